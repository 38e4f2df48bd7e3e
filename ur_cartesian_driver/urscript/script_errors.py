# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The two ways in which a program can be wrong: before it runs, and while it runs.

Both carry a position in the text that was sent, because that is what the controller reports to
its clients and what a person needs to find the place.
"""

from __future__ import annotations


class CompileError(Exception):
    """
    The text is not a program that can be started; nothing has run.

    :param line: 1-based line in the text that was parsed.
    :param column: 1-based column of the offending token.
    :param text: the controller's own wording, as clients see it.
    :param reason: one clause for people: what was expected.
    """

    def __init__(self, line: int, column: int, text: str, reason: str = '') -> None:
        super().__init__(line, column, text, reason)
        self.line = line
        self.column = column
        self.text = text
        self.reason = reason

    def __str__(self) -> str:
        reason = f' ({self.reason})' if self.reason else ''
        return f'{self.line}:{self.column}: {self.text}{reason}'


class RuntimeException(Exception):
    """
    The program did something that the controller cannot do; it has ended.

    Raised without a position by values and builtins; the interpreter adds the place in the
    program by `at`. Line 0 means that the place is not known yet.
    """

    def __init__(self, text: str, line: int = 0, column: int = 0) -> None:
        super().__init__(text, line, column)
        self.text = text
        self.line = line
        self.column = column

    def at(self, line: int, column: int) -> RuntimeException:
        """Return this error with a position; the innermost position wins."""
        return self if self.line else RuntimeException(self.text, line, column)

    def __str__(self) -> str:
        return f'Runtime error ({self.line}:{self.column}): {self.text}'


def name_not_found(name: str, line: int, column: int) -> CompileError:
    """Return the error for a name that means nothing where it stands."""
    return CompileError(line, column, f'compile_error_name_not_found:{name}:')
