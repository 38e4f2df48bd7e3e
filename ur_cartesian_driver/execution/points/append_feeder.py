# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The feeder of a goal to which points are appended while it runs (keep_open).

The trajectory of the goal is a stream (possible since URCL 2.14): the robot program reads points
until it is told their number. Three rules hold whatever is appended:

* The program never waits for a point while the arm moves: it would fail, or stop the arm abruptly.
  So every append is planned with an *ending* that brings the arm to rest (the last motion, without
  a blend; after a spline a braking piece), and the ending is held back. If no more points have
  come by ``margin`` seconds before the program would ask for the next one, the ending is sent, and
  the stream is closed with the number of its records.
* Sent records cannot be replaced, and a cancelled program has to read all of them. So only
  ``horizon`` seconds of motion are sent ahead.
* Memory does not grow: sent records, and the path behind the arm, are forgotten.

Only goals with keep_open have the states RUNNING_OUT and AWAITING_POINTS
(:mod:`~.goal_transitions`).
"""

from __future__ import annotations

from ur_cartesian_driver.execution.goal.appended_records import AppendedRecords
from ur_cartesian_driver.execution.goal.feeder import Appendable
from ur_cartesian_driver.execution.goal.goal_commands import GoalCommand, SendControl
from ur_cartesian_driver.execution.goal.goal_monitor import GoalMonitor
from ur_cartesian_driver.execution.goal.goal_transitions import GoalState
from ur_cartesian_driver.execution.goal.motion_job import AppendJob
from ur_cartesian_driver.execution.goal.outcome_codes import Meaning
from ur_cartesian_driver.execution.points.point_feeder import PointFeeder
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.protocol.program.reverse import TrajectoryAction

#: Longest wait for more points, before a motion begins that has only an ending [s]. It is short
#: because the robot program waits only half a second for its first point.
FIRST_POINTS_TIMEOUT = 0.25


class AppendFeeder(PointFeeder, Appendable):
    """Sends records up to the horizon, and the ending if nothing is appended in time."""

    def __init__(
        self, monitor: GoalMonitor, *, horizon: float, margin: float, timeout: float
    ) -> None:
        """
        Begin with the records known so far; nothing is sent yet.

        :param horizon: motion time sent to the program ahead of the arm [s].
        :param margin: the stream is closed this long before the robot program would ask for a
            missing point [s].
        :param timeout: longest wait at rest for more points [s]; 0 = no limit.
        """
        super().__init__(monitor)
        self._horizon, self._margin, self.append_timeout = horizon, margin, timeout
        self._appended = AppendedRecords(monitor)
        self.parts = (self._appended,)
        #: Number of records of the goal sent before the present stream.
        self._stream_first_record = 0
        #: Whether the length of the present stream was sent.
        self._is_stream_end_sent = False
        #: Start of the present stream, by the robot's clock [s].
        self._stream_start_time = 0.0

    # ---- points that come ---------------------------------------------------------------------

    def append(self, append_job: AppendJob, state: GoalState) -> list[GoalCommand]:
        """Accept all points or none; return the answer, and the due records."""
        sent = self._window.sent
        answer = self._appended.append(
            append_job, state, sent=sent, sent_until=self.monitor.records.end_time(sent)
        )
        if answer.refusal or state is not GoalState.MOVING:
            return [answer]
        return [answer, *self._release()]

    def supply(self, state: GoalState) -> Meaning:
        """Return the due signal about the supply of points (such as STARVING), or none."""
        return self._appended.supply(
            state,
            runs_out=self._is_running_out(),
            has_more=self.monitor.records.total > self._window.sent,
        )

    def _is_running_out(self) -> bool:
        """Return whether the program is about to ask for a missing point."""
        sent = self._window.sent
        if not self._appended.is_open or sent != self._appended.committed:
            return False
        if sent == self._stream_first_record:
            packet = self.monitor.latest
            time = 0.0 if packet is None else packet.timestamp
            return time - self._stream_start_time >= FIRST_POINTS_TIMEOUT
        request_time = self.monitor.records.request_time(sent)
        return request_time - self.monitor.time() <= self._margin

    # ---- points that go -----------------------------------------------------------------------

    def enter(self, state: GoalState, packet: RobotState) -> list[GoalCommand]:
        """Return the commands that begin a stream, close it with its ending, or cancel it."""
        commands = super().enter(state, packet)
        if state is GoalState.RUNNING_OUT:
            return self._window.send(self._appended.run_out()) + self._end_stream()
        if state is GoalState.AWAITING_POINTS:
            self._appended.rest(self.monitor.records.end_time(self._window.sent))
        return commands

    def _start(self, packet: RobotState) -> list[GoalCommand]:
        self._appended.go_on()
        self._is_stream_end_sent = False
        self._stream_first_record = self._window.sent
        self._stream_start_time = packet.timestamp
        self.monitor.start(packet.points_begun, sent=self._window.sent)
        return [SendControl(action=TrajectoryAction.STREAM_START), *self._release()]

    def _release(self) -> list[GoalCommand]:
        """Send the records up to the horizon, except the ending; close a complete stream."""
        ahead = self.monitor.records.count_until(self.monitor.time() + self._horizon)
        begun, limit = self.monitor.records_begun(), min(ahead, self._appended.committed)
        commands = self._window.release(begun, limit)
        return commands if self._appended.is_open else commands + self._end_stream()

    def _end_stream(self) -> list[GoalCommand]:
        """Send the number of the stream's records once all of them are sent."""
        if self._is_stream_end_sent or self._window.sent != self.monitor.records.total:
            return []
        self._is_stream_end_sent = True
        return [SendControl(action=TrajectoryAction.STREAM_END, count=self._sent_points())]

    def _sent_points(self) -> int:
        return self._window.sent - self._stream_first_record
