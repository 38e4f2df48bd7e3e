# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The machine that takes one goal through the robot program.

It is fed with events and the time and answers with commands; it sends nothing itself. The table of
its states, and what they mean, is in :mod:`~.states`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import inf
from types import MappingProxyType

import numpy as np

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
from ur_cartesian_driver.execution.monitor import PathTracker, speed
from ur_cartesian_driver.execution.pace import Pace
from ur_cartesian_driver.execution.states import (
    HOLDS,
    NO_STOP,
    PAUSES,
    RESULTS,
    Signal,
    State,
    stop_in,
    TRANSITIONS,
)
from ur_cartesian_driver.execution.tcp_loan import REST_SPEED, same_tcp, TcpLoan
from ur_cartesian_driver.execution.tolerances import Watch
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.events import (
    CancelRequested,
    Event,
    LinkLost,
    Outcome,
    PreemptRequested,
    Progress,
    StateReceived,
    Tick,
    TrajectoryEnded,
    TrajectoryResult,
)
from ur_cartesian_driver.motion.goal import Tolerance
from ur_cartesian_driver.motion.lever import seen_at
from ur_cartesian_driver.motion.plan import ReferencePath
from ur_cartesian_driver.motion.pose import IDENTITY, Pose, pose_from_row
from ur_cartesian_driver.motion.state import RobotState, RuntimeState
from ur_cartesian_driver.protocol.reverse import TrajectoryAction

#: Longest time from CANCEL to the answer and to standstill [s]: the arm brakes within a second
#: from full speed, and discarding the points in flight takes 0.5 s at most.
STOP_BOUND = 3.0
#: How long the robot may take to report a TCP that it was told [s].
TCP_BOUND = 1.0
#: How far the arm may have gone from where the plan begins until it is armed [m], [rad].
START_POSITION, START_ANGLE = 0.001, 0.01
#: How long a program that answered CANCELED may take to begin all the same [s].
EARLY_ANSWER = 1.0
#: How long the arm may need from the program's SUCCESS to rest inside its goal tolerance, when
#: the goal does not say [s].
DEFAULT_GOAL_TIME_TOLERANCE = 1.0
#: How long a deeper reason for the end of the robot program is waited for [s]: what dies together
#: is reported by different connections, some cycles apart.
GATHER = 0.1
#: How long the target may stand still in the middle of a goal that nothing holds [s].
STALL_BOUND = 2.0
#: How far the controller's own target may be from the plan [m], [rad].
MAX_PLAN_DEVIATION = (0.002, 0.02)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Order:
    """What of a plan the machine needs; small to send to another process."""

    points: int
    reference: ReferencePath
    #: Expected time at full speed [s].
    duration: float
    #: When the last point is due [s]; None where the goal names no times.
    due: float | None = None
    T_base_frame: Pose = IDENTITY
    #: The TCP that the plan found, the one that it needs (None = that one), and where the
    #: controlled frame is behind it.
    T_flange_active: Pose = IDENTITY
    T_flange_tcp: Pose | None = None
    T_tcp_controlled: Pose = IDENTITY
    path_tolerance: Tolerance = field(default_factory=Tolerance)
    goal_tolerance: Tolerance = field(default_factory=Tolerance)
    #: 0 = the default, negative = without end [s].
    goal_time_tolerance: float = 0.0
    #: Whether the robot program tells how many points it has begun; if not, nobody looks there.
    reports_begun: bool = True
    #: Whether the plan knows its speeds: not those of OPTIMIZED moves.
    knows_pace: bool = True


class TrajectoryMachine:
    """The table above for one goal; see the module's description."""

    def __init__(self, order: Order, *, feedback_period: float = 0.04,
                 max_plan_deviation: tuple[float, float] = MAX_PLAN_DEVIATION,
                 continues: bool = False) -> None:
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
        self._tracker = PathTracker(order.reference)
        self._pace = Pace(order.reference) if order.knows_pace else None
        self._path_watch = Watch(order.path_tolerance, order.T_base_frame)
        self._goal_watch = Watch(order.goal_tolerance, order.T_base_frame)
        self._watches_tcp = order.T_tcp_controlled == IDENTITY
        self._max_plan_deviation = max_plan_deviation
        self._surely_allowed = tuple(limit or inf for limit in max_plan_deviation)
        #: Whether the robot program has read START: it has begun a point, or the target moves.
        self._under_way = False
        self._window = Window(order.points)
        self._feedback_period = feedback_period
        self._next_report = -inf
        self._latest: RobotState | None = None
        #: The count of the goal before, as long as the robot reports it; None afterwards.
        self._stale_begun: int | None = None
        #: Time since the start in which the controller's own clock ran [s].
        self._scaled_time = 0.0
        #: How long the target has stood still while nothing held it [s].
        self._stalled_time = 0.0
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
            self._observe(event.state, now)
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
                reason = reason.removeprefix(f'{link}: ')
                return Signal.CONNECTION_LOST, f'the {link} connection was lost: {reason}'
            case Tick():
                return self._late(now)
        raise TypeError(f'unknown event {event!r}')

    def _judge(self, state: RobotState, now: float) -> tuple[Signal | None, str]:
        """Return what a packet of a robot that runs means in the present state."""
        if self.state is State.MOVING:
            return (self._plan_deviation(state) or self._wrong_pace(state) or self._stall()
                    or self._path_violation(state))
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
        """Tell whether the robot has the TCP of the goal, also in what else it reports."""
        assert self.loan is not None
        return self.loan.has_robot(state) and self._off_start(state) is None

    def _off_start(self, state: RobotState) -> str | None:
        """Return a clause that says how far the arm is from where the plan begins, or None."""
        start = pose_from_row(self.order.reference.poses[0])
        apart, angle = start.distance_to(state.actual_tcp_pose), start.angle_to(
            state.actual_tcp_pose)
        if apart <= START_POSITION and angle <= START_ANGLE:
            return None
        return (f'the arm is {apart:.4f} m and {angle:.4f} rad away from where the plan begins: '
                'it moved meanwhile')

    def _plan_deviation(self, state: RobotState) -> tuple[Signal, str] | None:
        """Return that the controller does something else than the plan, or None."""
        if not self._under_way or self._tracker.is_within(*self._surely_allowed):
            return None
        for name, unit, value, limit in zip(
                ('max_plan_deviation', 'max_plan_deviation_angle'), ('m', 'rad'),
                self._tracker.deviation(state.target_tcp_pose), self._max_plan_deviation,
                strict=True):
            if 0.0 < limit < value:
                return Signal.DEVIATION, (
                    f'the controller itself left the plan by {value:.6f} {unit}, {name} is '
                    f'{limit:.6f} {unit}: the arm is on another branch, or something else than '
                    'this goal moves it')
        return None

    def _wrong_pace(self, state: RobotState) -> tuple[Signal, str] | None:
        """Return that a program which tells no progress goes much faster or slower, or None."""
        if self._pace is None or self._stale_begun is None:
            return None
        clause = self._pace.violation(
            state.target_tcp_twist, self._scaled_time, self._tracker.time())
        return None if clause is None else (Signal.DEVIATION, clause)

    def _arrival(self, state: RobotState, now: float) -> tuple[Signal | None, str]:
        """Return what it means that the arm rests after the program's SUCCESS."""
        missed = self._missed_end(state)
        if missed and now >= self._arrival_due:
            return Signal.DEVIATION, missed
        if not missed and self._goal_error(state) is None:
            return Signal.SETTLED, ''
        return self._late(now)

    def _missed_end(self, state: RobotState) -> str:
        """Return that the controller's target is not at the end, as a clause, or nothing."""
        off = [value for value, limit in zip(
            self._tracker.deviation(state.target_tcp_pose), self._max_plan_deviation, strict=True)
            if 0.0 < limit < value]
        return '' if not off else (
            f'the robot program reports the end {off[0]:.4f} m or rad away from the last point: '
            'it left out motions that it does not know; set wire_dialect to the version of that '
            'program')

    def _stall(self) -> tuple[Signal, str] | None:
        """Return that the arm stands for no reason, or None."""
        if self._stalled_time < STALL_BOUND:
            return None
        return Signal.STALLED, (
            f'the arm has stood still for {STALL_BOUND:g} s, nothing holds it, and the robot '
            'program has not reported the end: a message to it or from it was lost, so it was '
            'ended')

    def _path_violation(self, state: RobotState) -> tuple[Signal | None, str]:
        if not (self._path_watch and self._under_way):
            return None, ''
        clause = self._violation(self._path_watch, self._desired(state), state)
        if clause is None:
            return None, ''
        return Signal.VIOLATION, f'on the way to point {self._tracker.waypoint()} {clause}'

    def _goal_error(self, state: RobotState) -> str | None:
        return self._violation(self._goal_watch, self._tracker.pose(), state)

    def _violation(self, watch: Watch, desired: Pose, state: RobotState) -> str | None:
        """Return what a watch says of the controlled frame; ``desired`` is of the TCP."""
        if self._watches_tcp:
            return watch.violation(desired, state)
        T_tcp_controlled = self.order.T_tcp_controlled
        return watch.violation(desired @ T_tcp_controlled, seen_at(state, T_tcp_controlled))

    def _desired(self, state: RobotState) -> Pose:
        """Return where the tool should be: around its progress, or at the end."""
        if self.state is State.SETTLING:
            return self._tracker.pose()
        return self._tracker.desired(state.actual_tcp_pose, state.target_tcp_twist)

    def _has_not_begun(self) -> bool:
        """
        Tell whether the program has not reported a point of this goal yet.

        A CANCELED that comes then most likely answers a goal whose end nobody waited for, because
        RTDE was lost; it names no goal. It counts only if nothing begins after it.
        """
        return self.state is State.MOVING and self._stale_begun is not None

    def _late(self, now: float) -> tuple[Signal | None, str]:
        if now < self._deadline:
            return None, ''
        if self.state is State.MOVING:
            self._deadline = inf
            return RESULTS[TrajectoryResult.CANCELED] if self._has_not_begun() else (None, '')
        if self.state is State.ARMING:
            return Signal.LATE, self._why_not_armed()
        if self.state in (State.RESTORING, State.ENDING):
            return Signal.LATE, ''
        if self.state is State.SETTLING:
            return self._unsettled()
        if self.state is State.STOPPING and self._latest is not None and _rests(self._latest):
            return Signal.UNANSWERED, ''
        return Signal.LATE, (f'the robot did not confirm the stop within {STOP_BOUND:g} s, '
                             'its program was ended')

    def _unsettled(self) -> tuple[Signal, str]:
        """Return what has kept the arm from arriving until now."""
        state = self._latest
        if state is None or not _rests(state):
            return Signal.LATE, 'the arm did not come to rest'
        if missed := self._missed_end(state):
            return Signal.DEVIATION, missed
        return Signal.LATE, self._goal_error(state) or 'the arm did not come to rest'

    def _why_not_armed(self) -> str:
        state = self._latest
        if state is not None and self.loan is not None and self.loan.has_robot(state):
            return self._off_start(state) or ''
        return (f'the robot did not take the TCP of the goal within {TCP_BOUND:g} s: its program '
                'is paused, or does not know that command; nothing was moved')

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
        return _ENTER[step.state](self, signal, now)

    def _enter_moving(self, signal: Signal, now: float) -> list[Command]:
        assert self._latest is not None
        return self._begin(self._latest)

    def _begin(self, state: RobotState) -> list[Command]:
        self._deadline = inf
        self._started = True
        self._stale_begun = state.points_begun
        return [SendControl(action=TrajectoryAction.START, count=self.order.points),
                *self._release(0)]

    def _enter_settling(self, signal: Signal, now: float) -> list[Command]:
        self._tracker.finish()
        tolerance = self._time_tolerance()
        self._deadline = inf if tolerance < 0.0 else now + tolerance
        self._arrival_due = min(self._deadline, now + DEFAULT_GOAL_TIME_TOLERANCE)
        late = 0.0 if self.order.due is None else self._scaled_time - self.order.due
        if 0.0 <= tolerance < late:
            return self._apply(Signal.LATE, (
                f'the last point was reached {late:.3f} s after its time '
                f'{self.order.due:.3f} s, goal_time_tolerance is {tolerance:.3f} s'), now)
        return []

    def _enter_stopping(self, signal: Signal, now: float) -> list[Command]:
        self._deadline = now + STOP_BOUND
        return [SendControl(action=TrajectoryAction.CANCEL, count=self._window.sent)]

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
        return [*self._last_report(), Finish(outcome=Outcome(
            code=code, text=self._sentence(code), report=self._about_tcp()))]

    def _last_report(self) -> list[Report]:
        return [self._progress_report()] if self._shows_goal() else []

    def _shows_goal(self) -> bool:
        """Tell whether the newest packet is about the TCP of the goal."""
        state, loan = self._latest, self.loan
        return state is not None and (loan is None or loan.has_robot(state))

    def _about_tcp(self) -> tuple[str, ...]:
        if self.loan is None:
            return ()
        if self.loan.returned:
            state = self._latest
            if state is not None and same_tcp(state.T_flange_tcp, self.loan.T_flange_before):
                return ('the TCP of the robot was set for the goal, and is what it was before',)
            return ('the TCP of the robot was set for the goal; somebody else has set another one '
                    'since, which is left alone',)
        return ('the TCP of the robot was set for the goal, and is not back yet: no goal is taken '
                'until it is',)

    def _sentence(self, code: ErrorCode) -> str:
        if code is ErrorCode.SUCCESSFUL:
            points = self.order.points
            what = 'The point was' if points == 1 else f'All {points} points were'
            return f'{what} executed in {self._scaled_time:.3f} s.'
        where = f'on the way to point {self._tracker.waypoint()}'
        if not self._started:
            where = 'before anything moved'
        if code is ErrorCode.GOAL_TOLERANCE_VIOLATED:
            where = 'at the last point'
        text = self._text if where in self._text else f'{self._text} ({where})'
        return text[:1].upper() + text[1:] + '.'

    # ---- observing ----------------------------------------------------------------------------

    def _observe(self, state: RobotState, now: float) -> None:
        """Take a packet: time, and place on the path."""
        before, self._latest = self._latest, state
        if self.loan is not None:
            self.loan.observe(state, now)
        if before is None or self.state is not State.MOVING:
            passed = 0.0
        else:
            passed = max(0.0, state.timestamp - before.timestamp)
            if state.runtime_state is not RuntimeState.PAUSED:
                self._scaled_time += passed * state.speed_scaling
        if self.state is State.MOVING:
            self._follow(before, state, passed)
            self._stalled_time = self._stalled_time + passed if _stands(before, state) else 0.0

    def _inform(self, state: RobotState, now: float) -> list[Command]:
        """Return the points to send and the progress to report after a packet."""
        if self.state is State.ENDED:
            return []
        commands = self._release(max(self._begun(state), self._tracker.waypoint()))
        if now >= self._next_report and self._shows_goal():
            self._next_report = now + self._feedback_period
            commands.append(self._progress_report())
        return commands

    def _follow(self, before: RobotState | None, state: RobotState, passed: float) -> None:
        """Find the place on the path."""
        begun, fastest = self._begun(state), speed(state.target_tcp_twist)
        self._under_way = self._under_way or begun > 0 or fastest > 0.0
        if before is not None:  # it may have braked since
            fastest = max(fastest, speed(before.target_tcp_twist))
        self._tracker.update(state.target_tcp_pose, 2.0 * passed * fastest, begun)

    def _begun(self, state: RobotState) -> int:
        """
        Return how many points of this goal the robot has begun; 0 = unknown.

        The register keeps the count of the goal before until the robot program has read START, so
        it is believed once it changes.
        """
        if not self.order.reports_begun or state.points_begun == self._stale_begun:
            return 0
        self._stale_begun = None
        return state.points_begun

    def _release(self, begun: int) -> list[Command]:
        if self.state is not State.MOVING:
            return []
        first, end = self._window.release(begun)
        return [SendPoints(first=first, end=end)] if end > first else []

    def _progress_report(self) -> Report:
        state, order = self._latest, self.order
        assert state is not None
        seen = seen_at(state, order.T_tcp_controlled)
        time = self._tracker.time()
        buffered_from = min(self._window.sent, order.points)
        last = int(np.searchsorted(order.reference.point, buffered_from - 1, side='right')) - 1
        return Report(progress=Progress(
            waypoint=self._tracker.waypoint(),
            fraction=1.0 if order.duration <= 0.0 else min(1.0, time / order.duration),
            desired_pose=self._desired(state) @ order.T_tcp_controlled,
            desired_twist=seen.target_tcp_twist,
            desired_acceleration=seen.target_tcp_acceleration,
            actual_pose=seen.actual_tcp_pose,
            actual_twist=seen.actual_tcp_twist,
            actual_acceleration=seen.actual_tcp_acceleration,
            actual_q=state.actual_q,
            time=time,
            time_remaining=max(0.0, order.duration - time),
            speed_scaling=state.speed_scaling,
            points_received=order.points,
            buffered=max(0.0, float(order.reference.time[max(last, 0)]) - time),
            timestamp=state.timestamp))

    def _time_tolerance(self) -> float:
        return self.order.goal_time_tolerance or DEFAULT_GOAL_TIME_TOLERANCE


def _rests(state: RobotState) -> bool:
    return max(map(abs, state.actual_qd)) < REST_SPEED


def _stands(before: RobotState | None, state: RobotState) -> bool:
    """Tell whether the target stands although neither slider nor pause holds it."""
    return (before is not None and state.target_q == before.target_q
            and state.target_tcp_pose == before.target_tcp_pose
            and state.speed_scaling > 0.0 and state.target_speed_fraction > 0.0
            and state.runtime_state is RuntimeState.PLAYING)


_ENTER: Mapping[State, Callable[[TrajectoryMachine, Signal, float], list[Command]]] = (
    MappingProxyType({
        State.MOVING: TrajectoryMachine._enter_moving,
        State.SETTLING: TrajectoryMachine._enter_settling,
        State.STOPPING: TrajectoryMachine._enter_stopping,
        State.HALTING: TrajectoryMachine._enter_halting,
        State.RESTORING: TrajectoryMachine._enter_restoring,
        State.ENDING: TrajectoryMachine._enter_ending,
        State.ENDED: TrajectoryMachine._enter_ended,
    }))
