# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Predict where a moving arm comes to rest: a goal that preempts another one is checked from there.

The robot program stops the arm along its joints (``stopj``): the leading joint brakes evenly and
the others in proportion, so each travels half of what it would have travelled in the time of
the stop. The prediction assumes that the stop begins now. The arm moves on while the goal is
checked, for an unknown time; so a goal that passes is planned again when the arm is at rest.
"""

from __future__ import annotations

from dataclasses import replace

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.motion.robot_state import RobotState
from ur_cartesian_driver.motion.vectors import add_scaled6, ZERO6


def predict_stop(state: RobotState, arm: Arm, deceleration: float) -> RobotState:
    """
    Return the state of the arm after a stop that begins now; the state itself if it is at rest.

    :param deceleration: of the leading joint [rad/s^2].
    """
    leading = max(map(abs, state.target_qd))
    if leading == 0.0:
        return state
    q = add_scaled6(state.actual_q, state.target_qd, 0.5 * leading / deceleration)
    # By the change of the pose: an arm whose calibration is unknown is off its model anyway.
    T_flange_tcp_now = arm.forward(state.actual_q).inverse() @ state.actual_tcp_pose
    T_base_tcp = arm.forward(q) @ T_flange_tcp_now
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
