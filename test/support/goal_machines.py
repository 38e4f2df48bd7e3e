# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Goal machines, composed as in the driver, with settings of their own."""

from __future__ import annotations

from dataclasses import replace

from ur_cartesian_driver.execution.goal.goal_machine import GoalMachine
from ur_cartesian_driver.execution.goal.goal_monitor import GoalMonitor, MAX_PLAN_DEVIATION
from ur_cartesian_driver.execution.goal.motion_job import MotionJob
from ur_cartesian_driver.execution.points.append_feeder import AppendFeeder
from ur_cartesian_driver.execution.points.point_feeder import PointFeeder
from ur_cartesian_driver.execution.servo.servo_feeder import ServoFeeder
from ur_cartesian_driver.execution.servo.servo_stream import ServoSettings, ServoStream
from ur_cartesian_driver.execution.servo.setpoint_source import SplineSetpoints


def point_machine(
    job: MotionJob,
    *,
    max_plan_deviation: tuple[float, float] = MAX_PLAN_DEVIATION,
    feedback_period: float = 0.04,
    resume_after_stop: bool = False,
    max_state_age: float = 0.0,
) -> GoalMachine:
    """Return the machine of a goal with all its points."""
    return GoalMachine(
        PointFeeder(GoalMonitor(job, max_plan_deviation)),
        feedback_period=feedback_period,
        resume_after_stop=resume_after_stop,
        max_state_age=max_state_age,
    )


def append_machine(
    job: MotionJob,
    *,
    horizon: float = 1.0,
    margin: float = 0.2,
    timeout: float = 30.0,
    max_plan_deviation: tuple[float, float] = MAX_PLAN_DEVIATION,
) -> GoalMachine:
    """Return the machine of a goal to which points are appended."""
    monitor = GoalMonitor(job, max_plan_deviation)
    return GoalMachine(AppendFeeder(monitor, horizon=horizon, margin=margin, timeout=timeout))


def servo_machine(job: MotionJob, settings: ServoSettings | None = None) -> GoalMachine:
    """Return the machine of a goal whose spline goes through the buffered servo."""
    assert job.spline is not None
    stream = ServoStream(SplineSetpoints(job.spline), settings or ServoSettings())
    return GoalMachine(ServoFeeder(GoalMonitor(replace(job, has_speed_profile=False)), stream))
