# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The RTDE client: negotiate the recipes, then decode data packages to values.

::

    NEW --start()--> V 2 --refused--> V 1
                      |                |
                      +-------+--------+
                              v
                              v  (controller version; it bounds the frequency)
                              |
                              O  (outputs; again without the optional ones that are NOT_FOUND)
                              |
                              I  (inputs; none: skipped)
                              |
                              S  (start)
                              |
                            READY --> data packages, texts

The client opens no socket and has no clock. The owner of the socket sends ``data_to_send()``
after each ``feed()``, and gives up when ``state`` does not change for too long (the controller
answers within a second).

Real controllers send text messages at any time, and may send data before the reply to S; so a data
package counts as that reply. In each state of the handshake, up to five other unexpected packages
are tolerated.

The packages are in :mod:`~ur_cartesian_driver.protocol.rtde.rtde_packages`; the controller's side
of the connection is in `rtde_server`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import TypeAlias

from ur_cartesian_driver.motion.errors import LocalProtocolError, RemoteProtocolError
from ur_cartesian_driver.protocol.rtde.rtde_fields import (
    DataType,
    in_lower_half,
    INPUT_TYPES,
    LOWER_REGISTERS,
    OUTPUT_TYPES,
    REGISTER,
)
from ur_cartesian_driver.protocol.rtde.rtde_packages import (
    Acknowledgement,
    ControllerVersion,
    DataPackage,
    decode_reply,
    GetControllerVersion,
    IN_USE,
    LATEST_PROTOCOL_VERSION,
    NOT_FOUND,
    PackageType,
    RequestProtocolVersion,
    RtdeFrameBuffer,
    RtdeReply,
    RtdeRequest,
    RtdeTextMessage,
    SetupInputs,
    SetupInputsReply,
    SetupOutputs,
    SetupOutputsReply,
    StartStreaming,
)
from ur_cartesian_driver.protocol.rtde.rtde_recipe import Recipe, RtdeValues

#: Number of unexpected packages tolerated in each state of the handshake.
MAX_UNEXPECTED_PACKAGES = 5


class FieldsNotFound(RemoteProtocolError):
    """The controller lacks a required field."""

    def __init__(self, kind: str, names: Sequence[str], version: ControllerVersion) -> None:
        """Build the error text from the names and the controller's version."""
        super().__init__(
            f'The robot does not know the RTDE {kind} {", ".join(names)}; its software is '
            f'{version}, which may be too old.'
        )
        self.names = tuple(names)


class InputsInUse(RemoteProtocolError):
    """Another client or fieldbus writes a required input."""

    def __init__(self, names: Sequence[str]) -> None:
        """Build the error text from the names."""
        numbers = [int(match[1]) for name in names if (match := REGISTER.fullmatch(name))]
        is_lower = bool(numbers) and min(numbers) < LOWER_REGISTERS
        owner = 'the fieldbus, or another client' if is_lower else 'another client'
        super().__init__(
            f'The RTDE inputs {", ".join(names)} are in use by {owner}; end it, or disable '
            'EtherNet/IP, PROFINET or MODBUS in the installation of the robot'
            f'{_other_half(is_lower) if numbers else ""}.'
        )
        self.names = tuple(names)


def _other_half(is_lower: bool) -> str:
    if is_lower:
        return ', or take the registers from 24 on (lower_registers: false)'
    return ', or take the registers 0 to 23 (lower_registers: true) if no fieldbus has them'


class RtdeState(Enum):
    """State of the handshake; the values name the expected answers, for error texts."""

    NEW = 'start()'
    PROTOCOL_VERSION = 'the answer to the protocol version'
    CONTROLLER_VERSION = 'the version of the controller'
    OUTPUTS = 'the types of the outputs'
    INPUTS = 'the types of the inputs'
    START = 'the start of the data'
    READY = 'data'
    BROKEN = 'nothing, an error came before'


@dataclass(frozen=True, slots=True, kw_only=True)
class HandshakeDone:
    """
    The handshake is done; data follow.

    :param frequency: the requested frequency, or the controller's highest [Hz]. Protocol version 1
        does not send it, so the controller may use another one.
    :param outputs: the fields of the data packages.
    :param missing: optional outputs that this controller lacks.
    :param inputs: the fields of the packages to write, None without inputs.
    """

    protocol_version: int
    controller_version: ControllerVersion
    frequency: float
    outputs: Recipe
    missing: tuple[str, ...]
    inputs: Recipe | None


@dataclass(frozen=True, slots=True)
class DataReceived:
    """Values in the order of ``HandshakeDone.outputs``; vectors are tuples."""

    values: RtdeValues


RtdeEvent: TypeAlias = HandshakeDone | DataReceived | RtdeTextMessage


def max_frequency(version: ControllerVersion) -> float:
    """Return the rate of the controller [Hz]: 125 before software 5, 500 since."""
    return 125.0 if version.major < 5 else 500.0


class RtdeClientCodec:
    """The client's end of one RTDE connection; use it once."""

    def __init__(
        self,
        outputs: Sequence[str],
        inputs: Sequence[str] = (),
        frequency: float = 0.0,
        optional_outputs: Iterable[str] = (),
        *,
        lower_registers: bool = False,
    ) -> None:
        """
        Choose outputs and inputs.

        :param outputs: names of the outputs to stream, in order.
        :param inputs: names of the inputs to write, all in one package.
        :param frequency: rate of the packages [Hz]; 0 = the controller's highest.
        :param optional_outputs: outputs that the controller may lack.
        :param lower_registers: whether to request the registers 0 to 23 in place of 24 to 47.
        :raises LocalProtocolError: no outputs, a duplicate name, or a frequency outside 0 to
            500 Hz.
        """
        for names in (outputs, inputs):
            duplicates = sorted({name for name in names if list(names).count(name) > 1})
            if duplicates:
                raise LocalProtocolError(f'An RTDE recipe contains {", ".join(duplicates)} twice.')
        if not outputs or not 0.0 <= frequency <= 500.0:
            raise LocalProtocolError(
                f'An RTDE connection needs outputs and a frequency of 0 to 500 Hz, but '
                f'{len(outputs)} outputs and {frequency!r} Hz were requested.'
            )
        self.state = RtdeState.NEW
        self._wire_name = in_lower_half if lower_registers else str
        self._outputs, self._inputs = tuple(outputs), tuple(inputs)
        self._optional = frozenset(optional_outputs)
        self._missing: tuple[str, ...] = ()
        self._frequency = frequency
        self._version = LATEST_PROTOCOL_VERSION
        self._controller = ControllerVersion(major=0, minor=0, bugfix=0)
        self._recipe: Recipe | None = None
        self._input_recipe: Recipe | None = None
        self._unexpected = 0
        self._frames = RtdeFrameBuffer()
        self._to_send = b''

    def start(self) -> bytes:
        """
        Start the handshake and return the first bytes to send.

        :raises LocalProtocolError: the handshake has already started.
        """
        if self.state is not RtdeState.NEW:
            raise LocalProtocolError('An RtdeClientCodec serves one connection; make a new one.')
        self._send_request(
            RtdeState.PROTOCOL_VERSION, RequestProtocolVersion(version=self._version)
        )
        return self.data_to_send()

    def data_to_send(self) -> bytes:
        """Return the bytes to send and forget them."""
        data, self._to_send = self._to_send, b''
        return data

    def values_in(self, data: bytes) -> RtdeValues | None:
        """
        Return the values if the bytes are exactly one data package, as they nearly always are.

        Otherwise return None; the bytes then have to go to :meth:`feed`, which is slower.
        """
        if self._recipe is None or self.state is not RtdeState.READY or not self._frames.is_empty:
            return None
        return self._recipe.unpack_frame(data)

    def feed(self, data: bytes) -> list[RtdeEvent]:
        """
        Take bytes from the controller (``b''`` = end of stream) and return the events in them.

        :raises RemoteProtocolError: the controller violated the protocol, closed the connection
            too early, or lacks a field (:class:`FieldsNotFound`), or another client writes an
            input (:class:`InputsInUse`). The client cannot be used after that.
        :raises LocalProtocolError: this controller cannot stream at the requested frequency.
        """
        if self.state is RtdeState.BROKEN:
            raise RemoteProtocolError('The RTDE connection is broken; open a new one.')
        try:
            frames = self._frames.feed(data)
            if not data and self.state is not RtdeState.READY:
                raise RemoteProtocolError(
                    f'The robot closed the RTDE connection before it sent {self.state.value}.'
                )
            return [event for frame in frames for event in self._frame(frame)]
        except (RemoteProtocolError, LocalProtocolError):
            self.state = RtdeState.BROKEN
            raise

    def _frame(self, frame: bytes) -> list[RtdeEvent]:
        # Fast path: 500 frames a second.
        if (
            self._recipe is not None
            and frame[2] == PackageType.DATA_PACKAGE
            and (self.state is RtdeState.READY)
        ):
            return [DataReceived(self._recipe.unpack(frame[3:]))]
        reply = decode_reply(frame, self._version)
        if isinstance(reply, RtdeTextMessage):
            return [reply]
        if self.state is RtdeState.START and isinstance(reply, DataPackage):
            return [*self._ready(), *self._frame(frame)]
        match self.state, reply:
            case RtdeState.PROTOCOL_VERSION, Acknowledgement(
                type=PackageType.REQUEST_PROTOCOL_VERSION
            ):
                return self._on_protocol_version(reply)
            case RtdeState.CONTROLLER_VERSION, ControllerVersion():
                return self._on_controller_version(reply)
            case RtdeState.OUTPUTS, SetupOutputsReply():
                return self._on_outputs(reply)
            case RtdeState.INPUTS, SetupInputsReply():
                return self._on_inputs(reply)
            case RtdeState.START | RtdeState.READY, Acknowledgement(
                type=PackageType.CONTROL_PACKAGE_START
            ):
                return self._on_start(reply)
        return self._handle_unexpected(reply)

    def _send_request(self, state: RtdeState, request: RtdeRequest) -> list[RtdeEvent]:
        """Queue a request and expect its reply."""
        self.state = state
        self._unexpected = 0
        self._to_send += request.encode()
        return []

    def _handle_unexpected(self, reply: RtdeReply) -> list[RtdeEvent]:
        if self.state is not RtdeState.READY:
            self._unexpected += 1
            if self._unexpected > MAX_UNEXPECTED_PACKAGES:
                raise RemoteProtocolError(
                    f'The robot sent {self._unexpected} unexpected RTDE packages instead of '
                    f'{self.state.value}; the last one was {reply!r:.200}.'
                )
        return []

    def _on_protocol_version(self, reply: Acknowledgement) -> list[RtdeEvent]:
        if reply.accepted:
            return self._send_request(RtdeState.CONTROLLER_VERSION, GetControllerVersion())
        if self._version == 1:
            raise RemoteProtocolError(
                'The robot supports neither version 2 nor version 1 of RTDE.'
            )
        self._version = 1
        return self._send_request(RtdeState.PROTOCOL_VERSION, RequestProtocolVersion(version=1))

    def _on_controller_version(self, reply: ControllerVersion) -> list[RtdeEvent]:
        self._controller = reply
        limit = max_frequency(reply)
        if self._frequency > limit:
            raise LocalProtocolError(
                f'The robot, software {reply}, streams at {limit:g} Hz at most, but '
                f'{self._frequency:g} Hz were requested; request {limit:g} Hz, or 0 for the most.'
            )
        self._frequency = self._frequency or limit
        return self._request_outputs()

    def _request_outputs(self) -> list[RtdeEvent]:
        frequency = None if self._version == 1 else self._frequency
        return self._send_request(
            RtdeState.OUTPUTS,
            SetupOutputs(names=tuple(map(self._wire_name, self._outputs)), frequency=frequency),
        )

    def _on_outputs(self, reply: SetupOutputsReply) -> list[RtdeEvent]:
        names = self._outputs
        _check_count(reply.types, names)
        missing = [n for n, text in zip(names, reply.types, strict=True) if text == NOT_FOUND]
        needed = [name for name in missing if name not in self._optional]
        if needed or len(missing) == len(names):
            lacking = list(map(self._wire_name, needed or missing))
            raise FieldsNotFound('outputs', lacking, self._controller)
        if missing:
            self._missing += tuple(missing)
            self._outputs = tuple(name for name in names if name not in missing)
            return self._request_outputs()
        types = [
            _type(name, text, OUTPUT_TYPES.get(name))
            for name, text in zip(names, reply.types, strict=True)
        ]
        self._recipe = Recipe(names, types, reply.recipe_id)
        if not self._inputs:
            return self._send_request(RtdeState.START, StartStreaming())
        return self._send_request(
            RtdeState.INPUTS, SetupInputs(names=tuple(map(self._wire_name, self._inputs)))
        )

    def _on_inputs(self, reply: SetupInputsReply) -> list[RtdeEvent]:
        names = self._inputs
        _check_count(reply.types, names)
        answers = list(zip(names, reply.types, strict=True))
        if missing := [name for name, text in answers if text == NOT_FOUND]:
            raise FieldsNotFound('inputs', list(map(self._wire_name, missing)), self._controller)
        if taken := [name for name, text in answers if text == IN_USE]:
            raise InputsInUse(list(map(self._wire_name, taken)))
        types = [_type(name, text, INPUT_TYPES.get(name)) for name, text in answers]
        self._input_recipe = Recipe(names, types, reply.recipe_id)
        return self._send_request(RtdeState.START, StartStreaming())

    def _on_start(self, reply: Acknowledgement) -> list[RtdeEvent]:
        """Process the reply to S, which data may have overtaken."""
        if not reply.accepted:
            raise RemoteProtocolError('The robot refused to start the RTDE data.')
        return [] if self.state is RtdeState.READY else self._ready()

    def _ready(self) -> list[RtdeEvent]:
        assert self._recipe is not None
        self.state = RtdeState.READY
        return [
            HandshakeDone(
                protocol_version=self._version,
                controller_version=self._controller,
                frequency=self._frequency,
                outputs=self._recipe,
                missing=self._missing,
                inputs=self._input_recipe,
            )
        ]


def _check_count(types: Sequence[str], names: Sequence[str]) -> None:
    if len(types) != len(names):
        raise RemoteProtocolError(
            f'The robot answered with {len(types)} types for {len(names)} RTDE fields: '
            f'{", ".join(types):.200}.'
        )


def _type(name: str, text: str, expected_type: DataType | None) -> DataType:
    """
    Return the type that the controller gave for a field.

    If the text is not a type (the manufacturer's test server repeats the names), the expected type
    is assumed.
    """
    if text in DataType.__members__:
        return DataType[text]
    if expected_type is None:
        raise RemoteProtocolError(
            f'The robot gives the RTDE field {name} the unknown type {text!r:.60}.'
        )
    return expected_type
