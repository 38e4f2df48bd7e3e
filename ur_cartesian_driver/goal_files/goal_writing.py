# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Turns a goal into the fields of its message; most fields at their default are omitted."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any, TypeAlias

from ur_cartesian_driver.goal_files.goal_packing import packed_fields
from ur_cartesian_driver.motion.goal.field_annotations import (
    Form,
    goal_fields,
    GoalField,
    in_order_of_files,
)
from ur_cartesian_driver.motion.goal.goal import Goal
from ur_cartesian_driver.motion.goal.goal_columns import (
    goal_table,
    GoalRows,
    SegmentRows,
    WaypointRows,
)

#: The fields of a message, by name.
Fields: TypeAlias = dict[str, Any]

_NANOSECONDS = 1_000_000_000


def fields_of_goal(goal: Goal, *, packed: bool = False) -> Fields:
    """
    Return the fields of a goal, as plain data for YAML or for a message.

    Frames are written by their names; the stamp of the header is not written.

    :param packed: write points and segments in flat arrays, if the arrays can hold all values.
    """
    table = goal_table(goal)
    arrays = packed_fields(table.waypoints, table.segments) if packed else None
    if arrays is None:
        return _record(Goal, table)
    rest = replace(table, waypoints=WaypointRows.of(()), segments=SegmentRows.of(()))
    columns = {name: list(column) for name, column in arrays.items() if len(column)}
    return {**_record(Goal, rest), 'packed': columns}


def _record(kind: type, record: Any) -> Fields:
    """Return the message fields of ``record``, an object of the goal dataclass ``kind``."""
    written: Fields = {}
    for each in in_order_of_files(goal_fields(kind)):
        _write(each, getattr(record, each.name), written)
    return written


def _rows(rows: GoalRows[Any]) -> list[Fields]:
    """Return the message fields of each row."""
    written: list[Fields] = [{} for _ in range(len(rows))]
    columns = {each.field.name: each for each in rows.columns()}
    for each in in_order_of_files(goal_fields(rows.kind)):
        for fields, value in zip(written, rows.values(columns[each.name]), strict=True):
            _write(each, value, fields)
    return written


def _write(each: GoalField, value: Any, fields: Fields) -> None:
    """
    Add a value to ``fields``, unless it is the default of an optional field.

    NaN equals no default, so it is always added.
    """
    default = each.default if each.has_default else 0
    if value == default and not each.is_always_sent:
        return
    written = _value(each, value)
    if written in ({}, []) and not each.is_always_sent:
        return
    *outer, name = each.message_name.split('.')
    for part in outer:
        fields = fields.setdefault(part, {})
    fields[name] = written


def _value(each: GoalField, value: Any) -> Any:
    match each.form:
        case Form.CHOICE:
            return int(value)
        case Form.DURATION:
            return duration_fields(value)
        case Form.VECTOR:
            return _vector(value)
        case Form.RATES:
            parts = {'linear': value[:3], 'angular': value[3:]}
            return {name: _vector(part) for name, part in parts.items() if any(part)}
        case Form.POSE:
            q = value.quaternion
            return {
                'position': _vector(value.position),
                'orientation': dict(zip('xyzw', q, strict=True)),
            }
        case Form.VALUES:
            return list(value)
        case Form.RECORD:
            return _record(each.type, value)
        case Form.RECORDS if isinstance(value, GoalRows):
            return _rows(value)
        case Form.RECORDS:
            return [_record(each.type, one) for one in value]
        case _:
            return value


def _vector(values: Iterable[float]) -> Fields:
    return dict(zip('xyz', values, strict=True))


def duration_fields(time: float) -> Fields:
    """Return a time [s] as seconds and nanoseconds, rounded to the nearest nanosecond."""
    sec, nanosec = divmod(round(time * _NANOSECONDS), _NANOSECONDS)
    return {name: part for name, part in (('sec', sec), ('nanosec', nanosec)) if part}
