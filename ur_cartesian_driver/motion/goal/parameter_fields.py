# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The annotations with which a dataclass declares parameters, and the check of their values.

::

    #: Largest speed of the TCP [m/s]; 0.0: no limit.
    max_tool_speed: Annotated[float, Range(0.0, 10.0)] = 0.25

is all that declares this parameter. The node's parameters, their descriptions and the contents of
``config/driver.yaml`` follow from such declarations
(:mod:`~ur_cartesian_driver.ros.parameters.parameter_table`).
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cache
from typing import (
    Annotated,
    Any,
    get_args,
    get_origin,
    Literal,
    TypeAlias,
    TypeVar,
)

from ur_cartesian_driver.motion.goal.declared_types import declare_types, declared_hints
from ur_cartesian_driver.motion.goal.field_annotations import Mark, Range

T = TypeVar('T')

#: The type of a field that the driver fills in; such a field is not a parameter.
Detected: TypeAlias = Annotated[T, Mark.NOT_SENT]


@dataclass(frozen=True, slots=True)
class OneOf:
    """The allowed texts of a parameter, taken from a table; without a table use ``Literal``."""

    choices: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterField:
    """A field of a dataclass that is a parameter."""

    name: str
    default: Any
    #: The range of a number; None = not limited.
    range: Range | None
    #: The allowed texts; empty = any text.
    choices: tuple[str, ...]

    def problem(self, value: Any) -> str:
        """Return the fault of a value that is not allowed; '' if the value is allowed."""
        if self.range is not None and not self.range.holds(value):
            zero = f'be 0 ({self.range.zero}) or ' if self.range.zero else ''
            low, high = plain_number(self.range.low), plain_number(self.range.high)
            return f'is {value}, but must {zero}lie between {low} and {high}'
        if self.choices and value not in self.choices:
            return f'is {value!r}, but must be one of {", ".join(self.choices)}'
        return ''


def plain_number(value: float) -> str:
    """Return a bound as people write it: 100000, not 1e+05."""
    return f'{value:.10g}'


@cache
def parameter_fields(kind: type) -> tuple[ParameterField, ...]:
    """Return the fields of a dataclass that are parameters, in the order of the class."""
    hints = declared_hints(kind)
    return tuple(
        _field(each.name, each.default, hints[each.name])
        for each in fields(kind)
        if Mark.NOT_SENT not in _notes(hints[each.name])
    )


def check_parameters(instance: object) -> None:
    """
    Convert the fields of a new dataclass to their types and check them; for ``__post_init__``.

    :raises ValueError: a value has the wrong type or is out of bounds; the text names the field.
    """
    declare_types(instance)
    kind: type = type(instance)
    for each in parameter_fields(kind):
        value = getattr(instance, each.name)
        if value != each.default and (problem := each.problem(value)):
            raise ValueError(f'{each.name} {problem}.')


def _field(name: str, default: Any, hint: Any) -> ParameterField:
    notes = _notes(hint)
    choices = get_args(hint) if get_origin(hint) is Literal else ()
    return ParameterField(
        name=name,
        default=default,
        range=next((note for note in notes if isinstance(note, Range)), None),
        choices=next((note.choices for note in notes if isinstance(note, OneOf)), choices),
    )


def _notes(hint: Any) -> tuple[Any, ...]:
    return getattr(hint, '__metadata__', ())
