# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Vectors of three and six plain floats: immutable, comparable, and cheap within a 2 ms cycle.

:data:`Vector3` is a position or a direction. :data:`Vector6` is six joints, a twist, an
acceleration, a wrench or a pose. Many vectors together are the rows of a numpy array.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import hypot
from typing import TypeAlias

Vector3: TypeAlias = tuple[float, float, float]
#: Six floats: one for each joint, a twist [m/s, rad/s], or a pose ``x y z rx ry rz`` with a
#: rotation vector [m, rad].
Vector6: TypeAlias = tuple[float, float, float, float, float, float]
#: Joint positions [rad].
Joints: TypeAlias = Vector6

ZERO3: Vector3 = (0.0, 0.0, 0.0)
ZERO6: Vector6 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def vector3(values: Iterable[float]) -> Vector3:
    """
    Return three values as a vector.

    :raises ValueError: there are not exactly three values.
    """
    x, y, z = values
    return (x, y, z)


def vector6(values: Iterable[float]) -> Vector6:
    """
    Return six values as a vector; for an array pass ``row.tolist()``, to get Python floats.

    :raises ValueError: there are not exactly six values.
    """
    a, b, c, d, e, f = values
    return (a, b, c, d, e, f)


def add(a: Vector3, b: Vector3) -> Vector3:
    """Return a + b."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def subtract(a: Vector3, b: Vector3) -> Vector3:
    """Return a - b."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def scale(a: Vector3, factor: float) -> Vector3:
    """Return a times a factor."""
    return (a[0] * factor, a[1] * factor, a[2] * factor)


def dot(a: Vector3, b: Vector3) -> float:
    """Return the scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector3, b: Vector3) -> Vector3:
    """Return the vector product."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def norm(a: Vector3) -> float:
    """Return the length."""
    return hypot(a[0], a[1], a[2])


def unit(a: Vector3) -> Vector3:
    """
    Return the vector of length 1 in the same direction.

    :raises ZeroDivisionError: the vector is zero.
    """
    return scale(a, 1.0 / norm(a))


def add6(a: Vector6, b: Vector6) -> Vector6:
    """Return a + b."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5])


def subtract6(a: Vector6, b: Vector6) -> Vector6:
    """Return a - b."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2], a[3] - b[3], a[4] - b[4], a[5] - b[5])


def scale6(a: Vector6, factor: float) -> Vector6:
    """Return a times a factor."""
    return vector6(factor * value for value in a)


def add_scaled6(a: Vector6, b: Vector6, factor: float) -> Vector6:
    """Return a + factor b: positions after some time at a velocity, for example."""
    return vector6(x + factor * y for x, y in zip(a, b, strict=True))
