# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A spline that swings to both sides of lines and arcs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import nan

from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import Vector6, ZERO6
from ur_cartesian_driver.motion.goal.goal import ArcMode, SegmentType
from ur_cartesian_driver.path.centre_line import arc, CentreLine, line, RestToRest, Stroke
from ur_cartesian_driver.path.path_points import PathPoint, SAME_POSITION

_POINTS_PER_WAVE = 8
#: Time step of the finite differences for the twists of points [s].
_STEP = 1e-5


def strokes(start: Pose, points: Sequence[PathPoint]) -> list[Stroke]:
    """
    Return the lines and arcs of a path.

    :raises InvalidGoal: the path has corners, other motions than lines and arcs, events,
        durations, postures or dwells.
    """
    found: list[Stroke] = []
    before = start
    for i, point in enumerate(points):
        where = f'weave() at point {i}'
        segment = point.segment
        if point.events or point.duration or point.waypoint.posture or segment.dwell:
            raise InvalidGoal(
                where,
                'has outputs or inputs, a duration, a posture or a dwell',
                'add them to the path that weave() returns',
            )
        stroke = _stroke(before, point)
        if stroke is None or stroke.length <= SAME_POSITION:
            raise InvalidGoal(
                where,
                'has a motion that is no line or arc',
                'use line() or arc(), without `optimized` and `follow`',
            )
        if found and not found[-1].is_smooth_into(stroke):
            raise InvalidGoal(
                f'weave() at point {i - 1}', 'has a corner', 'weave each leg and join them'
            )
        found.append(stroke)
        before = point.pose
    return found


def _stroke(before: Pose, point: PathPoint) -> Stroke | None:
    segment = point.segment
    if segment.type in (SegmentType.LINEAR, SegmentType.PROCESS):
        return line(before, point.pose)
    if segment.via is not None and segment.arc_mode is ArcMode.UNCONSTRAINED:
        return arc(before, segment.via.position, point.pose)
    return None


def woven(
    centre: CentreLine, motion: RestToRest, amplitude: float, waves: int
) -> Iterator[tuple[Pose, float, Vector6]]:
    """
    Yield pose, time [s] and twist of the points on waves along a centre line.

    :raises ZeroDivisionError: the tool points along the centre line.
    """
    count = waves * _POINTS_PER_WAVE
    for i in range(1, count + 1):
        s = centre.length * i / count
        twist = ZERO6
        if i < count:
            rate = motion.rate(s)
            step = min(_STEP * rate, 0.5 * centre.length / count)
            ahead, behind = (centre.swing(s + d, amplitude, waves).position for d in (step, -step))
            x, y, z = (rate * (a - b) / (2.0 * step) for a, b in zip(ahead, behind, strict=True))
            twist = (x, y, z, nan, nan, nan)
        yield centre.swing(s, amplitude, waves), motion.time(s), twist
