# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Cuts the stream of a script port into programs and single lines.

A program begins with `def` or `sec` in column 1 and can come in any number of pieces. If its whole
body is indented, it ends with `end` in column 1, as the robot's manual demands. A program without
indentation ends when all its blocks have ended. (If blocks were counted in indented programs, too,
a program that lacks an inner `end` would never be complete, and its client would get no error.)
Any other line is a command or a statement.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
import re
from typing import TypeAlias

from ur_cartesian_driver.urscript.parsing.scanner import scan, TokenKind
from ur_cartesian_driver.urscript.script_errors import CompileError

#: Longest program [bytes]; compiling it takes about ten seconds. The manufacturer publishes no
#: such bound.
MAX_UPLOAD_SIZE = 1024 * 1024

#: The encoding of URScript on all ports. The manufacturer's manual speaks of "(extended) ASCII";
#: in this encoding each byte is a character, and no byte is an error.
SCRIPT_ENCODING = 'latin-1'

_BLOCKS = frozenset({'def', 'thread', 'if', 'while', 'switch'})
#: The first line of a program.
_FIRST_LINE = re.compile(r'(?:def|sec)\s')
#: A line that ends a program, unless an inner block is not indented.
_LAST_LINE = re.compile(r'end\s*(?:#.*)?$')
#: A word that opens or closes a block; most lines have none.
_BLOCK_WORD = re.compile(rf'\b(?:end|{"|".join(sorted(_BLOCKS))})\b')


@dataclass(frozen=True, slots=True)
class UploadedProgram:
    """A whole program, ready to be compiled."""

    text: str


@dataclass(frozen=True, slots=True)
class UploadedLine:
    """One line that belongs to no program."""

    text: str


@dataclass(frozen=True, slots=True)
class UploadTooLong:
    """A line or program that exceeds ``MAX_UPLOAD_SIZE``, so that the remainder is skipped."""

    text: str = (
        f'The program is longer than {MAX_UPLOAD_SIZE >> 20} MiB, which this controller does not '
        'take; split it.'
    )


UploadedItem: TypeAlias = UploadedProgram | UploadedLine | UploadTooLong


class UploadDecoder:
    """Decodes the stream of one connection."""

    def __init__(self) -> None:
        """Begin outside of any program."""
        self._rest = b''
        self._program: list[str] = []
        self._size = 0
        self._open_blocks = 0
        self._indented = True
        #: Whether the remainder of a program that is too long is being received.
        self._skipping = False

    def feed(self, data: bytes) -> list[UploadedItem]:
        """Return complete programs and lines; a program that is too long is reported once."""
        *lines, self._rest = (self._rest + data).split(b'\n')
        found = [item for line in lines if (item := self._line(line)) is not None]
        if self._size + len(self._rest) > MAX_UPLOAD_SIZE:
            self._rest = b''
            if not self._skipping:
                found.append(self._skip())
        return found

    def _skip(self) -> UploadTooLong:
        """Discard the program, and skip its remaining lines up to an `end` in column 1."""
        self._program, self._size, self._skipping = [], 0, True
        return UploadTooLong()

    def _line(self, data: bytes) -> UploadedItem | None:
        line = data.decode(SCRIPT_ENCODING).rstrip('\r')
        is_last = _LAST_LINE.match(line) is not None
        if self._skipping:
            self._skipping = not _LAST_LINE.match(line)
            return None
        if not self._program:
            if not _FIRST_LINE.match(line):
                bare = line.strip()
                return UploadedLine(bare) if bare and not bare.startswith('#') else None
            # The word "sec" opens a block only here: elsewhere it is a name.
            self._size, self._open_blocks, self._indented = 0, int(line.startswith('sec')), True
        elif line[:1] not in ('', ' ', '\t', '#') and not is_last:
            self._indented = False
        self._program.append(line)
        self._size += len(data)
        if self._size > MAX_UPLOAD_SIZE and not is_last:
            return self._skip()
        self._open_blocks += _block_balance(line)
        if not is_last or not (self._indented or self._open_blocks <= 0):
            return None
        text = '\n'.join(self._program) + '\n'
        self._program, self._size = [], 0
        return UploadedProgram(text)


@lru_cache(maxsize=4096)  # clients send the same program again and again
def _block_balance(line: str) -> int:
    """Return the number of blocks that a line opens, minus the number that it closes."""
    if not _BLOCK_WORD.search(line):
        return 0
    try:
        words = [token.text for token in scan(line) if token.kind is TokenKind.KEYWORD]
    except CompileError:
        return 0  # the compiler will report the mistake
    return sum(word in _BLOCKS for word in words) - words.count('end')
