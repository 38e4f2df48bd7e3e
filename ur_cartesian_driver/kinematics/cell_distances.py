# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Distances between the arm, the bodies that it carries, and the other bodies of its cell.

Each link of the arm is measured in two steps: by the convex bodies that contain it
(:mod:`~.collision_bodies`) and, where these are too close, by its meshes, if the model has them. A
mesh of the cell is first measured by its bounding box. Before both steps, the spheres that cover
one body are compared with the other body, which is cheap enough for all pairs at once.

A pair consists of a body that moves, and a body that is fixed or carried by another link.
Distances of the arm to itself are in :mod:`~.collision_meshes`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from math import inf, pi
from typing import NamedTuple

import numpy as np

from ur_cartesian_driver.kinematics.cell_poses import T_carrier_body
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.collision_bodies import CollisionBodies, CONNECTOR, Link
from ur_cartesian_driver.kinematics.collision_meshes import missing_meshes
from ur_cartesian_driver.kinematics.link_shapes import (
    link_meshes,
    LinkFrames,
    LinkShape,
    mesh_tolerance,
    shortest_turn_of_z,
)
from ur_cartesian_driver.kinematics.solids import (
    CarrierFrames,
    Depths,
    distances,
    has_coal,
    Hull,
    Solid,
)
from ur_cartesian_driver.motion.cell.cell import Cell, LINK_NAMES
from ur_cartesian_driver.motion.cell.mesh_file import read_mesh
from ur_cartesian_driver.motion.cell.shapes import Cylinder, HalfSpace, Mesh
from ur_cartesian_driver.motion.geometry.arrays import Floats, Indices
from ur_cartesian_driver.motion.geometry.pose import Pose

# Number of corners of the polygon that contains a rim of a swept cylinder.
_RIM = 16
# A mesh is convex if no vertex is farther than this outside the plane of a triangle [m].
_FLAT = 2e-5
# Number of rows whose lower bounds are computed at once; few, to keep arrays in the CPU cache.
_ROWS = 256
# Distances are cut off this much above the bound, so that rounding brings none below it [m].
_ROUNDING = 1e-9
#: Number of carriers: the base and six links.
CARRIERS = 7


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Body:
    """A link of the arm, its tool, or a body of the cell."""

    name: str
    carrier: int
    #: Convex solids and half-spaces that contain the body.
    coarse: tuple[Solid, ...]
    #: The true shape of the body; the same as ``coarse`` if no better one is known.
    exact: tuple[Solid, ...]
    #: Distance to keep from the body [m]; 0 for the arm, so that the other body decides.
    clearance: float = 0.0
    #: By how much the exact solids may be too small [m].
    tolerance: float = 0.0


class _Opponents(NamedTuple):
    """Pairs of some first bodies with each of several second bodies on the same carrier."""

    #: The pair of each first body with each second one, (firsts, seconds).
    columns: Indices
    #: The carrier of the second bodies, and the distances of points from them.
    carrier: int
    depths: Depths
    #: The spheres that cover the first bodies, one body after the other: their indices and radii
    #: (k,) [m], and the place at which each body begins.
    points: Indices
    radii: Floats
    begins: Indices


def missing_coal(cell: Cell) -> str:
    """Return the reason why a cell cannot be measured, as a clause; '' if it can."""
    meshes = [body.name for body in cell.bodies if body.has_mesh]
    if not meshes or has_coal():
        return ''
    return (
        f'has the mesh "{meshes[0]}", but pinocchio, which measures meshes, is not installed; the '
        'extra `collision` brings it (boxes, cylinders, spheres and planes do not need it)'
    )


class Pair(NamedTuple):
    """Two bodies, by name, and the distance that they must keep [m]."""

    a: str
    b: str
    clearance: float


class CellDistances:
    """
    The distances of one arm, its tool and all bodies of a cell.

    :param T_flange_tcp: the active TCP, for bodies in ``tool0_controller``.
    :param cell: must have no meshes if :func:`missing_coal` returns a reason.
    :param tool_radius: radius of a cylinder from the flange to the tool's tip [m]; 0 = none.
    :param T_flange_tip: the tool's tip; None = the active TCP.
    """

    def __init__(
        self,
        arm: Arm,
        T_flange_tcp: Pose,
        cell: Cell,
        tool_radius: float = 0.0,
        T_flange_tip: Pose | None = None,
    ) -> None:
        """Place all bodies on their carriers."""
        self._frames = LinkFrames(arm)
        arm_bodies = _arm_bodies(arm, self._frames, T_flange_tip or T_flange_tcp, tool_radius)
        self._bodies = [*arm_bodies, *_cell_bodies(cell, self._frames, T_flange_tcp)]
        #: The numbers of the bodies of each pair, (pairs, 2); the first body moves.
        self._numbers = _pair_numbers(self._bodies, len(arm_bodies), cell)
        #: The measured pairs, in the order of the columns of distances.
        self.pairs = [
            Pair(
                self._bodies[a].name,
                self._bodies[b].name,
                max(self._bodies[a].clearance, self._bodies[b].clearance),
            )
            for a, b in self._numbers
        ]
        self.clearances = np.array([pair.clearance for pair in self.pairs])
        covers = [_cover(body) for body in self._bodies]
        #: Centres (k, 3) of spheres that cover the bodies, in the frames of their carriers (k,).
        self._centres = np.concatenate([centres for centres, _ in covers])
        counts = [len(centres) for centres, _ in covers]
        self._carriers_of_centres = np.repeat([body.carrier for body in self._bodies], counts)
        self._opponents = _opponents(self._bodies, self._numbers, covers)
        boxes = [_carrier_box(self._bodies, carrier) for carrier in range(CARRIERS)]
        #: Middles and half sides of the boxes around all bodies on a carrier, (carriers, 3) [m].
        self._middles, self._halves = (np.array(each) for each in zip(*boxes, strict=True))
        #: Bound on the distance from the base of anything on each carrier, (carriers,) [m].
        self.reaches = _reaches(arm, boxes)
        #: For each pair, the carriers of both bodies, (pairs, 2).
        self.carriers = np.array(
            [[self._bodies[a].carrier, self._bodies[b].carrier] for a, b in self._numbers],
            dtype=np.intp,
        ).reshape(-1, 2)
        #: Whether a joint connects the links that carry the bodies of each pair, (pairs,).
        self.are_neighbours = (self.carriers > 0).all(axis=1) & (
            np.abs(np.diff(self.carriers, axis=1)[:, 0]) == 1
        )

    def poses(self, q: Floats) -> Floats:
        """Return the poses of all carriers, (n, 7 carriers, 7), at joints (n, 6) [rad]."""
        return self._frames.poses(q)

    def box_points(self, poses: Floats) -> Floats:
        """
        Return middle and half axes of the boxes around all bodies on each carrier.

        A point of the box is the middle plus the three half axes, with factors from -1 to 1 on
        each. So no point moves farther than the sum of the changes of these four vectors.

        :param poses: (n, carriers, 7).
        :returns: (n, carriers, 4, 3) [m].
        """
        rotation, origin = _carrier_frames(poses)
        result = np.empty((*poses.shape[:2], 4, 3))
        result[:, :, 0] = np.einsum('ncij,cj->nci', rotation, self._middles) + origin
        result[:, :, 1:] = (rotation * self._halves[:, None]).swapaxes(2, 3)
        return result

    def lower_bounds(self, poses: Floats) -> Floats:
        """
        Return lower bounds (n, pairs) of the distances [m]; cheap, and often far too low.

        Bodies that overlap have a bound below 0, but may overlap more deeply than the bound.
        """
        result = np.empty((len(poses), len(self.pairs)))
        for begin in range(0, len(poses), _ROWS):
            rows = slice(begin, begin + _ROWS)
            self._bound(poses[rows], result[rows])
        return result

    def _bound(self, poses: Floats, result: Floats) -> None:
        """Write the lower bounds (n, pairs) at ``poses`` into ``result``."""
        rotation, origin = _carrier_frames(poses)
        carriers = self._carriers_of_centres
        points = np.einsum('nkij,kj->nki', rotation[:, carriers], self._centres)
        points += origin[:, carriers]
        for each in self._opponents:
            of_firsts = points[:, each.points]
            if each.carrier:
                frames = CarrierFrames(rotation[:, each.carrier], origin[:, each.carrier])
                of_firsts = frames.local(of_firsts)
            depths = each.depths.of(of_firsts)
            depths -= each.radii[:, None]
            result[:, each.columns] = np.minimum.reduceat(depths, each.begins, axis=1)

    def distances(
        self, column: int, poses: Floats, enough: float, most: Floats | None = None
    ) -> Floats:
        """
        Return the distances of one pair.

        :param poses: (n, carriers, 7).
        :param enough: a distance above this [m] need not be exact: a smaller value that is not
            below ``enough`` may be returned, which is faster.
        :param most: (n,) distances above this [m] may be cut off to it, which is faster, too;
            None = ``enough``.
        :returns: (n,) [m]; at most 0 where the bodies touch.
        """
        a, b = (self._bodies[number] for number in self._numbers[column])
        found = _between(a.coarse, a, b.coarse, b, poses)
        if a.exact is a.coarse and b.exact is b.coarse:
            return found
        near = np.flatnonzero(found < enough)
        if len(near):
            tolerance = a.tolerance + b.tolerance
            bound = (enough if most is None else most[near]) + (tolerance + _ROUNDING)
            exact = _between(a.exact, a, b.exact, b, poses[near], bound) - tolerance
            found[near] = np.maximum(found[near], exact)
        return found

    def pairs_below(self, q: Floats) -> list[tuple[Pair, float]]:
        """
        Return the pairs that are closer than their clearance at one configuration.

        :param q: (6,) [rad].
        :returns: each pair with its distance [m], the one farthest below its clearance first.
        """
        poses = self.poses(np.asarray(q, dtype=np.float64)[None])
        lower = self.lower_bounds(poses)[0]
        found = []
        for column in np.flatnonzero(lower < self.clearances).tolist():
            pair = self.pairs[column]
            distance = float(self.distances(column, poses, pair.clearance)[0])
            if distance < pair.clearance:
                found.append((pair, distance))
        return sorted(found, key=lambda each: each[1] - each[0].clearance)

    def closest(self, q: Floats) -> tuple[Floats, Indices]:
        """
        Return the smallest distance of all pairs at each configuration.

        :param q: (n, 6) [rad].
        :returns: the distances (n,) [m], and their pairs (n,) as indices into :attr:`pairs`.
        """
        poses = self.poses(q)
        lower = self.lower_bounds(poses)
        best, columns = np.full(len(q), np.inf), np.zeros(len(q), dtype=np.intp)
        # The pairs with the lowest bounds first: they rule out most others.
        for column in np.argsort(lower.min(axis=0)).tolist():
            rows = np.flatnonzero(lower[:, column] < best)
            if not len(rows):
                continue
            found = self.distances(column, poses[rows], float(best[rows].max()))
            nearer = rows[found < best[rows]]
            best[nearer] = found[found < best[rows]]
            columns[nearer] = column
        return best, columns


def _carrier_frames(poses: Floats) -> tuple[Floats, Floats]:
    """Return rotations (n, carriers, 3, 3) and origins (n, carriers, 3) of poses."""
    rotation, origin = CarrierFrames.of(poses.reshape(-1, 7))
    shape = poses.shape[:2]
    return rotation.reshape(*shape, 3, 3), origin.reshape(*shape, 3)


def _opponents(
    bodies: Sequence[_Body], numbers: Indices, covers: Sequence[tuple[Floats, Floats]]
) -> list[_Opponents]:
    """Return the pairs in groups whose bounds are found together."""
    groups: dict[tuple[int, tuple[int, ...]], list[tuple[int, Indices]]] = {}
    for second in np.unique(numbers[:, 1]).tolist():
        columns = np.flatnonzero(numbers[:, 1] == second)
        key = bodies[second].carrier, tuple(numbers[columns, 0].tolist())
        groups.setdefault(key, []).append((second, columns))
    counts = [len(centres) for centres, _ in covers]
    firsts_at = np.cumsum([0, *counts])
    return [
        _Opponents(
            columns=np.stack([columns for _, columns in group], axis=1),
            carrier=carrier,
            depths=Depths([bodies[second].coarse for second, _ in group]),
            points=np.concatenate([np.arange(firsts_at[a], firsts_at[a + 1]) for a in firsts]),
            radii=np.concatenate([covers[a][1] for a in firsts]),
            begins=np.cumsum([0, *(counts[a] for a in firsts[:-1])]),
        )
        for (carrier, firsts), group in groups.items()
    ]


def _between(
    solids_a: Sequence[Solid],
    a: _Body,
    solids_b: Sequence[Solid],
    b: _Body,
    poses: Floats,
    most: Floats | float = inf,
) -> Floats:
    """Return the smallest distances (n,) of the solids of two bodies, at most ``most`` [m]."""
    frames_a, frames_b = (
        CarrierFrames.of(poses[:, body.carrier] if body.carrier else poses[:1, 0])
        for body in (a, b)
    )
    found = [
        np.broadcast_to(distances(one, frames_a, other, frames_b, most), len(poses))
        for one, other in product(solids_a, solids_b)
    ]
    return np.array(np.min(found, axis=0))


def _arm_bodies(
    arm: Arm, frames: LinkFrames, T_flange_tcp: Pose, tool_radius: float
) -> list[_Body]:
    """Return the links of the arm, and its tool if it has a radius."""
    coarse: dict[Link, list[Solid]] = {}
    for link, radius, axes in CollisionBodies(arm, T_flange_tcp, tool_radius).hulls():
        carrier = min(link, Link.WRIST_3)
        T_link_base = frames.at_zero[carrier].inverse()
        coarse.setdefault(link, []).append(_hull_solid(radius, axes, T_link_base))
    name, tolerance = arm.model.name, 0.0
    exact: dict[Link, list[Solid]] = {}
    if not missing_meshes(name) and has_coal():
        tolerance = mesh_tolerance(name)
        for shape in link_meshes(name, 'collision'):
            exact.setdefault(shape.link, []).append(_link_solid(shape))
        # The meshes of the base lack the connector.
        exact[Link.BASE].append(coarse[Link.BASE][CONNECTOR])
    return [
        _Body(
            name=LINK_NAMES[link],
            carrier=min(link, Link.WRIST_3),
            coarse=(solids := tuple(coarse[link])),
            exact=tuple(exact[link]) if link in exact else solids,
            tolerance=tolerance if link in exact else 0.0,
        )
        for link in Link
        if link in coarse
    ]


def _hull_solid(radius: float, axes: Floats, T_link_base: Pose) -> Solid:
    """Return the convex hull of one or two cylinders in the frame of a link."""
    if len(axes) == 1:
        (start, end), *_ = axes
        vector = end - start
        length = float(np.linalg.norm(vector))
        x, y, z = (0.5 * (start + end)).tolist()
        T_base_middle = Pose((x, y, z), shortest_turn_of_z(*(vector / length).tolist()))
        return Solid(Cylinder(radius, length), T_link_base @ T_base_middle)
    direction = axes[0, 1] - axes[0, 0]
    direction /= np.linalg.norm(direction)
    across = np.linalg.svd(direction[None])[2][1:]
    angles = 2.0 * pi / _RIM * np.arange(_RIM)
    rim = np.stack([np.cos(angles), np.sin(angles)], axis=1) @ across
    rim *= radius / np.cos(pi / _RIM)
    points = (axes.reshape(-1, 1, 3) + rim).reshape(-1, 3)
    return Solid(Hull(points), T_link_base)


def _link_solid(shape: LinkShape) -> Solid:
    """Return the mesh or cylinder of a link; a convex mesh becomes a hull, which is faster."""
    if shape.mesh is None:
        return Solid(Cylinder(shape.radius, shape.length), shape.T_link_shape)
    return Solid(_read_link_mesh(str(shape.mesh)), shape.T_link_shape)


def _is_convex(mesh: Mesh) -> bool:
    """Return whether no vertex is outside the plane of a triangle by more than ``_FLAT``."""
    corners = mesh.vertices[mesh.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-300)[:, None]
    heights = mesh.vertices @ normals.T - np.einsum('ni,ni->n', corners[:, 0], normals)
    return bool(heights.max() < _FLAT)


@lru_cache
def _read_link_mesh(file: str) -> Mesh | Hull:
    mesh = read_mesh(file)
    return Hull(mesh.vertices) if _is_convex(mesh) else mesh


def _cell_bodies(cell: Cell, frames: LinkFrames, T_flange_tcp: Pose) -> Iterator[_Body]:
    for body in cell.bodies:
        carrier, T_carrier = T_carrier_body(body, frames, T_flange_tcp)
        exact = tuple(Solid(each.shape, T_carrier @ each.T_body_shape) for each in body.shapes)
        coarse = tuple(solid.box if isinstance(solid.shape, Mesh) else solid for solid in exact)
        yield _Body(
            name=body.name,
            carrier=carrier,
            coarse=coarse,
            exact=exact if body.has_mesh else coarse,
            clearance=cell.clearance_of(body),
        )


def _pair_numbers(bodies: Sequence[_Body], arm_count: int, cell: Cell) -> Indices:
    """Return the numbers of the two bodies of each measured pair, (pairs, 2)."""
    pairs = []
    for b in range(arm_count, len(bodies)):
        for a in range(b):
            first, second = bodies[a], bodies[b]
            if first.carrier == second.carrier:
                continue
            if frozenset((first.name, second.name)) in cell.may_touch:
                continue
            # The first body has to move. So it is never a half-space, which is always fixed.
            pairs.append((a, b) if first.carrier else (b, a))
    return np.array(pairs, dtype=np.intp).reshape(-1, 2)


def _reaches(arm: Arm, boxes: Sequence[tuple[Floats, Floats]]) -> Floats:
    geometry = arm.model.geometry
    lengths = np.hypot(geometry.a, geometry.d)
    return np.array(
        [
            lengths[:carrier].sum() + np.linalg.norm(np.abs(middle) + half)
            for carrier, (middle, half) in enumerate(boxes)
        ]
    )


def _cover(body: _Body) -> tuple[Floats, Floats]:
    """
    Return centres (k, 3) in the carrier's frame and radii (k,) of spheres that cover a body.

    Spheres cannot cover a half-space, so it has none.
    """
    if any(isinstance(solid.shape, HalfSpace) for solid in body.coarse):
        return np.empty((0, 3)), np.empty(0)
    spheres = [solid.spheres() for solid in body.coarse]
    return np.concatenate([c for c, _ in spheres]), np.concatenate([r for _, r in spheres])


def _carrier_box(bodies: Sequence[_Body], carrier: int) -> tuple[Floats, Floats]:
    """Return middle and half sides (3,) of the box around all bodies of a carrier [m]."""
    corners = [
        solid.corners()
        for body in bodies
        if body.carrier == carrier
        for solid in body.coarse
        if not isinstance(solid.shape, HalfSpace)
    ]
    if not corners:
        return np.zeros(3), np.zeros(3)
    points = np.concatenate(corners)
    low, high = points.min(axis=0), points.max(axis=0)
    return 0.5 * (low + high), 0.5 * (high - low)
