# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The two errors of a program: one before it runs, and one while it runs.

Both have a position in the program's text. The controller reports the position to its clients, and
people need it to find the mistake.
"""

from __future__ import annotations


class CompileError(Exception):
    """
    The text is no program that the controller can start; nothing of it has run.

    :param line: 1-based line in the text that was parsed.
    :param column: 1-based column of the offending token.
    :param text: the controller's own wording, as clients see it.
    :param reason: one clause for people, such as the token that was expected.
    """

    def __init__(self, line: int, column: int, text: str, reason: str) -> None:
        super().__init__(line, column, text, reason)
        self.line = line
        self.column = column
        self.text = text
        self.reason = reason

    def __str__(self) -> str:
        return f'{self.line}:{self.column}: {self.text} ({self.reason})'


class RuntimeException(Exception):
    """
    The program did something that the controller cannot do, and ended.

    Builtins and operations on values raise it without a position; the interpreter adds the
    position with `at`. Line 0 means that the position is not known yet.
    """

    def __init__(self, text: str, line: int = 0, column: int = 0) -> None:
        super().__init__(text, line, column)
        self.text = text
        self.line = line
        self.column = column

    def at(self, line: int, column: int) -> RuntimeException:
        """Return this error with a position, unless it already has one."""
        return self if self.line else RuntimeException(self.text, line, column)

    def __str__(self) -> str:
        return f'Runtime error ({self.line}:{self.column}): {self.text}'


def name_not_found(kind: str, name: str, line: int, column: int) -> CompileError:
    """
    Return the error for a name that is unknown in its scope.

    :param kind: 'variable', 'function' or 'thread'.
    """
    text = f'compile_error_name_not_found:{name}:'
    return CompileError(line, column, text, f'there is no {kind} {name!r}')
