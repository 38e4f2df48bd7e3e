# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A goal in columns is the same goal."""

from dataclasses import replace
from math import nan
from typing import Any

import pytest
from random_goals import random_case

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.goal import Goal, Posture, Segment, SegmentType, Waypoint
from ur_cartesian_driver.motion.goal.goal_columns import goal_table, SegmentRows, WaypointRows

ARM = Arm(robot_model('ur5e'))
ELBOW = Posture(names=('elbow_joint',), values=(1.5,))
POINTS = (
    Waypoint(pose=Pose((0.1, 0.2, 0.3))),
    Waypoint(pose=Pose((0.2, 0.2, 0.3)), time=1.5, twist=(0.1, nan, 0.0, 0.0, 0.0, 0.0)),
    Waypoint(pose=Pose((0.3, 0.2, 0.3), (0.0, 0.0, 1.0, 0.0)), time=2.0, posture=ELBOW),
)
SEGMENTS = (
    Segment(blend_radius=0.01, velocity=0.25),
    Segment(type=SegmentType.CIRCULAR, via=Pose((0.15, 0.25, 0.3)), via_posture=ELBOW),
    Segment(type=SegmentType.JOINT, acceleration=2.0),
)


def test_rows_are_the_sequence_that_they_were_made_of():
    points, segments = WaypointRows.of(POINTS), SegmentRows.of(SEGMENTS)
    assert (len(points), len(segments)) == (3, 3)
    assert tuple(segments) == SEGMENTS
    assert points[2] == POINTS[2] == points[-1]
    assert points[0] == POINTS[0]
    # NaN differs from itself, except for the very same object in a tuple.
    assert str(tuple(points)) == str(POINTS)
    assert points == WaypointRows.of(list(POINTS))
    assert points != WaypointRows.of((*POINTS[:2], replace(POINTS[2], time=3.0)))
    with pytest.raises(IndexError):
        points[3]


def test_a_slice_keeps_the_postures_of_its_rows():
    points, segments = WaypointRows.of(POINTS), SegmentRows.of(SEGMENTS)
    assert points[1:].postures == {1: ELBOW}
    assert not points[:2].postures
    assert tuple(segments[1:2]) == SEGMENTS[1:2]
    assert len(points[3:]) == 0
    with pytest.raises(ValueError, match='step'):
        points[::2]


def test_columns_have_the_units_of_the_fields_and_nobody_changes_them():
    points = WaypointRows.of(POINTS)
    assert points.times.tolist() == [0.0, 1.5, 2.0]
    assert points.poses.shape == (3, 7)
    assert points.poses[2].tolist() == [0.3, 0.2, 0.3, 0.0, 0.0, 1.0, 0.0]
    assert points.twists.shape == points.jerks.shape == (3, 6)
    for column in (points.times, points.poses, points.twists, points.jerks):
        assert not column.flags.writeable


def test_a_table_stays_one_whatever_replaces_its_points():
    table = goal_table(Goal(waypoints=POINTS, segments=SEGMENTS))
    assert goal_table(table) is table
    objects: Any = {'waypoints': POINTS[:2], 'segments': ()}
    shorter = replace(table, **objects)
    assert isinstance(shorter.waypoints, WaypointRows)
    assert len(shorter.segments) == 0
    assert tuple(shorter.motions) == (Segment(), Segment())
    assert table.motions is table.segments


@pytest.mark.parametrize('seed', range(20))
def test_random_goals_become_tables_and_back(seed):
    goal = random_case(ARM, seed).goal
    table = goal_table(goal)
    assert tuple(table.segments) == tuple(goal.segments)
    assert tuple(table.waypoints) == tuple(goal.waypoints)
