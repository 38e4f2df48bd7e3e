# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The fields of ``FollowCartesianTrajectory.Goal``, without the generated messages.

The schema follows from the table of goal fields; a test compares it with the messages. In a
schema, a dict means a message, a list means a sequence whose elements are like the list's only
element, a :class:`Whole` means a whole number, and any other value is the default of its field.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from enum import IntEnum
from importlib import import_module
from types import SimpleNamespace
from typing import Any, TypeAlias

from ur_cartesian_driver.motion.errors import shortened, suggestion
from ur_cartesian_driver.motion.goal.field_annotations import Form, goal_fields, GoalField
from ur_cartesian_driver.motion.goal.goal import Goal
from ur_cartesian_driver.motion.goal.goal_columns import SegmentRows, WaypointRows

#: A message, or an object with its fields.
Message: TypeAlias = Any


@dataclass(frozen=True, slots=True)
class Whole:
    """A field that is a whole number from ``low`` to ``high``; its default is 0."""

    low: int
    high: int
    #: The named values; None = a plain number.
    choices: type[IntEnum] | None = field(default=None, compare=False)


_UINT8, _UINT32 = Whole(0, 2**8 - 1), Whole(0, 2**32 - 1)
_TIME = {'sec': Whole(-(2**31), 2**31 - 1), 'nanosec': _UINT32}
_VECTOR = {'x': 0.0, 'y': 0.0, 'z': 0.0}
_FORMS: Mapping[Form, Any] = {
    Form.PIN: _UINT8,
    Form.COUNT: _UINT32,
    Form.INDEX: _UINT32,
    Form.DURATION: _TIME,
    Form.VECTOR: _VECTOR,
    Form.RATES: {'linear': _VECTOR, 'angular': _VECTOR},
    Form.POSE: {'position': _VECTOR, 'orientation': {**_VECTOR, 'w': 1.0}},
}


def _schema(kind: type) -> dict[str, Any]:
    """Return the schema of the message for a goal dataclass."""
    schema: dict[str, Any] = {}
    for each in goal_fields(kind):
        *outer, name = each.message_name.split('.')
        inner = schema
        for part in outer:
            inner = inner.setdefault(part, {})
        inner[name] = _value_schema(each)
    return schema


def _value_schema(each: GoalField) -> Any:
    if each.form is Form.CHOICE:
        return replace(_UINT8, choices=each.type)
    if each.form in _FORMS:
        return _FORMS[each.form]
    if each.form is Form.RECORD:
        return _schema(each.type)
    if each.form is Form.RECORDS:
        return [_schema(each.type)]
    default = each.default if each.has_default else each.type()
    return [each.type()] if each.form is Form.VALUES else default


def _packed_schema() -> dict[str, Any]:
    """Return the schema of ``PackedPoints``."""
    schema: dict[str, Any] = {}
    for each in (*WaypointRows.columns(), *SegmentRows.columns()):
        if each.field.form is Form.RECORD:
            schema.setdefault('posture_joint_names', [''])
        if each.packed is not None:
            schema[each.packed] = [_UINT8 if each.field.form is Form.CHOICE else 0.0]
    return schema


PACKED = _packed_schema()
#: Message fields without a counterpart in :class:`Goal`, keyed by the field before them.
_BESIDE: Mapping[str, Any] = {
    'execution': {'validate_only': False},
    'safe_outputs': {'packed': PACKED},
}


def _goal_schema() -> dict[str, Any]:
    schema: dict[str, Any] = {}
    for name, value in _schema(Goal).items():
        schema |= {name: value, **_BESIDE.get(name, {})}
    schema['trajectory']['header'] = {'stamp': _TIME, **schema['trajectory']['header']}
    return schema


GOAL: Mapping[str, Any] = _goal_schema()


class FieldError(ValueError):
    """A key or a value does not fit the action's goal; the message names the key."""


def with_defaults(values: object, schema: Any = GOAL, key: str = '') -> Message:
    """
    Return an object with all fields of the message, from plain data as YAML reads it.

    :param schema: the schema of the data.
    :param key: the name of the data in errors; empty = the whole goal.
    :raises FieldError: a key is unknown, or a value does not have the type of its field.
    """
    if isinstance(schema, dict):
        return _fields(values, schema, key)
    if isinstance(schema, list):
        if not isinstance(values, list):
            raise FieldError(f'{key} is {_echo(values)}, but must be a list.')
        return [with_defaults(item, schema[0], f'{key}[{i}]') for i, item in enumerate(values)]
    if isinstance(schema, str):
        if not isinstance(values, str):
            raise FieldError(f'{key} is {_echo(values)}, but must be a text; put it in quotes.')
        return values
    if isinstance(schema, bool):
        if not isinstance(values, bool):
            raise FieldError(f'{key} is {_echo(values)}, but must be true or false.')
        return values
    return _whole(values, schema, key) if isinstance(schema, Whole) else _number(values, key)


def _fields(values: object, schema: Mapping[str, Any], key: str) -> SimpleNamespace:
    if not isinstance(values, dict):
        raise FieldError(
            f'{key or "the goal"} is {_echo(values)}, but must be a mapping of fields.'
        )
    for name in values:
        if name not in schema:
            path = shortened(f'{key}.{name}' if key else str(name))
            fields = f'{key or "a goal"} has {", ".join(schema)}.'
            hint = suggestion(str(name), schema, fields)
            raise FieldError(f'{path} is not a field; {hint}')
    return SimpleNamespace(
        **{
            name: with_defaults(values[name], kind, f'{key}.{name}' if key else name)
            if name in values
            else default(kind)
            for name, kind in schema.items()
        }
    )


def default(schema: Any) -> Any:
    """Return the default value of a field that has this schema."""
    if isinstance(schema, dict):
        return SimpleNamespace(**{name: default(kind) for name, kind in schema.items()})
    if isinstance(schema, list):
        return []
    return 0 if isinstance(schema, Whole) else schema


def message_of(plain: Message, kind: type[Any]) -> Any:
    """
    Copy an object with all fields of a message into a new generated message.

    :param kind: the class of the message.
    """
    names = kind.get_fields_and_field_types()
    return kind(
        **{
            name: _slot_value(getattr(plain, name), slot)
            for name, slot in zip(names, kind.SLOT_TYPES, strict=True)
        }
    )


def _slot_value(value: Any, slot: Any) -> Any:
    if hasattr(slot, 'namespaces'):  # a message
        return message_of(value, getattr(import_module('.'.join(slot.namespaces)), slot.name))
    if hasattr(getattr(slot, 'value_type', None), 'namespaces'):
        return [_slot_value(item, slot.value_type) for item in value]
    return value


def _echo(value: object) -> str:
    return shortened(repr(value))


def _number(value: object, key: str) -> float:
    # YAML reads 1e-3 as a text, because its own notation is 1.0e-3.
    with suppress(ValueError, OverflowError):
        if isinstance(value, (int, float, str)) and not isinstance(value, bool):
            return float(value)
    if isinstance(value, int) and not isinstance(value, bool):
        raise FieldError(f'{key} is {value!r:.20}..., which is too large for a number.')
    raise FieldError(f'{key} is {_echo(value)}, but must be a number.')


def _whole(value: object, kind: Whole, key: str) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or not kind.low <= value <= kind.high:
        names = {} if kind.choices is None else kind.choices.__members__
        choice = names.get(str(value).upper())
        meant = '' if choice is None else f'; {choice.name} is {choice.value}'
        raise FieldError(
            f'{key} is {value!r:.60}, but must be a whole number from {kind.low} to '
            f'{kind.high}{meant}.'
        )
    return value
