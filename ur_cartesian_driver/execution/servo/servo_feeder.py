# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The feeder of a goal through the buffered servo: the robot gets set-points instead of points.

A source makes a set-point for each packet of the robot (:mod:`~.servo_stream`). The states of the
goal (:mod:`~ur_cartesian_driver.execution.goal.goal_transitions`) then mean:

* in ARMING the inputs of the robot are claimed, the divergence thresholds are written and the
  robot program has to answer. If the inputs belong to another client, or the program does not
  answer, the goal ends before anything moves;
* MOVING first fills the buffer, and ends when the robot has carried out the last set-point;
* SETTLING holds that set-point until the arm is there and at rest;
* in CANCELLING the mode IDLE is written instead of a CANCEL; the program answers by leaving the
  servo.

A goal with events along its path is also sent as points
(:mod:`~ur_cartesian_driver.execution.points.point_feeder`): the robot program switches outputs,
waits and calls functions as along any spline, but the set-points lead the arm. While the program
acts at a point, the set-points are held there, until the program has begun the next motion. In
CANCELLING such a goal also sends CANCEL.

At the end of every goal, successful or not, the robot program is told to brake and stop reading,
and the inputs are released.
"""

from __future__ import annotations

from collections import deque
from math import inf

import numpy as np

from ur_cartesian_driver.execution.goal.feeder import (
    Feeder,
    Interpreting,
    Prepared,
    Streaming,
)
from ur_cartesian_driver.execution.goal.goal_commands import (
    EnterServo,
    GoalCommand,
    LeaveServo,
    OpenServo,
    ReportServo,
    WriteInputs,
)
from ur_cartesian_driver.execution.goal.goal_monitor import GoalMonitor, START_ANGLE_TOLERANCE
from ur_cartesian_driver.execution.goal.goal_transitions import GoalState, INTERRUPTIBLE_STATES
from ur_cartesian_driver.execution.goal.outcome_codes import GoalSignal, Meaning, NO_MEANING
from ur_cartesian_driver.execution.goal.timeouts import ARMING_TIMEOUT, NO_INPUTS
from ur_cartesian_driver.execution.points.point_feeder import PointFeeder
from ur_cartesian_driver.execution.servo.servo_stream import ServoPhase, ServoStream
from ur_cartesian_driver.execution.servo.wait_for_arm import WaitForArm
from ur_cartesian_driver.motion.events import (
    Event,
    ServoReceived,
    TrajectoryEnded,
    TrajectoryResult,
)
from ur_cartesian_driver.motion.geometry.vectors import subtract6
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.motion.state.servo_report import UNKNOWN6

#: A robot program that has read one of our sequence numbers within this time [s] is not considered
#: hung, even if the arm stands still.
ANSWER_TIMEOUT = 1.0
#: Longest time for the robot program to answer CANCEL while it reads set-points [s].
CANCEL_TIMEOUT = 1.0
#: ``servoj`` smooths its set-points, so the controller's target lags them: by about the lookahead
#: time of ``servoj``, or, with a low gain, by up to this many lookahead times.
MAX_LAG_LOOKAHEADS = 4.0
#: ``servoj`` has reached its end if every joint is this near to the last set-point [rad].
_END_TOLERANCE = 1e-4


class ServoFeeder(Feeder, Prepared, Interpreting, Streaming):
    """Answers each packet of the servo's registers with a set-point."""

    motion = 'set-points'

    def __init__(self, monitor: GoalMonitor, stream: ServoStream, *parts: object) -> None:
        """
        Keep the stream; the RTDE inputs are not claimed yet.

        :param stream: the stream of set-points, from the goal's spline or another source.
        :param parts: objects with further capabilities of this motion.
        """
        super().__init__(monitor)
        self.stream, self.parts = stream, parts
        if monitor.job.stall_timeout:
            self.parts = (WaitForArm(monitor, stream), *self.parts)
        self._spline = monitor.job.spline
        self._max_servo_lag = MAX_LAG_LOOKAHEADS * stream.settings.lookahead_time
        self._last_read, self._last_answer = -1, -inf
        self._has_filled = self._has_left = False
        #: Time of the first packet after a CANCEL that has to be answered [s]; None = none yet.
        self._cancelled_at: float | None = None
        #: Sends the events along the path to the robot program; None = there are no events.
        self._points = PointFeeder(monitor) if monitor.job.has_events else None
        self._holds = deque(monitor.job.holds)
        self._held_time = 0.0
        self.stream.next_hold = self._next_hold()

    # ---- before the motion --------------------------------------------------------------------

    def prepare(self) -> list[GoalCommand]:
        """Return the command that claims the inputs."""
        return [OpenServo()]

    def explain_not_ready(self, packet: RobotState | None) -> str:
        """Return the reason why the arm cannot follow set-points yet, or ''."""
        if self.stream.phase is ServoPhase.OPENING:
            return NO_INPUTS
        if self.stream.phase is not ServoPhase.READY:
            return (
                'the robot program did not answer through its registers within '
                f'{ARMING_TIMEOUT:g} s: it is paused, or knows no buffered servo'
            )
        # If the arm was moved after planning, the servo would pull it back to the start.
        error = 0.0 if packet is None else self._joint_distance(packet, 0)
        if error <= START_ANGLE_TOLERANCE:
            return ''
        return (
            f'a joint is {error:.4f} rad away from where the set-points begin: the arm was '
            'moved meanwhile'
        )

    def _joint_distance(self, packet: RobotState, knot: int) -> float:
        """Return the largest distance of a joint target from a knot [rad]; 0 without a spline."""
        if self._spline is None:
            return 0.0
        q, _, _ = self._spline.at(float(self._spline.times[knot]))
        return float(np.abs(q - packet.target_q).max())

    # ---- the motion ---------------------------------------------------------------------------

    def enter(self, state: GoalState, packet: RobotState) -> list[GoalCommand]:
        """Begin the set-points in MOVING, and end them when the goal stops or ends."""
        match state:
            case GoalState.MOVING:
                self._has_filled = False
                self.stream.begin()  # the next packet is answered with the first set-point
                if self._points is not None:
                    return self._points.enter(state, packet)
                self.monitor.start(0)
            case GoalState.RESTORING:
                # No inputs are written in RESTORING, so the program must not wait for a write.
                return self._leave()
            case GoalState.CANCELLING | GoalState.PROGRAM_LOST:
                # IDLE is written, so that a program started later finds no set-points in the
                # inputs. A program with points reads IDLE only after it has discarded them: the
                # stream waits for its CANCELED, or the program would leave in the next goal.
                self.stream.may_leave = self._points is None or state is not GoalState.CANCELLING
                commands = self._points.enter(state, packet) if self._points is not None else []
                return commands + self._stop()
            case GoalState.ENDED:
                return [*self._leave(), *self.reports()]
        return []

    def _leave(self) -> list[GoalCommand]:
        """Return the commands that leave the servo; none from the second call on."""
        if self._has_left:
            return []
        self._has_left = True
        return [*self._stop(), LeaveServo()]

    def _stop(self) -> list[GoalCommand]:
        row = self.stream.stop()
        return [] if row is None else [WriteInputs(values=row)]

    def feed(self, event: Event, now: float) -> list[GoalCommand]:
        """Answer a packet of the servo's registers with a write, any other event with points."""
        if not isinstance(event, ServoReceived):
            self._end_hold()
            return [] if self._points is None else self._points.feed(event, now)
        if event.feedback.last_sequence != self._last_read:
            self._last_read, self._last_answer = event.feedback.last_sequence, now
        if not self.stream.may_leave:
            self._cancelled_at = now if self._cancelled_at is None else self._cancelled_at
            # A paused program does not answer, but it takes no next goal either, so the stream
            # need not wait for its answer.
            is_late = now > self._cancelled_at + CANCEL_TIMEOUT
            self.stream.may_leave = is_late or not event.feedback.playing
        before = self.stream.phase
        row = self.stream.on_feedback(event.feedback, now)
        if self.stream.phase is ServoPhase.SERVOING and not self._has_filled:
            # The time of the goal begins with its motion, not when the buffer begins to fill.
            self._has_filled = True
            self.monitor.allowed_delay = (
                self.monitor.scaled_time - self.stream.source_time + self.stream.lag
            )
        commands: list[GoalCommand] = [] if row is None else [WriteInputs(values=row)]
        if before is ServoPhase.OPENING and self.stream.phase is ServoPhase.ENTERING:
            commands.append(EnterServo())
        return commands

    def _next_hold(self) -> float:
        return self._holds[0].begin if self._holds else inf

    def _end_hold(self) -> None:
        """End a hold once the robot program is done at its point; allow the goal that delay."""
        if not self.monitor.job.holds:
            return
        stream = self.stream
        if self._holds and self.monitor.motions_begun >= self._holds[0].motions:
            hold = self._holds.popleft()
            stream.go_on(hold.end - hold.begin, self._next_hold())
        self.monitor.allowed_delay += stream.held_time - self._held_time
        self._held_time = stream.held_time

    def interpret(self, event: Event, state: GoalState) -> Meaning | None:
        """Return the meaning of the servo's phase after a packet."""
        if self._points is None and isinstance(event, TrajectoryEnded):
            # This goal sends no points, so all results but TOUCHED belong to an earlier goal.
            return None if event.result is TrajectoryResult.TOUCHED else NO_MEANING
        if isinstance(event, TrajectoryEnded) and event.result is TrajectoryResult.CANCELED:
            self.stream.may_leave = True
        if not isinstance(event, ServoReceived):
            return None
        if self.stream.phase is ServoPhase.ARRIVED and state is GoalState.MOVING:
            # With points, the robot program itself reports SUCCESS, after its last action.
            return (GoalSignal.SUCCESS, '') if self._points is None else NO_MEANING
        if self.stream.phase is not ServoPhase.LEFT:
            return NO_MEANING
        if state is GoalState.CANCELLING:
            return GoalSignal.CANCELED, ''
        if state in INTERRUPTIBLE_STATES:
            # A program that is about to end leaves the servo; the reason may follow in a moment.
            return GoalSignal.PROGRAM_STOPPED, (
                'the robot program left the servo by itself; its log on the pendant says why'
            )
        return NO_MEANING

    # ---- progress -----------------------------------------------------------------------------

    def motions_begun(self, packet: RobotState) -> tuple[int | None, int]:
        """Return the count of spline pieces begun (None = no spline), and the target's lag."""
        if self._spline is None:
            return None, 0
        if self._points is not None:
            return packet.points_begun, self._behind(packet.points_begun)
        time = self.stream.motion_time
        begun = self._pieces_begun(time)
        return begun, begun - self._pieces_begun(time - self._max_servo_lag)

    def _behind(self, begun: int) -> int:
        """Return the largest lag of the controller's target behind ``begun``, in motions."""
        records = self.monitor.records
        begin = records.end_time(records.begun_records(begun) - 1)
        first = records.count_until(begin - self._max_servo_lag)
        return max(0, begun - records.motions_before(first))

    def _pieces_begun(self, time: float) -> int:
        """Return the number of pieces of the spline that begin before a time [s]; 0 = none yet."""
        return self.monitor.records.count_until(time) if time > 0.0 else 0

    def is_read(self, now: float) -> bool:
        """
        Return whether the robot program has lately read a set-point.

        With points, an arm that stands is a fault even while set-points are read, unless the
        motion is stalled.
        """
        is_alone = self._points is None or self.stream.is_stalled
        return is_alone and now - self._last_answer < ANSWER_TIMEOUT

    def has_arrived(self, packet: RobotState) -> bool:
        """Return whether the target is at the last set-point, which servoj may overshoot."""
        return self._joint_distance(packet, -1) <= _END_TOLERANCE

    @property
    def buffered(self) -> float:
        """Motion time in the robot's buffer [s]."""
        return self.stream.buffered

    @property
    def lag(self) -> float:
        """The time by which the arm lags the newest set-point [s]."""
        return self.stream.lag

    def reports(self) -> list[GoalCommand]:
        """Return the report of the servo's state."""
        packet = self.monitor.latest
        error = UNKNOWN6 if packet is None else subtract6(packet.target_q, packet.actual_q)
        report = self.stream.report(error)
        return [] if report is None else [ReportServo(report=report)]
