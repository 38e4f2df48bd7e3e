# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Feeds a goal through the buffered servo: not points but set-points go to the robot.

They come from a source, one for each packet of the robot (:mod:`~.servo_stream`). In the states of
a goal (:mod:`~ur_cartesian_driver.execution.goal.goal_transitions`) that means:

* in ARMING the inputs of the robot are taken, the divergence thresholds are written and the
  robot program has to answer. Inputs that belong to another client, or a program that does not
  answer, end the goal before anything moves;
* MOVING begins with a full buffer and ends when the last set-point was carried out;
* SETTLING holds that set-point until the arm is there and at rest;
* in CANCELLING the mode IDLE is written instead of a CANCEL; the program leaves the servo, and
  that is the answer.

However the goal ends, the robot program is told to brake and stop reading, and the inputs are
released.
"""

from __future__ import annotations

from math import inf

import numpy as np

from ur_cartesian_driver.execution.goal.feeder import Feeder
from ur_cartesian_driver.execution.goal.goal_commands import (
    EnterServo,
    GoalCommand,
    LeaveServo,
    LogWarning,
    OpenServo,
    ReportServo,
    WriteInputs,
)
from ur_cartesian_driver.execution.goal.goal_monitor import GoalMonitor, START_ANGLE_TOLERANCE
from ur_cartesian_driver.execution.goal.goal_transitions import GoalState, INTERRUPTIBLE_STATES
from ur_cartesian_driver.execution.goal.outcome_codes import Fault, GoalSignal, Meaning, NO_MEANING
from ur_cartesian_driver.execution.goal.timeouts import ARMING_TIMEOUT
from ur_cartesian_driver.execution.servo.offset_setpoints import OffsetSetpoints
from ur_cartesian_driver.execution.servo.servo_stream import ServoPhase, ServoStream
from ur_cartesian_driver.execution.servo.wait_for_arm import WaitForArm
from ur_cartesian_driver.motion.events import (
    Event,
    INPUTS_LINK,
    LinkLost,
    ServoReceived,
    TrajectoryEnded,
)
from ur_cartesian_driver.motion.geometry.vectors import subtract6, Vector3, Vector6, vector6
from ur_cartesian_driver.motion.plan.offset_band import AppliedOffset, NO_OFFSET
from ur_cartesian_driver.motion.state.robot_state import RobotState
from ur_cartesian_driver.motion.state.servo_report import ServoFeedback, UNKNOWN6

#: A robot program that has read one of our sequence numbers so lately does not hang, wherever the
#: arm stands [s].
ANSWER_TIMEOUT = 1.0
#: The controller's target is behind the set-point that the arm is led to by about the lookahead
#: time of ``servoj``, by more with a low gain: so many lookahead times at most.
MAX_LAG_LOOKAHEADS = 4.0
#: So near to its last set-point servoj has come to its end [rad].
_END_TOLERANCE = 1e-4


class ServoFeeder(Feeder):
    """Answers each packet of the servo's registers with a set-point."""

    def __init__(
        self, monitor: GoalMonitor, stream: ServoStream, offsets: OffsetSetpoints | None = None
    ) -> None:
        """
        Prepare; the inputs are not taken yet.

        :param stream: of the set-points of the goal's spline, or of another source.
        :param offsets: that source, where the path may give way.
        """
        super().__init__(monitor)
        self._offsets = offsets
        self.stream = stream
        self._spline = monitor.job.spline
        self._max_servo_lag = MAX_LAG_LOOKAHEADS * stream.settings.lookahead_time
        self._last_read, self._last_answer = -1, -inf
        self._has_filled = self._has_left = False
        self._wait = WaitForArm(monitor.job.stall_timeout)
        self._unsaid: list[GoalCommand] = []

    # ---- what to send -------------------------------------------------------------------------

    def prepare(self) -> list[GoalCommand]:
        """Return what takes the inputs."""
        return [OpenServo()]

    def explain_not_ready(self, packet: RobotState | None) -> str:
        """Return why the arm cannot follow set-points yet."""
        if self.stream.phase is ServoPhase.OPENING:
            return (
                f'the robot did not give its RTDE inputs within {ARMING_TIMEOUT:g} s; '
                'nothing was moved'
            )
        if self.stream.phase is not ServoPhase.READY:
            return (
                'the robot program did not answer through its registers within '
                f'{ARMING_TIMEOUT:g} s: it is paused, or knows no buffered servo; '
                'nothing was moved'
            )
        error = self._start_joint_error(packet)
        if error > START_ANGLE_TOLERANCE:
            return (
                f'a joint is {error:.4f} rad away from where the set-points begin: the arm was '
                'moved meanwhile'
            )
        return ''

    def _start_joint_error(self, packet: RobotState | None) -> float:
        """
        Return how far a joint is from the first set-point of a plan [rad].

        The servo would pull an arm there that was moved since it was planned.
        """
        if self._spline is None or packet is None:
            return 0.0
        start = self._spline.at(float(self._spline.times[0]))[0]
        return float(np.abs(start - packet.target_q).max())

    def enter(self, state: GoalState, packet: RobotState) -> list[GoalCommand]:
        """Begin the set-points in MOVING, end them where the goal ends."""
        match state:
            case GoalState.MOVING:
                self.monitor.start(0)
                self._has_filled = False
                self.stream.begin()  # the next packet is answered with the first set-point
            case GoalState.RESTORING:
                # Nothing is written while this lasts, and the program must not wait for that.
                return self._leave()
            case GoalState.CANCELLING | GoalState.PROGRAM_LOST:
                # A program that begins after it was lost must not find set-points in the inputs.
                return self._stop()
            case GoalState.ENDED:
                return [*self._leave(), *self.extra_reports()]
        return []

    def _leave(self) -> list[GoalCommand]:
        """Leave the servo, once."""
        if self._has_left:
            return []
        self._has_left = True
        return [*self._stop(), LeaveServo()]

    def _stop(self) -> list[GoalCommand]:
        row = self.stream.stop()
        return [] if row is None else [WriteInputs(values=row)]

    def set_path_offset(self, offset: Vector3, age: float, now: float) -> bool:
        """Take a path offset; False = the goal permits none."""
        if self._offsets is not None:
            self._offsets.requests.set_offset(offset, age, now)
        return self._offsets is not None

    # ---- what the robot confirms --------------------------------------------------------------

    def take(self, event: Event, now: float) -> list[GoalCommand]:
        """Answer a packet of the servo's registers with a write."""
        if self._offsets is not None:
            self._unsaid += self._offsets.requests.warnings(now)
        if not isinstance(event, ServoReceived):
            return []
        commands, self._unsaid = self._write(event.feedback, now) + self._unsaid, []
        return commands

    def _write(self, feedback: ServoFeedback, now: float) -> list[GoalCommand]:
        if feedback.last_sequence != self._last_read:
            self._last_read, self._last_answer = feedback.last_sequence, now
        before = self.stream.phase
        row = self.stream.on_feedback(feedback, now)
        if self.stream.phase is ServoPhase.SERVOING and not self._has_filled:
            # The time of the goal begins with its motion: not with the filling of the buffer.
            self._has_filled = True
            self.start_delay = self.monitor.scaled_time - self.stream.source_time + self.stream.lag
        commands: list[GoalCommand] = [] if row is None else [WriteInputs(values=row)]
        if before is ServoPhase.OPENING and self.stream.phase is ServoPhase.ENTERING:
            commands.append(EnterServo())
        return commands

    def interpret(self, event: Event, state: GoalState) -> Meaning | None:
        """Return what an answer of the servo means to the goal."""
        match event:
            case ServoReceived():
                return self._interpret_phase(state)
            case TrajectoryEnded():  # of a goal before this one
                return NO_MEANING
            case LinkLost(link=link, reason=reason) if (
                link == INPUTS_LINK and state is GoalState.ARMING
            ):
                return GoalSignal.NOT_READY, (
                    f'the robot does not take set-points: {reason}'.rstrip('.')
                )
        return None

    def _interpret_phase(self, state: GoalState) -> Meaning:
        if self.stream.phase is ServoPhase.ARRIVED and state is GoalState.MOVING:
            return GoalSignal.SUCCESS, ''
        if self.stream.phase is not ServoPhase.LEFT:
            return NO_MEANING
        if state is GoalState.CANCELLING:
            return GoalSignal.CANCELED, ''
        if state in INTERRUPTIBLE_STATES:
            # It does so where it is about to end, for a reason that we may hear of in a moment.
            return GoalSignal.PROGRAM_STOPPED, (
                'the robot program left the servo by itself; its log on the pendant says why'
            )
        return NO_MEANING

    def motions_begun(self, packet: RobotState) -> tuple[int | None, int]:
        """Return how many pieces of the spline the arm has begun."""
        if self._spline is None:
            return None, 0
        begun = self._pieces_begun(self.stream.motion_time)
        return begun, begun - self._pieces_begun(self.stream.motion_time - self._max_servo_lag)

    def _pieces_begun(self, time: float) -> int:
        """Return how many pieces of the spline begin until a time [s]; 0 = none yet."""
        if self._spline is None or time <= 0.0:
            return 0
        return self.monitor.records.count_until(time)

    def applied_offset(self, packet: RobotState) -> AppliedOffset:
        """Return how far the path has given way where the controller's target is."""
        if self._offsets is None:
            return NO_OFFSET
        return self._offsets.applied_offset(packet.target_q)

    def wait_out(self, fault: Fault | None, packet: RobotState) -> Fault | None:
        """Hold the motion while the arm is off its path, where the goal asks for that."""
        wait = self._wait
        if not wait.timeout:
            return fault
        self.stream.is_held = wait.update(fault, packet)
        # The time of the goal stands still meanwhile.
        self.start_delay += self.stream.held_time - wait.held_time
        wait.held_time = self.stream.held_time
        if wait.is_over:
            return GoalSignal.VIOLATION, f'{wait.clause} for {wait.timeout:g} s'
        if wait.begins:
            self._unsaid.append(LogWarning(text=f'the motion waits for the arm: {wait.clause}'))
        return None if self.stream.is_held else fault

    def confirms(self, now: float) -> bool:
        """Tell whether the robot program has lately read a set-point."""
        return now - self._last_answer < ANSWER_TIMEOUT

    def has_arrived(self, packet: RobotState) -> bool:
        """Tell whether the target is at the last set-point: servoj may swing past it, and back."""
        if self._spline is None:
            return True
        end, _, _ = self._spline.at(float(self._spline.times[-1]))
        return max(map(abs, subtract6(packet.target_q, vector6(end.tolist())))) <= _END_TOLERANCE

    # ---- what to report -----------------------------------------------------------------------

    @property
    def buffered(self) -> float:
        """Motion time in the robot's buffer [s]."""
        return self.stream.buffered

    @property
    def lag(self) -> float:
        """How far the arm is behind the newest set-point [s]."""
        return self.stream.lag

    def extra_reports(self) -> list[GoalCommand]:
        """Return the state of the servo."""
        report = self.stream.report(self._joint_error())
        return [] if report is None else [ReportServo(report=report)]

    def report_lines(self) -> tuple[str, ...]:
        """Return how often the motion has waited for the arm, and what became of offsets."""
        return (*self._wait.report, *(self._offsets.requests.report if self._offsets else ()))

    def _joint_error(self) -> Vector6:
        packet = self.monitor.latest
        return UNKNOWN6 if packet is None else subtract6(packet.target_q, packet.actual_q)
