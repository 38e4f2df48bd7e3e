# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Events of a running goal, its progress and its outcome."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from math import nan
from typing import TypeAlias

from ur_cartesian_driver.motion.errors import error_of_outcome, ErrorCode
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import Vector3, Vector6, ZERO3, ZERO6
from ur_cartesian_driver.motion.goal.goal import OutputKind, SafeOutput
from ur_cartesian_driver.motion.plan.offset_band import OffsetFeedback
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.motion.state.servo_report import ServoFeedback


class TrajectoryResult(IntEnum):
    """The end of a trajectory, by the number with which the robot program reports it."""

    SUCCESS = 0
    CANCELED = 1
    FAILURE = 2
    #: An awaited input did not come in time. Only our own robot program reports this result and
    #: the following ones.
    INPUT_MISSING = 3
    #: The tool made contact, which ends the trajectory.
    CONTACT = 4
    #: A required contact did not come.
    NO_CONTACT = 5
    #: The tool made contact, and a contact watch that is no part of the goal stopped the arm.
    TOUCHED = 6


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
    """The motion has to stop; the reason is a clause for the text of the outcome."""

    reason: str = 'the client cancelled the goal'


@dataclass(frozen=True, slots=True, kw_only=True)
class PreemptRequested:
    """The motion has to stop because another one preempts it."""

    #: The other motion, as part of a sentence.
    by: str = 'a newer motion'


@dataclass(frozen=True, slots=True, kw_only=True)
class CollisionFound:
    """The rest of the path would collide, because the cell changed; the reason is a clause."""

    reason: str


#: The name of the connection to the RTDE inputs in :class:`LinkLost`.
INPUTS_LINK = 'RTDE inputs'


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkLost:
    """A connection that the motion needs is gone; the reason is a clause for the error text."""

    link: str
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactWatchChanged:
    """The robot program has begun or ended a watch for contact that is no part of the goal."""

    is_active: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Tick:
    """Time passed; sent every 20 ms, so that timeouts expire even if nothing else happens."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ServoReceived:
    """The robot program reported on the set-points that it follows."""

    feedback: ServoFeedback


@dataclass(frozen=True, slots=True, kw_only=True)
class OffsetReceived:
    """The robot program reported the path offset of its trajectory."""

    feedback: OffsetFeedback


@dataclass(frozen=True, slots=True, kw_only=True)
class OutputsSecured:
    """The safe outputs were written to the robot, as far as possible."""

    #: The outputs whose values were changed, each with its value before the change.
    changed: tuple[SafeOutput, ...] = ()
    #: The sentence that names the unwritten outputs and the reason; empty = all were written.
    failure: str = ''


Event: TypeAlias = (
    StateReceived
    | ServoReceived
    | OffsetReceived
    | TrajectoryEnded
    | CancelRequested
    | PreemptRequested
    | CollisionFound
    | LinkLost
    | OutputsSecured
    | ContactWatchChanged
    | Tick
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Progress:
    """
    The progress of a running motion.

    Poses, twists and accelerations belong to the controlled frame, in the robot's base.
    """

    #: Index of the waypoint that the tool moves to.
    waypoint: int
    #: Fraction of the planned time that has passed, 0 to 1.
    fraction: float
    desired_pose: Pose
    desired_twist: Vector6 = ZERO6
    #: None = the robot does not report accelerations; also for ``actual_acceleration``.
    desired_acceleration: Vector6 | None = None
    actual_pose: Pose
    actual_twist: Vector6 = ZERO6
    actual_acceleration: Vector6 | None = None
    #: Joint positions that the controller desires [rad].
    desired_q: Vector6 = ZERO6
    #: Joint velocities that the controller desires [rad/s].
    desired_qd: Vector6 = ZERO6
    #: Measured joint positions [rad].
    actual_q: Vector6 = ZERO6
    #: Measured joint velocities [rad/s].
    actual_qd: Vector6 = ZERO6
    #: Planned time of the desired pose, from the start of the motion [s].
    time: float = 0.0
    #: Planned time that is left if the robot's speed slider is at 100 % [s].
    time_remaining: float = 0.0
    #: The effective speed of the controller (:mod:`~.effective_speed`), 0 to 1.
    speed_scaling: float = 1.0
    points_received: int = 0
    #: Motion time of the points that the robot holds and has not begun [s].
    buffered: float = 0.0
    #: SERVO: nominal time by which the arm is behind the newest set-point [s]; NaN = none.
    lag: float = nan
    #: Time by the controller's clock [s].
    timestamp: float = 0.0
    #: Whether the arm is at rest and the goal waits for more points (keep_open).
    awaiting_points: bool = False
    #: Displacement of the tool by path offsets: along, across, normal [m].
    path_offset: Vector3 = ZERO3
    #: Fraction of the planned speed under a feed override, 0 to 1; whether its signal is valid.
    feed_override: float = 1.0
    feed_is_valid: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class Pulse:
    """A pulse that the robot program has given."""

    output: OutputKind
    pin: int
    #: Number of the pulse among the pulses of this output in the goal, from 0.
    number: int
    #: Time by the controller's clock of the cycle in which the output switched on [s].
    timestamp: float
    #: Measured pose of the TCP in that cycle, in the robot's base; None = the packet of the cycle
    #: was lost, and ``timestamp`` is the time of a later packet.
    pose: Pose | None


@dataclass(frozen=True, slots=True, kw_only=True)
class PathPlace:
    """A place on the path of a goal."""

    #: Index of the point at the end of the segment on which the place lies.
    point: int
    #: Fraction of this segment that lies before the place, 0 to 1: by length; for a joint motion,
    #: by joint travel; for a spline, by time. In the first half of a blend the fraction rises to
    #: 1; the second half belongs to the next segment, whose fraction rises from 0 there.
    fraction: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """The end of a goal: a code, a sentence, and the lines of the goal's report."""

    code: ErrorCode
    text: str
    report: tuple[str, ...] = ()
    #: The place on the path at which the goal was stopped; the arm came to rest some millimetres
    #: farther on. None = the goal succeeded, nothing had moved, or the place is not known.
    stopped: PathPlace | None = None
    #: Whether the goal succeeded because the tool touched something.
    touched: bool = False

    @property
    def succeeded(self) -> bool:
        """Whether the goal was reached (or passed all checks, if only these were requested)."""
        return self.code is ErrorCode.SUCCESSFUL

    def raise_for_error(self) -> Outcome:
        """
        Return this outcome if it succeeded, else raise the error of its code.

        ``driver.execute(goal).raise_for_error()`` lets Python code handle failures as exceptions;
        the table of codes and classes is :data:`~ur_cartesian_driver.motion.errors.ERRORS`.

        :raises GoalRefused: the goal was refused before anything moved; or, as CollisionPredicted,
            the cell changed and the rest of the path would have collided.
        :raises ExecutionEnded: the goal ended before its last point. Like GoalRefused, the error
            carries the text and the ``report`` of this outcome.
        """
        if not self.succeeded:
            raise error_of_outcome(self.code, self.text, self.report)
        return self
