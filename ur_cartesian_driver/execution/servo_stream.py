# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Set-points through RTDE registers, packet by packet: the driver's side of the buffered servo.

Each packet of the robot is answered by one write with a new sequence number, so the robot program
knows that somebody is there; most of them carry a set-point. The phases, and what leads from one
to another (:data:`TRANSITIONS`):

* **OPENING**: the inputs are asked for. The first packets show the control step of the robot, and
  the sequence number that it has read last, perhaps from an earlier client; ours begin behind it.
* **ENTERING**: the divergence thresholds are written, with the mode IDLE, and the robot program is
  told to listen (a program after the guide does so always). It has answered when it has read one
  of our sequence numbers.
* **READY**: it listens. Nothing moves before somebody begins.
* **FILLING**: mode SERVO; set-points are where the arm stands, until enough motion time is under
  way.
* **SERVOING**: set-points come from the source, as fast as the clock says
  (:mod:`~.servo_clock`).
* **HOLDING**: the buffer ran empty, because nothing came through for longer than was under way.
  The arm stands at the last set-point, or comes to it; set-points repeat that until the buffer is
  full again, then the motion goes on slowly and gets faster.
* **DRAINING**: the source is at its end; the last set-point is written again and again.
* **ARRIVED**: all of them were carried out.
* **LEAVING**: mode IDLE is written; the arm brakes.
* **LEFT**: the robot program says so; or it has left by itself.

This knows registers only, no reverse socket: so it drives the sample program of the guide, too.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from enum import auto, Enum
from itertools import pairwise
from math import ceil, inf
from types import MappingProxyType

from ur_cartesian_driver.execution.servo_clock import ServoClock
from ur_cartesian_driver.execution.servo_source import Setpoints
from ur_cartesian_driver.motion.pose import Vector6
from ur_cartesian_driver.motion.servo import ServoActivity, ServoFeedback, ServoReport, UNKNOWN6
from ur_cartesian_driver.protocol.registers import ExternalError, ServoMode, SyncState

#: The part of a control step that lies between two writes at least: of two in one step the robot
#: would see the second one only.
LEAST_PAUSE = 0.5
#: The part of the wanted motion time that is under way when the arm starts.
FULL = 0.75
#: How much faster the motion gets in a second, once it goes on after the buffer was empty [1/s].
RESTART = 2.0
#: Behind this number sequences begin again: long before the register is at its end.
LAST_SEQUENCE = 2**30
#: A clock that jumps by more, or backwards, has not run [s].
LONGEST_GAP = 1.0
#: Control steps of the robots that there are [s].
SHORTEST_STEP, LONGEST_STEP = 0.002, 0.008
#: So many packets show how long the robot's control step is.
FIRST_PACKETS = 4


class Phase(Enum):
    """Where the streaming is."""

    OPENING = auto()
    ENTERING = auto()
    READY = auto()
    FILLING = auto()
    SERVOING = auto()
    HOLDING = auto()
    DRAINING = auto()
    ARRIVED = auto()
    LEAVING = auto()
    LEFT = auto()


class Change(Enum):
    """What leads from one phase to another."""

    OPENED = auto()
    ANSWERED = auto()
    BEGUN = auto()
    FILLED = auto()
    EMPTY = auto()
    AT_END = auto()
    DONE = auto()
    STOP = auto()
    PROGRAM_LEFT = auto()


_STOPS = {Change.STOP: Phase.LEAVING, Change.PROGRAM_LEFT: Phase.LEFT}

#: What is not named leaves the phase as it is.
TRANSITIONS: Mapping[Phase, Mapping[Change, Phase]] = MappingProxyType(
    {
        Phase.OPENING: {Change.OPENED: Phase.ENTERING, Change.STOP: Phase.LEFT},
        Phase.ENTERING: {Change.ANSWERED: Phase.READY, Change.STOP: Phase.LEAVING},
        Phase.READY: {Change.BEGUN: Phase.FILLING, Change.STOP: Phase.LEAVING},
        Phase.FILLING: {Change.FILLED: Phase.SERVOING, **_STOPS},
        Phase.SERVOING: {Change.AT_END: Phase.DRAINING, Change.EMPTY: Phase.HOLDING, **_STOPS},
        Phase.HOLDING: {Change.FILLED: Phase.SERVOING, **_STOPS},
        Phase.DRAINING: {Change.DONE: Phase.ARRIVED, **_STOPS},
        Phase.ARRIVED: {**_STOPS},
        Phase.LEAVING: {Change.PROGRAM_LEFT: Phase.LEFT},
        Phase.LEFT: {},
    }
)

#: Phases in which the arm belongs to the set-points.
STREAMING = frozenset(
    {Phase.FILLING, Phase.SERVOING, Phase.HOLDING, Phase.DRAINING, Phase.ARRIVED}
)
_ACTIVITIES: Mapping[Phase, ServoActivity] = MappingProxyType(
    {
        Phase.FILLING: ServoActivity.FILLING,
        Phase.SERVOING: ServoActivity.SERVOING,
        Phase.HOLDING: ServoActivity.HOLDING,
        Phase.DRAINING: ServoActivity.DRAINING,
        Phase.ARRIVED: ServoActivity.DRAINING,
    }
)


@dataclass(frozen=True, slots=True, kw_only=True)
class ServoSettings:
    """
    How set-points are streamed.

    :raises ValueError: the values cannot work together.
    """

    #: Motion time that is to be under way to the arm [s]: so long may nothing come through.
    target_lag: float = 0.04
    #: Motion time that may be under way [s].
    most_lag: float = 0.2
    #: How many set-points the robot's buffer holds.
    buffer_depth: int = 250
    #: How far each joint may be from its set-point [rad]: beyond, the robot program stops the arm.
    max_divergence: float = 0.3
    #: How far ``servoj`` lags behind its set-points by itself [s].
    lookahead_time: float = 0.03
    #: False = set-points come as fast as the robot's packets, whatever the robot does with them.
    closed_loop: bool = True

    def __post_init__(self) -> None:
        """Refuse what lets the buffer overflow."""
        if not LONGEST_STEP <= self.target_lag <= self.most_lag:
            raise ValueError(
                f'servo_target_lag is {self.target_lag:g} s, it has to be within '
                f'{LONGEST_STEP:g} and {self.most_lag:g} s.'
            )
        if self.target_lag > SHORTEST_STEP * self.buffer_depth:
            raise ValueError(
                f'servo_buffer_depth is {self.buffer_depth}, but servo_target_lag of '
                f'{self.target_lag:g} s needs room for '
                f'{ceil(self.target_lag / SHORTEST_STEP)} set-points.'
            )


class ServoStream:
    """The streaming of one source's set-points; see the module's description."""

    def __init__(self, source: Setpoints, settings: ServoSettings) -> None:
        """Wait for the first packet."""
        self.phase = Phase.OPENING
        self._source = source
        self._settings = settings
        self._clock = self._clock_of(SHORTEST_STEP)
        self._times: list[float] = []
        self._latest: ServoFeedback | None = None
        self._sequence = 0
        #: The first number of ours, of those that want SERVO, and of those that want IDLE again.
        self._first = self._first_servo = self._first_idle = 0
        self._state_time = 0.0
        self._joints: Vector6 = source.next(0.0)
        self._enough = FULL * settings.target_lag if settings.closed_loop else 0.0
        #: Set-points that the robot has not read yet: sequence number and state time.
        self._unread: deque[tuple[int, float]] = deque()
        self._read_time = 0.0
        #: How far the source was asked [s]; of what is under way: state time, time of the source.
        self._asked = 0.0
        self._behind: deque[tuple[float, float]] = deque()
        #: The time of the source that the arm was led to last [s].
        self.motion_time = 0.0
        #: How fast the motion runs in the time of the set-points, 0 to 1.
        self._pace = 1.0
        self._last_write = -inf
        self._sent = self._underruns = 0

    def _clock_of(self, step: float) -> ServoClock:
        settings = self._settings
        return ServoClock(
            step=step,
            target=settings.target_lag,
            closed=settings.closed_loop,
            most=min(settings.most_lag, settings.buffer_depth * step),
        )

    # ---- what is known ------------------------------------------------------------------------

    @property
    def under_way(self) -> float:
        """Motion time that was sent and not carried out yet [s]."""
        reported = 0.0 if self._latest is None else self._latest.lag
        return self._state_time - self._read_time + reported

    @property
    def lag(self) -> float:
        """How far the arm is behind the newest set-point [s], that of ``servoj`` included."""
        return self.under_way + self._settings.lookahead_time

    @property
    def buffered(self) -> float:
        """Motion time in the robot's buffer [s]."""
        return 0.0 if self._latest is None else self._latest.lag

    def report(self, joint_error: Vector6 = UNKNOWN6) -> ServoReport | None:
        """
        Return how it is going; None before the first packet.

        :param joint_error: target - actual [rad].
        """
        state, settings = self._latest, self._settings
        if state is None:
            return None
        return ServoReport(
            timestamp=state.timestamp,
            activity=_ACTIVITIES.get(self.phase, ServoActivity.IDLE),
            setpoints_sent=self._sent,
            setpoints_done=state.setpoints_done,
            buffer_size=state.buffer_size,
            buffer_capacity=settings.buffer_depth,
            buffered=state.lag,
            lag=self.lag,
            speed_scaling=state.speed_scaling,
            joint_error=joint_error,
            underruns=self._underruns,
            overruns=state.overflows,
            repeats=state.repeats,
            skipped=state.skipped,
        )

    # ---- what happens -------------------------------------------------------------------------

    def begin(self) -> None:
        """Let the arm follow the set-points from now on."""
        self._change(Change.BEGUN)
        self._first_servo = self._sequence + 1
        # What the source says now, as the first write may come before its first set-point.
        self._joints = self._source.next(0.0)

    def stop(self) -> tuple[float, ...] | None:
        """Leave the servo; return what is to be written at once, if anything can be."""
        before = self.phase
        self._change(Change.STOP)
        if self.phase is before or self.phase is Phase.LEFT:
            return None
        self._sequence += 1
        self._first_idle = self._sequence
        return self._row()

    def take(self, feedback: ServoFeedback, now: float) -> tuple[float, ...] | None:
        """
        Take a packet; return what is to be written, None = nothing.

        :param now: time of a steady clock [s].
        """
        before, self._latest = self._latest, feedback
        if self.phase is Phase.OPENING and not self._open(feedback):
            return None
        self._note_read(feedback)
        self._note_done()
        self._look(feedback)
        if before is not None:
            self._pass(feedback.timestamp - before.timestamp, feedback)
        if self.phase is Phase.LEFT or now < self._last_write + LEAST_PAUSE * self._clock.step:
            return None
        self._last_write = now
        self._advance()
        return self._row()

    def _open(self, feedback: ServoFeedback) -> bool:
        """Learn from the first packets; return whether they were enough."""
        self._times.append(feedback.timestamp)
        if len(self._times) < FIRST_PACKETS:
            return False
        step = min(b - a for a, b in pairwise(self._times))
        if step > 0.0:
            self._clock = self._clock_of(1.0 / round(1.0 / step))
        last = feedback.last_sequence
        self._sequence = last if 0 <= last < LAST_SEQUENCE else 0
        self._first = self._sequence + 1
        self._change(Change.OPENED)
        return True

    def _note_read(self, feedback: ServoFeedback) -> None:
        """Forget what the robot has read."""
        if feedback.last_sequence <= self._sequence:  # else it is not about ours
            while self._unread and self._unread[0][0] <= feedback.last_sequence:
                self._read_time = self._unread.popleft()[1]

    def _note_done(self) -> None:
        """Find how far the arm was led."""
        done = self._state_time - self.under_way + 0.5 * self._clock.step
        while self._behind and self._behind[0][0] <= done:
            self.motion_time = self._behind.popleft()[1]

    def _look(self, feedback: ServoFeedback) -> None:
        """Find what the packet changes."""
        phase = self.phase
        if phase is Phase.ENTERING and self._has_read(self._first):
            self._change(Change.ANSWERED)
        elif self._is_left(feedback):
            self._change(Change.PROGRAM_LEFT)
        elif phase in (Phase.FILLING, Phase.HOLDING) and self.under_way >= self._enough:
            self._change(Change.FILLED)
        elif (
            phase is Phase.SERVOING
            and feedback.lag <= 0.0
            and feedback.playing
            and self.under_way <= 0.5 * self._clock.step
        ):
            self._underruns += 1
            self._pace = 0.0
            self._change(Change.EMPTY)
        elif phase is Phase.DRAINING and self.under_way <= 0.5 * self._clock.step:
            self._change(Change.DONE)

    def _is_left(self, feedback: ServoFeedback) -> bool:
        """Tell whether the program is not in SERVO, after it was told to be or not to be."""
        if self.phase is Phase.LEAVING:
            return self._has_read(self._first_idle) and feedback.mode != ServoMode.SERVO
        return (
            self.phase in STREAMING
            and self._has_read(self._first_servo)
            and feedback.mode != ServoMode.SERVO
        )

    def _pass(self, passed: float, feedback: ServoFeedback) -> None:
        """Let the robot's time pass."""
        passed = passed if 0.0 <= passed <= LONGEST_GAP else 0.0
        if self.phase in STREAMING:
            scaling = feedback.speed_scaling if feedback.playing else 0.0
            self._clock.advance(passed, scaling, self.under_way)
        if self.phase is Phase.SERVOING:
            self._pace = min(1.0, self._pace + RESTART * passed)

    def _advance(self) -> None:
        """Give the next write a number, and make a set-point of it if one is due."""
        self._sequence += 1
        if self.phase in (Phase.FILLING, Phase.SERVOING, Phase.HOLDING):
            steps = self._clock.take(self.under_way)
            if steps:
                self._sent += steps
                self._send(steps * self._clock.step)
                self._unread.append((self._sequence, self._state_time))

    def _send(self, time: float) -> None:
        """Make the next set-point."""
        moves = self.phase is Phase.SERVOING
        passed = self._pace * time if moves else 0.0
        self._joints = self._source.next(passed)
        self._asked += passed
        self._state_time += time
        self._behind.append((self._state_time, self._asked))
        if moves and self._source.done:
            self._change(Change.AT_END)

    def _change(self, change: Change) -> None:
        self.phase = TRANSITIONS[self.phase].get(change, self.phase)

    def _has_read(self, sequence: int) -> bool:
        assert self._latest is not None
        return sequence <= self._latest.last_sequence <= self._sequence

    def _row(self) -> tuple[float, ...]:
        """Return the inputs in the order of ``registers.SERVO_INPUTS``."""
        moves = self.phase in STREAMING
        return (
            ServoMode.SERVO if moves else ServoMode.IDLE,
            self._sequence,
            ExternalError.NONE,
            SyncState.EXTERNAL_TO_ROBOT if moves else SyncState.NONE,
            *self._joints,
            *(self._settings.max_divergence,) * 6,
            self._state_time,
        )
