# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Random cells, and a judge of their distances that shares no computation with the package.

Solids are surfaces of triangles. A cylinder has two surfaces, one inside of it and one around it;
a sphere is a point with a radius. Carried bodies move with pinocchio's kinematics, and bodies on
the tool with textbook matrices.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import cos, inf, pi, sin
from pathlib import Path

from collision_shapes import body_surfaces
from forward_model import dh_forward, pose_matrix
import numpy as np
from triangle_distance import (
    box_surface,
    cylinder_surfaces,
    encloses,
    hull_surface,
    moved,
    triangle_distance,
)

from ur_cartesian_driver.kinematics.chain import Arm, pinocchio_model
from ur_cartesian_driver.kinematics.collision_bodies import CollisionBodies, Link
from ur_cartesian_driver.kinematics.collision_meshes import missing_meshes
from ur_cartesian_driver.kinematics.link_shapes import connector_shape, link_meshes, LinkFrames
from ur_cartesian_driver.kinematics.robot_models import MODELS
from ur_cartesian_driver.motion.cell.cell import Cell, CellBody, LINK_NAMES, PlacedShape
from ur_cartesian_driver.motion.cell.shapes import Box, Cylinder, HalfSpace, Mesh, Sphere
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.sim.calibration import random_calibration

MODEL_NAMES = ('ur3', 'ur5', 'ur10', 'ur3e', 'ur5e', 'ur10e', 'ur16e', 'ur20')
LINKS = ('shoulder', 'upper_arm', 'forearm', 'wrist_1', 'wrist_2', 'wrist_3')
ON_TOOL = ('tool0', 'flange', 'tool0_controller')
_LINK_OF = {'base': 0, 'base_link': 0} | {f'{name}_link': k + 1 for k, name in enumerate(LINKS)}


def matrix(rotation, position=(0.0, 0.0, 0.0)):
    """Return a matrix (4, 4) of a rotation and a position."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = rotation, position
    return T


#: ``base`` is turned by 180 degrees against ``base_link``; x of ``flange`` is z of ``tool0``.
T_BASE_BASE_LINK = matrix(np.diag((-1.0, -1.0, 1.0)))
T_TOOL0_FLANGE = matrix(np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]]))


# -- draws ----------------------------------------------------------------------------------------


def random_pose(rng, middle=(0.0, 0.0, 0.0), spread=0.1):
    """Return a pose near a place, with any rotation."""
    quaternion = rng.normal(size=4)
    position = np.array(middle) + rng.uniform(-spread, spread, 3)
    return Pose(
        tuple(position.tolist()), tuple((quaternion / np.linalg.norm(quaternion)).tolist())
    )


def random_arm(rng, name=None):
    """Return an arm of any model, calibrated in half of the cases."""
    name = str(rng.choice(MODEL_NAMES)) if name is None else name
    calibrated = rng.random() < 0.5
    return Arm(
        MODELS[name],
        random_calibration(MODELS[name], int(rng.integers(20))) if calibrated else None,
    )


def plate(rng, cells=8, size=0.3, bumps=0.02):
    """Return an open, bumpy plate of 2 * cells**2 triangles."""
    x, y = np.meshgrid(*[np.linspace(-size / 2, size / 2, cells + 1)] * 2)
    points = np.stack([x, y, bumps * rng.uniform(-1.0, 1.0, x.shape)], axis=-1).reshape(-1, 3)
    corner = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    one = np.stack([corner, corner + 1, corner + cells + 1], axis=1)
    other = np.stack([corner + 1, corner + cells + 2, corner + cells + 1], axis=1)
    return Mesh(points, np.concatenate([one, other]))


def ring(rng, n=12, m=8):
    """Return a closed torus, stretched a little."""
    large, small = rng.uniform(0.08, 0.2), rng.uniform(0.01, 0.05)
    u, v = np.meshgrid(*[2.0 * pi / k * np.arange(k) for k in (n, m)], indexing='ij')
    around = large + small * np.cos(v)
    points = np.stack([around * np.cos(u), around * np.sin(u), small * np.sin(v)], axis=-1)
    i, k = (each.ravel() for each in np.meshgrid(range(n), range(m), indexing='ij'))
    a, b = i * m + k, (i + 1) % n * m + k
    c, d = (i + 1) % n * m + (k + 1) % m, i * m + (k + 1) % m
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return Mesh(points.reshape(-1, 3) * rng.uniform(0.7, 1.3, 3), faces)


def loose_triangles(rng, count=15):
    """Return triangles that are not connected."""
    corners = rng.uniform(-0.15, 0.15, (count, 1, 3)) + rng.uniform(-0.05, 0.05, (count, 3, 3))
    return Mesh(corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3))


def random_shape(rng, meshes=True, largest=0.4):
    """Return a box, a cylinder, a sphere or a mesh, from thin to large."""
    kind = int(rng.integers(6 if meshes else 3))
    size = np.exp(rng.uniform(np.log(0.001), np.log(largest), 3))
    if kind == 0:
        return Box(tuple(size.tolist()))
    if kind == 1:
        return Cylinder(max(0.01, 0.5 * float(size[0])), float(size[1]))
    if kind == 2:
        return Sphere(0.5 * float(size.max()))
    return (plate, ring, loose_triangles)[kind - 3](rng)


def random_cell(rng, places, *, carried=True, meshes=True, spread=0.3, largest=0.4):
    """
    Return a cell of up to ten bodies, most of them near places (n, 3) that the arm may reach.

    :param carried: whether links and tool carry some of the bodies.
    :param spread: distance of the bodies from the places [m].
    :param largest: largest size of boxes, cylinders and spheres [m].
    """
    bodies = []
    for k in range(int(rng.integers(1, 7))):
        count = 1 if rng.random() < 0.7 else int(rng.integers(2, 4))
        placed = tuple(
            PlacedShape(random_shape(rng, meshes, largest), random_pose(rng)) for _ in range(count)
        )
        middle = places[rng.integers(len(places))]
        pose = random_pose(rng, middle, spread)
        if rng.random() < 0.1:
            placed = (PlacedShape(HalfSpace(), random_pose(rng)),)
            pose = random_pose(rng, 1.5 * np.array(middle))
        bodies.append(
            CellBody(
                name=f'fixed {k}',
                shapes=placed,
                T_frame_body=pose,
                clearance=None if rng.random() < 0.7 else float(rng.uniform(0.0, 0.03)),
            )
        )
        if rng.random() < 0.2:
            turned = np.linalg.inv(T_BASE_BASE_LINK) @ pose_matrix(pose)
            bodies[-1] = _placed_in(bodies[-1], 'base_link', turned)
    for k in range(int(rng.integers(0, 4)) if carried else 0):
        frame = str(rng.choice((*ON_TOOL, *(f'{name}_link' for name in LINKS))))
        shapes = tuple(
            PlacedShape(random_shape(rng, meshes, 0.15), random_pose(rng, spread=0.05))
            for _ in range(1 + (rng.random() < 0.3))
        )
        pose = random_pose(rng, (0.0, 0.0, 0.08), 0.05)
        bodies.append(CellBody(name=f'held {k}', shapes=shapes, frame=frame, T_frame_body=pose))
    return Cell(bodies=tuple(bodies), clearance=float(rng.choice((0.0, 0.002, 0.005, 0.02))))


def _placed_in(body, frame, T):
    """Return a fixed body in another frame of the base, turned by 180 degrees about z."""
    x, y, z, w = body.T_frame_body.quaternion
    # A turn by 180 degrees about z is the quaternion (0, 0, 1, 0).
    return CellBody(
        name=body.name,
        shapes=body.shapes,
        frame=frame,
        T_frame_body=Pose(tuple(T[:3, 3].tolist()), (-y, x, w, -z)),
        clearance=body.clearance,
    )


# -- solids ---------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Part:
    """
    A solid in the frame of its carrier.

    :param inner: a surface inside of it; ``outer``: one around it; the same surface if exact.
    :param radius: a radius around both; a sphere is a point with a radius.
    :param T: the pose of the surfaces on the carrier (4, 4).
    """

    inner: np.ndarray
    outer: np.ndarray
    T: np.ndarray
    radius: float = 0.0
    #: Whether the inside of the surface belongs to the solid, and whether it may count as such.
    is_solid: bool = True
    may_be_solid: bool = True
    is_half_space: bool = False


def box_of(part):
    """Return the corners of the box around a part, in its frame (1, 8, 3)."""
    low, high = (
        part.outer.min(axis=(0, 1)) - part.radius,
        part.outer.max(axis=(0, 1)) + part.radius,
    )
    return np.array(np.meshgrid(*zip(low, high, strict=True))).reshape(3, -1).T[None]


def exact(surface, T, **more):
    """Return the part with exactly this surface."""
    return Part(surface, surface, T, **more)


def part_of(shape, T):
    """Return the part of a shape of the cell."""
    if isinstance(shape, HalfSpace):
        return exact(np.empty((0, 3, 3)), T, is_half_space=True)
    if isinstance(shape, Sphere):
        return exact(np.zeros((1, 3, 3)), T, radius=shape.radius)
    if isinstance(shape, Box):
        return exact(box_surface(shape.size), T)
    if isinstance(shape, Cylinder):
        inner, outer = _prisms(shape.radius, shape.length)
        return Part(inner, outer, T)
    assert isinstance(shape, Mesh)
    return exact(shape.vertices[shape.triangles], T, is_solid=False, may_be_solid=False)


_prisms = lru_cache(cylinder_surfaces)


def part_distances(a, T_a, b, T_b):
    """Return a lower and an upper bound of the distance of two parts [m]."""
    if a.is_half_space:
        a, T_a, b, T_b = b, T_b, a, T_a
    T = np.linalg.inv(T_b @ b.T) @ T_a @ a.T
    if b.is_half_space:
        heights = [moved(each, T)[..., 2].min() - a.radius for each in (a.outer, a.inner)]
        return tuple(heights)
    found = []
    for k, (one, other) in enumerate(((a.outer, b.outer), (a.inner, b.inner))):
        one = moved(one, T)
        if k == 0 or not (a.inner is a.outer and b.inner is b.outer):
            apart = triangle_distance(one, other)
        distance = apart
        for part, surface, point in ((a, one, other[0, 0]), (b, other, one[0, 0])):
            counts = part.is_solid if k else part.may_be_solid
            if counts and len(surface) > 1 and encloses(surface, point):
                distance = 0.0
        found.append(distance - a.radius - b.radius)
    return found[0], found[1]


class CellJudge:
    """
    The bodies of a cell and of an arm, and their distances.

    :param tcp: the TCP on the flange.
    """

    def __init__(self, arm, tcp, cell):
        self.arm, self.cell = arm, cell
        self._tcp = pose_matrix(tcp)
        self._model = pinocchio_model(arm)
        self._data = self._model.createData()
        self._at_zero = [pose_matrix(pose) for pose in LinkFrames(arm).at_zero]
        joints = self._joints(np.zeros(6))
        self._T_joint_link = [
            np.linalg.inv(joint) @ link for joint, link in zip(joints, self._at_zero, strict=True)
        ]
        self.carriers, self.parts = {}, {}
        for body in cell.bodies:
            T = pose_matrix(body.T_frame_body)
            if body.frame == 'base_link':
                T = T_BASE_BASE_LINK @ T
            elif body.frame == 'flange':
                T = T_TOOL0_FLANGE @ T
            elif body.frame == 'tool0_controller':
                T = self._tcp @ T
            self.carriers[body.name] = 7 if body.frame in ON_TOOL else _LINK_OF[body.frame]
            self.parts[body.name] = [
                part_of(each.shape, T @ pose_matrix(each.T_body_shape)) for each in body.shapes
            ]
        self.has_meshes = not missing_meshes(arm.model.name)
        if self.has_meshes:
            for link, parts in zip(LINK_NAMES, _mesh_parts(arm), strict=False):
                self.carriers[link], self.parts[link] = LINK_NAMES.index(link), parts
        else:
            self._add_bodies()

    def _add_bodies(self):
        """Add the bodies that contain the links; rims of 24 corners make them a little smaller."""
        bodies = CollisionBodies(self.arm)
        surfaces = body_surfaces(bodies, np.zeros(6))
        for link in Link:
            if link is Link.TOOL:
                continue
            T = np.linalg.inv(self._at_zero[link])
            self.carriers[LINK_NAMES[link]] = int(link)
            self.parts[LINK_NAMES[link]] = [
                exact(hull_surface(points), T)
                for points, of in zip(surfaces, bodies.links, strict=True)
                if of == link
            ]

    def _joints(self, q):
        """Return the frames of the base and of pinocchio's joints (4, 4) at joints (6,)."""
        import pinocchio

        pinocchio.forwardKinematics(self._model, self._data, np.asarray(q, dtype=float))
        return [np.eye(4), *(self._data.oMi[k].homogeneous.copy() for k in range(1, 7))]

    def frames(self, q):
        """Return the frames of base, links and flange (8, 4, 4) at joints (6,) [rad]."""
        links = [T @ zero for T, zero in zip(self._joints(q), self._T_joint_link, strict=True)]
        return np.array([*links, dh_forward(self.arm.geometry, q)])

    def distances(self, a, b, frames):
        """
        Return bounds of the distance of two bodies, by name [m].

        :returns: a lower and an upper bound; both are 0 or less if the bodies touch.
        """
        low, high = inf, inf
        for one in self.parts[a]:
            for other in self.parts[b]:
                found = part_distances(
                    one, frames[self.carriers[a]], other, frames[self.carriers[b]]
                )
                low, high = min(low, found[0]), min(high, found[1])
        return low, high


@lru_cache
def _connector(arm):
    shape = connector_shape(arm)
    return part_of(Cylinder(shape.radius, shape.length), pose_matrix(shape.T_link_shape))


@lru_cache
def _mesh_parts(arm):
    """Return the parts of each link, by the texts of their files."""
    found = [[] for _ in (*LINKS, 'base')]
    for shape in link_meshes(arm.model.name, 'collision'):
        T = pose_matrix(shape.T_link_shape)
        if shape.mesh is None:
            found[shape.link].append(part_of(Cylinder(shape.radius, shape.length), T))
        else:
            # A body wholly inside of a link does not touch its surface, but its convex hull.
            found[shape.link].append(exact(file_surface(shape.mesh), T, is_solid=False))
    found[0].append(_connector(arm))
    return found


@lru_cache
def file_surface(file: Path):
    """Return the triangles of an OBJ file, or of a binary STL file."""
    if file.suffix == '.stl':
        record = np.dtype([('normal', '<f4', 3), ('corners', '<f4', (3, 3)), ('rest', '<u2')])
        return np.fromfile(file, record, offset=84)['corners'].astype(float)
    lines = [line.split() for line in file.read_text().splitlines()]
    points = np.array([words[1:4] for words in lines if words[:1] == ['v']], dtype=float)
    corners = [
        [int(word.split('/')[0]) - 1 for word in words[1:]]
        for words in lines
        if words[:1] == ['f']
    ]
    return points[np.array(corners)]


def turned(axis, angle):
    """Return a matrix (4, 4) of a turn about an axis of base."""
    c, s = cos(angle), sin(angle)
    i, k = {'x': (1, 2), 'y': (2, 0), 'z': (0, 1)}[axis]
    T = np.eye(4)
    T[i, i] = T[k, k] = c
    T[k, i], T[i, k] = s, -s
    return T
