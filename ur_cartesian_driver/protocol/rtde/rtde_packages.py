# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
RTDE packages: what client and controller say to each other, as bytes.

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

Names and types are text separated by commas. Instead of a type the controller writes
``NOT_FOUND``, or, for inputs, ``IN_USE`` when another client writes it already; the recipe id is 0
then.

Obligations of a controller towards the manufacturer's library: send a frame in one piece and keep
it below 4092 bytes; answer V and v within a second; send no text message between the reply to the
first S and P.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from operator import itemgetter
import struct
from typing import Any, cast, TypeAlias

from ur_cartesian_driver.motion.errors import LocalProtocolError, RemoteProtocolError
from ur_cartesian_driver.protocol.framing import decode_text, FrameBuffer, hex_text
from ur_cartesian_driver.protocol.rtde.rtde_fields import DataType


class PackageType(IntEnum):
    """The type byte; the members' values are the letters of the table."""

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

_HEADER = struct.Struct('>HB')
_VERSION = struct.Struct('>4I')

#: A number, a flag, or a vector of numbers.
RtdeValue: TypeAlias = int | float | tuple[float, ...]
#: Values in the order of a recipe.
RtdeValues: TypeAlias = tuple[RtdeValue, ...]


class RtdeFrameBuffer(FrameBuffer):
    """Cuts an RTDE stream into frames; the size field bounds them to 65535 bytes."""

    def __init__(self) -> None:
        """Start empty."""
        super().__init__(size_width=2, min_size=3, max_size=65535, what='RTDE package')


class Recipe:
    """
    An agreed list of fields, with their bytes.

    ``pack`` and ``unpack`` go through one precompiled struct, because they run 500 times a second.
    """

    __slots__ = (
        '_frame',
        '_head',
        '_lengths',
        '_pick',
        '_size',
        '_struct',
        'names',
        'recipe_id',
        'types',
    )

    def __init__(
        self, names: Sequence[str], types: Sequence[DataType], recipe_id: int | None = 1
    ) -> None:
        """
        Compile the recipe.

        :param recipe_id: the byte before the values; None = there is none (outputs of version 1).
        :raises ValueError: there are not as many types as names, or no names.
        """
        if len(names) != len(types) or not names:
            raise ValueError(f'{len(names)} names and {len(types)} types make no RTDE recipe.')
        self.names = tuple(names)
        self.types = tuple(types)
        self.recipe_id = recipe_id
        codes = ''.join(data_type.codes for data_type in types)
        head = '' if recipe_id is None else 'x'
        self._struct = struct.Struct(f'>{head}{codes}')
        self._frame = struct.Struct(f'>HB{"" if recipe_id is None else "B"}{codes}')
        self._size = self._struct.size
        self._head = _HEADER.pack(self._frame.size, PackageType.DATA_PACKAGE)
        self._lengths = tuple(data_type.length for data_type in types)
        keys: list[int | slice] = []
        start = 0
        for length in self._lengths:
            keys.append(start if length == 1 else slice(start, start + length))
            start += length
        # With a single key itemgetter gives the bare item, so that case is left to unpack().
        self._pick = itemgetter(*keys) if len(keys) > 1 else None

    def unpack(self, payload: bytes) -> RtdeValues:
        """
        Return the values of a data package without its first three bytes; vectors are tuples.

        The recipe id is not looked at: controllers exist that send another one than agreed.

        :raises RemoteProtocolError: the package has another size than the recipe.
        """
        if len(payload) != self._size:
            raise RemoteProtocolError(
                f'An RTDE data package of this recipe has {self._size} bytes, but {len(payload)} '
                f'came: {hex_text(payload)}.'
            )
        flat = self._struct.unpack(payload)
        if self._pick is None:
            return flat if len(flat) == 1 else (flat,)
        return cast(RtdeValues, self._pick(flat))

    def unpack_frame(self, data: bytes) -> RtdeValues | None:
        """Return the values of a whole frame; None where the bytes are anything else."""
        if len(data) != self._frame.size or self._pick is None or data[:3] != self._head:
            return None
        return cast(RtdeValues, self._pick(self._struct.unpack_from(data, _HEADER.size)))

    def pack(self, values: Sequence[RtdeValue]) -> bytes:
        """
        Return the whole frame of a data package.

        :param values: in the order of the recipe; vectors as tuples.
        :raises LocalProtocolError: number, length or range of the values is wrong.
        """
        flat: list[Any] = [] if self.recipe_id is None else [self.recipe_id]
        try:
            for value, length in zip(values, self._lengths, strict=True):
                if length == 1:
                    flat.append(value)
                # A number has no length: that is one of the errors below.
                elif len(value) == length:  # type: ignore[arg-type]
                    flat.extend(value)  # type: ignore[arg-type]
                else:
                    raise self._packing_error(values)
            return self._frame.pack(self._frame.size, PackageType.DATA_PACKAGE, *flat)
        except (struct.error, OverflowError, TypeError, ValueError):
            raise self._packing_error(values) from None

    def pack_named(self, values: Mapping[str, RtdeValue]) -> bytes:
        """
        Return the whole frame of a data package with values by name.

        :raises LocalProtocolError: a value is missing, surplus or wrong.
        """
        if len(values) != len(self.names) or not all(name in values for name in self.names):
            missing = ', '.join(set(self.names) - set(values)) or 'none'
            surplus = ', '.join(set(values) - set(self.names)) or 'none'
            raise LocalProtocolError(
                f'An RTDE package needs all values of its recipe; missing: {missing}, '
                f'surplus: {surplus}.'
            )
        return self.pack([values[name] for name in self.names])

    def named(self, values: RtdeValues) -> dict[str, RtdeValue]:
        """Return values by name."""
        return dict(zip(self.names, values, strict=True))

    def zeros(self) -> RtdeValues:
        """Return zero for each field."""
        return tuple(0 if t.length == 1 else (0,) * t.length for t in self.types)

    def index(self, name: str) -> int:
        """Return the place of a field in the values; ValueError if it is not in the recipe."""
        return self.names.index(name)

    def __eq__(self, other: object) -> bool:
        """Compare names, types and id."""
        return isinstance(other, Recipe) and self._key() == other._key()

    def __hash__(self) -> int:
        """Hash names, types and id."""
        return hash(self._key())

    def __repr__(self) -> str:
        """Return the recipe as text."""
        fields = ', '.join(f'{n}: {t.name}' for n, t in zip(self.names, self.types, strict=True))
        return f'Recipe({self.recipe_id}: {fields})'

    def _key(self) -> tuple[object, ...]:
        return self.names, self.types, self.recipe_id

    def _packing_error(self, values: Sequence[RtdeValue]) -> LocalProtocolError:
        """Return the error that names the value which cannot be packed."""
        if len(values) != len(self.names):
            return LocalProtocolError(
                f'{len(values)} values do not fill an RTDE recipe of {len(self.names)} fields.'
            )
        problems = [
            f'{name} is {value!r}, which is no {data_type.name}'
            for name, data_type, value in zip(self.names, self.types, values, strict=True)
            if not _fits_type(data_type, value)
        ]
        return LocalProtocolError('; '.join(problems) + '.')


def _fits_type(data_type: DataType, value: Any) -> bool:
    try:
        struct.pack(f'>{data_type.codes}', *(value if data_type.length > 1 else (value,)))
    except (struct.error, OverflowError, TypeError):
        return False
    return True


@dataclass(frozen=True, slots=True, kw_only=True)
class RequestProtocolVersion:
    """Client: let us speak this version."""

    version: int

    def encode(self) -> bytes:
        """Return the frame."""
        return encode_frame(
            PackageType.REQUEST_PROTOCOL_VERSION, _pack_checked('>H', self.version)
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class GetControllerVersion:
    """Client: which software is this."""

    def encode(self) -> bytes:
        """Return the frame."""
        return encode_frame(PackageType.GET_URCONTROL_VERSION)


@dataclass(frozen=True, slots=True, kw_only=True)
class SetupOutputs:
    """Client: stream these; the frequency [Hz] is None in version 1."""

    names: tuple[str, ...]
    frequency: float | None = None

    def encode(self) -> bytes:
        """Return the frame."""
        head = b'' if self.frequency is None else _pack_checked('>d', self.frequency)
        return encode_frame(
            PackageType.CONTROL_PACKAGE_SETUP_OUTPUTS, head + encode_names(self.names)
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class SetupInputs:
    """Client: these are what I shall write."""

    names: tuple[str, ...]

    def encode(self) -> bytes:
        """Return the frame."""
        return encode_frame(PackageType.CONTROL_PACKAGE_SETUP_INPUTS, encode_names(self.names))


@dataclass(frozen=True, slots=True, kw_only=True)
class StartStreaming:
    """Client: start streaming."""

    def encode(self) -> bytes:
        """Return the frame."""
        return encode_frame(PackageType.CONTROL_PACKAGE_START)


@dataclass(frozen=True, slots=True, kw_only=True)
class PauseStreaming:
    """Client: pause streaming."""

    def encode(self) -> bytes:
        """Return the frame."""
        return encode_frame(PackageType.CONTROL_PACKAGE_PAUSE)


@dataclass(frozen=True, slots=True, kw_only=True)
class DataPackage:
    """Either side: values, to be read with a recipe; the payload includes a recipe id."""

    payload: bytes

    @property
    def recipe_id(self) -> int:
        """Return the first byte, which is the recipe id but in outputs of version 1."""
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
        if version == 1:
            return encode_frame(PackageType.TEXT_MESSAGE, _pack_checked('>B', self.level) + text)
        if max(len(text), len(source)) > 255:
            raise LocalProtocolError(
                f'text has {len(text)} and source {len(source)} bytes, but an RTDE text message '
                'holds at most 255 of each.'
            )
        return encode_frame(
            PackageType.TEXT_MESSAGE,
            bytes([len(text)])
            + text
            + bytes([len(source)])
            + source
            + _pack_checked('>B', self.level),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Acknowledgement:
    """Controller: whether V, S or P was accepted."""

    type: PackageType
    accepted: bool

    def encode(self) -> bytes:
        """Return the frame."""
        return encode_frame(self.type, bytes([self.accepted]))


@dataclass(frozen=True, slots=True, kw_only=True)
class ControllerVersion:
    """Controller: my software."""

    major: int
    minor: int
    bugfix: int
    build: int = 0

    def encode(self) -> bytes:
        """Return the frame."""
        return encode_frame(
            PackageType.GET_URCONTROL_VERSION,
            _pack_checked('>4I', self.major, self.minor, self.bugfix, self.build),
        )

    def __str__(self) -> str:
        """Return the version with dots."""
        return f'{self.major}.{self.minor}.{self.bugfix}.{self.build}'


@dataclass(frozen=True, slots=True, kw_only=True)
class SetupOutputsReply:
    """Controller: types of the outputs as text; the recipe id is None in version 1."""

    types: tuple[str, ...]
    recipe_id: int | None = 1

    def encode(self) -> bytes:
        """Return the frame."""
        head = b'' if self.recipe_id is None else _pack_checked('>B', self.recipe_id)
        return encode_frame(
            PackageType.CONTROL_PACKAGE_SETUP_OUTPUTS, head + encode_names(self.types)
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class SetupInputsReply:
    """Controller: types of the inputs as text."""

    types: tuple[str, ...]
    recipe_id: int = 1

    def encode(self) -> bytes:
        """Return the frame."""
        return encode_frame(
            PackageType.CONTROL_PACKAGE_SETUP_INPUTS,
            _pack_checked('>B', self.recipe_id) + encode_names(self.types),
        )


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

    :raises LocalProtocolError: it would be longer than 65535 bytes.
    """
    size = _HEADER.size + len(payload)
    if size > 65535:
        raise LocalProtocolError(
            f'An RTDE package of {size} bytes cannot be sent, 65535 are possible; ask for fewer '
            'fields.'
        )
    return _HEADER.pack(size, package_type) + payload


def _pack_checked(layout: str, *values: float) -> bytes:
    try:
        return struct.pack(layout, *values)
    except (struct.error, OverflowError) as error:
        raise LocalProtocolError(f'{values} cannot be sent in an RTDE package: {error}.') from None


def encode_names(names: Sequence[str]) -> bytes:
    """
    Return names as the wire has them.

    :raises LocalProtocolError: a name is empty or contains a comma.
    """
    for name in names:
        if not name or ',' in name:
            raise LocalProtocolError(f'{name!r} is not the name of an RTDE field.')
    return ','.join(names).encode()


def decode_request(data: bytes, version: int = LATEST_PROTOCOL_VERSION) -> RtdeRequest:
    """
    Return what a client said in one frame.

    :param version: the protocol version that was agreed.
    :raises RemoteProtocolError: type or length is impossible.
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
            return _text_message(data, payload, version)
    _require_size(data, payload, 0)
    if kind is PackageType.GET_URCONTROL_VERSION:
        return GetControllerVersion()
    return StartStreaming() if kind is PackageType.CONTROL_PACKAGE_START else PauseStreaming()


def decode_reply(data: bytes, version: int = LATEST_PROTOCOL_VERSION) -> RtdeReply:
    """
    Return what a controller said in one frame.

    :param version: the protocol version that was agreed.
    :raises RemoteProtocolError: type or length is impossible.
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
    if len(data) < _HEADER.size:
        raise RemoteProtocolError(f'An RTDE package is too short: {hex_text(data)}.')
    try:
        return PackageType(data[2]), data[3:]
    except ValueError:
        raise RemoteProtocolError(
            f'{data[2]} is not a type of RTDE package: {hex_text(data)}.'
        ) from None


def _split_names(payload: bytes) -> tuple[str, ...]:
    """Return the items of a list; clients in use (ur_rtde) end it with a comma."""
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
    _require_min_size(data, payload, 1)
    if version == 1:
        return RtdeTextMessage(text=decode_text(payload[1:]), level=payload[0])
    end = 1 + payload[0]
    _require_min_size(data, payload, end + 2)
    source_end = end + 1 + payload[end]
    _require_min_size(data, payload, source_end + 1)
    return RtdeTextMessage(
        text=decode_text(payload[1:end]),
        source=decode_text(payload[end + 1 : source_end]),
        level=payload[source_end],
    )
