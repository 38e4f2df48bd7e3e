# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Frames from touched points: the best-fitting rigid motion, and the error of each point."""

from __future__ import annotations

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.geometry.pose import normalize, Pose, rotate
from ur_cartesian_driver.motion.geometry.vectors import subtract, vector3

#: Points are on a line if their spread across it is less than this fraction of their length.
_ON_A_LINE = 1e-3


def fit_frame(known: Floats, measured: Floats) -> tuple[Pose, Floats]:
    """
    Return the pose of the known points' frame in the measured points' frame, and the residuals.

    The pose minimizes the sum of the squared distances (Horn, Closed-form solution of absolute
    orientation using unit quaternions, 1987).

    :param known: (n, 3) points in the frame that is sought [m].
    :param measured: (n, 3) the same points as measured [m].
    :returns: the pose, and the distances (n,) of the known points, put at it, from the measured
        ones [m].
    :raises ValueError: fewer than three points, or all of them on a line.
    """
    centre, other = known.mean(axis=0), measured.mean(axis=0)
    a, b = known - centre, measured - other
    spread = np.linalg.svd(a, compute_uv=False) if len(a) > 2 else np.zeros(3)
    if spread[1] <= _ON_A_LINE * max(float(spread[0]), 1e-9):
        raise ValueError('the points are on a line, so the rotation about it is not determined')
    s = a.T @ b
    cross = s - s.T
    n = np.empty((4, 4))
    n[0, 0] = np.trace(s)
    n[0, 1:] = n[1:, 0] = cross[1, 2], cross[2, 0], cross[0, 1]
    n[1:, 1:] = s + s.T - np.trace(s) * np.eye(3)
    w, x, y, z = np.linalg.eigh(n)[1][:, -1].tolist()
    quaternion = normalize((x, y, z, w))
    position = subtract(vector3(other.tolist()), rotate(quaternion, vector3(centre.tolist())))
    pose = Pose(position, quaternion)
    there = np.array([pose.apply(vector3(point)) for point in known.tolist()])
    residuals: Floats = np.linalg.norm(there - measured, axis=1)
    return pose, residuals
