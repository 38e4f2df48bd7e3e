# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Text to tokens.

Newlines are white space. A token knows its line; the parser uses it only in the few places where
the language depends on lines.
"""

from __future__ import annotations

from collections.abc import Iterator
from enum import Enum
import re
from typing import NamedTuple

from ur_cartesian_driver.urscript.script_errors import CompileError

#: Without `sec`, which is also a field of the result of `time()`.
KEYWORDS = frozenset({
    'and', 'break', 'case', 'continue', 'def', 'default', 'elif', 'else', 'end', 'enter_critical',
    'exit_critical', 'false', 'False', 'global', 'halt', 'if', 'join', 'kill', 'local', 'None',
    'not', 'or', 'pause', 'return', 'run', 'switch', 'thread', 'true', 'True', 'while', 'xor',
})  # fmt: skip

#: Longest first, so that `<=` is not read as `<`.
SYMBOLS = ('==', '!=', '<=', '>=', *'+-*/%<>=()[],:.$')

#: Integers of the controller have 32 bits; a longer literal is read as a float.
INT_LIMIT = 2**31

_BLANK = re.compile(r'(?:[ \t\r\f\v\n]|#[^\n]*)+')
_WORD = re.compile(r'[A-Za-z_][A-Za-z_0-9]*')
_TOKEN = re.compile(
    rf'(?P<word>{_WORD.pattern})'
    r'|(?P<number>(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)'
    r'|(?P<string>"[^"\n]*")'
    rf'|(?P<symbol>{"|".join(map(re.escape, SYMBOLS))})'
)


class TokenKind(Enum):
    """What a token is."""

    NAME = 'name'
    KEYWORD = 'keyword'
    SYMBOL = 'symbol'
    NUMBER = 'number'
    STRING = 'string'
    END = 'end of text'


class Token(NamedTuple):
    """A token; `text` of a string is the text between the quotes."""

    kind: TokenKind
    text: str
    line: int
    column: int

    @property
    def number(self) -> int | float:
        """The value of a number."""
        value = float(self.text)
        # Python refuses to read integers of thousands of digits.
        if self.text.isdigit() and value < INT_LIMIT:
            return int(self.text)
        return value


def syntax_error(text: str, line: int, column: int, reason: str) -> CompileError:
    """Return a syntax error in the controller's wording, with the source line in it."""
    source = text.split('\n')[line - 1].rstrip('\r')
    return CompileError(line, column, f'syntax_error_on_line:{line}:{source}:', reason)


def scan(text: str) -> list[Token]:
    """
    Split a text into tokens, the last of which is END.

    :raises CompileError: at the first character that begins no token.
    """
    return list(_scan(text))


def _scan(text: str) -> Iterator[Token]:
    position, line, line_start = 0, 1, 0
    while True:
        if blank := _BLANK.match(text, position):
            position = blank.end()
            if newlines := blank.group().count('\n'):
                line += newlines
                line_start = text.rindex('\n', blank.start(), position) + 1
        column = position - line_start + 1
        if position == len(text):
            yield Token(TokenKind.END, '', line, column)
            return
        kind, word, position = _token(text, position, line, column)
        yield Token(kind, word, line, column)


def _token(text: str, start: int, line: int, column: int) -> tuple[TokenKind, str, int]:
    """Return kind and text of the token at `start`, and where it ends."""
    if found := _TOKEN.match(text, start):
        word, end = found.group(), found.end()
        match found.lastgroup:
            case 'word':
                return TokenKind.KEYWORD if word in KEYWORDS else TokenKind.NAME, word, end
            case 'number':
                if _WORD.match(text, end):
                    raise syntax_error(text, line, column, 'a number ends in letters')
                return TokenKind.NUMBER, word, end
            case 'string':
                return TokenKind.STRING, word[1:-1], end
        return TokenKind.SYMBOL, word, end
    if text[start] == '"':
        raise syntax_error(text, line, column, 'a string is not closed on its line')
    raise syntax_error(text, line, column, f'{text[start]!r} has no meaning here')
