# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The trajectory point interface: motion primitives to the robot program, one result back.

A point is 21 big-endian int32, 84 bytes: the numbers of
:mod:`~ur_cartesian_driver.protocol.program.point_fields`, scaled.

The sender must

* announce the points on the reverse interface first (``TrajectoryAction.START`` with their number,
  or ``STREAM_START``), and send no more than announced;
* send the next point in time: the robot waits 0.5 s for it, but only one controller step while a
  spline moves. A late point means ``TrajectoryResult.FAILURE``;
* send reverse messages all the while, or the program halts;
* end at rest. The robot sets the blend radius of the last point of a counted trajectory to 0.

The result is one int32: 0 success, 1 canceled, 2 failure. It comes in a segment of its own.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import islice
import struct

import numpy as np
from numpy.typing import NDArray

from ur_cartesian_driver.motion.errors import LocalProtocolError, RemoteProtocolError
from ur_cartesian_driver.motion.events import TrajectoryResult
from ur_cartesian_driver.motion.primitive import Instruction
from ur_cartesian_driver.protocol.framing import (
    checked_size,
    FIXED_POINT,
    from_fixed,
    hex_text,
    INT32_MAX,
    INT32_MIN,
    range_error,
    ResultDecoder,
    to_fixed,
)
from ur_cartesian_driver.protocol.program.point_fields import (
    check_fields,
    field_names,
    from_fields,
    MotionType,
    PointFields,
    to_fields,
)
from ur_cartesian_driver.protocol.program.wire_dialects import Dialect, NEWEST_DIALECT

#: Number of outputs that may wait for their trigger poses at one time.
MAX_PENDING_OUTPUTS = 64
POINT_FIELDS = 21
POINT_SIZE = 4 * POINT_FIELDS

_POINT = struct.Struct('>21i')


def encode_fields(fields: PointFields, dialect: Dialect = NEWEST_DIALECT) -> bytes:
    """
    Return the 84 bytes of 21 numbers.

    :raises LocalProtocolError: a number cannot be sent.
    """
    check_fields(fields, dialect)
    spline = fields[20] == MotionType.SPLINE
    names = field_names(fields[20], dialect)
    words = [to_fixed(value, name) for value, name in zip(fields[:18], names[:18], strict=True)]
    word18 = to_fixed(fields[18], names[18], dialect.time_scale)
    word19 = int(fields[19]) if spline else to_fixed(fields[19], names[19], dialect.time_scale)
    return _POINT.pack(*words, word18, word19, int(fields[20]))


def decode_fields(data: bytes, dialect: Dialect = NEWEST_DIALECT) -> PointFields:
    """
    Return the 21 numbers of 84 bytes, in SI units.

    :raises RemoteProtocolError: the size is wrong.
    """
    words = _POINT.unpack(checked_size(data, POINT_SIZE, 'trajectory point'))
    scale = dialect.time_scale
    word19 = words[19] if words[20] == MotionType.SPLINE else from_fixed(words[19], scale)
    return (
        *(from_fixed(word) for word in words[:18]),
        from_fixed(words[18], scale),
        word19,
        words[20],
    )


def encode_point(primitive: Instruction, dialect: Dialect = NEWEST_DIALECT) -> bytes:
    """
    Return the 84 bytes of a primitive.

    :raises LocalProtocolError: a value cannot be sent; the text names the field and the bound.
    """
    return encode_fields(to_fields(primitive, dialect), dialect)


def decode_point(data: bytes, dialect: Dialect = NEWEST_DIALECT) -> Instruction:
    """
    Return the primitive or output of 84 bytes.

    :raises RemoteProtocolError: the size is wrong, or a type, kind or mode is unknown.
    """
    try:
        return from_fields(decode_fields(data, dialect), dialect)
    except RemoteProtocolError as error:
        raise RemoteProtocolError(f'{error} Bytes: {hex_text(data)}') from None


#: Points encoded at once: large enough for numpy, small enough for the cache.
_CHUNK = 4096


def encode_points(primitives: Iterable[Instruction], dialect: Dialect = NEWEST_DIALECT) -> bytes:
    """
    Return the bytes of many primitives, as :func:`encode_point` does one by one, but faster.

    :raises LocalProtocolError: names the point (from 0), the field and the bound.
    """
    chunks = []
    iterator = iter(primitives)
    first = 0
    while chunk := list(islice(iterator, _CHUNK)):
        chunks.append(_encode_chunk(chunk, first, dialect))
        first += len(chunk)
    return b''.join(chunks)


def _encode_chunk(primitives: list[Instruction], first: int, dialect: Dialect) -> bytes:
    rows = []
    for index, primitive in enumerate(primitives, first):
        try:
            fields = to_fields(primitive, dialect)
            check_fields(fields, dialect)
        except LocalProtocolError as error:
            raise LocalProtocolError(f'Point {index}: {error}') from None
        rows.append(fields)
    return _encode_rows(np.array(rows, dtype=np.float64), first, dialect)


def _encode_rows(fields: NDArray[np.float64], first: int, dialect: Dialect) -> bytes:
    """Return the bytes of rows of fields (n, 21), and check their range."""
    scales = np.array([FIXED_POINT] * 18 + [dialect.time_scale] * 2 + [1], dtype=np.float64)
    with np.errstate(over='ignore'):  # infinite values are refused below
        scaled = fields * scales
    spline = fields[:, 20] == MotionType.SPLINE
    scaled[spline, 19] = fields[spline, 19]
    bad = ~((scaled > INT32_MIN - 0.5) & (scaled < INT32_MAX + 0.5))
    if bad.any():
        row, column = (int(i) for i in np.argwhere(bad)[0])
        error = range_error(
            float(fields[row, column]),
            field_names(fields[row, 20], dialect)[column],
            int(scales[column]),
        )
        raise LocalProtocolError(f'Point {first + row}: {error}')
    # Ties away from zero, as in to_fixed().
    size = np.abs(scaled)
    whole = np.floor(size)
    whole += size - whole >= 0.5
    words = np.copysign(whole, scaled)
    return words.astype('>i4').tobytes()


class TrajectoryResultDecoder(ResultDecoder[TrajectoryResult]):
    """Decodes the results that the robot program sends."""

    def __init__(self) -> None:
        """Start empty."""
        super().__init__(TrajectoryResult, 'trajectory result')
