# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The machine that takes one goal through the robot program.

It is fed with events and the time and answers with commands; it sends nothing itself. The table of
its states, and what they mean, is in :mod:`~.states`; what the packets of the robot show of the
goal is seen in :mod:`~.observer`.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf, nan

from ur_cartesian_driver.execution.commands import (
    Command,
    Finish,
    LendTcp,
    Report,
    ReturnTcp,
    SendControl,
    SendPoints,
    StopProgram,
)
from ur_cartesian_driver.execution.flow import Window
from ur_cartesian_driver.execution.observer import MAX_PLAN_DEVIATION, Observer
from ur_cartesian_driver.execution.order import Order
from ur_cartesian_driver.execution.records import Records
from ur_cartesian_driver.execution.states import (
    HOLDS,
    NO_STOP,
    PAUSES,
    RESULTS,
    Signal,
    State,
    stop_in,
    TRANSITIONS,
    UNDER_WAY,
)
from ur_cartesian_driver.execution.tcp_loan import REST_SPEED, same_tcp, TcpLoan
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
from ur_cartesian_driver.protocol.reverse import TrajectoryAction

#: Longest time from CANCEL to the answer and to standstill [s]: the arm brakes within a second
#: from full speed, and discarding the points in flight takes 0.5 s at most.
STOP_BOUND = 3.0
#: How long the robot may take to report a TCP that it was told [s].
TCP_BOUND = 1.0
#: How long a program that answered CANCELED may take to begin all the same [s].
EARLY_ANSWER = 1.0
#: How long the arm may need from the program's SUCCESS to rest inside its goal tolerance, when
#: the goal does not say [s].
DEFAULT_GOAL_TIME_TOLERANCE = 1.0
#: How long a deeper reason for the end of the robot program is waited for [s]: what dies together
#: is reported by different connections, some cycles apart.
GATHER = 0.1


class TrajectoryMachine:
    """One goal on its way through the table of the states; see the module's description."""

    def __init__(
        self,
        order: Order,
        *,
        feedback_period: float = 0.04,
        max_plan_deviation: tuple[float, float] = MAX_PLAN_DEVIATION,
        continues: bool = False,
    ) -> None:
        """
        Take an order; nothing happens before :meth:`start`.

        :param feedback_period: time between two progress reports [s].
        :param max_plan_deviation: how far the controller's own target may be from the plan [m],
            [rad]; 0 = any way, any angle.
        :param continues: a protective or safeguard stop holds the goal, as a pause does, until
            somebody unlocks the robot and plays its program.
        """
        self._borne = HOLDS if continues else NO_STOP
        self.order = order
        self.state = State.MOVING if order.T_flange_tcp is None else State.ARMING
        #: The TCP that was set for this goal. Where it is not ``returned`` at the end, whoever
        #: carries out the commands has to see to it.
        self.loan: TcpLoan | None = None
        self._records = Records(order)
        self._observer = Observer(order, self._records, max_plan_deviation)
        self._window = Window(order.points)
        self._feedback_period = feedback_period
        self._next_report = -inf
        self._deadline = inf
        #: When the controller's target has to be at the end, once the program says so.
        self._arrival_due = inf
        self._code: ErrorCode | None = None
        self._text = ''
        #: Whether START was sent, and whether the end was decided.
        self._started = self._over = False

    def start(self, state: RobotState) -> list[Command]:
        """
        Return the commands that start the motion: START, then the first points.

        Before that the TCP, where the goal needs another one.

        :param state: the robot's newest packet.
        """
        lent = self.order.T_flange_tcp
        if lent is None:
            return self._begin(state)
        self.loan = TcpLoan(self.order.T_flange_active, lent)
        return [LendTcp(T_flange_tcp=lent)]

    def where(self) -> tuple[int, float, float]:
        """
        Return the point that the arm is on its way to, and two times [s].

        What motion the robot has yet, and how far the arm is behind; NaN = nobody knows.
        """
        return self._observer.waypoint(), self._observer.buffered(self._window.sent), nan

    def time_behind(self, records: int) -> float:
        """Return when the first so many records are planned to end [s]."""
        return self._records.end(records)

    def step(self, event: Event, now: float) -> list[Command]:
        """
        Return what to do after an event.

        :param now: time of a steady clock [s].
        """
        if self.state is State.ENDED:
            return []
        if self.state is State.ARMING:
            self._deadline = min(self._deadline, now + TCP_BOUND)
        if isinstance(event, StateReceived):
            if self.loan is not None:
                self.loan.observe(event.state, now)
            self._observer.take(event.state, moving=self.state in UNDER_WAY)
        signal, text = self._signal(event, now)
        commands = [] if signal is None else self._apply(signal, text, now)
        brakes = signal is not None and self.state is State.STOPPING
        if isinstance(event, StateReceived) and not brakes:
            # A CANCEL does not wait until a report is made: that comes with the next packet.
            commands += self._inform(event.state, now)
        return commands

    # ---- from events to signals ---------------------------------------------------------------

    def _signal(self, event: Event, now: float) -> tuple[Signal | None, str]:
        """Return what the event means, with a clause for the outcome's text."""
        match event:
            case StateReceived(state=state):
                return stop_in(state, self._borne) or self._judge(state, now)
            case TrajectoryEnded(result=TrajectoryResult.CANCELED) if self._has_not_begun():
                self._deadline = now + EARLY_ANSWER
                return None, ''
            case TrajectoryEnded(result=result):
                return RESULTS[result]
            case CancelRequested(reason=reason):
                return Signal.CANCEL, reason
            case PreemptRequested(by=by):
                return Signal.PREEMPT, f'{by} took the place of this one'
            case LinkLost(link='program', reason=reason):
                return Signal.PROGRAM_STOPPED, f'the robot program hung up: {reason}'
            case LinkLost(link=link, reason=reason):
                return Signal.CONNECTION_LOST, f'the {link} connection was lost: {reason}'
            case Tick():
                return self._late(now)
        raise TypeError(f'unknown event {event!r}')

    def _judge(self, state: RobotState, now: float) -> tuple[Signal | None, str]:
        """Return what a packet of a robot that runs means in the present state."""
        if self.state in UNDER_WAY:
            return self._observer.fault(state) or (None, '')
        at_rest = _rests(state)
        if self.state is State.ARMING and self._is_armed(state):
            return Signal.ARMED, ''
        if self.state is State.SETTLING and at_rest:
            return self._arrival(state, now)
        if self.state is State.HALTING and at_rest:
            return Signal.AT_REST, ''
        if self.state is State.RESTORING and self.loan is not None and self.loan.returned:
            return Signal.RESTORED, ''
        return self._late(now)

    def _is_armed(self, state: RobotState) -> bool:
        """Tell whether the robot has the TCP of the goal, and reports it where the plan begins."""
        assert self.loan is not None
        return self.loan.has_robot(state) and self._observer.off_start(state) is None

    def _arrival(self, state: RobotState, now: float) -> tuple[Signal | None, str]:
        """Return what it means that the arm rests after the program's SUCCESS."""
        missed = self._observer.missed_end(state)
        if missed and now >= self._arrival_due:
            return Signal.DEVIATION, missed
        if not missed and self._observer.goal_error(state) is None:
            return Signal.SETTLED, ''
        return self._late(now)

    def _has_not_begun(self) -> bool:
        """
        Tell whether the program has not reported a point of this goal yet.

        A CANCELED that comes then most likely answers a goal whose end nobody waited for, because
        RTDE was lost; it names no goal. It counts only if nothing begins after it.
        """
        return self.state in UNDER_WAY and self._observer.awaits_count()

    def _late(self, now: float) -> tuple[Signal | None, str]:
        if now < self._deadline:
            return None, ''
        if self.state in UNDER_WAY:
            self._deadline = inf
            return RESULTS[TrajectoryResult.CANCELED] if self._has_not_begun() else (None, '')
        if self.state is State.ARMING:
            return Signal.LATE, self._why_not_armed()
        if self.state in (State.RESTORING, State.ENDING):
            return Signal.LATE, ''
        if self.state is State.SETTLING:
            return self._unsettled()
        state = self._observer.latest
        if self.state is State.STOPPING and state is not None and _rests(state):
            return Signal.UNANSWERED, ''
        return Signal.LATE, (
            f'the robot did not confirm the stop within {STOP_BOUND:g} s, its program was ended'
        )

    def _unsettled(self) -> tuple[Signal, str]:
        """Return what has kept the arm from arriving until now."""
        state = self._observer.latest
        if state is None or not _rests(state):
            return Signal.LATE, 'the arm did not come to rest'
        if missed := self._observer.missed_end(state):
            return Signal.DEVIATION, missed
        return Signal.LATE, self._observer.goal_error(state) or 'the arm did not come to rest'

    def _why_not_armed(self) -> str:
        state = self._observer.latest
        if state is not None and self.loan is not None and self.loan.has_robot(state):
            return self._observer.off_start(state) or ''
        return (
            f'the robot did not take the TCP of the goal within {TCP_BOUND:g} s: its program '
            'is paused, or does not know that command; nothing was moved'
        )

    # ---- from signals to commands -------------------------------------------------------------

    def _apply(self, signal: Signal, text: str, now: float) -> list[Command]:
        step = TRANSITIONS[self.state][signal]
        before, self.state = self.state, step.state
        if step.code is not None:
            if before is State.ENDING:  # the end of the program came of it
                text = f'{text}; before that was heard of, {self._text}'
            self._code, self._text = step.code, text
        if step.state is before:
            return []
        return self._entered(step.state)(signal, now)

    def _entered(self, state: State) -> Callable[[Signal, float], list[Command]]:
        """Return what is done when a state is entered."""
        return {
            State.MOVING: self._enter_moving,
            State.SETTLING: self._enter_settling,
            State.STOPPING: self._enter_stopping,
            State.HALTING: self._enter_halting,
            State.RESTORING: self._enter_restoring,
            State.ENDING: self._enter_ending,
            State.ENDED: self._enter_ended,
        }[state]

    def _enter_moving(self, signal: Signal, now: float) -> list[Command]:
        assert self._observer.latest is not None
        return self._begin(self._observer.latest)

    def _begin(self, state: RobotState) -> list[Command]:
        self._deadline = inf
        self._started = True
        self._observer.start(state)
        return [
            SendControl(action=TrajectoryAction.START, count=self.order.points),
            *self._release(0),
        ]

    def _enter_settling(self, signal: Signal, now: float) -> list[Command]:
        self._observer.finish()
        tolerance = self._time_tolerance()
        self._deadline = inf if tolerance < 0.0 else now + tolerance
        self._arrival_due = min(self._deadline, now + DEFAULT_GOAL_TIME_TOLERANCE)
        late = 0.0 if self.order.due is None else self._observer.scaled_time - self.order.due
        if 0.0 <= tolerance < late:
            return self._apply(
                Signal.LATE,
                (
                    f'the last point was reached {late:.3f} s after its time '
                    f'{self.order.due:.3f} s, goal_time_tolerance is {tolerance:.3f} s'
                ),
                now,
            )
        return []

    def _enter_stopping(self, signal: Signal, now: float) -> list[Command]:
        self._deadline = now + STOP_BOUND
        return [SendControl(action=TrajectoryAction.CANCEL, count=self._sent())]

    def _sent(self) -> int:
        """Return how many records were sent since START."""
        return self._window.sent

    def _enter_halting(self, signal: Signal, now: float) -> list[Command]:
        self._deadline = now + STOP_BOUND
        return []

    def _enter_restoring(self, signal: Signal, now: float) -> list[Command]:
        """Have the TCP put back; a goal that changed none is at its end."""
        self._over = True
        if self.loan is None:
            return self._apply(Signal.RESTORED, '', now)
        self._deadline = now + TCP_BOUND
        return [*self._last_report(), ReturnTcp(T_flange_tcp=self.loan.T_flange_before)]

    def _enter_ending(self, signal: Signal, now: float) -> list[Command]:
        self._deadline = now + GATHER
        return []

    def _enter_ended(self, signal: Signal, now: float) -> list[Command]:
        if self._over:  # nothing of the motion is left that could go on
            return self._finish()
        commands: list[Command] = []
        unconfirmed = signal is Signal.LATE and self._code is ErrorCode.EXECUTION_FAILED
        if signal in PAUSES or unconfirmed:
            # A paused program reads no socket: without this the old motion would go on when
            # somebody unlocks the arm and plays the program.
            commands.append(StopProgram(reason=self._text))
        return commands + self._finish()

    def _finish(self) -> list[Command]:
        code = self._code if self._code is not None else ErrorCode.EXECUTION_FAILED
        return [
            *self._last_report(),
            Finish(outcome=Outcome(code=code, text=self._sentence(code), report=self._report())),
        ]

    def _report(self) -> tuple[str, ...]:
        """Return what is to be said beyond the sentence."""
        return self._about_tcp()

    def _last_report(self) -> list[Report]:
        return [self._progress_report()] if self._shows_goal() else []

    def _shows_goal(self) -> bool:
        """Tell whether the newest packet is about the TCP of the goal."""
        state, loan = self._observer.latest, self.loan
        return state is not None and (loan is None or loan.has_robot(state))

    def _about_tcp(self) -> tuple[str, ...]:
        if self.loan is None:
            return ()
        if self.loan.returned:
            state = self._observer.latest
            if state is not None and same_tcp(state.T_flange_tcp, self.loan.T_flange_before):
                return ('the TCP of the robot was set for the goal, and is what it was before',)
            return (
                'the TCP of the robot was set for the goal; somebody else has set another one '
                'since, which is left alone',
            )
        return (
            'the TCP of the robot was set for the goal, and is not back yet: no goal is taken '
            'until it is',
        )

    def _sentence(self, code: ErrorCode) -> str:
        if code is ErrorCode.SUCCESSFUL:
            points = self._records.points
            what = 'The point was' if points == 1 else f'All {points} points were'
            return f'{what} executed in {self._observer.scaled_time:.3f} s.'
        where = 'at the last point' if code is ErrorCode.GOAL_TOLERANCE_VIOLATED else self._where()
        text = self._text if where in self._text else f'{self._text} ({where})'
        return text[:1].upper() + text[1:] + '.'

    def _where(self) -> str:
        """Return where the goal ended, as a clause."""
        if not self._started:
            return 'before anything moved'
        return f'on the way to point {self._observer.waypoint()}'

    def _inform(self, state: RobotState, now: float) -> list[Command]:
        """Return the points to send and the progress to report after a packet."""
        if self.state is State.ENDED:
            return []
        commands = self._release(self._observer.begun(state))
        if now >= self._next_report and self._shows_goal():
            self._next_report = now + self._feedback_period
            commands.append(self._progress_report())
        return commands

    def _release(self, begun: int) -> list[Command]:
        if self.state is not State.MOVING:
            return []
        first, end = self._window.release(begun)
        return [SendPoints(first=first, end=end)] if end > first else []

    def _progress_report(self) -> Report:
        return Report(
            progress=self._observer.progress(
                self._window.sent, at_end=self.state is State.SETTLING
            )
        )

    def _time_tolerance(self) -> float:
        return self.order.goal_time_tolerance or DEFAULT_GOAL_TIME_TOLERANCE


def _rests(state: RobotState) -> bool:
    return max(map(abs, state.actual_qd)) < REST_SPEED
