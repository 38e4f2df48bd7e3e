# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The motion calls that a recorded program made, from the text of the program."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
import re

_CALL = re.compile(r'^\s*(movej|movel)\s*\((.*)\)\s*(?:#.*)?$')
_ARGUMENT = re.compile(r'\b([avtr])\s*=\s*([^,()\s]+)')


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionCommand:
    """A call of ``movej`` or ``movel``; what was left out is None [m or rad, s]."""

    name: str
    a: float | None = None
    v: float | None = None
    t: float | None = None
    r: float | None = None


def read_commands(text: str, name: str) -> list[MotionCommand]:
    """
    Return the calls in the lines of a text, in order; other lines are skipped.

    :param text: one call a line, with a, v, t and r by name, ``movel(there, a=1, v=0.2)``.
    :param name: of the file, for error texts.
    :raises ValueError: a number cannot be read.
    """
    commands = []
    for line, content in enumerate(text.splitlines(), 1):
        if (call := _CALL.match(content)) is None:
            continue
        numbers = {}
        for key, value in _ARGUMENT.findall(call[2]):
            try:
                numbers[key] = float(value)
            except ValueError:
                raise ValueError(
                    f'{name}, line {line}: {key} of {call[1]} is {value}; write a number'
                ) from None
            if not (isfinite(numbers[key]) and numbers[key] >= 0.0):
                raise ValueError(f'{name}, line {line}: {key} of {call[1]} is {value}; 0 or more')
        given = {key: value for key, value in numbers.items() if value > 0.0}
        commands.append(MotionCommand(name=call[1], **given))
    if not commands:
        raise ValueError(f'{name} has no call of movej or movel; write one a line')
    return commands
