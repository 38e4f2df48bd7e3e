# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Convert velocities and accelerations between TCP and joints, in rows.

With the twist V and the joint velocities q', V = J q' and V' = J q'' + J' q'. The last term is the
acceleration of the TCP at constant joint velocities; it is summed up along the arm.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np

from ur_cartesian_driver.kinematics.chain import Arm, ChainFramesOf, jacobian_at
from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import Vector3

# Added to the diagonal of Jacobians, so that they can be inverted in a singularity; far below the
# smallest singular value at which the arm is allowed to move.
_MIN_SINGULAR_VALUE = 1e-12

# Rows per block, so that the intermediate arrays stay in the CPU cache.
_BLOCK = 1024
_TRAVEL_AND_TURN = slice(0, 3), slice(3, 6)


@dataclass(frozen=True, slots=True)
class StandingPoint:
    """A point fixed in base, in place of a TCP; twists are the flange's, taken at this point."""

    position: Vector3


class _Jacobians(NamedTuple):
    """Frames, Jacobians (n, 6, 6) and TCP positions (3, n) [m] of n configurations."""

    frames: ChainFramesOf[Floats]
    jacobian: Floats
    tcp: Floats


#: The point to which twists and accelerations refer: the TCP in the flange, or a fixed point.
ReferencePoint: TypeAlias = Pose | StandingPoint


def joint_rates(
    arm: Arm, T_flange_tcp: ReferencePoint, q: Floats, twist: Floats, acceleration: Floats
) -> tuple[Floats, Floats]:
    """
    Return the joint velocities [rad/s] and accelerations [rad/s^2] (n, 6) of a TCP motion.

    :param q: (n, 6) [rad]; near a singularity joint velocities are not limited.
    :param twist: (n, 6) twist of the TCP in base axes [m/s], [rad/s].
    :param acceleration: (n, 6) likewise [m/s^2], [rad/s^2].
    """
    qd, qdd = np.empty((2, *q.shape))
    for begin in range(0, len(q), _BLOCK):
        rows = slice(begin, begin + _BLOCK)
        at = _jacobians(arm, T_flange_tcp, q[rows])
        # Avoid a division by zero for an arm at rest in a singularity.
        regular = at.jacobian + _MIN_SINGULAR_VALUE * np.eye(6)
        # Solving both systems takes two thirds of the time of inverting the Jacobians.
        qd[rows] = _solved(regular, twist[rows])
        qdd[rows] = _solved(regular, acceleration[rows] - _bias_acceleration(at, qd[rows]))
    return qd, qdd


def largest_joint_rates(
    arm: Arm,
    T_flange_tcp: ReferencePoint,
    q: Floats,
    rates: tuple[float, float],
    accelerations: tuple[float, float],
) -> tuple[Floats, Floats]:
    """
    Return upper bounds of the joint velocities [rad/s] and accelerations [rad/s^2] (n, 6).

    :param q: (n, 6) [rad].
    :param rates: greatest speed and turn rate of the TCP [m/s], [rad/s], in any direction.
    :param accelerations: likewise [m/s^2], [rad/s^2].
    """
    at = _jacobians(arm, T_flange_tcp, q)
    inverse = np.linalg.inv(at.jacobian + _MIN_SINGULAR_VALUE * np.eye(6))
    travel, turn = (
        np.sqrt(np.einsum('ijk,ijk->ij', part, part))
        for part in (inverse[:, :, columns] for columns in _TRAVEL_AND_TURN)
    )
    qd: Floats = rates[0] * travel + rates[1] * turn
    # At constant joint rates, the acceleration of the TCP is at most the square of the sum of the
    # rates, times the distance of the TCP from the farthest joint axis's origin.
    bias = qd.sum(axis=1)[:, None] ** 2
    reach = np.linalg.norm(np.array(at.frames.origins) - at.tcp, axis=1).max(axis=0)[:, None]
    qdd: Floats = (accelerations[0] + reach * bias) * travel
    return qd, qdd + (accelerations[1] + bias) * turn


def tool_rates(
    arm: Arm, T_flange_tcp: ReferencePoint, q: Floats, qd: Floats, qdd: Floats
) -> tuple[Floats, Floats]:
    """Return twist and acceleration (n, 6) of the TCP; the inverse of :func:`joint_rates`."""
    at = _jacobians(arm, T_flange_tcp, q)
    twist: Floats = (at.jacobian @ qd[:, :, None])[:, :, 0]
    return twist, (at.jacobian @ qdd[:, :, None])[:, :, 0] + _bias_acceleration(at, qd)


def _solved(matrices: Floats, rows: Floats) -> Floats:
    """Return the solution (n, 6) of each system of six equations."""
    found: Floats = np.linalg.solve(matrices, rows[:, :, None])[:, :, 0].astype(
        np.float64, copy=False
    )
    return found


def _jacobians(arm: Arm, point: ReferencePoint, q: Floats) -> _Jacobians:
    frames = arm.frames_rows(q)
    if isinstance(point, Pose):
        tcp = frames.point(point.position)
    else:
        x, y, z = (np.full(len(q), value) for value in point.position)
        tcp = x, y, z
    return _Jacobians(frames, jacobian_at(frames, tcp), np.array(tcp))


def _bias_acceleration(at: _Jacobians, qd: Floats) -> Floats:
    """
    Return J' q' (n, 6): the acceleration of the TCP at constant joint velocities.

    The sum goes from link to link: a joint on a link with the angular velocity w adds the
    angular acceleration w x (z q'). On a link with the angular acceleration e, a point at r from
    the joint is accelerated by e x r + w x (w x r).
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
    """Return cross products (3, n); numpy.cross takes twenty times as long for small n."""
    cross = np.empty(b.shape)
    cross[0], cross[1] = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2]
    cross[2] = a[0] * b[1] - a[1] * b[0]
    return cross
