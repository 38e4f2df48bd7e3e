# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Which machine takes a motion through the robot program."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from ur_cartesian_driver.driver.ipc.channel import StartMotion
from ur_cartesian_driver.driver.ipc.driver_config import DriverConfig
from ur_cartesian_driver.execution import (
    AppendMachine,
    AppendSettings,
    GoalMachine,
    ServoMachine,
    ServoSettings,
)
from ur_cartesian_driver.execution.live.live_machine import FreedriveMachine, LiveMachine
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.ideal_arm import ideal_arm_of
from ur_cartesian_driver.kinematics.robot_models import DhTable, robot_model
from ur_cartesian_driver.motion.goal import ExecutionMode


def make_machine(request: StartMotion, config: DriverConfig) -> GoalMachine:
    """Return the machine of a motion."""
    settings: dict[str, Any] = {
        'feedback_period': 1.0 / config.feedback_rate,
        'max_plan_deviation': (config.max_plan_deviation, config.max_plan_deviation_angle),
        'resume_after_stop': config.on_robot_stop == 'continue',
    }
    if request.job.keep_open:
        return AppendMachine(
            request.job,
            settings=AppendSettings(
                horizon=config.keep_open_horizon,
                margin=config.keep_open_margin,
                timeout=config.keep_open_timeout,
            ),
            **settings,
        )
    if request.job.execution is ExecutionMode.SERVO:
        return _servo_machine(
            request,
            **settings,
            settings=ServoSettings(
                target_lag=config.servo_target_lag,
                buffer_depth=config.servo_buffer_depth,
                max_divergence=config.servo_max_divergence,
                lookahead_time=config.servoj_lookahead_time,
            ),
        )
    return GoalMachine(request.job, **settings)


def is_slow_to_make(request: StartMotion) -> bool:
    """Tell whether a machine takes long to make: the kinematics of a calibrated arm do."""
    live = request.live
    return live is not None and live.geometry != robot_model(live.ur_type).geometry


def _servo_machine(request: StartMotion, **settings: Any) -> ServoMachine:
    live = request.live
    if live is not None:
        return LiveMachine(
            request.job, live.settings, _arm(live.ur_type, live.geometry), live.start, **settings
        )
    kind = FreedriveMachine if request.freedrive else ServoMachine
    return kind(request.job, **settings)


@lru_cache(maxsize=4)
def _arm(ur_type: str, geometry: DhTable) -> Arm:
    """Return the arm of a robot; what takes long about a calibrated one is done once."""
    arm = Arm(robot_model(ur_type), geometry)
    ideal_arm_of(arm)
    return arm
