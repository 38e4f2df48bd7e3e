# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The machine that takes one goal through the buffered servo.

Its states are those of any goal (:mod:`~.states`), and what the packets of the robot show of it
is seen by the same observer; only what goes to the robot differs. Not points and a number of them
go there but set-points, from a source, one for each packet of the robot (:mod:`~.servo_stream`):

* in ARMING the inputs of the robot are taken, the divergence thresholds are written and the
  robot program has to answer, beside the TCP of the goal where it needs another one. Inputs that
  somebody else has, or a program that does not answer, end the goal before anything moves;
* MOVING begins with a full buffer and ends when the last set-point was carried out;
* SETTLING holds that set-point until the arm is there and at rest;
* in STOPPING the mode IDLE is written instead of a CANCEL, and the program's leaving of the servo
  is the answer.

However the goal ends, the robot program is told to brake and listen no more, and the inputs are
given back.
"""

from __future__ import annotations

from dataclasses import replace
from math import inf

import numpy as np

from ur_cartesian_driver.execution.commands import (
    Command,
    EnterServo,
    LeaveServo,
    LendTcp,
    OpenServo,
    Report,
    ReportServo,
    WriteServo,
)
from ur_cartesian_driver.execution.observer import MAX_PLAN_DEVIATION, START_ANGLE
from ur_cartesian_driver.execution.order import Order
from ur_cartesian_driver.execution.servo_source import Setpoints, SplineSetpoints
from ur_cartesian_driver.execution.servo_stream import Phase, ServoSettings, ServoStream
from ur_cartesian_driver.execution.states import Signal, State, UNDER_WAY
from ur_cartesian_driver.execution.tcp_loan import TcpLoan
from ur_cartesian_driver.execution.trajectory import STOP_BOUND, TCP_BOUND, TrajectoryMachine
from ur_cartesian_driver.motion.events import (
    Event,
    LinkLost,
    ServoReceived,
    StateReceived,
    TrajectoryEnded,
)
from ur_cartesian_driver.motion.pose import Vector6
from ur_cartesian_driver.motion.servo import ServoFeedback, UNKNOWN6
from ur_cartesian_driver.motion.state import RobotState

#: The connection to the inputs, as it is called in :class:`LinkLost`.
SERVO_LINK = 'RTDE inputs'
#: A robot program that reads our sequence numbers is not stalled, wherever the arm stands: so
#: lately has it to have read one [s].
ANSWERS_WITHIN = 1.0
#: The controller's target is behind the set-point that the arm is led to by about the lookahead
#: time of ``servoj``, by more with a low gain: so many lookahead times at most.
TRAIL = 4.0


class ServoMachine(TrajectoryMachine):
    """One goal on its way through the buffered servo; see the module's description."""

    def __init__(
        self,
        order: Order,
        *,
        settings: ServoSettings,
        source: Setpoints | None = None,
        feedback_period: float = 0.04,
        max_plan_deviation: tuple[float, float] = MAX_PLAN_DEVIATION,
        continues: bool = False,
    ) -> None:
        """
        Take an order; nothing happens before :meth:`start`.

        :param source: where the set-points come from; None = the spline of the order.
        :raises ValueError: there is neither a source nor a spline.
        """
        # How far it is, the set-points tell; how fast they go, nobody else does.
        super().__init__(
            replace(order, knows_pace=False, reports_begun=order.spline is not None),
            feedback_period=feedback_period,
            max_plan_deviation=max_plan_deviation,
            continues=continues,
        )
        if source is None:
            if order.spline is None:
                raise ValueError('An order for the servo needs a spline or another source.')
            source = SplineSetpoints(order.spline)
        self.state = State.ARMING
        self.stream = ServoStream(source, settings)
        self._trail = TRAIL * settings.lookahead_time
        self._read = -1
        self._last_answer = -inf
        self._is_timed = False

    def start(self, state: RobotState) -> list[Command]:
        """
        Return the commands that prepare the motion: take the inputs, lend the TCP.

        :param state: the robot's newest packet.
        """
        lent = self.order.T_flange_tcp
        if lent is None:
            return [OpenServo()]
        self.loan = TcpLoan(self.order.T_flange_active, lent)
        return [OpenServo(), LendTcp(T_flange_tcp=lent)]

    def step(self, event: Event, now: float) -> list[Command]:
        """
        Return what to do after an event.

        :param now: time of a steady clock [s].
        """
        if self.state is State.ENDED:
            return []
        commands: list[Command] = []
        if isinstance(event, ServoReceived):
            commands = self._stream_on(event.feedback, now)
        elif isinstance(event, StateReceived):
            begun = self._begun(self.stream.motion_time)
            self._observer.trail = begun - self._begun(self.stream.motion_time - self._trail)
            event = StateReceived(state=replace(event.state, points_begun=begun))
        return commands + super().step(event, now)

    def _begun(self, time: float) -> int:
        """Return how many pieces of the spline begin until a time [s]; 0 = none, or unknown."""
        spline = self.order.spline
        if spline is None or time <= 0.0:
            return 0
        return spline.piece(time) + 1

    def _stream_on(self, feedback: ServoFeedback, now: float) -> list[Command]:
        """Answer a packet of the servo's registers with a write."""
        if feedback.last_sequence != self._read:
            self._read, self._last_answer = feedback.last_sequence, now
        opening = self.stream.phase is Phase.OPENING
        row = self.stream.take(feedback, now)
        if self.stream.phase is Phase.SERVOING and not self._is_timed:
            self._is_timed = True
            self._put_off()
        commands: list[Command] = [] if row is None else [WriteServo(values=row)]
        if opening and self.stream.phase is Phase.ENTERING:
            commands.append(EnterServo())
        return commands

    def _put_off(self) -> None:
        """Let the time of the goal begin with its motion: not with the filling of the buffer."""
        if self.order.due is not None:
            self.order = replace(
                self.order, due=(self.order.due + self._observer.scaled_time + self.stream.lag)
            )

    # ---- from events to signals ---------------------------------------------------------------

    def _signal(self, event: Event, now: float) -> tuple[Signal | None, str]:
        match event:
            case ServoReceived():
                return self._progress_of_stream()
            case TrajectoryEnded():  # of a goal before this one
                return None, ''
            case LinkLost(link=link, reason=reason) if (
                link == SERVO_LINK and self.state is State.ARMING
            ):
                return Signal.LATE, (f'the robot does not take set-points: {reason}'.rstrip('.'))
        return super()._signal(event, now)

    def _progress_of_stream(self) -> tuple[Signal | None, str]:
        """Return what the phase of the streaming means to the goal."""
        if self.stream.phase is Phase.ARRIVED and self.state is State.MOVING:
            return Signal.SUCCESS, ''
        if self.stream.phase is not Phase.LEFT:
            return None, ''
        if self.state is State.STOPPING:
            return Signal.CANCELED, ''
        if self.state in (State.MOVING, State.SETTLING):
            # It does so where it is about to end, for a reason that we may hear of in a moment.
            return Signal.PROGRAM_STOPPED, (
                'the robot program left the servo by itself; its log on the pendant says why'
            )
        return None, ''

    def _judge(self, state: RobotState, now: float) -> tuple[Signal | None, str]:
        if self.state in UNDER_WAY:
            answers = now - self._last_answer < ANSWERS_WITHIN
            return self._observer.fault(state, may_stand=answers) or (None, '')
        return super()._judge(state, now)

    def _is_armed(self, state: RobotState) -> bool:
        return (
            self.stream.phase is Phase.READY
            and self._off_start(state) <= START_ANGLE
            and (self.loan is None or super()._is_armed(state))
        )

    def _off_start(self, state: RobotState) -> float:
        """
        Return how far a joint is from the first set-point of a plan [rad].

        An arm that was moved since it was planned would be torn there.
        """
        spline = self.order.spline
        if spline is None:
            return 0.0
        return float(np.abs(spline.at(float(spline.times[0]))[0] - state.target_q).max())

    def _why_not_armed(self) -> str:
        if self.stream.phase is Phase.READY:
            state = self._observer.latest
            off = 0.0 if state is None else self._off_start(state)
            return (
                super()._why_not_armed()
                if off <= START_ANGLE
                else (
                    f'a joint is {off:.4f} rad away from where the set-points begin: the arm was '
                    'moved meanwhile'
                )
            )
        if self.stream.phase is Phase.OPENING:
            return (
                f'the robot did not give its RTDE inputs within {TCP_BOUND:g} s; nothing was moved'
            )
        return (
            f'the robot program did not answer through its registers within {TCP_BOUND:g} s: '
            'it is paused, or knows no buffered servo; nothing was moved'
        )

    # ---- from signals to commands -------------------------------------------------------------

    def _begin(self, state: RobotState) -> list[Command]:
        self._deadline = inf
        self._started = True
        self._observer.start(replace(state, points_begun=0))
        self.stream.begin()
        return []  # the next packet is answered with the first set-point

    def _enter_stopping(self, signal: Signal, now: float) -> list[Command]:
        self._deadline = now + STOP_BOUND
        return self._stop_streaming()

    def _enter_restoring(self, signal: Signal, now: float) -> list[Command]:
        return [*self._stop_streaming(), *super()._enter_restoring(signal, now)]

    def _enter_ending(self, signal: Signal, now: float) -> list[Command]:
        # A program that begins now must not find set-points in the inputs.
        return [*self._stop_streaming(), *super()._enter_ending(signal, now)]

    def _enter_ended(self, signal: Signal, now: float) -> list[Command]:
        return [
            *self._stop_streaming(),
            LeaveServo(),
            *self._about_stream(),
            *super()._enter_ended(signal, now),
        ]

    def _stop_streaming(self) -> list[Command]:
        row = self.stream.stop()
        return [] if row is None else [WriteServo(values=row)]

    def where(self) -> tuple[int, float, float]:
        """Return where the arm is, as any machine does."""
        return self._observer.waypoint(), self.stream.buffered, self.stream.lag

    def _release(self, begun: int) -> list[Command]:
        return []

    def _inform(self, state: RobotState, now: float) -> list[Command]:
        commands = super()._inform(state, now)
        if any(isinstance(command, Report) for command in commands):
            commands += self._about_stream()
        return commands

    def _about_stream(self) -> list[Command]:
        report = self.stream.report(self._joint_error())
        return [] if report is None else [ReportServo(report=report)]

    def _joint_error(self) -> Vector6:
        state = self._observer.latest
        if state is None:
            return UNKNOWN6
        a, b, c, d, e, f = (
            target - actual for target, actual in zip(state.target_q, state.actual_q, strict=True)
        )
        return a, b, c, d, e, f

    def _progress_report(self) -> Report:
        progress = super()._progress_report().progress
        return Report(
            progress=replace(progress, lag=self.stream.lag, buffered=self.stream.buffered)
        )
