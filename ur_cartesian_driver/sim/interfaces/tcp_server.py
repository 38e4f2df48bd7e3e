# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
A TCP port that serves any number of clients of one kind.

A session converts a client's bytes to answers, without access to the socket. A client that does
not read is dropped, so that it cannot stall the cycle or the other clients.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
import asyncio
from collections.abc import Callable, Iterator
from errno import EACCES, EADDRINUSE
import logging
from typing import cast, Generic, TypeVar

from ur_cartesian_driver.motion.errors import ProtocolError
from ur_cartesian_driver.sim.faults.impairment import ImpairedConnection, Impairment

_log = logging.getLogger(__name__)

#: Largest number of bytes that a client can leave unread, not counting bytes in the kernel.
MAX_UNREAD_BYTES = 1_000_000
#: A client with more unread bytes gets no states but is kept, because many clients only send
#: scripts and never read.
MAX_UNREAD_BYTES_FOR_STATE = 16_384


class HangUp(Exception):
    """Raised by a session to end its connection after its last bytes."""

    def __init__(self, farewell: bytes = b'') -> None:
        """Take the last bytes to send."""
        super().__init__(farewell)
        self.farewell = farewell


class ClientSession(ABC):
    """One client's conversation."""

    @property
    def is_busy(self) -> bool:
        """Whether requests wait; these are carried out even if the client hangs up meanwhile."""
        return False

    def open(self) -> bytes:
        """Return the bytes to send at the start; by default none, because the client begins."""
        return b''

    @abstractmethod
    def feed(self, data: bytes) -> bytes:
        """
        Take bytes from the client; return the answer.

        :raises ProtocolError: the client violates the protocol; it is disconnected.
        :raises HangUp: the conversation is over.
        """

    def close(self) -> None:  # noqa: B027  # most sessions hold nothing
        """Release the client's resources; by default there are none."""


S = TypeVar('S', bound=ClientSession)


class _ClientConnection(asyncio.Protocol, Generic[S]):
    """Moves bytes between a transport and a session."""

    def __init__(self, server: TcpServer[S]) -> None:
        self._server = server
        self.session = server.make_session()
        self._transport: asyncio.Transport | None = None
        #: Bytes that a fault holds back, or has held back; None = the connection is sound.
        self._impaired: ImpairedConnection | None = None
        #: Whether the session has hung up: it gets no more data, but held-back bytes are sent.
        self._has_hung_up = False
        #: Whether the client has hung up: held-back requests are still carried out and answered.
        self._has_ended = False

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast(asyncio.Transport, transport)
        self._server.connections.add(self)
        if self._server.refuses_connections:
            self._transport.abort()
            return
        if self._server.impairment is not None:
            self.impair_connection(self._server.impairment)
        self.write(self.session.open())

    def data_received(self, data: bytes) -> None:
        if self._impaired is None:
            self._handle_incoming(data)
        else:
            self._impaired.queue_incoming(data, self._server.now)
            self._transport_reading(self._impaired.incoming.size < MAX_UNREAD_BYTES)

    def eof_received(self) -> bool:
        """Return True, which keeps the transport open, while a fault holds bytes back."""
        self._has_ended = True
        held = self._impaired
        return held is not None and bool(held.incoming.size or held.outgoing.size)

    def poll(self) -> None:
        """Send the answers to requests that the session could not answer at once."""
        self._handle_incoming(b'')
        if self._transport is None:
            self._leave_if_done()

    def _transport_reading(self, wanted: bool) -> None:
        """Resume reading, or pause it so that the client has to wait."""
        if self._transport is None or self._transport.is_closing():
            return
        if wanted:
            self._transport.resume_reading()
        else:
            self._transport.pause_reading()

    def _handle_incoming(self, data: bytes) -> None:
        if self._has_hung_up:
            return
        try:
            self.write(self.session.feed(data))
        except HangUp as hangup:
            self.write(hangup.farewell)
            self._hang_up()
        except ProtocolError as error:
            _log.warning('%s client disconnected: %s', self._server.name, error)
            self._hang_up()

    def _hang_up(self) -> None:
        self._has_hung_up = True
        if self._impaired is not None:
            self._impaired.incoming.clear()
        self._close_if_drained()

    def _close_if_drained(self) -> None:
        if self._transport is not None and (self._impaired is None or self._impaired.is_drained):
            self._transport.close()

    def write(self, data: bytes) -> None:
        """Send data, or drop a client that does not read."""
        if self._has_hung_up:
            return
        if self._impaired is None:
            self._send(data)
            return
        self._impaired.queue_outgoing(data, self._server.now)
        if self._impaired.outgoing.size > MAX_UNREAD_BYTES:
            self._drop_unread()

    def _send(self, data: bytes) -> None:
        if not data or self._transport is None or self._transport.is_closing():
            return
        if self._transport.get_write_buffer_size() > MAX_UNREAD_BYTES:
            self._drop_unread()
            return
        self._transport.write(data)

    def _drop_unread(self) -> None:
        _log.warning('%s client dropped: it does not read', self._server.name)
        self.abort()

    def write_state(self, data: bytes) -> None:
        """Send a state, unless the client has left too many bytes unread."""
        if self._transport is not None and (
            self._transport.get_write_buffer_size() < MAX_UNREAD_BYTES_FOR_STATE
        ):
            self.write(data)

    def impair_connection(self, impairment: Impairment | None) -> ImpairedConnection:
        """Impair this connection; None = end the impairment."""
        if self._impaired is None:
            self._impaired = ImpairedConnection(impairment, self._server.now)
        self._impaired.impairment = impairment
        return self._impaired

    def pump(self, now: float) -> bool:
        """Pass on the bytes that are due; return whether to call again in the next cycle."""
        impaired = self._impaired
        if impaired is None:
            return False
        if data := impaired.due_incoming(now):
            self._handle_incoming(data)
        self._transport_reading(impaired.incoming.size < MAX_UNREAD_BYTES)
        self._send(impaired.due_outgoing(now))
        if self._has_hung_up or self._has_ended:
            self._close_if_drained()
        if impaired.is_over:
            self._impaired = None
        return not impaired.is_over

    def abort(self) -> None:
        """Disconnect at once."""
        if self._transport is not None:
            self._transport.abort()

    def connection_lost(self, exc: Exception | None) -> None:
        self._transport = None
        self._leave_if_done()

    def _leave_if_done(self) -> None:
        if self._has_hung_up or self._server.closing or not self.session.is_busy:
            self._server.connections.discard(self)
            self.session.close()


class TcpServer(Generic[S]):
    """One listening port and its clients."""

    def __init__(self, name: str, make_session: Callable[[], S]) -> None:
        """
        Begin without listening.

        :param name: the name of the interface, for the log.
        :param make_session: returns the session of a new client.
        """
        self.name = name
        self.make_session = make_session
        self.connections: set[_ClientConnection[S]] = set()
        self._server: asyncio.Server | None = None
        self.closing = False
        #: The impairment of all connections; None = no impairment.
        self.impairment: Impairment | None = None
        #: The controller's clock at the last update of the faults [s].
        self.now = 0.0

    @property
    def port(self) -> int:
        """The port on which the server listens."""
        assert self._server is not None
        return int(self._server.sockets[0].getsockname()[1])

    @property
    def refuses_connections(self) -> bool:
        """Whether new connections are closed at once: the server is closing, or a fault is set."""
        return self.closing or (
            self.impairment is not None and self.impairment.refuses_connections
        )

    @property
    def session_connections(self) -> Iterator[tuple[S, _ClientConnection[S]]]:
        """The sessions with their connections."""
        return ((connection.session, connection) for connection in tuple(self.connections))

    async def listen(self, host: str, port: int) -> None:
        """
        Start to listen.

        :raises OSError: the port is taken, or the host is not this computer; the text names both.
        """
        loop = asyncio.get_running_loop()
        self.closing = False
        try:
            self._server = await loop.create_server(lambda: _ClientConnection(self), host, port)
        except (OSError, UnicodeError) as error:
            is_taken = isinstance(error, OSError) and error.errno in (EADDRINUSE, EACCES)
            remedy = (
                'Choose another port, or 0 for any free one'
                if is_taken
                else 'Give an address of this computer as host'
            )
            reason = getattr(error, 'strerror', None) or error
            raise OSError(
                f'Cannot open the {self.name} port {port} on {host}: {reason}. {remedy}.'
            ) from error

    def broadcast(self, data: bytes) -> None:
        """Send the same bytes to all clients."""
        for connection in tuple(self.connections):
            connection.write(data)

    def broadcast_state(self, data: bytes) -> None:
        """Send a state to all clients that do not leave too many bytes unread."""
        for connection in tuple(self.connections):
            connection.write_state(data)

    # Called by the fault injector (the protocol Impairable)

    def impair(self, impairment: Impairment | None, now: float) -> None:
        """Impair all connections from now on; None = end the impairment."""
        self.impairment, self.now = impairment, now
        for connection in self.connections:
            connection.impair_connection(impairment)

    def pump(self, now: float) -> bool:
        """Pass on the bytes that are due; return whether to call again in the next cycle."""
        self.now = now
        held = [connection.pump(now) for connection in tuple(self.connections)]
        return self.impairment is not None or any(held)

    def drop(self) -> None:
        """Cut all connections."""
        for connection in tuple(self.connections):
            connection.abort()

    def freeze(self) -> None:
        """Make all connections half-open: they stay, but nothing is sent or received."""
        for connection in self.connections:
            connection.impair_connection(self.impairment).freeze()

    def inject(self, data: bytes) -> None:
        """Send bytes that no session has sent."""
        self.broadcast(data)

    async def close(self) -> None:
        """Stop listening and disconnect all clients."""
        if self._server is None:
            return
        self.closing = True
        self._server.close()
        self.drop()
        await asyncio.sleep(0)  # the loop reports an abort in its next iteration
        await self._server.wait_closed()
        self._server = None
