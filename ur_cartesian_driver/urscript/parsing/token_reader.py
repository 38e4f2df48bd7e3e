# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Reads tokens from left to right: the base of all grammar rules."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypedDict, TypeVar

from ur_cartesian_driver.urscript.parsing.scanner import scan, syntax_error, Token, TokenKind
from ur_cartesian_driver.urscript.script_errors import CompileError

#: Deepest nesting of blocks, brackets, signs and `not`.
MAX_NESTING = 50
#: Largest number of consecutive operators of equal precedence, or of consecutive calls, indices
#: and fields; each of these makes the tree one node deeper.
MAX_CHAIN = 100

#: The kinds of tokens whose texts the language defines: its words and symbols.
FIXED = (TokenKind.KEYWORD, TokenKind.SYMBOL)

T = TypeVar('T')


class SourcePosition(TypedDict):
    """The position of a node, as keyword arguments of its class."""

    line: int
    column: int


def source_position(token: Token) -> SourcePosition:
    """Return the position of a token, as keyword arguments for a node."""
    return SourcePosition(line=token.line, column=token.column)


class TokenReader:
    """The tokens of one text, and the index of the next one."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._tokens = scan(text)
        self._next = 0
        self._token = self._tokens[0]
        self._nesting = 0

    @property
    def _previous(self) -> Token:
        return self._tokens[self._next - 1]

    def _advance(self) -> Token:
        token = self._token
        if token.kind is not TokenKind.END:
            self._next += 1
            self._token = self._tokens[self._next]
        return token

    def _at(self, *texts: str) -> bool:
        """Return whether the next token is one of these keywords or symbols."""
        token = self._token
        return token.text in texts and token.kind in FIXED  # a string can have the same text

    def _match(self, *texts: str) -> Token | None:
        return self._advance() if self._at(*texts) else None

    def _expect(self, text: str) -> Token:
        if not self._at(text):
            raise self.error(f'{text!r} is missing before {self._found()}')
        return self._advance()

    def _expect_kind(self, kind: TokenKind) -> Token:
        if self._token.kind is not kind:
            raise self.error(f'a {kind.value} is missing before {self._found()}')
        return self._advance()

    def _found(self) -> str:
        token = self._token
        return token.kind.value if token.kind is TokenKind.END else repr(token.text)

    def _same_line(self) -> bool:
        """Return whether the next token is on the line of the previous one."""
        return self._token.line == self._previous.line

    def error(self, reason: str, token: Token | None = None) -> CompileError:
        """Return a syntax error at a token, by default the next one."""
        at = token or self._token
        return syntax_error(self._text, at.line, at.column, reason)

    @contextmanager
    def _nested(self) -> Iterator[None]:
        """Count one level of nesting; raise an error beyond MAX_NESTING levels."""
        self._nesting += 1
        if self._nesting > MAX_NESTING:
            raise self.error(f'more than {MAX_NESTING} levels inside one another')
        yield
        self._nesting -= 1

    def _list(self, item: Callable[[], T], close: str) -> tuple[T, ...]:
        """Read [ item { "," item } ] and then the bracket `close`."""
        items: list[T] = []
        with self._nested():
            if not self._at(close):
                items.append(item())
                while self._match(','):
                    items.append(item())
        self._expect(close)
        return tuple(items)
