# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Configuration of a driver."""

from __future__ import annotations

from dataclasses import dataclass

from ur_cartesian_driver.execution.goal.goal_monitor import MAX_PLAN_DEVIATION
from ur_cartesian_driver.robot.link_settings import LinkSettings


@dataclass(frozen=True, slots=True, kw_only=True)
class DriverConfig(LinkSettings):
    """The connections to a robot, and the loop that holds them; defaults fit a real robot."""

    #: Port of the dashboard on the robot; PolyScope X has none, ...
    dashboard_port: int = 29999
    #: ... but a Robot API, over HTTP.
    robot_api_port: int = 80
    #: How far the controller's target may be from the plan, except in blends [m], [rad]; 0 = any.
    max_plan_deviation: float = MAX_PLAN_DEVIATION[0]
    max_plan_deviation_angle: float = MAX_PLAN_DEVIATION[1]
    #: Warn if the calibration moves the flange by more than this [m]; 0 = never.
    max_calibration_difference: float = 0.01
    #: What a protective or safeguard stop does to a goal: ``abort``, or ``continue`` it when a
    #: person has unlocked the robot and plays its program.
    on_robot_stop: str = 'abort'
    #: Of goals with keep_open: planned time of the motion that the robot is given ahead [s]; ...
    keep_open_horizon: float = 1.0
    #: ... how long before it runs out the motion is brought to rest if nothing else comes [s]; ...
    keep_open_margin: float = 0.2
    #: ... and how long the goal then waits for more points until it ends [s]; 0 = without end.
    keep_open_timeout: float = 30.0
    #: SERVO: motion time in flight, and so the longest gap in the connection [s].
    servo_target_lag: float = 0.04
    #: SERVO: the robot program stops the arm when a joint is farther from its set-point [rad].
    servo_max_divergence: float = 0.3
    #: Progress reports per second.
    feedback_rate: float = 25.0
    #: Without a heartbeat of the owner for that long [s] the arm is stopped.
    node_timeout: float = 5.0
    #: Where each motion is recorded, a file each (doc/recordings.md); empty = nowhere.
    record_directory: str = ''
    #: Size of all recordings together [MB]; the oldest ones are removed.
    record_max_size: float = 2000.0
    #: ``process`` (robust) or ``thread`` (light: tests and scripts).
    robot_loop: str = 'process'

    def __post_init__(self) -> None:
        """
        Refuse values that cannot work together.

        :raises ValueError: names the field, its value and the bound.
        """
        LinkSettings.__post_init__(self)  # super() does not work in a class with slots
        for name, first, second in (
            ('robot_loop', 'process', 'thread'),
            ('on_robot_stop', 'abort', 'continue'),
        ):
            if (value := getattr(self, name)) not in (first, second):
                raise ValueError(f'{name} is {value!r}, it has to be {first!r} or {second!r}.')
        self._require_positive(
            'feedback_rate', 'node_timeout', 'keep_open_margin', 'record_max_size'
        )
        if not self.keep_open_horizon >= 2.0 * self.keep_open_margin:
            raise ValueError(
                f'keep_open_horizon is {self.keep_open_horizon}, it has to be at least '
                f'twice keep_open_margin = {self.keep_open_margin}.'
            )
        self._require_within('servo_target_lag', 0.008, 0.2)
        self._require_within('servo_max_divergence', 0.01, 3.0)
        self._require_not_negative(
            'keep_open_timeout',
            'max_plan_deviation',
            'max_plan_deviation_angle',
            'max_calibration_difference',
        )
