# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The machine that takes one goal through the robot program.

It is fed with events and the time and answers with commands; it sends nothing itself. The table of
its states, and what they mean, is in :mod:`~.states`; what the packets of the robot show of the
goal is seen in :mod:`~.monitor`.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf, nan

from ur_cartesian_driver.execution.goal.goal_commands import (
    Finish,
    GoalCommand,
    ReportProgress,
    RestoreTcp,
    SendControl,
    SendPoints,
    SetTemporaryTcp,
    StopProgram,
)
from ur_cartesian_driver.execution.goal.monitor import GoalMonitor, MAX_PLAN_DEVIATION
from ur_cartesian_driver.execution.goal.motion_job import MotionJob
from ur_cartesian_driver.execution.goal.send_window import SendWindow
from ur_cartesian_driver.execution.goal.states import (
    detect_stop,
    GoalSignal,
    GoalState,
    NO_STOP,
    RESULT_SIGNALS,
    RESUMABLE_STOPS,
    RUNNING_STATES,
    STOP_PROGRAM_AFTER,
    TRANSITIONS,
)
from ur_cartesian_driver.execution.goal.temporary_tcp import REST_SPEED, same_tcp, TemporaryTcp
from ur_cartesian_driver.execution.goal.wire_records import WireRecords
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.events import (
    CancelRequested,
    Event,
    LinkLost,
    Outcome,
    PreemptRequested,
    StateReceived,
    Tick,
    TrajectoryEnded,
    TrajectoryResult,
)
from ur_cartesian_driver.motion.state import RobotState
from ur_cartesian_driver.protocol.program.reverse import TrajectoryAction

#: Longest time from CANCEL to the answer and to standstill [s]: the arm brakes within a second
#: from full speed, and discarding the points in flight takes 0.5 s at most.
STOP_TIMEOUT = 3.0
#: How long the robot may take to report a TCP that it was told [s].
TCP_TIMEOUT = 1.0
#: How long a program that answered CANCELED may take to begin all the same [s].
EARLY_CANCELED_TIMEOUT = 1.0
#: How long the arm may need from the program's SUCCESS to rest inside its goal tolerance, when
#: the goal does not say [s].
DEFAULT_GOAL_TIME_TOLERANCE = 1.0
#: How long a deeper reason for the end of the robot program is waited for [s]: what dies together
#: is reported by different connections, some cycles apart.
CAUSE_TIMEOUT = 0.1


class GoalMachine:
    """One goal on its way through the table of the states; see the module's description."""

    def __init__(
        self,
        job: MotionJob,
        *,
        feedback_period: float = 0.04,
        max_plan_deviation: tuple[float, float] = MAX_PLAN_DEVIATION,
        resume_after_stop: bool = False,
    ) -> None:
        """
        Take an order; nothing happens before :meth:`start`.

        :param feedback_period: time between two progress reports [s].
        :param max_plan_deviation: how far the controller's own target may be from the plan [m],
            [rad]; 0 = any way, any angle.
        :param resume_after_stop: a protective or safeguard stop holds the goal, as a pause does,
            until somebody unlocks the robot and plays its program.
        """
        self._ignored_stops = RESUMABLE_STOPS if resume_after_stop else NO_STOP
        self.job = job
        self.state = GoalState.MOVING if job.T_flange_tcp is None else GoalState.ARMING
        #: The TCP that was set for this goal. Where it is not ``is_restored`` at the end, whoever
        #: carries out the commands has to see to it.
        self.temporary_tcp: TemporaryTcp | None = None
        self._records = WireRecords(job)
        self._monitor = GoalMonitor(job, self._records, max_plan_deviation)
        self._window = SendWindow(job.points)
        self._feedback_period = feedback_period
        self._next_report = -inf
        self._deadline = inf
        #: When the controller's target has to be at the end, once the program says so.
        self._arrival_due = inf
        self._code: ErrorCode | None = None
        self._text = ''
        #: Whether START was sent, and whether the end was decided.
        self._started = self._is_decided = False

    def start(self, state: RobotState) -> list[GoalCommand]:
        """
        Return the commands that start the motion: START, then the first points.

        Before that the TCP, where the goal needs another one.

        :param state: the robot's newest packet.
        """
        lent = self.job.T_flange_tcp
        if lent is None:
            return self._start_motion(state)
        self.temporary_tcp = TemporaryTcp(self.job.T_flange_active, lent)
        return [SetTemporaryTcp(T_flange_tcp=lent)]

    def motion_status(self) -> tuple[int, float, float]:
        """
        Return the point that the arm is on its way to, and two times [s].

        What motion the robot has yet, and how far the arm is behind; NaN = nobody knows.
        """
        return self._monitor.waypoint(), self._monitor.buffered(self._window.sent), nan

    def end_time_of(self, records: int) -> float:
        """Return when the first so many records are planned to end [s]."""
        return self._records.end_time(records)

    def step(self, event: Event, now: float) -> list[GoalCommand]:
        """
        Return what to do after an event.

        :param now: time of a steady clock [s].
        """
        if self.state is GoalState.ENDED:
            return []
        if self.state is GoalState.ARMING:
            self._deadline = min(self._deadline, now + TCP_TIMEOUT)
        if isinstance(event, StateReceived):
            if self.temporary_tcp is not None:
                self.temporary_tcp.observe(event.state, now)
            self._monitor.update(event.state, moving=self.state in RUNNING_STATES)
        signal, text = self._signal(event, now)
        commands = [] if signal is None else self._apply(signal, text, now)
        brakes = signal is not None and self.state is GoalState.CANCELLING
        if isinstance(event, StateReceived) and not brakes:
            # A CANCEL does not wait until a report is made: that comes with the next packet.
            commands += self._after_packet(event.state, now)
        return commands

    # ---- from events to signals ---------------------------------------------------------------

    def _signal(self, event: Event, now: float) -> tuple[GoalSignal | None, str]:
        """Return what the event means, with a clause for the outcome's text."""
        match event:
            case StateReceived(state=state):
                return detect_stop(state, self._ignored_stops) or self._check_packet(state, now)
            case TrajectoryEnded(result=TrajectoryResult.CANCELED) if self._has_not_begun():
                self._deadline = now + EARLY_CANCELED_TIMEOUT
                return None, ''
            case TrajectoryEnded(result=result):
                return RESULT_SIGNALS[result]
            case CancelRequested(reason=reason):
                return GoalSignal.CANCEL, reason
            case PreemptRequested(by=by):
                return GoalSignal.PREEMPT, f'{by} took the place of this one'
            case LinkLost(link='program', reason=reason):
                return GoalSignal.PROGRAM_STOPPED, f'the robot program hung up: {reason}'
            case LinkLost(link=link, reason=reason):
                return GoalSignal.CONNECTION_LOST, f'the {link} connection was lost: {reason}'
            case Tick():
                return self._check_deadline(now)
        raise TypeError(f'unknown event {event!r}')

    def _check_packet(self, state: RobotState, now: float) -> tuple[GoalSignal | None, str]:
        """Return what a packet of a robot that runs means in the present state."""
        if self.state in RUNNING_STATES:
            return self._monitor.find_fault(state) or (None, '')
        at_rest = _is_at_rest(state)
        if self.state is GoalState.ARMING and self._is_armed(state):
            return GoalSignal.ARMED, ''
        if self.state is GoalState.SETTLING and at_rest:
            return self._arrival(state, now)
        if self.state is GoalState.COMING_TO_REST and at_rest:
            return GoalSignal.AT_REST, ''
        if (
            self.state is GoalState.RESTORING
            and self.temporary_tcp is not None
            and self.temporary_tcp.is_restored
        ):
            return GoalSignal.RESTORED, ''
        return self._check_deadline(now)

    def _is_armed(self, state: RobotState) -> bool:
        """Tell whether the robot has the TCP of the goal, and reports it where the plan begins."""
        assert self.temporary_tcp is not None
        return self.temporary_tcp.is_active(state) and self._monitor.start_offset(state) is None

    def _arrival(self, state: RobotState, now: float) -> tuple[GoalSignal | None, str]:
        """Return what it means that the arm rests after the program's SUCCESS."""
        missed = self._monitor.missed_end(state)
        if missed and now >= self._arrival_due:
            return GoalSignal.DEVIATION, missed
        if not missed and self._monitor.goal_violation(state) is None:
            return GoalSignal.SETTLED, ''
        return self._check_deadline(now)

    def _has_not_begun(self) -> bool:
        """
        Tell whether the program has not reported a point of this goal yet.

        A CANCELED that comes then most likely answers a goal whose end nobody waited for, because
        RTDE was lost; it names no goal. It counts only if nothing begins after it.
        """
        return self.state in RUNNING_STATES and self._monitor.awaits_count()

    def _check_deadline(self, now: float) -> tuple[GoalSignal | None, str]:
        if now < self._deadline:
            return None, ''
        if self.state in RUNNING_STATES:
            self._deadline = inf
            return (
                RESULT_SIGNALS[TrajectoryResult.CANCELED] if self._has_not_begun() else (None, '')
            )
        if self.state is GoalState.ARMING:
            return GoalSignal.TIMEOUT, self._arming_failure()
        if self.state in (GoalState.RESTORING, GoalState.PROGRAM_LOST):
            return GoalSignal.TIMEOUT, ''
        if self.state is GoalState.SETTLING:
            return self._settling_failure()
        state = self._monitor.latest
        if self.state is GoalState.CANCELLING and state is not None and _is_at_rest(state):
            return GoalSignal.UNANSWERED, ''
        return GoalSignal.TIMEOUT, (
            f'the robot did not confirm the stop within {STOP_TIMEOUT:g} s, its program was ended'
        )

    def _settling_failure(self) -> tuple[GoalSignal, str]:
        """Return what has kept the arm from arriving until now."""
        state = self._monitor.latest
        if state is None or not _is_at_rest(state):
            return GoalSignal.TIMEOUT, 'the arm did not come to rest'
        if missed := self._monitor.missed_end(state):
            return GoalSignal.DEVIATION, missed
        return GoalSignal.TIMEOUT, self._monitor.goal_violation(
            state
        ) or 'the arm did not come to rest'

    def _arming_failure(self) -> str:
        state = self._monitor.latest
        if (
            state is not None
            and self.temporary_tcp is not None
            and self.temporary_tcp.is_active(state)
        ):
            return self._monitor.start_offset(state) or ''
        return (
            f'the robot did not take the TCP of the goal within {TCP_TIMEOUT:g} s: its program '
            'is paused, or does not know that command; nothing was moved'
        )

    # ---- from signals to commands -------------------------------------------------------------

    def _apply(self, signal: GoalSignal, text: str, now: float) -> list[GoalCommand]:
        step = TRANSITIONS[self.state][signal]
        before, self.state = self.state, step.state
        if step.code is not None:
            if before is GoalState.PROGRAM_LOST:  # the end of the program came of it
                text = f'{text}; before that was heard of, {self._text}'
            self._code, self._text = step.code, text
        if step.state is before:
            return []
        return self._entry_action(step.state)(signal, now)

    def _entry_action(self, state: GoalState) -> Callable[[GoalSignal, float], list[GoalCommand]]:
        """Return what is done when a state is entered."""
        return {
            GoalState.MOVING: self._enter_moving,
            GoalState.SETTLING: self._enter_settling,
            GoalState.CANCELLING: self._enter_cancelling,
            GoalState.COMING_TO_REST: self._enter_coming_to_rest,
            GoalState.RESTORING: self._enter_restoring,
            GoalState.PROGRAM_LOST: self._enter_program_lost,
            GoalState.ENDED: self._enter_ended,
        }[state]

    def _enter_moving(self, signal: GoalSignal, now: float) -> list[GoalCommand]:
        assert self._monitor.latest is not None
        return self._start_motion(self._monitor.latest)

    def _start_motion(self, state: RobotState) -> list[GoalCommand]:
        self._deadline = inf
        self._started = True
        self._monitor.start(state)
        return [
            SendControl(action=TrajectoryAction.START, count=self.job.points),
            *self._release_points(0),
        ]

    def _enter_settling(self, signal: GoalSignal, now: float) -> list[GoalCommand]:
        self._monitor.finish()
        tolerance = self._time_tolerance()
        self._deadline = inf if tolerance < 0.0 else now + tolerance
        self._arrival_due = min(self._deadline, now + DEFAULT_GOAL_TIME_TOLERANCE)
        late = 0.0 if self.job.due is None else self._monitor.scaled_time - self.job.due
        if 0.0 <= tolerance < late:
            return self._apply(
                GoalSignal.TIMEOUT,
                (
                    f'the last point was reached {late:.3f} s after its time '
                    f'{self.job.due:.3f} s, goal_time_tolerance is {tolerance:.3f} s'
                ),
                now,
            )
        return []

    def _enter_cancelling(self, signal: GoalSignal, now: float) -> list[GoalCommand]:
        self._deadline = now + STOP_TIMEOUT
        return [SendControl(action=TrajectoryAction.CANCEL, count=self._records_sent())]

    def _records_sent(self) -> int:
        """Return how many records were sent since START."""
        return self._window.sent

    def _enter_coming_to_rest(self, signal: GoalSignal, now: float) -> list[GoalCommand]:
        self._deadline = now + STOP_TIMEOUT
        return []

    def _enter_restoring(self, signal: GoalSignal, now: float) -> list[GoalCommand]:
        """Have the TCP put back; a goal that changed none is at its end."""
        self._is_decided = True
        if self.temporary_tcp is None:
            return self._apply(GoalSignal.RESTORED, '', now)
        self._deadline = now + TCP_TIMEOUT
        return [
            *self._final_progress(),
            RestoreTcp(T_flange_tcp=self.temporary_tcp.T_flange_original),
        ]

    def _enter_program_lost(self, signal: GoalSignal, now: float) -> list[GoalCommand]:
        self._deadline = now + CAUSE_TIMEOUT
        return []

    def _enter_ended(self, signal: GoalSignal, now: float) -> list[GoalCommand]:
        if self._is_decided:  # nothing of the motion is left that could go on
            return self._finish()
        commands: list[GoalCommand] = []
        unconfirmed = signal is GoalSignal.TIMEOUT and self._code is ErrorCode.EXECUTION_FAILED
        if signal in STOP_PROGRAM_AFTER or unconfirmed:
            # A paused program reads no socket: without this the old motion would go on when
            # somebody unlocks the arm and plays the program.
            commands.append(StopProgram(reason=self._text))
        return commands + self._finish()

    def _finish(self) -> list[GoalCommand]:
        code = self._code if self._code is not None else ErrorCode.EXECUTION_FAILED
        return [
            *self._final_progress(),
            Finish(
                outcome=Outcome(
                    code=code, text=self._outcome_text(code), report=self._outcome_report()
                )
            ),
        ]

    def _outcome_report(self) -> tuple[str, ...]:
        """Return what is to be said beyond the sentence."""
        return self._tcp_report()

    def _final_progress(self) -> list[ReportProgress]:
        return [self._progress_report()] if self._has_goal_tcp() else []

    def _has_goal_tcp(self) -> bool:
        """Tell whether the newest packet is about the TCP of the goal."""
        state, temporary_tcp = self._monitor.latest, self.temporary_tcp
        return state is not None and (temporary_tcp is None or temporary_tcp.is_active(state))

    def _tcp_report(self) -> tuple[str, ...]:
        if self.temporary_tcp is None:
            return ()
        if self.temporary_tcp.is_restored:
            state = self._monitor.latest
            if state is not None and same_tcp(
                state.T_flange_tcp, self.temporary_tcp.T_flange_original
            ):
                return ('the TCP of the robot was set for the goal, and is what it was before',)
            return (
                'the TCP of the robot was set for the goal; somebody else has set another one '
                'since, which is left alone',
            )
        return (
            'the TCP of the robot was set for the goal, and is not back yet: no goal is taken '
            'until it is',
        )

    def _outcome_text(self, code: ErrorCode) -> str:
        if code is ErrorCode.SUCCESSFUL:
            points = self._records.points
            what = 'The point was' if points == 1 else f'All {points} points were'
            return f'{what} executed in {self._monitor.scaled_time:.3f} s.'
        motion_status = (
            'at the last point'
            if code is ErrorCode.GOAL_TOLERANCE_VIOLATED
            else self._location_clause()
        )
        text = self._text if motion_status in self._text else f'{self._text} ({motion_status})'
        return text[:1].upper() + text[1:] + '.'

    def _location_clause(self) -> str:
        """Return where the goal ended, as a clause."""
        if not self._started:
            return 'before anything moved'
        return f'on the way to point {self._monitor.waypoint()}'

    def _after_packet(self, state: RobotState, now: float) -> list[GoalCommand]:
        """Return the points to send and the progress to report after a packet."""
        if self.state is GoalState.ENDED:
            return []
        commands = self._release_points(self._monitor.records_begun(state))
        if now >= self._next_report and self._has_goal_tcp():
            self._next_report = now + self._feedback_period
            commands.append(self._progress_report())
        return commands

    def _release_points(self, begun: int) -> list[GoalCommand]:
        if self.state is not GoalState.MOVING:
            return []
        first, end = self._window.release(begun)
        return [SendPoints(first=first, end=end)] if end > first else []

    def _progress_report(self) -> ReportProgress:
        return ReportProgress(
            progress=self._monitor.progress(
                self._window.sent, at_end=self.state is GoalState.SETTLING
            )
        )

    def _time_tolerance(self) -> float:
        return self.job.goal_time_tolerance or DEFAULT_GOAL_TIME_TOLERANCE


def _is_at_rest(state: RobotState) -> bool:
    return max(map(abs, state.actual_qd)) < REST_SPEED
