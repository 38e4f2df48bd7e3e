# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The reverse interface: what the robot program shall do, and for how long it may believe that.

One message is 8 big-endian int32, 32 bytes; S = 1,000,000. The robot sends nothing back.

=====  ============  ======================================================================
index  mode          meaning
=====  ============  ======================================================================
0      all           how long the robot's *next* read may take [ms]; 0 = for ever
1 - 6  SERVOJ        joint positions [rad] x S
1 - 6  SPEEDJ        joint velocities [rad/s] x S
1 - 6  SPEEDL        twist of the tool [m/s, rad/s] x S
1 - 6  POSE          x y z rx ry rz [m, rad] x S
1 - 6  TORQUE        joint torques [Nm] x S
1, 2   FORWARD       trajectory action, number of points, both unscaled
1      FREEDRIVE     freedrive action, unscaled
1 - 6  IDLE,         no meaning; URCL sends whatever is in memory
       STOPPED
7      all           control mode
=====  ============  ======================================================================

The sender must

* send the next message before the time in word 0 is over, also when there is nothing to say
  (:func:`keepalive`, or ``TrajectoryAction.NOOP`` while a trajectory runs): a read that times out
  ends the robot program;
* know that any FORWARD message, NOOP too, *enters* that mode and stops what ran before;
* give START the number of points, and CANCEL in a stream the number of all points written since
  STREAM_START;
* end or cancel a stream before the next START, which would else swallow the new points.

``BUFFERED_SERVO`` is a mode of our own robot program, whose words 1 to 6 have no meaning either.
The streams came with URCL 2.14 (see `dialects`). All else here
has had its place and scale since URCL 2.0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
import struct
from typing import cast, TypeAlias

from ur_cartesian_driver.motion.errors import LocalProtocolError, RemoteProtocolError
from ur_cartesian_driver.motion.pose import Vector6
from ur_cartesian_driver.protocol.framing import (
    checked_int32,
    checked_size,
    from_fixed,
    hex_text,
    INT32_MAX,
    INT32_MIN,
    RecordDecoder,
    to_fixed,
)
from ur_cartesian_driver.protocol.program.wire_dialects import Dialect, NEWEST_DIALECT


class ControlMode(IntEnum):
    """Word 7: how the robot is controlled."""

    #: The control loop of the robot program ends, the program around it goes on.
    STOPPED = -2
    #: Initial value inside the robot program; never sent.
    UNINITIALIZED = -1
    IDLE = 0
    SERVOJ = 1
    SPEEDJ = 2
    #: Trajectory forwarding: the points come over the trajectory interface.
    FORWARD = 3
    SPEEDL = 4
    POSE = 5
    FREEDRIVE = 6
    #: Used inside the robot program; never sent.
    TOOL_IN_CONTACT = 7
    TORQUE = 8
    #: Ours alone: set-points come through RTDE registers (:mod:`~.registers`), are buffered and
    #: fed to ``servoj``; the messages here are the leash, as in the other modes.
    BUFFERED_SERVO = 100


class TrajectoryAction(IntEnum):
    """Word 1 in FORWARD mode."""

    CANCEL = -1
    #: Keep alive.
    NOOP = 0
    START = 1
    STREAM_START = 2
    STREAM_END = 3


class FreedriveAction(IntEnum):
    """Word 1 in FREEDRIVE mode."""

    STOP = -1
    NOOP = 0
    START = 1


MESSAGE_FIELDS = 8
MESSAGE_SIZE = 4 * MESSAGE_FIELDS
#: Longest time between two set-points that the robot is allowed to bridge [ms].
MAX_REALTIME_TIMEOUT = 200
#: Word 0 of a STOPPED message [ms].
STOPPED_TIMEOUT = 100
#: Controller cycle of an e-Series robot [ms].
DEFAULT_STEP_TIME = 2

# Tuples: to compare a few numbers is faster than to hash one.
_STREAMS = (TrajectoryAction.STREAM_START, TrajectoryAction.STREAM_END)
REALTIME_MODES = (
    ControlMode.SERVOJ,
    ControlMode.SPEEDJ,
    ControlMode.SPEEDL,
    ControlMode.POSE,
    ControlMode.TORQUE,
)
_NEVER_SENT = (ControlMode.UNINITIALIZED, ControlMode.TOOL_IN_CONTACT)
_VALUE_NAMES = {
    ControlMode.SERVOJ: 'joint position',
    ControlMode.SPEEDJ: 'joint velocity',
    ControlMode.SPEEDL: 'tool speed',
    ControlMode.POSE: 'pose',
    ControlMode.TORQUE: 'torque',
}

MessageWords: TypeAlias = tuple[int, int, int, int, int, int]

_MESSAGE = struct.Struct('>8i')


@dataclass(frozen=True, slots=True, kw_only=True)
class ReverseMessage:
    """
    One message as it stands on the wire; the builders below apply the rules.

    :param read_timeout: how long the robot's next read may take [ms], 0 = for ever.
    :param payload: words 1 to 6, unscaled.
    :raises LocalProtocolError: a word does not fit, or the mode is never sent.
    """

    read_timeout: int
    mode: ControlMode
    payload: MessageWords = (0, 0, 0, 0, 0, 0)

    def __post_init__(self) -> None:
        """Check everything, so that no invalid message exists."""
        _refuse_internal_mode(self.mode)
        if not 0 <= self.read_timeout <= INT32_MAX:
            raise LocalProtocolError(
                f'read_timeout is {self.read_timeout} ms, but it must lie within 0 and '
                f'{INT32_MAX}.'
            )
        if not INT32_MIN <= min(self.payload) <= max(self.payload) <= INT32_MAX:
            for index, word in enumerate(self.payload, 1):
                checked_int32(word, f'word {index} of a {self.mode.name} message')

    def encode(self) -> bytes:
        """Return the 32 bytes."""
        return _MESSAGE.pack(self.read_timeout, *self.payload, self.mode)

    @classmethod
    def decode(cls, data: bytes) -> ReverseMessage:
        """
        Return the message of 32 bytes.

        :raises RemoteProtocolError: the size, the mode or the read timeout is impossible.
        """
        words = _MESSAGE.unpack(checked_size(data, MESSAGE_SIZE, 'reverse message'))
        try:
            return cls(
                read_timeout=words[0],
                mode=ControlMode(words[7]),
                payload=cast(MessageWords, words[1:7]),
            )
        except (ValueError, LocalProtocolError) as error:
            raise RemoteProtocolError(
                f'A reverse message is wrong: {error} {hex_text(data)}'
            ) from None

    @property
    def values(self) -> Vector6:
        """Words 1 to 6 as the numbers that they are in a real-time mode, in SI units."""
        return cast(Vector6, tuple(from_fixed(word) for word in self.payload))


class ReverseDecoder(RecordDecoder[ReverseMessage]):
    """Decodes reverse messages: the robot's side."""

    def __init__(self) -> None:
        """Start empty."""
        super().__init__(MESSAGE_SIZE, 'reverse message', ReverseMessage.decode)


def read_timeout_for(mode: ControlMode, requested: int, step_time: int = DEFAULT_STEP_TIME) -> int:
    """
    Return word 0 for a wish [ms].

    * Real-time modes: at least one step, at most 200 ms. They cannot wait for ever, because the
      arm would go on moving.
    * IDLE, FORWARD, FREEDRIVE, BUFFERED_SERVO: 0 = for ever, else at least one step.
    * STOPPED: always 100 ms.

    :param step_time: controller cycle [ms].
    :raises LocalProtocolError: the mode is never sent, or the wish is negative.
    """
    _refuse_internal_mode(mode)
    if requested < 0:
        raise LocalProtocolError(
            f'read_timeout is {requested} ms, but it must not be negative (0 = for ever).'
        )
    if mode is ControlMode.STOPPED:
        return STOPPED_TIMEOUT
    if mode in REALTIME_MODES:
        return min(max(requested, step_time), MAX_REALTIME_TIMEOUT)
    return max(requested, step_time) if requested else 0


def trajectory(
    action: TrajectoryAction,
    count: int = 0,
    read_timeout: int = 200,
    step_time: int = DEFAULT_STEP_TIME,
    dialect: Dialect = NEWEST_DIALECT,
) -> ReverseMessage:
    """
    Return the message that starts, ends, cancels or keeps alive a trajectory.

    :param count: number of points: START, STREAM_END, CANCEL of a stream.
    :raises LocalProtocolError: the dialect has no such action; a program would ignore it.
    """
    if action in _STREAMS and not dialect.supports_append:
        raise LocalProtocolError(
            f'{action.name} does not exist in wire dialect {dialect.name}: its trajectories have '
            'a number of points that is known at their start.'
        )
    mode = ControlMode.FORWARD
    return ReverseMessage(
        read_timeout=read_timeout_for(mode, read_timeout, step_time),
        mode=mode,
        payload=(action, count, 0, 0, 0, 0),
    )


def freedrive(
    action: FreedriveAction, read_timeout: int = 200, step_time: int = DEFAULT_STEP_TIME
) -> ReverseMessage:
    """Return the message that starts, ends or keeps alive freedrive."""
    mode = ControlMode.FREEDRIVE
    return ReverseMessage(
        read_timeout=read_timeout_for(mode, read_timeout, step_time),
        mode=mode,
        payload=(action, 0, 0, 0, 0, 0),
    )


def setpoint(
    mode: ControlMode,
    values: Sequence[float],
    read_timeout: int = 20,
    step_time: int = DEFAULT_STEP_TIME,
) -> ReverseMessage:
    """
    Return a set-point of a real-time mode.

    :param values: six numbers, see the table above.
    :raises LocalProtocolError: the mode takes no set-points, or a value cannot be sent.
    """
    if mode not in REALTIME_MODES or len(values) != 6:
        raise LocalProtocolError(
            f'{mode.name} with {len(values)} values is not a set-point: the modes are '
            f'{", ".join(m.name for m in sorted(REALTIME_MODES))}, each with 6 values.'
        )
    name = _VALUE_NAMES[mode]
    words = tuple(to_fixed(value, f'{name}[{i}]') for i, value in enumerate(values))
    return ReverseMessage(
        read_timeout=read_timeout_for(mode, read_timeout, step_time),
        mode=mode,
        payload=cast(MessageWords, words),
    )


def keepalive(read_timeout: int = 1000, step_time: int = DEFAULT_STEP_TIME) -> ReverseMessage:
    """Return the message that says: stand still, and wait for the next one."""
    mode = ControlMode.IDLE
    return ReverseMessage(read_timeout=read_timeout_for(mode, read_timeout, step_time), mode=mode)


def buffered_servo(read_timeout: int = 200, step_time: int = DEFAULT_STEP_TIME) -> ReverseMessage:
    """Return the message that enters the buffered servo, or keeps it alive."""
    mode = ControlMode.BUFFERED_SERVO
    return ReverseMessage(read_timeout=read_timeout_for(mode, read_timeout, step_time), mode=mode)


def stop() -> ReverseMessage:
    """Return the message that ends the control loop of the robot program."""
    return ReverseMessage(read_timeout=STOPPED_TIMEOUT, mode=ControlMode.STOPPED)


def _refuse_internal_mode(mode: ControlMode) -> None:
    if mode in _NEVER_SENT:
        raise LocalProtocolError(f'Control mode {mode.name} exists inside the robot program only.')
