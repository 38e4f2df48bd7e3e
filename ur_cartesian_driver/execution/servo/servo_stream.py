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

from ur_cartesian_driver.execution.servo.servo_clock import ServoClock
from ur_cartesian_driver.execution.servo.setpoint_source import SetpointSource
from ur_cartesian_driver.motion.servo import ServoActivity, ServoFeedback, ServoReport, UNKNOWN6
from ur_cartesian_driver.motion.vectors import Vector6
from ur_cartesian_driver.protocol.program.registers import ExternalError, ServoMode, SyncState

#: The part of a control step that lies between two writes at least: of two in one step the robot
#: would see the second one only.
MIN_WRITE_PERIOD = 0.5
#: The part of the wanted motion time that is under way when the arm starts.
START_FILL = 0.75
#: How much faster the motion gets in a second, once it goes on after the buffer was empty [1/s].
RESTART_ACCELERATION = 2.0
#: Behind this number sequences begin again: long before the register is at its end.
MAX_SEQUENCE = 2**30
#: A clock that jumps by more, or backwards, has not run [s].
MAX_CLOCK_GAP = 1.0
#: Control steps of the robots that there are [s].
MIN_STEP, MAX_STEP = 0.002, 0.008
#: So many packets show how long the robot's control step is.
STEP_SAMPLES = 4


class ServoPhase(Enum):
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


class ServoEvent(Enum):
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


_STOPS = {ServoEvent.STOP: ServoPhase.LEAVING, ServoEvent.PROGRAM_LEFT: ServoPhase.LEFT}

#: What is not named leaves the phase as it is.
TRANSITIONS: Mapping[ServoPhase, Mapping[ServoEvent, ServoPhase]] = MappingProxyType(
    {
        ServoPhase.OPENING: {
            ServoEvent.OPENED: ServoPhase.ENTERING,
            ServoEvent.STOP: ServoPhase.LEFT,
        },
        ServoPhase.ENTERING: {
            ServoEvent.ANSWERED: ServoPhase.READY,
            ServoEvent.STOP: ServoPhase.LEAVING,
        },
        ServoPhase.READY: {
            ServoEvent.BEGUN: ServoPhase.FILLING,
            ServoEvent.STOP: ServoPhase.LEAVING,
        },
        ServoPhase.FILLING: {ServoEvent.FILLED: ServoPhase.SERVOING, **_STOPS},
        ServoPhase.SERVOING: {
            ServoEvent.AT_END: ServoPhase.DRAINING,
            ServoEvent.EMPTY: ServoPhase.HOLDING,
            **_STOPS,
        },
        ServoPhase.HOLDING: {ServoEvent.FILLED: ServoPhase.SERVOING, **_STOPS},
        ServoPhase.DRAINING: {ServoEvent.DONE: ServoPhase.ARRIVED, **_STOPS},
        ServoPhase.ARRIVED: {**_STOPS},
        ServoPhase.LEAVING: {ServoEvent.PROGRAM_LEFT: ServoPhase.LEFT},
        ServoPhase.LEFT: {},
    }
)

#: Phases in which the arm belongs to the set-points.
STREAMING = frozenset(
    {
        ServoPhase.FILLING,
        ServoPhase.SERVOING,
        ServoPhase.HOLDING,
        ServoPhase.DRAINING,
        ServoPhase.ARRIVED,
    }
)
_ACTIVITIES: Mapping[ServoPhase, ServoActivity] = MappingProxyType(
    {
        ServoPhase.FILLING: ServoActivity.FILLING,
        ServoPhase.SERVOING: ServoActivity.SERVOING,
        ServoPhase.HOLDING: ServoActivity.HOLDING,
        ServoPhase.DRAINING: ServoActivity.DRAINING,
        ServoPhase.ARRIVED: ServoActivity.DRAINING,
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
    max_lag: float = 0.2
    #: How many set-points the robot's buffer holds.
    buffer_depth: int = 250
    #: How far each joint may be from its set-point [rad]: beyond, the robot program stops the arm.
    max_divergence: float = 0.3
    #: How far ``servoj`` lags behind its set-points by itself [s].
    lookahead_time: float = 0.03

    def __post_init__(self) -> None:
        """Refuse what lets the buffer overflow."""
        if not MAX_STEP <= self.target_lag <= self.max_lag:
            raise ValueError(
                f'servo_target_lag is {self.target_lag:g} s, it has to be within '
                f'{MAX_STEP:g} and {self.max_lag:g} s.'
            )
        if self.target_lag > MIN_STEP * self.buffer_depth:
            raise ValueError(
                f'servo_buffer_depth is {self.buffer_depth}, but servo_target_lag of '
                f'{self.target_lag:g} s needs room for '
                f'{ceil(self.target_lag / MIN_STEP)} set-points.'
            )


class ServoStream:
    """The streaming of one source's set-points; see the module's description."""

    def __init__(self, source: SetpointSource, settings: ServoSettings) -> None:
        """Wait for the first packet."""
        self.phase = ServoPhase.OPENING
        self._source = source
        self.settings = settings
        self._clock = self._make_clock(MIN_STEP)
        self._times: list[float] = []
        self._latest: ServoFeedback | None = None
        self._sequence = 0
        #: The first number of ours, of those that want SERVO, and of those that want IDLE again.
        self._first = self._first_servo = self._first_idle = 0
        self._state_time = 0.0
        self._joints: Vector6 = source.next(0.0)
        self._fill_target = START_FILL * settings.target_lag
        #: Set-points that the robot has not read yet: sequence number and state time.
        self._unread: deque[tuple[int, float]] = deque()
        self._read_time = 0.0
        #: How far the source was asked [s]; of what is under way: state time, time of the source.
        self._source_time = 0.0
        self._unfinished: deque[tuple[float, float]] = deque()
        #: The time of the source that the arm was led to last [s].
        self.motion_time = 0.0
        #: How fast the motion runs in the time of the set-points, 0 to 1.
        self._motion_rate = 1.0
        self._last_write = -inf
        self._sent = self._underruns = 0

    def _make_clock(self, step: float) -> ServoClock:
        settings = self.settings
        return ServoClock(
            step=step,
            target=settings.target_lag,
            max_lag=min(settings.max_lag, settings.buffer_depth * step),
        )

    # ---- what is known ------------------------------------------------------------------------

    @property
    def in_flight(self) -> float:
        """Motion time that was sent and not carried out yet [s]."""
        reported = 0.0 if self._latest is None else self._latest.lag
        return self._state_time - self._read_time + reported

    @property
    def lag(self) -> float:
        """How far the arm is behind the newest set-point [s], that of ``servoj`` included."""
        return self.in_flight + self.settings.lookahead_time

    @property
    def buffered(self) -> float:
        """Motion time in the robot's buffer [s]."""
        return 0.0 if self._latest is None else self._latest.lag

    def report(self, joint_error: Vector6 = UNKNOWN6) -> ServoReport | None:
        """
        Return how it is going; None before the first packet.

        :param joint_error: target - actual [rad].
        """
        state, settings = self._latest, self.settings
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
        self._apply(ServoEvent.BEGUN)
        self._first_servo = self._sequence + 1
        # What the source says now, as the first write may come before its first set-point.
        self._joints = self._source.next(0.0)

    def stop(self) -> tuple[float, ...] | None:
        """Leave the servo; return what is to be written at once, if anything can be."""
        before = self.phase
        self._apply(ServoEvent.STOP)
        if self.phase is before or self.phase is ServoPhase.LEFT:
            return None
        self._sequence += 1
        self._first_idle = self._sequence
        return self._row()

    def on_feedback(self, feedback: ServoFeedback, now: float) -> tuple[float, ...] | None:
        """
        Take a packet; return what is to be written, None = nothing.

        :param now: time of a steady clock [s].
        """
        before, self._latest = self._latest, feedback
        if self.phase is ServoPhase.OPENING and not self._open(feedback):
            return None
        self._update_read(feedback)
        self._update_motion_time()
        self._update_phase(feedback)
        if before is not None:
            self._advance_clock(feedback.timestamp - before.timestamp, feedback)
        if (
            self.phase is ServoPhase.LEFT
            or now < self._last_write + MIN_WRITE_PERIOD * self._clock.step
        ):
            return None
        self._last_write = now
        self._next_write()
        return self._row()

    def _open(self, feedback: ServoFeedback) -> bool:
        """Learn from the first packets; return whether they were enough."""
        self._times.append(feedback.timestamp)
        if len(self._times) < STEP_SAMPLES:
            return False
        step = min(b - a for a, b in pairwise(self._times))
        if step > 0.0:
            self._clock = self._make_clock(1.0 / round(1.0 / step))
        last = feedback.last_sequence
        self._sequence = last if 0 <= last < MAX_SEQUENCE else 0
        self._first = self._sequence + 1
        self._apply(ServoEvent.OPENED)
        return True

    def _update_read(self, feedback: ServoFeedback) -> None:
        """Forget what the robot has read."""
        if feedback.last_sequence <= self._sequence:  # else it is not about ours
            while self._unread and self._unread[0][0] <= feedback.last_sequence:
                self._read_time = self._unread.popleft()[1]

    def _update_motion_time(self) -> None:
        """Find how far the arm was led."""
        done = self._state_time - self.in_flight + 0.5 * self._clock.step
        while self._unfinished and self._unfinished[0][0] <= done:
            self.motion_time = self._unfinished.popleft()[1]

    def _update_phase(self, feedback: ServoFeedback) -> None:
        """Find what the packet changes."""
        phase = self.phase
        if phase is ServoPhase.ENTERING and self._has_read(self._first):
            self._apply(ServoEvent.ANSWERED)
        elif self._has_left(feedback):
            self._apply(ServoEvent.PROGRAM_LEFT)
        elif (
            phase in (ServoPhase.FILLING, ServoPhase.HOLDING)
            and self.in_flight >= self._fill_target
        ):
            self._apply(ServoEvent.FILLED)
        elif (
            phase is ServoPhase.SERVOING
            and feedback.lag <= 0.0
            and feedback.playing
            and self.in_flight <= 0.5 * self._clock.step
        ):
            self._underruns += 1
            self._motion_rate = 0.0
            self._apply(ServoEvent.EMPTY)
        elif phase is ServoPhase.DRAINING and self.in_flight <= 0.5 * self._clock.step:
            self._apply(ServoEvent.DONE)

    def _has_left(self, feedback: ServoFeedback) -> bool:
        """Tell whether the program is not in SERVO, after it was told to be or not to be."""
        if self.phase is ServoPhase.LEAVING:
            return self._has_read(self._first_idle) and feedback.mode != ServoMode.SERVO
        return (
            self.phase in STREAMING
            and self._has_read(self._first_servo)
            and feedback.mode != ServoMode.SERVO
        )

    def _advance_clock(self, passed: float, feedback: ServoFeedback) -> None:
        """Let the robot's time pass."""
        passed = passed if 0.0 <= passed <= MAX_CLOCK_GAP else 0.0
        if self.phase in STREAMING:
            scaling = feedback.speed_scaling if feedback.playing else 0.0
            self._clock.advance(passed, scaling, self.in_flight)
        if self.phase is ServoPhase.SERVOING:
            self._motion_rate = min(1.0, self._motion_rate + RESTART_ACCELERATION * passed)

    def _next_write(self) -> None:
        """Give the next write a number, and make a set-point of it if one is due."""
        self._sequence += 1
        if self.phase in (ServoPhase.FILLING, ServoPhase.SERVOING, ServoPhase.HOLDING):
            steps = self._clock.take_steps(self.in_flight)
            if steps:
                self._sent += steps
                self._send(steps * self._clock.step)
                self._unread.append((self._sequence, self._state_time))

    def _send(self, time: float) -> None:
        """Make the next set-point."""
        moves = self.phase is ServoPhase.SERVOING
        passed = self._motion_rate * time if moves else 0.0
        self._joints = self._source.next(passed)
        self._source_time += passed
        self._state_time += time
        self._unfinished.append((self._state_time, self._source_time))
        if moves and self._source.done:
            self._apply(ServoEvent.AT_END)

    def _apply(self, change: ServoEvent) -> None:
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
            *(self.settings.max_divergence,) * 6,
            self._state_time,
        )
