# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
TCP endpoints: one that connects, one that listens for the robot program.

Both call back on the event loop and never block it. The reason for the end of a connection is a
clause ("the other side closed the connection", ...): a user who reads that a goal ended wants to
know which side closed the connection.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
import errno
import ipaddress
from math import inf
import os
import socket

OnData = Callable[[bytes], None]
OnClosed = Callable[[str], None]

#: Pauses between attempts to connect [s]; the last pause repeats.
BACKOFF_PERIODS = (0.1, 0.2, 0.5, 1.0, 2.0)
CONNECT_TIMEOUT = 2.0

#: Most data that may wait until the other side reads it [bytes]. It bounds the memory, and is more
#: than all points that the driver sends ahead.
MAX_UNSENT = 1 << 20
#: Most data read at once [bytes].
MAX_READ = 1 << 16
#: Longest time for a closed connection to send its remaining data [s].
LINGER_TIMEOUT = 1.0
#: Largest number of log lines about clients in a period; this period [s].
MAX_LINES, WARNING_PERIOD = 3, 60.0
#: Largest number of different failures to connect, each with a count of its own.
MAX_FAILURES = 20

#: Remedies if a port cannot be opened.
REMEDIES = {
    errno.EADDRINUSE: 'another driver may use it; set {name} to a free port or to 0',
    errno.EACCES: 'set {name} to a port above 1023 or to 0',
}


def ignore(_: object) -> None:
    """Do nothing; for callbacks that nobody needs."""


class TcpConnection(asyncio.BufferedProtocol):
    """
    One TCP connection, dialled or accepted.

    The connection reads into its own buffer. For protocols without a buffer, asyncio asks the
    system for 256 KiB of fresh memory at each read, which takes longer than reading a packet.
    """

    def __init__(
        self,
        on_data: OnData,
        on_closed: OnClosed,
        on_open: Callable[[TcpConnection], None] | None = None,
    ) -> None:
        """
        Set the callbacks; all of them run on the event loop.

        :param on_data: called with bytes that came in.
        :param on_closed: called once, with the reason, when the connection is gone.
        :param on_open: called when the connection is made.
        """
        self._on_data, self._on_closed, self._on_open = on_data, on_closed, on_open
        self._transport: asyncio.Transport | None = None
        self._buffer = memoryview(bytearray(MAX_READ))
        self._reason = ''

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """
        Switch off Nagle's algorithm, and call ``on_open``.

        Every message is one small segment that has to be sent at once.
        """
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        sock = transport.get_extra_info('socket')
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        if self._on_open is not None:
            self._on_open(self)

    def get_buffer(self, sizehint: int) -> memoryview:
        """Return the buffer for the next read."""
        return self._buffer

    def buffer_updated(self, nbytes: int) -> None:
        """Pass the received bytes to ``on_data``."""
        self._on_data(bytes(self._buffer[:nbytes]))

    def eof_received(self) -> bool:
        """
        Have asyncio close the transport: half-open connections are not used.

        The end is reported now and not when the transport is gone: a robot program that is
        started again connects at the same moment, and must find the previous program gone.
        """
        self._end('the other side closed the connection')
        return False

    def connection_lost(self, exc: Exception | None) -> None:
        """Report the end of the connection and its reason, unless :meth:`eof_received` has."""
        self._end(f'{exc}' if exc is not None else 'we closed the connection')

    def _end(self, reason: str) -> None:
        """Report once that the connection is gone."""
        if self._transport is not None:
            self._transport = None
            self._on_closed(self._reason or reason)

    @property
    def is_open(self) -> bool:
        """Return whether bytes can be sent."""
        return self._transport is not None and not self._transport.is_closing()

    @property
    def local_address(self) -> str:
        """Return our address on this connection."""
        assert self._transport is not None
        return str(self._transport.get_extra_info('sockname')[0])

    @property
    def peer_address(self) -> str:
        """Return the other side's address on this connection; empty if it hung up at once."""
        assert self._transport is not None
        peer = self._transport.get_extra_info('peername')
        return str(peer[0]) if peer else ''

    def send(self, data: bytes) -> bool:
        """Send bytes; return False if the connection is gone, or fails now."""
        if self._transport is None or self._transport.is_closing():
            return False
        if self._transport.get_write_buffer_size() > MAX_UNSENT:
            self.abort(f'the other side did not read {MAX_UNSENT} bytes')
            return False
        self._transport.write(data)
        return True

    def send_at_once(self, data: bytes) -> bool:
        """Send bytes in one system call, for a reader that stops at the first pause."""
        if self._transport is not None:
            # Twice the size of the data, because the system counts the memory that its packets
            # take, which is more than the data in them.
            sock = self._transport.get_extra_info('socket')
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 2 * len(data))
        return self.send(data)

    def close(self, reason: str = '') -> None:
        """
        Close when the data sent so far has gone out, or after :data:`LINGER_TIMEOUT`.

        :param reason: the reason for ``on_closed``.
        """
        self._reason = self._reason or reason
        if self._transport is not None:
            self._transport.close()
            if self._transport.get_write_buffer_size():
                asyncio.get_running_loop().call_later(LINGER_TIMEOUT, self._transport.abort)

    def abort(self, reason: str) -> None:
        """Close at once, even if data are still unsent."""
        self._reason = self._reason or reason
        if self._transport is not None:
            self._transport.abort()


async def dial(connection: TcpConnection, host: str, port: int) -> None:
    """
    Connect once.

    The caller makes the connection object, and so has it before the first bytes arrive: some
    servers send first.

    :raises OSError: nothing answers; the text names host and port.
    """
    loop = asyncio.get_running_loop()
    try:
        async with asyncio.timeout(CONNECT_TIMEOUT):
            await loop.create_connection(lambda: connection, host, port)
    except TimeoutError:
        raise OSError(f'{host} port {port} does not answer within {CONNECT_TIMEOUT:g} s') from None
    except OSError as error:
        raise OSError(f'{host} port {port}: {error_reason(error)}') from error


def error_reason(error: OSError) -> str:
    """Return the system's text for an error, without the address that asyncio's text adds."""
    if error.errno is not None and error.errno in errno.errorcode:
        return os.strerror(error.errno).lower()
    return error.strerror or str(error)  # such as an unknown host name


class Backoff:
    """The pauses between attempts to connect, which grow until an attempt succeeds."""

    def __init__(self) -> None:
        """Start with the shortest pause."""
        self._attempt = 0

    def reset(self) -> None:
        """Return to the shortest pause after a success."""
        self._attempt = 0

    async def wait(self) -> None:
        """Wait before the next attempt."""
        await asyncio.sleep(BACKOFF_PERIODS[min(self._attempt, len(BACKOFF_PERIODS) - 1)])
        self._attempt += 1


class AttemptLog:
    """
    Logs each different failure of repeated attempts once.

    The counts of the failures are logged when a different failure occurs, or an attempt succeeds.
    """

    def __init__(self, log: Callable[[str], None], log_count: Callable[[str], None]) -> None:
        """
        Begin with no failure.

        :param log: logs a new failure.
        :param log_count: logs the count of a repeated failure.
        """
        self._log, self._log_count = log, log_count
        #: Occurrences of each failure since its count was last logged.
        self._counts: dict[str, int] = {}

    def failed(self, text: str) -> None:
        """Log a failure if it is new, else count it."""
        if text in self._counts:
            self._counts[text] += 1
            return
        self._log_counts()
        if len(self._counts) >= MAX_FAILURES:  # texts that always differ must not fill the memory
            self._counts.clear()
        self._counts[text] = 1
        self._log(text)

    def succeeded(self) -> None:
        """Log the counts, and forget all failures: after a success, any failure is new."""
        self._log_counts()
        self._counts.clear()

    def _log_counts(self) -> None:
        for text, count in self._counts.items():
            if count > 1:
                self._log_count(f'{text.rstrip(".")} ({count} times)')
                self._counts[text] = 1


class WarningLimiter:
    """Limits the log lines about clients: a flood of connections must not flood the log."""

    def __init__(self, warn: Callable[[str], None]) -> None:
        """Begin with no lines."""
        self._warn = warn
        self._begin = -inf
        self._count = 0

    def add(self, text: str, now: float) -> None:
        """Log a line, or only count it if the period has had too many."""
        if now - self._begin >= WARNING_PERIOD:
            suppressed = self._count - MAX_LINES
            self._begin, self._count = now, 0
            if suppressed > 0:
                text += f' ({suppressed} more lines like this were left out)'
        self._count += 1
        if self._count <= MAX_LINES:
            self._warn(text)


class TcpListener:
    """
    A TCP port for the robot program; one client at a time.

    Clients without an allowed address are rejected, and so are all clients while a program is
    fully connected. Otherwise the newest client replaces the previous one, which may have died
    without closing its connection, or may not be a robot program.
    """

    def __init__(
        self,
        name: str,
        *,
        on_open: Callable[[TcpConnection], None],
        on_data: OnData,
        on_closed: OnClosed,
        on_refused: Callable[[str], None],
        is_taken: Callable[[], bool] = lambda: False,
    ) -> None:
        """
        Describe the port.

        :param name: name of the port's parameter, for texts.
        :param on_refused: called with the reason when a client was rejected.
        :param is_taken: returns whether the connected client must not be replaced.
        """
        self.name = name
        self.port = 0
        self.connection: TcpConnection | None = None
        self._on_open, self._on_data, self._on_closed = on_open, on_data, on_closed
        self._is_taken = is_taken
        self._warnings = WarningLimiter(on_refused)
        self._server: asyncio.Server | None = None
        self._allowed: frozenset[str] = frozenset()

    @property
    def is_open(self) -> bool:
        """Return whether the port is open."""
        return self._server is not None

    async def open(self, host: str, port: int, allowed: frozenset[str]) -> None:
        """
        Start to listen.

        :param port: port number; 0 = any free port, which :attr:`port` then gives.
        :param allowed: addresses that may connect; empty = all.
        :raises OSError: the port is taken; the text names the parameter to change.
        """
        self.allow(allowed)
        try:
            # In two steps, so that close() finds the server if we are cancelled between them.
            self._server = await asyncio.get_running_loop().create_server(
                self._accept, host, port, backlog=4, reuse_address=True, start_serving=False
            )
            await self._server.start_serving()
        except OSError as error:
            remedy = REMEDIES.get(
                error.errno or 0, 'set bind_address to an address of this computer'
            ).format(name=self.name)
            raise OSError(
                f'cannot listen on {host} port {port} ({error_reason(error)}): {remedy}'
            ) from error
        self.port = int(self._server.sockets[0].getsockname()[1])

    def allow(self, allowed: frozenset[str]) -> None:
        """Set the addresses that may connect from now on; empty = all."""
        self._allowed = frozenset(map(plain_address, allowed))

    def close(self) -> None:
        """Close the port and its connection."""
        if self._server is not None:
            self._server.close()
            self._server = None
        self.disconnect()

    def disconnect(self) -> None:
        """Close the connection, if any, without a callback; the next client may connect."""
        connection, self.connection = self.connection, None
        if connection is not None:
            connection.close()

    def _accept(self) -> TcpConnection:
        connection = TcpConnection(
            self._on_data, lambda reason: self._ended(connection, reason), self._opened
        )
        return connection

    def _opened(self, connection: TcpConnection) -> None:
        peer = plain_address(connection.peer_address)
        if not self.is_open or not peer:  # closed by either side meanwhile
            connection.abort('closed by one side')
        elif self._allowed and peer not in self._allowed:
            self._reject(
                connection, f'{peer} may not connect; add it to allowed_peers if it is the robot'
            )
        elif self.connection is not None and self._is_taken():
            self._reject(
                connection, f'{peer} was rejected: the robot program is connected already'
            )
        else:
            self.disconnect()
            self.connection = connection
            self._on_open(connection)

    def warn_limited(self, text: str) -> None:
        """Log a fault of a client, within the limit of lines."""
        self._warnings.add(f'{self.name}: {text}', asyncio.get_running_loop().time())

    def _reject(self, connection: TcpConnection, text: str) -> None:
        connection.abort(text)
        self.warn_limited(text)

    def _ended(self, connection: TcpConnection, reason: str) -> None:
        if connection is self.connection:  # not a rejected or closed connection
            self.connection = None
            self._on_closed(reason)


def plain_address(text: str) -> str:
    """
    Return an address in canonical form.

    On an IPv6 port, an IPv4 client appears as ``::ffff:a.b.c.d``.
    """
    try:
        address = ipaddress.ip_address(text)
    except ValueError:
        return text  # a name
    mapped = getattr(address, 'ipv4_mapped', None)
    return str(mapped or address)
