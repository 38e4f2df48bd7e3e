# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Turns a goal message, or an object with the fields of one, into the goal itself.

The table of goal fields determines which fields are read. A message has its points in one of two
forms: as a list of messages, or in the flat arrays of a ``PackedPoints``. Either form is read
directly into the arrays of the goal. Only messages that cannot be read are refused here: a number
that is not in its enumeration, points in both forms, or an array of the wrong length.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from enum import IntEnum
from operator import attrgetter
from typing import Any, TypeVar

import numpy as np

from ur_cartesian_driver.goal_files.goal_schema import Message, PACKED
from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, Pose
from ur_cartesian_driver.motion.geometry.vectors import Vector3, Vector6
from ur_cartesian_driver.motion.goal.field_annotations import (
    Form,
    goal_fields,
    GoalColumn,
    GoalField,
)
from ur_cartesian_driver.motion.goal.goal import Goal, IOCommand, Posture, SegmentType
from ur_cartesian_driver.motion.goal.goal_columns import (
    GoalRows,
    GoalTable,
    rows_where,
    SegmentRows,
    WaypointRows,
)

_Enum = TypeVar('_Enum', bound=IntEnum)


def goal_from_fields(message: Message) -> GoalTable:
    """
    Return the goal of a ``FollowCartesianTrajectory.Goal``; its frames are names, not yet poses.

    :raises InvalidGoal: a number is not in its enumeration, or :func:`rows_of_points`
        refuses the points; the error names the field.
    """
    waypoints, segments = rows_of_points(message, message.trajectory.points, 'trajectory.points')
    rest = _values(Goal, message, without=('waypoints', 'segments'))
    return GoalTable(waypoints=waypoints, segments=segments, **rest)


def io_commands(message: Message) -> tuple[IOCommand, ...]:
    """Return the ``io_commands`` of a message."""
    return _records(IOCommand, message.io_commands, 'io_commands')


# -- records -----------------------------------------------------------------------------------


def _values(
    kind: type, message: Message, where: str = '', without: Collection[str] = ()
) -> dict[str, Any]:
    """Return the field values of a goal dataclass, by name; errors put ``where`` before names."""
    return {
        each.name: _value(each, attrgetter(each.message_name)(message), where + each.message_name)
        for each in goal_fields(kind)
        if each.name not in without
    }


def _records(kind: type[Any], messages: Sequence[Message], where: str) -> tuple[Any, ...]:
    return tuple(
        kind(**_values(kind, message, f'{where}[{i}].')) for i, message in enumerate(messages)
    )


def _value(each: GoalField, value: Any, where: str) -> Any:
    match each.form:
        case Form.CHOICE:
            return enum_member(each.type, value, where)
        case Form.DURATION:
            return seconds(value)
        case Form.VECTOR:
            return _three(value)
        case Form.RATES:
            return _six(value)
        case Form.VALUES:
            return tuple(value)
        case Form.RECORD:
            return each.type(**_values(each.type, value, f'{where}.'))
        case Form.RECORDS:
            return _records(each.type, value, where)
        case _:
            return value


def enum_member(enum: type[_Enum], value: int, field: str) -> _Enum:
    """Return the member with this value, or refuse a value without one and list the members."""
    try:
        return enum(value)
    except ValueError:
        names = ', '.join(f'{member.name} ({member.value})' for member in enum)
        raise InvalidGoal(field, f'is {value}', f'it must be one of {names}') from None


def nanoseconds(time: Message) -> int:
    """Return a ``Duration`` or ``Time`` in nanoseconds."""
    return int(time.sec) * 1_000_000_000 + int(time.nanosec)


def seconds(time: Message) -> float:
    """Return a ``Duration`` or ``Time`` in seconds; a single rounding keeps the nanoseconds."""
    return nanoseconds(time) / 1_000_000_000


def pose_from_message(pose: Message) -> Pose:
    """Return a ``geometry_msgs/Pose`` as a pose, without normalizing or checking it."""
    p, q = pose.position, pose.orientation
    return Pose((p.x, p.y, p.z), (q.x, q.y, q.z, q.w))


def _three(vector: Message) -> Vector3:
    return (vector.x, vector.y, vector.z)


def _six(twist: Message) -> Vector6:
    """Return the six numbers of a ``Twist`` or ``Accel``, the linear ones first."""
    u, v = twist.linear, twist.angular
    return (u.x, u.y, u.z, v.x, v.y, v.z)


def _seven(pose: Message) -> tuple[float, ...]:
    p, q = pose.position, pose.orientation
    return (p.x, p.y, p.z, q.x, q.y, q.z, q.w)


# -- points and segments -----------------------------------------------------------------------


def rows_of_points(
    message: Message, points: Sequence[Message], field: str
) -> tuple[WaypointRows, SegmentRows]:
    """
    Return the points and segments of a message, in whichever form it has them.

    :param points: the list of points in the message; may be empty.
    :param field: the name of that list, for errors.
    :raises InvalidGoal: points are given in both forms, the length of an array does not fit the
        number of points, or a number is not in its enumeration; the error names the field.
    """
    if not is_packed(message.packed):
        return point_rows(points), segment_rows(message.segments)
    if given := field if points else 'segments' if message.segments else '':
        raise InvalidGoal('packed', f'is given beside {given}', 'use one form or the other')
    return _unpacked(message.packed)


def point_rows(points: Sequence[Message]) -> WaypointRows:
    """Return ``CartesianTrajectoryPoint`` messages as rows."""
    return WaypointRows.of_columns(len(points), _columns(WaypointRows, points))


def segment_rows(segments: Sequence[Message]) -> SegmentRows:
    """
    Return ``MotionSegment`` messages as rows.

    :raises InvalidGoal: a number is not in its enumeration; the error names the field.
    """
    columns = _columns(SegmentRows, segments)
    for each in SegmentRows.columns():
        _check_numbers(each, columns[each.name], f'segments[{{}}].{each.field.message_name}')
    return _with_vias(len(segments), columns)


def _columns(kind: type[GoalRows[Any]], messages: Sequence[Message]) -> dict[str, Any]:
    """Return the columns of a list of messages; if the list is empty, each column is None."""
    if not messages:
        return {each.name: None for each in kind.columns()}
    return {
        each.name: _column(each.field, list(map(attrgetter(each.field.message_name), messages)))
        for each in kind.columns()
    }


def _column(each: GoalField, values: Sequence[Any]) -> Any:
    match each.form:
        case Form.RECORD:
            postures = ((i, _posture(posture)) for i, posture in enumerate(values))
            return {i: posture for i, posture in postures if posture}
        case Form.DURATION:
            return np.array([nanoseconds(time) for time in values]) / 1_000_000_000
        case Form.POSE:
            return np.array([_seven(pose) for pose in values])
        case Form.RATES:  # most goals have only zeros: None saves their memory
            rows = np.array([_six(rates) for rates in values])
            return rows if rows.any() else None
        case _:
            return np.array(values, dtype=np.int64 if each.form is Form.CHOICE else np.float64)


_NO_POSTURE = Posture()


def _posture(posture: Message) -> Posture:
    names, values = posture.posture_joint_names, posture.posture_joint_values
    if not names and not values:
        return _NO_POSTURE
    return Posture(names=tuple(names), values=tuple(values))


def _check_numbers(each: GoalColumn, column: Any, where: str) -> None:
    """Refuse a column with a number that is not in the column's enumeration."""
    if each.field.form is Form.CHOICE and column is not None:
        for i in rows_where(~np.isin(column, list(each.field.type)))[:1]:
            enum_member(each.field.type, int(column[i]), where.format(i))


def _with_vias(n: int, columns: Mapping[str, Any]) -> SegmentRows:
    """
    Return segments made of columns, and choose the segments that have a via pose.

    In a message, a via pose that is not set is the identity. An arc always has a via pose, even
    the identity. Any other segment has one if it is not the identity, so that the check of the
    goal can refuse this pose instead of ignoring it.
    """
    types, vias = columns['types'], columns['vias']
    has_via = np.zeros(n, dtype=np.bool_)
    if vias is not None:
        has_via |= (vias != IDENTITY.row()).any(axis=1)
    if types is not None:
        has_via |= types == SegmentType.CIRCULAR
    return SegmentRows.of_columns(n, {**columns, 'has_via': has_via})


# -- flat arrays -------------------------------------------------------------------------------


def is_packed(packed: Message) -> bool:
    """Return whether any array of a ``PackedPoints`` has items."""
    return any(len(getattr(packed, name)) for name in PACKED)


def _unpacked(packed: Message) -> tuple[WaypointRows, SegmentRows]:
    """Return the points and segments of a ``PackedPoints``."""
    n, rest = divmod(len(packed.poses), 7)
    if rest or not n:
        raise InvalidGoal(
            'packed.poses',
            f'has {len(packed.poses)} numbers, but each point needs 7',
            'give position x y z and orientation x y z w of each point',
        )
    points = WaypointRows.of_columns(n, _unpacked_columns(WaypointRows, packed, n))
    columns = _unpacked_columns(SegmentRows, packed, n)
    if all(column is None for column in columns.values()):
        return points, SegmentRows.of(())
    for each in SegmentRows.columns():
        _check_numbers(each, columns[each.name], f'packed.{each.packed}[{{}}]')
    return points, _with_vias(n, columns)


def _unpacked_columns(kind: type[GoalRows[Any]], packed: Message, n: int) -> dict[str, Any]:
    """Return the columns of flat arrays; a column is None if its array is empty."""
    columns = {}
    for each in kind.columns():
        values = [] if each.packed is None else getattr(packed, each.packed)
        column: Any = None
        if len(values) and each.field.form is Form.RECORD:
            column = _postures(packed, str(each.packed), n, tuple(packed.posture_joint_names))
        elif len(values):
            width = {Form.RATES: 6, Form.POSE: 7}.get(each.field.form, 1)
            column = _matrix(packed, str(each.packed), n, width)
            column = column if width > 1 else column[:, 0]
            column = column.astype(np.int64) if each.field.form is Form.CHOICE else column
        columns[each.name] = column
    return columns


def _matrix(packed: Message, name: str, n: int, columns: int) -> Floats:
    """Return an array as a matrix of n rows; refuse an array of another length."""
    values = getattr(packed, name)
    if len(values) != n * columns:
        raise InvalidGoal(
            f'packed.{name}',
            f'has {len(values)} numbers for {n} points',
            f'give {columns} for each point, or none' if columns > 1 else f'give {n}, or none',
        )
    return np.array(values, dtype=np.float64).reshape(n, columns)


def _postures(packed: Message, name: str, n: int, names: tuple[str, ...]) -> Mapping[int, Posture]:
    if not names:
        raise InvalidGoal(
            f'packed.{name}', 'has numbers, but posture_joint_names is empty', 'name the joints'
        )
    values = _matrix(packed, name, n, len(names))
    given = ~np.isnan(values)
    if given.all():  # every row has all joints
        return {
            i: Posture(names=names, values=tuple(row)) for i, row in enumerate(values.tolist())
        }
    return {
        i: Posture(
            names=tuple(name for name, is_given in zip(names, given[i], strict=True) if is_given),
            values=tuple(values[i][given[i]].tolist()),
        )
        for i in rows_where(given.any(axis=1))
    }
