# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The trajectory point interface: points go to the robot program, which answers with a result.

A point is 21 big-endian int32, 84 bytes: the numbers of
:mod:`~ur_cartesian_driver.protocol.program.point_fields`, scaled. The :class:`Dialect` checks the
numbers, and arranges their words for older robot programs.

The sender must

* announce the points on the reverse interface first (``TrajectoryAction.START`` with their number,
  or ``STREAM_START``), and send no more than announced;
* send the next point in time: the robot waits 0.5 s for it, but only one controller step while a
  spline moves. A late point means ``TrajectoryResult.FAILURE``;
* keep sending reverse messages meanwhile, or the program halts;
* end the trajectory at rest. After a START, which announces the number of points, the robot sets
  the blend radius of the last one to 0.

The result of a trajectory is one int32: 0 success, 1 canceled, 2 failure; from our own program
also 3 input missing, 4 contact, 5 no contact, 6 touched. It comes in a TCP segment of its own.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ur_cartesian_driver.motion.errors import LocalProtocolError
from ur_cartesian_driver.motion.events import TrajectoryResult
from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.plan.move_rows import MoveRows, SplineRows
from ur_cartesian_driver.motion.plan.plan import Plan, PlannedRows
from ur_cartesian_driver.motion.plan.primitive import Instruction
from ur_cartesian_driver.protocol.framing import (
    FIXED_POINT,
    INT32_MAX,
    INT32_MIN,
    range_error,
    ResultDecoder,
)
from ur_cartesian_driver.protocol.program.point_fields import (
    are_plain_moves,
    field_names,
    MotionType,
    move_fields,
    PointField,
    PointFields,
    spline_fields,
    to_fields,
)
from ur_cartesian_driver.protocol.program.wire_dialects import Dialect, DIALECTS, NEWEST_DIALECT

#: Number of outputs that may wait for their trigger poses at one time.
MAX_PENDING_OUTPUTS = 64
#: Number of outputs that may be past their trigger poses and wait until their leads begin.
MAX_LEADS = 8
#: Number of outputs that may give pulses in one goal.
MAX_PULSE_TRAINS = 4
POINT_FIELDS = 21
POINT_SIZE = 4 * POINT_FIELDS

#: Number of points encoded at once: large enough for numpy, small enough for the cache.
_CHUNK = 4096
#: Factors of words 0 to 17.
_MOVE_SCALES = (FIXED_POINT,) * 18


def encode_points(instructions: Iterable[Instruction], dialect: Dialect = NEWEST_DIALECT) -> bytes:
    """
    Return the bytes of primitives and outputs, 84 for each.

    :raises LocalProtocolError: a value cannot be sent; the text gives the point's index
        (from 0) and the bound.
    """
    fields = [_checked_fields(each, i, dialect) for i, each in enumerate(instructions)]
    return encode_numbers(np.array(fields, dtype=np.float64).reshape(-1, POINT_FIELDS), dialect)


def encode_plan(plan: Plan) -> bytes:
    """
    Return the bytes of a plan, for the robot program for which the plan was made.

    :raises LocalProtocolError: a value cannot be sent; the text gives the record's index
        (from 0) and the bound.
    """
    return encode_rows(plan.rows, DIALECTS.get(plan.older_program, NEWEST_DIALECT))


def encode_rows(rows: PlannedRows, dialect: Dialect = NEWEST_DIALECT) -> bytes:
    """
    Return the bytes of a plan's segments, like :func:`encode_points` but from columns.

    :raises LocalProtocolError: a value cannot be sent; the text gives the record's index
        (from 0) and the bound.
    """
    moves, records = rows.primitives, rows.records
    first = np.cumsum(records) - records
    fields = np.zeros((int(records.sum()), POINT_FIELDS))
    accepted = np.zeros(len(fields), dtype=np.bool_)
    others: dict[int, Instruction] = {}
    if isinstance(moves, SplineRows):
        fields[first], accepted[first] = spline_fields(moves), moves.durations > 0.0
    elif isinstance(moves, MoveRows):
        for begin in range(0, len(moves), _CHUNK):  # all at once would need twice the memory
            part = slice(begin, begin + _CHUNK)
            fields[first[part]] = move_fields(moves[part])
        accepted[first] = are_plain_moves(moves)
        others |= {int(first[row]): move for row, move in moves.others.items()}
    else:
        others |= zip(first.tolist(), moves, strict=True)
    accepted &= dialect.accepts(fields)
    for row, outputs in rows.outputs.items():
        others |= {int(first[row]) + 1 + k: output for k, output in enumerate(outputs)}
    for record in np.flatnonzero(~accepted).tolist():
        instruction = others.get(record) or moves[int(np.searchsorted(first, record))]
        fields[record] = _checked_fields(instruction, record, dialect)
    return encode_numbers(fields, dialect)


def encode_numbers(fields: Floats, dialect: Dialect = NEWEST_DIALECT) -> bytes:
    """
    Return the bytes of rows (n, 21) in SI units, which the dialect has accepted.

    :raises LocalProtocolError: a number does not fit; the text names the first one.
    """
    return b''.join(
        _encode_chunk(fields[first : first + _CHUNK], first, dialect)
        for first in range(0, len(fields), _CHUNK)
    )


class TrajectoryResultDecoder(ResultDecoder[TrajectoryResult]):
    """Decodes the results that the robot program sends."""

    def __init__(self) -> None:
        """Start empty."""
        super().__init__(TrajectoryResult, 'trajectory result')


def _checked_fields(instruction: Instruction, index: int, dialect: Dialect) -> PointFields:
    try:
        fields = to_fields(instruction)
        dialect.check_fields(fields)
    except LocalProtocolError as error:
        raise LocalProtocolError(f'Point {index}: {error}') from None
    return fields


def _encode_chunk(fields: Floats, first: int, dialect: Dialect) -> bytes:
    """Return the bytes of consecutive rows, the first of which is point ``first``."""
    scales = np.where(
        fields[:, [PointField.TYPE]] == MotionType.SPLINE,
        _scales(MotionType.SPLINE, dialect),
        _scales(MotionType.MOVEJ, dialect),
    )
    with np.errstate(over='ignore'):  # infinite values are refused below
        scaled = fields * scales
    fits = (scaled > INT32_MIN - 0.5) & (scaled < INT32_MAX + 0.5)  # NaN does not fit
    if not fits.all():
        row, column = (int(i) for i in np.argwhere(~fits)[0])
        name = field_names(fields[row])[column]
        error = range_error(float(fields[row, column]), name, int(scales[row, column]))
        raise LocalProtocolError(f'Point {first + row}: {error}')
    return dialect.arrange(_round_half_away(scaled).astype('>i4')).tobytes()


def _scales(motion_type: float, dialect: Dialect) -> tuple[int, ...]:
    """Return the factor on the wire for each of the 21 numbers."""
    time = dialect.time_scale
    # Word 19 is the kind of a spline, but the blend radius of other motions.
    word19 = 1 if motion_type == MotionType.SPLINE else time
    return (*_MOVE_SCALES, time, word19, 1)


def _round_half_away(values: Floats) -> Floats:
    """Return the values rounded to whole numbers, ties away from zero like :func:`to_fixed`."""
    size = np.abs(values)
    whole = np.floor(size)
    # The difference is exact; adding 0.5 first would round 0.49999999999999994 up.
    whole += size - whole >= 0.5
    return np.copysign(whole, values)
