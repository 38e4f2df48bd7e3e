# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Every parameter of the node but its default: description, range and choices.

They are read from ``parameters.yaml``. The defaults come from the dataclasses that use the values,
so a program without ROS has the same.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from itertools import chain
from math import inf
from typing import TypeAlias

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
import yaml

ParameterValue: TypeAlias = bool | int | float | str | list[str]

_TYPE_NAMES: Mapping[type, str] = {
    bool: 'true or false',
    int: 'a whole number',
    float: 'a number',
    str: 'a text',
    list: 'a list of texts',
}


class ParameterError(ValueError):
    """A parameter is unknown or has an invalid value; the text is one sentence."""


@dataclass(frozen=True, slots=True)
class ParameterDeclaration:
    """One parameter: its meaning and its values."""

    name: str
    description: str
    range: Sequence[float] = (-inf, inf)
    choices: Sequence[str] = ()

    def descriptor(self, default: ParameterValue) -> ParameterDescriptor:
        """Return what ``ros2 param describe`` shows."""
        descriptor = ParameterDescriptor(
            name=self.name,
            description=self.description,
            read_only=True,
            additional_constraints='one of: ' + ', '.join(self.choices) if self.choices else '',
        )
        low, high = self.range
        if type(default) is int:
            integers = IntegerRange(from_value=int(low), to_value=int(high))
            descriptor.integer_range = [integers]
        elif type(default) is float:
            floats = FloatingPointRange(from_value=low, to_value=high)
            descriptor.floating_point_range = [floats]
        return descriptor

    def check(self, value: ParameterValue, default: ParameterValue) -> None:
        """
        Refuse a value of another type or out of range.

        :raises ParameterError: with the bound.
        """
        wanted = type(default)
        if type(value) is not wanted:
            hint = f'; write {value}.0' if wanted is float and type(value) is int else ''
            if wanted is str:  # YAML reads off as false, 2.14 as a number
                hint = '; put it in quotes that the shell does not remove'
            raise ParameterError(
                f'Parameter {self.name} is {value!r}, but must be {_TYPE_NAMES[wanted]}{hint}.'
            )
        low, high = self.range
        if isinstance(value, (int, float)) and not low <= value <= high:
            raise ParameterError(
                f'Parameter {self.name} is {value}, but must lie between {low:g} and {high:g}.'
            )
        if self.choices and value not in self.choices:
            raise ParameterError(
                f'Parameter {self.name} is {value!r}, but must be one of '
                f'{", ".join(self.choices)}.'
            )


def _read_sections() -> dict[str, list[ParameterDeclaration]]:
    text = files(__package__).joinpath('parameters.yaml').read_text('utf-8')
    return {
        title: [ParameterDeclaration(name, **facts) for name, facts in section.items()]
        for title, section in yaml.safe_load(text).items()
    }


#: The parameters by the sections of ``config/driver.yaml``, in its order.
SECTIONS = _read_sections()
DECLARATIONS = tuple(chain.from_iterable(SECTIONS.values()))
