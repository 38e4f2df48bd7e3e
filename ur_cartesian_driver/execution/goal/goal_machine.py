# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The state machine of one goal, from its start to its outcome.

The machine sends nothing and reads no clock. The owner of the sockets calls
:meth:`GoalMachine.start` once and then :meth:`GoalMachine.step` with every event, and carries out
the returned commands, until one of them is :class:`~.goal_commands.Finish`.

An event becomes a signal or has no effect. The signal selects a transition in the table of
:mod:`~.goal_transitions`, and entering the new state yields commands. :mod:`~.goal_monitor`
compares each packet (the robot's state, as RTDE reports it) with the plan; a
:class:`~.feeder.Feeder` sends the motion to the robot program.
"""

from __future__ import annotations

from dataclasses import replace
from math import inf
from typing import NamedTuple

from ur_cartesian_driver.execution.goal import timeouts
from ur_cartesian_driver.execution.goal.feeder import Capabilities, Feeder
from ur_cartesian_driver.execution.goal.goal_commands import (
    Finish,
    GoalCommand,
    LogWarning,
    ReportProgress,
    ReportPulses,
    RestoreTcp,
    SetTemporaryTcp,
    StopProgram,
)
from ur_cartesian_driver.execution.goal.goal_outcome import GoalOutcome
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
from ur_cartesian_driver.execution.goal.output_guard import OutputGuard
from ur_cartesian_driver.execution.goal.pulse_counter import PulseCounter
from ur_cartesian_driver.execution.goal.temporary_tcp import TemporaryTcp
from ur_cartesian_driver.motion import events
from ur_cartesian_driver.motion.goal.goal import DEFAULT_GOAL_TIME_TOLERANCE
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.motion.state.state_age import explain_age

#: The events in which the robot program reports through registers.
_REGISTERS = (events.ServoReceived, events.OffsetReceived)


class MotionStatus(NamedTuple):
    """The progress of a motion, recorded with each robot state; NaN = unknown."""

    #: The number of the point to which the arm moves.
    waypoint: int
    #: The motion time that the robot has received and not yet run [s].
    buffered: float
    #: The time by which the arm lags the newest set-point [s].
    lag: float


class GoalMachine:
    """Runs one goal: answers events with commands, by the table of transitions."""

    def __init__(
        self,
        feeder: Feeder,
        *,
        feedback_period: float = 0.04,
        resume_after_stop: bool = False,
        max_state_age: float = 0.0,
    ) -> None:
        """
        Keep the settings; no command is given before :meth:`start`.

        :param feeder: sends the motion of this goal.
        :param feedback_period: time between two progress reports [s].
        :param resume_after_stop: whether a protective or safeguard stop only pauses the goal,
            until somebody unlocks the robot and plays its program; if False, it ends the goal.
        :param max_state_age: the goal ends when the newest state of the robot is older than this
            [s]; 0 = no limit.
        """
        self.state = INITIAL_STATE
        self.feeder = feeder
        #: The capabilities of the feeder.
        self.can = Capabilities(feeder)
        #: The TCP set for this goal, if any. If its ``is_restored`` is False when the
        #: goal ends, the owner of the sockets restores the original TCP.
        self.temporary_tcp: TemporaryTcp | None = None
        self._monitor = feeder.monitor
        self._ignored_stops = RESUMABLE_STOPS if resume_after_stop else NO_STOP
        self._max_state_age = max_state_age or inf
        #: When the state in the newest packet was measured, by the clock of :meth:`step` [s]; None
        #: = not known yet.
        self._packet_time: float | None = None
        self._feedback_period = feedback_period
        self._next_report = -inf
        self._deadline = inf
        #: In SETTLING: the time by which the controller's target must be at the last point [s].
        self._arrival_due = inf
        #: The outcome, as far as it is decided.
        self.outcome = GoalOutcome(self._monitor, self.can)
        self._has_entered_restoring = False

    @property
    def job(self) -> MotionJob:
        """The last appended job, or the goal's first job if nothing was appended."""
        return self._monitor.job

    def start(self, packet: RobotState) -> list[GoalCommand]:
        """
        Return the commands that prepare the motion, or start it if nothing must be prepared.

        :param packet: the newest packet of the robot.
        """
        job = self.job
        self._packet = packet = self._seen(packet)
        own = job.following_outputs.union(job.pulse_outputs)
        self._guard = OutputGuard(job.safe_outputs, packet, own)
        self._pulses = PulseCounter(job.pulse_outputs, packet)
        commands = [*self.can.preparation.prepare(), *self._guard.arm()]
        if job.T_flange_tcp is not None:
            self.temporary_tcp = TemporaryTcp(job.T_flange_active, job.T_flange_tcp)
            commands.append(SetTemporaryTcp(T_flange_tcp=job.T_flange_tcp))
        elif not self._guard and not self.can.preparation.explain_not_ready(packet):
            # The time does not matter here, because MOVING has no deadline.
            commands += self._apply(GoalSignal.ARMED, '', -inf)
        return commands

    def step(self, event: events.Event | AppendJob, now: float) -> list[GoalCommand]:
        """
        Return the commands with which the machine answers an event or appended points.

        :param now: time of a steady clock [s].
        """
        if isinstance(event, AppendJob):
            return self._append(event, now)
        if self.state is GoalState.ENDED:
            return []
        if self.job.moving_frame is not None and isinstance(event, events.StateReceived):
            event = replace(event, state=self._seen(event.state))
        if self._packet_time is None:
            self._packet_time = now - self._packet.state_age
        if self.state is GoalState.ARMING:
            self._deadline = min(self._deadline, now + timeouts.ARMING_TIMEOUT)
        commands: list[GoalCommand] = []
        for each in self.can.ageing:
            commands += each.age(now)
        if isinstance(event, events.ContactWatchChanged):
            self._monitor.contact_is_watched = event.is_active
            return commands
        if isinstance(event, events.StateReceived):
            commands += self._observe(event.state, now)
        elif isinstance(event, _REGISTERS):
            commands += self.feeder.feed(event, now)
        elif isinstance(event, events.OutputsSecured):
            self._guard.take(event)
            return commands + ([LogWarning(text=event.failure)] if event.failure else [])
        signal, text = self._interpret(event, now)
        if signal is not None:
            commands += self._apply(signal, text, now)
        # The progress report waits for the next packet if it would delay a CANCEL.
        sends_cancel = signal is not None and self.state is GoalState.CANCELLING
        if isinstance(event, events.StateReceived) and not sends_cancel:
            commands += self._after_packet(event, now)
        return commands

    def _seen(self, packet: RobotState) -> RobotState:
        """
        Return a packet with the poses and rates of the tool in the frame of the path.

        This frame is the robot's base, or moves with a part that the arm holds.
        """
        frame = self.job.moving_frame
        return packet if frame is None else frame.seen(packet)

    def motion_status(self) -> MotionStatus:
        """Return the progress of the motion, for the recording."""
        return MotionStatus(self._monitor.waypoint(), self.feeder.buffered, self.can.streaming.lag)

    def end_time_of(self, records: int) -> float:
        """Return the planned end of the first ``records`` instructions sent to the robot [s]."""
        return self._monitor.records.end_time(records)

    def _observe(self, packet: RobotState, now: float) -> list[GoalCommand]:
        """Take in a packet; return the commands for safe outputs, and a report of new pulses."""
        self._packet, self._packet_time = packet, now - packet.state_age
        if self.temporary_tcp is not None:
            self.temporary_tcp.observe(packet, now)
        begun, behind = self.can.streaming.motions_begun(packet)
        self._monitor.update(
            packet,
            begun,
            behind,
            moving=self.state in RUNNING_STATES,
            applied_offset=self.can.displacement.applied_offset(packet),
            feed=self.can.overriding.observe_feed(packet, now),
        )
        # The deadlines of SETTLING stand still in a pause, and run slower with the speed slider.
        if self.state is GoalState.SETTLING:
            self._deadline += self._monitor.held_time
            self._arrival_due += self._monitor.held_time
        commands = self._guard.observe(packet, goes_on=self.state in INTERRUPTIBLE_STATES)
        if pulses := self._pulses.observe(packet):
            commands = [*commands, ReportPulses(pulses=pulses)]
        return commands

    def _append(self, append_job: AppendJob, now: float) -> list[GoalCommand]:
        commands = self.can.appending.append(append_job, self.state)
        if self.state is GoalState.MOVING:  # the next packet shows whether points run out
            return commands
        return commands + self._apply_supply(now)

    # ---- from events to signals ---------------------------------------------------------------

    def _interpret(self, event: events.Event, now: float) -> Meaning:
        """Return the signal of an event (None = none), and a clause for the outcome's text."""
        meaning = self.can.interpretation.interpret(event, self.state)
        if meaning is not None:
            return meaning
        match event:
            case events.StateReceived(state=packet):
                return (
                    detect_stop(packet, self._ignored_stops)
                    or self._check_age(now)
                    or self._check_outputs()
                    or self._check_packet(packet, now)
                )
            case events.ServoReceived() | events.OffsetReceived():
                return NO_MEANING
            case events.TrajectoryEnded(result=events.TrajectoryResult.CANCELED) if (
                self._has_not_begun()
            ):
                self._deadline = now + timeouts.EARLY_CANCELED_TIMEOUT
                return NO_MEANING
            case events.TrajectoryEnded(result=events.TrajectoryResult.INPUT_MISSING) if (
                clause := self._monitor.missing_input()
            ):
                return GoalSignal.FAILURE, clause
            case events.TrajectoryEnded(result=events.TrajectoryResult.CONTACT):
                return GoalSignal.CONTACT, self._monitor.contact_clause(self._packet)
            case events.TrajectoryEnded(result=result):
                return RESULT_SIGNALS[result]
            case events.CancelRequested(reason=reason):
                return GoalSignal.CANCEL, reason
            case events.PreemptRequested(by=by):
                return GoalSignal.PREEMPT, f'{by} took the place of this one'
            case events.CollisionFound(reason=reason):
                return GoalSignal.COLLISION, reason
            case events.LinkLost(link='program', reason=reason):
                return GoalSignal.PROGRAM_STOPPED, f'the robot program hung up: {reason}'
            case events.LinkLost(link=link, reason=reason):
                if link == events.INPUTS_LINK and self.state is GoalState.ARMING:
                    refusal = f'the robot does not take {self.can.preparation.motion}: {reason}'
                    return GoalSignal.NOT_READY, refusal.rstrip('.')
                return GoalSignal.CONNECTION_LOST, f'the {link} connection was lost: {reason}'
            case events.Tick():
                return self._check_age(now) or self._check_deadline(now)
        raise TypeError(f'unknown event {event!r}')

    def _check_age(self, now: float) -> Meaning | None:
        """Return the signal if the newest state is too old to monitor the goal, else None."""
        assert self._packet_time is not None
        age = now - self._packet_time
        if age <= self._max_state_age or self.state not in MONITORED_STATES:
            return None
        return GoalSignal.STALE, explain_age(age, self._max_state_age).rstrip('.')

    def _check_outputs(self) -> Meaning | None:
        """Return the signal if a pause changed safe outputs without ``restore``, else None."""
        fault = self._guard.fault()
        if not fault or self.state not in INTERRUPTIBLE_STATES:
            return None
        return GoalSignal.DEVIATION, fault

    def _check_packet(self, packet: RobotState, now: float) -> Meaning:
        """Return the signal of a packet that reports no stop."""
        if self.state in RUNNING_STATES:
            fault = self._monitor.find_fault(
                packet, may_stand_still=self.can.streaming.is_read(now)
            )
            fault = self.can.stalling.wait_out(fault, packet)
            return fault or self.can.appending.supply(self.state)
        if self.state is GoalState.ARMING and self._is_armed(packet):
            return GoalSignal.ARMED, ''
        if is_at_rest(packet):
            if self.state is GoalState.SETTLING and self.can.streaming.has_arrived(packet):
                return self._arrival(packet, now)
            if self.state is GoalState.COMING_TO_REST:
                return GoalSignal.AT_REST, ''
        if self.state is GoalState.RESTORING and self._is_restored():
            return GoalSignal.RESTORED, ''
        signal, text = self._check_deadline(now)
        return (signal, text) if signal is not None else self.can.appending.supply(self.state)

    def _is_armed(self, packet: RobotState) -> bool:
        """
        Return whether the robot is prepared for the motion.

        A TCP set for the goal must be active, and at the start of the plan.
        """
        tcp = self.temporary_tcp
        return (
            (tcp is None or (tcp.is_active(packet) and self._monitor.start_offset(packet) is None))
            and self._guard.is_confirmed(packet)
            and not self.can.preparation.explain_not_ready(packet)
        )

    def _is_restored(self) -> bool:
        """Return whether the robot has its original TCP back and has confirmed the outputs."""
        tcp = self.temporary_tcp
        return (tcp is None or tcp.is_restored) and self._guard.is_confirmed(self._packet)

    def _arrival(self, packet: RobotState, now: float) -> Meaning:
        """Return the signal of an arm at rest after the program's SUCCESS."""
        missed = self._monitor.missed_end(packet)
        if missed and now >= self._arrival_due:
            return GoalSignal.DEVIATION, missed
        if not missed and self._monitor.goal_violation(packet) is None:
            return GoalSignal.SETTLED, ''
        return self._check_deadline(now)

    def _has_not_begun(self) -> bool:
        """
        Return whether the program runs the goal, but has not reported a point of it yet.

        The result CANCELED does not say to which goal it belongs. If it comes this early, it most
        likely belongs to an earlier goal whose end was never seen because RTDE was lost. So it
        takes effect only if no point begins within ``EARLY_CANCELED_TIMEOUT``.
        """
        return self.state in RUNNING_STATES and self._monitor.awaits_count()

    def _check_deadline(self, now: float) -> Meaning:
        """Return the signal if the deadline of the present state has passed, else NO_MEANING."""
        if now < self._deadline:
            return NO_MEANING
        if self.state not in RUNNING_STATES:
            return missed_deadline(
                self.state, self._monitor, self.can, self.temporary_tcp, self._guard
            )
        # In these states only an early CANCELED sets a deadline: if no point has begun by then,
        # the CANCELED takes effect.
        self._deadline = inf
        return (
            RESULT_SIGNALS[events.TrajectoryResult.CANCELED]
            if self._has_not_begun()
            else NO_MEANING
        )

    # ---- from signals to commands -------------------------------------------------------------

    def _apply(self, signal: GoalSignal, text: str, now: float) -> list[GoalCommand]:
        """Make a table transition and return its commands; only this method sets ``state``."""
        transition = TRANSITIONS[self.state][signal]
        before, self.state = self.state, transition.state
        if transition.code is not None:
            self.outcome.decide(transition.code, text, signal, before)
        if self.state is before:
            return []
        # If the program stopped following set-points while the safe outputs are armed, it would
        # set them. So after a success they are disarmed first, and the feeder stops it in ENDED.
        succeeds = self.outcome.succeeds
        disarms_first = self.state is GoalState.RESTORING and succeeds and self._guard
        commands = [] if disarms_first else self.feeder.enter(self.state, self._packet)
        return commands + self._enter(self.state, signal, now)

    def _apply_supply(self, now: float) -> list[GoalCommand]:
        signal, text = self.can.appending.supply(self.state)
        return [] if signal is None else self._apply(signal, text, now)

    def _enter(self, state: GoalState, signal: GoalSignal, now: float) -> list[GoalCommand]:
        """Set the deadline of a state; return the commands to add to the feeder's commands."""
        match state:
            case GoalState.MOVING:
                self._deadline, self.outcome.has_moved = inf, True
            case GoalState.AWAITING_POINTS:
                self._deadline = now + (self.can.appending.append_timeout or inf)
                return self._apply_supply(now)
            case GoalState.SETTLING:
                return self._enter_settling(now)
            case GoalState.CANCELLING | GoalState.COMING_TO_REST:
                self._deadline = now + timeouts.STOP_TIMEOUT
            case GoalState.RESTORING:
                return self._enter_restoring(now)
            case GoalState.PROGRAM_LOST:
                self._deadline = now + timeouts.CAUSE_TIMEOUT
                return self._guard.secure()
            case GoalState.ENDED:
                return [*self._secure_unconfirmed(), *self._end(signal)]
        return []

    def _enter_settling(self, now: float) -> list[GoalCommand]:
        self._monitor.finish()
        tolerance = self.job.goal_time_tolerance or DEFAULT_GOAL_TIME_TOLERANCE
        self._deadline = inf if tolerance < 0.0 else now + tolerance
        self._arrival_due = min(self._deadline, now + DEFAULT_GOAL_TIME_TOLERANCE)
        if late := self.outcome.late_arrival(tolerance):
            return self._apply(GoalSignal.NOT_SETTLED, late, now)
        return []

    def _enter_restoring(self, now: float) -> list[GoalCommand]:
        """Restore the TCP and release the outputs; a goal that set neither ends at once."""
        self._has_entered_restoring = True
        if self.temporary_tcp is None and not self._guard:
            return self._apply(GoalSignal.RESTORED, '', now)
        self._deadline = now + timeouts.SAFE_OUTPUTS_TIMEOUT
        release = self._guard.release(succeeded=self.outcome.succeeds)
        commands = [*self._progress(), *release]
        if self.temporary_tcp is not None:
            self._deadline = now + timeouts.ARMING_TIMEOUT
            commands.append(RestoreTcp(T_flange_tcp=self.temporary_tcp.T_flange_original))
        return commands

    def _secure_unconfirmed(self) -> list[GoalCommand]:
        """Write the safe outputs of a failed goal, unless the program has confirmed them."""
        is_safe = self._has_entered_restoring and self._guard.is_confirmed(self._packet)
        if self.outcome.succeeds or is_safe:
            return []
        # On entering RESTORING, the machine has already released the outputs.
        release = [] if self._has_entered_restoring else self._guard.release(succeeded=False)
        return [*release, *self._guard.secure()]

    def _end(self, signal: GoalSignal) -> list[GoalCommand]:
        # Once RESTORING was entered, no motion is left that could go on.
        if signal in STOP_PROGRAM_AFTER and not self._has_entered_restoring:
            return [StopProgram(reason=self.outcome.cause), *self._finish()]
        return self._finish()

    # ---- reports ------------------------------------------------------------------------------

    def _after_packet(self, event: events.StateReceived, now: float) -> list[GoalCommand]:
        """Return the next points to send, and the progress report if one is due."""
        if self.state is GoalState.ENDED:
            return []
        commands = self.feeder.feed(event, now) if self.state is GoalState.MOVING else []
        if now >= self._next_report and (report := self._progress()):
            self._next_report = now + self._feedback_period
            commands += [*report, *self.can.streaming.reports()]
        return commands

    def _progress(self) -> list[GoalCommand]:
        """Return a progress report; nothing if there is no progress or another TCP is active."""
        packet, tcp = self._monitor.latest, self.temporary_tcp
        if packet is None or not self.can.streaming.has_progress:
            return []
        if tcp is not None and not tcp.is_active(packet):
            return []
        waits = self.state is GoalState.AWAITING_POINTS
        progress = self._monitor.progress(
            buffered=self.feeder.buffered,
            lag=self.can.streaming.lag,
            at_end=waits
            or self.state is GoalState.SETTLING
            or (self.outcome.succeeds and not self.outcome.touched),
            waits=waits,
        )
        return [ReportProgress(progress=progress)]

    def _finish(self) -> list[GoalCommand]:
        outcome = self.outcome.for_client(self.temporary_tcp)
        return [*self._progress(), Finish(outcome=outcome)]
