# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Splits text into tokens.

Newlines are white space. Each token has a line number, which the parser uses only in the few
places where the language depends on lines.
"""

from __future__ import annotations

from enum import Enum
import re
from typing import NamedTuple

from ur_cartesian_driver.urscript.script_errors import CompileError

#: `sec` is not a keyword, because it is also a field of the result of `time()`.
KEYWORDS = frozenset({
    'and', 'break', 'case', 'continue', 'def', 'default', 'elif', 'else', 'end', 'enter_critical',
    'exit_critical', 'false', 'False', 'global', 'halt', 'if', 'join', 'kill', 'local', 'None',
    'not', 'or', 'pause', 'return', 'run', 'switch', 'thread', 'true', 'True', 'while', 'xor',
})  # fmt: skip

#: Longer symbols come first, so that `<=` is not read as `<`.
SYMBOLS = ('==', '!=', '<=', '>=', *'+-*/%<>=()[],:.$!')

#: Integers of the controller have 32 bits; a larger literal is read as a float.
INT_LIMIT = 2**31

_WORD = re.compile(r'[A-Za-z_][A-Za-z_0-9]*')
_TOKEN = re.compile(
    r'(?P<blank>(?:[ \t\r\f\v\n]|#[^\n]*)+)'
    rf'|(?P<word>{_WORD.pattern})'
    r'|(?P<number>(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)'
    r'|(?P<string>"[^"\n]*")'
    rf'|(?P<symbol>{"|".join(map(re.escape, SYMBOLS))})'
    r'|(?P<other>.)'
)


class TokenKind(Enum):
    """The kinds of tokens."""

    NAME = 'name'
    KEYWORD = 'keyword'
    SYMBOL = 'symbol'
    NUMBER = 'number'
    STRING = 'string'
    END = 'end of text'


class Token(NamedTuple):
    """A token; the `text` of a string excludes its quotes."""

    kind: TokenKind
    text: str
    line: int
    column: int

    @property
    def number(self) -> int | float:
        """The value of a number."""
        value = float(self.text)
        # float() comes first, because Python's int() refuses thousands of digits.
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

    :raises CompileError: a character begins no token, a number is malformed, or a string is not
        closed.
    """
    tokens: list[Token] = []
    line, line_start = 1, 0
    for found in _TOKEN.finditer(text):
        group, word, start = found.lastgroup, found.group(), found.start()
        column = start - line_start + 1
        if group == 'blank':
            if newlines := word.count('\n'):
                line += newlines
                line_start = start + word.rindex('\n') + 1
            continue
        if group == 'symbol':
            kind = TokenKind.SYMBOL
        elif group == 'number':
            kind = TokenKind.NUMBER
            _check_number(text, found.end(), line, column)
        elif group == 'word':
            kind = TokenKind.KEYWORD if word in KEYWORDS else TokenKind.NAME
        elif group == 'string':
            kind, word = TokenKind.STRING, word[1:-1]
        elif word == '"':
            raise syntax_error(text, line, column, 'a string is not closed on its line')
        elif word == "'":
            raise syntax_error(text, line, column, 'a string stands in double quotes')
        else:
            raise syntax_error(text, line, column, f'{word!r} has no meaning here')
        tokens.append(Token(kind, word, line, column))
    tokens.append(Token(TokenKind.END, '', line, len(text) - line_start + 1))
    return tokens


def _check_number(text: str, end: int, line: int, column: int) -> None:
    if text.startswith('.', end):
        raise syntax_error(text, line, column, 'a number has two decimal points')
    if _WORD.match(text, end):
        raise syntax_error(text, line, column, 'a number ends in letters')
