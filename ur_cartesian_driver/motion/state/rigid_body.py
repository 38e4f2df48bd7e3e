# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The motion of a rigid body at another reference point.

Flange, TCP and every controlled frame are fixed to each other. Their angular motion is the same;
their linear motion differs because of the offset between their origins. The robot reports the
motion of the TCP, but a goal may control another frame.
"""

from __future__ import annotations

from dataclasses import replace

from ur_cartesian_driver.motion.geometry.pose import IDENTITY, Pose, rotate
from ur_cartesian_driver.motion.geometry.vectors import add, cross, Vector3, Vector6
from ur_cartesian_driver.motion.state.rtde_state import RobotState


def twist_at(twist: Vector6, offset: Vector3) -> Vector6:
    """
    Return the twist of a body at another point of it: v + w x r.

    :param twist: linear [m/s] and angular [rad/s] velocity at the first point.
    :param offset: from the first point to the other one [m], in the axes of the twist.
    """
    v, w = twist[:3], twist[3:]
    return (*add(v, cross(w, offset)), *w)


def acceleration_at(acceleration: Vector6, twist: Vector6, offset: Vector3) -> Vector6:
    """
    Return the acceleration of a body at another point of it: a + e x r + w x (w x r).

    :param acceleration: linear [m/s^2] and angular [rad/s^2] acceleration at the first point.
    :param twist: twist at any point of the body.
    :param offset: from the first point to the other one [m], in the axes of both vectors.
    """
    a, e, w = acceleration[:3], acceleration[3:], twist[3:]
    return (*add(add(a, cross(e, offset)), cross(w, cross(w, offset))), *e)


def shift_reference_point(state: RobotState, T_tcp_frame: Pose) -> RobotState:
    """
    Return the state as if another frame, fixed to the TCP, were the active TCP.

    The wrench stays at the TCP.
    """
    if T_tcp_frame == IDENTITY:
        return state
    actual = rotate(state.actual_tcp_pose.quaternion, T_tcp_frame.position)
    target = rotate(state.target_tcp_pose.quaternion, T_tcp_frame.position)
    return replace(
        state,
        T_flange_tcp=state.T_flange_tcp @ T_tcp_frame,
        actual_tcp_pose=state.actual_tcp_pose @ T_tcp_frame,
        target_tcp_pose=state.target_tcp_pose @ T_tcp_frame,
        actual_tcp_twist=twist_at(state.actual_tcp_twist, actual),
        target_tcp_twist=twist_at(state.target_tcp_twist, target),
        actual_tcp_acceleration=_known(
            state.actual_tcp_acceleration, state.actual_tcp_twist, actual
        ),
        target_tcp_acceleration=_known(
            state.target_tcp_acceleration, state.target_tcp_twist, target
        ),
    )


def _known(acceleration: Vector6 | None, twist: Vector6, offset: Vector3) -> Vector6 | None:
    return None if acceleration is None else acceleration_at(acceleration, twist, offset)
