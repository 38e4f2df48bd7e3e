# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Joint goals: refusals and their reasons, the velocities that the driver chooses, and limits."""

from dataclasses import replace
import itertools
from math import inf, nan, pi
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from random_cases import cases, random_of

from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.motion.errors import (
    CollisionPredicted,
    InvalidGoal,
    InvalidJoints,
    JointLimitExceeded,
    NotAvailable,
    OldHeaderTimestamp,
    TooFast,
)
from ur_cartesian_driver.motion.goal.joint_goal import JointGoal, JointPoint, JointTolerance
from ur_cartesian_driver.motion.plan.joint_spline import JointSpline
from ur_cartesian_driver.motion.plan.primitive import BeginPress, EndPress, PressLaw, Spline
from ur_cartesian_driver.planning import plan_joint_goal, PlanningOptions
from ur_cartesian_driver.planning.geometry.curves import tcp_rows
from ur_cartesian_driver.protocol.program.wire_dialects import DIALECTS

OPTIONS = PlanningOptions(max_tool_speed=0.0, max_approach_distance=0.0, self_collision='off')
SIX = (0.1,) * 6
ZERO = (0.0,) * 6


def goal_through(cell, *rows, step=1.0, **fields):
    """Return a goal through offsets from home, a step of time apart."""
    points = tuple(
        JointPoint(time=(i + 1) * step, positions=np.add(cell.state.actual_q, row))
        for i, row in enumerate(rows)
    )
    return JointGoal(joint_names=JOINT_NAMES, points=points, **fields)


def planned(cell, goal, options=OPTIONS, **more):
    state = replace(cell.state, target_q=cell.state.actual_q)
    return plan_joint_goal(goal, state, cell.arm, replace(options, **more))


def spline_of(plan):
    return JointSpline.of(plan.start, plan.rows.primitives)


def point(**fields: Any) -> dict[str, Any]:
    given: dict[str, Any] = {'time': 1.0, 'positions': SIX} | fields
    return {'points': (JointPoint(**given),)}


@pytest.mark.parametrize(
    ('error', 'text', 'fields'),
    [
        (InvalidJoints, r'joint_names lacks wrist_3_joint', {'joint_names': JOINT_NAMES[:5]}),
        (
            InvalidJoints,
            r'joint_names\[6\] repeats',
            {'joint_names': (*JOINT_NAMES, 'elbow_joint')},
        ),
        (InvalidJoints, r"joint_names\[0\] is 'rail', not", {'joint_names': ('rail',)}),
        (InvalidGoal, r'trajectory\.points is empty', {'points': ()}),
        (InvalidGoal, r'points\[0\]\.positions are empty', point(positions=())),
        (InvalidGoal, r'points\[0\]\.positions has 5 values for 6', point(positions=SIX[:5])),
        (InvalidGoal, r'points\[0\]\.velocities has 1 values', point(velocities=(0.0,))),
        (InvalidGoal, r'positions contains nan', point(positions=(*SIX[:5], nan))),
        (InvalidGoal, r'positions contains a number beyond', point(positions=(*SIX[:5], 90.0))),
        (InvalidGoal, r'velocities are empty, but', point(accelerations=SIX)),
        (InvalidGoal, r'velocities are not zero, but the motion ends', point(velocities=SIX)),
        (InvalidGoal, r'effort is given', point(effort=SIX)),
        (InvalidGoal, r'time_from_start is -1 s, less than', point(time=-1.0)),
        (InvalidGoal, r'time_from_start is 0, so there is no time', point(time=0.0)),
        (InvalidGoal, r'gives the segment 0.0005 s, less', point(time=0.0005)),
        (InvalidGoal, r'more than max_segment_time', point(time=1e5)),
        (InvalidGoal, r'time_from_start contains inf', point(time=inf)),
        (OldHeaderTimestamp, r'header.stamp is 5.000 s old', {'age': 5.0}),
        (InvalidGoal, r'goal_time_tolerance contains nan', {'goal_time_tolerance': nan}),
        (
            InvalidJoints,
            r"path_tolerance\[0\].name is 'rail'",
            {'path_tolerance': (JointTolerance(name='rail'),)},
        ),
        (
            InvalidGoal,
            r'goal_tolerance\[0\].acceleration is 1, but robots do not report',
            {'goal_tolerance': (JointTolerance(name='elbow_joint', acceleration=1.0),)},
        ),
        (InvalidGoal, r'JointGoal\.age', {'age': 'now'}),
    ],
)
def test_what_is_wrong_for_every_robot_is_refused_by_name(cell, error, text, fields):
    goal = JointGoal(**{'joint_names': JOINT_NAMES, **point()} | fields)
    with pytest.raises(error, match=text):
        planned(cell, goal)


def test_the_order_of_times_and_the_first_point_count(cell):
    one, two = goal_through(cell, ZERO, SIX).points
    for points, text in (
        (
            (two, one),
            r'points\[1\]\.time_from_start is 1 s, not later than the 2 s of points\[0\]',
        ),
        (
            (replace(one, time=0.0, positions=np.add(one.positions, np.eye(6)[2] / 50)), two),
            r'time_from_start is 0, but elbow_joint is 0.0200 rad away',
        ),
        ((replace(one, time=0.0, velocities=SIX), two), r'the motion starts at rest there'),
    ):
        with pytest.raises(InvalidGoal, match=text):
            planned(cell, JointGoal(joint_names=JOINT_NAMES, points=points))
    made = planned(cell, JointGoal(joint_names=JOINT_NAMES, points=(replace(one, time=0.0), two)))
    assert made.rows.waypoints.tolist() == [1]
    assert 'point 0: the robot is there' in made.remarks[0]


def test_what_the_robot_cannot_do_is_refused_with_place_value_and_bound(cell):
    far = (2.0 * pi, 0.0, 0.0, 0.0, 0.0, 0.0)
    for error, text, row, more in (
        (JointLimitExceeded, r'shoulder_pan_joint turns to 6.\d+ rad, its range', far, {}),
        (TooFast, r'shoulder_lift_joint needs .* adapt velocities', (0, 2.5, 0, 0, 0, 0), {}),
        (TooFast, 'more than max_tool_speed = 0.100', SIX, {'max_tool_speed': 0.1}),
        (
            CollisionPredicted,
            'plane "floor"',
            (0, 0.8, 0, 0, 0, 0),
            {'workspace_planes': ('floor 0 0 0.1 0 0 1',)},
        ),
        (
            InvalidGoal,
            'max_approach_distance',
            (1.0, 0, 0, 0, 0, 0),
            {'max_approach_distance': 0.3},
        ),
        (NotAvailable, 'calibration of this robot is unknown', SIX, {'calibration_known': False}),
        (NotAvailable, 'milliseconds', SIX, {'dialect': DIALECTS['2.0']}),
    ):
        with pytest.raises(error, match=text):
            planned(cell, goal_through(cell, np.add(row, 0.1 if row is far else 0.0)), **more)


def test_a_trajectory_that_is_too_fast_is_slowed_as_a_whole(cell):
    goal = goal_through(cell, SIX, ZERO, np.negative(SIX), step=0.5)
    fast, slow = (
        planned(cell, goal, max_tool_speed=speed, on_too_fast='slow') for speed in (0.0, 0.2)
    )
    factor = slow.duration / fast.duration
    assert factor > 1.2
    assert f'stretched by {factor:.4g}' in slow.remarks[1]
    u = np.linspace(0.0, 1.0, 200)
    q_fast, qd_fast, _ = spline_of(fast).rows(u * fast.duration)
    q_slow, qd_slow, _ = spline_of(slow).rows(u * slow.duration)
    np.testing.assert_allclose(q_slow, q_fast, atol=1e-5)
    np.testing.assert_allclose(factor * qd_slow, qd_fast, atol=1e-4)
    assert slow.goal.waypoints[-1].time == pytest.approx(slow.duration)
    with pytest.raises(InvalidGoal, match=r'would take .* s because of .*, more than max_segment'):
        planned(cell, goal, max_tool_speed=0.2, on_too_fast='slow', max_segment_time=0.6)


def test_the_acceleration_where_a_cubic_begins_counts(cell):
    """The joint starts off from a point with 3 d / T^2, and arrives at the next one with 0."""
    d, T = 0.2, 0.2
    rows = [np.zeros(6), *(np.array([0.0, 0.0, 0.0, 0.0, 0.0, by]) for by in (d, d + 0.75))]
    speeds = (0.0, 1.5 * d / T, 0.0)
    points = tuple(
        JointPoint(
            time=time, positions=np.add(cell.state.actual_q, row), velocities=(*ZERO[:5], speed)
        )
        for time, row, speed in zip((1.0, 1.0 + T, 2.0 + T), rows, speeds, strict=True)
    )
    goal, most = JointGoal(joint_names=JOINT_NAMES, points=points), 3.0 * d / T**2
    text = (
        r'points\[1\]\.time_from_start gives too little time: at 0 % of it wrist_3_joint needs '
        rf'{most:.3f} rad/s\^2, more than max_joint_acceleration = {0.99 * most:.3f}'
    )
    planned(cell, goal, max_joint_acceleration=1.01 * most)
    with pytest.raises(TooFast, match=text):
        planned(cell, goal, max_joint_acceleration=0.99 * most)
    slow = planned(cell, goal, max_joint_acceleration=0.5 * most, on_too_fast='slow')
    q, dt = spline_of(slow).rows(np.linspace(0.0, slow.duration, 20_001))[0], slow.duration / 20e3
    assert np.abs(np.diff(q, 2, axis=0) / dt**2).max() == pytest.approx(0.5 * most, rel=1e-3)


def turned(cell, by, time, *, rates=ZERO):
    """Return a point with wrist 3 turned from home [rad], and rates."""
    positions = np.add(cell.state.actual_q, (*ZERO[:5], by))
    return JointPoint(time=time, positions=positions, velocities=rates, accelerations=ZERO)


@pytest.mark.parametrize('T', [0.004, 0.02, 0.1])
def test_accelerations_between_samples_count(cell, T):
    """From rest to rest, a quintic needs 10 / sqrt(3) of d / T^2, at 21 % and 79 % of its time."""
    most = 40.0
    d = most * T**2 * 3.0**0.5 / 10.0
    points = (turned(cell, 0.0, 1.0), turned(cell, d, 1.0 + T))
    goal = JointGoal(joint_names=JOINT_NAMES, points=points)
    options = {'max_angular_acceleration': 1000.0}
    planned(cell, goal, **options, max_joint_acceleration=1.003 * most)
    with pytest.raises(TooFast, match=r'at (2[012]|7[89]|80) % of it wrist_3_joint needs \d+'):
        planned(cell, goal, **options, max_joint_acceleration=0.997 * most)


@pytest.mark.random
def test_no_limit_is_exceeded_between_samples(cell):
    """Judged by differences of joints and places, at 2,000 steps of each piece."""
    random, judged = random_of('joint limits'), 0
    for _ in range(cases(30)):
        rng = np.random.default_rng(random.randrange(2**32))
        goal = random_goal(cell, rng)
        options = {
            'max_tool_speed': float(rng.choice([0.0, 0.25])),
            'max_joint_acceleration': float(rng.choice([5.0, 40.0])),
            'max_linear_acceleration': float(rng.choice([2.0, 10.0])),
            'on_too_fast': 'slow',
        }
        try:
            made = planned(cell, goal, **options)
        except (InvalidGoal, JointLimitExceeded):
            continue
        judged += 1
        for key, used in used_parts_of_limits(cell, made, options).items():
            assert used < 1.003, key
    assert judged > cases(30) / 3


def random_goal(cell, rng):
    """Return a goal with pieces of any duration, short ones included, and any rates."""
    time, points, quintic = 0.5, [], rng.random() < 0.5
    moved, scale = rng.random(6) < rng.choice([0.2, 0.5, 1.0]), 10.0 ** rng.uniform(-5.0, -1.0)
    count = rng.integers(1, 6)
    for i in range(count):
        time += 10.0 ** rng.uniform(-2.7, -0.5)
        rates = rng.normal(0.0, 1.0, (2, 6)) * 10.0 ** rng.uniform(-3.0, 0.0) * (i + 1 < count)
        points.append(
            JointPoint(
                time=time,
                positions=np.add(cell.state.actual_q, rng.normal(0.0, scale, 6) * moved),
                velocities=rates[0],
                accelerations=5.0 * rates[1] if quintic else (),
            )
        )
    return JointGoal(joint_names=JOINT_NAMES, points=tuple(points))


def used_parts_of_limits(cell, made, options):
    """Return the greatest parts of the limits that a plan uses inside of its pieces."""
    spline, used = spline_of(made), dict.fromkeys(('qd', 'qdd', 'v', 'a'), 0.0)
    for begin, end in itertools.pairwise(spline.times):
        times = np.linspace(begin, end, 2001)[1:-1]
        h, q = times[1] - times[0], spline.rows(times)[0]
        x = tcp_rows(cell.arm, cell.T_flange_tcp, q)[:, :3]
        v, a = (np.linalg.norm(np.diff(x, n, axis=0), axis=1).max() / h**n for n in (1, 2))
        qd, qdd = (np.abs(np.diff(q, n, axis=0)).max(axis=0) / h**n for n in (1, 2))
        for key, part in (
            ('qd', (qd / cell.arm.model.max_joint_speed).max()),
            ('qdd', qdd.max() / options['max_joint_acceleration']),
            ('v', v / (options['max_tool_speed'] or np.inf)),
            ('a', a / options['max_linear_acceleration']),
        ):
            used[key] = max(used[key], part)
    return used


@pytest.mark.parametrize('beyond', [1e-5, 1e-4])
def test_a_joint_that_turns_back_between_samples_keeps_its_range(cell, beyond):
    """A cubic that leaves with v and comes back with -v after T gets v T / 4 far."""
    T, v = 0.05, 0.5
    bound = 2.0 * pi - cell.state.actual_q[5]
    begin = bound + beyond - v * T / 4.0
    points = tuple(
        JointPoint(
            time=time,
            positions=np.add(cell.state.actual_q, (*ZERO[:5], by)),
            velocities=(*ZERO[:5], speed),
        )
        for time, by, speed in (
            (9.0, begin, v),
            (9.0 + T, begin, -v),
            (19.0, bound - 1.0, 0.0),
        )
    )
    goal = JointGoal(joint_names=JOINT_NAMES, points=points)
    text = (
        r'points\[1\]\.positions, at 4\d\.\d % of its segment: wrist_3_joint turns to 6\.283\d+ '
    )
    with pytest.raises(JointLimitExceeded, match=text):
        planned(cell, goal, max_joint_acceleration=100.0)
    nearer = tuple(
        replace(each, positions=(*each.positions[:5], each.positions[5] - 1.01 * beyond))
        for each in points
    )
    planned(cell, replace(goal, points=nearer), max_joint_acceleration=100.0)


def test_points_may_be_a_millisecond_apart(cell):
    times = [0.5 + 0.001 * k for k in range(200)]  # as sums of decimals are
    points = tuple(JointPoint(positions=cell.state.actual_q, time=time) for time in times)
    planned(cell, JointGoal(joint_names=JOINT_NAMES, points=points))


def test_joints_come_in_any_order_and_with_the_prefix(cell):
    plain = goal_through(cell, np.arange(6) * 0.02)
    (one,) = plain.points
    turned = JointGoal(
        joint_names=tuple(f'left_{name}' for name in reversed(JOINT_NAMES)),
        points=(replace(one, positions=one.positions[::-1]),),
        path_tolerance=(JointTolerance(name='left_elbow_joint', position=0.1, velocity=-1.0),),
    )
    made = planned(cell, turned, tf_prefix='left_')
    np.testing.assert_array_equal(made.rows.joints, planned(cell, plain).rows.joints)
    assert made.joint_tolerances.path.position == (0.0, 0.0, 0.1, 0.0, 0.0, 0.0)


def test_accelerations_of_some_points_are_ignored_and_the_report_says_so(cell):
    first, last = goal_through(cell, SIX, ZERO).points
    rates = {'velocities': ZERO, 'accelerations': SIX}
    full, partly = (
        planned(cell, JointGoal(joint_names=JOINT_NAMES, points=(replace(first, **rates), end)))
        for end in (replace(last, **rates), last)
    )
    assert all(piece.accelerations == SIX for piece in full.rows.primitives)
    assert all(piece.accelerations is None for piece in partly.rows.primitives)
    assert any('accelerations are ignored' in line for line in partly.remarks)


def test_accelerations_of_a_point_where_the_arm_rests_are_ignored_and_the_report_says_so(cell):
    rates = {'velocities': ZERO, 'accelerations': SIX}
    home = JointPoint(positions=cell.state.actual_q, time=0.0, **rates)
    (point,) = goal_through(cell, SIX).points
    goal = JointGoal(joint_names=JOINT_NAMES, points=(home, replace(point, **rates)))
    text = 'point 0: accelerations are ignored, because the arm rests there'
    assert text in planned(cell, goal).remarks
    still = replace(goal, points=(replace(home, accelerations=ZERO), *goal.points[1:]))
    assert text not in planned(cell, still).remarks


@given(
    st.lists(st.tuples(st.floats(0.05, 2.0), *[st.floats(-0.3, 0.3)] * 6), min_size=1, max_size=6)
)
def test_chosen_velocities_turn_no_joint_beyond_its_points(cell, steps):
    times, rows = np.cumsum([step[0] for step in steps]), [step[1:] for step in steps]
    points = tuple(
        JointPoint(time=time, positions=np.add(cell.state.actual_q, row))
        for time, row in zip(times, rows, strict=True)
    )
    made = planned(
        cell,
        JointGoal(joint_names=JOINT_NAMES, points=points),
        on_too_fast='slow',
        max_segment_time=2000.0,
    )
    spline, ends = spline_of(made), np.cumsum(made.rows.durations)
    q_before = np.array(made.start)
    for begin, end, row in zip(np.append(0.0, ends), ends, made.rows.joints, strict=False):
        q, _, _ = spline.rows(np.linspace(begin, end, 40))
        low, high = np.minimum(q_before, row), np.maximum(q_before, row)
        assert (q > low - 1e-9).all()
        assert (q < high + 1e-9).all()
        q_before = row


def test_a_goal_until_contact_is_watched_from_its_start_to_its_end(cell):
    goal = goal_through(cell, SIX, ZERO, until_contact=True)
    made, plain = planned(cell, goal), planned(cell, replace(goal, until_contact=False))
    assert [type(each) for each in made.rows.primitives] == [
        PressLaw,
        BeginPress,
        Spline,
        Spline,
        EndPress,
    ]
    assert tuple(made.rows.primitives)[2:4] == tuple(plain.rows.primitives)
    assert made.duration == plain.duration
    assert 'goes from the start to point 1, or until the tool touches' in made.report[0]
    assert made.reference.time.tolist() == plain.reference.time.tolist()


@pytest.mark.parametrize('dialect', ['2.10', '2.12'])
def test_older_programs_do_not_watch_splines_for_contact(cell, dialect):
    goal, options = goal_through(cell, SIX), {'dialect': DIALECTS[dialect]}
    planned(cell, goal, **options)
    with pytest.raises(NotAvailable, match=rf'wire dialect {dialect} do not watch'):
        planned(cell, replace(goal, until_contact=True), **options)
