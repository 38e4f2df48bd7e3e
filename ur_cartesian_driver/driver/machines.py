# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Which machine takes a motion through the robot program."""

from __future__ import annotations

from typing import Any

from ur_cartesian_driver.driver.channel import StartMotion
from ur_cartesian_driver.driver.config import DriverConfig
from ur_cartesian_driver.execution import StreamMachine, StreamSettings, TrajectoryMachine


def machine_of(request: StartMotion, config: DriverConfig) -> TrajectoryMachine:
    """Return the machine of a motion."""
    settings: dict[str, Any] = {
        'feedback_period': 1.0 / config.feedback_rate,
        'max_plan_deviation': (config.max_plan_deviation, config.max_plan_deviation_angle),
        'continues': config.after_robot_stop == 'continue'}
    if request.order.open_end:
        return StreamMachine(request.order, settings=StreamSettings(
            horizon=config.stream_horizon, margin=config.stream_margin,
            timeout=config.keep_open_timeout), **settings)
    return TrajectoryMachine(request.order, **settings)
