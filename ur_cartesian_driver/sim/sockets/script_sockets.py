# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The sockets that programs open: the interface for the script functions.

No method waits: a script function polls its socket once per cycle and yields in between.
`tcp_script_sockets` uses real TCP; the sockets in memory are for programs on the virtual clock.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from typing import Protocol


class SocketState(Enum):
    """State of a program's socket."""

    CLOSED = 'closed'
    CONNECTING = 'connecting'
    OPEN = 'open'


class ScriptSockets(Protocol):
    """Named connections of a program; no method blocks."""

    def open(self, name: str, address: str, port: int) -> None:
        """Begin to connect; an older socket of that name is closed."""

    def state(self, name: str) -> SocketState:
        """Return the state; CLOSED if the name is unknown or the peer has closed."""

    def received(self, name: str) -> bytearray:
        """Return the unread bytes; the caller deletes the bytes that it takes."""

    def send(self, name: str, data: bytes) -> bool:
        """Send without waiting; return whether the socket accepted the data."""

    def close(self, name: str) -> None:
        """Close; an unknown name is not an error."""

    def close_all(self) -> None:
        """Close every socket; also called when a program ends."""

    def poll(self) -> None:
        """Continue connecting and sending; called once per cycle."""


class MemorySocket:
    """A connection in memory; the test that holds this object is the program's peer."""

    def __init__(self) -> None:
        """Begin open, with nothing in either direction."""
        self.incoming = bytearray()
        self.outgoing = bytearray()
        self.state = SocketState.OPEN

    def feed(self, data: bytes) -> None:
        """Send data to the program."""
        self.incoming += data

    def take(self) -> bytes:
        """Return and forget the bytes sent by the program."""
        data = bytes(self.outgoing)
        self.outgoing.clear()
        return data

    def hang_up(self) -> None:
        """Close the connection as the peer; bytes that it sent before can still be read."""
        self.state = SocketState.CLOSED


class MemorySockets:
    """Connections in memory to listeners in this process."""

    def __init__(self) -> None:
        """Begin without listeners."""
        #: Port -> function that gets each connection to the port.
        self.listeners: dict[int, Callable[[MemorySocket], None]] = {}
        self._sockets: dict[str, MemorySocket] = {}

    def listen(self, port: int) -> list[MemorySocket]:
        """Accept connections to a port; they are appended to the list that is returned."""
        accepted: list[MemorySocket] = []
        self.listeners[port] = accepted.append
        return accepted

    def open(self, name: str, address: str, port: int) -> None:
        """Connect at once, if the port has a listener."""
        self.close(name)
        if port in self.listeners:
            self._sockets[name] = MemorySocket()
            self.listeners[port](self._sockets[name])

    def state(self, name: str) -> SocketState:
        """Return the state of a socket."""
        return self._sockets[name].state if name in self._sockets else SocketState.CLOSED

    def received(self, name: str) -> bytearray:
        """Return the unread bytes sent by the peer."""
        return self._sockets[name].incoming if name in self._sockets else bytearray()

    def send(self, name: str, data: bytes) -> bool:
        """Hand the data to the peer; return False if the socket is not open."""
        if self.state(name) is not SocketState.OPEN:
            return False
        self._sockets[name].outgoing += data
        return True

    def close(self, name: str) -> None:
        """Close a socket."""
        if socket := self._sockets.pop(name, None):
            socket.hang_up()

    def close_all(self) -> None:
        """Close all sockets."""
        for name in list(self._sockets):
            self.close(name)

    def poll(self) -> None:
        """Do nothing, because connecting and sending take effect at once."""
