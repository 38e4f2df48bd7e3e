# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The reverse interface: orders to the robot program, with the timeout of its next read.

One message is 8 big-endian int32, 32 bytes; S = 1,000,000. The robot sends nothing back.

=====  ============  ======================================================================
index  mode          meaning
=====  ============  ======================================================================
0      all           timeout of the robot's *next* read [ms]; 0 = none
1, 2   FORWARD       trajectory action, number of points, both unscaled
3      FORWARD       START: 1 = the path accepts offsets (:mod:`~.registers`)
4, 5   FORWARD       feed override: fraction of the planned speed of splines x S, and its largest
                     rate of change [1/s] x S; 0 = no override
1, 2   BUFFERED_     trajectory action, number of points: events along the set-points
       SERVO
1 - 6  IDLE,         no meaning; URCL sends uninitialized memory
       STOPPED
7      all           control mode
=====  ============  ======================================================================

The sender must

* send the next message before the timeout in word 0, even if nothing changes (:func:`keepalive`,
  or ``TrajectoryAction.NOOP`` while a trajectory runs): a read that times out ends the robot
  program;
* send a FORWARD message, even NOOP, only if FORWARD is the wanted mode: the message *enters* this
  mode, and so ends any other;
* send the number of points with START, and the number of all points written since STREAM_START
  with STREAM_END, or with the CANCEL of a stream;
* end or cancel a stream before the next START; otherwise the new points extend the stream.

``BUFFERED_SERVO`` is a mode of our own robot program. The program does not run trajectory pieces
in this mode; it waits while the set-points move the arm through them. The driver does not use
URCL's modes of set-points (servoj, speedj, speedl, pose, torque) and of freedrive.
Word 3 of START and words 4 and 5 exist only in our own program, too; URCL leaves them 0. Every
FORWARD message of a goal has words 4 and 5.
Streams came with URCL 2.14; older programs ignore them. All other words have had the same place
and scale since URCL 2.0.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
import struct
from typing import NamedTuple, TypeAlias

from ur_cartesian_driver.motion.errors import LocalProtocolError
from ur_cartesian_driver.protocol.framing import FIXED_POINT, INT32_MAX, to_fixed


class ControlMode(IntEnum):
    """Word 7: how the robot is controlled."""

    #: Ends the control loop of the robot program; the program that contains the loop continues.
    STOPPED = -2
    #: Initial value inside the robot program; never sent.
    UNINITIALIZED = -1
    IDLE = 0
    #: Trajectories; the points come over the trajectory interface.
    FORWARD = 3
    #: Our own program only: set-points come through RTDE registers (:mod:`~.registers`), are
    #: buffered and fed to ``servoj``; reverse messages keep the program alive, and start the
    #: events along the set-points.
    BUFFERED_SERVO = 100


class TrajectoryAction(IntEnum):
    """Word 1 in the modes FORWARD and BUFFERED_SERVO."""

    CANCEL = -1
    #: Only keeps the program alive.
    NOOP = 0
    START = 1
    STREAM_START = 2
    STREAM_END = 3


MESSAGE_FIELDS = 8
MESSAGE_SIZE = 4 * MESSAGE_FIELDS
#: Word 3 of a START whose path accepts offsets.
TAKES_OFFSETS = 1
#: Word 0 of a STOPPED message [ms].
STOPPED_TIMEOUT = 100

MessageWords: TypeAlias = tuple[int, int, int, int, int, int]

_MESSAGE = struct.Struct('>8i')


@dataclass(frozen=True, slots=True, kw_only=True)
class ReverseMessage:
    """
    One message as on the wire; the functions below make messages that follow the rules.

    :param read_timeout: timeout of the robot's next read [ms], 0 = none.
    :param payload: words 1 to 6, unscaled.
    :raises LocalProtocolError: a word does not fit into an int32, or the mode is never sent.
    """

    read_timeout: int
    mode: ControlMode
    payload: MessageWords = (0, 0, 0, 0, 0, 0)

    def __post_init__(self) -> None:
        """Check all words, so that no invalid message exists."""
        if self.mode is ControlMode.UNINITIALIZED:
            raise LocalProtocolError(
                f'Control mode {self.mode.name} exists only inside the robot program.'
            )
        if not 0 <= self.read_timeout <= INT32_MAX:
            raise LocalProtocolError(
                f'read_timeout is {self.read_timeout} ms, but must lie within 0 and {INT32_MAX}.'
            )
        for index, word in enumerate(self.payload, 1):
            to_fixed(word, f'word {index} of a {self.mode.name} message', scale=1)

    def encode(self) -> bytes:
        """Return the 32 bytes."""
        return _MESSAGE.pack(self.read_timeout, *self.payload, self.mode)


class FeedTarget(NamedTuple):
    """A feed override in FORWARD mode."""

    #: The target, as a fraction of the planned speed.
    fraction: float
    #: Rate at which the feed approaches the target [1/s].
    rate: float

    def encode(self) -> tuple[int, int]:
        """Return words 4 and 5."""
        return round(self.fraction * FIXED_POINT), round(self.rate * FIXED_POINT)


#: No feed override: words 4 and 5 are 0, as in messages of other drivers.
NO_OVERRIDE = FeedTarget(0.0, 0.0)


def trajectory(
    action: TrajectoryAction,
    count: int = 0,
    read_timeout: int = 200,
    takes_offsets: bool = False,
    mode: ControlMode = ControlMode.FORWARD,
    feed: FeedTarget = NO_OVERRIDE,
) -> ReverseMessage:
    """
    Return the message that starts, ends, cancels or keeps alive a trajectory.

    :param count: number of points, for START, STREAM_END, and CANCEL of a stream.
    :param read_timeout: timeout of the robot's next read [ms], 0 = none.
    :param takes_offsets: for START: whether the path accepts offsets, through registers.
    :param mode: BUFFERED_SERVO for a trajectory along which set-points lead the arm.
    :param feed: the feed override of the goal.
    """
    return ReverseMessage(
        read_timeout=read_timeout,
        mode=mode,
        payload=(action, count, TAKES_OFFSETS * takes_offsets, *feed.encode(), 0),
    )


def keepalive(read_timeout: int = 1000) -> ReverseMessage:
    """Return the message that asks the robot to stand still and wait for the next message."""
    return ReverseMessage(read_timeout=read_timeout, mode=ControlMode.IDLE)


def buffered_servo(read_timeout: int = 200) -> ReverseMessage:
    """Return the message that enters the buffered servo, or keeps it alive."""
    return ReverseMessage(read_timeout=read_timeout, mode=ControlMode.BUFFERED_SERVO)


def stop() -> ReverseMessage:
    """Return the message that ends the control loop of the robot program."""
    return ReverseMessage(read_timeout=STOPPED_TIMEOUT, mode=ControlMode.STOPPED)
