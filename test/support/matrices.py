# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Poses from homogeneous matrices."""

from collections.abc import Sequence

from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.geometry.pose import normalize, Pose, Quaternion


def pose_from_matrix(matrix: Floats | Sequence[Sequence[float]]) -> Pose:
    """Return the pose of a homogeneous (4, 4) or (3, 4) matrix with a proper rotation."""
    (a, b, c, x), (d, e, f, y), (g, h, i, z) = (
        (float(v) for v in row) for row in list(matrix)[:3]
    )
    return Pose((x, y, z), quaternion_from_rotation((a, b, c, d, e, f, g, h, i)))


def quaternion_from_rotation(r: Sequence[float]) -> Quaternion:
    """
    Return the unit quaternion of a rotation matrix given row by row, w >= 0.

    It uses the one of Shepperd's four formulas that divides by the largest component.
    """
    a, b, c, d, e, f, g, h, i = r
    trace = a + e + i
    if trace >= max(a, e, i):
        q = (h - f, c - g, d - b, 1.0 + trace)
    elif a >= max(e, i):
        q = (1.0 + a - e - i, b + d, c + g, h - f)
    elif e >= i:
        q = (b + d, 1.0 - a + e - i, f + h, c - g)
    else:
        q = (c + g, f + h, 1.0 - a - e + i, d - b)
    x, y, z, w = normalize(q)
    return (-x, -y, -z, -w) if w < 0.0 else (x, y, z, w)
