# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The table of the node's parameters, made from the dataclasses that use their values.

The dataclasses declare types, defaults and bounds, so a program without ROS has the same ones.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from inspect import getsource
from typing import Any, TypeAlias

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor

from ur_cartesian_driver.driver import DriverConfig
from ur_cartesian_driver.motion.goal.parameter_fields import (
    parameter_fields,
    ParameterField,
    plain_number,
)
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.ros.parameters.node_settings import NodeSettings

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

    field: ParameterField
    description: str

    @property
    def name(self) -> str:
        """The name of the field and of the parameter."""
        return self.field.name

    @property
    def default(self) -> ParameterValue:
        """The default, in a type that ROS parameters can have."""
        return plain_value(self.field.default)

    @property
    def values(self) -> str:
        """The allowed values, as text; '' = any value."""
        if self.field.choices:
            return f'one of: {", ".join(self.field.choices)}'
        if (bounds := self.field.range) is None:
            return ''
        zero = '0 or ' if bounds.zero else ''
        return f'range: {zero}{plain_number(bounds.low)} to {plain_number(bounds.high)}'

    def descriptor(self) -> ParameterDescriptor:
        """Return the descriptor, which ``ros2 param describe`` prints."""
        descriptor = ParameterDescriptor(
            name=self.name, description=self.description, read_only=True
        )
        bounds = self.field.range
        if bounds is None or bounds.zero:
            descriptor.additional_constraints = self.values
        if bounds is not None:
            low, high = 0.0 if bounds.zero else bounds.low, bounds.high
            if isinstance(self.default, float):
                descriptor.floating_point_range = [
                    FloatingPointRange(from_value=float(low), to_value=float(high))
                ]
            else:
                descriptor.integer_range = [IntegerRange(from_value=int(low), to_value=int(high))]
        return descriptor

    def check(self, value: ParameterValue) -> None:
        """
        Refuse a value that has another type or is not allowed.

        :raises ParameterError: the value is refused; the text names the needed type or values.
        """
        wanted = type(self.default)
        if type(value) is not wanted:
            hint = f'; write {value}.0' if wanted is float and type(value) is int else ''
            if wanted is str:  # YAML reads off as false, 2.14 as a number
                hint = '; put it in quotes that the shell does not remove'
            raise ParameterError(
                f'Parameter {self.name} is {value!r}, but must be {_TYPE_NAMES[wanted]}{hint}.'
            )
        if problem := self.field.problem(value):
            raise ParameterError(f'Parameter {self.name} {problem}.')


def plain_value(value: Any) -> ParameterValue:
    """
    Return a value as plain Python; a sequence as a list of texts.

    The list is never empty: YAML and ROS have no type for an empty one.
    """
    if isinstance(value, (bool, int, float, str)):
        return value
    return [str(text) for text in value] or ['']


def _comments(kind: type) -> Iterator[tuple[str, str]]:
    """Yield the fields of a class and the ``#:`` comments before them, as Sphinx reads them."""
    try:
        source = getsource(kind)
    except OSError:
        return  # only compiled modules are installed: the parameters have no descriptions
    comment: list[str] = []
    for line in map(str.strip, source.splitlines()):
        if line.startswith('#:'):
            # An empty line begins a paragraph.
            comment.append(line[2:].strip() or '\n')
        else:
            yield line.partition(':')[0], ' '.join(comment).replace(' \n ', '\n')
            comment = []


def declarations_of(*kinds: type) -> Iterator[ParameterDeclaration]:
    """Yield the parameters that dataclasses declare as their fields."""
    for kind in kinds:
        comments = {
            name: comment for each in kind.__mro__[-2::-1] for name, comment in _comments(each)
        }
        for field in parameter_fields(kind):
            yield ParameterDeclaration(field, comments.get(field.name, ''))


DECLARATIONS = tuple(declarations_of(DriverConfig, PlanningOptions, NodeSettings))
