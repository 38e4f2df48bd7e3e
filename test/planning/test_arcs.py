# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The arcs of goals in columns, judged by circles through three points."""

from math import pi

from forward_model import pose_matrix
from goal_geometry import Arc, poses_apart
import numpy as np
import pytest
from random_cases import cases, random_of

from ur_cartesian_driver.motion.geometry.pose import (
    IDENTITY,
    multiply,
    Pose,
    pose_from_row,
    quaternion_from_rotation_vector,
)
from ur_cartesian_driver.motion.goal.goal import ArcMode, Goal, Segment, SegmentType, Waypoint
from ur_cartesian_driver.motion.goal.goal_columns import goal_table
from ur_cartesian_driver.planning.geometry.blended_path import curves_of
from ur_cartesian_driver.planning.geometry.curves import arc_faults, goal_arcs

AT = np.linspace(0.0, 1.0, 9)


def random_pose(rng, size):
    turn = quaternion_from_rotation_vector(tuple(rng.normal(0.0, 0.5, 3)))
    return Pose(tuple(rng.uniform(-size, size, 3).tolist()), turn)


def arcs_of(rng, modes):
    """Return poses, vias and the table of a goal of arcs, all in the frame of the goal."""
    size = 10.0 ** rng.uniform(-2.0, 0.0)
    poses = [random_pose(rng, size) for _ in range(len(modes) + 1)]
    vias = [random_pose(rng, size) for _ in modes]
    goal = Goal(
        waypoints=tuple(Waypoint(pose=pose) for pose in poses[1:]),
        segments=tuple(
            Segment(type=SegmentType.CIRCULAR, via=via, arc_mode=mode)
            for via, mode in zip(vias, modes, strict=True)
        ),
        T_base_frame=random_pose(rng, 1.0),
    )
    return poses, vias, goal_table(goal)


def in_base(table, pose):
    return pose_matrix(table.T_base_frame) @ pose_matrix(pose)


@pytest.mark.random
def test_arcs_follow_the_circles_through_three_points():
    rng = np.random.default_rng(random_of('arcs in columns').randrange(2**32))
    count, compared = cases(100), 0
    for _ in range(count):
        modes = [ArcMode(int(number)) for number in rng.integers(0, 2, 4)]
        poses, vias, table = arcs_of(rng, modes)
        rows = np.array([(table.T_base_frame @ pose).row() for pose in poses])
        curves, faults = curves_of(
            table.motions, table.T_base_frame, rows[:-1].copy(), rows[1:].copy()
        )
        if faults:
            continue
        compared += 1
        start = in_base(table, poses[0])
        for k, (via, end, mode) in enumerate(zip(vias, poses[1:], modes, strict=True)):
            fixed = mode is ArcMode.FIXED
            arc = Arc(start, in_base(table, via), in_base(table, end), fixed)
            found = curves.rows(np.full(len(AT), k), AT)
            made = np.array([pose_matrix(pose_from_row(row)) for row in found])
            off, turned = poses_apart(made, arc.at(AT))
            assert off.max() < 1e-9 * max(1.0, arc.radius**2)
            assert turned.max() < 1e-6
            assert curves.arcs.radius[k] == pytest.approx(arc.radius, rel=1e-6)
            assert curves.length[k] == pytest.approx(arc.length, rel=1e-6)
            assert curves.angle[k] == pytest.approx(arc.angle, abs=1e-6)
            # The via is passed at its fraction of the arc.
            passed = curves.rows(np.array([k]), curves.arcs.u_via[k : k + 1])[0]
            assert np.linalg.norm(passed[:3] - in_base(table, via)[:3, 3]) < 1e-8 * (
                1.0 + arc.radius**2
            )
            # The next segment begins as this one ends.
            start = arc.end
    assert compared > 0.5 * count


@pytest.mark.parametrize('sweep', [0.06, 1.0, pi, 3.5, 6.0])
def test_a_place_at_a_distance_from_the_start_is_on_the_arc(sweep):
    radius = 0.1
    a, via, b = (
        np.array([[radius * np.cos(t), radius * np.sin(t), 0.0, 0.0, 0.0, 0.0, 1.0]])
        for t in (0.0, 0.4 * sweep, sweep)
    )
    table = goal_table(
        Goal(
            waypoints=(Waypoint(pose=pose_from_row(b[0])),),
            segments=(Segment(type=SegmentType.CIRCULAR, via=pose_from_row(via[0])),),
        )
    )
    rows, arcs, faults = goal_arcs(table.segments, IDENTITY, a, b)
    assert (rows.tolist(), faults) == ([0], {})
    distance = np.array([0.001])
    t = arcs.trim(distance) * sweep
    assert 2.0 * radius * np.sin(0.5 * t) == pytest.approx(distance, rel=1e-9)
    assert arcs.u_via == pytest.approx([0.4], abs=1e-9)


HERE, THERE = (0.0, 0.0, 0.0), (0.1, 0.0, 0.0)


@pytest.mark.parametrize(
    ('via', 'end', 'fixed', 'text'),
    [
        ((0.05, 0.02, 0.0), THERE, False, ''),
        ((0.05, 0.02, 0.0), THERE, True, ''),
        ((0.05, 1.1e-5, 0.0), THERE, False, ''),
        ((0.05, 0.9e-5, 0.0), THERE, False, 'on one straight line'),
        ((0.2, 0.0, 0.0), THERE, False, 'on one straight line'),
        (HERE, THERE, False, 'the start and the via of the arc coincide'),
        (THERE, THERE, False, 'the via and the end of the arc coincide'),
        ((0.05, 0.02, 0.0), HERE, False, 'the start and the end of the arc coincide'),
        ((500.0, 500.0, 0.0), (1100.0, 0.0, 0.0), False, 'more than 1000 m apart'),
        # The tool may turn by 2 x 1.5 um x 0.1 m / (0.5 mm x 0.1 m) = 6 mrad, more than 5.
        ((0.0, 0.0005, 0.0), THERE, True, 'may turn the tool by 0.3 degrees'),
        ((0.0, 0.0005, 0.0), THERE, False, ''),
    ],
)
def test_points_that_make_no_arc_are_told_by_their_fault(via, end, fixed, text):
    start, middle, last = (np.array([each]) for each in (HERE, via, end))
    faults = arc_faults(start, middle, last, np.array([fixed]))
    assert list(faults) == [0] * bool(text)
    assert text in faults.get(0, '')


def test_only_arcs_without_a_fault_have_a_row():
    turned = multiply((0.0, 0.0, 0.0, 1.0), quaternion_from_rotation_vector((0.0, 0.0, 0.3)))
    ends = [Pose((0.1 * k, 0.0, 0.0), turned) for k in range(1, 5)]
    kinds = ('arc', 'line', 'flat', 'arc')
    vias = {'arc': 0.03, 'flat': 0.0}
    goal = Goal(
        waypoints=tuple(Waypoint(pose=pose) for pose in ends),
        segments=tuple(
            Segment()
            if kind == 'line'
            else Segment(
                type=SegmentType.CIRCULAR, via=Pose((0.1 * k + 0.05, vias[kind], 0.0), turned)
            )
            for k, kind in enumerate(kinds)
        ),
    )
    start, end = (
        np.array([pose.row() for pose in each])
        for each in ([Pose((0.0, 0.0, 0.0), turned), *ends[:-1]], ends)
    )
    rows, arcs, faults = goal_arcs(goal_table(goal).segments, IDENTITY, start, end)
    assert rows.tolist() == [0, 3]
    assert list(faults) == [2]
    # Half a chord of 50 mm and a height of 30 mm: the radius is (50^2 + 30^2) / 60 mm.
    assert arcs.radius == pytest.approx([0.0034 / 0.06] * 2)
