# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Forward kinematics independent of the package, by textbook matrices."""

from math import cos, sin

import numpy as np


def dh_matrix(theta, d, a, alpha):
    """Return the textbook matrix of one link in the distal convention."""
    ct, st, ca, sa = cos(theta), sin(theta), cos(alpha), sin(alpha)
    return np.array(
        [
            [ct, -st * ca, st * sa, a * ct],
            [st, ct * ca, -ct * sa, a * st],
            [0, sa, ca, d],
            [0, 0, 0, 1],
        ]
    )


def dh_forward(geometry, q):
    """Return the product of the link matrices."""
    T = np.eye(4)
    for i in range(6):
        T = T @ dh_matrix(
            geometry.theta[i] + q[i], geometry.d[i], geometry.a[i], geometry.alpha[i]
        )
    return T


def pose_matrix(pose):
    """Return the matrix of a position and a unit quaternion x y z w."""
    x, y, z, w = pose.quaternion
    T = np.eye(4)
    T[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    T[:3, 3] = pose.position
    return T


def dh_frames(geometry, q):
    """
    Return the frames of the base and behind each joint, (n, 7, 4, 4), for configurations (n, 6).

    The last frame is the flange.
    """
    q = np.atleast_2d(q)
    frames = np.tile(np.eye(4), (len(q), 7, 1, 1))
    for i in range(6):
        ct, st = np.cos(geometry.theta[i] + q[:, i]), np.sin(geometry.theta[i] + q[:, i])
        ca, sa = cos(geometry.alpha[i]), sin(geometry.alpha[i])
        link = np.zeros((len(q), 4, 4))
        link[:, 0] = np.stack([ct, -st * ca, st * sa, geometry.a[i] * ct], axis=1)
        link[:, 1] = np.stack([st, ct * ca, -ct * sa, geometry.a[i] * st], axis=1)
        link[:, 2, 1:] = sa, ca, geometry.d[i]
        link[:, 3, 3] = 1.0
        frames[:, i + 1] = frames[:, i] @ link
    return frames


def turn(axis, angle):
    """Return the matrices (..., 4, 4) of turns about x, y or z by angles [rad]."""
    i, j = {'x': (1, 2), 'y': (2, 0), 'z': (0, 1)}[axis]
    angle = np.asarray(angle)
    T = np.tile(np.eye(4), (*angle.shape, 1, 1))
    T[..., i, i] = T[..., j, j] = np.cos(angle)
    T[..., j, i] = np.sin(angle)
    T[..., i, j] = -np.sin(angle)
    return T


def origin_matrix(row):
    """Return the matrix of a URDF's origin: x, y, z, roll, pitch, yaw."""
    *xyz, roll, pitch, yaw = row
    T = turn('z', yaw) @ turn('y', pitch) @ turn('x', roll)
    T[:3, 3] = xyz
    return T


def chain_of_origins(rows, q):
    """Return the flange (n, 4, 4) at joints (n, 6), each of which turns about its origin's z."""
    T = np.eye(4)
    for row, angles in zip(rows, np.transpose(q), strict=True):
        T = T @ origin_matrix(row) @ turn('z', angles)
    return T


def turn_between(a, b):
    """Return the angle between rotations (..., 3, 3) [rad]; exact near 0."""
    chord = np.linalg.norm(a - b, axis=(-2, -1)) / (2.0 * np.sqrt(2.0))
    return 2.0 * np.arcsin(np.minimum(1.0, chord))
