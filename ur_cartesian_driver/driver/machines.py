# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Which machine takes a motion through the robot program."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from ur_cartesian_driver.driver.channel import StartMotion
from ur_cartesian_driver.driver.config import DriverConfig
from ur_cartesian_driver.execution import (
    ServoMachine,
    ServoSettings,
    StreamMachine,
    StreamSettings,
    TrajectoryMachine,
)
from ur_cartesian_driver.execution.live_machine import LiveMachine, TeachMachine
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robots import Geometry, robot_model
from ur_cartesian_driver.kinematics.shape import shape_of
from ur_cartesian_driver.motion.goal import ExecutionMode


def machine_of(request: StartMotion, config: DriverConfig) -> TrajectoryMachine:
    """Return the machine of a motion."""
    settings: dict[str, Any] = {
        'feedback_period': 1.0 / config.feedback_rate,
        'max_plan_deviation': (config.max_plan_deviation, config.max_plan_deviation_angle),
        'continues': config.after_robot_stop == 'continue',
    }
    if request.order.open_end:
        return StreamMachine(
            request.order,
            settings=StreamSettings(
                horizon=config.stream_horizon,
                margin=config.stream_margin,
                timeout=config.keep_open_timeout,
            ),
            **settings,
        )
    if request.order.execution is ExecutionMode.SERVO:
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
    return TrajectoryMachine(request.order, **settings)


def is_slow(request: StartMotion) -> bool:
    """Tell whether a machine takes long to make: the kinematics of a calibrated arm do."""
    live = request.live
    return live is not None and live.geometry != robot_model(live.ur_type).geometry


def _servo_machine(request: StartMotion, **settings: Any) -> ServoMachine:
    live = request.live
    if live is not None:
        return LiveMachine(
            request.order, live.settings, _arm(live.ur_type, live.geometry), live.start, **settings
        )
    kind = TeachMachine if request.teach else ServoMachine
    return kind(request.order, **settings)


@lru_cache(maxsize=4)
def _arm(ur_type: str, geometry: Geometry) -> Arm:
    """Return the arm of a robot; what takes long about a calibrated one is done once."""
    arm = Arm(robot_model(ur_type), geometry)
    shape_of(arm)
    return arm
