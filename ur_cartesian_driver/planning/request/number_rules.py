# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Rules about single numbers: enums, finite values, signs, unit quaternions."""

from __future__ import annotations

from collections.abc import Iterable
from enum import IntEnum
from math import hypot, isfinite, isnan, sqrt
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ur_cartesian_driver.motion.errors import InvalidGoal, NotAvailable
from ur_cartesian_driver.motion.geometry.pose import Quaternion
from ur_cartesian_driver.motion.geometry.pose_rows import Floats
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import (
    ArcMode,
    ContactEnd,
    DEFAULT_STALL_TIMEOUT,
    FreeAxis,
    InputKind,
    OnPathTolerance,
    OutputKind,
    PressFrame,
    SegmentType,
    StaleOffset,
    Waypoint,
)
from ur_cartesian_driver.motion.goal.goal_table import GoalTable, rows_where
from ur_cartesian_driver.motion.state.io_signals import AnalogDomain
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.default_tolerances import named_tolerances
from ur_cartesian_driver.planning.request.goal_fields import (
    is_spline,
    point_field,
    resolve_execution_mode,
    segment_field,
)

#: How far the length of a quaternion may differ from 1.
QUATERNION_TOLERANCE = 1e-3
#: The shortest and the longest horizon behind which points can be replaced [s].
REPLACE_HORIZONS = 0.05, 1.0

_Enum = TypeVar('_Enum', bound=IntEnum)


def check_enums(goal: GoalTable, options: PlanningOptions) -> None:
    """Refuse a mode, a type or an input that does not exist."""
    _check_enum('execution', goal.execution, ExecutionMode)
    _check_enum('on_path_tolerance', goal.on_path_tolerance, OnPathTolerance)
    _check_enum('path_offset.on_stale', goal.path_offset.on_stale, StaleOffset)
    for i, press in enumerate(goal.presses):
        _check_enum(f'presses[{i}].frame', press.frame, PressFrame)
        _check_enum(f'presses[{i}].contact', press.contact, ContactEnd)
    for i, wait in enumerate(goal.input_waits):
        _check_enum(f'input_waits[{i}].input', wait.input, InputKind)
    segments = goal.segments
    known = np.isin(segments.types, list(SegmentType)) & np.isin(segments.arc_modes, list(ArcMode))
    known &= np.isin(segments.free_axes, list(FreeAxis))
    for i in rows_where(~known):
        segment = segments[i]
        _check_enum(segment_field(i, 'type'), segment.type, SegmentType)
        _check_enum(segment_field(i, 'arc_mode'), segment.arc_mode, ArcMode)
        _check_enum(segment_field(i, 'free_axis'), segment.free_axis, FreeAxis)


def check_output_enums(goal: GoalTable) -> None:
    """Refuse outputs, and what they carry, that do not exist."""
    for name in ('io_commands', 'safe_outputs'):
        for i, output in enumerate(getattr(goal, name)):
            _check_enum(f'{name}[{i}].output', output.output, OutputKind)
            _check_enum(f'{name}[{i}].analog_domain', output.domain, AnalogDomain)
    for i, amount in enumerate(goal.proportional_outputs):
        _check_enum(f'proportional_outputs[{i}].analog_domain', amount.domain, AnalogDomain)


def check_frame_numbers(goal: GoalTable, options: PlanningOptions) -> None:
    """Refuse poses of frames that are no poses."""
    for name, pose in (
        ('trajectory.header.frame_id', goal.T_base_frame),
        ('trajectory.controlled_frame', goal.T_flange_controlled),
    ):
        if pose is not None:
            check_finite(f'the pose of {name}', (*pose.position, *pose.quaternion))
            _check_unit(f'the orientation of {name}', pose.quaternion)


def check_point_numbers(goal: GoalTable, options: PlanningOptions) -> None:
    """Refuse points with numbers that are not finite, or with no orientation."""
    points = goal.waypoints
    numbers = (points.times[:, None], points.poses, points.jerks)
    rates = (points.twists, points.accelerations)
    fine = _are_units(points.poses[:, 3:])
    for values in (*numbers, *rates):
        fine &= np.isfinite(values).all(axis=1)
    if fine.all():
        return
    # NaN in a rate of a spline lets the driver choose.
    nan_allowed = is_spline(goal)
    for i in rows_where(~fine):
        _check_point(i, points[i], nan_allowed)


def check_segment_numbers(goal: GoalTable, options: PlanningOptions) -> None:
    """Refuse segments with negative numbers, or with ones that are not finite."""
    segments = goal.segments
    numbers = np.stack(
        (segments.blend_radii, segments.dwells, segments.velocities, segments.accelerations)
    )
    vias = segments.vias
    fine = (np.isfinite(numbers) & (numbers >= 0.0)).all(axis=0)
    fine &= np.isfinite(segments.free_minima) & np.isfinite(segments.free_maxima)
    fine &= ~segments.has_via | (np.isfinite(vias).all(axis=1) & _are_units(vias[:, 3:]))
    for i in rows_where(~fine):
        segment = segments[i]
        for field in ('blend_radius', 'dwell', 'velocity', 'acceleration'):
            value = getattr(segment, field)
            check_finite(segment_field(i, field), (value,))
            if value < 0.0:
                raise InvalidGoal(
                    segment_field(i, field), f'is {value:g}; it must not be negative'
                )
        for field in ('free_min', 'free_max'):
            check_finite(segment_field(i, field), (getattr(segment, field),))
        if segment.via is not None:
            check_finite(segment_field(i, 'via.position'), segment.via.position)
            check_finite(segment_field(i, 'via.orientation'), segment.via.quaternion)
            _check_unit(segment_field(i, 'via.orientation'), segment.via.quaternion)


def check_tolerance_numbers(goal: GoalTable, options: PlanningOptions) -> None:
    """Refuse tolerances that are not finite."""
    for name, tolerance in named_tolerances(goal):
        for field in ('position', 'orientation', 'twist', 'acceleration'):
            check_finite(f'{name}.{field}_error', getattr(tolerance, field))
    check_finite('goal_time_tolerance', (goal.goal_time_tolerance,))
    check_finite('stall_timeout', (goal.stall_timeout,))
    if goal.stall_timeout < 0.0:
        raise InvalidGoal(
            'stall_timeout',
            f'is {goal.stall_timeout:g} s; it must not be negative',
            f'set 0 for {DEFAULT_STALL_TIMEOUT:g} s',
        )


def check_replace_horizon(goal: GoalTable, options: PlanningOptions) -> None:
    """Refuse a horizon that is none, or in a goal whose points cannot be replaced."""
    field, horizon = 'replace_horizon', goal.replace_horizon
    check_finite(field, (horizon,))
    if not horizon:
        return
    low, high = REPLACE_HORIZONS
    if not low <= horizon <= high:
        raise InvalidGoal(
            field,
            f'is {horizon:g} s, but must be 0 (nothing is replaced) or from {low:g} to {high:g} s',
            'set it to 0.15',
        )
    if not goal.keep_open:
        raise InvalidGoal(
            field,
            f'is {horizon:g} s, but only points of a goal with keep_open can be replaced',
            'set keep_open',
        )
    mode = resolve_execution_mode(goal)
    if not mode.traits.is_spline:
        raise NotAvailable(
            field,
            f'is {horizon:g} s, but motions of the robot, which {mode.name} sends, cannot be '
            'planned from the middle of a motion',
            'set execution to SPLINE or SERVO',
        )


def check_min_speed_fraction(goal: GoalTable, options: PlanningOptions) -> None:
    """Refuse a demand on the speed that is no fraction, or that cannot be checked."""
    field, fraction = 'min_speed_fraction', goal.min_speed_fraction
    check_finite(field, (fraction,))
    if not 0.0 <= fraction <= 1.0:
        raise InvalidGoal(
            field, f'is {fraction:g}, but must be from 0 (not demanded) to 1', 'give a fraction'
        )
    if fraction and goal.keep_open:
        raise InvalidGoal(
            field,
            f'is {fraction:g}, but the points of a goal with keep_open are not all known',
            'set it to 0, or send the whole path',
        )


def _check_enum(field: str, value: int, kind: type[_Enum]) -> None:
    try:
        kind(value)
    except ValueError:
        names = ', '.join(f'{member.name} = {member.value}' for member in kind)
        raise InvalidGoal(field, f'is {value}; allowed are {names}') from None


def _check_point(index: int, point: Waypoint, nan_allowed: bool) -> None:
    """
    Refuse a number that is not finite, and an orientation that is none.

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
    _check_unit(point_field(index, 'pose.orientation'), point.pose.quaternion)


def check_finite(field: str, values: Iterable[float]) -> None:
    """Refuse NaN and infinity."""
    for value in values:
        if not isfinite(value):
            raise InvalidGoal(field, f'contains {value}; every number must be finite')


def _are_units(quaternions: Floats) -> NDArray[np.bool_]:
    """Tell of quaternions (n, 4) whether :func:`_check_unit` has nothing to say."""
    squares = np.einsum('ij,ij->i', quaternions, quaternions)
    are_units: NDArray[np.bool_] = np.abs(squares - 1.0) <= 0.999 * QUATERNION_TOLERANCE
    return are_units


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
