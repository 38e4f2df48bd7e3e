# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Configuration of a driver."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from ur_cartesian_driver.execution.goal.goal_monitor import MAX_PLAN_DEVIATION
from ur_cartesian_driver.execution.offsets.feed_input import parse_feed_input
from ur_cartesian_driver.motion.goal.field_annotations import Range
from ur_cartesian_driver.robot.link_settings import LinkSettings, Port


@dataclass(frozen=True, slots=True, kw_only=True)
class DriverConfig(LinkSettings):
    """The connections to a robot, and the loop that holds them; defaults fit a real robot."""

    #: Port of the dashboard server of the robot.
    dashboard_port: Port = 29999
    #: Port of the Robot API (HTTP) of the robot, which PolyScope X has instead of a dashboard.
    robot_api_port: Port = 80
    #: Largest distance of the controller's own target from the plan [m]; 0.0: no limit. A larger
    #: distance means that the robot executes another motion than planned, and ends the goal. In
    #: blends the robot's own tolerance is added.
    max_plan_deviation: Annotated[float, Range(0.0, 1.0)] = MAX_PLAN_DEVIATION[0]
    #: Largest angle of the controller's own target from the plan [rad]; 0.0: no limit.
    max_plan_deviation_angle: Annotated[float, Range(0.0, 3.2)] = MAX_PLAN_DEVIATION[1]
    #: The driver plans with the robot's own calibration. Warn if it moves the flange farther than
    #: this from its nominal pose [m]: the arm was repaired badly, or is another arm. 0.0: never.
    max_calibration_difference: Annotated[float, Range(0.0, 1.0)] = 0.01
    #: Effect of a protective or safeguard stop during a goal. abort: the goal ends, and its motion
    #: never resumes, whoever unlocks the robot. continue: the goal continues when a person unlocks
    #: the robot and plays its program.
    on_robot_stop: Literal['abort', 'continue'] = 'abort'
    #: Analog input that gives the signal of goals with feed_override, in place of ~/feed_override:
    #: 'standard_analog PIN ZERO FULL', with the levels [A] or [V] that mean 0 and 1 of the planned
    #: speed. A level beyond them by more than 3 % of their range is invalid. Empty: no input.
    #:
    #: Example: 'standard_analog 0 2.0 8.0'
    feed_override_input: str = ''
    #: Goals with keep_open: planned motion time that the robot is given ahead [s]; at least twice
    #: keep_open_margin.
    keep_open_horizon: Annotated[float, Range(0.1, 60.0)] = 1.0
    #: Goals with keep_open: time before the robot runs out of points at which the arm is brought
    #: to rest, if no more points have arrived [s].
    keep_open_margin: Annotated[float, Range(0.02, 10.0)] = 0.2
    #: Goals with keep_open: time that a goal waits at rest for more points before it ends [s];
    #: 0.0: no limit.
    keep_open_timeout: Annotated[float, Range(0.0, 86400.0)] = 30.0
    #: SERVO: motion time in flight to the arm [s]. The connection may be interrupted for that long
    #: before the arm stops, and the arm executes a set-point that much later.
    servo_target_lag: Annotated[float, Range(0.008, 0.2)] = 0.04
    #: SERVO: distance of a joint from its set-point at which the robot program stops the arm
    #: [rad].
    servo_max_divergence: Annotated[float, Range(0.01, 3.0)] = 0.3
    #: Rate of a goal's feedback [Hz].
    feedback_rate: Annotated[float, Range(0.5, 500.0)] = 25.0
    #: Time without a heartbeat of this node after which its arm is stopped [s]. It must be longer
    #: than the largest goal takes to arrive.
    node_timeout: Annotated[float, Range(0.2, 60.0)] = 5.0
    #: Each motion is recorded as a file in this directory, which `ur-cartesian plot FILE` draws:
    #: planned and executed path, joints, speeds, lag, outputs, events. Empty: no recordings.
    record_directory: str = ''
    #: Largest size of all recordings together [MB]; the oldest ones are removed. A motion takes
    #: 0.27 MB a second at 500 Hz; a single recording ends at half of this size.
    record_max_size: Annotated[float, Range(1.0, 1000000.0)] = 2000.0
    #: Where the robot loop, which holds the connections to the robot, runs: in a process of its
    #: own, or in a thread (for tests; large goals then disturb it).
    robot_loop: Literal['process', 'thread'] = 'process'

    def __post_init__(self) -> None:
        """
        Refuse values that cannot work together.

        :raises ValueError: a value is outside its bounds; the text names the field and the bound.
        """
        LinkSettings.__post_init__(self)  # super() does not work in a class with slots
        parse_feed_input(self.feed_override_input)
        if not self.keep_open_horizon >= 2.0 * self.keep_open_margin:
            raise ValueError(
                f'keep_open_horizon is {self.keep_open_horizon}, it has to be at least '
                f'twice keep_open_margin = {self.keep_open_margin}.'
            )
