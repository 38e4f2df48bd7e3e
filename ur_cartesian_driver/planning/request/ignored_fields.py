# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Remarks about fields of a goal that have no effect."""

from __future__ import annotations

from functools import partial

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Flags
from ur_cartesian_driver.motion.goal.goal import SegmentType
from ur_cartesian_driver.motion.goal.goal_columns import GoalTable, rows_where
from ur_cartesian_driver.motion.plan.slow_stretch import name_points
from ur_cartesian_driver.planning.request.goal_fields import (
    is_rounded,
    is_timed,
    TAKES_TOOL_SPEED,
    type_table,
)

#: Segment types that are sent with a time if the goal has times, so that acceleration is ignored.
_IS_TIMED = type_table((SegmentType.AUTO, SegmentType.LINEAR, SegmentType.JOINT))


def ignored_remarks(goal: GoalTable, first: int = 0, translates: Flags | None = None) -> list[str]:
    """
    Return a remark for each field without effect.

    :param first: the number of the first point.
    :param translates: (n,) whether each segment moves the tool, and does not only turn it; None =
        not known.
    """
    remarks: list[str] = []
    points, segments, motions = goal.waypoints, goal.segments, goal.motions
    add = partial(add_remark, remarks, first)
    has_twist = points.twists.any(axis=1)
    if timed := is_timed(goal):
        add(has_twist, 'twist is ignored: UR motion commands stop or blend at a point')
    else:
        takes_twist = (motions.velocities == 0.0) & TAKES_TOOL_SPEED[motions.types]
        add(
            has_twist & ~takes_twist,
            'twist is ignored: the segment has a velocity, or its type takes no tool speed',
        )
        if translates is not None:
            part = np.where(translates[:, None], points.twists[:, :3], points.twists[:, 3:])
            add(
                has_twist & takes_twist & ~part.any(axis=1),
                'twist is ignored: the speed is that of its linear part, or of its angular part '
                'where the tool only turns, and that part is 0',
            )
    add(
        points.accelerations.any(axis=1),
        'acceleration is ignored: '
        + (
            'corners are rounded with those of the segments'
            if is_rounded(goal)
            else 'UR motion commands cannot meet it'
        ),
    )
    add(points.jerks.any(axis=1), 'jerk is ignored: no robot motion takes it')
    if timed:
        add(
            (segments.accelerations > 0.0) & _IS_TIMED[segments.types],
            'the acceleration of the segment is ignored: its time sets the speed',
        )
    if segments and segments.blend_radii[-1] > 0.0 and not goal.keep_open:
        remarks.append(
            f'point {first + len(points) - 1}: blend_radius is ignored: the last point is never '
            'blended'
        )
    return remarks


def add_remark(remarks: list[str], first: int, rows: Flags | np.bool_, what: str) -> None:
    """Add a remark about the points of the flagged rows, if any; row 0 is the point ``first``."""
    points = [first + row for row in rows_where(rows)]
    if points:
        remarks.append(f'{name_points(points)}: {what}')
