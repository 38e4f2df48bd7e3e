# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""One RTDE connection: agrees on recipes, then passes values both ways."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping, Sequence
from math import inf

from ur_cartesian_driver.motion.errors import ProtocolError
from ur_cartesian_driver.protocol.rtde.rtde_client import (
    DataReceived,
    HandshakeDone,
    RtdeClientCodec,
    RtdeEvent,
)
from ur_cartesian_driver.protocol.rtde.rtde_packages import ControllerVersion, RtdeTextMessage
from ur_cartesian_driver.protocol.rtde.rtde_recipe import Recipe, RtdeValue, RtdeValues
from ur_cartesian_driver.robot.transport import dial, ignore, TcpConnection

#: Longest time between a request of the handshake and its answer [s].
ANSWER_TIMEOUT = 2.0
#: Silence of the stream after which the robot is lost [s].
SILENCE_TIMEOUT = 1.0
#: Text messages up to this level are warnings or errors.
WARNING_LEVEL = 2


class RtdeConnection:
    """A connection, used once and from one event loop: open it, wait for its end, close it."""

    def __init__(
        self,
        client: RtdeClientCodec,
        on_values: Callable[[Sequence[str], RtdeValues], None],
        *,
        silence: float = SILENCE_TIMEOUT,
        on_text: Callable[[str], None] = ignore,
    ) -> None:
        """
        Prepare a connection.

        :param client: chooses the streamed and the written fields.
        :param on_values: called for each packet with the names and values of its fields, possibly
            before :meth:`open` returns.
        :param silence: the longest pause between two packets [s]; after that the robot is lost.
        :param on_text: called with each warning and error that the controller sends.
        """
        self._client = client
        self._on_values = on_values
        self._silence, self._on_text = silence, on_text
        self._names: tuple[str, ...] = ()
        self._inputs: Recipe | None = None
        #: Whether the peer has sent valid RTDE data.
        self._has_answered = False
        self._last_packet = self._last_request = 0.0
        #: Shortest time between a request of the handshake and its answer [s].
        self.round_trip = inf
        self._version: ControllerVersion | None = None
        #: The timeout of the handshake; each of its requests sets a new end.
        self._patience = asyncio.timeout(None)
        #: Set when the handshake is done, or the connection is closed.
        self._answered = asyncio.Event()
        self._closed: asyncio.Future[str] = asyncio.get_running_loop().create_future()
        self._connection = TcpConnection(self._on_data, self._on_closed)

    @property
    def local_address(self) -> str:
        """Return our address on the connection to the robot."""
        return self._connection.local_address

    @property
    def peer_address(self) -> str:
        """Return the robot's IP address, even if a host name was given."""
        return self._connection.peer_address

    async def open(self, host: str, port: int) -> ControllerVersion:
        """
        Connect, agree on the recipes, and return the version of the controller's software.

        :raises OSError: nothing answers, or the other side is not a robot; the text names host and
            port.
        """
        await dial(self._connection, host, port)
        try:
            async with self._patience:
                self._send_request(self._client.start())
                await self._answered.wait()
        except TimeoutError:
            raise OSError(
                f'{host} port {port} does not answer as an RTDE server; is it a robot?'
            ) from None
        if self._version is None:
            raise OSError(f'{host} port {port} (RTDE): {self._closed.result()}')
        self._last_packet = asyncio.get_running_loop().time()
        return self._version

    def write(self, values: Mapping[str, RtdeValue]) -> None:
        """Write the inputs of the codec; ``values`` has each by its name."""
        assert self._inputs is not None, 'The codec has no inputs.'
        self._connection.send(self._inputs.pack_named(values))

    async def ended(self) -> str:
        """Wait for the end of the connection or of its data; return the reason as a clause."""
        loop = asyncio.get_running_loop()
        while loop.time() - self._last_packet < self._silence:
            await asyncio.wait({self._closed}, timeout=self._silence / 10.0)
            if self._closed.done():
                return self._closed.result()
        return f'the robot sent nothing for {self._silence:g} s'

    def close(self) -> None:
        """Close the connection."""
        self._connection.close()

    def abort(self, reason: str) -> None:
        """Close the connection at once; :meth:`ended` returns the reason."""
        self._connection.abort(reason)

    def _on_data(self, data: bytes) -> None:
        try:
            values = self._client.values_in(data)
            if values is not None:
                self._take_values(values)
                return
            if self._version is None:
                now = asyncio.get_running_loop().time()
                self.round_trip = min(self.round_trip, now - self._last_request)
            for event in self._client.feed(data):
                self._take(event)
            self._has_answered = True
        except ProtocolError as error:
            reason = str(error)
            if not self._has_answered:  # it may be another of the robot's interfaces
                reason = f'{reason.rstrip(".")}; is this the RTDE port (30004)?'
            self.abort(reason)
            return
        self._send_request(self._client.data_to_send())

    def _send_request(self, data: bytes) -> None:
        """Send the next request of the handshake, if any."""
        if data:
            self._last_request = asyncio.get_running_loop().time()
            if not self._patience.expired():
                self._patience.reschedule(self._last_request + ANSWER_TIMEOUT)
            self._connection.send(data)

    def _take(self, event: RtdeEvent) -> None:
        if isinstance(event, DataReceived):
            self._take_values(event.values)
        elif isinstance(event, HandshakeDone):
            self._names, self._inputs = event.outputs.names, event.inputs
            self._version = event.controller_version
            self._answered.set()
        elif isinstance(event, RtdeTextMessage) and event.level <= WARNING_LEVEL:
            self._on_text(event.text)

    def _take_values(self, values: RtdeValues) -> None:
        self._on_values(self._names, values)  # first, because it may send a CANCEL
        self._last_packet = asyncio.get_running_loop().time()

    def _on_closed(self, reason: str) -> None:
        self._closed.set_result(reason)
        self._answered.set()
