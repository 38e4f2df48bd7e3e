# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The feeder of a goal, which sends its motion to the robot, and the capabilities of feeders.

A :class:`~.goal_machine.GoalMachine` knows the state of a goal. It asks its :class:`Feeder` for
commands, and the feeder never changes the state.

Motions differ much: points on a socket, set-points through registers, a person who guides the arm.
A hook for each difference in one class would be empty in most feeders. So whatever only some
motions can do is a *capability*: a small class, from which a feeder inherits, or one of its
:attr:`~Feeder.parts` does. The machine looks all of them up once (:class:`Capabilities`). The
methods of the classes below are right for a motion without the capability.

A new capability is a class here, its line in :class:`Capabilities`, the place in the machine where
it counts, and the feeder or part that has it. The other feeders stay as they are.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from math import nan
from typing import TypeVar

from ur_cartesian_driver.execution.goal.goal_commands import AnswerAppend, GoalCommand
from ur_cartesian_driver.execution.goal.goal_monitor import GoalMonitor
from ur_cartesian_driver.execution.goal.goal_transitions import GoalState
from ur_cartesian_driver.execution.goal.motion_job import AppendJob
from ur_cartesian_driver.execution.goal.outcome_codes import Fault, Meaning, NO_MEANING
from ur_cartesian_driver.motion.events import Event
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import Vector3
from ur_cartesian_driver.motion.plan.offset_band import AppliedOffset, NO_OFFSET
from ur_cartesian_driver.motion.state.robot_state import RobotState

T = TypeVar('T')


class Feeder(ABC):
    """Sends the robot the motion of one goal."""

    #: Objects with capabilities that the feeder itself does not have.
    parts: tuple[object, ...] = ()

    def __init__(self, monitor: GoalMonitor) -> None:
        """Prepare; nothing is sent yet."""
        self.monitor = monitor

    @abstractmethod
    def enter(self, state: GoalState, packet: RobotState) -> list[GoalCommand]:
        """
        Return the commands at the beginning of a state: START or CANCEL, for example.

        :param packet: the newest packet of the robot.
        """

    @abstractmethod
    def feed(self, event: Event, now: float) -> list[GoalCommand]:
        """
        Return the next piece of the motion, in answer to a packet of the robot.

        A packet of its state comes in MOVING only, and after all conclusions from it; a packet of
        its registers comes in every state, and before any conclusion.

        :param now: time of a steady clock [s].
        """

    @property
    @abstractmethod
    def buffered(self) -> float:
        """Motion time that the robot has received and not yet run [s]."""


class Prepared:
    """The robot has to be prepared before the motion."""

    #: The name of the motion in the sentence that another client has the robot's inputs.
    motion = ''

    def prepare(self) -> list[GoalCommand]:
        """Return the commands that prepare the robot."""
        return []

    def explain_not_ready(self, packet: RobotState | None) -> str:
        """
        Return why the motion cannot begin yet, as a clause, or ''.

        :param packet: the newest packet of the robot, None before the first.
        """
        return ''


class Appendable:
    """The client appends points while the goal runs, or replaces the tail of its motion."""

    #: How long a goal waits at rest for more points [s]; 0 = without limit.
    append_timeout = 0.0

    def append(self, append_job: AppendJob, state: GoalState) -> list[GoalCommand]:
        """Take all points or none; return the answer, and the commands that follow at once."""
        return [AnswerAppend(number=append_job.number, refusal='The goal is not open.')]

    def supply(self, state: GoalState) -> Meaning:
        """Return the signal for running out of points, or for points that came at rest."""
        return NO_MEANING


class Steerable:
    """The motion follows live targets."""

    def set_target(self, T_base_tcp: Pose, age: float, now: float) -> None:
        """
        Take a live target.

        :param age: how long ago it was true [s].
        :param now: time of a steady clock [s].
        """


class Displaceable:
    """Offsets displace the path while the arm moves (path_offset)."""

    def set_offset(self, offset: Vector3, age: float, now: float) -> None:
        """
        Take an offset.

        :param offset: along the path, across it and normal to both [m].
        :param age: how long ago it was true [s].
        :param now: time of a steady clock [s].
        """


class Displaced:
    """The tool is beside the path of the goal, because offsets displace it."""

    def applied_offset(self, packet: RobotState) -> AppliedOffset:
        """Return the offset at the place of the controller's target."""
        return NO_OFFSET


class Ageing:
    """Values from clients grow old, or warnings become due, while the motion goes on."""

    def age(self, now: float) -> list[GoalCommand]:
        """
        Let time pass, and return the warnings that are due.

        :param now: time of a steady clock [s].
        """
        return []


class Stallable:
    """The motion waits for an arm that is off its path (on_path_tolerance: STALL)."""

    def wait_out(self, fault: Fault | None, packet: RobotState) -> Fault | None:
        """Return the fault of a motion, unless the motion waits until it goes away."""
        return fault


class Interpreting:
    """The robot answers with events that motions of points do not have."""

    def interpret(self, event: Event, state: GoalState) -> Meaning | None:
        """Return the meaning of an event; None leaves that to the machine."""
        return None


class Streaming:
    """The driver streams set-points, and itself knows how far the robot is."""

    @property
    def lag(self) -> float:
        """The time by which the arm is behind the newest set-point [s]; NaN = there are none."""
        return nan

    @property
    def has_progress(self) -> bool:
        """Whether progress reports have anything to report yet."""
        return True

    def motions_begun(self, packet: RobotState) -> tuple[int | None, int]:
        """
        Return the number of motions that the robot has begun, and the lag of its target.

        :returns: the count since START (None = unknown), and the most motions by which the
            controller's target is behind it.
        """
        return packet.points_begun, 0

    def is_read(self, now: float) -> bool:
        """Tell whether the robot program has read a set-point lately: then the arm may stand."""
        return False

    def has_arrived(self, packet: RobotState) -> bool:
        """Tell whether an arm that stands after the last point will stay there."""
        return True

    def reports(self) -> list[GoalCommand]:
        """Return the commands that accompany each progress report."""
        return []


class Phrasing:
    """The outcome has sentences of its own."""

    def success_text(self) -> str:
        """Return the sentence of a success; '' = the one of points."""
        return ''

    def location(self, *, started: bool) -> str:
        """Return the place or time of the end, as a clause; '' = the place among the points."""
        return ''


class Reporting:
    """The report of the goal has further lines."""

    @property
    def report(self) -> tuple[str, ...]:
        """The lines."""
        return ()


class Capabilities:
    """The capabilities of a feeder; the ones that it lacks do nothing."""

    def __init__(self, feeder: Feeder) -> None:
        """Look them up in the feeder and its parts."""

        def all_of(kind: type[T]) -> tuple[T, ...]:
            return tuple(each for each in (feeder, *feeder.parts) if isinstance(each, kind))

        def one_of(kind: type[T]) -> T:
            return (*all_of(kind), kind())[0]

        self.preparation = one_of(Prepared)
        self.appending = one_of(Appendable)
        self.steering = one_of(Steerable)
        self.displacing = one_of(Displaceable)
        self.displacement = one_of(Displaced)
        self.stalling = one_of(Stallable)
        self.interpretation = one_of(Interpreting)
        self.streaming = one_of(Streaming)
        self.phrasing = one_of(Phrasing)
        self.ageing = all_of(Ageing)
        self.reporting = all_of(Reporting)


def how_often(count: int) -> str:
    """Return a count of 1 or more in words, for a report."""
    return 'once' if count == 1 else f'{count} times'
