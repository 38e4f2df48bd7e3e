# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Velocities and accelerations of tool and joints, in rows: one from the other.

With the twist V and the joint velocities q', V = J q' and V' = J q'' + J' q'. The last term is the
acceleration that the tool has while all joints turn evenly; it is added up along the arm.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ur_cartesian_driver.kinematics.chain import Arm, ChainFramesOf, jacobian_at
from ur_cartesian_driver.motion.pose import Pose

Floats = NDArray[np.float64]

# Far below the least singular value of an arm that may move.
_MIN_SINGULAR_VALUE = 1e-12


class _Jacobians(NamedTuple):
    """Of rows of joint positions: frames, Jacobians (n, 6, 6), and the TCP (3, n) [m]."""

    frames: ChainFramesOf[Floats]
    jacobian: Floats
    tcp: Floats


def joint_rates(
    arm: Arm, T_flange_tcp: Pose, q: Floats, twist: Floats, acceleration: Floats
) -> tuple[Floats, Floats]:
    """
    Return joint velocities [rad/s] and accelerations [rad/s^2] (n, 6) that move the TCP so.

    :param q: (n, 6) [rad]; beside a singularity the joints get as fast as it takes.
    :param twist: (n, 6) of the TCP in base axes [m/s], [rad/s].
    :param acceleration: (n, 6) [m/s^2], [rad/s^2].
    """
    at = _jacobians(arm, T_flange_tcp, q)
    # An arm that leaves a singularity at rest shall not be divided by zero.
    inverse = np.linalg.inv(at.jacobian + _MIN_SINGULAR_VALUE * np.eye(6))
    qd: Floats = (inverse @ twist[:, :, None])[:, :, 0]
    rest = acceleration - _bias_acceleration(at, qd)
    return qd, (inverse @ rest[:, :, None])[:, :, 0]


def tool_rates(
    arm: Arm, T_flange_tcp: Pose, q: Floats, qd: Floats, qdd: Floats
) -> tuple[Floats, Floats]:
    """Return twist and acceleration (n, 6) of the TCP in base axes; as :func:`joint_rates`."""
    at = _jacobians(arm, T_flange_tcp, q)
    twist: Floats = (at.jacobian @ qd[:, :, None])[:, :, 0]
    return twist, (at.jacobian @ qdd[:, :, None])[:, :, 0] + _bias_acceleration(at, qd)


def _jacobians(arm: Arm, T_flange_tcp: Pose, q: Floats) -> _Jacobians:
    frames = arm.frames_rows(q)
    x, y, z = T_flange_tcp.position
    tcp = (
        np.array(frames.position)
        + x * np.array(frames.x)
        + y * np.array(frames.y)
        + z * np.array(frames.z)
    )
    jacobian = jacobian_at(frames, (tcp[0], tcp[1], tcp[2]))
    return _Jacobians(frames, jacobian, tcp)


def _bias_acceleration(at: _Jacobians, qd: Floats) -> Floats:
    """
    Return J' q' (n, 6): the acceleration of the TCP while the joint velocities stay.

    From link to link: an axis that is carried by w turns the velocity about it, w x (z q'), and a
    point r farther out is accelerated by e x r + w x (w x r).
    """
    origins, axes = np.array(at.frames.origins), np.array(at.frames.axes)  # (6, 3, n)
    w, e, a = np.zeros((3, 3, len(qd)))
    for k in range(6):
        spin = axes[k] * qd[:, k]
        e = e + _cross(w, spin)
        w = w + spin
        r = (origins[k + 1] if k < 5 else at.tcp) - origins[k]
        a = a + _cross(e, r) + _cross(w, _cross(w, r))
    return np.concatenate([a, e]).T


def _cross(a: Floats, b: Floats) -> Floats:
    """Return the products of vectors (3, n); numpy's own takes twenty times as long for few."""
    return np.stack(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )
