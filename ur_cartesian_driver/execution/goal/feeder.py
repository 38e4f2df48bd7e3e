# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
What gives the robot the motion of a goal: points, set-points, or a person's hand.

A :class:`~.goal_machine.GoalMachine` knows in which state a goal is. It asks its feeder what to
send in that state, and what the answers of the robot mean; the feeder never changes the state.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from math import nan

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


class Feeder(ABC):
    """Gives the robot the motion of one goal; the defaults are those of points sent at once."""

    #: How long a goal waits at rest for more points [s]; 0 = without limit.
    append_timeout = 0.0
    #: Time from the start of the goal to that of its motion [s].
    start_delay = 0.0

    def __init__(self, monitor: GoalMonitor) -> None:
        """
        Prepare; nothing is sent yet.

        :param monitor: that of the goal.
        """
        self.monitor = monitor

    # ---- what to send -------------------------------------------------------------------------

    def prepare(self) -> list[GoalCommand]:
        """Return what to send before the motion may begin."""
        return []

    def explain_not_ready(self, packet: RobotState | None) -> str:
        """
        Return why the motion cannot begin yet, as a clause; empty if it can.

        :param packet: the newest packet of the robot, None before the first.
        """
        return ''

    @abstractmethod
    def enter(self, state: GoalState, packet: RobotState) -> list[GoalCommand]:
        """
        Return what to send because the goal enters a state: START or CANCEL, for example.

        :param packet: the newest packet of the robot.
        """

    def feed(self) -> list[GoalCommand]:
        """Return what to send next; called in MOVING, after each packet."""
        return []

    def append(self, append_job: AppendJob, state: GoalState) -> AnswerAppend:
        """Take or refuse points that the client appends."""
        return AnswerAppend(number=append_job.number, refusal='The goal is not open.')

    def set_target(self, T_base_tcp: Pose, age: float, now: float) -> bool:
        """
        Take a live target; False = the goal follows none.

        :param age: how long ago it was true [s].
        :param now: time of a steady clock [s].
        """
        return False

    def set_path_offset(self, offset: Vector3, age: float, now: float) -> bool:
        """
        Take a path offset; False = the goal permits none.

        :param offset: along the path, across it and normal to both [m].
        :param age: how long ago it was true [s].
        :param now: time of a steady clock [s].
        """
        return False

    # ---- what the robot confirms --------------------------------------------------------------

    def take(self, event: Event, now: float) -> list[GoalCommand]:
        """
        Take note of an event, and return what answers it at once, in whatever state.

        :param now: time of a steady clock [s].
        """
        return []

    def interpret(self, event: Event, state: GoalState) -> Meaning | None:
        """Return what an event means to the goal; None leaves that to the machine."""
        return None

    def supply(self, state: GoalState) -> Meaning:
        """Return what it means how many points there are to send."""
        return NO_MEANING

    def motions_begun(self, packet: RobotState) -> tuple[int | None, int]:
        """
        Return how many motions the robot reports as begun, and how far its target may be behind.

        :returns: the count since START (None = the robot reports none), and by how many motions
            the controller's target may be behind it.
        """
        return (packet.points_begun if self.monitor.job.reports_points_begun else None), 0

    def applied_offset(self, packet: RobotState) -> AppliedOffset:
        """Return how far the path has given way where the arm is."""
        return NO_OFFSET

    def wait_out(self, fault: Fault | None, packet: RobotState) -> Fault | None:
        """
        Return the fault that ends the goal, after a look at one that may go away by itself.

        Called with every packet while the robot program runs points.
        """
        return fault

    def confirms(self, now: float) -> bool:
        """Tell whether the robot program reads what it gets, so that the arm may stand still."""
        return False

    def has_arrived(self, packet: RobotState) -> bool:
        """Tell whether an arm that stands after the last point will not move again by itself."""
        return True

    # ---- what to report -----------------------------------------------------------------------

    @property
    @abstractmethod
    def buffered(self) -> float:
        """Motion time that the robot has got and not yet run [s]."""

    @property
    def lag(self) -> float:
        """How far the arm is behind the newest set-point [s]; NaN = there are no set-points."""
        return nan

    @property
    def has_progress(self) -> bool:
        """Whether the robot has begun what progress reports are about."""
        return True

    def extra_reports(self) -> list[GoalCommand]:
        """Return what is reported with each progress report."""
        return []

    def success_text(self) -> str:
        """Return the sentence of a goal that has succeeded."""
        points = self.monitor.records.points
        what = 'The point was' if points == 1 else f'All {points} points were'
        return f'{what} executed in {self.monitor.scaled_time:.3f} s.'

    def location(self, *, started: bool) -> str:
        """Return where the goal ended, as a clause."""
        if not started:
            return 'before anything moved'
        return self.monitor.script_call()[1] or f'on the way to point {self.monitor.waypoint()}'

    def report_lines(self) -> tuple[str, ...]:
        """Return what the outcome reports beyond its sentence."""
        return ()
