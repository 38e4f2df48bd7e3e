# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The primary interface: state and messages from the controller, programs and commands to it.

The controller sends big-endian frames: ``int32`` size of the whole frame, ``uint8`` type, body.

* type 16, robot state: sub-packages (see `primary_state`), sent ten times a second.
* type 20, robot message: ``u64`` timestamp, ``i8`` source, ``u8`` message type, and a body:

  ====  ==================  ====================================================================
  type  class               body (texts extend to the end of the frame, without terminator)
  ====  ==================  ====================================================================
  0     TextMessage         text
  3     VersionMessage      i8 length, name; u8 major, u8 minor, i32 bugfix, i32 build; date
  5     SafetyModeMessage   i32 code, i32 argument, u8 safety mode, u32 type of the datum, 4 bytes
                            datum (type 2: i32, 3: f32, else u32)
  6     ErrorCodeMessage    i32 code, i32 argument, i32 level, u32 type of the datum, u32 datum;
                            text
  7     KeyMessage          i32 code, i32 argument; u8 length, title; text
  10    RuntimeException    u32 line, u32 column (from 1); text
  ====  ==================  ====================================================================

* every other type becomes a :class:`RawFrame`.

The client sends text. A line is a command, unless it begins a program (``def`` or ``sec``). Once
the ``end`` of a ``def`` program has arrived, this program replaces the running one; a ``sec``
program runs concurrently with it. The simulator's `script_upload` decodes this text.

The manufacturer's client library relies on the controller to send the version message first on
each connection, to send a frame in one piece of at most 4091 bytes (checked here), never to send a
sub-package that is too short, and to send a safety mode message only when the mode changes.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import Enum, IntEnum
import struct
from typing import ClassVar, get_args, TypeAlias

from ur_cartesian_driver.motion.errors import LocalProtocolError
from ur_cartesian_driver.protocol.client_interfaces.body_layout import (
    Body,
    BodyLayout,
    pack,
    unpack,
)
from ur_cartesian_driver.protocol.client_interfaces.primary_state import (
    decode_sub_packages,
    encode_sub_package,
    SubPackage,
)
from ur_cartesian_driver.protocol.framing import FrameBuffer


class FrameType(IntEnum):
    """The type byte of a frame."""

    ROBOT_STATE = 16
    ROBOT_MESSAGE = 20


class ReportLevel(IntEnum):
    """Severity of an error; the levels from 128 up are for developers."""

    DEBUG = 0
    INFO = 1
    WARNING = 2
    VIOLATION = 3
    FAULT = 4
    CRITICAL_FAULT = 5
    DEVL_DEBUG = 128
    DEVL_INFO = 129
    DEVL_WARNING = 130
    DEVL_VIOLATION = 131
    DEVL_FAULT = 132
    DEVL_CRITICAL_FAULT = 133


#: Longest frame that the manufacturer's library can read [bytes].
MAX_SENT_FRAME_SIZE = 4091
#: Longest accepted frame [bytes]; a frame with all variables of a program can be long.
MAX_FRAME_SIZE = 1 << 20
#: Sources of messages: the controller; its motion control.
SOURCE_CONTROLLER = -2
SOURCE_MOTION = -3

_HEADER = struct.Struct('>iB')
_MESSAGE = struct.Struct('>QbB')


@dataclass(frozen=True, slots=True, kw_only=True)
class _Message(Body):
    """Common head of robot messages; the body contains the fields of the subclass."""

    message_type: ClassVar[int]
    timestamp: int = 0
    source: int = SOURCE_MOTION


@dataclass(frozen=True, slots=True, kw_only=True)
class TextMessage(_Message):
    """A text from ``textmsg``."""

    message_type: ClassVar = 0
    layout: ClassVar = BodyLayout('text', 'text message')
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class VersionMessage(_Message):
    """The software of the controller; the first message on a connection."""

    message_type: ClassVar = 3
    layout: ClassVar = BodyLayout('b:text B B i i text', 'version message')
    source: int = SOURCE_CONTROLLER
    project: str = 'URControl'
    major: int
    minor: int
    bugfix: int = 0
    build: int = 0
    date: str = ''


@dataclass(frozen=True, slots=True, kw_only=True)
class SafetyModeMessage(_Message):
    """A change of the safety mode, perhaps to a number that :class:`SafetyMode` lacks."""

    message_type: ClassVar = 5
    layout: ClassVar = BodyLayout('i i B I 4s', 'safety mode message')
    code: int = 0
    argument: int = 0
    safety_mode: int
    data_type: int = 0
    data: int | float = 0

    def encode(self) -> bytes:
        """Return the body."""
        *values, datum = (getattr(self, name) for name in self.__slots__)
        return self.layout.pack([*values, pack(self._datum_layout(self.data_type), datum)])

    @classmethod
    def decode(cls, body: bytes, **head: int) -> SafetyModeMessage:
        """Decode a body; RemoteProtocolError if it is too short."""
        *values, data_type, data = cls.layout.unpack(body)
        (datum,) = cls._datum_layout(data_type).unpack(data)
        values += [data_type, datum]
        return cls(**dict(zip(cls.__slots__, values, strict=True)), **head)

    @staticmethod
    def _datum_layout(data_type: int) -> struct.Struct:
        return struct.Struct({2: '>i', 3: '>f'}.get(data_type, '>I'))


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorCodeMessage(_Message):
    """An error; its ``level`` may be a number that :class:`ReportLevel` lacks."""

    message_type: ClassVar = 6
    layout: ClassVar = BodyLayout('i i i I I text', 'error code message')
    code: int
    argument: int = 0
    level: int = ReportLevel.WARNING
    data_type: int = 0
    data: int = 0
    text: str = ''

    @property
    def label(self) -> str:
        """Return the error as the manuals write it, for example ``C209A0``."""
        return f'C{self.code}A{self.argument}'


@dataclass(frozen=True, slots=True, kw_only=True)
class KeyMessage(_Message):
    """A named event, such as ``PROGRAM_XXX_STARTED`` or ``..._STOPPED`` with a program's name."""

    message_type: ClassVar = 7
    layout: ClassVar = BodyLayout('i i B:text text', 'key message')
    source: int = SOURCE_CONTROLLER
    code: int = 0
    argument: int = 0
    title: str
    text: str = ''


@dataclass(frozen=True, slots=True, kw_only=True)
class RuntimeExceptionMessage(_Message):
    """A program failed, or did not compile, at a line and a column (numbered from 1)."""

    message_type: ClassVar = 10
    layout: ClassVar = BodyLayout('I I text', 'runtime exception message')
    line: int
    column: int
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class RawMessage:
    """A message of any other type, undecoded."""

    message_type: int
    timestamp: int = 0
    source: int = SOURCE_MOTION
    content: bytes = b''

    def encode(self) -> bytes:
        """Return the body."""
        return self.content


_TypedMessage: TypeAlias = (
    TextMessage
    | VersionMessage
    | SafetyModeMessage
    | ErrorCodeMessage
    | KeyMessage
    | RuntimeExceptionMessage
)
PrimaryMessage: TypeAlias = _TypedMessage | RawMessage


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotStateFrame:
    """A robot state frame."""

    packages: tuple[SubPackage, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class RawFrame:
    """A frame of any other type, undecoded."""

    frame_type: int
    body: bytes


PrimaryFrame: TypeAlias = RobotStateFrame | PrimaryMessage | RawFrame


def encode_state(packages: Iterable[SubPackage]) -> bytes:
    """
    Return a robot state frame.

    :raises LocalProtocolError: a value does not fit, or the frame is too long.
    """
    return _frame(FrameType.ROBOT_STATE, b''.join(map(encode_sub_package, packages)))


def encode_message(message: PrimaryMessage) -> bytes:
    """
    Return a robot message frame.

    :raises LocalProtocolError: a value does not fit, or the frame is too long.
    """
    head = pack(_MESSAGE, message.timestamp, message.source, message.message_type)
    return _frame(FrameType.ROBOT_MESSAGE, head + message.encode())


def decode_frame(data: bytes) -> PrimaryFrame:
    """
    Return the content of one whole frame; its size field is not checked.

    :raises RemoteProtocolError: a part is too short, or the size of a sub-package is impossible.
    """
    _, frame_type = unpack(_HEADER, data, 'primary frame')
    body = data[_HEADER.size :]
    if frame_type == FrameType.ROBOT_STATE:
        return RobotStateFrame(packages=decode_sub_packages(body))
    if frame_type == FrameType.ROBOT_MESSAGE:
        return _decode_message(body)
    return RawFrame(frame_type=frame_type, body=body)


class PrimaryDecoder:
    """Decodes the controller's stream."""

    def __init__(self) -> None:
        """Start empty."""
        self._frames = FrameBuffer(
            size_width=4, min_size=_HEADER.size, max_size=MAX_FRAME_SIZE, what='primary frame'
        )

    def feed(self, data: bytes) -> list[PrimaryFrame]:
        """
        Take bytes from the controller (``b''`` = end of stream) and return the frames in them.

        :raises RemoteProtocolError: a size is impossible, a frame or a part of it is too short, or
            the stream ended inside a frame.
        """
        return [decode_frame(frame) for frame in self._frames.feed(data)]


def _frame(frame_type: FrameType, body: bytes) -> bytes:
    size = _HEADER.size + len(body)
    if size > MAX_SENT_FRAME_SIZE:
        raise LocalProtocolError(
            f'A primary frame has {size} bytes, but clients read at most {MAX_SENT_FRAME_SIZE}.'
        )
    return _HEADER.pack(size, frame_type) + body


def _decode_message(body: bytes) -> PrimaryMessage:
    timestamp, source, message_type = unpack(_MESSAGE, body, 'robot message')
    content = body[_MESSAGE.size :]
    head = {'timestamp': timestamp, 'source': source}
    message = _MESSAGES.get(message_type)
    if message is None:
        return RawMessage(message_type=message_type, content=content, **head)
    return message.decode(content, **head)


_MESSAGES: Mapping[int, type[_TypedMessage]] = {
    message.message_type: message for message in get_args(_TypedMessage)
}


class PrimaryCommand(Enum):
    """One-line commands, which are not part of a program."""

    POWER_ON = 'power on'
    POWER_OFF = 'power off'
    #: Power on if necessary, and release the brakes.
    RUN = 'set robotmode run'
    UNLOCK_PROTECTIVE_STOP = 'set unlock protective stop'
    STOP_PROGRAM = 'stop program'
    PAUSE_PROGRAM = 'pause program'
    RESUME_PROGRAM = 'resume program'


def encode_command(line: PrimaryCommand) -> bytes:
    """Return the bytes of a command."""
    return line.value.encode() + b'\n'


def encode_program(program_text: str) -> bytes:
    """Return the bytes that make the controller run a program."""
    return program_text.encode() + b'\n'
