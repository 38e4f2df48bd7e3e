# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Points and segments in flat arrays: conversion of rows and goals to ``PackedPoints``.

In the plain form, rclpy makes ten objects for each point, which takes some 0.1 ms. A flat array of
all points is a single object, copied in one piece.
"""

from __future__ import annotations

from ur_cartesian_driver.action import FollowCartesianTrajectory
from ur_cartesian_driver.goal_files.goal_packing import packed_fields
from ur_cartesian_driver.goal_files.goal_reading import is_packed, point_rows, segment_rows
from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.goal.goal_columns import SegmentRows, WaypointRows
from ur_cartesian_driver.msg import CartesianTrajectory, PackedPoints

#: Clients send goals with at least this many points in flat arrays.
MANY_POINTS = 200


def packed_points(points: WaypointRows, segments: SegmentRows) -> PackedPoints | None:
    """Return points and segments as a message; None if :func:`packed_fields` returns None."""
    fields = packed_fields(points, segments)
    return None if fields is None else PackedPoints(**fields)


def in_flat_arrays(goal: FollowCartesianTrajectory.Goal) -> FollowCartesianTrajectory.Goal:
    """
    Return a goal with its points and segments packed.

    The goal is returned unchanged if it is packed already, has a jerk (which no motion uses), or
    is malformed and so will be refused.
    """
    trajectory = goal.trajectory
    try:
        segments = segment_rows(goal.segments)
    except InvalidGoal:
        return goal
    if len(segments) not in (0, len(trajectory.points)) or is_packed(goal.packed):
        return goal
    packed = packed_points(point_rows(trajectory.points), segments)
    if packed is None:
        return goal
    fields = {name: getattr(goal, name) for name in goal.get_fields_and_field_types()}
    return FollowCartesianTrajectory.Goal(
        **fields
        | {
            'trajectory': CartesianTrajectory(
                header=trajectory.header, controlled_frame=trajectory.controlled_frame
            ),
            'segments': [],
            'packed': packed,
        }
    )


def packed_if_long(goal: FollowCartesianTrajectory.Goal) -> FollowCartesianTrajectory.Goal:
    """Return a goal of many points in flat arrays, and any other goal unchanged."""
    return in_flat_arrays(goal) if len(goal.trajectory.points) >= MANY_POINTS else goal
