# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
``ur-cartesian validate``: check and plan a goal without driver and robot.

The command line gives what the driver reads from the robot: model, calibration, joint positions
and TCP. tf2 frames are not available.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from dataclasses import replace
import sys
from time import time_ns

from ur_cartesian_driver.cli.commands import calibration, code_text, read_goal
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.errors import GoalRefused
from ur_cartesian_driver.motion.pose import IDENTITY, Pose
from ur_cartesian_driver.motion.vectors import vector6
from ur_cartesian_driver.sim import SimulatorConfig


def validate(arguments: argparse.Namespace) -> int:
    """Plan a goal from the given joint positions, and print the plan or the refusal."""
    from ur_cartesian_driver.motion.known_frames import ArmSnapshot
    from ur_cartesian_driver.planning import plan
    from ur_cartesian_driver.planning.stop_prediction import state_at_rest
    from ur_cartesian_driver.preview import postures, table
    from ur_cartesian_driver.ros.messages.goal_conversion import goal_from_message
    from ur_cartesian_driver.ros.parameters.parameter_files import read_settings

    settings = read_settings(arguments.params_file, arguments.param)
    model = robot_model(arguments.ur_type or settings.driver.ur_type)
    arm = Arm(model, calibration(arguments, model))
    T_flange_tcp = Pose.from_rotation_vector(arguments.tcp) if arguments.tcp else IDENTITY
    state = state_at_rest(arm, vector6(arguments.joints or SimulatorConfig().q), T_flange_tcp)
    dialect = settings.driver.dialect
    options = replace(
        settings.planning,
        dialect=dialect,
        allow_tcp_change=settings.planning.allow_tcp_change and dialect.supports_tcp_change,
    )
    message = read_goal(arguments)
    try:
        goal = goal_from_message(
            message,
            settings.frames,
            now=time_ns(),
            snapshot=ArmSnapshot.of(state),
            time_tolerance=settings.node.goal_time_tolerance,
        )
        found = plan(goal, state, arm, options)
    except GoalRefused as refusal:
        print(f'refused, {code_text(refusal.code)}: {refusal}', file=sys.stderr)
        return 1
    print(
        f'{model.name}{" with its calibration" if arm.calibrated else ""}, joints '
        f'{_numbers(state.actual_q)} rad, TCP {_numbers(T_flange_tcp.rotation_vector())}'
    )
    print(table(found))
    if arguments.postures:
        print(postures(found))
    print(*found.report, sep='\n')
    return 0


def _numbers(values: Iterable[float]) -> str:
    return ' '.join(f'{value:.4g}' for value in values)
