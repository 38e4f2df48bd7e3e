# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Names of goal fields for error messages, and properties of goals and segment types."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence

import numpy as np

from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import SegmentType
from ur_cartesian_driver.motion.goal.goal_columns import GoalTable


def type_table(types: Collection[SegmentType]) -> Flags:
    """
    Return an array to be indexed with segment types: True for ``types``.

    This is faster than np.isin, and faster than comparing an array with an enumeration member.
    """
    return np.array([kind in types for kind in SegmentType])


IS_LINEAR, IS_JOINT = type_table((SegmentType.LINEAR,)), type_table((SegmentType.JOINT,))
IS_ARC, IS_PROCESS = type_table((SegmentType.CIRCULAR,)), type_table((SegmentType.PROCESS,))
IS_ARC_OR_PROCESS = IS_ARC | IS_PROCESS
_OPTIMIZED = (SegmentType.OPTIMIZED_LINEAR, SegmentType.OPTIMIZED_JOINT)
#: Segment types that are straight lines in joint space.
IS_JOINT_MOVE = type_table((SegmentType.JOINT, SegmentType.OPTIMIZED_JOINT))
#: Segment types that move the tool on a straight line.
IS_STRAIGHT = ~(IS_JOINT_MOVE | IS_ARC)
#: Segment types whose speeds are fractions of the robot's limits.
IS_OPTIMIZED = type_table(_OPTIMIZED)
#: Segment types whose velocity is the speed of the tool.
TAKES_TOOL_SPEED = ~type_table((SegmentType.JOINT, *_OPTIMIZED))
#: Segment types whose blends ``MotionLaws`` describes. The manual describes the blends of PROCESS,
#: and the blends of OPTIMIZED types have not been measured.
FOLLOWS_BLEND_LAWS = type_table((SegmentType.LINEAR, SegmentType.JOINT, SegmentType.CIRCULAR))


def point_field(index: int, field: str = '') -> str:
    """Return the name of a point's field as in the message."""
    return f'trajectory.points[{index}]' + (f'.{field}' if field else '')


def segment_field(index: int, field: str = '') -> str:
    """Return the name of a segment's field as in the message."""
    return f'segments[{index}]' + (f'.{field}' if field else '')


def late_point_error(
    index: int, times: Floats | Sequence[float], remedy: str = 'increase it'
) -> InvalidGoal:
    """Return the error for a point whose time is negative or not after the point before."""
    than = 'less than the 0 s'
    if index > 0:
        than = f'not later than the {times[index - 1]:g} s of points[{index - 1}]'
    return InvalidGoal(
        point_field(index, 'time_from_start'), f'is {times[index]:g} s, {than}', remedy
    )


def short_segment_error(index: int, duration: float, least: float) -> InvalidGoal:
    """Return the error for a time that is too short for a piece of a spline."""
    return InvalidGoal(
        point_field(index, 'time_from_start'),
        f'gives the segment {duration:g} s, less than the {least:g} s that a piece of a spline '
        'needs',
        'leave points out',
    )


def long_segment_error(index: int, duration: float, most: float) -> InvalidGoal:
    """Return the error for a time that is longer than max_segment_time."""
    return InvalidGoal(
        point_field(index, 'time_from_start'),
        f'gives the segment {duration:g} s, more than max_segment_time = {most:.0f} s',
        'add points in between',
    )


def check_plausible(field: str, values: Iterable[float], bound: float, units: str) -> None:
    """Refuse numbers beyond ``bound``, which no robot reaches; their units must be wrong."""
    if any(abs(value) > bound for value in values):
        raise InvalidGoal(
            field,
            f'contains a number beyond {bound:g}, more than any of these robots can do',
            f'check the units ({units})',
        )


def resolve_execution_mode(goal: GoalTable) -> ExecutionMode:
    """
    Return the execution mode of a goal.

    AUTO becomes SPLINE for a goal with rounded corners, and for a goal with times that has a twist
    or an acceleration at any point but its end; otherwise PRIMITIVES. The last point of a goal
    with keep_open is not its end.
    """
    if goal.execution != ExecutionMode.AUTO:
        return ExecutionMode(goal.execution)
    if is_rounded(goal):
        return ExecutionMode.SPLINE
    points, inner = goal.waypoints, slice(len(goal.waypoints) - (not goal.keep_open))
    if is_timed(goal) and (points.twists[inner].any() or points.accelerations[inner].any()):
        return ExecutionMode.SPLINE
    return ExecutionMode.PRIMITIVES


def is_spline(goal: GoalTable) -> bool:
    """Return whether a timed spline connects the points of a goal."""
    return resolve_execution_mode(goal).traits.is_spline and not is_rounded(goal)


def is_rounded(goal: GoalTable) -> bool:
    """Return whether lines and arcs with rounded corners connect the points of a goal."""
    return bool(goal.corner_deviation or goal.segments.corner_deviations.any())


def is_timed(goal: GoalTable) -> bool:
    """Return whether the goal has times; if not, its speeds apply."""
    return bool(goal.waypoints.times.any())


def gives_joints(goal: GoalTable) -> Flags:
    """Return whether each point (n,) gives joint positions in place of a pose."""
    return np.asarray(np.isnan(goal.waypoints.poses).all(axis=1))
