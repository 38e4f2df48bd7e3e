# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The order in which a program's lines are executed: M98 calls subprograms, M99 ends them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
import re

from ur_cartesian_driver.importing.imported_path import BrokenFile

_NUMBER_LINE = re.compile(r'\s*(?:N\s*[0-9]+\s*)?[O:]\s*([0-9]{1,8})\s*(?:[(;].*)?', re.I)
_COMMENT = re.compile(r'\([^)]*\)|;.*')
_END = re.compile(r'M\s*0*(?:2|30)(?![0-9.])', re.I)
#: Largest depth of nested calls, as in Fanuc's controls and LinuxCNC.
_MAX_DEPTH = 10
#: Largest number of executed lines of all subprograms together.
_MAX_LINES = 200_000
#: Fanuc packs repetitions and a four-digit program number into one P: P51002 calls O1002 five
#: times.
_PACKED = 10_000


@dataclass(slots=True)
class _Call:
    number: int
    #: The index of the subprogram's first line.
    first: int
    #: The index of the line after the call.
    return_index: int
    repeats_left: int


class LineSequence:
    """Yields the lines of a program in the order of execution, with their numbers."""

    def __init__(self, lines: Sequence[str]) -> None:
        """Begin at the first line."""
        self._lines = lines
        self._next = 0
        self._calls: list[_Call] = []
        self._in_subprograms = 0
        self._is_executed = bytearray(len(lines))
        #: The line that ended the program; 0 = the last one.
        self.end_line = 0

    def __iter__(self) -> Iterator[tuple[int, str]]:
        """Yield the number (from 1) and the text of each line that is executed."""
        while self._next < len(self._lines):
            self._next += 1
            if self._calls:
                self._in_subprograms += 1
                if self._in_subprograms > _MAX_LINES:
                    raise BrokenFile(
                        self._next, f'subprograms would execute more than {_MAX_LINES} lines'
                    )
            self._is_executed[self._next - 1] = True
            yield self._next, self._lines[self._next - 1]
        if self._calls:
            raise BrokenFile(
                len(self._lines), f'the subprogram O{self._calls[-1].number} has no M99'
            )

    def end(self) -> None:
        """Execute no further line."""
        self.end_line = self._next
        self._calls.clear()
        self._next = len(self._lines)

    def never_executed(self) -> Iterator[int]:
        """Yield the numbers of the lines that have words and were not executed."""
        row = self._is_executed.find(False)
        while row >= 0:
            if _COMMENT.sub('', self._lines[row]).strip(' \t%'):
                yield row + 1
            row = self._is_executed.find(False, row + 1)

    def check_program_number(self, line: int, number: int, *, is_first: bool) -> None:
        """
        Accept an O number that is executed only if it is the first line of the main program.

        :param is_first: whether no code or word has been executed before.
        :raises BrokenFile: execution has run into another O number.
        """
        if self._calls:
            raise BrokenFile(
                line, f'the subprogram O{self._calls[-1].number} reaches O{number} without M99'
            )
        if not is_first:
            raise BrokenFile(line, f'the main program runs into O{number}; end it by M30 before')

    def call(self, line: int, words: dict[str, float]) -> None:
        """
        Continue at a subprogram (M98 P- L-).

        :raises BrokenFile: a word of the call is wrong, calls are nested too deeply, or the file
            lacks the subprogram.
        """
        number, repeats = words.get('P'), words.get('L', 1.0)
        if number is None or set(words) - {'P', 'L'}:
            raise BrokenFile(line, 'M98 takes P, the number of a subprogram, L, and nothing else')
        if number < 1.0 or number % 1.0 or repeats % 1.0 or not 0.0 <= repeats <= 9999.0:
            raise BrokenFile(line, 'M98 needs a whole P of at least 1, and L from 0 to 9999')
        first = self._first_line(line, int(number))
        if first is None and 'L' not in words and number >= _PACKED:
            repeats, packed = divmod(number, _PACKED)
            if (first := self._first_line(line, int(packed))) is not None:
                number = packed
        if first is None:
            raise BrokenFile(line, f'O{number:g} is not in the file, and other files are not read')
        if len(self._calls) == _MAX_DEPTH:
            raise BrokenFile(line, f'subprograms are nested more than {_MAX_DEPTH} deep')
        self._is_executed[first - 1] = True  # its O number
        if repeats:
            self._calls.append(_Call(int(number), first, self._next, int(repeats) - 1))
            self._next = first

    def back(self, line: int, words: dict[str, float]) -> bool:
        """
        Repeat the subprogram, or continue after its call (M99).

        In the main program, end it and return False.

        :raises BrokenFile: M99 names a line to continue at, or is in the main program before an
            M2 or M30.
        """
        if words:
            raise BrokenFile(line, 'M99 with a line to continue at (P) is not read')
        if not self._calls:
            if any(_END.search(_COMMENT.sub('', text)) for text in self._lines[line:]):
                raise BrokenFile(
                    line,
                    'M99 ends the main program; put the main program first, with M30 at its end',
                )
            self.end()
            return False
        call = self._calls[-1]
        if call.repeats_left:
            call.repeats_left -= 1
            self._next = call.first
        else:
            self._calls.pop()
            self._next = call.return_index
        return True

    def _first_line(self, line: int, number: int) -> int | None:
        """Return the index of the first line of a subprogram; None = it is not in the file."""
        found = self._first_lines.get(number, [])
        if len(found) > 1:
            raise BrokenFile(line, f'O{number} is there twice, in lines {found[0]} and {found[1]}')
        return found[0] if found else None

    @cached_property
    def _first_lines(self) -> dict[int, list[int]]:
        found: dict[int, list[int]] = {}
        for index, text in enumerate(self._lines, start=1):
            if match := _NUMBER_LINE.fullmatch(text):
                found.setdefault(int(match[1]), []).append(index)
        return found
