# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Make the goal machine of a motion, with the feeder of its execution mode.

:data:`FEEDERS` has an entry for each execution mode. Live targets and freedrive have the mode
SERVO.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import lru_cache
from math import inf
from typing import TypeAlias

from ur_cartesian_driver.driver.ipc.channel import ArmSetup, LiveSetup, StartMotion
from ur_cartesian_driver.driver.ipc.driver_config import DriverConfig
from ur_cartesian_driver.execution.goal.feeder import Feeder
from ur_cartesian_driver.execution.goal.goal_machine import GoalMachine
from ur_cartesian_driver.execution.goal.goal_monitor import GoalMonitor
from ur_cartesian_driver.execution.goal.motion_job import MotionJob
from ur_cartesian_driver.execution.live.freedrive import FreedriveFeeder
from ur_cartesian_driver.execution.live.live_feeder import ANY_DEVIATION, LiveFeeder
from ur_cartesian_driver.execution.live.live_targets import LiveTargets
from ur_cartesian_driver.execution.live.online_trajectory import OnlineTrajectoryGenerator
from ur_cartesian_driver.execution.offsets.feed_input import FeedInput, parse_feed_input
from ur_cartesian_driver.execution.offsets.feed_requests import FeedRequests
from ur_cartesian_driver.execution.points.append_feeder import AppendFeeder
from ur_cartesian_driver.execution.points.offset_point_feeder import OffsetPointFeeder
from ur_cartesian_driver.execution.points.point_feeder import PointFeeder
from ur_cartesian_driver.execution.points.program_feed import ProgramFeed
from ur_cartesian_driver.execution.servo.append_servo_feeder import AppendServoFeeder
from ur_cartesian_driver.execution.servo.offset_setpoints import OffsetSetpoints
from ur_cartesian_driver.execution.servo.servo_feeder import ServoFeeder
from ur_cartesian_driver.execution.servo.servo_stream import ServoSettings, ServoStream
from ur_cartesian_driver.execution.servo.setpoint_feed import SetpointFeed
from ur_cartesian_driver.execution.servo.setpoint_source import SplineSetpoints
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.ideal_arm import ideal_arm_of
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import FeedOverride, PIECES_PER_HORIZON

#: Makes the feeder of a motion.
MakeFeeder: TypeAlias = Callable[[StartMotion, DriverConfig], Feeder]


def make_machine(request: StartMotion, config: DriverConfig) -> GoalMachine:
    """Return the machine of a motion."""
    feeder = FEEDERS[request.job.execution](request, config)
    if (bounds := request.job.feed_override) is not None:
        feed_input = parse_feed_input(config.feed_override_input)
        feeder.add_part(_feed(feeder, bounds, feed_input))
    return GoalMachine(
        feeder,
        feedback_period=1.0 / config.feedback_rate,
        resume_after_stop=config.on_robot_stop == 'continue',
        max_state_age=config.max_state_age,
    )


def point_feeder(request: StartMotion, config: DriverConfig) -> Feeder:
    """Return the feeder of a goal in points: displaced by offsets, all known, or appended."""
    monitor = _monitor(request, config)
    if request.job.offset_band is not None:
        return OffsetPointFeeder(monitor, request.job.offset_band)
    if not request.job.keep_open:
        return PointFeeder(monitor)
    # A piece is at most 1 / PIECES_PER_HORIZON of the replace horizon long. The last piece sent
    # begins within the shorter horizon of the feeder, so it ends within the replace horizon. The
    # margin is cut, too: the ending is sent only once no more points can come in time.
    horizon = (1.0 - 1.0 / PIECES_PER_HORIZON) * (request.job.replace_horizon or inf)
    return AppendFeeder(
        monitor,
        horizon=min(config.keep_open_horizon, horizon),
        margin=min(config.keep_open_margin, horizon),
        timeout=config.keep_open_timeout,
    )


def servo_feeder(request: StartMotion, config: DriverConfig) -> Feeder:
    """Return the feeder for freedrive, for live targets, or for the set-points of a spline."""
    job = request.job
    settings = ServoSettings(
        target_lag=config.servo_target_lag,
        buffer_depth=config.servo_buffer_depth,
        max_divergence=config.servo_max_divergence,
        lookahead_time=config.servoj_lookahead_time,
    )
    if request.live is not None:
        assert request.arm is not None
        targets = _live_targets(request.live, request.arm, job)
        return LiveFeeder(GoalMonitor(job, ANY_DEVIATION), targets, settings)
    if request.freedrive:
        return FreedriveFeeder(GoalMonitor(job, ANY_DEVIATION), settings)
    assert job.spline is not None
    if job.keep_open:
        horizon = job.replace_horizon or inf
        settings = replace(
            settings,
            target_lag=min(settings.target_lag, horizon),
            max_lag=min(settings.max_lag, horizon),
        )
        return AppendServoFeeder(_monitor(request, config), settings, config.keep_open_timeout)
    setpoints, monitor = SplineSetpoints(job.spline), _monitor(request, config)
    if job.offset_band is None or request.arm is None:
        return ServoFeeder(monitor, ServoStream(setpoints, settings))
    offsets = OffsetSetpoints(setpoints, job.offset_band, _arm(request.arm), job.moving_frame)
    return ServoFeeder(monitor, ServoStream(offsets, settings), offsets, offsets.requests)


#: The feeder of each execution mode.
FEEDERS: Mapping[ExecutionMode, MakeFeeder] = {
    ExecutionMode.PRIMITIVES: point_feeder,
    ExecutionMode.SPLINE: point_feeder,
    ExecutionMode.SERVO: servo_feeder,
}


def _feed(feeder: Feeder, bounds: FeedOverride, feed_input: FeedInput | None) -> FeedRequests:
    """Return the feed override for the side that times the motion: driver or robot program."""
    if isinstance(feeder, ServoFeeder):
        return SetpointFeed(bounds, feeder.stream, feed_input)
    return ProgramFeed(bounds, feed_input)


def _monitor(request: StartMotion, config: DriverConfig) -> GoalMonitor:
    return GoalMonitor(request.job, (config.max_plan_deviation, config.max_plan_deviation_angle))


def is_slow_to_make(request: StartMotion) -> bool:
    """Return whether making the machine is slow: for a calibrated arm, or a cell with bodies."""
    arm, live = request.arm, request.live
    if live is not None and live.settings.limits.workspace.cell:
        return True
    return arm is not None and arm.geometry != arm.model.geometry


def _live_targets(live: LiveSetup, arm: ArmSetup, job: MotionJob) -> LiveTargets:
    generator = OnlineTrajectoryGenerator(
        _arm(arm), job.T_flange_active, live.start, live.settings.limits
    )
    return LiveTargets(generator, live.settings)


@lru_cache(maxsize=4)
def _arm(setup: ArmSetup) -> Arm:
    """Return the arm of a robot; the slow computations for a calibrated arm are done once."""
    arm = Arm(setup.model, setup.geometry)
    ideal_arm_of(arm)
    return arm
