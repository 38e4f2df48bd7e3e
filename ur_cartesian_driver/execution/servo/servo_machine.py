# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The machine that takes one goal through the buffered servo.

Its states are those of any goal (:mod:`~.states`), and what the packets of the robot show of it
is seen by the same monitor; only what goes to the robot differs. Not points and a number of them
go there but set-points, from a source, one for each packet of the robot (:mod:`~.servo_stream`):

* in ARMING the inputs of the robot are taken, the divergence thresholds are written and the
  robot program has to answer, beside the TCP of the goal where it needs another one. Inputs that
  somebody else has, or a program that does not answer, end the goal before anything moves;
* MOVING begins with a full buffer and ends when the last set-point was carried out;
* SETTLING holds that set-point until the arm is there and at rest;
* in CANCELLING the mode IDLE is written instead of a CANCEL, and the program's leaving of the
  servo is the answer.

However the goal ends, the robot program is told to brake and listen no more, and the inputs are
given back.
"""

from __future__ import annotations

from dataclasses import replace
from math import inf

import numpy as np

from ur_cartesian_driver.execution.goal.goal_commands import (
    EnterServo,
    GoalCommand,
    LeaveServo,
    OpenServo,
    ReportProgress,
    ReportServo,
    SetTemporaryTcp,
    WriteServo,
)
from ur_cartesian_driver.execution.goal.goal_machine import GoalMachine, STOP_TIMEOUT, TCP_TIMEOUT
from ur_cartesian_driver.execution.goal.monitor import MAX_PLAN_DEVIATION, START_ANGLE_TOLERANCE
from ur_cartesian_driver.execution.goal.motion_job import MotionJob
from ur_cartesian_driver.execution.goal.states import GoalSignal, GoalState, RUNNING_STATES
from ur_cartesian_driver.execution.goal.temporary_tcp import TemporaryTcp
from ur_cartesian_driver.execution.servo.servo_stream import ServoPhase, ServoSettings, ServoStream
from ur_cartesian_driver.execution.servo.setpoint_source import SetpointSource, SplineSetpoints
from ur_cartesian_driver.motion.events import (
    Event,
    LinkLost,
    ServoReceived,
    StateReceived,
    TrajectoryEnded,
)
from ur_cartesian_driver.motion.servo import ServoFeedback, UNKNOWN6
from ur_cartesian_driver.motion.state import RobotState
from ur_cartesian_driver.motion.vectors import Vector6

#: The connection to the inputs, as it is called in :class:`LinkLost`.
SERVO_LINK = 'RTDE inputs'
#: A robot program that reads our sequence numbers is not stalled, wherever the arm stands: so
#: lately has it to have read one [s].
ANSWER_TIMEOUT = 1.0
#: The controller's target is behind the set-point that the arm is led to by about the lookahead
#: time of ``servoj``, by more with a low gain: so many lookahead times at most.
MAX_LAG_LOOKAHEADS = 4.0


class ServoMachine(GoalMachine):
    """One goal on its way through the buffered servo; see the module's description."""

    def __init__(
        self,
        job: MotionJob,
        *,
        settings: ServoSettings,
        source: SetpointSource | None = None,
        feedback_period: float = 0.04,
        max_plan_deviation: tuple[float, float] = MAX_PLAN_DEVIATION,
        resume_after_stop: bool = False,
    ) -> None:
        """
        Take an order; nothing happens before :meth:`start`.

        :param source: where the set-points come from; None = the spline of the order.
        :raises ValueError: there is neither a source nor a spline.
        """
        # How far it is, the set-points tell; how fast they go, nobody else does.
        super().__init__(
            replace(job, has_speed_profile=False, reports_points_begun=job.spline is not None),
            feedback_period=feedback_period,
            max_plan_deviation=max_plan_deviation,
            resume_after_stop=resume_after_stop,
        )
        if source is None:
            if job.spline is None:
                raise ValueError('An order for the servo needs a spline or another source.')
            source = SplineSetpoints(job.spline)
        self.state = GoalState.ARMING
        self.stream = ServoStream(source, settings)
        self._max_servo_lag = MAX_LAG_LOOKAHEADS * settings.lookahead_time
        self._read = -1
        self._last_answer = -inf
        self._is_due_shifted = False

    def start(self, state: RobotState) -> list[GoalCommand]:
        """
        Return the commands that prepare the motion: take the inputs, lend the TCP.

        :param state: the robot's newest packet.
        """
        lent = self.job.T_flange_tcp
        if lent is None:
            return [OpenServo()]
        self.temporary_tcp = TemporaryTcp(self.job.T_flange_active, lent)
        return [OpenServo(), SetTemporaryTcp(T_flange_tcp=lent)]

    def step(self, event: Event, now: float) -> list[GoalCommand]:
        """
        Return what to do after an event.

        :param now: time of a steady clock [s].
        """
        if self.state is GoalState.ENDED:
            return []
        commands: list[GoalCommand] = []
        if isinstance(event, ServoReceived):
            commands = self._answer_feedback(event.feedback, now)
        elif isinstance(event, StateReceived):
            begun = self._begun(self.stream.motion_time)
            self._monitor.lag_motions = begun - self._begun(
                self.stream.motion_time - self._max_servo_lag
            )
            event = StateReceived(state=replace(event.state, points_begun=begun))
        return commands + super().step(event, now)

    def _begun(self, time: float) -> int:
        """Return how many pieces of the spline begin until a time [s]; 0 = none, or unknown."""
        spline = self.job.spline
        if spline is None or time <= 0.0:
            return 0
        return spline.piece(time) + 1

    def _answer_feedback(self, feedback: ServoFeedback, now: float) -> list[GoalCommand]:
        """Answer a packet of the servo's registers with a write."""
        if feedback.last_sequence != self._read:
            self._read, self._last_answer = feedback.last_sequence, now
        opening = self.stream.phase is ServoPhase.OPENING
        row = self.stream.on_feedback(feedback, now)
        if self.stream.phase is ServoPhase.SERVOING and not self._is_due_shifted:
            self._is_due_shifted = True
            self._shift_due_time()
        commands: list[GoalCommand] = [] if row is None else [WriteServo(values=row)]
        if opening and self.stream.phase is ServoPhase.ENTERING:
            commands.append(EnterServo())
        return commands

    def _shift_due_time(self) -> None:
        """Let the time of the goal begin with its motion: not with the filling of the buffer."""
        if self.job.due is not None:
            self.job = replace(
                self.job, due=(self.job.due + self._monitor.scaled_time + self.stream.lag)
            )

    # ---- from events to signals ---------------------------------------------------------------

    def _signal(self, event: Event, now: float) -> tuple[GoalSignal | None, str]:
        match event:
            case ServoReceived():
                return self._stream_signal()
            case TrajectoryEnded():  # of a goal before this one
                return None, ''
            case LinkLost(link=link, reason=reason) if (
                link == SERVO_LINK and self.state is GoalState.ARMING
            ):
                return GoalSignal.TIMEOUT, (
                    f'the robot does not take set-points: {reason}'.rstrip('.')
                )
        return super()._signal(event, now)

    def _stream_signal(self) -> tuple[GoalSignal | None, str]:
        """Return what the phase of the streaming means to the goal."""
        if self.stream.phase is ServoPhase.ARRIVED and self.state is GoalState.MOVING:
            return GoalSignal.SUCCESS, ''
        if self.stream.phase is not ServoPhase.LEFT:
            return None, ''
        if self.state is GoalState.CANCELLING:
            return GoalSignal.CANCELED, ''
        if self.state in (GoalState.MOVING, GoalState.SETTLING):
            # It does so where it is about to end, for a reason that we may hear of in a moment.
            return GoalSignal.PROGRAM_STOPPED, (
                'the robot program left the servo by itself; its log on the pendant says why'
            )
        return None, ''

    def _check_packet(self, state: RobotState, now: float) -> tuple[GoalSignal | None, str]:
        if self.state in RUNNING_STATES:
            answers = now - self._last_answer < ANSWER_TIMEOUT
            return self._monitor.find_fault(state, may_stand_still=answers) or (None, '')
        return super()._check_packet(state, now)

    def _is_armed(self, state: RobotState) -> bool:
        return (
            self.stream.phase is ServoPhase.READY
            and self._start_joint_error(state) <= START_ANGLE_TOLERANCE
            and (self.temporary_tcp is None or super()._is_armed(state))
        )

    def _start_joint_error(self, state: RobotState) -> float:
        """
        Return how far a joint is from the first set-point of a plan [rad].

        An arm that was moved since it was planned would be torn there.
        """
        spline = self.job.spline
        if spline is None:
            return 0.0
        return float(np.abs(spline.at(float(spline.times[0]))[0] - state.target_q).max())

    def _arming_failure(self) -> str:
        if self.stream.phase is ServoPhase.READY:
            state = self._monitor.latest
            off = 0.0 if state is None else self._start_joint_error(state)
            return (
                super()._arming_failure()
                if off <= START_ANGLE_TOLERANCE
                else (
                    f'a joint is {off:.4f} rad away from where the set-points begin: the arm was '
                    'moved meanwhile'
                )
            )
        if self.stream.phase is ServoPhase.OPENING:
            return (
                f'the robot did not give its RTDE inputs within {TCP_TIMEOUT:g} s; '
                'nothing was moved'
            )
        return (
            f'the robot program did not answer through its registers within {TCP_TIMEOUT:g} s: '
            'it is paused, or knows no buffered servo; nothing was moved'
        )

    # ---- from signals to commands -------------------------------------------------------------

    def _start_motion(self, state: RobotState) -> list[GoalCommand]:
        self._deadline = inf
        self._started = True
        self._monitor.start(replace(state, points_begun=0))
        self.stream.begin()
        return []  # the next packet is answered with the first set-point

    def _enter_cancelling(self, signal: GoalSignal, now: float) -> list[GoalCommand]:
        self._deadline = now + STOP_TIMEOUT
        return self._stop_streaming()

    def _enter_restoring(self, signal: GoalSignal, now: float) -> list[GoalCommand]:
        return [*self._stop_streaming(), *super()._enter_restoring(signal, now)]

    def _enter_program_lost(self, signal: GoalSignal, now: float) -> list[GoalCommand]:
        # A program that begins now must not find set-points in the inputs.
        return [*self._stop_streaming(), *super()._enter_program_lost(signal, now)]

    def _enter_ended(self, signal: GoalSignal, now: float) -> list[GoalCommand]:
        return [
            *self._stop_streaming(),
            LeaveServo(),
            *self._servo_report(),
            *super()._enter_ended(signal, now),
        ]

    def _stop_streaming(self) -> list[GoalCommand]:
        row = self.stream.stop()
        return [] if row is None else [WriteServo(values=row)]

    def motion_status(self) -> tuple[int, float, float]:
        """Return where the arm is, as any machine does."""
        return self._monitor.waypoint(), self.stream.buffered, self.stream.lag

    def _release_points(self, begun: int) -> list[GoalCommand]:
        return []

    def _after_packet(self, state: RobotState, now: float) -> list[GoalCommand]:
        commands = super()._after_packet(state, now)
        if any(isinstance(command, ReportProgress) for command in commands):
            commands += self._servo_report()
        return commands

    def _servo_report(self) -> list[GoalCommand]:
        report = self.stream.report(self._joint_error())
        return [] if report is None else [ReportServo(report=report)]

    def _joint_error(self) -> Vector6:
        state = self._monitor.latest
        if state is None:
            return UNKNOWN6
        a, b, c, d, e, f = (
            target - actual for target, actual in zip(state.target_q, state.actual_q, strict=True)
        )
        return a, b, c, d, e, f

    def _progress_report(self) -> ReportProgress:
        progress = super()._progress_report().progress
        return ReportProgress(
            progress=replace(progress, lag=self.stream.lag, buffered=self.stream.buffered)
        )
