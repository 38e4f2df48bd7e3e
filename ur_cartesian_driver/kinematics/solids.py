# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Solids in the frame of a carrier, and their distances for rows of poses.

coal measures exactly; it is a part of pinocchio and optional. Without it, convex solids are
measured here: their separation along any direction is never larger than their distance, and
Gilbert's algorithm improves the direction (E. G. Gilbert, An iterative procedure for computing
the minimum of a quadratic form on a convex set, 1966). Half-spaces never need coal: the lowest
point of the other solid decides.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from math import ceil, inf
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from ur_cartesian_driver.motion.cell.shapes import Box, Cylinder, HalfSpace, Mesh, Shape, Sphere
from ur_cartesian_driver.motion.geometry.arrays import Floats, Indices
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import vector3

# Number of directions to try without coal: the bound is then within a millimetre for most pairs.
_ROUNDS = 60
_TINY = 1e-300
# Solids that touch count as overlapping by this at least [m], as a clearance of 0 forbids contact.
_TOUCH = 1e-9
# Smallest bound for coal, which would miss contacts with a smaller one [m].
_MIN_BOUND = 0.001
# To be covered by spheres, a long solid is divided into parts that are at most _STRETCH times as
# long as wide, but into at most _MAX_SPHERES parts; a sphere covers each part.
_STRETCH, _MAX_SPHERES = 1.5, 8


@dataclass(frozen=True, slots=True, eq=False)
class Hull:
    """The convex hull of points (n, 3) [m]."""

    points: Floats

    @property
    def bounds(self) -> Floats:
        """The lowest and the highest corner, (2, 3) [m]."""
        return np.array([self.points.min(axis=0), self.points.max(axis=0)])


SolidShape: TypeAlias = Shape | Hull


class CarrierFrames(NamedTuple):
    """Rotation matrices (n, 3, 3) and origins (n, 3) [m] of a carrier; one row = it is fixed."""

    rotation: Floats
    origin: Floats

    @classmethod
    def of(cls, poses: Floats) -> CarrierFrames:
        """Return the frames of poses (n, 7)."""
        x, y, z, w = poses[:, 3:].T
        rotation = np.empty((len(poses), 3, 3))
        rotation[:, 0, 0], rotation[:, 0, 1] = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w)
        rotation[:, 0, 2], rotation[:, 1, 0] = 2.0 * (x * z + y * w), 2.0 * (x * y + z * w)
        rotation[:, 1, 1], rotation[:, 1, 2] = 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)
        rotation[:, 2, 0], rotation[:, 2, 1] = 2.0 * (x * z - y * w), 2.0 * (y * z + x * w)
        rotation[:, 2, 2] = 1.0 - 2.0 * (x * x + y * y)
        return cls(rotation, poses[:, :3])

    def local(self, points: Floats) -> Floats:
        """Return points (n, k, 3), given in base, in the frame of the carrier."""
        inside: Floats = np.matmul(points - self.origin[:, None], self.rotation)
        return inside


class Solid:
    """
    A shape in the frame of its carrier. Immutable.

    :param T_carrier_shape: the pose of the shape in the frame of the carrier.
    """

    def __init__(self, shape: SolidShape, T_carrier_shape: Pose) -> None:
        self.shape, self._T_carrier_shape = shape, T_carrier_shape
        matrix = T_carrier_shape.matrix()
        self._rotation, self._position = matrix[:3, :3], matrix[:3, 3]

    def frames(self, carrier: CarrierFrames) -> CarrierFrames:
        """Return the frames of the shape in base."""
        return CarrierFrames(
            carrier.rotation @ self._rotation,
            carrier.rotation @ self._position + carrier.origin,
        )

    def corners(self) -> Floats:
        """Return the corners of its bounding box in the carrier's frame, (8, 3) [m]."""
        low, high = self.shape.bounds
        grid = np.array(np.meshgrid(*zip(low, high, strict=True))).reshape(3, -1).T
        corners: Floats = grid @ self._rotation.T + self._position
        return corners

    @cached_property
    def box(self) -> Solid:
        """The bounding box of the shape, at the same place."""
        low, high = self.shape.bounds
        x, y, z = (0.5 * (low + high)).tolist()
        box = Box(vector3(np.maximum(high - low, 1e-6).tolist()))
        return Solid(box, self._T_carrier_shape @ Pose((x, y, z)))

    def spheres(self) -> tuple[Floats, Floats]:
        """Return centres (k, 3) in the carrier's frame and radii (k,) of spheres that cover it."""
        low, high = self.shape.bounds
        size = high - low
        axis = int(np.argmax(size))
        across = float(np.linalg.norm(np.delete(size, axis)))
        if isinstance(self.shape, Cylinder) and axis == 2:
            across = 2.0 * self.shape.radius
        count = min(_MAX_SPHERES, max(1, ceil(size[axis] / max(_STRETCH * across, 1e-9))))
        part = size[axis] / count
        centres = np.tile(0.5 * (low + high), (count, 1))
        centres[:, axis] = low[axis] + part * (np.arange(count) + 0.5)
        if isinstance(self.shape, Sphere):
            return centres @ self._rotation.T + self._position, np.array([self.shape.radius])
        radius = 0.5 * float(np.hypot(part, across))
        return centres @ self._rotation.T + self._position, np.full(count, radius)

    def supports(self, directions: Floats, frames: CarrierFrames) -> Floats:
        """
        Return the points (n, 3) in base that are the farthest along unit vectors (n, 3).

        :param frames: the frames of the shape, from :meth:`frames`.
        """
        along = np.einsum('nji,nj->ni', frames.rotation, directions)
        shape = self.shape
        if isinstance(shape, Box):
            local = np.where(along < 0.0, -0.5, 0.5) * np.array(shape.size)
        elif isinstance(shape, Sphere):
            local = shape.radius * along
        elif isinstance(shape, Cylinder):
            radial = np.maximum(np.hypot(along[:, 0], along[:, 1]), _TINY)
            local = along * (shape.radius / radial)[:, None]
            local[:, 2] = np.where(along[:, 2] < 0.0, -0.5, 0.5) * shape.length
        else:
            points = self._hull_points
            local = points[np.argmax(along @ points.T, axis=1)]
        farthest: Floats = np.einsum('nij,nj->ni', frames.rotation, local) + frames.origin
        return farthest

    @cached_property
    def _hull_points(self) -> Floats:
        """The points that span the convex hull of a hull or mesh, (k, 3)."""
        if isinstance(self.shape, Hull):
            return self.shape.points
        assert isinstance(self.shape, Mesh)
        return self.shape.vertices

    @cached_property
    def geometry(self) -> Any:
        """The shape as an object of coal."""
        shape = self.shape
        if isinstance(shape, Box):
            return coal().Box(*shape.size)
        if isinstance(shape, Sphere):
            return coal().Sphere(shape.radius)
        if isinstance(shape, Cylinder):
            return coal().Cylinder(shape.radius, shape.length)
        if isinstance(shape, Hull):
            return coal().ConvexBase.convexHull(_vectors(shape.points), False, '')
        assert isinstance(shape, Mesh)
        return _tree(shape)


class Depths:
    """
    Signed distances of points from bodies on one carrier, negative inside; for all bodies at once.

    :param bodies: one or more solids of each body.
    """

    def __init__(self, bodies: Sequence[Sequence[Solid]]) -> None:
        solids = [solid for body in bodies for solid in body]
        shapes = [solid.shape for solid in solids]
        self._begins = np.cumsum([0, *(len(body) for body in bodies[:-1])])
        self._rotation = np.concatenate([solid._rotation for solid in solids], axis=1)
        #: From the carrier's origin to the middle of each solid, along the solid's axes.
        self._middles = np.array([solid._position @ solid._rotation for solid in solids])
        self._planes = _indices(shapes, HalfSpace)
        self._spheres = _indices(shapes, Sphere)
        self._cylinders = _indices(shapes, Cylinder)
        rest = np.setdiff1d(
            np.arange(len(shapes)), [*self._planes, *self._spheres, *self._cylinders]
        )
        self._boxes = rest.astype(np.intp)
        self._radii = np.array([getattr(shape, 'radius', 0.0) for shape in shapes])
        #: Half sides of the bounding boxes; of cylinders, only the height is used.
        self._halves = np.zeros((len(shapes), 3))
        for k in (*self._boxes.tolist(), *self._cylinders.tolist()):
            low, high = shapes[k].bounds
            self._halves[k] = 0.5 * (high - low)
            self._middles[k] += 0.5 * (low + high)

    def of(self, points: Floats) -> Floats:
        """
        Return lower bounds of the signed distances of points from the bodies, negative inside.

        :param points: (n, k, 3) in the frame of the carrier [m].
        :returns: (n, k, bodies) [m]; exact for boxes, cylinders, spheres and half-spaces, else
            from the bounding box.
        """
        shape = (*points.shape[:2], len(self._middles))
        inside = (points @ self._rotation).reshape(*shape, 3) - self._middles
        depths: Floats = np.empty(shape)
        if len(planes := self._planes):
            depths[..., planes] = inside[..., planes, 2]
        if len(spheres := self._spheres):
            depths[..., spheres] = _norms(inside[..., spheres, :]) - self._radii[spheres]
        if len(cylinders := self._cylinders):
            part = inside[..., cylinders, :]
            across = np.hypot(part[..., 0], part[..., 1]) - self._radii[cylinders]
            along = np.abs(part[..., 2]) - self._halves[cylinders, 2]
            depths[..., cylinders] = _signed(np.stack([across, along], axis=-1))
        if len(boxes := self._boxes):
            depths[..., boxes] = _signed(np.abs(inside[..., boxes, :]) - self._halves[boxes])
        if len(self._begins) < len(self._middles):
            depths = np.minimum.reduceat(depths, self._begins, axis=2)
        return depths


def _indices(shapes: Sequence[SolidShape], kind: type) -> Indices:
    found = [k for k, shape in enumerate(shapes) if isinstance(shape, kind)]
    return np.array(found, dtype=np.intp)


def _norms(vectors: Floats) -> Floats:
    norms: Floats = np.sqrt(np.einsum('...i,...i', vectors, vectors))
    return norms


def _signed(beyond: Floats) -> Floats:
    """Return signed distances, given how far points are beyond each pair of parallel sides."""
    distances = _norms(np.maximum(beyond, 0.0))
    distances += np.minimum(beyond.max(axis=-1), 0.0)
    return distances


def distances(
    a: Solid,
    frames_a: CarrierFrames,
    b: Solid,
    frames_b: CarrierFrames,
    most: Floats | float = inf,
) -> Floats:
    """
    Return the distances of two solids.

    :param frames_a: n frames of the carrier, or one if it is fixed; the same for ``b``.
    :param most: larger distances may be replaced by this one (n,) [m]; far from a mesh, that is a
        thousand times as fast.
    :returns: (n,) [m]; negative where solids overlap or meshes touch, and then the true depth only
        if both solids are convex. Without coal, a lower bound of the distance.
    """
    own_a, own_b = a.frames(frames_a), b.frames(frames_b)
    for half_space, plane, other, place in ((a, own_a, b, own_b), (b, own_b, a, own_a)):
        if isinstance(half_space.shape, HalfSpace):
            return _heights(plane, other, place)
    if has_coal():
        return _measured(a.geometry, own_a, b.geometry, own_b, most)
    return _separations(a, own_a, b, own_b)


def _heights(plane: CarrierFrames, other: Solid, place: CarrierFrames) -> Floats:
    """Return the heights (n,) of a solid's lowest points above a half-space."""
    rotation, origin, *_ = np.broadcast_arrays(
        plane.rotation, plane.origin[:, None], place.rotation
    )
    normals, origins = rotation[:, :, 2], origin[:, 0]
    lowest = other.supports(-normals, place)
    heights: Floats = np.einsum('ni,ni->n', normals, lowest - origins)
    return heights


def _measured(
    a: Any, frames_a: CarrierFrames, b: Any, frames_b: CarrierFrames, most: Floats | float
) -> Floats:
    request, result = coal().DistanceRequest(), coal().DistanceResult()
    measure = coal().distance
    found = []
    rows, other_rows = _transforms(frames_a, frames_b)
    # coal leaves out parts of a mesh that are no nearer than min_distance, the least distance so
    # far. So the search begins with the bound there.
    bounds = np.broadcast_to(np.clip(most, _MIN_BOUND, result.min_distance), len(rows))
    for T_a, T_b, bound in zip(rows, other_rows, bounds.tolist(), strict=True):
        result.clear()
        result.min_distance = bound
        found.append(measure(a, T_a, b, T_b, request, result))
    # For two meshes that pass through each other, coal returns 0.
    return np.where(np.array(found) > 0.0, found, np.minimum(found, -_TOUCH))


def _transforms(frames_a: CarrierFrames, frames_b: CarrierFrames) -> Iterator[Sequence[Any]]:
    """Yield the transforms of both solids as objects of coal, equally many of each."""
    count = max(len(frames_a.origin), len(frames_b.origin))
    for frames in (frames_a, frames_b):
        rows = [coal().Transform3s(R, t) for R, t in zip(*frames, strict=True)]
        yield rows if len(rows) == count else rows * count


def _separations(a: Solid, frames_a: CarrierFrames, b: Solid, frames_b: CarrierFrames) -> Floats:
    """Return lower bounds (n,) of the distances of two convex solids."""
    count = max(len(frames_a.origin), len(frames_b.origin))
    frames_a, frames_b = (
        CarrierFrames(
            np.broadcast_to(each.rotation, (count, 3, 3)),
            np.broadcast_to(each.origin, (count, 3)),
        )
        for each in (frames_a, frames_b)
    )
    gap = frames_a.origin - frames_b.origin
    gap = np.where(np.abs(gap).max(axis=1, keepdims=True) > 0.0, gap, (0.0, 0.0, 1e-9))
    bound = np.full(count, -np.inf)
    # The directions of all faces are tried first, because Gilbert's algorithm takes many rounds
    # to find the direction of the wide face of a plate.
    axes = np.concatenate([frames_a.rotation, frames_b.rotation], axis=2).transpose(2, 0, 1)
    for axis in axes:
        direction = np.where(np.einsum('ni,ni->n', axis, gap)[:, None] < 0.0, -axis, axis)
        corner = a.supports(-direction, frames_a) - b.supports(direction, frames_b)
        bound = np.maximum(bound, np.einsum('ni,ni->n', direction, corner))
    for _ in range(_ROUNDS):
        length = np.linalg.norm(gap, axis=1)
        direction = gap / np.maximum(length, _TINY)[:, None]
        corner = a.supports(-direction, frames_a) - b.supports(direction, frames_b)
        # Without a length there is no direction, and the solids overlap.
        separation = np.where(length > 0.0, np.einsum('ni,ni->n', direction, corner), -np.inf)
        bound = np.maximum(bound, separation)
        step = gap - corner
        part = np.einsum('ni,ni->n', gap, step) / np.maximum(
            np.einsum('ni,ni->n', step, step), _TINY
        )
        gap = gap - np.clip(part, 0.0, 1.0)[:, None] * step
    return bound


@lru_cache
def has_coal() -> bool:
    """Return whether coal is installed."""
    try:
        coal()
    except ImportError:
        return False
    return True


@lru_cache
def coal() -> Any:
    """
    Return the module of pinocchio's shapes, which has another name in older versions.

    :raises ImportError: it is not installed.
    """
    try:
        import coal
    except ImportError:
        import hppfcl as coal
    return coal


def _vectors(points: Floats) -> Any:
    vectors = coal().StdVec_Vec3s()
    vectors.extend(list(points))
    return vectors


@lru_cache(maxsize=64)
def _tree(mesh: Mesh) -> Any:
    """Return coal's bounding-volume tree of a mesh, without the triangles that have no area."""
    corners = mesh.vertices[mesh.triangles]
    areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    used = mesh.triangles[np.abs(areas).max(axis=1) > 0.0]
    triangles = coal().StdVec_Triangle()
    triangle = coal().Triangle
    triangles.extend([triangle(*row) for row in used.tolist()])
    tree = coal().BVHModelOBBRSS()
    tree.beginModel(len(used), len(mesh.vertices))
    tree.addSubModel(_vectors(mesh.vertices), triangles)
    tree.endModel()
    return tree
