# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Check the robot's pose at the start of a goal."""

from __future__ import annotations

from ur_cartesian_driver.motion.errors import InvalidGoal, InvalidPosture, RobotNotReady
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.goal import Posture
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.preflight.tcp_kinematics import TcpKinematics
from ur_cartesian_driver.planning.request.goal_fields import point_field

#: Largest difference between the reported TCP and the TCP that the kinematics predicts [m], [rad].
#: Calibration shifts the TCP by some millimetres; a wrong model or TCP shifts it much more.
MAX_MISMATCH_POSITION = 0.015
MAX_MISMATCH_ANGLE = 0.05


def check_reported_tcp(state: RobotState, kinematics: TcpKinematics) -> None:
    """
    Refuse a robot that reports its TCP elsewhere than the kinematics predicts.

    :raises RobotNotReady: the model, the calibration or the TCP is probably wrong.
    """
    predicted = kinematics.arm.forward(state.actual_q) @ state.T_flange_tcp
    reported = kinematics.tcp(state.actual_tcp_pose)
    distance = predicted.distance_to(reported)
    angle = predicted.angle_to(reported)
    if distance > MAX_MISMATCH_POSITION or angle > MAX_MISMATCH_ANGLE:
        raise RobotNotReady(
            f'The robot reports its TCP {1e3 * distance:.1f} mm and {angle:.3f} rad away from '
            f'where the kinematics of a {kinematics.arm.model.name} puts it; check '
            'ur_type and the TCP. If the software of the robot does not report its TCP (RTDE '
            'field tcp_offset), the TCP has to be the flange.'
        )


def check_approach(state: RobotState, target: Pose, options: PlanningOptions) -> None:
    """Refuse a first point that is farther from the tool than max_approach_distance (0 = off)."""
    distance = state.actual_tcp_pose.distance_to(target)
    bound = options.max_approach_distance
    if 0.0 < bound < distance:
        raise InvalidGoal(
            point_field(0, 'pose.position'),
            f'is {distance:.4g} m away from the tool, more '
            f'than max_approach_distance = {bound:g} m',
            'move closer first, add points in between, set allow_travel, or raise the parameter',
        )


def check_start(
    state: RobotState,
    target: Pose,
    posture: Posture | None,
    kinematics: TcpKinematics,
    options: PlanningOptions,
) -> None:
    """
    Refuse a goal whose first point is at time 0 if the robot is not at that point.

    :raises InvalidGoal: the robot is elsewhere.
    :raises InvalidPosture: the arm has another posture.
    """
    actual = state.actual_tcp_pose
    distance, angle = actual.distance_to(target), actual.angle_to(target)
    if distance > options.start_tolerance_position or angle > options.start_tolerance_angle:
        raise InvalidGoal(
            point_field(0, 'time_from_start'),
            f'is 0, but the tool is {distance:.4f} m and '
            f'{angle:.4f} rad away from the point (allowed are '
            f'{options.start_tolerance_position:g} m and {options.start_tolerance_angle:g} '
            'rad)',
            'give the first point a time greater than 0',
        )
    if posture:
        where = point_field(0, 'pose')
        # The robot is not exactly at the first point, so the solution there is compared.
        near = kinematics.nearest(target, state.actual_q, where)
        _, clause = kinematics.compare_posture(target, posture, near, where, options.tf_prefix)
        if clause:
            raise InvalidPosture(
                f'{point_field(0, "posture")} is not the one in which the robot stands: '
                f'{clause}; give the first point a time greater than 0.'
            )
