# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The shapes of bodies.

A shape has a frame of its own: boxes, cylinders and spheres are centred on its origin, and the
axis of a cylinder is z. A half-space is solid below z = 0.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import inf, isfinite
from typing import TypeAlias

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Floats, Indices
from ur_cartesian_driver.motion.geometry.vectors import Vector3

#: Largest size of a shape [m]; a larger one is probably given in millimetres.
MAX_SIZE = 50.0
#: Corners of a mesh that are closer than this count as one [m].
_SAME_PLACE = 1e-6


def _check_size(name: str, value: float) -> None:
    if not (isfinite(value) and 0.0 < value <= MAX_SIZE):
        raise ValueError(
            f'{name} is {value:g}; it must be greater than 0 and at most {MAX_SIZE:g} m'
        )


@dataclass(frozen=True, slots=True)
class Box:
    """
    A box.

    :raises ValueError: a side is not positive, or too long.
    """

    #: Lengths of the sides along x, y and z [m].
    size: Vector3

    def __post_init__(self) -> None:
        """Check the sizes."""
        for axis, value in zip('xyz', self.size, strict=True):
            _check_size(f'the side of a box along {axis}', value)

    @property
    def bounds(self) -> Floats:
        """The lowest and the highest corner, (2, 3) [m]."""
        half = 0.5 * np.array(self.size)
        return np.array([-half, half])


@dataclass(frozen=True, slots=True)
class Cylinder:
    """
    A cylinder about z.

    :raises ValueError: radius or length is not positive, or too large.
    """

    radius: float
    length: float

    def __post_init__(self) -> None:
        """Check the sizes."""
        _check_size('the radius of a cylinder', self.radius)
        _check_size('the length of a cylinder', self.length)

    @property
    def bounds(self) -> Floats:
        """The lowest and the highest corner, (2, 3) [m]."""
        half = np.array([self.radius, self.radius, 0.5 * self.length])
        return np.array([-half, half])


@dataclass(frozen=True, slots=True)
class Sphere:
    """
    A sphere.

    :raises ValueError: the radius is not positive, or too large.
    """

    radius: float

    def __post_init__(self) -> None:
        """Check the radius."""
        _check_size('the radius of a sphere', self.radius)

    @property
    def bounds(self) -> Floats:
        """The lowest and the highest corner, (2, 3) [m]."""
        half = np.full(3, self.radius)
        return np.array([-half, half])


@dataclass(frozen=True, slots=True)
class HalfSpace:
    """Everything below z = 0: a table, a floor, a wall."""

    @property
    def bounds(self) -> Floats:
        """The lowest and the highest corner, (2, 3) [m]; only the highest z, 0, is finite."""
        return np.array([[-inf, -inf, -inf], [inf, inf, 0.0]])


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """
    The triangles of a surface, which may be open and in several parts.

    Only the triangles are solid, even of a closed surface: a body inside, far from any triangle,
    does not touch it.

    :raises ValueError: there is no triangle, a number is not finite, a triangle names a vertex
        that does not exist, or the mesh is too large.
    """

    #: (n, 3) [m]
    vertices: Floats = field(repr=False)
    #: (m, 3) indices of the vertices of each triangle.
    triangles: Indices = field(repr=False)
    #: The file, '' = none.
    source: str = ''
    #: Factors that convert the coordinates in the file, along x, y and z, to metres.
    scale: Vector3 = (1.0, 1.0, 1.0)

    def __post_init__(self) -> None:
        """Check the arrays and make them read-only."""
        vertices = np.array(self.vertices, dtype=np.float64).reshape(-1, 3)
        triangles = np.array(self.triangles, dtype=np.intp).reshape(-1, 3)
        if not len(triangles):
            raise ValueError('the mesh has no triangle')
        if not np.isfinite(vertices).all():
            raise ValueError('a vertex of the mesh is not finite')
        if triangles.min() < 0 or triangles.max() >= len(vertices):
            raise ValueError('a triangle of the mesh names a vertex that does not exist')
        with np.errstate(over='ignore'):
            size = float(np.ptp(vertices, axis=0).max())
        if not 0.0 < size <= MAX_SIZE:
            raise ValueError(
                f'the mesh is {size:g} m long; it must be longer than 0 and at most '
                f'{MAX_SIZE:g} m (a file in millimetres has the scale 0.001)'
            )
        for name, array in (('vertices', vertices), ('triangles', triangles)):
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    @property
    def bounds(self) -> Floats:
        """The lowest and the highest corner, (2, 3) [m]."""
        return np.array([self.vertices.min(axis=0), self.vertices.max(axis=0)])

    @property
    def is_closed(self) -> bool:
        """Whether triangles share every edge in pairs, so that the surface encloses a solid."""
        # Programs may write a shared corner with other last digits for each triangle.
        places = np.round(self.vertices / _SAME_PLACE)
        numbers = np.unique(places, axis=0, return_inverse=True)[1].reshape(-1)
        begin = numbers[self.triangles]
        end = np.roll(begin, 1, axis=1)
        edges = np.minimum(begin, end) * len(numbers) + np.maximum(begin, end)
        return not (np.unique_counts(edges[begin != end]).counts % 2).any()


Shape: TypeAlias = Box | Cylinder | Sphere | HalfSpace | Mesh
