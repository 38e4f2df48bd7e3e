# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Goals with rounded corners: what is planned, what is said of it, and what is refused."""

from collections import Counter
from dataclasses import replace
import gc
from math import sqrt
import tracemalloc

from curve_distance import distances
from forward_model import dh_forward, pose_matrix
import numpy as np
import pytest
from random_cases import cases, random_of
from rounded_goals import measure, OPTIONS, random_case

from ur_cartesian_driver.motion.errors import (
    GoalRefused,
    InvalidGoal,
    JointLimitExceeded,
    NearSingularity,
    Unreachable,
)
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import (
    ArcMode,
    Goal,
    IOCommand,
    OutputKind,
    Segment,
    SegmentType,
)
from ur_cartesian_driver.motion.plan.primitive import Wait
from ur_cartesian_driver.motion.plan.slow_stretch import SlowCause
from ur_cartesian_driver.planning import plan

PARTS = 10
#: What refuses a random goal rightly: the arm cannot be there.
EXPLAINED = (Unreachable, NearSingularity, JointLimitExceeded)


@pytest.mark.random
@pytest.mark.parametrize('part', range(PARTS))
def test_random_goals_keep_every_limit(part):
    random = random_of('rounded goals', part)
    refused = Counter()
    count = cases(1000 // PARTS)
    for _ in range(count):
        case = random_case(random)
        try:
            found = plan(case.goal, case.state, case.arm, OPTIONS)
        except EXPLAINED as error:
            refused[type(error)] += 1
            continue
        seen = measure(case, found)
        assert seen.deviation <= 1.0, case
        assert seen.speed <= 1.02, case
        assert seen.acceleration <= 1.02, case
        assert seen.jerk <= 1.02, case
        assert seen.joint_speed <= 1.02, case
        assert seen.joint_acceleration <= 1.02, case
        assert seen.shortest_piece >= 0.02 - 1e-6, case
        assert seen.pieces_per_second <= 50.0, case
    # About a fifth is out of reach, more by chance if few are drawn; 30 of a hundred at most.
    assert refused.total() <= 0.2 * count + sqrt(count)


def square(cell, side=0.06, **fields):
    points = [(side, 0, 0), (side, side, 0), (0, side, 0), (0, 0.02, 0)]
    return Goal(waypoints=tuple(cell.point(*each) for each in points), **fields)


def tool_rows(cell, found, step=0.002):
    t = np.arange(0.0, found.duration, step)
    q, _, _ = found.joint_spline.rows(t)
    tool = pose_matrix(cell.T_flange_tcp)
    rows = [(dh_forward(cell.arm.model.geometry, each) @ tool)[:3, 3] for each in q]
    return t, np.array(rows)


@pytest.mark.parametrize('deviation', [5e-5, 5e-4, 5e-3])
def test_a_square_is_passed_beside_its_corners(cell, deviation):
    goal = square(cell, corner_deviation=deviation)
    found = plan(goal, cell.state, cell.arm, OPTIONS)
    assert found.execution is ExecutionMode.SPLINE
    t, rows = tool_rows(cell, found, 0.004)
    corners = np.array([cell.home.position, *(point.pose.position for point in goal.waypoints)])
    off = distances(rows, [corners])
    # A corner of 90 degrees is passed at 0.7 times the distance from it beside its lines.
    assert 0.5 * deviation < off.max() <= 0.72 * deviation
    apart = np.linalg.norm(rows[:, None] - corners[1:-1], axis=2)
    assert 0.75 * deviation < apart.min(axis=0).min() <= apart.min(axis=0).max() < 1.1 * deviation
    # Away from the corners, the lines are followed.
    outside = apart.min(axis=1) > min(12.0 * deviation, 0.025)
    assert outside.any()
    assert off[outside].max() < 2e-5
    speed = np.linalg.norm(np.gradient(rows, t, axis=0), axis=1)
    slow = (speed < 0.09)[(t > 0.3) & (t < t[-1] - 0.3)]
    assert slow.any()
    assert speed[(t > 0.3) & (t < t[-1] - 0.3)].min() > 0.003  # it stops nowhere between
    assert np.linalg.norm(rows[-1] - corners[-1]) < 1e-6


def test_the_larger_the_deviation_the_shorter_the_time(cell):
    times = [
        plan(square(cell, corner_deviation=deviation), cell.state, cell.arm, OPTIONS).duration
        for deviation in (2e-5, 2e-4, 2e-3, 2e-2)
    ]
    assert times == sorted(times, reverse=True)
    assert times[0] > 1.2 * times[-1]


def test_the_report_separates_corners_and_speed(cell):
    goal = square(cell, corner_deviation=5e-4)
    report = '\n'.join(plan(goal, cell.state, cell.arm, OPTIONS).report)
    assert 'point 0: rounded, in ' in report
    assert 'passes 0.4' in report
    assert 'point 3: rounded, in ' in report
    assert 'stops there' in report
    assert '% of the length at the speed that was asked, within 1 %' in report
    assert 'because of the acceleration across the path at the corner near point 1' in report
    assert 'because the arm starts from rest' in report


def test_points_without_a_deviation_are_stops(cell):
    segments = (
        Segment(corner_deviation=1e-3),
        Segment(),
        Segment(corner_deviation=1e-3),
        Segment(),
    )
    found = plan(square(cell, segments=segments), cell.state, cell.arm, OPTIONS)
    t, rows = tool_rows(cell, found)
    speed = np.linalg.norm(np.gradient(rows, t, axis=0), axis=1)
    corners = np.array([point.pose.position for point in found.goal.waypoints])
    nearest = [int(np.argmin(np.linalg.norm(rows - corner, axis=1))) for corner in corners]
    assert speed[nearest[1]] < 0.005
    assert np.linalg.norm(rows[nearest[1]] - corners[1]) < 1e-4
    assert min(speed[nearest[0]], speed[nearest[2]]) > 0.01


def test_a_stop_is_a_slow_stretch_down_to_rest(cell):
    segments = (Segment(corner_deviation=1e-3), Segment(), Segment(corner_deviation=1e-3))
    found = plan(square(cell, segments=(*segments, Segment())), cell.state, cell.arm, OPTIONS)
    stretches = found.find_slow_stretches()
    stops = [each for each in stretches if each.cause is SlowCause.STOP]
    assert [(each.point, each.lowest) for each in stops] == [(1, 0.0)] * 2
    assert stops[0].last == 1
    assert stops[1].first == 2
    corners = [each for each in stretches if each.cause is SlowCause.CORNER]
    assert {each.point for each in corners} == {0, 2}
    assert all(0.0 < each.lowest < each.asked for each in corners)


def test_a_dwell_is_a_stop_with_a_rest(cell):
    segments = (Segment(), Segment(dwell=0.5), Segment(), Segment())
    goal = square(cell, segments=segments, corner_deviation=1e-3)
    found = plan(goal, cell.state, cell.arm, OPTIONS)
    (rest,) = [row for row in found.segments if isinstance(row.primitive, Wait)]
    assert (rest.waypoint, rest.duration) == (1, 0.5)
    at_rest = np.array(cell.arm.forward(rest.joints).position)
    assert np.linalg.norm(at_rest - cell.arm.forward(rest.joints).position) < 1e-6


def test_outputs_are_placed_at_the_time_of_their_point(cell):
    commands = tuple(
        IOCommand(waypoint=k, offset=0.0, output=OutputKind.STANDARD_DIGITAL, pin=k, value=1.0)
        for k in range(4)
    )
    goal = square(cell, side=0.03, io_commands=commands, corner_deviation=1e-3)
    found = plan(goal, cell.state, cell.arm, OPTIONS)
    records = [record for row in found.segments for record in row.outputs]
    assert [record.pin for record in records] == [0, 1, 2, 3]
    for record, point in zip(records[:3], goal.waypoints[:3], strict=True):
        off = record.trigger_pose.distance_to(point.pose)
        assert 0.5e-3 < off <= 1e-3  # where the tool passes beside the point
    assert records[3].trigger_pose is None


def test_points_within_a_piece_have_a_line_and_a_kind_each(cell):
    goal = Goal(
        waypoints=tuple(cell.point(1e-4 * k, 2e-5 * (k % 3)) for k in range(1, 200)),
        corner_deviation=5e-5,
        io_commands=(
            IOCommand(
                waypoint=77, offset=0.0, output=OutputKind.STANDARD_DIGITAL, pin=1, value=1.0
            ),
        ),
    )
    found = plan(goal, cell.state, cell.arm, OPTIONS)
    assert len(found.segments) < 100
    assert found.rows.kinds == dict.fromkeys(range(199), 'Spline')
    lines = [line for line in found.report if line.startswith('point ')]
    assert all(any(f'point {k}: rounded' in line for line in lines) for k in range(199))
    assert not any('\n' in line for line in found.report)
    assert any('digital output 1 on while passing point 77' in line for line in found.report)
    (record,) = [record for row in found.segments for record in row.outputs]
    assert record.trigger_pose.distance_to(goal.waypoints[77].pose) < 5e-5


def test_points_that_repeat_are_passed_once(cell):
    goal = square(cell, corner_deviation=1e-3)
    twice = tuple(point for point in goal.waypoints for _ in range(2))
    once, again = (
        plan(each, cell.state, cell.arm, OPTIONS)
        for each in (goal, replace(goal, waypoints=twice))
    )
    assert again.duration == pytest.approx(once.duration, abs=1e-6)


@pytest.mark.parametrize('bounds', [(5e-3, 1e-3), (1e-3, 5e-3)])
def test_a_corner_that_is_given_twice_keeps_the_tighter_bound(cell, bounds):
    places = [(0.06, 0, 0), (0.06, 0, 0), (0.06, 0.06, 0)]
    goal = Goal(
        waypoints=tuple(cell.point(*each) for each in places),
        segments=tuple(Segment(corner_deviation=bound) for bound in (*bounds, 0.0)),
    )
    _, rows = tool_rows(cell, plan(goal, cell.state, cell.arm, OPTIONS), 0.004)
    corner = np.array(goal.waypoints[0].pose.position)
    assert 0.75e-3 < np.linalg.norm(rows - corner, axis=1).min() < 1.1e-3


def test_arcs_that_turn_with_their_tangent_and_turns_on_the_spot_are_led_through(cell):
    goal = Goal(
        waypoints=(
            cell.point(0.05),
            cell.point(0.1, 0.05),
            cell.point(0.1, 0.05, turn=(0.0, 0.0, 0.4)),
            cell.point(0.1, 0.09, turn=(0.0, 0.0, 0.4)),
        ),
        segments=(
            Segment(),
            Segment(
                type=SegmentType.CIRCULAR, via=cell.pose(0.085, 0.015), arc_mode=ArcMode.FIXED
            ),
            Segment(velocity=0.3),
            Segment(),
        ),
        corner_deviation=5e-4,
        corner_angle=0.01,
    )
    found = plan(goal, cell.state, cell.arm, OPTIONS)
    end = cell.arm.forward(found.rows.joints[-1].tolist()) @ cell.T_flange_tcp
    assert end.distance_to(goal.waypoints[-1].pose) < 1e-6
    assert end.angle_to(goal.waypoints[-1].pose) < 1e-5


def test_an_acceleration_at_a_point_is_told_to_be_ignored_with_the_reason(cell):
    goal = square(cell, corner_deviation=1e-3)
    first = replace(goal.waypoints[0], acceleration=(0.1, 0, 0, 0, 0, 0))
    found = plan(
        replace(goal, waypoints=(first, *goal.waypoints[1:])), cell.state, cell.arm, OPTIONS
    )
    text = 'point 0: acceleration is ignored: corners are rounded with those of the segments'
    assert text in found.report


def test_the_slowest_limit_is_demanded_away(cell):
    goal = square(cell, corner_deviation=5e-5, min_speed_fraction=0.9)
    with pytest.raises(InvalidGoal, match=r'min_speed_fraction is 0\.9, but at .*corner near'):
        plan(goal, cell.state, cell.arm, OPTIONS)
    plan(
        replace(goal, corner_deviation=1e-2, segments=(Segment(velocity=0.02),) * 4),
        cell.state,
        cell.arm,
        OPTIONS,
    )


@pytest.mark.parametrize(
    ('fields', 'text'),
    [
        (
            {'execution': ExecutionMode.PRIMITIVES},
            'corner_deviation is set, but with execution PRIM',
        ),
        ({'keep_open': True}, 'corner_deviation is set, but the points of a goal with keep_open'),
        ({'corner_deviation': 1e-6}, 'corner_deviation is 1e-06 m, but must be 0'),
        ({'corner_deviation': 0.2}, 'corner_deviation is 0.2 m, but must be 0'),
        ({'corner_angle': 0.6}, 'corner_angle is 0.6 rad, but must be 0'),
        (
            {'segments': (Segment(blend_radius=0.01),) * 4},
            r'segments\[0\]\.blend_radius is 0\.01 m, but corner_deviation rounds',
        ),
        (
            {'segments': (Segment(type=SegmentType.JOINT),) * 4},
            r'segments\[0\]\.type is JOINT, but only lines and arcs',
        ),
    ],
)
def test_what_excludes_rounded_corners_is_refused(cell, fields, text):
    with pytest.raises(GoalRefused, match=text):
        plan(square(cell, **{'corner_deviation': 1e-3} | fields), cell.state, cell.arm, OPTIONS)


@pytest.mark.parametrize('count', [1, 3])
def test_a_path_that_leads_nowhere_is_refused(cell, count):
    goal = Goal(waypoints=(cell.point(),) * count, corner_deviation=1e-3)
    with pytest.raises(InvalidGoal, match='are all where the arm is'):
        plan(goal, cell.state, cell.arm, OPTIONS)


def test_a_path_that_needs_too_many_samples_is_refused(cell):
    back, forth = cell.point(), cell.point(0.2)  # a hundred steps of 2 mm apart
    goal = Goal(waypoints=(forth, back) * 10_100, corner_deviation=1e-3)
    with pytest.raises(InvalidGoal, match=r'needs 2\.02e\+06 samples, more than 2,000,000'):
        plan(goal, cell.state, cell.arm, OPTIONS)


@pytest.mark.parametrize('deviation', [2e-5, 1e-3, 0.1])
@pytest.mark.parametrize(
    'places',
    [
        [1e-7],
        [1e-6, 2e-6],
        [1e-5 * k for k in range(1, 50)],
        [0.05, 0.0],
        [0.05, 0.0, 0.05, 0.0],
        [0.1, 0.1 + 1e-9, 0.0],
    ],
)
def test_paths_of_any_size_and_reversals_are_planned(cell, places, deviation):
    goal = Goal(waypoints=tuple(cell.point(x) for x in places), corner_deviation=deviation)
    found = plan(goal, cell.state, cell.arm, OPTIONS)
    end = cell.arm.forward(found.rows.joints[-1].tolist()) @ cell.T_flange_tcp
    assert end.distance_to(goal.waypoints[-1].pose) < 1e-6


def test_a_plan_keeps_no_more_memory_than_a_spline_through_the_same_points(cell):
    # Zigzag: a corner at every point, and a fifth of a second from one to the next.
    points = [cell.point(5e-4 * k, 0.01 * (k % 2)) for k in range(1, 200)]
    rounded = Goal(waypoints=tuple(points), corner_deviation=1e-4)
    spline = Goal(
        waypoints=tuple(replace(point, time=5.0 + 0.2 * k) for k, point in enumerate(points)),
        execution=ExecutionMode.SPLINE,
    )

    def kept(goal):
        plan(goal, cell.state, cell.arm, OPTIONS)  # what is made only once does not count
        gc.collect()
        tracemalloc.start()
        found = plan(goal, cell.state, cell.arm, OPTIONS)
        gc.collect()
        size, _ = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        assert len(found.segments) > 100
        return size

    assert kept(rounded) <= kept(spline)


def test_times_are_refused(cell):
    goal = square(cell, corner_deviation=1e-3)
    points = tuple(replace(point, time=1.0 + k) for k, point in enumerate(goal.waypoints))
    with pytest.raises(InvalidGoal, match='corner_deviation is set, but the goal has times'):
        plan(replace(goal, waypoints=points), cell.state, cell.arm, OPTIONS)


def test_an_unknown_calibration_is_refused(cell):
    options = replace(OPTIONS, calibration_known=False)
    with pytest.raises(GoalRefused, match='calibration of this robot is unknown'):
        plan(square(cell, corner_deviation=1e-3), cell.state, cell.arm, options)
