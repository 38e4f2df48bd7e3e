# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Remarks about fields of a goal that have no effect."""

from __future__ import annotations

from ur_cartesian_driver.motion.goal import Goal, SegmentType
from ur_cartesian_driver.planning.request.goal_fields import is_optimized, is_timed, segment_of

#: How many points a remark lists before it counts the rest.
_MAX_LISTED = 5


def ignored_remarks(goal: Goal, first: int = 0) -> list[str]:
    """Return a remark for each field without effect; the first point has the number ``first``."""
    remarks: list[str] = []
    timed = is_timed(goal)
    points = list(enumerate(goal.waypoints, first))
    if timed:
        add_remark(
            remarks,
            [i for i, p in points if any(p.twist)],
            'twist is ignored: UR motion commands stop or blend at a point',
        )
    else:
        add_remark(
            remarks,
            [i for i, p in points if any(p.twist) and not _takes_twist(goal, i - first)],
            'twist is ignored: the segment has a velocity, or its type takes no tool speed',
        )
    add_remark(
        remarks,
        [i for i, p in points if any(p.acceleration)],
        'acceleration is ignored: UR motion commands cannot meet it',
    )
    add_remark(
        remarks, [i for i, p in points if any(p.jerk)], 'jerk is ignored: no robot motion takes it'
    )
    if timed:
        add_remark(
            remarks,
            [
                i
                for i, s in enumerate(goal.segments, first)
                if s.acceleration > 0.0
                and s.type in (SegmentType.AUTO, SegmentType.LINEAR, SegmentType.JOINT)
            ],
            'the acceleration of the segment is ignored: its time sets the speed',
        )
    if goal.segments and goal.segments[-1].blend_radius > 0.0 and not goal.keep_open:
        remarks.append(
            f'point {points[-1][0]}: blend_radius is ignored: the last point is never blended'
        )
    return remarks


def _takes_twist(goal: Goal, index: int) -> bool:
    segment = segment_of(goal, index)
    return (
        segment.velocity == 0.0
        and segment.type != SegmentType.JOINT
        and not is_optimized(segment.type)
    )


def add_remark(remarks: list[str], points: list[int], what: str) -> None:
    """Add a remark about points, if there are any."""
    if not points:
        return
    listed = ', '.join(str(i) for i in points[:_MAX_LISTED])
    more = f' and {len(points) - _MAX_LISTED} more' if len(points) > _MAX_LISTED else ''
    word = 'point' if len(points) == 1 else 'points'
    remarks.append(f'{word} {listed}{more}: {what}')
