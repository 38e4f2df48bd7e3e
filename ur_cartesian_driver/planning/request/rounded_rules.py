# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Rules about goals whose lines and arcs have rounded corners."""

from __future__ import annotations

import numpy as np

from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.goal.goal import (
    DEFAULT_CORNER_ANGLE,
    Segment,
    SegmentType,
)
from ur_cartesian_driver.motion.goal.goal_columns import GoalTable, rows_where
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.goal_fields import (
    is_rounded,
    is_timed,
    resolve_execution_mode,
    segment_field,
    TAKES_TOOL_SPEED,
)


def corner_bounds(goal: GoalTable) -> Floats:
    """Return the deviations (n, 2) [m], [rad] that a goal allows at its points; 0 = it stops."""
    segments = goal.motions
    deviation = np.where(
        segments.corner_deviations > 0.0, segments.corner_deviations, goal.corner_deviation
    )
    angle = np.where(
        segments.corner_angles > 0.0,
        segments.corner_angles,
        goal.corner_angle or DEFAULT_CORNER_ANGLE,
    )
    return np.stack([deviation, np.where(deviation > 0.0, angle, 0.0)], axis=1)


def check_rounded(goal: GoalTable, options: PlanningOptions) -> None:
    """Refuse a goal with rounded corners if its mode, times or segments exclude them."""
    _check_angles(goal)
    if not is_rounded(goal):
        return
    mode = resolve_execution_mode(goal)
    name = 'corner_deviation' if goal.corner_deviation else _first_corner(goal)
    if not mode.traits.is_spline:
        raise InvalidGoal(
            name,
            f'is set, but with execution {mode.name} the robot rounds corners by its own blends',
            'set execution to SPLINE or SERVO, or use blend_radius',
        )
    if is_timed(goal):
        raise InvalidGoal(
            name,
            'is set, but the goal has times; the speed along rounded corners follows from the '
            'segments',
            'set all times to 0, and velocity of the segments',
        )
    if goal.keep_open:
        raise InvalidGoal(
            name,
            'is set, but the points of a goal with keep_open are not all known',
            'send the whole path',
        )
    segments = goal.segments
    wrong = ~TAKES_TOOL_SPEED[segments.types] | (segments.blend_radii > 0.0)
    for i in rows_where(wrong)[:1]:
        _refuse_segment(i, segments[i])


def _check_angles(goal: GoalTable) -> None:
    """Refuse a corner_angle where there is no corner_deviation."""
    segments = goal.segments
    without = (segments.corner_deviations == 0.0) & (goal.corner_deviation == 0.0)
    given = [
        (segment_field(i, 'corner_angle'), float(segments.corner_angles[i]))
        for i in rows_where((segments.corner_angles > 0.0) & without)[:1]
    ]
    if goal.corner_angle and not is_rounded(goal):
        given.insert(0, ('corner_angle', goal.corner_angle))
    for field, angle in given[:1]:
        raise InvalidGoal(
            field,
            f'is {angle:g} rad, but without corner_deviation the arm rounds no corner there',
            'set corner_deviation as well, or set it to 0',
        )


def _first_corner(goal: GoalTable) -> str:
    rows = rows_where(goal.segments.corner_deviations > 0.0)
    return segment_field(rows[0], 'corner_deviation')


def _refuse_segment(index: int, segment: Segment) -> None:
    if segment.blend_radius > 0.0:
        raise InvalidGoal(
            segment_field(index, 'blend_radius'),
            f'is {segment.blend_radius:g} m, but corner_deviation rounds the corners of this goal',
            'set one of them to 0',
        )
    raise InvalidGoal(
        segment_field(index, 'type'),
        f'is {SegmentType(segment.type).name}, but only lines and arcs have rounded corners',
        'use LINEAR or CIRCULAR, or a goal of its own for that motion',
    )
