# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Clients of a robot's ports that share nothing with this package: sockets and published formats.

They see the same as any other client of a robot.
"""

from __future__ import annotations

import asyncio
import contextlib
from dataclasses import dataclass
import socket
import struct
import threading
import time
from typing import Any, Self

#: Longest time for an answer [s].
TIMEOUT = 30.0
STATE, MESSAGE = 16, 20
TEXT, SAFETY_MODE, ERROR, KEY, EXCEPTION = 0, 5, 6, 7, 10


def state_fields(body: bytes) -> dict[str, Any]:
    """Return fields of a robot state: of its sub-packages for modes and joints."""
    start, fields = 0, dict[str, Any]()
    while start < len(body):
        size, kind = struct.unpack_from('>IB', body, start)
        if kind == 0:
            names = 'stamp real enabled power emergency protective running paused mode'
            values = struct.unpack_from('>Q7?B', body, start + 5)
            fields |= dict(zip(names.split(), values, strict=True))
            fraction, scaling = struct.unpack_from('>dd', body, start + 22)
            fields |= {'fraction': fraction, 'scaling': scaling}
        elif kind == 1:
            joints = [struct.unpack_from('>3d4fB', body, start + 5 + 41 * i) for i in range(6)]
            names = 'q target_q qd amperes volts celsius motor_celsius joint_modes'
            fields |= dict(zip(names.split(), map(list, zip(*joints, strict=True)), strict=True))
        start += size
    return fields


class PlainPrimary:
    """The primary interface (30001) as pairs of a name and its fields."""

    def __init__(self, host: str, port: int) -> None:
        self.socket = socket.create_connection((host, port), timeout=TIMEOUT)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.socket.close()

    def send(self, text: str) -> None:
        self.socket.sendall(text.encode())

    def _exactly(self, size: int) -> bytes:
        data = b''
        while len(data) < size:
            more = self.socket.recv(size - len(data))
            assert more, 'the robot has closed the connection'
            data += more
        return data

    def next(self) -> tuple[str, dict[str, Any]]:
        """Return 'state' or the kind of a message, and its fields."""
        size, kind = struct.unpack('>iB', self._exactly(5))
        body = self._exactly(size - 5)
        if kind == STATE:
            return 'state', state_fields(body)
        stamp, _, message = struct.unpack_from('>QbB', body)
        rest = body[10:]
        if kind != MESSAGE:
            return 'other', {}
        if message == ERROR:
            code, argument = struct.unpack_from('>ii', rest)
            return 'error', {'stamp': stamp, 'code': code, 'argument': argument}
        if message == KEY:
            title = rest[9 : 9 + rest[8]].decode()
            return 'key', {'stamp': stamp, 'title': title, 'text': rest[9 + rest[8] :].decode()}
        if message == EXCEPTION:
            line, column = struct.unpack_from('>ii', rest)
            return 'exception', {'line': line, 'column': column, 'text': rest[8:].decode()}
        if message == TEXT:
            return 'text', {'stamp': stamp, 'text': rest.decode()}
        return 'other', {}

    def await_(self, wanted: str, **fields: object) -> dict[str, Any]:
        """Return the fields of the next frame of this kind that has these values."""
        deadline = time.monotonic() + TIMEOUT
        while time.monotonic() < deadline:
            kind, found = self.next()
            if kind == wanted and all(found[name] == value for name, value in fields.items()):
                return found
        raise AssertionError(f'no {wanted} {fields} within {TIMEOUT} s')


class PlainDashboard:
    """The dashboard (29999): an answer line for each line."""

    def __init__(self, host: str, port: int) -> None:
        self.socket = socket.create_connection((host, port), timeout=TIMEOUT)
        self._lines = self.socket.makefile()
        assert self._lines.readline() == 'Connected: Universal Robots Dashboard Server\n'

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._lines.close()
        self.socket.close()

    def ask(self, line: str) -> str:
        self.socket.sendall(line.encode() + b'\n')
        return self._lines.readline().removesuffix('\n')


@dataclass(frozen=True, slots=True)
class Sample:
    """A packet of the real-time interface: targets [s, rad, rad/s, m]."""

    time: float
    q: tuple[float, ...]
    qd: tuple[float, ...]
    #: x, y, z and rotation vector of the tool in the base.
    pose: tuple[float, ...]


class PlainRealtime:
    """The real-time interface (30003): a packet of doubles in each cycle."""

    def __init__(self, host: str, port: int) -> None:
        self.socket = socket.create_connection((host, port), timeout=TIMEOUT)
        self._stream = self.socket.makefile('rb')

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stream.close()
        self.socket.close()

    def next(self) -> Sample:
        (size,) = struct.unpack('>i', self._stream.read(4))
        values = struct.unpack(f'>{(size - 4) // 8}d', self._stream.read(size - 4))
        return Sample(values[0], values[1:7], values[7:13], values[73:79])

    def motion(self, script: str) -> list[Sample]:
        """Send a program; return its motion, from the last sample at rest to the next at rest."""
        self.socket.sendall(script.encode())
        before = sample = self.next()
        start = sample.time
        while not any(sample.qd):
            assert sample.time < start + TIMEOUT, 'nothing moves'
            before, sample = sample, self.next()
        samples = [before, sample]
        # An arm that stands for 50 ms has arrived.
        while any(any(sample.qd) for sample in samples[-25:]):
            samples.append(self.next())
        return samples[:-24]


@dataclass(frozen=True, slots=True)
class RtdeRow:
    """A packet of RTDE: target and measured joints [s, rad, rad/s], and outputs."""

    time: float
    target_q: tuple[float, ...]
    target_qd: tuple[float, ...]
    q: tuple[float, ...]
    qd: tuple[float, ...]
    digital_outputs: int


class RtdeBytes:
    """The real-time data exchange (30004) without its socket: requests, and rows of data."""

    _OUTPUTS = 'timestamp,target_q,target_qd,actual_q,actual_qd,actual_digital_output_bits'
    _LAYOUT = struct.Struct('>B25dQ')
    _VERSION, _SETUP, _START, _DATA = b'VOSU'

    def __init__(self) -> None:
        self._received = bytearray()

    def requests(self, frequency: float) -> bytes:
        """Return requests for version 2, for outputs at a frequency [Hz], and for the start."""

        def frame(kind: int, body: bytes = b'') -> bytes:
            return struct.pack('>HB', 3 + len(body), kind) + body

        setup = struct.pack('>d', frequency) + self._OUTPUTS.encode()
        version = struct.pack('>H', 2)
        return frame(self._VERSION, version) + frame(self._SETUP, setup) + frame(self._START)

    def feed(self, data: bytes) -> list[RtdeRow]:
        """Return the rows that are complete with these bytes."""
        self._received += data
        rows, start = [], 0
        while len(self._received) >= start + 3:
            size, kind = struct.unpack_from('>HB', self._received, start)
            if len(self._received) < start + size:
                break
            body = self._received[start + 3 : start + size]
            if kind == self._DATA:
                v = self._LAYOUT.unpack(body)
                rows.append(RtdeRow(v[1], v[2:8], v[8:14], v[14:20], v[20:26], v[26]))
            elif kind == self._SETUP:
                assert b'NOT_FOUND' not in body, body
            start += size
        del self._received[:start]
        return rows


class RtdeRecorder(asyncio.Protocol):
    """A client of RTDE on an event loop: :attr:`rows` are the received rows."""

    def __init__(self) -> None:
        self.codec, self.rows = RtdeBytes(), list[RtdeRow]()

    def data_received(self, data: bytes) -> None:
        """Take bytes from the robot."""
        self.rows += self.codec.feed(data)


class PlainRtde:
    """RTDE through a socket: the rows of a thread that reads until the end."""

    def __init__(self, host: str, port: int, frequency: float) -> None:
        self.rows: list[RtdeRow] = []
        self._codec = RtdeBytes()
        self._socket = socket.create_connection((host, port), timeout=TIMEOUT)
        self._socket.sendall(self._codec.requests(frequency))
        self._thread = threading.Thread(target=self._read)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        self._thread.join()
        self._socket.close()

    def wait(self, seconds: float) -> None:
        """Wait until this time has passed on the controller's clock [s]."""
        end, deadline = self.rows[-1].time + seconds, time.monotonic() + TIMEOUT
        while self.rows[-1].time < end:
            assert time.monotonic() < deadline, 'RTDE is silent'
            time.sleep(0.005)

    def _read(self) -> None:
        with contextlib.suppress(ConnectionResetError):  # the robot may end first
            while data := self._socket.recv(1 << 16):
                self.rows += self._codec.feed(data)
