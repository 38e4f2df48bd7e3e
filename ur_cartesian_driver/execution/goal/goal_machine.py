# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The state machine that takes one goal through the robot program.

It sends nothing and reads no clock. The owner of the sockets calls :meth:`GoalMachine.start` once
and then :meth:`GoalMachine.step` with every event, and carries out the commands that they return,
until one of them is :class:`~.goal_commands.Finish`.

Each event becomes a signal, the signal chooses a transition in the table of
:mod:`~.goal_transitions`, and the state that is entered gives commands. :mod:`~.goal_monitor`
compares the packets of the robot with the plan; a :class:`~.feeder.Feeder` knows what to send to
the robot and what its answers mean.
"""

from __future__ import annotations

from math import inf
from typing import NamedTuple

from ur_cartesian_driver.execution.goal.feeder import Feeder
from ur_cartesian_driver.execution.goal.goal_commands import (
    Finish,
    GoalCommand,
    LogWarning,
    ReportProgress,
    RestoreTcp,
    SetTemporaryTcp,
    StopProgram,
)
from ur_cartesian_driver.execution.goal.goal_transitions import (
    detect_stop,
    GoalState,
    INITIAL_STATE,
    INTERRUPTIBLE_STATES,
    is_at_rest,
    MONITORED_STATES,
    NO_STOP,
    RESUMABLE_STOPS,
    RUNNING_STATES,
    STOP_PROGRAM_AFTER,
    TRANSITIONS,
)
from ur_cartesian_driver.execution.goal.missed_deadlines import missed_deadline
from ur_cartesian_driver.execution.goal.motion_job import AppendJob, MotionJob
from ur_cartesian_driver.execution.goal.outcome_codes import (
    GoalSignal,
    Meaning,
    NO_MEANING,
    RESULT_SIGNALS,
)
from ur_cartesian_driver.execution.goal.outcome_text import failure_text, tcp_report
from ur_cartesian_driver.execution.goal.output_guard import OutputGuard
from ur_cartesian_driver.execution.goal.temporary_tcp import TemporaryTcp
from ur_cartesian_driver.execution.goal.timeouts import (
    ARMING_TIMEOUT,
    CAUSE_TIMEOUT,
    EARLY_CANCELED_TIMEOUT,
    SAFE_OUTPUTS_TIMEOUT,
    STOP_TIMEOUT,
)
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.events import (
    CancelRequested,
    Event,
    LinkLost,
    Outcome,
    OutputsSecured,
    PreemptRequested,
    StateReceived,
    Tick,
    TrajectoryEnded,
    TrajectoryResult,
)
from ur_cartesian_driver.motion.goal.goal import DEFAULT_GOAL_TIME_TOLERANCE
from ur_cartesian_driver.motion.state.robot_state import RobotState
from ur_cartesian_driver.motion.state.state_age import explain_age


class MotionStatus(NamedTuple):
    """How far a motion is; NaN = unknown."""

    #: The number of the point to which the arm moves.
    waypoint: int
    #: The motion time that the robot has received and not yet run [s].
    buffered: float
    #: How far the arm is behind the newest set-point [s].
    lag: float


class GoalMachine:
    """Takes one goal through the table of states."""

    def __init__(
        self,
        feeder: Feeder,
        *,
        feedback_period: float = 0.04,
        resume_after_stop: bool = False,
        max_state_age: float = 0.0,
    ) -> None:
        """
        Prepare; nothing happens before :meth:`start`.

        :param feeder: sends the motion of this goal.
        :param feedback_period: time between two progress reports [s].
        :param resume_after_stop: a protective or safeguard stop pauses the goal, until somebody
            unlocks the robot and plays its program; otherwise it ends the goal.
        :param max_state_age: the goal ends when the newest state of the robot is older [s]; 0 =
            it may have any age.
        """
        self.state = INITIAL_STATE
        self.feeder = feeder
        #: The TCP that was set for this goal, if any. The owner of the sockets restores it if it
        #: is not ``is_restored`` when the goal ends.
        self.temporary_tcp: TemporaryTcp | None = None
        self._monitor = feeder.monitor
        #: Its outputs that have to be safe, if any.
        self._guard: OutputGuard | None = None
        self._ignored_stops = RESUMABLE_STOPS if resume_after_stop else NO_STOP
        self._max_state_age = max_state_age or inf
        #: When the newest packet was true [s]; None = not known yet.
        self._packet_time: float | None = None
        self._feedback_period = feedback_period
        self._next_report = -inf
        self._deadline = inf
        #: In SETTLING: when the controller's target has to be at the last point [s].
        self._arrival_due = inf
        #: The outcome, as far as it is decided.
        self._code: ErrorCode | None = None
        self._text = ''
        self._has_moved = False
        self._is_decided = False

    @property
    def job(self) -> MotionJob:
        """The motion that was appended last, or the first one."""
        return self._monitor.job

    def start(self, packet: RobotState) -> list[GoalCommand]:
        """
        Return the commands that start the motion, or those that prepare it.

        :param packet: the newest packet of the robot.
        """
        self._packet = packet
        commands = self.feeder.prepare()
        T_flange_tcp = self.job.T_flange_tcp
        if self.job.safe_outputs:
            self._guard = OutputGuard(self.job.safe_outputs, packet, self.job.following_outputs)
            commands.append(self._guard.arm())
        if T_flange_tcp is not None:
            self.temporary_tcp = TemporaryTcp(self.job.T_flange_active, T_flange_tcp)
            commands.append(SetTemporaryTcp(T_flange_tcp=T_flange_tcp))
        elif self._guard is None and not self.feeder.explain_not_ready(packet):
            # No time is needed: MOVING has no deadline.
            commands += self._apply(GoalSignal.ARMED, '', -inf)
        return commands

    def step(self, event: Event | AppendJob, now: float) -> list[GoalCommand]:
        """
        Return the commands that answer an event, or points that were appended.

        :param now: time of a steady clock [s].
        """
        if isinstance(event, AppendJob):
            return self._append(event, now)
        if self.state is GoalState.ENDED:
            return []
        if self._packet_time is None:
            self._packet_time = now - self._packet.state_age
        if self.state is GoalState.ARMING:
            self._deadline = min(self._deadline, now + ARMING_TIMEOUT)
        commands = self.feeder.take(event, now)
        if isinstance(event, StateReceived):
            self._packet_time = now - event.state.state_age
            self._observe(event.state, now)
            if self._guard is not None:
                goes_on = self.state in INTERRUPTIBLE_STATES
                commands += self._guard.observe(event.state, goes_on=goes_on)
        elif isinstance(event, OutputsSecured):
            return commands + self._take_secured(event)
        signal, text = self._interpret(event, now)
        if signal is not None:
            commands += self._apply(signal, text, now)
        # A CANCEL does not wait for a progress report: the next packet brings one.
        sends_cancel = signal is not None and self.state is GoalState.CANCELLING
        if isinstance(event, StateReceived) and not sends_cancel:
            commands += self._after_packet(now)
        return commands

    def motion_status(self) -> MotionStatus:
        """Return how far the motion is, for the recording."""
        return MotionStatus(self._monitor.waypoint(), self.feeder.buffered, self.feeder.lag)

    def end_time_of(self, records: int) -> float:
        """Return when the first ``records`` records are planned to end [s]."""
        return self._monitor.records.end_time(records)

    def _observe(self, packet: RobotState, now: float) -> None:
        self._packet = packet
        if self.temporary_tcp is not None:
            self.temporary_tcp.observe(packet, now)
        begun, behind = self.feeder.motions_begun(packet)
        self._monitor.update(
            packet,
            begun,
            behind,
            moving=self.state in RUNNING_STATES,
            applied_offset=self.feeder.applied_offset(packet),
        )
        if self.state is GoalState.SETTLING:  # its time is that of the controller
            self._deadline += self._monitor.held_time
            self._arrival_due += self._monitor.held_time

    def _take_secured(self, event: OutputsSecured) -> list[GoalCommand]:
        assert self._guard is not None
        self._guard.take(event)
        return [LogWarning(text=event.failure)] if event.failure else []

    def _append(self, append_job: AppendJob, now: float) -> list[GoalCommand]:
        answer = self.feeder.append(append_job, self.state)
        if answer.refusal:
            return [answer]
        if self.state is GoalState.MOVING:
            return [answer, *self.feeder.feed()]
        return [answer, *self._apply_supply(now)]

    # ---- from events to signals ---------------------------------------------------------------

    def _interpret(self, event: Event, now: float) -> Meaning:
        """Return what the event means, with a clause for the outcome's text."""
        meaning = self.feeder.interpret(event, self.state)
        if meaning is not None:
            return meaning
        match event:
            case StateReceived(state=packet):
                return (
                    detect_stop(packet, self._ignored_stops)
                    or self._check_age(now)
                    or self._check_outputs()
                    or self._check_packet(packet, now)
                )
            case TrajectoryEnded(result=TrajectoryResult.CANCELED) if self._has_not_begun():
                self._deadline = now + EARLY_CANCELED_TIMEOUT
                return NO_MEANING
            case TrajectoryEnded(result=TrajectoryResult.INPUT_MISSING) if (
                clause := self._monitor.missing_input()
            ):
                return GoalSignal.FAILURE, clause
            case TrajectoryEnded(result=TrajectoryResult.CONTACT):
                return GoalSignal.CONTACT, self._monitor.contact_clause(self._packet)
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
                return self._check_age(now) or self._check_deadline(now)
        raise TypeError(f'unknown event {event!r}')

    def _check_age(self, now: float) -> Meaning | None:
        """Return that the arm has moved for too long since the newest packet was true."""
        assert self._packet_time is not None
        age = now - self._packet_time
        if age <= self._max_state_age or self.state not in MONITORED_STATES:
            return None
        return GoalSignal.STALE, explain_age(age, self._max_state_age).rstrip('.')

    def _check_outputs(self) -> Meaning | None:
        """Return that a goal must not go on, because a pause has changed its outputs."""
        if self._guard is None or self.state not in INTERRUPTIBLE_STATES:
            return None
        fault = self._guard.fault()
        return (GoalSignal.DEVIATION, fault) if fault else None

    def _check_packet(self, packet: RobotState, now: float) -> Meaning:
        """Return what a packet means in the present state, when nothing stops the robot."""
        if self.state in RUNNING_STATES:
            fault = self._monitor.find_fault(packet, may_stand_still=self.feeder.confirms(now))
            return self.feeder.wait_out(fault, packet) or self.feeder.supply(self.state)
        if self.state is GoalState.ARMING and self._is_armed(packet):
            return GoalSignal.ARMED, ''
        if (
            self.state is GoalState.SETTLING
            and is_at_rest(packet)
            and self.feeder.has_arrived(packet)
        ):
            return self._arrival(packet, now)
        if self.state is GoalState.COMING_TO_REST and is_at_rest(packet):
            return GoalSignal.AT_REST, ''
        if (
            self.state is GoalState.RESTORING
            and self._is_tcp_restored()
            and self._are_outputs_confirmed()
        ):
            return GoalSignal.RESTORED, ''
        signal, text = self._check_deadline(now)
        return (signal, text) if signal is not None else self.feeder.supply(self.state)

    def _is_armed(self, packet: RobotState) -> bool:
        """Tell whether the robot is ready, with the TCP of the goal where the plan begins."""
        tcp = self.temporary_tcp
        return (
            (tcp is None or (tcp.is_active(packet) and self._monitor.start_offset(packet) is None))
            and (self._guard is None or self._guard.is_confirmed(packet))
            and not self.feeder.explain_not_ready(packet)
        )

    def _is_tcp_restored(self) -> bool:
        return self.temporary_tcp is None or self.temporary_tcp.is_restored

    def _are_outputs_confirmed(self) -> bool:
        return self._guard is None or self._guard.is_confirmed(self._packet)

    def _arrival(self, packet: RobotState, now: float) -> Meaning:
        """Return the meaning of an arm at rest after the program's SUCCESS."""
        missed = self._monitor.missed_end(packet)
        if missed and now >= self._arrival_due:
            return GoalSignal.DEVIATION, missed
        if not missed and self._monitor.goal_violation(packet) is None:
            return GoalSignal.SETTLED, ''
        return self._check_deadline(now)

    def _has_not_begun(self) -> bool:
        """
        Tell whether the program runs the goal, but has not reported a point of it yet.

        A CANCELED names no goal. One that comes so early most likely answers an earlier goal,
        whose end was never seen because RTDE was lost. So it counts only if no point begins
        within ``EARLY_CANCELED_TIMEOUT``.
        """
        return self.state in RUNNING_STATES and self._monitor.awaits_count()

    def _check_deadline(self, now: float) -> Meaning:
        """Return the meaning of a deadline that has passed."""
        if now < self._deadline:
            return NO_MEANING
        if self.state not in RUNNING_STATES:
            return missed_deadline(self.state, self.feeder, self.temporary_tcp, self._guard)
        # Only an early CANCELED sets a deadline in these states; it counts if nothing has begun.
        self._deadline = inf
        if self._has_not_begun():
            return RESULT_SIGNALS[TrajectoryResult.CANCELED]
        return NO_MEANING

    # ---- from signals to commands -------------------------------------------------------------

    def _apply(self, signal: GoalSignal, text: str, now: float) -> list[GoalCommand]:
        """Take the transition of the table; nothing else changes the state."""
        transition = TRANSITIONS[self.state][signal]
        before, self.state = self.state, transition.state
        if transition.code is not None:
            if before is GoalState.PROGRAM_LOST:  # this is why the program ended
                text = f'{text}; before that, {self._text}'
            if self._code is ErrorCode.CONNECTION_LOST and signal is GoalSignal.UNCONFIRMED:
                self._text = f'{self._text}; {text}'  # which follows from it
            else:
                self._code, self._text = transition.code, text
        if self.state is before:
            return []
        commands = [] if self._awaits_disarming() else self.feeder.enter(self.state, self._packet)
        return commands + self._enter(self.state, signal, now)

    def _awaits_disarming(self) -> bool:
        """Tell whether a motion that leaves its mode now would set the outputs of a success."""
        return (
            self.state is GoalState.RESTORING
            and self._code is ErrorCode.SUCCESSFUL
            and self._guard is not None
        )

    def _apply_supply(self, now: float) -> list[GoalCommand]:
        signal, text = self.feeder.supply(self.state)
        return [] if signal is None else self._apply(signal, text, now)

    def _enter(self, state: GoalState, signal: GoalSignal, now: float) -> list[GoalCommand]:
        """Set the deadline of a state, and return the commands that are not the feeder's."""
        match state:
            case GoalState.MOVING:
                self._deadline, self._has_moved = inf, True
            case GoalState.AWAITING_POINTS:
                timeout = self.feeder.append_timeout
                self._deadline = now + timeout if timeout > 0.0 else inf
                return self._apply_supply(now)
            case GoalState.SETTLING:
                return self._enter_settling(now)
            case GoalState.CANCELLING | GoalState.COMING_TO_REST:
                self._deadline = now + STOP_TIMEOUT
            case GoalState.RESTORING:
                return self._enter_restoring(now)
            case GoalState.PROGRAM_LOST:
                self._deadline = now + CAUSE_TIMEOUT
                return [] if self._guard is None else self._guard.secure()
            case GoalState.ENDED:
                return self._enter_ended(signal)
        return []

    def _enter_settling(self, now: float) -> list[GoalCommand]:
        self._monitor.finish()
        tolerance = self.job.goal_time_tolerance or DEFAULT_GOAL_TIME_TOLERANCE
        self._deadline = inf if tolerance < 0.0 else now + tolerance
        self._arrival_due = min(self._deadline, now + DEFAULT_GOAL_TIME_TOLERANCE)
        if late := self._explain_late(tolerance):
            return self._apply(GoalSignal.NOT_SETTLED, late, now)
        return []

    def _explain_late(self, tolerance: float) -> str:
        """
        Return how late the last point was reached, as a clause; empty if in time.

        :param tolerance: allowed delay [s]; negative = any.
        """
        if self.job.due is None or tolerance < 0.0:
            return ''
        due = self.job.due + self.feeder.start_delay
        late = self._monitor.scaled_time - due
        if late <= tolerance:
            return ''
        return (
            f'the last point was reached {late:.3f} s after its time {due:.3f} s, '
            f'goal_time_tolerance is {tolerance:.3f} s'
        )

    def _enter_restoring(self, now: float) -> list[GoalCommand]:
        """Restore the TCP, see to the outputs; a goal that has neither ends at once."""
        self._is_decided = True
        if self.temporary_tcp is None and self._guard is None:
            return self._apply(GoalSignal.RESTORED, '', now)
        commands: list[GoalCommand] = [*self._final_progress()]
        if self._guard is not None:
            self._deadline = now + SAFE_OUTPUTS_TIMEOUT
            succeeded = self._code is ErrorCode.SUCCESSFUL
            commands.append(self._guard.release(succeeded=succeeded))
        if self.temporary_tcp is not None:
            self._deadline = now + ARMING_TIMEOUT
            commands.append(RestoreTcp(T_flange_tcp=self.temporary_tcp.T_flange_original))
        return commands

    def _enter_ended(self, signal: GoalSignal) -> list[GoalCommand]:
        return [*self._secure_unconfirmed(), *self._end(signal)]

    def _secure_unconfirmed(self) -> list[GoalCommand]:
        """Write the safe outputs, unless the robot program has confirmed that they are."""
        if (
            self._guard is None
            or self._code is ErrorCode.SUCCESSFUL
            or (self._is_decided and self._guard.is_safe(self._packet))
        ):
            return []
        if self._is_decided:  # it was told to
            return self._guard.secure()
        return [self._guard.release(succeeded=False), *self._guard.secure()]

    def _end(self, signal: GoalSignal) -> list[GoalCommand]:
        if self._is_decided:  # no motion is left that could resume
            return self._finish()
        if signal in STOP_PROGRAM_AFTER:
            return [StopProgram(reason=self._text), *self._finish()]
        return self._finish()

    # ---- reports ------------------------------------------------------------------------------

    def _after_packet(self, now: float) -> list[GoalCommand]:
        """Return the next points to send, and the progress report if one is due."""
        if self.state is GoalState.ENDED:
            return []
        commands = self.feeder.feed() if self.state is GoalState.MOVING else []
        if now >= self._next_report and self._has_progress():
            self._next_report = now + self._feedback_period
            commands += [self._progress(), *self.feeder.extra_reports()]
        return commands

    def _has_progress(self) -> bool:
        """Tell whether the newest packet shows the motion, with the TCP of the goal."""
        packet, tcp = self._monitor.latest, self.temporary_tcp
        return (
            packet is not None
            and self.feeder.has_progress
            and (tcp is None or tcp.is_active(packet))
        )

    def _progress(self) -> ReportProgress:
        waits = self.state is GoalState.AWAITING_POINTS
        return ReportProgress(
            progress=self._monitor.progress(
                buffered=self.feeder.buffered,
                lag=self.feeder.lag,
                at_end=waits or self.state is GoalState.SETTLING,
                waits=waits,
            )
        )

    def _final_progress(self) -> list[GoalCommand]:
        return [self._progress()] if self._has_progress() else []

    def _finish(self) -> list[GoalCommand]:
        code = self._code if self._code is not None else ErrorCode.EXECUTION_FAILED
        if code is ErrorCode.SUCCESSFUL:
            text = f'{self._text}.' if self._text else self.feeder.success_text()
        elif code is ErrorCode.GOAL_TOLERANCE_VIOLATED:
            text = failure_text(self._text, 'at the last point')
        else:
            text = failure_text(self._text, self.feeder.location(started=self._has_moved))
        stopped = None
        if code is not ErrorCode.SUCCESSFUL and len(self.job.waypoint):
            stopped = self._monitor.place()
        report = (
            *tcp_report(self.temporary_tcp, self._monitor.latest),
            *self.feeder.report_lines(),
        )
        return [
            *self._final_progress(),
            Finish(outcome=Outcome(code=code, text=text, report=report, stopped=stopped)),
        ]
