# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Orientations of the tool from directions and angles: unit quaternions (x, y, z, w).

All are orientations of the controlled frame in the frame of the path.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, isfinite, sin, sqrt

from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.geometry.pose import MAX_ANGLE, multiply, normalize, Quaternion
from ur_cartesian_driver.motion.geometry.vectors import (
    cross,
    dot,
    norm,
    scale,
    subtract,
    unit,
    Vector3,
)
from ur_cartesian_driver.path.path_numbers import any_number

#: The tool's axis z points straight down, its axis x along y of the frame.
DOWN: Quaternion = (sqrt(0.5), sqrt(0.5), 0.0, 0.0)
#: Directions of the axes of the frame.
X: Vector3 = (1.0, 0.0, 0.0)
Y: Vector3 = (0.0, 1.0, 0.0)
Z: Vector3 = (0.0, 0.0, 1.0)

#: Directions that differ by less than this [rad] are parallel.
_PARALLEL = 1e-6


def roll_pitch_yaw(roll: float, pitch: float, yaw: float) -> Quaternion:
    """
    Return the rotation by roll, pitch and yaw [rad] about the fixed axes x, then y, then z.

    :raises InvalidGoal: an angle looks like degrees.
    """
    about_z, about_y = axis_angle(Z, yaw), axis_angle(Y, pitch)
    return multiply(about_z, multiply(about_y, axis_angle(X, roll)))


def axis_angle(axis: Sequence[float], angle: float) -> Quaternion:
    """
    Return the rotation about an axis of any length by an angle [rad].

    :raises InvalidGoal: the axis is zero, or the angle looks like degrees.
    """
    x, y, z = direction('axis', axis)
    angle = any_number('axis_angle()', 'angle', angle)
    if not isfinite(angle) or abs(angle) > MAX_ANGLE:
        raise InvalidGoal(
            'angle', f'is {angle:g} rad, more than two turns', f'write deg({angle:g}) for degrees'
        )
    s = sin(0.5 * angle)
    return normalize((x * s, y * s, z * s, cos(0.5 * angle)))


def against(normal: Sequence[float], x: Sequence[float]) -> Quaternion:
    """
    Return the orientation whose axis z points against the normal of a surface.

    :param x: direction in which the tool's axis x points as nearly as possible; not parallel to
        the normal.
    :raises InvalidGoal: a direction is zero, or the two directions are parallel.
    """
    n, along = direction('normal', normal), direction('x', x)
    along = subtract(along, scale(n, dot(along, n)))
    if norm(along) < _PARALLEL:
        raise InvalidGoal('x', 'is parallel to the normal', 'choose a direction along the surface')
    ex, ez = unit(along), scale(n, -1.0)
    return _of_axes(ex, cross(ez, ex), ez)


def tilted(angle: float, about: Sequence[float] = X, of: Quaternion = DOWN) -> Quaternion:
    """
    Return an orientation (by default DOWN) turned by an angle [rad] about an axis of the frame.

    :raises InvalidGoal: as for :func:`axis_angle`.
    """
    return multiply(axis_angle(about, angle), of)


def direction(name: str, vector: Sequence[float]) -> Vector3:
    """
    Return the vector of length 1 with the direction of a vector.

    :raises InvalidGoal: the vector is zero, or does not consist of three finite numbers.
    """
    try:
        values = [float(value) for value in vector]
    except (TypeError, ValueError, OverflowError):
        values = []
    if len(values) != 3 or not all(map(isfinite, values)) or not any(values):
        raise InvalidGoal(name, f'is {vector!r}', 'give three numbers that are not all zero')
    x, y, z = values
    return unit((x, y, z))


def _of_axes(ex: Vector3, ey: Vector3, ez: Vector3) -> Quaternion:
    """
    Return the orientation of a frame from its axes.

    It is computed from the quaternion's largest component, which is certainly not zero.
    """
    m = (ex, ey, ez)  # columns
    trace = ex[0] + ey[1] + ez[2]
    candidates = (trace, ex[0], ey[1], ez[2])
    k = candidates.index(max(candidates)) - 1
    if k < 0:
        w = 1.0 + trace
        return normalize((ey[2] - ez[1], ez[0] - ex[2], ex[1] - ey[0], w))
    i, j = (k + 1) % 3, (k + 2) % 3
    q = [0.0, 0.0, 0.0, m[i][j] - m[j][i]]
    q[k] = 1.0 + m[k][k] - m[i][i] - m[j][j]
    q[i] = m[i][k] + m[k][i]
    q[j] = m[j][k] + m[k][j]
    return normalize((q[0], q[1], q[2], q[3]))
