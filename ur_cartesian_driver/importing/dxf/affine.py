# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Affine maps: the object coordinate systems, placed blocks and units of a drawing."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, sin

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.geometry.vectors import cross, norm, unit, Vector3, ZERO3


@dataclass(frozen=True, slots=True)
class Affine:
    """An affine map: the axes and the origin of one coordinate system, given in another."""

    x: Vector3 = (1.0, 0.0, 0.0)
    y: Vector3 = (0.0, 1.0, 0.0)
    z: Vector3 = (0.0, 0.0, 1.0)
    origin: Vector3 = ZERO3

    def direction(self, v: Vector3) -> Vector3:
        """Map the difference of two points."""
        (a, b, c), (d, e, f), (g, h, i) = self.x, self.y, self.z
        x, y, z = v
        return (a * x + d * y + g * z, b * x + e * y + h * z, c * x + f * y + i * z)

    def point(self, p: Vector3) -> Vector3:
        """Map a point."""
        x, y, z = self.direction(p)
        return (x + self.origin[0], y + self.origin[1], z + self.origin[2])

    def weighted_points(self, rows: Floats) -> Floats:
        """Map points (..., 4) in homogeneous coordinates w x, w y, w z, w."""
        matrix = np.array([(*self.x, 0.0), (*self.y, 0.0), (*self.z, 0.0), (*self.origin, 1.0)])
        mapped: Floats = rows @ matrix
        return mapped

    def after(self, first: Affine) -> Affine:
        """Return the map that applies the map `first`, and then this one."""
        return Affine(
            self.direction(first.x),
            self.direction(first.y),
            self.direction(first.z),
            self.point(first.origin),
        )

    def is_within(self, bound: float) -> bool:
        """Return whether the axes and the origin are all shorter than a bound."""
        return max(norm(v) for v in (self.x, self.y, self.z, self.origin)) < bound


def scaled(x: float, y: float, z: float) -> Affine:
    """Return the map that multiplies each axis by a factor."""
    return Affine((x, 0.0, 0.0), (0.0, y, 0.0), (0.0, 0.0, z))


def shifted(by: Vector3) -> Affine:
    """Return the map that adds a vector."""
    return Affine(origin=by)


def turned(angle: float) -> Affine:
    """Return the rotation about z by an angle [rad]."""
    return Affine((cos(angle), sin(angle), 0.0), (-sin(angle), cos(angle), 0.0))


def object_axes(extrusion: Vector3) -> Affine:
    """Return the object axes of an extrusion direction (DXF's arbitrary axis algorithm)."""
    z = unit(extrusion)
    is_near_z = abs(z[0]) < 1.0 / 64.0 and abs(z[1]) < 1.0 / 64.0
    x = unit(cross((0.0, 1.0, 0.0) if is_near_z else (0.0, 0.0, 1.0), z))
    return Affine(x, cross(z, x), z)
