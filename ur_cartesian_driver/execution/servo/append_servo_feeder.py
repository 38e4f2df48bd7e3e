# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Feeds a goal with keep_open through the buffered servo.

The driver makes the set-points, so only those that were made are final: the rest of the curve is
replaced in an instant, its ending too. A goal whose set-points reach the ending comes to rest
(RUNNING_OUT, :mod:`~ur_cartesian_driver.execution.goal.goal_transitions`); what comes then begins
there.
"""

from __future__ import annotations

from math import inf

from ur_cartesian_driver.execution.goal.appended_records import AppendedRecords
from ur_cartesian_driver.execution.goal.goal_commands import AnswerAppend, GoalCommand
from ur_cartesian_driver.execution.goal.goal_monitor import GoalMonitor
from ur_cartesian_driver.execution.goal.goal_transitions import GoalState, is_at_rest
from ur_cartesian_driver.execution.goal.motion_job import AppendJob
from ur_cartesian_driver.execution.goal.outcome_codes import GoalSignal, Meaning, NO_MEANING
from ur_cartesian_driver.execution.servo.servo_feeder import ServoFeeder
from ur_cartesian_driver.execution.servo.servo_stream import (
    ServoPhase,
    ServoSettings,
    ServoStream,
)
from ur_cartesian_driver.execution.servo.setpoint_source import SplineSetpoints
from ur_cartesian_driver.motion.events import Event, ServoReceived
from ur_cartesian_driver.motion.plan.joint_spline import JointSpline, SAME_TIME
from ur_cartesian_driver.motion.state.robot_state import RobotState


class AppendServoFeeder(ServoFeeder):
    """Streams a curve that is appended to, and whose tail is replaced."""

    def __init__(self, monitor: GoalMonitor, settings: ServoSettings, timeout: float) -> None:
        """
        Prepare the first points.

        :param timeout: how long the goal waits at rest for more points [s]; 0 = without limit.
        """
        assert monitor.job.spline is not None
        self._source = SplineSetpoints(monitor.job.spline)
        super().__init__(monitor, ServoStream(self._source, settings))
        self.append_timeout = timeout
        self._appended = AppendedRecords(monitor)
        #: What begins where the arm comes to rest.
        self._next_spline: JointSpline | None = None
        self._stop_time = inf

    # ---- points that come ---------------------------------------------------------------------

    def append(self, append_job: AppendJob, state: GoalState) -> AnswerAppend:
        """Take all points or none."""
        self._notice_ending()
        answer = self._appended.append(append_job, state, sent_until=self._source.time)
        job = append_job.job
        if job is None or answer.refusal:
            return answer
        assert job.spline is not None
        if self._stop_time == inf:
            self._source.replace_tail(job.spline)
        elif self._next_spline is None:
            self._next_spline = job.spline
        else:
            self._next_spline = self._next_spline.followed_by(job.spline, self._stop_time)
        self._spline = self._source.spline
        return answer

    def _notice_ending(self) -> None:
        """Commit the ending once a set-point of it was made."""
        records = self.monitor.records
        if (
            self._stop_time == inf
            and self._appended.is_open
            and self._source.time >= records.end_time(self._appended.committed) - SAME_TIME
        ):
            self._stop_time = records.end_time(self._appended.run_out())

    def supply(self, state: GoalState) -> Meaning:
        """Return whether points run out, or whether a goal that waits at rest goes on."""
        self._notice_ending()
        if state is GoalState.MOVING and self._stop_time < inf:
            return GoalSignal.STARVING, ''
        if state is not GoalState.AWAITING_POINTS:
            return NO_MEANING
        if self._next_spline is None:
            return NO_MEANING if self._appended.is_open else (GoalSignal.NO_MORE_POINTS, '')
        packet = self.monitor.latest
        if packet is None or not is_at_rest(packet):
            return NO_MEANING
        return GoalSignal.APPENDED, ''

    # ---- set-points that go -------------------------------------------------------------------

    def enter(self, state: GoalState, packet: RobotState) -> list[GoalCommand]:
        """Go on with what was appended at rest."""
        if state is GoalState.AWAITING_POINTS:
            self.monitor.finish(self._stop_time)
        elif state is GoalState.MOVING and self._next_spline is not None:
            self._source.replace_tail(self._next_spline)
            self._spline = self._source.spline
            self._next_spline, self._stop_time = None, inf
        return super().enter(state, packet)

    def interpret(self, event: Event, state: GoalState) -> Meaning | None:
        """Return what an answer of the servo means to the goal."""
        if isinstance(event, ServoReceived) and self.stream.phase is ServoPhase.ARRIVED:
            packet = self.monitor.latest
            if state is GoalState.RUNNING_OUT and packet is not None and is_at_rest(packet):
                return GoalSignal.SUCCESS, ''
            if self._stop_time < inf:  # it runs out with the next packet
                return NO_MEANING
        return super().interpret(event, state)

    # ---- what to report -----------------------------------------------------------------------

    def location(self, *, started: bool) -> str:
        """Return where the goal ended, as a clause."""
        if self._stop_time < inf and self.stream.phase is ServoPhase.ARRIVED:
            return f'at rest behind point {self._appended.last_stop_point}, waiting for more'
        return super().location(started=started)

    def report_lines(self) -> tuple[str, ...]:
        """Return how often the arm had to wait, for points and to be back on its path."""
        return (*self._appended.report_lines, *super().report_lines())
