# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Feeds a goal to which points are appended while it runs (keep_open).

Its trajectory is a stream of the wire dialect 2.14: the robot program reads points until it is
sent their number. Three things hold, whoever appends:

* The program never waits for a point while the arm moves: it would fail, or stop the arm the hard
  way. So every append is planned with an *ending* that brings the arm to rest (the last motion,
  without a blend; behind a spline a braking piece), and the ending is held back. Where nothing
  else has come ``margin`` before the program would ask, the ending is sent, and the stream is
  closed with the number of its records.
* What was sent is final, so little is sent: as many seconds as ``horizon``. A program that is
  cancelled has to read all of it.
* Memory does not grow: records that were sent, and the path behind the arm, are forgotten.

The states RUNNING_OUT and AWAITING_POINTS are of these goals only (:mod:`~.goal_transitions`).
"""

from __future__ import annotations

from dataclasses import dataclass

from ur_cartesian_driver.execution.goal.appended_records import AppendedRecords
from ur_cartesian_driver.execution.goal.feeder import Feeder
from ur_cartesian_driver.execution.goal.goal_commands import (
    AnswerAppend,
    GoalCommand,
    SendControl,
    SendPoints,
)
from ur_cartesian_driver.execution.goal.goal_monitor import GoalMonitor
from ur_cartesian_driver.execution.goal.goal_transitions import GoalState, is_at_rest
from ur_cartesian_driver.execution.goal.motion_job import AppendJob
from ur_cartesian_driver.execution.goal.outcome_codes import GoalSignal, Meaning, NO_MEANING
from ur_cartesian_driver.execution.points.send_window import SendWindow
from ur_cartesian_driver.motion.state.robot_state import RobotState
from ur_cartesian_driver.protocol.program.reverse import TrajectoryAction

#: How long a motion that is only its ending so far waits for more before it begins [s]: the robot
#: program waits half a second for its first point.
FIRST_POINTS_TIMEOUT = 0.25


@dataclass(frozen=True, slots=True, kw_only=True)
class AppendSettings:
    """How far ahead the robot gets its points, and how long it waits for them."""

    #: Planned time of the motion that the robot program has and has not run [s].
    horizon: float = 1.0
    #: The stream is closed this long before the robot program would ask for a point that is not
    #: there [s].
    margin: float = 0.2
    #: How long the goal waits at rest for more points [s]; 0 = without limit.
    timeout: float = 30.0


class AppendFeeder(Feeder):
    """Sends records up to the horizon, and the ending where nothing is appended in time."""

    def __init__(self, monitor: GoalMonitor, settings: AppendSettings | None = None) -> None:
        """Prepare what is known so far."""
        super().__init__(monitor)
        self._settings = settings if settings is not None else AppendSettings()
        self.append_timeout = self._settings.timeout
        self._window = SendWindow()
        self._appended = AppendedRecords(monitor)
        #: How many were sent before this stream, and whether its number was sent.
        self._stream_first_record = 0
        self._is_stream_end_sent = False
        #: When it was begun, by the robot's clock [s].
        self._stream_start_time = 0.0
        #: Whether the arm has come to rest there and has not gone on.
        self._is_resting = False

    # ---- points that come ---------------------------------------------------------------------

    def append(self, append_job: AppendJob, state: GoalState) -> AnswerAppend:
        """Take all points or none."""
        sent = self._window.sent
        sent_until = self.monitor.records.end_time(sent)
        return self._appended.append(append_job, state, sent=sent, sent_until=sent_until)

    def supply(self, state: GoalState) -> Meaning:
        """Return whether points run out, or whether a goal that waits at rest goes on."""
        if state is GoalState.MOVING and self._is_running_out():
            return GoalSignal.STARVING, ''
        if state is not GoalState.AWAITING_POINTS:
            return NO_MEANING
        if self.monitor.records.total == self._window.sent:
            return NO_MEANING if self._appended.is_open else (GoalSignal.NO_MORE_POINTS, '')
        packet = self.monitor.latest
        # Packets may be late: one that shows the arm at rest says from where it goes on.
        if packet is None or not is_at_rest(packet):
            return NO_MEANING
        moved = self.monitor.rest_offset(packet)
        return (GoalSignal.APPENDED, '') if moved is None else (GoalSignal.DEVIATION, moved)

    def _is_running_out(self) -> bool:
        """Tell whether the program is about to ask for a point that is not there."""
        sent = self._window.sent
        if not self._appended.is_open or sent != self._appended.committed:
            return False
        if sent == self._stream_first_record:
            return self._robot_time() - self._stream_start_time >= FIRST_POINTS_TIMEOUT
        request_time = self.monitor.records.request_time(sent)
        return request_time - self.monitor.time() <= self._settings.margin

    def _robot_time(self) -> float:
        packet = self.monitor.latest
        return 0.0 if packet is None else packet.timestamp

    # ---- points that go -----------------------------------------------------------------------

    def enter(self, state: GoalState, packet: RobotState) -> list[GoalCommand]:
        """Return what begins a stream, closes it with its ending, or cancels it."""
        match state:
            case GoalState.MOVING:
                return self._begin_stream(packet)
            case GoalState.RUNNING_OUT:
                return self._send_ending()
            case GoalState.AWAITING_POINTS:
                self._is_resting = True
                self.monitor.finish(self.monitor.records.end_time(self._window.sent))
            case GoalState.CANCELLING:
                count = self._window.sent - self._stream_first_record
                return [SendControl(action=TrajectoryAction.CANCEL, count=count)]
        return []

    def _begin_stream(self, packet: RobotState) -> list[GoalCommand]:
        self._is_stream_end_sent = self._is_resting = False
        self._stream_first_record, self._stream_start_time = self._window.sent, packet.timestamp
        self.monitor.start(packet.points_begun, sent=self._window.sent)
        return [SendControl(action=TrajectoryAction.STREAM_START), *self.feed()]

    def feed(self) -> list[GoalCommand]:
        """Return the records up to the horizon, without the ending."""
        ahead = self.monitor.records.count_until(self.monitor.time() + self._settings.horizon)
        first, end = self._window.release(
            self.monitor.records_begun(), min(ahead, self._appended.committed)
        )
        commands: list[GoalCommand] = [SendPoints(first=first, end=end)] if end > first else []
        return commands if self._appended.is_open else commands + self._end_stream()

    def _send_ending(self) -> list[GoalCommand]:
        first, end = self._window.sent, self._appended.run_out()
        self._window.sent = end
        commands: list[GoalCommand] = [SendPoints(first=first, end=end)] if end > first else []
        return commands + self._end_stream()

    def _end_stream(self) -> list[GoalCommand]:
        """Return the number of the stream's records, once all of them are sent."""
        sent = self._window.sent
        if self._is_stream_end_sent or sent != self.monitor.records.total:
            return []
        self._is_stream_end_sent = True
        count = sent - self._stream_first_record
        return [SendControl(action=TrajectoryAction.STREAM_END, count=count)]

    # ---- what to report -----------------------------------------------------------------------

    @property
    def buffered(self) -> float:
        """Planned time of what was sent and lies ahead of the arm [s]."""
        return self.monitor.buffered(self._window.sent)

    def location(self, *, started: bool) -> str:
        """Return where the goal ended, as a clause."""
        if self._is_resting:
            return f'at rest behind point {self._appended.last_stop_point}, waiting for more'
        return super().location(started=started)

    def report_lines(self) -> tuple[str, ...]:
        """Return how often the arm had to wait for points."""
        return self._appended.report_lines
