# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A person guides the arm by hand, in a servo goal with the mode TEACH instead of set-points."""

from __future__ import annotations

from ur_cartesian_driver.execution.goal.feeder import Phrasing
from ur_cartesian_driver.execution.goal.goal_monitor import GoalMonitor
from ur_cartesian_driver.execution.goal.goal_transitions import GoalState
from ur_cartesian_driver.execution.goal.outcome_codes import GoalSignal, Meaning
from ur_cartesian_driver.execution.servo.servo_feeder import ServoFeeder
from ur_cartesian_driver.execution.servo.servo_stream import ServoPhase, ServoSettings, ServoStream
from ur_cartesian_driver.motion.events import Event, ServoReceived
from ur_cartesian_driver.motion.geometry.vectors import Joints, ZERO6
from ur_cartesian_driver.motion.state.servo_report import ServoFeedback
from ur_cartesian_driver.protocol.program.registers import ServoMode

#: Longest time for the robot program to enter freedrive [s].
FREEDRIVE_TIMEOUT = 1.0


class FreedriveFeeder(ServoFeeder, Phrasing):
    """Keeps the robot program in freedrive until the goal ends."""

    stream: FreedriveStream

    def __init__(self, monitor: GoalMonitor, settings: ServoSettings) -> None:
        """Set up the stream; the arm cannot be guided yet."""
        super().__init__(monitor, FreedriveStream(settings))

    @property
    def has_progress(self) -> bool:
        """Whether the arm can be guided; the first progress report tells the owner so."""
        return self.stream.is_active

    def interpret(self, event: Event, state: GoalState) -> Meaning | None:
        """Return the meaning of a failure of freedrive, else of the servo's phase."""
        if isinstance(event, ServoReceived) and self.stream.failure:
            # A program that is about to end first ends freedrive, so that is the likely cause.
            signal = GoalSignal.PROGRAM_STOPPED if self.stream.is_active else GoalSignal.FAILURE
            return signal, self.stream.failure
        return super().interpret(event, state)

    def location(self, *, started: bool) -> str:
        """Return when freedrive ended, as a clause."""
        return 'during freedrive' if started else 'before freedrive was active'


class FreedriveStream(ServoStream):
    """The registers of the buffered servo, with the mode TEACH instead of set-points."""

    def __init__(self, settings: ServoSettings) -> None:
        """Begin before the first packet; freedrive is not requested yet."""
        super().__init__(_ZeroSetpoints(), settings)
        self._begun = False
        self._requested_at = 0.0
        #: Whether the robot program has entered freedrive.
        self.is_active = False
        #: Why the program did not enter or keep freedrive, as a clause; '' = no failure.
        self.failure = ''

    def begin(self) -> None:
        """Request freedrive from now on."""
        self._begun = True

    def on_feedback(self, feedback: ServoFeedback, now: float) -> tuple[float, ...] | None:
        """Process a packet; return the inputs to write, None = write nothing."""
        if self._begun and self._requested_at == 0.0:
            self._requested_at = now
        is_teaching = feedback.mode == ServoMode.TEACH
        if self._begun and self.phase is ServoPhase.READY and not is_teaching:
            if self.is_active:
                self.failure = 'the robot program has ended freedrive by itself'
            elif now > self._requested_at + FREEDRIVE_TIMEOUT:
                self.failure = (
                    'the robot program does not enter freedrive: it is paused, '
                    'or was started without allow_freedrive'
                )
        self.is_active = self.is_active or is_teaching
        return super().on_feedback(feedback, now)

    def _row(self) -> tuple[float, ...]:
        mode, *rest = super()._row()
        freedrive = self._begun and self.phase is ServoPhase.READY
        return (ServoMode.TEACH if freedrive else mode, *rest)


class _ZeroSetpoints:
    """Fills the joint registers, which the robot program does not read in freedrive."""

    done = False

    def next(self, dt: float) -> Joints:
        """Return zeros."""
        return ZERO6
