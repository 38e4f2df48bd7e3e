# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Rules about single fields: enumeration values, ranges, finite numbers, unit quaternions.

The dataclasses in :mod:`~ur_cartesian_driver.motion.goal.goal` declare what each field accepts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from enum import IntEnum
from math import hypot, inf, isfinite, sqrt
from typing import Any

import numpy as np

from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, Pose, Quaternion
from ur_cartesian_driver.motion.goal.field_annotations import Form, goal_fields, GoalField
from ur_cartesian_driver.motion.goal.goal import Goal
from ur_cartesian_driver.motion.goal.goal_columns import GoalRows, GoalTable, rows_where
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.goal_fields import (
    gives_joints,
    is_spline,
    point_field,
    segment_field,
)

#: Largest allowed difference between the length of a quaternion and 1.
QUATERNION_TOLERANCE = 1e-3


def check_fields(goal: GoalTable, options: PlanningOptions) -> None:
    """Refuse values that a field never accepts, regardless of the other fields."""
    check_record('', goal, Goal)
    points, by_joints = goal.waypoints, gives_joints(goal)
    if by_joints.any():  # a pose of NaN alone is allowed: joint positions replace it
        poses = np.where(by_joints[:, None], IDENTITY.row(), points.poses)
        points = replace(points, poses=poses)
    _check_rows(points, point_field, nan_in_rates=is_spline(goal))
    _check_rows(goal.segments, segment_field)


def check_frames(goal: GoalTable, options: PlanningOptions) -> None:
    """Refuse frames whose pose is not finite or has no unit quaternion."""
    frame, controlled = goal.T_base_frame, goal.T_flange_controlled
    if goal.moving_frame is not None:
        frame, controlled = goal.moving_frame.T_flange_frame, goal.moving_frame.T_base_tool
    for name, pose in (
        ('trajectory.header.frame_id', frame),
        ('trajectory.controlled_frame', controlled),
    ):
        if pose is not None:
            check_finite(f'the pose of {name}', (*pose.position, *pose.quaternion))
            _check_unit(f'the orientation of {name}', pose.quaternion)


def check_record(
    where: str, record: Any, kind: type | None = None, nan_in_rates: bool = False
) -> None:
    """
    Refuse values that the fields of a record (an instance of a goal dataclass) do not accept.

    :param where: name of the record in the refusal.
    :param kind: the class that declares the fields; None = the class of the record.
    :param nan_in_rates: whether a rate may be NaN, so that the driver chooses the rate.
    :raises InvalidGoal: a value is not accepted; the text names field, value and bound.
    """
    for each in goal_fields(type(record) if kind is None else kind):
        field = f'{where}.{each.message_name}' if where else each.message_name
        value = getattr(record, each.name)
        if value == each.default:
            continue
        if each.form is Form.CHOICE:
            _check_member(field, value, each.type)
        elif each.form is Form.POSE and value is not None:
            _check_pose(field, value)
        elif each.form is Form.RECORD:
            check_record(field, value)
        elif each.form is Form.RECORDS and not isinstance(value, GoalRows):
            for i, one in enumerate(value):
                check_record(f'{field}[{i}]', one)
        elif each.range is not None:
            may_be_nan = nan_in_rates and each.range.nan_in_splines
            for name, number in _numbers(each, field, value):
                if not (each.range.holds(number) or (may_be_nan and number != number)):
                    raise InvalidGoal(name, *each.range.refusal(number))


def _numbers(each: GoalField, field: str, value: Any) -> Iterator[tuple[str, float]]:
    """Yield each number in a field, preceded by its name for refusals."""
    assert each.range is not None
    if each.form is Form.VALUES:
        yield from ((f'{field}[{k}]', number) for k, number in enumerate(value))
    elif each.form is Form.VECTOR and isfinite(each.range.high):
        yield from ((f'{field}.{axis}', x) for axis, x in zip('xyz', value, strict=True))
    elif each.form in (Form.VECTOR, Form.RATES):
        yield from ((field, number) for number in value)
    else:
        yield field, value


def _check_rows(
    rows: GoalRows[Any], name: Callable[[int], str], nan_in_rates: bool = False
) -> None:
    """Check all rows at once; :func:`check_record` decides about the suspect rows."""
    fine = np.ones(len(rows), dtype=np.bool_)
    for each in rows.columns():
        if rows.is_default(each):
            continue
        column, field = getattr(rows, each.name), each.field
        if field.form is Form.CHOICE:  # numbered from 0
            fine &= (column >= 0) & (column < len(field.type))
        elif field.form is Form.POSE:
            is_pose = np.isfinite(column).all(axis=1) & _are_units(column[:, 3:])
            fine &= is_pose | ~getattr(rows, each.mask) if each.mask else is_pose
        elif field.form is Form.RATES:
            may_be_nan = nan_in_rates and field.range is not None and field.range.nan_in_splines
            fine &= ((np.abs(column) < inf) | (may_be_nan & np.isnan(column))).all(axis=1)
        elif field.range is not None:
            fine &= field.range.holds(column)
    for i in rows_where(~fine):
        check_record(name(i), rows[i], nan_in_rates=nan_in_rates)


def _check_member(field: str, value: int, kind: type[IntEnum]) -> None:
    try:
        kind(value)
    except ValueError:
        names = ', '.join(f'{member.name} = {member.value}' for member in kind)
        raise InvalidGoal(field, f'is {value}; allowed are {names}') from None


def _check_pose(field: str, pose: Pose) -> None:
    check_finite(f'{field}.position', pose.position)
    check_finite(f'{field}.orientation', pose.quaternion)
    _check_unit(f'{field}.orientation', pose.quaternion)


def check_finite(field: str, values: Iterable[float]) -> None:
    """Refuse NaN and infinity."""
    for value in values:
        if not isfinite(value):
            raise InvalidGoal(field, f'contains {value}; every number must be finite')


def _are_units(quaternions: Floats) -> Flags:
    """Return for each quaternion (n, 4) whether :func:`_check_unit` certainly accepts it."""
    squares = np.einsum('ij,ij->i', quaternions, quaternions)
    are_units: Flags = np.abs(squares - 1.0) <= 0.999 * QUATERNION_TOLERANCE
    return are_units


def _check_unit(field: str, q: Quaternion) -> None:
    x, y, z, w = q
    square = x * x + y * y + z * z + w * w
    if abs(square - 1.0) <= QUATERNION_TOLERANCE:  # then |q| differs from 1 by half as much
        return
    length = sqrt(square) if isfinite(square) else hypot(x, y, z, w)
    if length == 0.0:
        raise InvalidGoal(field, 'is zero', 'send x, y, z, w = 0, 0, 0, 1 for no rotation')
    if abs(length - 1.0) > QUATERNION_TOLERANCE:
        raise InvalidGoal(
            field,
            f'has length {length:.6g}, but must be a unit quaternion (within '
            f'{QUATERNION_TOLERANCE:g})',
            'divide it by its length',
        )
