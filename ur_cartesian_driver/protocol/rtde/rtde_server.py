# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The RTDE server: the controller's end of one connection.

The codec answers requests as a controller does and keeps the agreed recipes. Its owner has the
clock, and decides when to send data packages, and with which values::

    for data in socket: events = server.feed(data); socket.send(server.data_to_send())
    if server.streaming and server.output: socket.send(server.output.recipe.pack(values))

* A client has one output recipe, because the manufacturer's guide mentions only one, in either
  protocol version. A new recipe replaces it.
* An unknown field makes the whole recipe invalid: the reply has ``NOT_FOUND`` as its type, and id
  0, and nothing is agreed.
* An input belongs to one client, which may use it in several recipes, one for each kind of command
  that it sends; other clients receive ``IN_USE``. All connections share the set of taken names;
  ``close()`` releases the names of this connection.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
import math

from ur_cartesian_driver.motion.errors import RemoteProtocolError
from ur_cartesian_driver.protocol.rtde.rtde_fields import DataType, INPUT_TYPES, OUTPUT_TYPES
from ur_cartesian_driver.protocol.rtde.rtde_packages import (
    Acknowledgement,
    ControllerVersion,
    DataPackage,
    decode_request,
    GetControllerVersion,
    IN_USE,
    LATEST_PROTOCOL_VERSION,
    NOT_FOUND,
    PackageType,
    PauseStreaming,
    RequestProtocolVersion,
    RtdeFrameBuffer,
    RtdeReply,
    RtdeTextMessage,
    SetupInputs,
    SetupInputsReply,
    SetupOutputs,
    SetupOutputsReply,
    StartStreaming,
)
from ur_cartesian_driver.protocol.rtde.rtde_recipe import Recipe, RtdeValues

#: Largest number of input recipes of a client: their ids are bytes, and 0 means invalid.
MAX_RECIPES = 255


@dataclass(frozen=True, slots=True, kw_only=True)
class OutputStream:
    """The recipe of the outputs that a client receives, and their frequency [Hz]."""

    recipe: Recipe
    frequency: float


@dataclass(frozen=True, slots=True, kw_only=True)
class InputReceived:
    """A client wrote values, in the order of the recipe."""

    recipe: Recipe
    values: RtdeValues


class RtdeServerCodec:
    """The controller's end of one connection."""

    def __init__(
        self,
        version: ControllerVersion,
        taken_inputs: set[str],
        frequency: float = 500.0,
        output_types: Mapping[str, DataType] = OUTPUT_TYPES,
        input_types: Mapping[str, DataType] = INPUT_TYPES,
    ) -> None:
        """
        Wait for requests.

        :param taken_inputs: inputs that any client writes; shared by all connections.
        :param frequency: rate of the controller [Hz], the highest that a client can get.
        :param output_types: the outputs that this controller has.
        :param input_types: the inputs that this controller has.
        """
        self.streaming = False
        self.output: OutputStream | None = None
        self._inputs: list[Recipe] = []
        self._version = version
        # An assumption: a client that never requests a version is an old one, and uses version 1.
        self._protocol = 1
        self._taken = taken_inputs
        self._frequency = frequency
        self._output_types = output_types
        self._input_types = input_types
        self._frames = RtdeFrameBuffer()
        self._to_send = b''

    @property
    def protocol_version(self) -> int:
        """Return the agreed protocol version."""
        return self._protocol

    def data_to_send(self) -> bytes:
        """Return the replies to send and forget them."""
        data, self._to_send = self._to_send, b''
        return data

    def feed(self, data: bytes) -> list[InputReceived | RtdeTextMessage]:
        """
        Take bytes from the client (``b''`` = end of stream) and return its values and texts.

        :raises RemoteProtocolError: the client violated the protocol; close the connection.
        """
        events: list[InputReceived | RtdeTextMessage] = []
        for frame in self._frames.feed(data):
            request = decode_request(frame, self._protocol)
            if isinstance(request, RtdeTextMessage):
                events.append(request)
            elif isinstance(request, DataPackage):
                events.append(self._input(request))
            else:
                self._to_send += self._answer(request).encode()
        return events

    def close(self) -> None:
        """Release the inputs of this client."""
        self.streaming = False
        for recipe in self._inputs:
            self._taken.difference_update(recipe.names)
        self._inputs.clear()

    def _answer(
        self,
        request: RequestProtocolVersion
        | GetControllerVersion
        | SetupOutputs
        | SetupInputs
        | StartStreaming
        | PauseStreaming,
    ) -> RtdeReply:
        match request:
            case RequestProtocolVersion():
                known = 1 <= request.version <= LATEST_PROTOCOL_VERSION
                self._protocol = request.version if known else self._protocol
                return Acknowledgement(type=PackageType.REQUEST_PROTOCOL_VERSION, accepted=known)
            case GetControllerVersion():
                return self._version
            case SetupOutputs():
                return self._set_up_outputs(request)
            case SetupInputs():
                return self._set_up_inputs(request)
            case StartStreaming():
                # A robot does not start without outputs, even if the client only writes inputs.
                self.streaming = self.output is not None
                return Acknowledgement(
                    type=PackageType.CONTROL_PACKAGE_START, accepted=self.streaming
                )
            case PauseStreaming():
                self.streaming = False
                return Acknowledgement(type=PackageType.CONTROL_PACKAGE_PAUSE, accepted=True)

    def _set_up_outputs(self, request: SetupOutputs) -> SetupOutputsReply:
        types = [self._output_types.get(name) for name in request.names]
        known = [data_type for data_type in types if data_type is not None]
        valid = len(known) == len(types) > 0
        recipe_id = None if self._protocol == 1 else int(valid)
        self.output = None
        if valid:
            self.output = OutputStream(
                recipe=Recipe(request.names, known, recipe_id),
                frequency=self._granted_frequency(request.frequency),
            )
        return SetupOutputsReply(
            types=tuple(t.name if t else NOT_FOUND for t in types), recipe_id=recipe_id
        )

    def _granted_frequency(self, frequency: float | None) -> float:
        """Return the granted frequency [Hz]."""
        if frequency is None or not math.isfinite(frequency) or frequency <= 0.0:
            return self._frequency
        return min(frequency, self._frequency)

    def _set_up_inputs(self, request: SetupInputs) -> SetupInputsReply:
        texts = []
        own_names = {name for recipe in self._inputs for name in recipe.names}
        for name in request.names:
            data_type = self._input_types.get(name)
            texts.append(
                NOT_FOUND
                if data_type is None
                else IN_USE
                if name in self._taken - own_names
                else data_type.name
            )
        recipe_id = 0
        if texts and NOT_FOUND not in texts and IN_USE not in texts:
            if len(self._inputs) >= MAX_RECIPES:
                raise RemoteProtocolError(
                    f'An RTDE client set up more than {MAX_RECIPES} input recipes.'
                )
            recipe_id = len(self._inputs) + 1
            types = [self._input_types[name] for name in request.names]
            self._inputs.append(Recipe(request.names, types, recipe_id))
            self._taken.update(request.names)
        return SetupInputsReply(types=tuple(texts), recipe_id=recipe_id)

    def _input(self, data: DataPackage) -> InputReceived:
        """Decode an input package; a client with one recipe may use any id."""
        if not self._inputs:
            raise RemoteProtocolError('An RTDE client wrote inputs before it set them up.')
        number = data.recipe_id if len(self._inputs) > 1 else 1
        if not 1 <= number <= len(self._inputs):
            raise RemoteProtocolError(
                f'An RTDE client wrote recipe {number}, but it set up 1 to {len(self._inputs)}.'
            )
        recipe = self._inputs[number - 1]
        return InputReceived(recipe=recipe, values=recipe.unpack(data.payload))
