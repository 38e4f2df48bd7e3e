# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The socket functions of URScript programs.

A timeout of zero or less means no time limit. Once the peer has closed the connection, a read
without enough data ends at once, with the same result as after a timeout. An incomplete value
stays in the buffer.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
import struct
from typing import TypeVar

from ur_cartesian_driver.sim.builtins.arguments import int32, number, text, whole
from ur_cartesian_driver.sim.builtins.builtin_group import BuiltinGroup
from ur_cartesian_driver.sim.controller import Controller
from ur_cartesian_driver.sim.sockets.script_sockets import ScriptSockets, SocketState
from ur_cartesian_driver.urscript.script_errors import RuntimeException
from ur_cartesian_driver.urscript.script_values import INT_MAX, INT_MIN, to_text, Value

CONNECT_TIMEOUT = 2.0
#: Largest number of reads of one socket in a cycle; a further read waits for the next cycle.
#: Without this bound, a peer that never stops writing would keep the program reading for ever.
#: With it, TCP's flow control slows the peer down. A real controller's bound is not published.
READS_PER_CYCLE = 32
#: Most values in one read of numbers; most characters in one string that is read without a suffix.
MAX_NUMBERS, MAX_CHARACTERS = 30, 1023
MAX_PORT = 65_535

T = TypeVar('T')


class SocketBuiltins(BuiltinGroup):
    """Functions that wait on the controller's clock, so they also work on the virtual clock."""

    def __init__(self, controller: Controller) -> None:
        """Begin with no reads counted."""
        super().__init__(controller)
        #: Socket name -> the cycle of its last read, and the number of reads in that cycle.
        self._reads: dict[str, tuple[int, int]] = {}

    @property
    def _sockets(self) -> ScriptSockets:
        return self._controller.sockets

    @property
    def _now(self) -> float:
        return self._controller.time

    def socket_open(
        self, address: Value, port: Value, socket_name: Value = 'socket_0'
    ) -> Generator[None, None, bool]:
        """Connect; return whether this succeeds within 2 s."""
        name, port_ = text(socket_name, 'socket_name'), whole(port, 'port')
        if not 0 <= port_ <= MAX_PORT:
            self._sockets.close(name)
            return False
        self._sockets.open(name, text(address, 'address'), port_)
        # A peer on the same computer is connected by now.
        self._sockets.poll()
        deadline = self._now + CONNECT_TIMEOUT
        while self._sockets.state(name) is SocketState.CONNECTING:
            if self._now >= deadline:
                self._sockets.close(name)
                break
            yield
        return self._sockets.state(name) is SocketState.OPEN

    def socket_close(self, socket_name: Value = 'socket_0') -> None:
        """Close a socket; an unknown name is no error."""
        self._sockets.close(text(socket_name, 'socket_name'))

    def _wait(
        self, name: Value, timeout: Value, take: Callable[[bytearray], T | None]
    ) -> Generator[None, None, T | None]:
        """
        Wait until `take` finds a value in the received bytes, and return the value.

        :param take: returns the value and deletes its bytes; None = it has not fully arrived.
        :returns: None = timeout, or the socket is closed.
        """
        limit = number(timeout, 'timeout')
        deadline = self._now + limit if limit > 0.0 else float('inf')
        name_ = text(name, 'socket_name')
        if self._count_read(name_):
            yield
        while True:
            found = take(self._sockets.received(name_))
            if found is not None:
                return found
            if self._now >= deadline or self._sockets.state(name_) is not SocketState.OPEN:
                return None
            yield

    def _count_read(self, name: str) -> bool:
        """Count a read of a socket; return whether the read has to wait for the next cycle."""
        now = self._controller.cycles
        cycle, reads = max(self._reads.get(name, (now, 0)), (now, 0))
        cycle, reads = (cycle, reads + 1) if reads < READS_PER_CYCLE else (cycle + 1, 1)
        self._reads[name] = cycle, reads
        return cycle > now

    def socket_read_binary_integer(
        self, number: Value, socket_name: Value = 'socket_0', timeout: Value = 2
    ) -> Generator[None, None, list[int]]:
        """Return 32 bit integers in network order as [n, v1 .. vn]; on failure [0, -1 .. -1]."""
        count = _count(number)
        data = yield from self._wait(socket_name, timeout, _exactly(4 * count))
        if data is None:
            return [0] + [-1] * count
        return [count, *struct.unpack(f'>{count}i', data)]

    def socket_read_byte_list(
        self, number: Value, socket_name: Value = 'socket_0', timeout: Value = 2
    ) -> Generator[None, None, list[int]]:
        """Return bytes as [n, v1 .. vn]; on failure [0, -1 .. -1]."""
        count = _count(number)
        data = yield from self._wait(socket_name, timeout, _exactly(count))
        return [0] + [-1] * count if data is None else [count, *data]

    def socket_read_ascii_float(
        self, number: Value, socket_name: Value = 'socket_0', timeout: Value = 2
    ) -> Generator[None, None, list[float]]:
        """Return `(1.4, 2)` as [2, 1.4, 2]; missing numbers are nan, on failure all of them."""
        count = _count(number)
        data = yield from self._wait(socket_name, timeout, _through(b')'))
        try:
            values = [float(item) for item in (data or b'').decode().strip('() \r\n').split(',')]
        except ValueError:
            values = []
        if len(values) > count:
            values = []
        return [float(len(values)), *values] + [float('nan')] * (count - len(values))

    def socket_read_string(
        self,
        socket_name: Value = 'socket_0',
        prefix: Value = '',
        suffix: Value = '',
        interpret_escape: Value = False,
        timeout: Value = 2,
    ) -> Generator[None, None, str]:
        """Return all received text, or the part between prefix and suffix; on failure, ''."""
        before, after = (_bytes(prefix, interpret_escape), _bytes(suffix, interpret_escape))
        data = yield from self._wait(socket_name, timeout, _between(before, after))
        return '' if data is None else data.decode('latin-1')

    def socket_read_line(
        self, socket_name: Value = 'socket_0', timeout: Value = 2
    ) -> Generator[None, None, str]:
        """Return one line without its line end; on failure, an empty string."""
        data = yield from self._wait(socket_name, timeout, _through(b'\n'))
        return '' if data is None else data.decode('latin-1').rstrip('\r\n')

    def socket_get_var(
        self, name: Value, socket_name: Value = 'socket_0'
    ) -> Generator[None, None, int]:
        """Send `GET name`; return the integer in the answer `name value`; on failure 0."""
        self._send(f'GET {text(name, "name")}\n'.encode('latin-1', 'replace'), socket_name)
        answer = yield from self.socket_read_line(socket_name)
        try:
            value = int(float(answer.split()[1]))
        except (IndexError, ValueError, OverflowError):
            return 0
        return value if INT_MIN <= value <= INT_MAX else 0

    def socket_set_var(self, name: Value, value: Value, socket_name: Value = 'socket_0') -> None:
        """Send `SET name value`."""
        line = f'SET {text(name, "name")} {whole(value, "value")}\n'
        self._send(line.encode('latin-1', 'replace'), socket_name)

    def socket_send_int(self, value: Value, socket_name: Value = 'socket_0') -> bool:
        """Send a 32 bit integer in network order; return whether the socket accepts it."""
        return self._send(struct.pack('>i', int32(value, 'value')), socket_name)

    def socket_send_byte(self, value: Value, socket_name: Value = 'socket_0') -> bool:
        """Send the lowest 8 bits of a value as a byte; return whether the socket accepts it."""
        return self._send(bytes([whole(value, 'value') & 0xFF]), socket_name)

    def socket_send_string(self, str: Value, socket_name: Value = 'socket_0') -> bool:
        """Send a value as text; return whether the socket accepts it."""
        return self._send(to_text(str).encode('latin-1', 'replace'), socket_name)

    def socket_send_line(self, str: Value, socket_name: Value = 'socket_0') -> bool:
        """Send a value as text with a line end; return whether the socket accepts it."""
        return self._send((to_text(str) + '\n').encode('latin-1', 'replace'), socket_name)

    def _send(self, data: bytes, socket_name: Value) -> bool:
        return self._sockets.send(text(socket_name, 'socket_name'), data)


def _count(value: Value) -> int:
    count = whole(value, 'number')
    if not 0 <= count <= MAX_NUMBERS:
        raise RuntimeException(f'number is {count}; a read takes at most {MAX_NUMBERS} values')
    return count


def _bytes(value: Value, interpret_escape: Value) -> bytes:
    raw = text(value, 'prefix or suffix').encode('latin-1', 'replace')
    if not interpret_escape:
        return raw
    try:
        return raw.decode('unicode_escape').encode('latin-1', 'replace')
    except UnicodeDecodeError:
        raise RuntimeException(
            f'the prefix or suffix {raw.decode("latin-1")!r} has an unfinished escape sequence'
        ) from None


def _take(received: bytearray, size: int) -> bytes:
    data = bytes(received[:size])
    del received[:size]
    return data


def _exactly(size: int) -> Callable[[bytearray], bytes | None]:
    return lambda received: None if len(received) < size else _take(received, size)


def _through(end: bytes) -> Callable[[bytearray], bytes | None]:
    def take(received: bytearray) -> bytes | None:
        at = received.find(end)
        return None if at < 0 else _take(received, at + len(end))

    return take


def _between(before: bytes, after: bytes) -> Callable[[bytearray], bytes | None]:
    def take(received: bytearray) -> bytes | None:
        start = received.find(before)
        if start < 0 or not received:
            return None
        start += len(before)
        end = received.find(after, start) if after else min(len(received), start + MAX_CHARACTERS)
        return None if end < 0 else _take(received, end + len(after))[start:end]

    return take
