# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A plan sampled without a robot."""

from __future__ import annotations

from math import pi
import re

import numpy as np
import pytest

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.goal import Goal, Posture, Segment, SegmentType, Waypoint
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.preview import postures, sample, table

ARM = Arm(robot_model('ur5e'))
TOOL = Pose((0.0, 0.0, 0.1))
Q = (0.0, -pi / 2, pi / 2, -pi / 2, -pi / 2, 0.0)
HOME = ARM.forward(Q) @ TOOL
STATE = RobotState(timestamp=0.0, actual_q=Q, actual_tcp_pose=HOME, T_flange_tcp=TOOL)


def moved(x, y, z):
    a, b, c = HOME.position
    return Pose((a + x, b + y, c + z), HOME.quaternion)


def made(*segments):
    flipped = Posture(names=('elbow_joint',), values=(-1.5,))
    points = (
        Waypoint(pose=moved(0.1, 0.0, 0.0)),
        Waypoint(pose=moved(0.1, 0.2, 0.0)),
        Waypoint(pose=moved(0.0, 0.2, 0.05), posture=flipped),
    )
    return plan(Goal(waypoints=points, segments=segments), STATE, ARM, PlanningOptions())


PLAN = made(Segment(), Segment(blend_radius=0.02), Segment(type=SegmentType.JOINT))


def test_samples_run_from_the_start_to_the_end_at_the_period():
    preview = sample(PLAN, ARM, TOOL, 0.05)
    assert np.allclose(np.diff(preview.time)[:-1], 0.05)
    assert preview.time[-1] == pytest.approx(PLAN.duration)
    assert np.allclose(preview.poses[0], HOME.row())
    assert np.allclose(preview.poses[-1][:3], moved(0.0, 0.2, 0.05).position, atol=1e-6)
    assert preview.poses.shape == (len(preview.time), 7)


def test_joints_lead_to_the_poses_without_jumps_also_through_an_elbow_flip():
    preview = sample(PLAN, ARM, TOOL, 0.01)
    assert preview.joints.shape == (len(preview.time), 6)
    for q, pose in zip(preview.joints, preview.poses, strict=True):
        assert np.allclose((ARM.forward(q) @ TOOL).position, pose[:3], atol=1e-7)
    assert np.allclose(preview.joints[0], Q)
    assert np.allclose(preview.joints[-1], PLAN.segments[-1].joints, atol=1e-4)
    assert preview.joints[-1][2] < 0.0
    assert np.abs(np.diff(preview.joints, axis=0)).max() < 0.2


def test_a_period_that_is_not_positive_is_refused():
    with pytest.raises(ValueError, match='period'):
        sample(PLAN, ARM, TOOL, 0.0)


def test_the_table_has_a_line_for_each_segment_and_the_sum():
    lines = table(PLAN).splitlines()
    assert lines[1].split()[:2] == ['0', 'MoveL']
    assert '20 mm' in lines[2]
    assert lines[3].split()[:2] == ['2', 'MoveJ']
    assert lines[4].split()[0] == 'sum'
    assert f'{PLAN.duration:.3f} s' in lines[4]


def test_the_columns_of_the_table_are_as_wide_as_their_widest_cell():
    """A rounded path has more pieces to a point than the column was wide."""
    points = tuple(Waypoint(pose=moved(0.1 * k, 0.0, 0.01 * (k % 2))) for k in (1, 2, 3))
    goal = Goal(waypoints=points, segments=(Segment(velocity=0.02),) * 3, corner_deviation=2e-4)
    head, *rows, total = table(plan(goal, STATE, ARM, PlanningOptions())).splitlines()
    assert any(re.search(r'Spline x \d\d', row) for row in rows)
    for column in ('length', 'turn', 'time', 'blend'):
        end = head.index(column) + len(column)
        for row in rows:
            assert row[end - 1] != ' '
            assert row[end : end + 1] in ('', ' ')
    for unit in (' m ', ' s'):
        assert {row.rindex(unit) for row in (*rows, total)} == {rows[0].rindex(unit)}


def test_postures_are_those_of_the_start_and_of_each_segment():
    _, *lines = (line.split() for line in postures(PLAN).splitlines())
    assert [line[0] for line in lines] == ['start', *(str(s.waypoint) for s in PLAN.segments)]
    assert [[float(q) for q in line[1:]] for line in lines] == [
        pytest.approx(q, abs=5e-5) for q in (PLAN.start, *(s.joints for s in PLAN.segments))
    ]


def test_the_joints_of_a_spline_are_those_of_its_pieces_and_lead_to_the_poses():
    through = Waypoint(pose=moved(0.0, 0.1, 0.0), time=1.5, twist=(0.0, 0.1, 0.05, 0.0, 0.0, 0.1))
    spline = plan(
        Goal(waypoints=(through, Waypoint(pose=moved(0.1, 0.2, 0.0), time=3.0))),
        STATE,
        ARM,
        PlanningOptions(),
    )
    preview = sample(spline, ARM, TOOL, 0.01)
    for q, pose in zip(preview.joints, preview.poses, strict=True):
        assert np.allclose((ARM.forward(q) @ TOOL).position, pose[:3], atol=6e-5)
    for segment in spline.segments:
        ends = sum(s.duration for s in spline.segments[: spline.segments.index(segment) + 1])
        row = round(ends / 0.01)
        if abs(0.01 * row - ends) < 1e-9:
            assert np.allclose(preview.joints[row], segment.joints, atol=1e-9)
    lines = table(spline).splitlines()
    assert [line.split()[0] for line in lines] == ['point', '0', '1', 'sum']
    assert len(postures(spline).splitlines()) == 4
