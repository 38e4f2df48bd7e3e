# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
RTDE packages: the messages between client and controller, as bytes.

Frame, big-endian: ``uint16`` size of the whole frame, ``uint8`` type, payload.

====  ==================  ==========================================  ===========================
type  name                client to controller                        controller to client
====  ==================  ==========================================  ===========================
V 86  protocol version    u16 version                                 u8 accepted
v     controller version  (nothing)                                   4 x u32: major, minor,
118                                                                   bugfix, build
O 79  set up outputs      v2: f64 frequency [Hz], names;              v2: u8 recipe id, types;
                          v1: names                                   v1: types
I 73  set up inputs       names                                       u8 recipe id, types
S 83  start               (nothing)                                   u8 accepted
P 80  pause               (nothing)                                   u8 accepted
U 85  data                u8 recipe id, values                        v2: u8 recipe id, values;
                                                                      v1: values
M 77  text message        v2: u8 length, text, u8 length, source, u8 level;  v1: u8 level, text
====  ==================  ==========================================  ===========================

A recipe lists the fields of a data package in their order: O or I gives their names, the reply
their types. Names and types are texts separated by commas. Instead of a type the controller writes
``NOT_FOUND`` for a field that it lacks, or ``IN_USE`` for an input that another client already
writes; then the recipe id is 0.

The manufacturer's client library relies on the controller to send a frame in one piece of less
than 4092 bytes, to answer V and v within a second, and to send no text message between the reply
to the first S and P.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
import re
import struct
from typing import ClassVar, TypeAlias

from ur_cartesian_driver.motion.errors import LocalProtocolError, RemoteProtocolError
from ur_cartesian_driver.protocol.framing import decode_text, FrameBuffer, hex_text


class PackageType(IntEnum):
    """The type byte of a frame: a letter of the table above."""

    REQUEST_PROTOCOL_VERSION = ord('V')
    GET_URCONTROL_VERSION = ord('v')
    TEXT_MESSAGE = ord('M')
    DATA_PACKAGE = ord('U')
    CONTROL_PACKAGE_SETUP_OUTPUTS = ord('O')
    CONTROL_PACKAGE_SETUP_INPUTS = ord('I')
    CONTROL_PACKAGE_START = ord('S')
    CONTROL_PACKAGE_PAUSE = ord('P')


NOT_FOUND = 'NOT_FOUND'
IN_USE = 'IN_USE'
LATEST_PROTOCOL_VERSION = 2

HEADER = struct.Struct('>HB')
_VERSION = struct.Struct('>4I')


class RtdeFrameBuffer(FrameBuffer):
    """Cuts an RTDE stream into frames; the size field limits a frame to 65535 bytes."""

    def __init__(self) -> None:
        """Start empty."""
        super().__init__(size_width=2, min_size=3, max_size=65535, what='RTDE package')


class _Package:
    """Base class of packages with a fixed type."""

    __slots__ = ()
    type: ClassVar[PackageType]

    def payload(self) -> bytes:
        """Return the bytes after the type."""
        return b''

    def encode(self) -> bytes:
        """Return the frame."""
        return encode_frame(self.type, self.payload())


@dataclass(frozen=True, slots=True, kw_only=True)
class RequestProtocolVersion(_Package):
    """Client: requests a protocol version."""

    type: ClassVar = PackageType.REQUEST_PROTOCOL_VERSION
    version: int

    def payload(self) -> bytes:
        """Return the bytes after the type."""
        return _pack_checked('>H', self.version)


@dataclass(frozen=True, slots=True, kw_only=True)
class GetControllerVersion(_Package):
    """Client: asks for the controller's software version."""

    type: ClassVar = PackageType.GET_URCONTROL_VERSION


@dataclass(frozen=True, slots=True, kw_only=True)
class SetupOutputs(_Package):
    """Client: requests outputs by name, at a frequency [Hz], which is None in version 1."""

    type: ClassVar = PackageType.CONTROL_PACKAGE_SETUP_OUTPUTS
    names: tuple[str, ...]
    frequency: float | None = None

    def payload(self) -> bytes:
        """Return the bytes after the type."""
        head = b'' if self.frequency is None else _pack_checked('>d', self.frequency)
        return head + encode_names(self.names)


@dataclass(frozen=True, slots=True, kw_only=True)
class SetupInputs(_Package):
    """Client: names the inputs of the controller that it will write."""

    type: ClassVar = PackageType.CONTROL_PACKAGE_SETUP_INPUTS
    names: tuple[str, ...]

    def payload(self) -> bytes:
        """Return the bytes after the type."""
        return encode_names(self.names)


@dataclass(frozen=True, slots=True, kw_only=True)
class StartStreaming(_Package):
    """Client: starts the data packages of the controller."""

    type: ClassVar = PackageType.CONTROL_PACKAGE_START


@dataclass(frozen=True, slots=True, kw_only=True)
class PauseStreaming(_Package):
    """Client: pauses the data packages of the controller."""

    type: ClassVar = PackageType.CONTROL_PACKAGE_PAUSE


@dataclass(frozen=True, slots=True, kw_only=True)
class DataPackage:
    """Either side: values, to be unpacked with a recipe; the payload includes the recipe id."""

    payload: bytes

    @property
    def recipe_id(self) -> int:
        """Return the first byte: the recipe id, except in outputs of version 1."""
        return self.payload[0]

    def encode(self) -> bytes:
        """Return the frame."""
        return encode_frame(PackageType.DATA_PACKAGE, self.payload)


@dataclass(frozen=True, slots=True, kw_only=True)
class RtdeTextMessage:
    """
    Either side: a text for the log.

    :param level: 0 exception, 1 error, 2 warning, 3 info.
    """

    text: str
    source: str = ''
    level: int = 3

    def encode(self, version: int = LATEST_PROTOCOL_VERSION) -> bytes:
        """Return the frame."""
        text, source = self.text.encode(), self.source.encode()
        level = _pack_checked('>B', self.level)
        if version == 1:
            return encode_frame(PackageType.TEXT_MESSAGE, level + text)
        if max(len(text), len(source)) > 255:
            raise LocalProtocolError(
                f'text has {len(text)} and source {len(source)} bytes, but an RTDE text message '
                'holds at most 255 of each.'
            )
        payload = bytes([len(text)]) + text + bytes([len(source)]) + source + level
        return encode_frame(PackageType.TEXT_MESSAGE, payload)


@dataclass(frozen=True, slots=True, kw_only=True)
class Acknowledgement:
    """Controller: whether V, S or P was accepted."""

    type: PackageType
    accepted: bool

    def encode(self) -> bytes:
        """Return the frame."""
        return encode_frame(self.type, bytes([self.accepted]))


@dataclass(frozen=True, slots=True, kw_only=True)
class ControllerVersion(_Package):
    """Controller: its software version."""

    type: ClassVar = PackageType.GET_URCONTROL_VERSION
    major: int
    minor: int
    bugfix: int
    build: int = 0

    def payload(self) -> bytes:
        """Return the bytes after the type."""
        return _pack_checked('>4I', self.major, self.minor, self.bugfix, self.build)

    def __str__(self) -> str:
        """Return the version with dots."""
        return f'{self.major}.{self.minor}.{self.bugfix}.{self.build}'

    @classmethod
    def parse(cls, text: str) -> ControllerVersion:
        """
        Return the first version in a text like ``URSoftware 5.21.0.1``; missing numbers are 0.

        :raises ValueError: the text has no version.
        """
        found = re.search(r'(\d+)\.(\d+)(?:\.(\d+))?(?:\.(\d+))?', text)
        if found is None:
            raise ValueError(f'{text!r} has no version like 5.21.0')
        major, minor, bugfix, build = (int(number or 0) for number in found.groups())
        return cls(major=major, minor=minor, bugfix=bugfix, build=build)

    @property
    def release(self) -> tuple[int, int, int]:
        """Major, minor and bugfix."""
        return self.major, self.minor, self.bugfix


@dataclass(frozen=True, slots=True, kw_only=True)
class SetupOutputsReply(_Package):
    """Controller: types of the requested outputs; the recipe id is None in version 1."""

    type: ClassVar = PackageType.CONTROL_PACKAGE_SETUP_OUTPUTS
    types: tuple[str, ...]
    recipe_id: int | None = 1

    def payload(self) -> bytes:
        """Return the bytes after the type."""
        head = b'' if self.recipe_id is None else _pack_checked('>B', self.recipe_id)
        return head + encode_names(self.types)


@dataclass(frozen=True, slots=True, kw_only=True)
class SetupInputsReply(_Package):
    """Controller: types of the named inputs."""

    type: ClassVar = PackageType.CONTROL_PACKAGE_SETUP_INPUTS
    types: tuple[str, ...]
    recipe_id: int = 1

    def payload(self) -> bytes:
        """Return the bytes after the type."""
        return _pack_checked('>B', self.recipe_id) + encode_names(self.types)


RtdeRequest: TypeAlias = (
    RequestProtocolVersion
    | GetControllerVersion
    | SetupOutputs
    | SetupInputs
    | StartStreaming
    | PauseStreaming
    | DataPackage
    | RtdeTextMessage
)
RtdeReply: TypeAlias = (
    Acknowledgement
    | ControllerVersion
    | SetupOutputsReply
    | SetupInputsReply
    | DataPackage
    | RtdeTextMessage
)


def encode_frame(package_type: PackageType, payload: bytes = b'') -> bytes:
    """
    Return a whole frame.

    :raises LocalProtocolError: the frame would be longer than 65535 bytes.
    """
    size = HEADER.size + len(payload)
    if size > 65535:
        raise LocalProtocolError(
            f'An RTDE package of {size} bytes cannot be sent, the maximum is 65535; request fewer '
            'fields.'
        )
    return HEADER.pack(size, package_type) + payload


def _pack_checked(layout: str, *values: float) -> bytes:
    try:
        return struct.pack(layout, *values)
    except (struct.error, OverflowError) as error:
        raise LocalProtocolError(f'{values} cannot be sent in an RTDE package: {error}.') from None


def encode_names(names: Sequence[str]) -> bytes:
    """
    Return names as bytes, separated by commas.

    :raises LocalProtocolError: a name is empty or contains a comma.
    """
    for name in names:
        if not name or ',' in name:
            raise LocalProtocolError(f'{name!r} is not the name of an RTDE field.')
    return ','.join(names).encode()


def decode_request(data: bytes, version: int = LATEST_PROTOCOL_VERSION) -> RtdeRequest:
    """
    Return the request in one frame of a client.

    :param version: the agreed protocol version.
    :raises RemoteProtocolError: the type or the length is impossible.
    """
    kind, payload = _split_frame(data)
    match kind:
        case PackageType.REQUEST_PROTOCOL_VERSION:
            return RequestProtocolVersion(
                version=int.from_bytes(_require_size(data, payload, 2), 'big')
            )
        case PackageType.CONTROL_PACKAGE_SETUP_OUTPUTS if version == 1:
            return SetupOutputs(names=_split_names(payload))
        case PackageType.CONTROL_PACKAGE_SETUP_OUTPUTS:
            (frequency,) = struct.unpack('>d', _require_size(data, payload[:8], 8))
            return SetupOutputs(names=_split_names(payload[8:]), frequency=frequency)
        case PackageType.CONTROL_PACKAGE_SETUP_INPUTS:
            return SetupInputs(names=_split_names(payload))
        case PackageType.DATA_PACKAGE:
            return DataPackage(payload=_require_min_size(data, payload, 1))
        case PackageType.TEXT_MESSAGE:
            # Clients send the same format in both protocol versions.
            return _text_message(data, payload, LATEST_PROTOCOL_VERSION)
    _require_size(data, payload, 0)
    if kind is PackageType.GET_URCONTROL_VERSION:
        return GetControllerVersion()
    return StartStreaming() if kind is PackageType.CONTROL_PACKAGE_START else PauseStreaming()


def decode_reply(data: bytes, version: int = LATEST_PROTOCOL_VERSION) -> RtdeReply:
    """
    Return the reply in one frame of a controller.

    :param version: the agreed protocol version.
    :raises RemoteProtocolError: the type or the length is impossible.
    """
    kind, payload = _split_frame(data)
    match kind:
        case PackageType.DATA_PACKAGE:
            return DataPackage(payload=_require_min_size(data, payload, 1))
        case PackageType.GET_URCONTROL_VERSION:
            major, minor, bugfix, build = _VERSION.unpack(_require_size(data, payload, 16))
            return ControllerVersion(major=major, minor=minor, bugfix=bugfix, build=build)
        case PackageType.CONTROL_PACKAGE_SETUP_OUTPUTS if version == 1:
            return SetupOutputsReply(types=_split_names(payload), recipe_id=None)
        case PackageType.CONTROL_PACKAGE_SETUP_OUTPUTS:
            _require_min_size(data, payload, 1)
            return SetupOutputsReply(types=_split_names(payload[1:]), recipe_id=payload[0])
        case PackageType.CONTROL_PACKAGE_SETUP_INPUTS:
            _require_min_size(data, payload, 1)
            return SetupInputsReply(types=_split_names(payload[1:]), recipe_id=payload[0])
        case PackageType.TEXT_MESSAGE:
            return _text_message(data, payload, version)
    return Acknowledgement(type=kind, accepted=_require_size(data, payload, 1) != b'\0')


def _split_frame(data: bytes) -> tuple[PackageType, bytes]:
    if len(data) < HEADER.size:
        raise RemoteProtocolError(f'An RTDE package is too short: {hex_text(data)}.')
    try:
        return PackageType(data[2]), data[3:]
    except ValueError:
        raise RemoteProtocolError(
            f'{data[2]} is not an RTDE package type: {hex_text(data)}.'
        ) from None


def _split_names(payload: bytes) -> tuple[str, ...]:
    """Return the items of a list; some clients (ur_rtde) end it with a comma."""
    items = decode_text(payload).removesuffix(',')
    return tuple(items.split(',')) if items else ()


def _require_size(data: bytes, payload: bytes, size: int) -> bytes:
    if len(payload) != size:
        raise RemoteProtocolError(f'An RTDE package has the wrong length: {hex_text(data)}.')
    return payload


def _require_min_size(data: bytes, payload: bytes, size: int) -> bytes:
    if len(payload) < size:
        raise RemoteProtocolError(f'An RTDE package is too short: {hex_text(data)}.')
    return payload


def _text_message(data: bytes, payload: bytes, version: int) -> RtdeTextMessage:
    """Return the text message; if its lengths do not fit version 2, it is read as version 1."""
    _require_min_size(data, payload, 1)
    end = 1 + payload[0]
    source_end = end + 1 + payload[end] if end < len(payload) else len(payload)
    if version == 1 or source_end >= len(payload):
        return RtdeTextMessage(text=decode_text(payload[1:]), level=payload[0])
    return RtdeTextMessage(
        text=decode_text(payload[1:end]),
        source=decode_text(payload[end + 1 : source_end]),
        level=payload[source_end],
    )
