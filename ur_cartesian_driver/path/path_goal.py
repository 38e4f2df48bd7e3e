# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""From the points of a path to a goal and back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from itertools import accumulate
from math import inf
from typing import TypeVar

from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import (
    Goal,
    InputWait,
    IOCommand,
    PayloadChange,
    Press,
    ProportionalOutput,
    ScriptCall,
    Segment,
    SegmentType,
)
from ur_cartesian_driver.motion.goal.goal_table import GoalTable, SegmentRows, WaypointRows
from ur_cartesian_driver.path.path_numbers import NANOSECONDS, to_nanoseconds
from ur_cartesian_driver.path.path_points import PathPoint, PathSettings, SAME_POSITION

_Stretch = TypeVar('_Stretch', ProportionalOutput, Press)
_Event = TypeVar('_Event', IOCommand, InputWait, PayloadChange, ScriptCall)
_Stop = TypeVar('_Stop', InputWait, PayloadChange, ScriptCall)

#: The blend of a point on a process that has none [m], and how long the tool is in it at least
#: [s]: the cycle of the slowest controller is 8 ms, and a blend that is passed in one is left out.
PROCESS_BLEND = 0.002
_PROCESS_BLEND_TIME = 0.01
#: The share of a segment that such a blend takes at most.
_PROCESS_BLEND_SHARE = 0.3


def goal_of_points(
    points: Sequence[PathPoint],
    settings: PathSettings,
    start: Pose | None,
    frame: str,
    tool: str,
) -> GoalTable:
    """
    Return a goal whose frames only have their names.

    :param start: where the path begins, if it says so.
    """
    rests = [0, *(_nanoseconds(point.segment.dwell) for point in points[:-1])]
    times = accumulate(
        point.duration + rest if point.duration else 0
        for point, rest in zip(points, rests, strict=False)
    )
    segments = [
        replace(point.segment, blend_radius=_process_blend(points, i, start))
        if point.auto_blend
        else point.segment
        for i, point in enumerate(points)
    ]
    if points and points[-1].feed_blend and not settings.keep_open:
        segments[-1] = replace(segments[-1], blend_radius=0.0)
    return GoalTable(
        waypoints=WaypointRows.of(
            [
                replace(point.waypoint, time=time / NANOSECONDS)
                for point, time in zip(points, times, strict=True)
            ]
        ),
        segments=SegmentRows.of(
            segments if any(segment != Segment() for segment in segments) else ()
        ),
        frame_id=frame,
        controlled_frame=tool,
        io_commands=tuple(
            replace(command, waypoint=i)
            for i, point in enumerate(points)
            for command in point.outputs
        ),
        input_waits=_stops(points, InputWait),
        script_calls=_stops(points, ScriptCall),
        payload_changes=_stops(points, PayloadChange),
        proportional_outputs=_stretches(points, ProportionalOutput),
        presses=_stretches(points, Press),
        **{each.name: getattr(settings, each.name) for each in fields(settings)},
    )


def points_of_goal(goal: Goal) -> tuple[PathPoint, ...]:
    """
    Return the points of a goal.

    :raises InvalidGoal: its lists do not fit each other, so that it would be refused anyway.
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
    outputs = _by_point('io_commands', goal.io_commands, len(points))
    waits = _by_point('input_waits', goal.input_waits, len(points))
    calls = _by_point('script_calls', goal.script_calls, len(points))
    payloads = _by_point('payload_changes', goal.payload_changes, len(points))
    stretches: dict[int, list[ProportionalOutput | Press]] = {}
    for name in ('proportional_outputs', 'presses'):
        for stretch in getattr(goal, name):
            first, last = stretch.first_waypoint, stretch.last_waypoint
            if not 0 <= first < last < len(points):
                raise InvalidGoal(name, f'names points {first} to {last}', 'name others')
            stretch = replace(stretch, first_waypoint=0, last_waypoint=last - first)
            stretches.setdefault(first, []).append(stretch)
    in_spline = any(times) and (
        goal.execution in (ExecutionMode.SPLINE, ExecutionMode.SERVO)
        or any(any(point.twist) or any(point.acceleration) for point in points[:-1])
    )
    return tuple(
        PathPoint(
            waypoint=replace(point, time=0.0),
            segment=segments[i] if segments else Segment(),
            duration=times[i] - (times[i - 1] + rests[i - 1] if i and times[i] else 0),
            outputs=tuple(outputs.get(i, ())),
            stretches=tuple(stretches.get(i, ())),
            stops=(*waits.get(i, ()), *calls.get(i, ()), *payloads.get(i, ())),
            in_spline=in_spline,
        )
        for i, point in enumerate(points)
    )


def _by_point(field: str, events: Sequence[_Event], count: int) -> dict[int, list[_Event]]:
    """Return what happens at points by the point, with the waypoint 0."""
    found: dict[int, list[_Event]] = {}
    for event in events:
        if not 0 <= event.waypoint < count:
            raise InvalidGoal(
                field, f'names point {event.waypoint}, which is none', 'name another'
            )
        found.setdefault(event.waypoint, []).append(replace(event, waypoint=0))
    return found


def _stops(points: Sequence[PathPoint], kind: type[_Stop]) -> tuple[_Stop, ...]:
    """Return what is done at points where the arm stops, of one kind, with its waypoints."""
    return tuple(
        replace(stop, waypoint=i)
        for i, point in enumerate(points)
        for stop in point.stops
        if isinstance(stop, kind)
    )


def _stretches(points: Sequence[PathPoint], kind: type[_Stretch]) -> tuple[_Stretch, ...]:
    """Return those of one kind, with their waypoints."""
    return tuple(
        _ended(stretch, i)
        for i, point in enumerate(points)
        for stretch in point.stretches
        if isinstance(stretch, kind)
    )


def _ended(stretch: _Stretch, index: int) -> _Stretch:
    if stretch.last_waypoint:
        return replace(stretch, first_waypoint=index, last_waypoint=index + stretch.last_waypoint)
    if isinstance(stretch, Press):
        raise InvalidGoal(
            f'press() at point {index}', 'has no end', 'call end_press() at a later point'
        )
    raise InvalidGoal(
        f'follow_speed() at point {index}',
        f'has no end for analog output {stretch.pin}',
        'call end_follow_speed() at a later point',
    )


def _nanoseconds(time: float) -> int:
    return round(time * NANOSECONDS)


def _process_blend(points: Sequence[PathPoint], index: int, start: Pose | None) -> float:
    """
    Return the radius at a point without one where a process goes on; 0 where none fits.

    An arc is part of a process where one follows.
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
