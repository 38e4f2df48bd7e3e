# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Rules about single numbers: enums, finite values, signs, unit quaternions."""

from __future__ import annotations

from collections.abc import Iterable
from enum import IntEnum
from math import hypot, isfinite, isnan, sqrt
from typing import TypeVar

from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal import ArcMode, Goal, SegmentType, Waypoint
from ur_cartesian_driver.motion.pose import Quaternion
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.default_tolerances import named_tolerances
from ur_cartesian_driver.planning.request.goal_fields import is_spline, point_field, segment_field

#: How far the length of a quaternion may differ from 1.
QUATERNION_TOLERANCE = 1e-3

_Enum = TypeVar('_Enum', bound=IntEnum)


def check_enums(goal: Goal, options: PlanningOptions) -> None:
    """Refuse a mode or a type that does not exist."""
    _check_enum('execution', goal.execution, ExecutionMode)
    for i, segment in enumerate(goal.segments):
        _check_enum(segment_field(i, 'type'), segment.type, SegmentType)
        _check_enum(segment_field(i, 'arc_mode'), segment.arc_mode, ArcMode)


def check_frame_numbers(goal: Goal, options: PlanningOptions) -> None:
    """Refuse poses of frames that are no poses."""
    for name, pose in (
        ('trajectory.header.frame_id', goal.T_base_frame),
        ('trajectory.controlled_frame', goal.T_flange_controlled),
    ):
        if pose is not None:
            check_finite(f'the pose of {name}', (*pose.position, *pose.quaternion))
            _check_unit(f'the orientation of {name}', pose.quaternion)


def check_point_numbers(goal: Goal, options: PlanningOptions) -> None:
    """Refuse points with numbers that are not finite, or with no orientation."""
    nan_allowed: bool | None = None
    for i, point in enumerate(goal.waypoints):
        if not _all_finite(point):
            nan_allowed = is_spline(goal) if nan_allowed is None else nan_allowed
            _refuse_not_finite(i, point, nan_allowed)
        _check_unit(point_field(i, 'pose.orientation'), point.pose.quaternion)


def check_segment_numbers(goal: Goal, options: PlanningOptions) -> None:
    """Refuse segments with negative numbers, or with ones that are not finite."""
    for i, segment in enumerate(goal.segments):
        for field in ('blend_radius', 'velocity', 'acceleration'):
            value = getattr(segment, field)
            check_finite(segment_field(i, field), (value,))
            if value < 0.0:
                raise InvalidGoal(
                    segment_field(i, field), f'is {value:g}; it must not be negative'
                )
        if segment.via is not None:
            check_finite(segment_field(i, 'via.position'), segment.via.position)
            check_finite(segment_field(i, 'via.orientation'), segment.via.quaternion)
            _check_unit(segment_field(i, 'via.orientation'), segment.via.quaternion)


def check_tolerance_numbers(goal: Goal, options: PlanningOptions) -> None:
    """Refuse tolerances that are not finite."""
    for name, tolerance in named_tolerances(goal):
        for field in ('position', 'orientation', 'twist', 'acceleration'):
            check_finite(f'{name}.{field}_error', getattr(tolerance, field))
    check_finite('goal_time_tolerance', (goal.goal_time_tolerance,))


def _check_enum(field: str, value: int, kind: type[_Enum]) -> None:
    try:
        kind(value)
    except ValueError:
        names = ', '.join(f'{member.name} = {member.value}' for member in kind)
        raise InvalidGoal(field, f'is {value}; allowed are {names}') from None


def _all_finite(point: Waypoint) -> bool:
    # A sum is finite only if every term is. Huge numbers may add up to infinity: then the slow
    # check finds nothing.
    pose = point.pose
    return isfinite(
        point.time
        + sum(pose.position)
        + sum(pose.quaternion)
        + sum(point.twist)
        + sum(point.acceleration)
        + sum(point.jerk)
    )


def _refuse_not_finite(index: int, point: Waypoint, nan_allowed: bool) -> None:
    """
    Refuse the number that is not finite.

    :param nan_allowed: whether NaN in twist and acceleration lets the driver choose.
    """
    check_finite(point_field(index, 'time_from_start'), (point.time,))
    check_finite(point_field(index, 'pose.position'), point.pose.position)
    check_finite(point_field(index, 'pose.orientation'), point.pose.quaternion)
    for field in ('twist', 'acceleration', 'jerk'):
        values = getattr(point, field)
        check_finite(
            point_field(index, field),
            (
                0.0 if nan_allowed and field != 'jerk' and isnan(value) else value
                for value in values
            ),
        )


def check_finite(field: str, values: Iterable[float]) -> None:
    """Refuse NaN and infinity."""
    for value in values:
        if not isfinite(value):
            raise InvalidGoal(field, f'contains {value}; every number must be finite')


def _check_unit(field: str, q: Quaternion) -> None:
    x, y, z, w = q
    square = x * x + y * y + z * z + w * w
    if abs(square - 1.0) <= QUATERNION_TOLERANCE:  # |q| is then within half of it
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
