# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Listening on a TCP port for any number of clients of one kind.

What is said is decided by a session, which knows no sockets: bytes in, bytes out. A client that
does not read what it gets is dropped, so that it can stall neither the cycle nor the others.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
import logging
from typing import cast, Generic, Protocol, TypeVar

from ur_cartesian_driver.motion.errors import ProtocolError

_log = logging.getLogger(__name__)

#: Bytes that a client may leave unread beside what the kernel holds.
MOST_UNREAD = 1_000_000
#: From here on a client is spared states: many send their scripts and never read.
MANY_UNREAD = 16_384


class Hangup(Exception):
    """Raised by a session to end its connection; what it carries is sent before."""

    def __init__(self, farewell: bytes = b'') -> None:
        """Take the last bytes to send."""
        super().__init__(farewell)
        self.farewell = farewell


class Session(Protocol):
    """One client's conversation."""

    def open(self) -> bytes:
        """Return what is sent unasked at the start."""

    def feed(self, data: bytes) -> bytes:
        """
        Take what came from the client, return the answer.

        :raises ProtocolError: the client talks nonsense; it is disconnected.
        :raises Hangup: the conversation is over.
        """

    def close(self) -> None:
        """Give back what the client held."""


S = TypeVar('S', bound=Session)


class _Connection(asyncio.Protocol, Generic[S]):
    """Moves bytes between a transport and a session."""

    def __init__(self, server: TcpServer[S]) -> None:
        self._server = server
        self.session = server.make_session()
        self._transport: asyncio.Transport | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast(asyncio.Transport, transport)
        self._server.connections.add(self)
        if self._server.closing:  # it called at the last moment
            self._transport.abort()
            return
        self.write(self.session.open())

    def data_received(self, data: bytes) -> None:
        try:
            self.write(self.session.feed(data))
        except Hangup as hangup:
            self.write(hangup.farewell)
            self._hang_up()
        except ProtocolError as error:
            _log.warning('%s client disconnected: %s', self._server.name, error)
            self._hang_up()

    def _hang_up(self) -> None:
        if self._transport is not None:
            self._transport.close()

    def write(self, data: bytes) -> None:
        """Send one piece; drop a client that does not read."""
        if not data or self._transport is None or self._transport.is_closing():
            return
        if self._transport.get_write_buffer_size() > MOST_UNREAD:
            _log.warning('%s client dropped: it does not read', self._server.name)
            self._transport.abort()
            return
        self._transport.write(data)

    def write_state(self, data: bytes) -> None:
        """Send a piece that the next of its kind replaces, if the client has read the others."""
        if self._transport is not None and (
                self._transport.get_write_buffer_size() < MANY_UNREAD):
            self.write(data)

    def abort(self) -> None:
        """Disconnect at once."""
        if self._transport is not None:
            self._transport.abort()

    def connection_lost(self, exc: Exception | None) -> None:
        self._transport = None
        self._server.connections.discard(self)
        self.session.close()


class TcpServer(Generic[S]):
    """One listening port and its clients."""

    def __init__(self, name: str, make_session: Callable[[], S]) -> None:
        """
        Listen nowhere yet.

        :param name: of the interface, for the log.
        :param make_session: called for each client.
        """
        self.name = name
        self.make_session = make_session
        self.connections: set[_Connection[S]] = set()
        self._server: asyncio.Server | None = None
        self.closing = False

    @property
    def port(self) -> int:
        """The port that is listened on."""
        assert self._server is not None
        return int(self._server.sockets[0].getsockname()[1])

    @property
    def sessions(self) -> Iterator[tuple[S, _Connection[S]]]:
        """The conversations with what they are written to."""
        return ((connection.session, connection) for connection in tuple(self.connections))

    async def listen(self, host: str, port: int) -> None:
        """
        Start to listen.

        :raises OSError: the port is taken; the text names interface and port.
        """
        loop = asyncio.get_running_loop()
        self.closing = False
        try:
            self._server = await loop.create_server(lambda: _Connection(self), host, port)
        except OSError as error:
            raise OSError(
                f'The {self.name} port {port} on {host} cannot be listened on: '
                f'{error.strerror or error}. Choose another port, or 0 for any free one.'
            ) from error

    def broadcast(self, data: bytes) -> None:
        """Send the same piece to all clients."""
        for connection in tuple(self.connections):
            connection.write(data)

    def broadcast_state(self, data: bytes) -> None:
        """Send the same piece to all clients that read what they are sent."""
        for connection in tuple(self.connections):
            connection.write_state(data)

    async def close(self) -> None:
        """Stop listening and disconnect everybody."""
        if self._server is None:
            return
        self.closing = True
        self._server.close()
        for connection in tuple(self.connections):
            connection.abort()
        await asyncio.sleep(0)  # the loop reports an abort in its next turn
        await self._server.wait_closed()
        self._server = None
