# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The numbers and times in the cells of a table; for any other cell, an error names the row."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime, time, UTC
import re

import numpy as np

from ur_cartesian_driver.importing.imported_path import BrokenFile, ImportNotes, MAX_DISTANCE
from ur_cartesian_driver.importing.tables.column_names import POSITION, ROLES
from ur_cartesian_driver.importing.tables.table_columns import Column
from ur_cartesian_driver.importing.text_file import quoted
from ur_cartesian_driver.motion.geometry.arrays import Floats

#: Matches a number; Python's float() also accepts underscores, digits of other scripts, and nan.
_NUMBER = re.compile(r'\s*[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?\s*', re.IGNORECASE | re.ASCII)
#: All numbers of a table are smaller than this: even the ns since 1970 have only 19 digits.
_MAX_NUMBER = 1e30
_NO_CHARACTER_OF_IT = re.compile(r'[^-+.0-9eE \t]')
#: In a text with one cell on each line: a cell with thousands separators, and a cell whose comma
#: must separate decimals. The comma in 1,234 could be either.
_WITH_THOUSANDS = re.compile(r'[.,][^\n,.]*,|,[^\n,.]*\.')
_CERTAIN_COMMA = re.compile(r'^(?!\s*[-+]?[1-9]\d{0,2},\d{3}\s*$).*,.*$', re.MULTILINE | re.ASCII)
#: Matches a time of day with two colons; 01:30 could be minutes and seconds.
_MOMENT = re.compile(r'\d:\d\d:\d')
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
#: The years 2000 to 2100 [s since 1970]. The times of clocks with another origin, such as the ns
#: since a computer was switched on or the ticks of .NET, are outside these years in every unit.
_CENTURY = (946_684_800.0, 4_102_444_800.0)
#: Units to try for times without a unit that would be after 2100 in seconds.
_UNIX_UNITS = ((1e-9, 'ns'), (1e-6, 'us'), (1e-3, 'ms'))


def cell_values(
    texts: dict[Column, list[str]], lines: Sequence[int], remarks: ImportNotes
) -> dict[str, Floats]:
    """
    Return the columns by their roles, in SI units.

    :raises BrokenFile: a cell is no number; the error names the first such row.
    """
    values, faults = {}, []
    for column, cells in _with_points(texts, lines).items():
        try:
            read = (
                _times(column, cells, lines, remarks)
                if column.role == 't'
                else _numbers(column, cells, lines)
            )
            values[column.role] = column.factor * read
        except BrokenFile as fault:
            faults.append(fault)
    if faults:
        raise min(faults, key=lambda fault: fault.line)
    if 'sec' in values:
        values['t'] = values['sec'] + values['nanosec']
    return values


def _numbers(column: Column, cells: Sequence[str], lines: Sequence[int]) -> Floats:
    """
    Return the numbers of a column.

    :raises BrokenFile: a cell is no finite number.
    """
    try:
        numbers = np.array(list(map(float, cells)))
    except ValueError:
        numbers = np.array([np.nan])
    if (np.abs(numbers) < _MAX_NUMBER).all() and not _NO_CHARACTER_OF_IT.search(''.join(cells)):
        return numbers
    for line, cell in zip(lines, cells, strict=True):
        if not cell.strip():
            raise BrokenFile(line, f'the cell of {column.title!r} is empty')
        if _NUMBER.fullmatch(cell) is None or not abs(float(cell)) < _MAX_NUMBER:
            text = cell.strip(' \t')
            raise BrokenFile(line, f'{quoted(text)} is no number ({column.title})')
    return numbers


def _times(
    column: Column, cells: Sequence[str], lines: Sequence[int], remarks: ImportNotes
) -> Floats:
    """
    Return the times of a column in its unit; the cells are numbers, or dates and times of day.

    :raises BrokenFile: a cell is neither, or the unit is not certain.
    """
    if _MOMENT.search(cells[0]):
        return _moments(cells, lines)
    times = _numbers(column, cells, lines)
    row = int(np.abs(times).argmax())
    latest = abs(times[row])
    if column.has_unit or latest <= _CENTURY[1]:
        return times
    for factor, unit in _UNIX_UNITS:
        if _CENTURY[0] <= latest * factor <= _CENTURY[1]:
            remarks.add(0, f'the times of {column.title!r}', f'read as {unit} since 1970')
            return times * factor
    raise BrokenFile(
        lines[row],
        f'the time {cells[row].strip()} has no unit, and is of no year from 2000 to 2100 in s, '
        f'ms, us or ns; write the unit, such as {column.title} [ns]',
    )


def _moments(cells: Sequence[str], lines: Sequence[int]) -> Floats:
    """
    Return the seconds of dates with times, or of times of day.

    :raises BrokenFile: a cell is neither, or not in the notation of the first one.
    """
    seconds = [_seconds(cell, line) for line, cell in zip(lines, cells, strict=True)]
    for line, cell in zip(lines, cells, strict=True):
        if _MOMENT.search(cell) is None or _has_date(cell) != _has_date(cells[0]):
            raise BrokenFile(
                line, f'{quoted(cell.strip())} is no time such as {cells[0].strip()} before it'
            )
    return np.array(seconds)


def _has_date(cell: str) -> bool:
    return len(cell.strip().partition(':')[0]) > 2


def _seconds(cell: str, line: int) -> float:
    """
    Return the seconds from 1970 to a date and time, or from midnight to a time of day.

    :raises BrokenFile: the cell is neither.
    """
    try:
        moment = datetime.fromisoformat(cell.strip())
    except ValueError:
        try:
            moment = datetime.combine(_EPOCH, time.fromisoformat(cell.strip()))
        except ValueError:
            raise BrokenFile(
                line, f'{quoted(cell.strip())} is no time such as 2026-03-04T10:00:00.125'
            ) from None
    zoned = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
    return (zoned - _EPOCH).total_seconds()


def _with_points(texts: dict[Column, list[str]], lines: Sequence[int]) -> dict[Column, list[str]]:
    """
    Return the cells, with decimal points in place of decimal commas.

    :raises BrokenFile: cells have or may have thousands separators, or mix points and commas.
    """
    numeric = [column for column, cells in texts.items() if not _MOMENT.search(cells[0])]
    # One text, with a line for each cell, is searched faster than the cells one by one.
    joined = '\n'.join('\n'.join(texts[column]) for column in numeric)
    if ',' not in joined:
        return texts

    def cell_at(place: int) -> tuple[int, str]:
        row = joined.count('\n', 0, place)
        return lines[row % len(lines)], joined.split('\n', row + 1)[row].strip()

    line, cell = cell_at(joined.index(','))
    if (match := _WITH_THOUSANDS.search(joined)) is not None:
        line, cell = cell_at(match.start())
        raise BrokenFile(line, f'{quoted(cell)} has thousands separators; leave them out')
    if '.' in joined:
        other_line, other = cell_at(joined.index('.'))
        raise BrokenFile(
            other_line,
            f'{quoted(other)} has a decimal point, but {quoted(cell)} at line {line} a decimal '
            'comma; write points everywhere',
        )
    if _CERTAIN_COMMA.search(joined) is None and all(
        # The comma can separate thousands only if all points are then within reach of an arm.
        abs(float(cell.replace(',', ''))) * column.factor < MAX_DISTANCE
        for column in numeric
        if column.role in ROLES[POSITION]
        for cell in texts[column]
        if ',' in cell
    ):
        raise BrokenFile(
            line,
            f'{cell!r} can be {cell.replace(",", "")} or {cell.replace(",", ".")}; write it '
            'without thousands separators and with a decimal point',
        )
    count, cells = len(lines), joined.replace(',', '.').split('\n')
    return texts | {column: cells[i * count : (i + 1) * count] for i, column in enumerate(numeric)}
