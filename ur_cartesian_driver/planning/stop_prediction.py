# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The states from which goals are planned: an arm at rest, and a moving arm after a stop.

A goal that preempts another one is checked from the state in which the arm will come to rest.

The robot program stops the arm along its joints (``stopj``): the leading joint brakes evenly and
the others in proportion, so each travels half as far as it would at constant speed in the time of
the stop. The prediction assumes that the stop begins now. But the arm moves on for an unknown time
while the goal is checked; so a goal that passes is planned again once the arm is at rest.
"""

from __future__ import annotations

from dataclasses import replace

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, Pose
from ur_cartesian_driver.motion.geometry.vectors import add_scaled6, Joints, subtract6, ZERO6
from ur_cartesian_driver.motion.state.rtde_state import RobotState

#: Largest deviation of a joint from its set-point that is ascribed to friction [rad]: 0.2 to 0.4
#: mrad were recorded.
MAX_STATIC_ERROR = 0.005


def state_at_rest(arm: Arm, q: Joints, T_flange_tcp: Pose = IDENTITY) -> RobotState:
    """Return the state of an arm at rest in the configuration ``q`` [rad]."""
    pose = arm.forward(q) @ T_flange_tcp
    return RobotState(
        timestamp=0.0,
        actual_q=q,
        target_q=q,
        actual_tcp_pose=pose,
        target_tcp_pose=pose,
        T_flange_tcp=T_flange_tcp,
    )


def at_set_point(state: RobotState, arm: Arm) -> RobotState:
    """
    Return the state of a resting arm, moved to its set-point.

    The controller's moves begin at its set-point, although friction holds the arm 0.2 to 0.4 mrad
    away from it (recorded on real arms). A state in which the arm is farther away than
    ``MAX_STATIC_ERROR`` is returned unchanged: friction cannot be the cause.
    """
    q = state.target_q
    if q == state.actual_q or max(map(abs, subtract6(q, state.actual_q))) > MAX_STATIC_ERROR:
        return state
    return replace(state, actual_q=q, actual_tcp_pose=_tcp_at(state, arm, q))


def predict_stop(state: RobotState, arm: Arm, deceleration: float) -> RobotState:
    """
    Return the state of the arm after a stop that begins now; ``state`` if the arm is at rest.

    :param deceleration: deceleration of the leading joint [rad/s^2].
    """
    leading = max(map(abs, state.target_qd))
    if leading == 0.0:
        return state
    q = add_scaled6(state.actual_q, state.target_qd, 0.5 * leading / deceleration)
    T_base_tcp = _tcp_at(state, arm, q)
    return replace(
        state,
        actual_q=q,
        target_q=q,
        actual_qd=ZERO6,
        target_qd=ZERO6,
        actual_tcp_pose=T_base_tcp,
        target_tcp_pose=T_base_tcp,
        actual_tcp_twist=ZERO6,
        target_tcp_twist=ZERO6,
    )


def _tcp_at(state: RobotState, arm: Arm, q: Joints) -> Pose:
    """Return the TCP pose in ``q``: the reported one, moved as the model predicts."""
    # The forward kinematics of ``q`` alone would ignore that the arm may differ from its model.
    return arm.forward(q) @ (arm.forward(state.actual_q).inverse() @ state.actual_tcp_pose)
