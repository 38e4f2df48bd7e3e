# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Names of a goal's fields, and predicates of goals and segments."""

from __future__ import annotations

from ur_cartesian_driver.motion.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal import (
    Goal,
    Segment,
    SegmentType,
)

#: The segments of a goal without any.
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
    """Return the execution mode: AUTO is SPLINE where only that meets twists or accelerations."""
    if goal.execution != ExecutionMode.AUTO:
        return ExecutionMode(goal.execution)
    inner = goal.waypoints if goal.keep_open else goal.waypoints[:-1]
    if is_timed(goal) and any(any(point.twist) or any(point.acceleration) for point in inner):
        return ExecutionMode.SPLINE
    return ExecutionMode.PRIMITIVES


def is_spline(goal: Goal) -> bool:
    """Tell whether a timed spline joins the points of a goal."""
    return resolve_execution_mode(goal).traits.is_spline


def is_timed(goal: Goal) -> bool:
    """Tell whether the goal has times; if not, speeds count."""
    return any(waypoint.time != 0.0 for waypoint in goal.waypoints)


def is_straight(kind: SegmentType) -> bool:
    """Tell whether the tool moves on a straight line."""
    return kind in (
        SegmentType.AUTO,
        SegmentType.LINEAR,
        SegmentType.PROCESS,
        SegmentType.OPTIMIZED_LINEAR,
    )


def is_optimized(kind: SegmentType) -> bool:
    """Tell whether speeds are fractions of the robot's limits."""
    return kind in (SegmentType.OPTIMIZED_LINEAR, SegmentType.OPTIMIZED_JOINT)
