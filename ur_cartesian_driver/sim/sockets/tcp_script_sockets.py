# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The sockets of programs over real TCP, polled by the controller's cycle.

The event loop does not serve these sockets, because a program reads only when it is executed:
unread bytes stay in the kernel, and while a program is paused, TCP's flow control stops the peer,
as on the robot.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
import contextlib
import errno
import socket

from ur_cartesian_driver.sim.sockets.script_sockets import SocketState

#: While the program has not taken this many received bytes, no more are read; at most this many
#: bytes wait to be sent.
_MAX_BUFFERED = 65_536
_IN_PROGRESS = (errno.EINPROGRESS, errno.EALREADY, errno.EWOULDBLOCK, errno.EINTR)
_CONNECTED = (0, errno.EISCONN)
#: Errors of a look-up: the name has no address; the text cannot be a name.
_NO_ADDRESS = (OSError, UnicodeError)

#: Addresses of IPv4, of IPv6, and of a Python without IPv6; connecting to the last kind fails.
_Address = tuple[str, int] | tuple[str, int, int, int] | tuple[int, bytes]
_Resolved = Sequence[tuple[int, int, int, str, _Address]]


class _ScriptConnection:
    """One TCP connection: connecting, open, or closed with data left to read."""

    def __init__(self, port: int, on_data: Callable[[int, bytes], None] | None, host: str) -> None:
        self._host = host
        self.state = SocketState.CONNECTING
        self.incoming = bytearray()
        self._outgoing = bytearray()
        self._port = port
        self._on_data = on_data
        self._socket: socket.socket | None = None
        self._target: _Address | None = None
        self.resolving: Future[_Resolved] | None = None

    def connect(self, resolved: _Resolved) -> None:
        """Start to connect to the first address."""
        family, kind, protocol, _, self._target = resolved[0]
        self._socket = socket.socket(family, kind, protocol)
        self._socket.setblocking(False)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        if _is_loopback(self._host) and _is_loopback(str(self._target[0])):
            self._socket.bind((self._host, 0))
        self._continue_connecting()

    def poll(self) -> None:
        """Continue resolving, connecting or sending."""
        if self.resolving is not None and self.resolving.done():
            resolving, self.resolving = self.resolving, None
            try:
                self.connect(resolving.result())
            except _NO_ADDRESS:
                self.close()
        elif self.state is SocketState.CONNECTING and self._socket is not None:
            self._continue_connecting()
        elif self._outgoing:
            self._flush()

    def _continue_connecting(self) -> None:
        assert self._socket is not None
        assert self._target is not None
        error = self._socket.connect_ex(self._target)
        if error in _CONNECTED:
            self.state = SocketState.OPEN
        elif error not in _IN_PROGRESS:
            self.close()

    def receive(self) -> None:
        """Read from the kernel until ``_MAX_BUFFERED`` bytes wait for the program."""
        while self.state is SocketState.OPEN and len(self.incoming) < _MAX_BUFFERED:
            assert self._socket is not None
            try:
                data = self._socket.recv(_MAX_BUFFERED)
            except BlockingIOError:
                return
            except OSError:
                data = b''
            if not data:
                self.close()
                return
            self.incoming += data
            if self._on_data is not None:
                self._on_data(self._port, data)

    def send(self, data: bytes) -> bool:
        """
        Send data, and keep the bytes that the kernel does not accept.

        :returns: False = the socket is not open, or too many bytes are kept.
        """
        if self.state is not SocketState.OPEN or len(self._outgoing) + len(data) > _MAX_BUFFERED:
            return False
        self._outgoing += data
        self._flush()
        return self.state is SocketState.OPEN

    def _flush(self) -> None:
        assert self._socket is not None
        try:
            sent = self._socket.send(self._outgoing)
            del self._outgoing[:sent]
        except BlockingIOError:
            return
        except OSError:
            self.close()

    def close(self) -> None:
        """Close; data that has arrived can still be read."""
        self.state = SocketState.CLOSED
        if self.resolving is not None:
            self.resolving.cancel()
            self.resolving = None
        if self._socket is not None:
            with contextlib.suppress(OSError):
                self._socket.close()
            self._socket = None
        self._outgoing.clear()


def _is_loopback(host: str) -> bool:
    return host.startswith('127.')


class TcpScriptSockets:
    """Named TCP connections; see :class:`~.script_sockets.ScriptSockets`."""

    def __init__(
        self, on_data: Callable[[int, bytes], None] | None = None, host: str = ''
    ) -> None:
        """
        Begin without connections.

        :param on_data: called with the peer's port and the bytes that are received from the peer.
        :param host: the robot's address. On loopback, connections come from this address, so that
            a peer can distinguish several robots on one computer.
        """
        self.on_data, self._host = on_data, host
        self._connections: dict[str, _ScriptConnection] = {}
        self._resolver: ThreadPoolExecutor | None = None

    def open(self, name: str, address: str, port: int) -> None:
        """
        Begin to connect; a thread looks up host names, because that can take seconds.

        :param port: a number from 0 to 65535.
        """
        self.close(name)
        connection = _ScriptConnection(port, self.on_data, self._host)
        self._connections[name] = connection
        host = '127.0.0.1' if address == 'localhost' else address
        try:
            resolved = socket.getaddrinfo(
                host, port, type=socket.SOCK_STREAM, flags=socket.AI_NUMERICHOST
            )
        except UnicodeError:  # not a host name: a part of it is empty or too long
            connection.close()
            return
        except OSError:
            connection.resolving = self._lookup(address, port)
            return
        try:
            connection.connect(resolved)
        except OSError:
            connection.close()

    def _lookup(self, address: str, port: int) -> Future[_Resolved]:
        if self._resolver is None:
            self._resolver = ThreadPoolExecutor(1, thread_name_prefix='ur-sim-resolver')
        return self._resolver.submit(socket.getaddrinfo, address, port, type=socket.SOCK_STREAM)

    def state(self, name: str) -> SocketState:
        """Return the state of a socket."""
        connection = self._connections.get(name)
        return connection.state if connection else SocketState.CLOSED

    def received(self, name: str) -> bytearray:
        """Read from the kernel, and return the unread bytes of a socket."""
        connection = self._connections.get(name)
        if connection is None:
            return bytearray()
        connection.receive()
        return connection.incoming

    def send(self, name: str, data: bytes) -> bool:
        """Send data on a socket; return whether it accepts the data."""
        connection = self._connections.get(name)
        return connection is not None and connection.send(data)

    def close(self, name: str) -> None:
        """Close a socket."""
        if connection := self._connections.pop(name, None):
            connection.close()

    def close_all(self) -> None:
        """Close all sockets, and end the look-ups."""
        for name in list(self._connections):
            self.close(name)
        if self._resolver is not None:
            self._resolver.shutdown(wait=False, cancel_futures=True)
            self._resolver = None

    def poll(self) -> None:
        """Continue connecting and sending."""
        for connection in self._connections.values():
            connection.poll()
