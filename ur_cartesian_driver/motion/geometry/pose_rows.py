# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The formulas of :mod:`~ur_cartesian_driver.motion.geometry.pose` for rows of poses.

A row is x y z [m] and the unit quaternion x y z w; arrays are (n, 7). The checks along a goal need
so many poses that creating an object for each would take longer than the inverse kinematics.
"""

from __future__ import annotations

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.geometry.pose import Pose

_SMALL_ANGLE = 1e-9


def multiply_rows(a: Floats, b: Floats) -> Floats:
    """
    Return the quaternion products ``a b`` (n, 4), which rotate by ``b`` first; not normalised.

    Each of ``a`` and ``b`` has n rows or one row, which is used for all.
    """
    ax, ay, az, aw = a.T
    bx, by, bz, bw = b.T
    rows = np.empty((len(a) if len(b) == 1 else len(b), 4))  # for few rows np.stack is slow
    rows[:, 0] = aw * bx + ax * bw + ay * bz - az * by
    rows[:, 1] = aw * by - ax * bz + ay * bw + az * bx
    rows[:, 2] = aw * bz + ax * by - ay * bx + az * bw
    rows[:, 3] = aw * bw - ax * bx - ay * by - az * bz
    return rows


def cross_rows(a: Floats, b: Floats) -> Floats:
    """Return the cross products of vectors (n, 3); for few rows np.cross is many times slower."""
    ax, ay, az = a.T
    bx, by, bz = b.T
    rows = np.empty(b.shape)
    rows[:, 0], rows[:, 1], rows[:, 2] = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    return rows


def conjugate_rows(a: Floats) -> Floats:
    """Return the inverse rotations (n, 4) of unit quaternions."""
    inverse: Floats = a * np.array((-1.0, -1.0, -1.0, 1.0))
    return inverse


def length_rows(vectors: Floats) -> Floats:
    """Return the lengths of vectors (n, k); np.linalg.norm takes several times as long."""
    lengths: Floats = np.sqrt(np.einsum('ij,ij->i', vectors, vectors))
    return lengths


def distance_rows(a: Floats, b: Floats) -> Floats:
    """
    Return the distances (n,) [m] between positions, the first three columns of ``a`` and ``b``.

    Huge distances do not overflow.
    """
    x, y, z = (b[:, :3] - a[:, :3]).T
    distances: Floats = np.hypot(np.hypot(x, y), z)
    return distances


def angle_rows(a: Floats, b: Floats) -> Floats:
    """Return the angles (n,) [rad], within [0, pi], between unit quaternions (n, 4)."""
    turn = multiply_rows(conjugate_rows(a), b)
    angle: Floats = 2.0 * np.arctan2(length_rows(turn[:, :3]), np.abs(turn[:, 3]))
    return angle


def compose_rows(T_a_b: Floats, T_b_c: Pose) -> Floats:
    """Return ``T_a_c`` (n, 7): each row ``T_a_b`` (n, 7) composed with the one pose ``T_b_c``."""
    ax, ay, az, aw = T_a_b[:, 3:].T
    x, y, z = T_b_c.position
    # v + 2 u x (u x v + w v), as in motion.geometry.pose.
    tx, ty, tz = 2.0 * (ay * z - az * y), 2.0 * (az * x - ax * z), 2.0 * (ax * y - ay * x)
    rows = np.empty((len(T_a_b), 7))
    rows[:, 0] = T_a_b[:, 0] + x + aw * tx + ay * tz - az * ty
    rows[:, 1] = T_a_b[:, 1] + y + aw * ty + az * tx - ax * tz
    rows[:, 2] = T_a_b[:, 2] + z + aw * tz + ax * ty - ay * tx
    rows[:, 3:] = multiply_rows(T_a_b[:, 3:], np.array([T_b_c.quaternion]))
    return rows


def transform_rows(T_a_b: Pose, T_b_c: Floats) -> Floats:
    """Return ``T_a_c`` (n, 7), normalised: one pose ``T_a_b`` composed with rows ``T_b_c``."""
    ux, uy, uz, w = T_a_b.quaternion
    x, y, z = T_b_c[:, :3].T
    # v + 2 u x (u x v + w v), as in motion.geometry.pose.
    tx, ty, tz = 2.0 * (uy * z - uz * y), 2.0 * (uz * x - ux * z), 2.0 * (ux * y - uy * x)
    px, py, pz = T_a_b.position
    rows = np.empty((len(T_b_c), 7))
    rows[:, 0] = x + w * tx + uy * tz - uz * ty + px
    rows[:, 1] = y + w * ty + uz * tx - ux * tz + py
    rows[:, 2] = z + w * tz + ux * ty - uy * tx + pz
    turned = multiply_rows(np.array([T_a_b.quaternion]), T_b_c[:, 3:])
    # Summed in the order of motion.geometry.pose, so that both give the same bits.
    x, y, z, w = turned.T
    rows[:, 3:] = turned * (1.0 / np.sqrt(x * x + y * y + z * z + w * w))[:, None]
    return rows


def rotate_rows(orientations: Floats, vectors: Floats) -> Floats:
    """Return vectors (n, 3) turned by unit quaternions (n, 4)."""
    u, w = orientations[:, :3], orientations[:, 3:]
    t = 2.0 * cross_rows(u, vectors)
    turned: Floats = vectors + w * t + cross_rows(u, t)
    return turned


def inverse_rows(T_a_b: Floats) -> Floats:
    """Return the inverses ``T_b_a`` (n, 7)."""
    turned_back = conjugate_rows(T_a_b[:, 3:])
    return np.concatenate([-rotate_rows(turned_back, T_a_b[:, :3]), turned_back], axis=1)


def interpolate_rows(a: Floats, b: Floats, fraction: Floats) -> Floats:
    """
    Return the poses at fractions (n,) of the way from ``a`` to ``b`` (n, 7).

    Positions are on the straight line, orientations on the shortest rotation.
    """
    rows: Floats = a + fraction[:, None] * (b - a)
    rows[:, 3:] = a[:, 3:]
    if (a[:, 3:] != b[:, 3:]).any():
        a, b = (np.broadcast_to(pose[:, 3:], (len(rows), 4)) for pose in (a, b))
        turns = np.flatnonzero((a != b).any(axis=1))
        rows[turns, 3:] = _turned_rows(a[turns], b[turns], fraction[turns])
    return rows


def _turned_rows(a: Floats, b: Floats, fraction: Floats) -> Floats:
    """Return orientations (n, 4) at fractions (n,) of the shortest rotations from a to b."""
    dot = np.einsum('ij,ij->i', a, b)
    angle = np.arccos(np.minimum(1.0, np.abs(dot)))
    sine = np.sin(angle)
    turns = angle >= _SMALL_ANGLE
    safe = np.where(turns, sine, 1.0)
    # q and -q are the same orientation: take the short way.
    sign = np.where(dot < 0.0, -1.0, 1.0)
    wa = np.where(turns, np.sin((1.0 - fraction) * angle) / safe, 1.0 - fraction)
    wb = np.where(turns, np.sin(fraction * angle) / safe, fraction) * sign
    return normalized_rows(wa[:, None] * a + wb[:, None] * b)


def normalized_rows(quaternions: Floats) -> Floats:
    """Return quaternions (n, 4) scaled to length 1."""
    return quaternions / length_rows(quaternions)[:, None]


def keep_hemisphere(poses: Floats) -> None:
    """
    Negate quaternions of ``poses``, in place, so that they do not jump between rows.

    A quaternion q and its negative -q are the same orientation.
    """
    dots = np.einsum('ij,ij->i', poses[1:, 3:], poses[:-1, 3:])
    signs = np.cumprod(np.where(dots < 0.0, -1.0, 1.0))
    poses[1:, 3:] *= signs[:, np.newaxis]
