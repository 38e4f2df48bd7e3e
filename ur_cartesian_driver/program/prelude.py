# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The user's functions in the robot program: goals call them by name, the program by number."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

#: The largest number of arguments in a trajectory point.
MAX_ARGUMENTS = 6


@dataclass(frozen=True, slots=True, kw_only=True)
class PreludeFunction:
    """A function, and the numbers of its required and of all its arguments."""

    name: str
    required: int = 0
    allowed: int = 0

    @property
    def counts(self) -> str:
        """The number of arguments, as part of a sentence."""
        between = '' if self.required == self.allowed else f'{self.required} to '
        return f'{between}{self.allowed or "no"} argument{"s" * (self.allowed != 1)}'


@dataclass(frozen=True, slots=True, kw_only=True)
class Prelude:
    """The user's URScript after its check, and the functions that it defines."""

    #: The file from which it comes, for error messages.
    file: str = ''
    lines: tuple[str, ...] = ()
    functions: tuple[PreludeFunction, ...] = ()

    def function(self, name: str) -> PreludeFunction | None:
        """Return a function, or None."""
        return next((function for function in self.functions if function.name == name), None)

    def number(self, name: str, arguments: int) -> int:
        """Return the number by which the program calls a function with that many arguments."""
        return self._calls().index((name, arguments))

    def dispatch(self) -> Iterator[str]:
        """Yield the lines that call the function ``number`` with the values of a list ``x``."""
        for number, (name, count) in enumerate(self._calls()):
            yield f'  {"elif" if number else "if"} number == {number}:'
            yield f'    {name}({", ".join(f"x[{i}]" for i in range(count))})'
        if self.functions:
            yield '  end'

    def _calls(self) -> list[tuple[str, int]]:
        return [
            (each.name, count)
            for each in self.functions
            for count in range(each.required, min(each.allowed, MAX_ARGUMENTS) + 1)
        ]


NO_PRELUDE = Prelude()
