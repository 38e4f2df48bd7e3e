# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The machine of a goal that is continued while it runs (keep_open).

Its trajectory is a stream of the wire dialect 2.14: the robot program reads points until it is
told how many they are. Three things have to hold, whoever supplies the points:

* The program never waits for a point while the arm moves: it would fail, or stop the arm the hard
  way. So what comes at the end for now (the *ending*: the last motion, without a blend; behind a
  spline a piece to rest) is planned together with every point, and kept back. Where nothing else
  has come ``margin`` before the program would ask, the ending is sent, and the stream is closed
  with the number of its records.
* What was sent is final, so little is sent: as many seconds as ``horizon`` says. A program that
  is told to cancel has to read all of it.
* Memory does not grow: what was sent, and the path that was passed, are forgotten.

The states RUNNING_OUT and AWAITING_POINTS are of these goals only (:mod:`~.states`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf

from ur_cartesian_driver.execution.goal.goal_commands import (
    AnswerAppend,
    GoalCommand,
    ReportProgress,
    SendControl,
    SendPoints,
)
from ur_cartesian_driver.execution.goal.goal_machine import GoalMachine
from ur_cartesian_driver.execution.goal.monitor import MAX_PLAN_DEVIATION
from ur_cartesian_driver.execution.goal.motion_job import AppendJob, MotionJob
from ur_cartesian_driver.execution.goal.states import GoalSignal, GoalState
from ur_cartesian_driver.execution.goal.temporary_tcp import REST_SPEED
from ur_cartesian_driver.motion.events import Event
from ur_cartesian_driver.motion.state import RobotState
from ur_cartesian_driver.protocol.program.reverse import TrajectoryAction

#: How long a motion that is only its ending so far waits for more before it begins [s]: the robot
#: program waits half a second for its first point.
FIRST_POINTS_TIMEOUT = 0.25

#: In these a goal takes more points.
_ACCEPTS_POINTS = frozenset(
    {GoalState.ARMING, GoalState.MOVING, GoalState.RUNNING_OUT, GoalState.AWAITING_POINTS}
)


@dataclass(frozen=True, slots=True, kw_only=True)
class AppendSettings:
    """How far ahead the robot gets its points, and how long it waits for them."""

    #: Planned time of the motion that the robot program has and has not run [s].
    horizon: float = 1.0
    #: So long before the robot program would ask for a point that is not there, the motion is
    #: closed [s].
    margin: float = 0.2
    #: How long the goal waits at rest for more points [s]; 0 = without end.
    timeout: float = 30.0


class AppendMachine(GoalMachine):
    """One goal with an open end; see the module's description."""

    def __init__(
        self,
        job: MotionJob,
        *,
        settings: AppendSettings | None = None,
        feedback_period: float = 0.04,
        max_plan_deviation: tuple[float, float] = MAX_PLAN_DEVIATION,
        resume_after_stop: bool = False,
    ) -> None:
        """Take the order of what is known so far; nothing happens before :meth:`start`."""
        super().__init__(
            job,
            feedback_period=feedback_period,
            max_plan_deviation=max_plan_deviation,
            resume_after_stop=resume_after_stop,
        )
        self._settings = settings if settings is not None else AppendSettings()
        #: Whether more points may come.
        self._is_open = True
        #: How many records will be sent whatever comes: all but the ending.
        self._committed = job.points - job.ending_records
        #: How many were sent before this stream, and whether its number was told.
        self._stream_first_record = 0
        #: When it was begun, by the robot's clock [s].
        self._stream_start_time = 0.0
        self._is_stream_end_sent = False
        #: How often the motion was closed, and where the last time.
        self._stop_count = self._last_stop_point = 0
        #: Whether the arm has come to rest there and has not gone on.
        self._is_resting = False

    def step(self, event: Event | AppendJob, now: float) -> list[GoalCommand]:
        """Return what to do after an event, or after points that came."""
        if not isinstance(event, AppendJob):
            return super().step(event, now)
        refusal = self._refusal(event)
        if refusal is not None:
            return [refusal]
        self._accept(event)
        return [AnswerAppend(number=event.number), *self._continue_motion(now)]

    # ---- points that come ---------------------------------------------------------------------

    def _refusal(self, append_job: AppendJob) -> AnswerAppend | None:
        """Return why points are not taken, or None."""
        number = append_job.number
        if not self._is_open:
            return AnswerAppend(
                number=number, refusal=('The last points of the goal were said to be the last.')
            )
        if self.state not in _ACCEPTS_POINTS:
            return AnswerAppend(number=number, refusal='The goal is ending.')
        if append_job.job is not None and append_job.records_before != self._committed:
            return AnswerAppend(
                number=number,
                replan_from_rest=True,
                refusal=('The motion was closed before these points came.'),
            )
        return None

    def _accept(self, append_job: AppendJob) -> None:
        job = append_job.job
        self._is_open = job is not None and job.keep_open
        if job is not None:
            self._monitor.append(job, append_job.records_before)
            self.job = job
        self._committed = self._records.total
        if self._is_open and job is not None:
            self._committed -= job.ending_records

    def _continue_motion(self, now: float) -> list[GoalCommand]:
        """Return what points, or the word that none will come, lead to in the present state."""
        if self.state is GoalState.MOVING:
            return self._release_points(0)
        signal = self._resume_signal()  # else they are sent when it is their turn
        return [] if signal is None else self._apply(signal, '', now)

    def _resume_signal(self) -> GoalSignal | None:
        """
        Return how a goal that waits goes on, or None.

        Packets may be late: where the arm goes on from is judged by one that shows it at rest.
        """
        if self.state is not GoalState.AWAITING_POINTS:
            return None
        if self._records.total == self._window.sent:
            return None if self._is_open else GoalSignal.NO_MORE_POINTS
        state = self._monitor.latest
        is_seen = state is not None and max(map(abs, state.actual_qd)) < REST_SPEED
        return GoalSignal.APPENDED if is_seen else None

    # ---- points that go -----------------------------------------------------------------------

    def _start_motion(self, state: RobotState) -> list[GoalCommand]:
        self._deadline = inf
        self._started, self._is_stream_end_sent, self._is_resting = True, False, False
        self._stream_first_record, self._stream_start_time = self._window.sent, state.timestamp
        self._monitor.resume(state, self._window.sent)
        return [SendControl(action=TrajectoryAction.STREAM_START), *self._release_points(0)]

    def _release_points(self, begun: int) -> list[GoalCommand]:
        if self.state is not GoalState.MOVING:
            return []
        first, self._window.begun = self._window.sent, max(self._window.begun, begun)
        ahead = self._records.count_until(self._monitor.time() + self._settings.horizon)
        end = max(first, min(ahead, self._committed, self._window.begun + self._window.size))
        return self._send(first, end)

    def _send(self, first: int, end: int) -> list[GoalCommand]:
        """Send records, and their number where they are the last ones."""
        self._window.sent = end
        commands: list[GoalCommand] = [SendPoints(first=first, end=end)] if end > first else []
        closes = self.state is GoalState.RUNNING_OUT or not self._is_open
        if closes and end == self._records.total and not self._is_stream_end_sent:
            self._is_stream_end_sent = True
            commands.append(
                SendControl(
                    action=TrajectoryAction.STREAM_END, count=end - self._stream_first_record
                )
            )
        return commands

    def _records_sent(self) -> int:
        return self._window.sent - self._stream_first_record

    # ---- signals and states -------------------------------------------------------------------

    def _check_packet(self, state: RobotState, now: float) -> tuple[GoalSignal | None, str]:
        signal, text = super()._check_packet(state, now)
        if signal is None and self.state is GoalState.MOVING and self._is_running_out():
            return GoalSignal.STARVING, ''
        return (signal, text) if signal is not None else (self._resume_signal(), '')

    def _is_running_out(self) -> bool:
        """Tell whether the program is soon going to ask for a point that nobody has given."""
        sent = self._window.sent
        if not self._is_open or sent != self._committed:
            return False
        if sent == self._stream_first_record:
            return self._robot_time() - self._stream_start_time >= FIRST_POINTS_TIMEOUT
        return self._records.request_time(sent) - self._monitor.time() <= self._settings.margin

    def _robot_time(self) -> float:
        state = self._monitor.latest
        return 0.0 if state is None else state.timestamp

    def _check_deadline(self, now: float) -> tuple[GoalSignal | None, str]:
        if self.state is GoalState.AWAITING_POINTS and now >= self._deadline:
            return GoalSignal.TIMEOUT, (
                'no more points, and no word that there are none, came within '
                f'keep_open_timeout = {self._settings.timeout:g} s'
            )
        return super()._check_deadline(now)

    def _entry_action(self, state: GoalState) -> Callable[[GoalSignal, float], list[GoalCommand]]:
        if state is GoalState.RUNNING_OUT:
            return self._enter_running_out
        return (
            self._enter_awaiting_points
            if state is GoalState.AWAITING_POINTS
            else super()._entry_action(state)
        )

    def _enter_running_out(self, signal: GoalSignal, now: float) -> list[GoalCommand]:
        self._committed = self._records.total
        self._stop_count += 1
        self._last_stop_point = self._records.points - 1
        return self._send(self._window.sent, self._committed)

    def _enter_awaiting_points(self, signal: GoalSignal, now: float) -> list[GoalCommand]:
        self._is_resting = True
        self._monitor.finish(self._records.end_time(self._window.sent))
        self._deadline = now + self._settings.timeout if self._settings.timeout > 0.0 else inf
        return self._continue_motion(now)

    def _enter_moving(self, signal: GoalSignal, now: float) -> list[GoalCommand]:
        state = self._monitor.latest
        if signal is GoalSignal.APPENDED and state is not None:
            moved = self._monitor.rest_offset(state)
            if moved is not None:
                self.state = GoalState.AWAITING_POINTS
                return self._apply(GoalSignal.DEVIATION, moved, now)
        return super()._enter_moving(signal, now)

    # ---- what is told -------------------------------------------------------------------------

    def _progress_report(self) -> ReportProgress:
        waits = self.state is GoalState.AWAITING_POINTS
        return ReportProgress(
            progress=self._monitor.progress(
                self._window.sent, at_end=waits or self.state is GoalState.SETTLING, waits=waits
            )
        )

    def _location_clause(self) -> str:
        if self._is_resting:
            return f'at rest behind point {self._last_stop_point}, waiting for more'
        return super()._location_clause()

    def _outcome_report(self) -> tuple[str, ...]:
        if not self._stop_count:
            return super()._outcome_report()
        times = 'once' if self._stop_count == 1 else f'{self._stop_count} times'
        return (
            *super()._outcome_report(),
            (
                f'the motion was brought to rest {times}, the last time behind point '
                f'{self._last_stop_point}, because no more points came in time; what was appended '
                'later is later by as much as that took'
            ),
        )
