# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Basics of all wire formats: fixed-point numbers and bounded buffers.

Every number on the robot program's sockets is a big-endian int32, usually a value times 1,000,000.
A value that does not fit raises an error before a byte is sent; otherwise the robot would read a
wrapped number and move to a wrong place.

A stream is cut into records (of a fixed size), frames (which begin with their size) or lines. Each
buffer holds at most one incomplete unit, of a bounded size, so a peer that sends nonsense cannot
exhaust the memory. A stream that ends inside a unit is an error, because something was lost.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from typing import Generic, TypeVar

from ur_cartesian_driver.motion.errors import LocalProtocolError, RemoteProtocolError

#: Factor by which a value is multiplied before it is rounded to an integer.
FIXED_POINT = 1_000_000

INT32_MIN = -(2**31)
INT32_MAX = 2**31 - 1

T = TypeVar('T')
E = TypeVar('E', bound=IntEnum)

#: Largest number of bytes that an error text quotes.
_MAX_QUOTED = 48


def to_fixed(value: float, field: str, scale: int = FIXED_POINT) -> int:
    """
    Return a value, scaled and rounded to an int32; ties are rounded away from zero.

    :param field: name of the value, for the error text.
    :raises LocalProtocolError: the value is not finite or does not fit.
    """
    scaled = value * scale
    # NaN fails this comparison, too. The bounds include values that round to INT32_MIN or _MAX.
    if not INT32_MIN - 0.5 < scaled < INT32_MAX + 0.5:
        raise range_error(value, field, scale)
    whole = int(scaled)
    # The difference is exact; adding 0.5 first would round 0.49999999999999994 up.
    rest = scaled - whole
    if rest >= 0.5:
        return whole + 1
    return whole - 1 if rest <= -0.5 else whole


def range_error(value: float, field: str, scale: int = FIXED_POINT) -> LocalProtocolError:
    """Return the error for a value that does not fit into an int32."""
    return LocalProtocolError(
        f'{field} is {value!r}, but only finite numbers from {INT32_MIN / scale!r} to '
        f'{INT32_MAX / scale!r} can be sent to the robot.'
    )


def hex_text(data: bytes) -> str:
    """Return bytes as hexadecimal digits for an error text, truncated if there are many."""
    text = data[:_MAX_QUOTED].hex()
    return f'{text}... ({len(data)} bytes)' if len(data) > _MAX_QUOTED else text or 'no bytes'


class RecordDecoder(Generic[T]):
    """Decodes a stream of records of a fixed size."""

    def __init__(self, size: int, what: str, decode: Callable[[bytes], T]) -> None:
        """
        Start empty.

        :param size: bytes in a record.
        :param what: the name of a record, for error texts.
        :param decode: turns one record into a message.
        """
        self._size = size
        self._what = what
        self._decode = decode
        self._rest = b''

    def feed(self, data: bytes) -> list[T]:
        """
        Take bytes from the stream (``b''`` = end of stream) and return the messages in them.

        :raises RemoteProtocolError: a record is invalid, or the stream ended inside one.
        """
        if not data:
            if self._rest:
                raise truncated_stream(self._what, self._rest)
            return []
        data = self._rest + data
        end = len(data) - len(data) % self._size
        self._rest = data[end:]
        return [self._decode(data[i : i + self._size]) for i in range(0, end, self._size)]


class ResultDecoder(RecordDecoder[E]):
    """Decodes a stream of results, each one int32 that is a member of an enum."""

    def __init__(self, enum: type[E], what: str) -> None:
        """
        Start empty.

        :param what: the name of a result, for error texts.
        """

        def decode(record: bytes) -> E:
            number = int.from_bytes(record, 'big', signed=True)
            try:
                return enum(number)
            except ValueError:
                members = [str(int(member)) for member in enum]
                raise RemoteProtocolError(
                    f'{number} is not a {what} ({", ".join(members[:-1])} or {members[-1]}): '
                    f'{hex_text(record)}.'
                ) from None

        super().__init__(4, what, decode)


class FrameBuffer:
    """
    Cuts a stream into frames that begin with their total size (big-endian).

    ::

        bytes            content
        0 .. width-1     size of the whole frame, this number included
        width .. size-1  the rest

    """

    def __init__(self, size_width: int, min_size: int, max_size: int, what: str) -> None:
        """
        Start empty.

        :param size_width: width of the size field [bytes].
        :param min_size: smallest size of a frame [bytes].
        :param max_size: largest accepted size of a frame [bytes]; a larger one is an error.
        :param what: the name of a frame, for error texts.
        """
        self._width = size_width
        self._bounds = (min_size, max_size)
        self._what = what
        self._buffer = bytearray()

    @property
    def is_empty(self) -> bool:
        """Return whether the stream is between two frames."""
        return not self._buffer

    def feed(self, data: bytes) -> list[bytes]:
        """
        Take bytes from the stream (``b''`` = end of stream) and return the complete frames.

        :raises RemoteProtocolError: a size is impossible, or the stream ended inside a frame.
        """
        if not data:
            if self._buffer:
                raise truncated_stream(self._what, bytes(self._buffer))
            return []
        self._buffer += data
        frames = []
        start = 0
        while (size := self._size_at(start)) and start + size <= len(self._buffer):
            frames.append(bytes(self._buffer[start : start + size]))
            start += size
        del self._buffer[:start]
        return frames

    def _size_at(self, start: int) -> int:
        """Return the size of the frame at an offset; 0 = not known yet."""
        head = self._buffer[start : start + self._width]
        if len(head) < self._width:
            return 0
        size = int.from_bytes(head, 'big')
        min_size, max_size = self._bounds
        if not min_size <= size <= max_size:
            raise RemoteProtocolError(
                f'The size of a {self._what} is given as {size} bytes, but only {min_size} to '
                f'{max_size} are possible: {hex_text(bytes(self._buffer[start:]))}.'
            )
        return size


class LineBuffer:
    """
    Cuts a stream into lines of text; a carriage return before the line feed is dropped.

    Bytes that are not in the encoding become backslash escapes, so that an odd character in a text
    for people does not end a connection.
    """

    def __init__(self, limit: int = 65536, encoding: str = 'utf-8') -> None:
        """
        Start empty.

        :param limit: longest accepted line [bytes]; a longer one is an error.
        """
        self._limit, self._encoding = limit, encoding
        self._rest = b''

    def feed(self, data: bytes) -> list[str]:
        """
        Take bytes from the stream (``b''`` = end of stream) and return the complete lines.

        :raises RemoteProtocolError: a line is too long, or the stream ended inside a line.
        """
        if not data:
            if self._rest:
                raise truncated_stream('line', self._rest)
            return []
        *lines, self._rest = (self._rest + data).split(b'\n')
        for line in (*lines, self._rest):
            if len(line) > self._limit:
                self._rest = b''
                raise RemoteProtocolError(
                    f'A line is longer than {self._limit} bytes: {hex_text(line)}.'
                )
        return [decode_text(line.removesuffix(b'\r'), self._encoding) for line in lines]


def decode_text(data: bytes, encoding: str = 'utf-8') -> str:
    """Decode received bytes; bytes that are not in the encoding become backslash escapes."""
    return data.decode(encoding, 'backslashreplace')


#: Longest text from a robot shown to people [characters].
_MAX_SHOWN = 400


def to_single_line(text: str) -> str:
    """
    Return a text from a robot, for a log or a message, as one line of bounded length.

    Unprintable characters become spaces: they could forge lines or control the terminal.
    """
    shown = ''.join(c if c.isprintable() else ' ' for c in text[:_MAX_SHOWN]).strip()
    return f'{shown}...' if len(text) > _MAX_SHOWN else shown


def truncated_stream(what: str, rest: bytes) -> RemoteProtocolError:
    """Return the error for a stream that ended too early."""
    return RemoteProtocolError(f'The stream ended inside a {what}: {hex_text(rest)}.')
