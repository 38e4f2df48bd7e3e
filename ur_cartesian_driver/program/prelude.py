# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The user's functions in the robot program: goals call them by name, the program by number."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

#: The largest number of function arguments that a trajectory point can carry.
MAX_ARGUMENTS = 6


@dataclass(frozen=True, slots=True, kw_only=True)
class PreludeFunction:
    """A function, with the number of its required arguments and of all its arguments."""

    name: str
    required: int = 0
    allowed: int = 0

    @property
    def counts(self) -> str:
        """The allowed number of arguments in words, such as `1 to 3 arguments`."""
        between = '' if self.required == self.allowed else f'{self.required} to '
        return f'{between}{self.allowed or "no"} argument{"s" * (self.allowed != 1)}'


@dataclass(frozen=True, slots=True, kw_only=True)
class Prelude:
    """The user's URScript, which has been checked, and the functions that it defines."""

    #: The file that contains the URScript, for error messages.
    file: str = ''
    lines: tuple[str, ...] = ()
    functions: tuple[PreludeFunction, ...] = ()

    def function(self, name: str) -> PreludeFunction | None:
        """Return the function with a name; None = there is none."""
        return next((function for function in self.functions if function.name == name), None)

    def number(self, name: str, arguments: int) -> int:
        """Return the number by which the program calls a function with so many arguments."""
        return self._calls().index((name, arguments))

    def dispatch(self) -> Iterator[str]:
        """Yield the URScript that makes call ``number``, with the items of ``x`` as arguments."""
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
