# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Rules about segments on which the tool may turn about a free axis."""

from __future__ import annotations

from math import tau

import numpy as np

from ur_cartesian_driver.motion.errors import InvalidGoal, NotAvailable
from ur_cartesian_driver.motion.goal.goal import ArcMode, FreeAxis, SegmentType
from ur_cartesian_driver.motion.goal.goal_columns import GoalTable, rows_where
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.goal_fields import segment_field

#: Tolerance [rad] for a range of a full turn, because clients write 2 pi with few digits.
_ROUNDING = 1e-3


def check_free_axes(goal: GoalTable, options: PlanningOptions) -> None:
    """Refuse invalid ranges, different free axes, and free axes with FIXED arcs or keep_open."""
    segments = goal.segments
    if not any(map(np.any, (segments.free_axes, segments.free_minima, segments.free_maxima))):
        return
    free = segments.free_axes != FreeAxis.NONE
    low, high = segments.free_minima, segments.free_maxima
    too_wide = high - low > tau + _ROUNDING
    too_wide |= np.maximum(np.abs(low), np.abs(high)) > tau + _ROUNDING
    follows = (segments.types == SegmentType.CIRCULAR) & (segments.arc_modes == ArcMode.FIXED)
    free_start = np.append(False, free[:-1])[: len(free)]
    suspect = np.where(free, (low > high) | too_wide, (low != 0.0) | (high != 0.0))
    suspect |= follows & (free | free_start) | (free & goal.keep_open)
    one = segments.free_axes[free][:1]
    suspect |= free & (segments.free_axes != one if len(one) else False)
    for i in rows_where(suspect):
        if goal.keep_open and free[i]:
            raise keep_open_error(i)
        if follows[i] and (free[i] or free_start[i]):
            where = (
                'which ties the tool to the arc'
                if free[i]
                else (f'which takes its orientation from points[{i - 1}], whose rotation is free')
            )
            raise InvalidGoal(
                segment_field(i, 'arc_mode'),
                f'is FIXED, {where}',
                'use UNCONSTRAINED, or set free_axis to NONE',
            )
        if free[i] and segments.free_axes[i] != one[0]:
            raise InvalidGoal(
                segment_field(i, 'free_axis'),
                f'is {FreeAxis(segments.free_axes[i]).name}, but that of another segment is '
                f'{FreeAxis(one[0]).name}',
                'use one free axis in a goal, or split the goal',
            )
        _check_range(i, bool(free[i]), float(low[i]), float(high[i]))


def keep_open_error(index: int) -> NotAvailable:
    """Return the refusal of a free axis in a goal with keep_open."""
    return NotAvailable(
        segment_field(index, 'free_axis'),
        'is set in a goal with keep_open, but the rotation is chosen along the whole path',
        'send all points at once, or set it to NONE',
    )


def _check_range(index: int, free: bool, low: float, high: float) -> None:
    field = segment_field(index, 'free_min' if low != 0.0 else 'free_max')
    if not free:
        raise InvalidGoal(field, 'is set, but free_axis is NONE', 'name the axis, or set it to 0')
    if low > high:
        raise InvalidGoal(
            segment_field(index, 'free_min'),
            f'is {low:g} rad, more than free_max = {high:g} rad',
            'exchange them',
        )
    if max(abs(low), abs(high)) > tau + _ROUNDING:
        value = low if abs(low) >= abs(high) else high
        raise InvalidGoal(
            segment_field(index, 'free_min' if value == low else 'free_max'),
            f'is {value:g} rad, more than a full turn',
            'give radians, not degrees; set both to 0 for any rotation',
        )
    raise InvalidGoal(
        segment_field(index, 'free_max'),
        f'is {high - low:g} rad above free_min, more than a full turn',
        'set both to 0 for any rotation',
    )
