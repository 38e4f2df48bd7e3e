# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""What a goal says: the names of its fields, and what follows from them."""

from __future__ import annotations

from ur_cartesian_driver.motion.goal import (
    ExecutionMode,
    Goal,
    Segment,
    SegmentType,
)

#: A goal without segments has these.
DEFAULT_SEGMENT = Segment()


def point_field(index: int, field: str = '') -> str:
    """Return the name of a point's field as in the message."""
    return f'trajectory.points[{index}]' + (f'.{field}' if field else '')


def segment_field(index: int, field: str) -> str:
    """Return the name of a segment's field as in the message."""
    return f'segments[{index}].{field}'


def segment_of(goal: Goal, index: int) -> Segment:
    """Return the segment that ends at a point, the plain one where the goal has none."""
    return goal.segments[index] if goal.segments else DEFAULT_SEGMENT


def resolve_execution_mode(goal: Goal) -> ExecutionMode:
    """Return how a goal is carried out: AUTO means SPLINE where only that does what it asks."""
    if goal.execution != ExecutionMode.AUTO:
        return ExecutionMode(goal.execution)
    inner = goal.waypoints if goal.keep_open else goal.waypoints[:-1]
    if is_timed(goal) and any(any(point.twist) or any(point.acceleration) for point in inner):
        return ExecutionMode.SPLINE
    return ExecutionMode.PRIMITIVES


def is_spline(goal: Goal) -> bool:
    """Tell whether the goal's points are joined by a spline, with times."""
    return resolve_execution_mode(goal) in (ExecutionMode.SPLINE, ExecutionMode.SERVO)


def is_timed(goal: Goal) -> bool:
    """Tell whether the goal gives times; if not, speeds decide."""
    return any(waypoint.time != 0.0 for waypoint in goal.waypoints)


def is_straight(kind: SegmentType) -> bool:
    """Tell whether the tool goes on a straight line."""
    return kind in (
        SegmentType.AUTO,
        SegmentType.LINEAR,
        SegmentType.PROCESS,
        SegmentType.OPTIMIZED_LINEAR,
    )


def is_optimized(kind: SegmentType) -> bool:
    """Tell whether speeds are fractions of the robot's limits."""
    return kind in (SegmentType.OPTIMIZED_LINEAR, SegmentType.OPTIMIZED_JOINT)
