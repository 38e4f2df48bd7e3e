# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Set-points through RTDE registers, packet by packet: the driver's side of the buffered servo.

Each packet of the robot is answered by one write with a new sequence number, which shows the robot
program that the client is alive; most writes carry a set-point. The phases, whose transitions are
in :data:`TRANSITIONS`:

* **OPENING**: the inputs are requested. The first packets show the control step of the robot, and
  the sequence number that it read last, perhaps of an earlier client; ours continue after it.
* **ENTERING**: the divergence thresholds are written, with the mode IDLE, and the robot program is
  asked to read the inputs (a program that follows the manufacturer's guide always reads them). The
  program has answered when it has read one of our sequence numbers.
* **READY**: the program reads the inputs. Nothing moves before :meth:`ServoStream.begin`.
* **FILLING**: mode SERVO; set-points repeat the present position until enough motion time is in
  flight.
* **SERVOING**: set-points come from the source, at the rate of the clock (:mod:`~.servo_clock`).
* **HOLDING**: the buffer ran empty, because no write came through for longer than the motion time
  in flight. The arm stops at the last set-point; this set-point is repeated until the buffer is
  full again, then the motion continues slowly and speeds up.
* **DRAINING**: the source is at its end; the last set-point is repeated.
* **ARRIVED**: all set-points were carried out. If the source goes on, the stream begins again as
  after READY.
* **LEAVING**: mode IDLE is written; the arm brakes.
* **LEFT**: the robot program has left the servo, on our request or by itself.

Only registers are used, not the reverse socket, so the sample program of the guide works too.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from enum import auto, Enum
from itertools import pairwise
from math import ceil, inf
from typing import NamedTuple

from ur_cartesian_driver.execution.servo.servo_clock import ServoClock
from ur_cartesian_driver.execution.servo.setpoint_source import RestingSource, SetpointSource
from ur_cartesian_driver.motion.geometry.vectors import Vector6
from ur_cartesian_driver.motion.state.servo_report import (
    ServoActivity,
    ServoFeedback,
    ServoReport,
    UNKNOWN6,
)
from ur_cartesian_driver.protocol.program.registers import ExternalError, ServoMode, SyncState

#: Shortest time between two writes, as a fraction of a control step: of two writes in one step the
#: robot would read only the second.
MIN_WRITE_PERIOD = 0.5
#: Fraction of ``target_lag`` that is in flight when the arm starts.
START_FILL = 0.75
#: Increase of the motion's rate after the buffer was empty, or after a stall [1/s].
RESTART_ACCELERATION = 2.0
#: Decrease of the motion's rate while the arm is off its path [1/s].
STALL_DECELERATION = 4.0
#: If the last sequence number that the robot has read is not below this, ours begin at 1: long
#: before the register overflows.
MAX_SEQUENCE = 2**30
#: Negative steps of the robot's clock, and steps longer than this [s], count as 0.
MAX_CLOCK_GAP = 1.0
#: Shortest and longest control step of existing robots [s].
MIN_STEP, MAX_STEP = 0.002, 0.008
#: Number of packets from which the robot's control step is measured.
STEP_SAMPLES = 4


class ServoPhase(Enum):
    """Phase of the streaming."""

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
    """A change that leads to another phase."""

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

#: The next phase after each event in each phase; other events leave the phase as it is.
TRANSITIONS: Mapping[ServoPhase, Mapping[ServoEvent, ServoPhase]] = {
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
    ServoPhase.ARRIVED: {ServoEvent.BEGUN: ServoPhase.FILLING, **_STOPS},
    ServoPhase.LEAVING: {ServoEvent.PROGRAM_LEFT: ServoPhase.LEFT},
    ServoPhase.LEFT: {},
}

_ACTIVITIES: Mapping[ServoPhase, ServoActivity] = {
    ServoPhase.FILLING: ServoActivity.FILLING,
    ServoPhase.SERVOING: ServoActivity.SERVOING,
    ServoPhase.HOLDING: ServoActivity.HOLDING,
    ServoPhase.DRAINING: ServoActivity.DRAINING,
    ServoPhase.ARRIVED: ServoActivity.DRAINING,
}
#: Phases in which the arm follows set-points.
STREAMING = frozenset(_ACTIVITIES)


@dataclass(frozen=True, slots=True, kw_only=True)
class ServoSettings:
    """
    Settings of the streaming.

    :raises ValueError: ``target_lag`` is outside its range or does not fit into the buffer.
    """

    #: Motion time to keep in flight [s]: gaps in the packets up to this long do not stop the arm.
    target_lag: float = 0.04
    #: Longest motion time in flight [s].
    max_lag: float = 0.2
    #: Number of set-points that the robot's buffer holds.
    buffer_depth: int = 250
    #: Distance of a joint from its set-point at which the robot program stops the arm [rad].
    max_divergence: float = 0.3
    #: The time by which ``servoj`` itself lags its set-points [s].
    lookahead_time: float = 0.03

    def __post_init__(self) -> None:
        """Refuse settings that let the buffer overflow."""
        if not MAX_STEP <= self.target_lag <= self.max_lag:
            raise ValueError(
                f'servo_target_lag is {self.target_lag:g} s; it must be between '
                f'{MAX_STEP:g} and {self.max_lag:g} s.'
            )
        if self.target_lag > MIN_STEP * self.buffer_depth:
            raise ValueError(
                f'servo_buffer_depth is {self.buffer_depth}, but servo_target_lag of '
                f'{self.target_lag:g} s needs room for '
                f'{ceil(self.target_lag / MIN_STEP)} set-points.'
            )


class _Setpoint(NamedTuple):
    """A set-point that the robot has not carried out yet."""

    sequence: int
    #: The time of the stream at which the set-point ends [s].
    state_time: float
    #: The time of the source at the set-point [s].
    source_time: float


class ServoStream:
    """Streams the set-points of one source; see the module's description."""

    def __init__(self, source: SetpointSource, settings: ServoSettings) -> None:
        """Begin before the first packet."""
        self.phase = ServoPhase.OPENING
        self._source = source
        self.settings = settings
        self._clock = self._make_clock(MIN_STEP)
        self._times: list[float] = []
        self._latest: ServoFeedback | None = None
        self._sequence = 0
        #: Our first sequence number; the first with mode SERVO; the first with IDLE after that.
        self._first = self._first_servo = self._first_idle = 0
        self._joints: Vector6 = source.next(0.0)
        self._fill_target = START_FILL * settings.target_lag
        #: Time of the stream [s]: at the newest set-point; at the last one that the robot read.
        self._state_time = self._read_time = 0.0
        #: Motion time in the robot's buffer [s].
        self.buffered = 0.0
        #: Set-points that the robot has not read yet.
        self._unread: deque[_Setpoint] = deque()
        #: Set-points that the robot has not carried out yet.
        self._unfinished: deque[_Setpoint] = deque()
        #: Time of the source at the newest set-point [s].
        self.source_time = 0.0
        #: Time of the source at the last set-point carried out [s].
        self.motion_time = 0.0
        #: Rate of the motion's time relative to the stream's time, 0 to 1.
        self._motion_rate = 1.0
        #: Whether the motion is stalled on its path.
        self.is_stalled = False
        #: Total delay of the motion by stalls [s].
        self.stalled_time = 0.0
        #: The time of the source at which set-points are repeated until :meth:`go_on` [s].
        self.next_hold = inf
        #: Total delay of the motion by such holds, beyond rests of the source [s].
        self.held_time = 0.0
        #: Time of the motion [s]: time of the source without the skipped rests.
        self._moved_time = 0.0
        #: Whether LEAVING may end when the program has left; until then the writes go on.
        self.may_leave = True
        #: The feed, as a fraction of the motion's rate, 0 to 1.
        self.feed = 1.0
        #: The value that :attr:`feed` approaches, and the rate of its change [1/s].
        self.feed_target, self.feed_rate = 1.0, 0.0
        #: Total delay of the motion by the feed override [s].
        self.feed_delay = 0.0
        #: Whether a stall slows the motion, or has slowed it and the rate is still below 1.
        self._recovers = False
        self._last_write = -inf
        self._sent = self._underruns = 0

    def _make_clock(self, step: float) -> ServoClock:
        settings = self.settings
        return ServoClock(
            step=step,
            target=settings.target_lag,
            max_lag=min(settings.max_lag, settings.buffer_depth * step),
        )

    # ---- state --------------------------------------------------------------------------------

    @property
    def in_flight(self) -> float:
        """Motion time sent and not carried out yet [s]."""
        return self._state_time - self._read_time + self.buffered

    @property
    def lag(self) -> float:
        """The time by which the arm lags the newest set-point, with the lag of servoj [s]."""
        return self.in_flight + self.settings.lookahead_time

    def report(self, joint_error: Vector6 = UNKNOWN6) -> ServoReport | None:
        """
        Return the state of the servo; None before the first packet.

        :param joint_error: target - actual [rad].
        """
        state = self._latest
        if state is None:
            return None
        return ServoReport(
            timestamp=state.timestamp,
            activity=_ACTIVITIES.get(self.phase, ServoActivity.IDLE),
            setpoints_sent=self._sent,
            setpoints_done=state.setpoints_done,
            buffer_size=state.buffer_size,
            buffer_capacity=self.settings.buffer_depth,
            buffered=state.lag,
            lag=self.lag,
            speed_scaling=state.effective_speed,
            joint_error=joint_error,
            underruns=self._underruns,
            overruns=state.overflows,
            repeats=state.repeats,
            skipped=state.skipped,
        )

    # ---- events -------------------------------------------------------------------------------

    def begin(self) -> None:
        """Make the arm follow the set-points from now on."""
        self._apply(ServoEvent.BEGUN)
        self._first_servo = self._sequence + 1
        # The source may have been reset after it gave these joints, and the first write may come
        # before its next set-point.
        self._joints = self._source.next(0.0)

    def go_on(self, rest: float, next_hold: float) -> None:
        """
        Go on after a hold.

        :param rest: time for which the source would rest here [s]; it has passed in the hold.
        :param next_hold: the time of the source at the next hold [s]; inf = none.
        """
        assert isinstance(self._source, RestingSource)
        self._source.skip(rest)
        self.source_time += rest
        self.held_time -= rest
        self.next_hold = next_hold

    def stop(self) -> tuple[float, ...] | None:
        """Leave the servo; return the inputs to write at once, None = nothing."""
        before = self.phase
        self._apply(ServoEvent.STOP)
        if self.phase is before or self.phase is ServoPhase.LEFT:
            return None
        self._sequence += 1
        self._first_idle = self._sequence
        return self._row()

    def on_feedback(self, feedback: ServoFeedback, now: float) -> tuple[float, ...] | None:
        """
        Process a packet; return the inputs to write, None = nothing.

        :param now: time of a steady clock [s].
        """
        before, self._latest, self.buffered = self._latest, feedback, feedback.lag
        if self.phase is ServoPhase.OPENING and not self._open(feedback):
            return None
        self._forget_finished(feedback)
        self._update_phase(feedback)
        if before is not None:
            self._advance_clock(feedback.timestamp - before.timestamp, feedback)
        if (
            self.phase is ServoPhase.LEFT
            or now < self._last_write + MIN_WRITE_PERIOD * self._clock.step
        ):
            return None
        self._last_write = now
        self._sequence += 1
        if self.phase in (ServoPhase.FILLING, ServoPhase.SERVOING, ServoPhase.HOLDING):
            steps = self._clock.take_steps(self.in_flight)
            if steps:
                self._next_setpoint(steps)
        return self._row()

    def _open(self, feedback: ServoFeedback) -> bool:
        """Measure the control step in the first packets; return whether it is known."""
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

    def _forget_finished(self, feedback: ServoFeedback) -> None:
        """Drop the set-points that the robot has read, or has carried out, from their queues."""
        if feedback.last_sequence <= self._sequence:  # else the number is not ours
            while self._unread and self._unread[0].sequence <= feedback.last_sequence:
                self._read_time = self._unread.popleft().state_time
        done = self._state_time - self.in_flight + 0.5 * self._clock.step
        while self._unfinished and self._unfinished[0].state_time <= done:
            self.motion_time = self._unfinished.popleft().source_time

    def _update_phase(self, feedback: ServoFeedback) -> None:
        """Change the phase as the packet requires."""
        match self.phase:
            case ServoPhase.ENTERING if self._has_read(self._first):
                self._apply(ServoEvent.ANSWERED)
            case _ if self._has_left(feedback):
                self._apply(ServoEvent.PROGRAM_LEFT)
            case ServoPhase.FILLING | ServoPhase.HOLDING if self.in_flight >= self._fill_target:
                self._apply(ServoEvent.FILLED)
            case ServoPhase.SERVOING if (
                feedback.lag <= 0.0 and feedback.playing and self._has_run_out()
            ):
                self._underruns += 1
                self._motion_rate = 0.0
                self._apply(ServoEvent.EMPTY)
            case ServoPhase.DRAINING if self._has_run_out():
                self._apply(ServoEvent.DONE)

    def _has_run_out(self) -> bool:
        return self.in_flight <= 0.5 * self._clock.step

    def _has_left(self, feedback: ServoFeedback) -> bool:
        """Return whether the program has left SERVO, on our request or by itself."""
        if feedback.mode == ServoMode.SERVO:
            return False
        if self.phase is ServoPhase.LEAVING:
            return self.may_leave and self._has_read(self._first_idle)
        return self.phase in STREAMING and self._has_read(self._first_servo)

    def _advance_clock(self, passed: float, feedback: ServoFeedback) -> None:
        """Advance the clock and the rate of the motion by the robot's time."""
        passed = passed if 0.0 <= passed <= MAX_CLOCK_GAP else 0.0
        if self.phase in STREAMING:
            speed = feedback.effective_speed if feedback.playing else 0.0
            self._clock.advance(passed, speed, self.in_flight)
        step = self.feed_rate * passed
        self.feed += min(max(self.feed_target - self.feed, -step), step)
        if self.phase is not ServoPhase.SERVOING:
            return
        if self.is_stalled:
            self._recovers = True
            self._motion_rate = max(0.0, self._motion_rate - STALL_DECELERATION * passed)
        else:
            self._motion_rate = min(1.0, self._motion_rate + RESTART_ACCELERATION * passed)
            self._recovers = self._recovers and self._motion_rate < 1.0

    def _next_setpoint(self, steps: int) -> None:
        """Make the set-point of the next write, which covers ``steps`` control steps."""
        moves, time = self.phase is ServoPhase.SERVOING, steps * self._clock.step
        passed = self._motion_rate * time if moves else 0.0
        if self._recovers:
            self.stalled_time += time - passed
        self.feed_delay += (1.0 - self.feed) * passed
        passed *= self.feed
        if self.source_time + passed >= self.next_hold:
            reached = max(0.0, self.next_hold - self.source_time)
            self.held_time += passed - reached
            passed = reached
        self._sent += steps
        self._joints = self._source.next(passed)
        self.source_time += passed
        self._moved_time += passed
        self._state_time += time
        setpoint = _Setpoint(self._sequence, self._state_time, self.source_time)
        self._unread.append(setpoint)
        self._unfinished.append(setpoint)
        if moves and self._source.done and self.next_hold == inf:
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
            self._moved_time,
        )
