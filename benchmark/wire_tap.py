# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
A relay between robot program and driver that records when bytes come from the driver.

The driver listens on 127.0.0.1, and the robot program connects to 127.0.0.2 (``reverse_ip``, as
behind a NAT); there the relay listens on the same ports and forwards everything. It is a process
of its own, so that no other work delays its clock.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
import selectors
import signal
import socket
import struct
import threading
import time

from processes import answer_calls, Child, child, HOST

from ur_cartesian_driver.protocol.framing import RecordDecoder
from ur_cartesian_driver.protocol.program.reverse import ControlMode, MESSAGE_SIZE

TAP_HOST = '127.0.0.2'
PORTS = ('reverse_port', 'trajectory_port', 'script_command_port')
_WORDS = struct.Struct('>8i')


@dataclass(frozen=True, slots=True)
class Mark:
    """Bytes that came from the driver."""

    #: Arrival, by ``time.monotonic_ns``.
    time: int
    port: str
    size: int
    #: Mode and first word of a message on the reverse socket.
    mode: int = 0
    action: int = 0

    @property
    def is_trajectory_action(self) -> bool:
        """Return whether it is a message of a running trajectory."""
        return self.port == 'reverse_port' and self.mode == ControlMode.FORWARD


@contextmanager
def wire_tap() -> Iterator[tuple[Child, dict[str, object]]]:
    """Run a relay; yield it (calls: ``ports``, ``marks``, ``hang_ups``) and the parameters."""
    with child(_tap) as tap:
        yield tap, {'reverse_ip': TAP_HOST, **tap.call('ports')}


def marks_until_first_point(
    tap: Child, spin: Callable[[float], None], timeout: float
) -> list[Mark]:
    """
    Wait for a point on the wire and return all marks until then.

    :param spin: waits for a time [s].
    :raises TimeoutError: none came within ``timeout`` [s].
    """
    marks: list[Mark] = []
    deadline = time.monotonic() + timeout
    while not any(mark.port == 'trajectory_port' for mark in marks):
        if time.monotonic() > deadline:
            raise TimeoutError(f'no point on the wire within {timeout:g} s')
        spin(0.05)
        marks += tap.call('marks')
    return marks


def _tap(connection: Connection) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    relay = Relay()
    threading.Thread(target=relay.run, daemon=True).start()
    answer_calls(
        connection,
        {'ports': lambda: relay.ports, 'marks': relay.take, 'hang_ups': lambda: relay.hang_ups},
    )


class Relay:
    """Forwards bytes in both directions, in one thread."""

    def __init__(self) -> None:
        """Listen on free ports."""
        self.ports: dict[str, int] = {}
        self.hang_ups = 0
        self._marks: list[Mark] = []
        self._selector = selectors.DefaultSelector()
        for name in PORTS:
            self.listen(TAP_HOST, name)

    def listen(self, host: str, name: str) -> None:
        """Listen on a free port, which becomes ``ports[name]``."""
        listener = socket.create_server((host, 0))
        self.ports[name] = listener.getsockname()[1]
        self._selector.register(listener, selectors.EVENT_READ, name)

    def directions(self, name: str) -> tuple[int, str, str]:
        """Return the port for a client, and the names of both directions ('' = without marks)."""
        return self.ports[name], '', name

    def take(self) -> list[Mark]:
        """Return the marks since the last call."""
        marks, self._marks = self._marks, []
        return marks

    def run(self) -> None:
        """Serve forever."""
        while True:
            for key, _ in self._selector.select():
                sock = key.fileobj
                assert isinstance(sock, socket.socket)
                if isinstance(key.data, RelayDirection):
                    self.forward(sock, key.data)
                else:
                    self._accept(sock, key.data)

    def _accept(self, listener: socket.socket, name: str) -> None:
        caller, _ = listener.accept()
        port, asked, answered = self.directions(name)
        called = socket.create_connection((HOST, port))
        self.add_direction(caller, called, asked)
        self.add_direction(called, caller, answered)

    def add_direction(self, source: socket.socket, target: socket.socket, port_name: str) -> None:
        """Forward bytes from one socket to the other."""
        source.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._selector.register(source, selectors.EVENT_READ, RelayDirection(target, port_name))

    def forward(self, source: socket.socket, direction: RelayDirection) -> None:
        """Forward received bytes, or the end of the connection."""
        try:
            data = source.recv(65536)
            now = time.monotonic_ns()
            direction.target.sendall(data)
        except OSError:
            data = b''
        if data:
            direction.add_marks(self._marks, now, data)
            return
        self.hang_ups += 1
        self._selector.unregister(source)
        with suppress(OSError):  # the other one hung up too
            direction.target.shutdown(socket.SHUT_WR)


class RelayDirection:
    """One direction of one connection."""

    def __init__(self, target: socket.socket, port_name: str) -> None:
        """Take the sockets; ``port_name`` is the port's name if the bytes come from the driver."""
        self.target = target
        self.port_name = port_name
        self._messages = RecordDecoder(MESSAGE_SIZE, 'reverse message', _WORDS.unpack)

    def add_marks(self, marks: list[Mark], now: int, data: bytes) -> None:
        """Add marks for bytes that came from the driver."""
        if self.port_name == 'reverse_port':
            marks += [
                Mark(now, self.port_name, len(data), mode=words[7], action=words[1])
                for words in self._messages.feed(data)
            ]
        elif self.port_name:
            marks.append(Mark(now, self.port_name, len(data)))
