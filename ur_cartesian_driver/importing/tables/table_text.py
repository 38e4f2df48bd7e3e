# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The header and rows of a table, in the dialects that programs write.

Columns are separated by semicolons, tabs, commas or blanks. Rows and header can have different
separators, because numpy.savetxt does not adapt its header to its delimiter. The header is the
first line that names a position and is not a comment. If the rows begin before such a line, the
header is the last comment, before the rows, that names a position.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Iterator
import csv
from dataclasses import dataclass, field
import itertools
import re
import string

from ur_cartesian_driver.importing.imported_path import BrokenFile, ImportNotes
from ur_cartesian_driver.importing.tables.column_units import is_unit

#: The separators of columns; None = any number of blanks.
_DELIMITERS = (';', '\t', ',', None)
_COMMENT = re.compile(r'\s*(?:#|%|//)[#%/\s]*')
_FIRST_LINE_OF_EXCEL = re.compile(r'\s*"?sep=(.)"?\s*', re.IGNORECASE)
#: Matches a title and its unit in brackets, in a header with blanks between the titles.
_TITLE = re.compile(r'"[^"]*"|[^\s"]+(?:\s+[\[(][^\])]*[\])])?')
#: The number of lines among which the header is searched for.
_MAX_PREAMBLE = 200
#: Headers to suggest in refusals, by the number of columns.
_SAMPLES = {
    3: 'x [mm],y [mm],z [mm]',
    6: 'x [mm],y [mm],z [mm],rx [rad],ry [rad],rz [rad]',
    7: 'x [mm],y [mm],z [mm],qx,qy,qz,qw',
    8: 'time [s],x [mm],y [mm],z [mm],qx,qy,qz,qw',
}


@dataclass(slots=True)
class Table:
    """A table of text."""

    #: The line number of the header; 0 = there is no header.
    line: int
    titles: list[str]
    #: All lines of the file.
    lines: list[str]
    #: None = columns are separated by blanks.
    delimiter: str | None
    #: Index in ``lines`` at which the rows begin.
    first: int
    #: The units in a second line of the header; empty = there is no such line.
    units: list[str] = field(default_factory=list)

    def rows(self) -> Iterator[tuple[int, list[str]]]:
        """
        Yield the line number and the cells of each row.

        :raises BrokenFile: a row has another number of cells than the header, or bad quotation
            marks.
        """
        width, delimiter = len(self.titles), self.delimiter
        # A spreadsheet ends with rows of empty cells.
        blank = string.whitespace + (delimiter or '')
        for number, line in enumerate(self.lines[self.first :], self.first + 1):
            start = line.lstrip()
            if not start.strip(blank) or (start[0] in '#%/' and _COMMENT.match(start)):
                continue
            cells = _cells(line, delimiter) if '"' in line else line.split(delimiter)
            if not cells:
                raise BrokenFile(number, 'its quotation marks do not enclose whole cells')
            if len(cells) != width:
                if len(cells) != width + 1 or cells[-1].strip():
                    raise BrokenFile(number, self._wrong_width(line, len(cells)))
                del cells[-1]  # a delimiter ends the row
            yield number, cells

    def _wrong_width(self, line: str, width: int) -> str:
        """Return the message about a row that has more or fewer columns than the header."""
        why = f'it has {width} column{"s" * (width != 1)}, but the header has {len(self.titles)}'
        if self.delimiter == ',' and width > len(self.titles) and '.' not in line:
            why += '; numbers with decimal commas need semicolons or tabs between them'
        return why


def read_table(
    lines: list[str], is_header: Callable[[list[str]], bool], unit: str, remarks: ImportNotes
) -> Table:
    """
    Return the table in the lines of a file; find its header and dialect.

    :param is_header: returns whether titles name a position.
    :param unit: the unit for three columns without a header; empty = such a table is refused.
    :raises BrokenFile: the file is empty, or has only numbers whose meaning is not known.
    """
    delimiters: tuple[str | None, ...] = _DELIMITERS
    header, before = None, []
    for i, line in enumerate(lines[:_MAX_PREAMBLE]):
        if first := _FIRST_LINE_OF_EXCEL.fullmatch(line):
            delimiters = (first[1],)
        elif line.strip():
            comment = _COMMENT.match(line)
            text = line[comment.end() :] if comment else line
            if titles := next(filter(is_header, _titles(text, delimiters)), None):
                header = (i + 1, titles)
            if not comment:
                # A number alone is the rate or count of a recorder, not a point.
                is_row = _is_numeric(line) and not _is_number(line)
                if (header and header[0] == i + 1) or is_row:
                    break
                before.append(i + 1)
    if header is None:
        return _without_header(lines, delimiters, unit, remarks)
    for number in before[: bisect_left(before, header[0])]:
        remarks.add(number, 'text before the header', 'it is no part of the table')
    return _with_rows(lines, *header, delimiters)


def _with_rows(
    lines: list[str], line: int, titles: list[str], delimiters: tuple[str | None, ...]
) -> Table:
    """Return the table with the delimiter of its first row."""
    header = lines[line - 1]
    order = sorted(delimiters, key=lambda d: d is not None and d not in header)
    table = Table(line, titles if titles[-1] else titles[:-1], lines, order[0], line)
    rows = (
        (number, text)
        for number, text in enumerate(lines[line:], line + 1)
        if text.strip() and not _COMMENT.match(text)
    )
    for number, text in itertools.islice(rows, 2):
        split = {d: [cell.strip() for cell in _cells(text, d)] for d in order}
        fitting = [d for d in order if _fits(split[d], len(table.titles))]
        # If no delimiter fits, use one that occurs in the row; the row will be refused later.
        table.delimiter = next(iter(fitting), next((d for d in order if d and d in text), None))
        if table.units or not (fitting and _are_units(split[table.delimiter])):
            break
        table.units, table.first = split[table.delimiter], number
    return table


def _fits(cells: list[str], width: int) -> bool:
    """Return whether a row has ``width`` cells, apart from an empty one at its end."""
    return bool(cells) and len(cells) - (not cells[-1]) <= width <= len(cells)


def _without_header(
    lines: list[str], delimiters: tuple[str | None, ...], unit: str, remarks: ImportNotes
) -> Table:
    """
    Return a table whose header is its first line, or x, y and z if that line has three numbers.

    :raises BrokenFile: the file is empty, or begins with numbers whose meaning or unit is not
        known.
    """
    number, line = next(
        (
            (i, line)
            for i, line in enumerate(lines, 1)
            if line.strip() and not (_COMMENT.match(line) or _FIRST_LINE_OF_EXCEL.fullmatch(line))
        ),
        (0, ''),
    )
    if not number:
        raise BrokenFile(0, 'the file is empty; its first line has to name the columns')
    delimiter = next((d for d in delimiters if d is not None and d in line), None)
    cells = [cell.strip() for cell in _cells(line, delimiter)]
    if cells and not cells[-1]:
        del cells[-1]
    if not _is_numeric(line):
        return Table(number, cells, lines, delimiter, number)
    if len(cells) == 3 and unit:
        remarks.add(0, 'no header', f'the columns are x, y and z [{unit}]')
        return Table(0, ['x', 'y', 'z'], lines, delimiter, number - 1)
    sample = _SAMPLES.get(len(cells), _SAMPLES[3])
    raise BrokenFile(number, f'no line before it names the columns; write one, such as {sample!r}')


def _titles(text: str, delimiters: tuple[str | None, ...]) -> Iterator[list[str]]:
    """Yield the lists of titles into which a line can be split."""
    for delimiter in delimiters:
        if delimiter is None:
            # Names that contain blanks are separated by wider gaps.
            yield re.split(r'\s{2,}|\t', text.strip())
            yield [title.strip('"') for title in _TITLE.findall(text)]
        elif delimiter in text:
            yield [title.strip() for title in _cells(text, delimiter)]


def _cells(line: str, delimiter: str | None) -> list[str]:
    """Return the cells of a line; empty = its quotation marks do not enclose whole cells."""
    if '"' not in line:
        return line.split(delimiter)
    if delimiter is None:
        # With this delimiter and skipinitialspace, the reader treats several blanks as one.
        line, delimiter = line.expandtabs(1).strip(), ' '
    try:
        return next(csv.reader([line], delimiter=delimiter, skipinitialspace=True, strict=True))
    except csv.Error:
        return []


def _is_numeric(line: str) -> bool:
    """Return whether more than half of the cells of a line are numbers."""
    cells = re.findall(r'[^;,\s"]+', line)
    return 2 * sum(map(_is_number, cells)) > len(cells)


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _are_units(cells: list[str]) -> bool:
    """Return whether a row is a second line of the header, which gives the units."""
    units = [cell.strip(' []()') for cell in cells]
    return any(is_unit(unit) and unit != '1' for unit in units) and all(
        not unit or is_unit(unit) for unit in units
    )
