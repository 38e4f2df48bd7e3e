# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The pipe between the owner of a driver and the robot loop, which controls the robot.

The owner is the program or node that plans the motions. It sends the loop a :data:`Request`; the
loop sends a :data:`Notification`. Each motion has a number, the field ``motion`` of the messages.

A message is sent as its length, then three pickles and its large arrays. The first pickle is the
notification with which a receiver that cannot read the message answers it (None = the message
needs no answer). The second has the sizes of the arrays, which follow it, each at a multiple of
:data:`ALIGNMENT`. The last is the message itself, one of the dataclasses below. Both ends run this
package, and no other process can open the pipe (a pair of sockets), so pickle is safe here. A
large plan has 60 MB of arrays: neither sending nor unpickling copies them (PEP 574).
"""

from __future__ import annotations

from dataclasses import dataclass, field
import io
import pickle
import socket
import struct
from typing import TypeAlias

from ur_cartesian_driver.driver.ipc.driver_config import DriverConfig
from ur_cartesian_driver.execution.goal.goal_commands import AnswerAppend
from ur_cartesian_driver.execution.goal.motion_job import AppendJob, MotionJob
from ur_cartesian_driver.execution.live.live_targets import LiveSettings
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import DhTable, JointLimits, RobotModel
from ur_cartesian_driver.motion.errors import DriverError, ErrorCode, LocalProtocolError
from ur_cartesian_driver.motion.events import Outcome, Progress, Pulse
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import Joints, Vector3
from ur_cartesian_driver.motion.state.io_signals import Signals
from ur_cartesian_driver.motion.state.servo_report import ServoReport
from ur_cartesian_driver.robot.connection_status import ConnectionStatus, LinkGaps
from ur_cartesian_driver.robot.services.service_calls import ServiceAnswer, ServiceCall

LENGTH = struct.Struct('>I')
Buffer: TypeAlias = bytes | memoryview
#: Arrays of at least ``LARGE_ARRAY`` bytes are sent outside the pickle, each beginning at a
#: multiple of ``ALIGNMENT`` bytes.
LARGE_ARRAY, ALIGNMENT = 1 << 16, 16
#: The reason given if the receiver cannot read the message.
UNREADABLE = (
    'The robot process cannot read the request, because it contains objects of classes that only '
    'your program has; use those of this package.'
)


class Unreadable(DriverError):
    """A message that cannot be read."""

    code = ErrorCode.INVALID_GOAL

    def __init__(self, reason: str, refusal: Notification | None) -> None:
        """
        Build the error.

        :param refusal: the notification that refuses the message; None = it needs no answer.
        """
        super().__init__(reason)
        self.refusal = refusal


@dataclass(frozen=True, slots=True, kw_only=True)
class TemporaryTcpSet:
    """A goal sets a temporary TCP."""

    T_flange_original: Pose
    T_flange_temporary: Pose


@dataclass(frozen=True, slots=True, kw_only=True)
class TemporaryTcpRestored:
    """The temporary TCP is not active: it was restored, replaced, or never set on the robot."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Configure:
    """The first message: the configuration of the robot loop."""

    config: DriverConfig
    #: Whether the robot program may be uploaded on the first connection; False if it had stopped
    #: when an earlier loop of the same owner ended.
    may_upload: bool = True
    #: A temporary TCP that an earlier loop of the same owner may not have restored.
    temporary_tcp: TemporaryTcpSet | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmSetup:
    """The arm's model and geometry, with the limits and the calibration that the robot reports."""

    model: RobotModel
    geometry: DhTable

    @classmethod
    def of(cls, arm: Arm) -> ArmSetup:
        """Return the setup of an arm, which is sent faster than the :class:`Arm` itself."""
        return cls(model=arm.model, geometry=arm.geometry)


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveSetup:
    """The settings of a live session, in addition to its job."""

    settings: LiveSettings
    #: Joint positions of the arm at rest [rad].
    start: Joints


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StartMotion:
    """Run a motion."""

    motion: int
    job: MotionJob
    #: The records of the motion: encoded instructions for the robot program, 84 bytes each.
    points: bytes
    #: Metadata of the plan for the recording, as JSON; empty = none.
    plan_metadata: str = ''
    #: The arm, if path offsets may displace the motion or it follows live targets; else None.
    arm: ArmSetup | None = None
    #: The settings of a live session; None = the motion is no live session.
    live: LiveSetup | None = None
    #: Whether a person guides the arm by hand.
    freedrive: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class SetLiveTarget:
    """Give a live session another target."""

    motion: int
    T_base_tcp: Pose
    #: How old the target is [s].
    age: float


@dataclass(frozen=True, slots=True, kw_only=True)
class SetPathOffset:
    """Give a new offset to a motion that accepts path offsets."""

    motion: int
    #: The offset along, across and normal to the path [m].
    offset: Vector3
    #: How old the offset is [s].
    age: float


@dataclass(frozen=True, slots=True, kw_only=True)
class SetFeedOverride:
    """Give a new feed to a motion that accepts a feed override."""

    motion: int
    #: Fraction of the planned speed; anything but 0 to 1 is an invalid signal.
    fraction: float
    #: How old the fraction is [s].
    age: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AppendToMotion:
    """Append to a motion with keep_open; :class:`AppendAnswered` answers it."""

    motion: int
    append_job: AppendJob
    #: The appended records, as in :class:`StartMotion`.
    points: bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class CancelMotion:
    """Stop the motion, if it is still running."""

    motion: int
    #: The motion that preempts this one, as a noun phrase; empty = this one is cancelled.
    preempted_by: str = ''
    #: Why the rest of the path would collide, as a clause; empty = there is another reason.
    collision: str = ''


@dataclass(frozen=True, slots=True, kw_only=True)
class ResendProgram:
    """Upload the robot program (again)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CallRobot:
    """Make a service call."""

    number: int
    call: ServiceCall


@dataclass(frozen=True, slots=True, kw_only=True)
class OwnerHeartbeat:
    """The owner is alive."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Shutdown:
    """Stop the arm and end the robot loop."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StatusChanged:
    """The status of the connection changed."""

    status: ConnectionStatus


@dataclass(frozen=True, slots=True, kw_only=True)
class GeometryReceived:
    """The robot reported its calibrated geometry."""

    geometry: DhTable


@dataclass(frozen=True, slots=True, kw_only=True)
class LimitsReceived:
    """The robot reported the limits of its joints."""

    limits: JointLimits


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionProgress:
    """Progress of a motion."""

    motion: int
    progress: Progress


@dataclass(frozen=True, slots=True, kw_only=True)
class AppendAnswered:
    """The answer to an append: the records were accepted or refused."""

    motion: int
    answer: AnswerAppend


@dataclass(frozen=True, slots=True, kw_only=True)
class ServoProgress:
    """Progress of a motion's streamed set-points."""

    motion: int
    report: ServoReport


@dataclass(frozen=True, slots=True, kw_only=True)
class PulsesGiven:
    """The robot program has given pulses."""

    pulses: tuple[Pulse, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionEnded:
    """The end of a motion."""

    motion: int
    outcome: Outcome


@dataclass(frozen=True, slots=True, kw_only=True)
class CallAnswered:
    """The answer to a service call."""

    number: int
    answer: ServiceAnswer


@dataclass(frozen=True, slots=True, kw_only=True)
class SignalsChanged:
    """Inputs, outputs or tool of the robot changed."""

    signals: Signals


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopHeartbeat:
    """The robot loop is alive; reports its longest gaps since the last heartbeat."""

    gaps: LinkGaps = field(default_factory=LinkGaps)


@dataclass(frozen=True, slots=True, kw_only=True)
class LogMessage:
    """A line for the owner's log, with a level of ``logging``."""

    level: int
    text: str


Request: TypeAlias = (
    Configure
    | StartMotion
    | AppendToMotion
    | SetLiveTarget
    | SetPathOffset
    | SetFeedOverride
    | CancelMotion
    | ResendProgram
    | CallRobot
    | OwnerHeartbeat
    | Shutdown
)
Notification: TypeAlias = (
    LoopHeartbeat
    | StatusChanged
    | SignalsChanged
    | GeometryReceived
    | LimitsReceived
    | MotionProgress
    | ServoProgress
    | PulsesGiven
    | AppendAnswered
    | MotionEnded
    | CallAnswered
    | TemporaryTcpSet
    | TemporaryTcpRestored
    | LogMessage
)


def refusal_of(message: Request | Notification, reason: str) -> Notification | None:
    """
    Return the notification that answers a message that was not carried out; None = none does.

    :param reason: the reason, as a sentence.
    """
    match message:
        case StartMotion(motion=motion):
            outcome = Outcome(code=ErrorCode.EXECUTION_FAILED, text=reason)
            return MotionEnded(motion=motion, outcome=outcome)
        case AppendToMotion(motion=motion, append_job=AppendJob(number=number)):
            answer = AnswerAppend(number=number, refusal=reason)
            return AppendAnswered(motion=motion, answer=answer)
        case CallRobot(number=number):
            return CallAnswered(number=number, answer=ServiceAnswer(ok=False, text=reason))
    return None


def pack(message: Request | Notification) -> bytes:
    """
    Return a message as bytes, its length first.

    :raises LocalProtocolError: a part of the message cannot be pickled.
    """
    return b''.join(pack_parts(message))


def pack_parts(message: Request | Notification) -> list[Buffer]:
    """
    Return a message in parts, to be sent in this order; large arrays are not copied.

    :raises LocalProtocolError: a part of the message cannot be pickled.
    """
    arrays: list[memoryview] = []

    def keep_inside(buffer: pickle.PickleBuffer) -> bool:
        """Return whether a buffer stays inside the pickle."""
        array = buffer.raw()
        is_small = array.nbytes < LARGE_ARRAY
        if not is_small:
            arrays.append(array)
        return is_small

    try:
        refusal = pickle.dumps(refusal_of(message, UNREADABLE))
        body = pickle.dumps(message, protocol=5, buffer_callback=keep_inside)
    except Exception as error:  # pickling calls methods of all objects, which may raise anything
        raise LocalProtocolError(
            f'{type(message).__name__} cannot be sent to the robot process: {error}.'
        ) from error
    begin = refusal + pickle.dumps([array.nbytes for array in arrays])
    parts: list[Buffer] = []
    size = len(begin)
    for array in arrays:
        parts += [bytes(-size % ALIGNMENT), array]
        size += len(parts[-2]) + array.nbytes
    begin = LENGTH.pack(size + len(body)) + begin
    return [begin, *parts, body] if arrays else [begin + body]


def unpack(body: bytes) -> Request | Notification:
    """
    Decode the bytes after the length; large arrays of the message are views of these bytes.

    :raises Unreadable: the bytes are no pickles, or use classes that this process does not have.
    """
    stream, refusal = io.BytesIO(body), None
    try:
        refusal = pickle.load(stream)
        arrays, whole = [], memoryview(body)
        for size in pickle.load(stream):
            first = stream.tell() + -stream.tell() % ALIGNMENT
            arrays.append(whole[first : first + size])
            stream.seek(first + size)
        message: Request | Notification = pickle.load(stream, buffers=arrays)
    except Exception as error:  # unpickling calls functions that may raise anything
        raise Unreadable(f'{type(error).__name__}: {error}', refusal) from error
    return message


def receive(pipe: socket.socket) -> Request | Notification | None:
    """
    Wait for the next message.

    :param pipe: a blocking socket; its timeout is the longest silence allowed.
    :returns: the message; None if the pipe was closed, or was silent for longer than its timeout.
    :raises Unreadable: the message cannot be decoded.
    """
    head = _read(pipe, LENGTH.size)
    if head is None:
        return None
    body = _read(pipe, LENGTH.unpack(head)[0])
    return None if body is None else unpack(body)


def _read(pipe: socket.socket, size: int) -> bytes | None:
    parts = bytearray()
    while len(parts) < size:
        try:
            part = pipe.recv(min(size - len(parts), 1 << 20))
        except OSError:
            return None
        if not part:
            return None
        parts += part
    return bytes(parts)
