# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""What can happen while a goal runs, and what is told about it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from math import nan
from typing import TypeAlias

from ur_cartesian_driver.motion.errors import error_of_outcome, ErrorCode
from ur_cartesian_driver.motion.pose import Pose
from ur_cartesian_driver.motion.servo import ServoFeedback
from ur_cartesian_driver.motion.state import RobotState
from ur_cartesian_driver.motion.vectors import Vector6, ZERO6


class TrajectoryResult(IntEnum):
    """How the robot program says that a trajectory ended; the numbers on the wire."""

    SUCCESS = 0
    CANCELED = 1
    FAILURE = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class StateReceived:
    """An RTDE packet came in."""

    state: RobotState


@dataclass(frozen=True, slots=True, kw_only=True)
class TrajectoryEnded:
    """The robot program reported the end of a trajectory."""

    result: TrajectoryResult


@dataclass(frozen=True, slots=True, kw_only=True)
class CancelRequested:
    """Somebody wants the motion to stop; the reason is a clause for the outcome's text."""

    reason: str = 'the client cancelled the goal'


@dataclass(frozen=True, slots=True, kw_only=True)
class PreemptRequested:
    """Another motion is to take the place of this one, which has to stop for it."""

    #: Who takes its place, as part of a sentence.
    by: str = 'a newer motion'


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkLost:
    """A connection that the motion needs is gone; the reason is a clause for the error text."""

    link: str
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Tick:
    """Time passed; sent at least every 20 ms so that bounds hold when nothing else happens."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ServoReceived:
    """The robot reported how it gets on with streamed set-points."""

    feedback: ServoFeedback


Event: TypeAlias = (
    StateReceived
    | ServoReceived
    | TrajectoryEnded
    | CancelRequested
    | PreemptRequested
    | LinkLost
    | Tick
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Progress:
    """
    Where a running motion is.

    Poses, twists and accelerations are those of the controlled frame, in the robot's base.
    """

    #: Index of the waypoint the tool is on its way to.
    waypoint: int
    #: Part of the planned time that is done, 0 to 1.
    fraction: float
    desired_pose: Pose
    desired_twist: Vector6 = ZERO6
    #: None = the robot does not report accelerations.
    desired_acceleration: Vector6 | None = None
    actual_pose: Pose
    actual_twist: Vector6 = ZERO6
    actual_acceleration: Vector6 | None = None
    actual_q: Vector6 = ZERO6
    #: Expected time of the desired pose from the start of the motion [s].
    time: float = 0.0
    #: Planned time that is left, at full speed scaling [s].
    time_remaining: float = 0.0
    speed_scaling: float = 1.0
    points_received: int = 0
    #: Motion time of the points on the robot's side that are not begun yet [s].
    buffered: float = 0.0
    #: SERVO: how far the arm is behind the newest set-point, as nominal time [s].
    lag: float = nan
    #: The controller's clock [s].
    timestamp: float = 0.0
    #: Whether the arm rests and the goal waits for more points (keep_open).
    awaiting_points: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """How a goal ended: one code, one sentence, and what was done."""

    code: ErrorCode
    text: str
    report: tuple[str, ...] = ()

    @property
    def succeeded(self) -> bool:
        """Tell whether the goal was reached (or passed all checks, when only these were asked)."""
        return self.code is ErrorCode.SUCCESSFUL

    def raise_for_error(self) -> Outcome:
        """
        Return this outcome if it succeeded, else raise the error of its code.

        ``driver.execute(goal).raise_for_error()`` lets Python code handle failures as exceptions;
        the table of codes and classes is :data:`~ur_cartesian_driver.motion.errors.ERRORS`.

        :raises GoalRefused: nothing has moved.
        :raises ExecutionEnded: the goal ended before its last point. Both carry the text and the
            ``report`` of this outcome.
        """
        if not self.succeeded:
            raise error_of_outcome(self.code, self.text, self.report)
        return self
