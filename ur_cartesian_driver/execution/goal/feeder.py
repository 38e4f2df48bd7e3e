# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The feeder, which sends the motion of a goal to the robot, and the capabilities of feeders.

A :class:`~.goal_machine.GoalMachine` knows the state of a goal. It asks its :class:`Feeder` for
commands, and the feeder never changes the state.

Motions differ greatly: points on a socket, set-points through registers, a person who guides the
arm. One base class with a hook for each difference would leave most hooks empty in most feeders.
So a feature of only some motions is a *capability*: a small class from which the feeder, or one of
its :attr:`~Feeder.parts`, inherits. The machine looks up the capabilities once
(:class:`Capabilities`). The methods of a capability class are the defaults for feeders without
that capability.

The word feed has two meanings here. A feeder *feeds* the robot (:meth:`Feeder.feed`). Names with
``feed_``, and :class:`~.feed_state.FeedState`, are about the *feed* of machine tools: the speed of
a motion, as a fraction of the planned one (``feed_override``).

To add a capability, write its class here, add a line to :class:`Capabilities`, use it in the
machine, and derive the feeder or part that has it from the class. The other feeders need no
change.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from math import nan
from typing import TypeVar

from ur_cartesian_driver.execution.goal.feed_state import FeedState, FULL_FEED
from ur_cartesian_driver.execution.goal.goal_commands import AnswerAppend, GoalCommand
from ur_cartesian_driver.execution.goal.goal_monitor import GoalMonitor
from ur_cartesian_driver.execution.goal.goal_transitions import GoalState
from ur_cartesian_driver.execution.goal.motion_job import AppendJob
from ur_cartesian_driver.execution.goal.outcome_codes import Fault, Meaning, NO_MEANING
from ur_cartesian_driver.motion.events import Event
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import Vector3
from ur_cartesian_driver.motion.plan.offset_band import AppliedOffset, NO_OFFSET
from ur_cartesian_driver.motion.state.rtde_state import RobotState

T = TypeVar('T')


class Feeder(ABC):
    """Sends the robot the motion of one goal."""

    #: Objects with capabilities that the feeder itself does not have.
    parts: tuple[object, ...] = ()

    def __init__(self, monitor: GoalMonitor) -> None:
        """Keep the monitor of the goal; nothing is sent yet."""
        self.monitor = monitor

    def add_part(self, part: object) -> None:
        """Give the feeder more capabilities, before a machine looks them up."""
        self.parts = (part, *self.parts)

    @abstractmethod
    def enter(self, state: GoalState, packet: RobotState) -> list[GoalCommand]:
        """
        Return the commands on entering a state, for example START or CANCEL.

        :param packet: the newest packet of the robot.
        """

    @abstractmethod
    def feed(self, event: Event, now: float) -> list[GoalCommand]:
        """
        Return the commands that send the next piece of the motion after a packet of the robot.

        A ``StateReceived`` is passed in the state MOVING only, after the machine has acted on it.
        Reports through registers (``ServoReceived``, ``OffsetReceived``) are passed in every
        state, before the machine acts on them.

        :param now: time of a steady clock [s].
        """

    @property
    @abstractmethod
    def buffered(self) -> float:
        """Motion time that the robot has received and not yet run [s]."""


class Prepared:
    """The robot has to be prepared before the motion."""

    #: The kind of motion, for the error message if another client holds the robot's RTDE inputs.
    motion = ''

    def prepare(self) -> list[GoalCommand]:
        """Return the commands that prepare the robot."""
        return []

    def explain_not_ready(self, packet: RobotState | None) -> str:
        """
        Return the reason why the motion cannot begin yet, as a clause; '' = none.

        :param packet: the newest packet of the robot; None before the first packet.
        """
        return ''


class Appendable:
    """The client can append points while the goal runs, or replace the tail of the motion."""

    #: Longest wait at rest for more points [s]; 0 = no limit.
    append_timeout = 0.0

    def append(self, append_job: AppendJob, state: GoalState) -> list[GoalCommand]:
        """Accept all points or none; return the answer, and the commands that follow at once."""
        return [AnswerAppend(number=append_job.number, refusal='The goal is not open.')]

    def supply(self, state: GoalState) -> Meaning:
        """Return the signal about the supply of points that is due now, such as STARVING."""
        return NO_MEANING


class Steerable:
    """The motion follows live targets."""

    def set_target(self, T_base_tcp: Pose, age: float, now: float) -> None:
        """
        Accept a live target.

        :param age: how old the target is on arrival [s].
        :param now: time of a steady clock [s].
        """


class Displaceable:
    """Offsets displace the path while the arm moves (path_offset)."""

    def set_offset(self, offset: Vector3, age: float, now: float) -> None:
        """
        Accept an offset.

        :param offset: along the path, across it and normal to both [m].
        :param age: how old the offset is on arrival [s].
        :param now: time of a steady clock [s].
        """


class Displaced:
    """The tool is off the path of the goal because offsets displace it."""

    def applied_offset(self, packet: RobotState) -> AppliedOffset:
        """Return the offset of the pose that the controller commands now (its target)."""
        return NO_OFFSET


class Overridable:
    """A signal overrides the feed of the motion while the arm moves (feed_override)."""

    def set_feed(self, fraction: float, age: float, now: float) -> None:
        """
        Accept a value of the signal.

        :param fraction: fraction of the planned speed.
        :param age: how old the value is on arrival [s].
        :param now: time of a steady clock [s].
        """

    def observe_feed(self, packet: RobotState, now: float) -> FeedState:
        """
        Read the signal if an input of the robot gives it, and return the feed of the motion.

        :param packet: the newest packet of the robot.
        :param now: time of a steady clock [s].
        """
        return FULL_FEED


class Ageing:
    """Values from clients grow old, or warnings become due, while the motion goes on."""

    def age(self, now: float) -> list[GoalCommand]:
        """
        Drop stale values, and return the due warnings.

        :param now: time of a steady clock [s].
        """
        return []


class Stallable:
    """The motion waits for an arm that is off its path (on_path_tolerance: STALL)."""

    def wait_out(self, fault: Fault | None, packet: RobotState) -> Fault | None:
        """Return the fault, or None while the motion waits for the fault to go away."""
        return fault


class Interpreting:
    """The robot answers with events that do not occur in motions sent as points."""

    def interpret(self, event: Event, state: GoalState) -> Meaning | None:
        """Return the meaning of an event; None = the machine interprets the event."""
        return None


class Streaming:
    """The driver streams set-points, and so knows the robot's progress itself."""

    @property
    def lag(self) -> float:
        """The time by which the arm lags the newest set-point [s]; NaN = no set-points."""
        return nan

    @property
    def has_progress(self) -> bool:
        """Whether there is any progress to report yet."""
        return True

    def motions_begun(self, packet: RobotState) -> tuple[int | None, int]:
        """
        Return the number of motions that the robot has begun, and how far its target can lag it.

        :returns: the count since START (None = unknown), and the largest number of motions by
            which the controller's target lags behind that count.
        """
        return packet.points_begun, 0

    def is_read(self, now: float) -> bool:
        """Return whether the program has read a set-point lately; then a still arm is no fault."""
        return False

    def has_arrived(self, packet: RobotState) -> bool:
        """Return whether an arm that stands still after the last point will stay there."""
        return True

    def reports(self) -> list[GoalCommand]:
        """Return the commands that accompany each progress report."""
        return []


class Phrasing:
    """The outcome has its own texts, not the default ones for motions sent as points."""

    def success_text(self) -> str:
        """Return the sentence for a success; '' = the sentence about points."""
        return ''

    def location(self, *, started: bool) -> str:
        """Return when or where the motion ended, as a clause; '' = the monitor names the place."""
        return ''


class Reporting:
    """The report of the goal has further lines."""

    @property
    def report(self) -> tuple[str, ...]:
        """The further lines of the report."""
        return ()


class Capabilities:
    """The capabilities of a feeder; for each that it lacks, an object with the default methods."""

    def __init__(self, feeder: Feeder) -> None:
        """Look up the capabilities of the feeder and its parts."""

        def all_of(kind: type[T]) -> tuple[T, ...]:
            return tuple(each for each in (feeder, *feeder.parts) if isinstance(each, kind))

        def one_of(kind: type[T]) -> T:
            found, *others = *all_of(kind), kind()
            assert len(others) <= 1, f'{kind.__name__} has two providers'
            return found

        self.preparation = one_of(Prepared)
        self.appending = one_of(Appendable)
        self.steering = one_of(Steerable)
        self.displacing = one_of(Displaceable)
        self.displacement = one_of(Displaced)
        self.overriding = one_of(Overridable)
        self.stalling = one_of(Stallable)
        self.interpretation = one_of(Interpreting)
        self.streaming = one_of(Streaming)
        self.phrasing = one_of(Phrasing)
        self.ageing = all_of(Ageing)
        self.reporting = all_of(Reporting)


def counted(count: int, noun: str) -> str:
    """Return a count with its noun and verb, for a report: "1 path offset was"."""
    return f'1 {noun} was' if count == 1 else f'{count} {noun}s were'


def how_often(count: int) -> str:
    """Return a count of 1 or more in words, for a report."""
    return 'once' if count == 1 else f'{count} times'
