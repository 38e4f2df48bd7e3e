# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Clients of the ports of a simulated robot: real sockets on the loopback interface."""

from __future__ import annotations

import socket
import struct
from typing import Any, Self

from ur_cartesian_driver.protocol.client_interfaces.primary_messages import PrimaryDecoder

#: Settings of a simulated robot, each of a type of its own: free ports, and no jump of its time
#: while this computer is busy.
FREE: dict[str, Any] = {
    'rtde_port': 0,
    'primary_port': 0,
    'dashboard_port': 0,
    'when_late': 'wait',
}
HOST = '127.0.0.1'


class Wire:
    """A client's socket that reads exactly as many bytes as asked."""

    def __init__(self, port: int) -> None:
        self.socket = socket.create_connection((HOST, port), timeout=5.0)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.socket.close()

    def send(self, data: bytes) -> None:
        self.socket.sendall(data)

    def exactly(self, size: int) -> bytes:
        data = b''
        while len(data) < size:
            data += self._more(size - len(data))
        return data

    def line(self) -> str:
        data = b''
        while not data.endswith(b'\n'):
            data += self._more(1)
        return data.decode().rstrip('\n')

    def ask(self, line: str) -> str:
        self.send(line.encode() + b'\n')
        return self.line()

    def rtde(self) -> tuple[int, bytes]:
        size, kind = struct.unpack('>HB', head := self.exactly(3))
        return kind, head + self.exactly(size - 3)

    def _more(self, size: int) -> bytes:
        data = self.socket.recv(size)
        assert data, 'the robot has closed the connection'
        return data


class Primary(Wire):
    """A client of the primary interface; collects frames until one fits."""

    def __init__(self, port: int) -> None:
        super().__init__(port)
        self._decoder = PrimaryDecoder()
        self._waiting: list[object] = []

    def next(self) -> Any:
        while not self._waiting:
            self._waiting += self._decoder.feed(self._more(65536))
        return self._waiting.pop(0)

    def await_(self, kind: type, **fields: object) -> Any:
        while True:
            frame = self.next()
            if isinstance(frame, kind) and all(
                getattr(frame, name) == value for name, value in fields.items()
            ):
                return frame


def setup_inputs(*names: str) -> bytes:
    payload = ','.join(names).encode()
    return struct.pack('>HB', 3 + len(payload), ord('I')) + payload


PAUSE = struct.pack('>HB', 3, ord('P'))


def fetch_program(driver: Any) -> str:
    """Fetch the robot program from a driver, as the External Control node does."""
    with socket.create_connection((HOST, driver.status.ports['script_sender_port'])) as sender:
        sender.settimeout(5.0)
        sender.sendall(b'request_program\n')
        text = ''
        while '# NODE_CONTROL_LOOP_ENDS' not in text:
            text += sender.recv(65536).decode()
    return text
