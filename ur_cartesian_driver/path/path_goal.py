# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Convert the points of a path to a goal, and back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from itertools import accumulate, pairwise
from math import inf
from typing import Any

from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.field_annotations import goal_fields, points_of, shifted
from ur_cartesian_driver.motion.goal.goal import Goal, Segment, SegmentType
from ur_cartesian_driver.motion.goal.goal_columns import GoalTable, SegmentRows, WaypointRows
from ur_cartesian_driver.path.path_numbers import NANOSECONDS, to_nanoseconds
from ur_cartesian_driver.path.path_points import PathPoint, SAME_POSITION
from ur_cartesian_driver.planning.request.point_events.registry import EVENT_KINDS

#: The fields of a goal that hold for its whole path. The others follow from frames and points.
SETTINGS = tuple(
    each.name
    for each in goal_fields(Goal)
    if each.name not in ('waypoints', 'segments', 'frame_id', 'controlled_frame')
    and each.name not in {kind.field for kind in EVENT_KINDS.values()}
)
#: The usual blend radius at both ends of a PROCESS motion for which none is given [m].
PROCESS_BLEND = 0.002
#: The smallest duration of such a blend [s]: the robot leaves out a blend that is shorter than one
#: cycle, which is 8 ms on the slowest controller.
_PROCESS_BLEND_TIME = 0.01
#: The largest fraction of a segment that such a blend takes up.
_PROCESS_BLEND_SHARE = 0.3


def goal_of_points(
    points: Sequence[PathPoint], settings: Goal, start: Pose | None, frame: str, tool: str
) -> GoalTable:
    """
    Return the goal with the given points; its frames are given by name only.

    :param settings: a goal without points, with the settings of the whole path.
    :param start: the pose at which the path begins, if it is known.
    """
    rests = [0, *(_nanoseconds(point.segment.dwell) for point in points[:-1])]
    times = accumulate(
        point.duration + rest if point.duration else 0
        for point, rest in zip(points, rests, strict=False)
    )
    is_rounded = settings.corner_deviation or any(
        point.segment.corner_deviation for point in points
    )
    segments = [
        replace(point.segment, blend_radius=_process_blend(points, i, start))
        if point.auto_blend and not is_rounded
        else point.segment
        for i, point in enumerate(points)
    ]
    if points and points[-1].feed_blend and not settings.keep_open:
        segments[-1] = replace(segments[-1], blend_radius=0.0)
    given: dict[str, Any] = {each.name: getattr(settings, each.name) for each in fields(Goal)}
    given |= {
        kind.field: tuple(
            shifted(event, i)
            for i, point in enumerate(points)
            for event in point.events
            if type(event) is record
        )
        for record, kind in EVENT_KINDS.items()
    }
    given['waypoints'] = WaypointRows.of(
        [
            replace(point.waypoint, time=time / NANOSECONDS)
            for point, time in zip(points, times, strict=True)
        ]
    )
    given['segments'] = SegmentRows.of(
        segments if any(segment != Segment() for segment in segments) else ()
    )
    return GoalTable(**{**given, 'frame_id': frame, 'controlled_frame': tool})


def settings_of(goal: Goal) -> Goal:
    """Return the settings of a goal that hold for its whole path, as a goal without points."""
    return Goal(waypoints=(), **{name: getattr(goal, name) for name in SETTINGS})


def points_of_goal(goal: Goal) -> tuple[PathPoint, ...]:
    """
    Return the points of a goal.

    :raises InvalidGoal: segments, times or events do not fit the points; planning would refuse
        such a goal, too.
    """
    points, segments = tuple(goal.waypoints), tuple(goal.segments)
    if len(segments) not in (0, len(points)):
        raise InvalidGoal(
            'segments',
            f'has {len(segments)} entries for {len(points)} points',
            'give none, or one for each point',
        )
    times = [to_nanoseconds(f'points[{i}]', point.time) for i, point in enumerate(points)]
    rests = [_nanoseconds(segment.dwell) for segment in segments] or [0] * len(points)
    events = _events(goal)
    in_spline = any(times) and (
        goal.execution in (ExecutionMode.SPLINE, ExecutionMode.SERVO)
        or any(any(point.twist) or any(point.acceleration) for point in points[:-1])
    )
    return tuple(
        PathPoint(
            waypoint=replace(point, time=0.0),
            segment=segments[i] if segments else Segment(),
            duration=times[i] - (times[i - 1] + rests[i - 1] if i and times[i] else 0),
            events=tuple(events.get(i, ())),
            in_spline=in_spline,
        )
        for i, point in enumerate(points)
    )


def _events(goal: Goal) -> dict[int, list[Any]]:
    """Return the events that happen or begin at each point, by the number of the point."""
    found: dict[int, list[Any]] = {}
    for kind in EVENT_KINDS.values():
        for event in kind.of(goal):
            points = list(points_of(event).values())
            is_in_order = all(a < b for a, b in pairwise([-1, *points, len(goal.waypoints)]))
            if not is_in_order and len(points) == 1:
                raise InvalidGoal(
                    kind.field, f'names point {points[0]}, which is none', 'name another'
                )
            if not is_in_order:
                names = ' to '.join(map(str, points))
                raise InvalidGoal(kind.field, f'names points {names}', 'name others')
            first = points[0]
            found.setdefault(first, []).append(shifted(event, -first))
    return found


def _nanoseconds(time: float) -> int:
    return round(time * NANOSECONDS)


def _process_blend(points: Sequence[PathPoint], index: int, start: Pose | None) -> float:
    """
    Return the blend radius of a point for which none is given [m]; 0 if it gets no blend.

    The last point gets no blend. Any other point gets one if the motion to or from it is a PROCESS
    motion, and if the blend fits.
    """
    if index + 1 == len(points):
        return 0.0
    point, after = points[index], points[index + 1]
    if SegmentType.PROCESS not in (point.segment.type, after.segment.type):
        return 0.0
    before = points[index - 1].pose if index else start
    shortest = min(
        point.pose.distance_to(after.pose),
        inf if before is None else point.pose.distance_to(before),
    )
    least = _PROCESS_BLEND_TIME * point.segment.velocity
    radius = min(max(PROCESS_BLEND, least), _PROCESS_BLEND_SHARE * shortest)
    return radius if radius >= max(least, SAME_POSITION) else 0.0
