# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The names of goal fields in refusals, and properties of goals and segment types."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Flags
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import SegmentType
from ur_cartesian_driver.motion.goal.goal_table import GoalTable

#: Types of segments that move the tool on a straight line.
STRAIGHT_TYPES = (
    SegmentType.AUTO,
    SegmentType.LINEAR,
    SegmentType.PROCESS,
    SegmentType.OPTIMIZED_LINEAR,
)
#: Types of segments whose speeds are fractions of the robot's limits.
OPTIMIZED_TYPES = (SegmentType.OPTIMIZED_LINEAR, SegmentType.OPTIMIZED_JOINT)


def type_table(types: Collection[SegmentType]) -> Flags:
    """Return an array by segment type, True for ``types``; indexing it is faster than np.isin."""
    return np.array([kind in types for kind in SegmentType])


#: By segment type: whether the blend behind it follows the measured laws of blends. Those of
#: PROCESS are documented, those of OPTIMIZED types are not measured.
FOLLOWS_BLEND_LAWS = type_table((SegmentType.LINEAR, SegmentType.JOINT, SegmentType.CIRCULAR))


def point_field(index: int, field: str = '') -> str:
    """Return the name of a point's field as in the message."""
    return f'trajectory.points[{index}]' + (f'.{field}' if field else '')


def segment_field(index: int, field: str = '') -> str:
    """Return the name of a segment's field as in the message."""
    return f'segments[{index}]' + (f'.{field}' if field else '')


def resolve_execution_mode(goal: GoalTable) -> ExecutionMode:
    """
    Return the execution mode of a goal.

    AUTO becomes SPLINE for a goal with rounded corners, or with times and with twists or
    accelerations at inner points; else PRIMITIVES.
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


def is_optimized(kind: SegmentType) -> bool:
    """Return whether the speeds of a segment type are fractions of the robot's limits."""
    return kind in OPTIMIZED_TYPES
