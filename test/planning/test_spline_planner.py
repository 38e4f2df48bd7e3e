# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Goals with times and twists: the tool along the joint pieces, refusals, motions in parts."""

from __future__ import annotations

from dataclasses import replace
from math import nan, pi
from typing import Any

from hypothesis import given, HealthCheck, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.differential_kinematics import tool_rates
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.errors import (
    CollisionPredicted,
    GoalRefused,
    InvalidGoal,
    InvalidPosture,
    JointLimitExceeded,
    NearSingularity,
    TooFast,
    Unreachable,
)
from ur_cartesian_driver.motion.geometry.pose import Pose, quaternion_from_rotation_vector, rotate
from ur_cartesian_driver.motion.geometry.pose_rows import angle_rows
from ur_cartesian_driver.motion.geometry.vectors import vector6
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import Goal, Posture, Segment, Waypoint
from ur_cartesian_driver.motion.goal.goal_columns import goal_table
from ur_cartesian_driver.motion.plan.joint_spline import JointSpline
from ur_cartesian_driver.motion.plan.primitive import Spline
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.motion.twin.twin import ArmIdentity, Twin
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.planning.geometry.curves import tcp_rows
from ur_cartesian_driver.planning.geometry.tool_spline import ToolSpline
from ur_cartesian_driver.planning.preflight.tcp_kinematics import TcpKinematics
from ur_cartesian_driver.planning.spline.joint_polynomials import ANGLE_TOLERANCE_RADIUS
from ur_cartesian_driver.planning.spline.spline_planner import (
    end_state,
    plan_spline,
    plan_stop,
    SplineState,
)
from ur_cartesian_driver.planning.spline.spline_points import tool_points

OPTIONS = PlanningOptions(self_collision='off')
CHOOSE = (nan,) * 6
SPLINE = ExecutionMode.SPLINE
#: A tenth of a micrometre, a microradian: lost by adding and rounding.
EXACT = 1e-7


def goal_of(cell, seed=0, n=4, *, accelerations=False, size=0.05, **fields):
    """Return a goal around home whose points have twists (and accelerations)."""
    random = np.random.default_rng(seed)

    def rates(linear, angular):
        return (
            *random.uniform(-linear, linear, 3).tolist(),
            *random.uniform(-angular, angular, 3).tolist(),
        )

    points = [
        cell.point(
            *random.uniform(-size, size, 3),
            time=1.0 + 0.9 * k,
            turn=tuple(random.uniform(-3.0 * size, 3.0 * size, 3)),
            twist=rates(0.07, 0.15),
            acceleration=rates(0.1, 0.2) if accelerations else (0.0,) * 6,
        )
        for k in range(n)
    ]
    if not fields.get('keep_open'):
        points[-1] = replace(points[-1], twist=(0.0,) * 6, acceleration=(0.0,) * 6)
    return Goal(waypoints=tuple(points), **fields)


def joints_of(made):
    return JointSpline.of(made.start, [segment.primitive for segment in made.segments])


def curve_of(cell, goal, arm=None):
    start = SplineState(q=cell.state.actual_q).tool(
        TcpKinematics(arm or cell.arm, cell.T_flange_tcp)
    )
    return ToolSpline.through(tool_points(goal_table(goal), start))


def off(arm, T_flange_tcp, joints, curve, times):
    """Return how far the tool along the joints is off its curve at times [m], [rad]."""
    tool = tcp_rows(arm, T_flange_tcp, joints.rows(times)[0])
    asked = curve.at(times).poses
    return (
        np.linalg.norm(tool[:, :3] - asked[:, :3], axis=1).max(),
        angle_rows(tool[:, 3:], asked[:, 3:]).max(),
    )


def calibrated(model):
    """An arm that is some tenths of a millimetre and milliradian off its model."""
    geometry, random = model.geometry, np.random.default_rng(8)

    def moved(values, by):
        return tuple(v + d for v, d in zip(values, random.normal(0.0, by, 6), strict=True))

    return Arm(
        model,
        replace(
            geometry,
            a=moved(geometry.a, 3e-4),
            alpha=moved(geometry.alpha, 1e-3),
            theta=moved(geometry.theta, 1e-3),
        ),
    )


def standing(cell, arm):
    return replace(
        cell.state, actual_tcp_pose=arm.forward(cell.state.actual_q) @ cell.T_flange_tcp
    )


# -- requests are met ---------------------------------------------------------------------------


@pytest.mark.parametrize('accelerations', [False, True])
@pytest.mark.parametrize(
    ('model', 'is_calibrated'), [('ur3e', False), ('ur5e', True), ('ur10', False), ('ur20', True)]
)
def test_the_tool_passes_each_point_in_time_with_its_twist_and_keeps_to_the_curve(
    make_cell, model, is_calibrated, accelerations
):
    cell = make_cell(model=model)
    arm = calibrated(cell.arm.model) if is_calibrated else cell.arm
    goal = goal_of(cell, 2, accelerations=accelerations)
    made = plan(goal, standing(cell, arm), arm, OPTIONS)
    joints = joints_of(made)
    assert made.execution is SPLINE
    assert joints.duration == pytest.approx(goal.waypoints[-1].time, abs=1e-6)
    distance, angle = off(
        arm,
        cell.T_flange_tcp,
        joints,
        curve_of(cell, goal, arm),
        np.arange(0.0, joints.duration, 0.004),
    )
    assert distance < OPTIONS.spline_tolerance * 1.02
    assert angle < OPTIONS.spline_tolerance / ANGLE_TOLERANCE_RADIUS * 1.02
    for point in goal.waypoints[:-1]:
        q, qd, qdd = joints.rows(np.array([point.time]))
        twist, acceleration = tool_rates(arm, cell.T_flange_tcp, q, qd, qdd)
        there = arm.forward(q[0]) @ cell.T_flange_tcp
        assert there.distance_to(point.pose) < 1e-6
        assert there.angle_to(point.pose) < 1e-6
        assert twist[0] == pytest.approx(point.twist, abs=1e-6)
        if accelerations:
            assert acceleration[0] == pytest.approx(point.acceleration, abs=1e-5)
    assert not any(made.segments[-1].primitive.velocities)


@pytest.mark.parametrize('tolerance', [1e-3, 2e-5, 5e-6])
def test_a_smaller_tolerance_is_kept_by_more_pieces(cell, tolerance):
    goal = goal_of(cell, 4)
    made = plan(goal, cell.state, cell.arm, replace(OPTIONS, spline_tolerance=tolerance))
    joints = joints_of(made)
    distance, _ = off(
        cell.arm,
        cell.T_flange_tcp,
        joints,
        curve_of(cell, goal),
        np.arange(0.0, joints.duration, 0.002),
    )
    assert distance < 1.02 * tolerance
    assert {1e-3: 4, 2e-5: 10, 5e-6: 20}[tolerance] <= len(made.segments) <= 60


def test_points_with_accelerations_make_quintic_pieces_others_cubic_ones(cell):
    for accelerations in (False, True):
        made = plan(goal_of(cell, 5, accelerations=accelerations), cell.state, cell.arm, OPTIONS)
        assert all(
            (segment.primitive.accelerations is not None) == accelerations
            for segment in made.segments
        )
        kind = 'quintic' if accelerations else 'cubic'
        assert any(f' {kind} pieces, which keep the tool within' in line for line in made.report)


def test_times_of_pieces_are_whole_microseconds_and_do_not_drift(cell):
    waypoints = tuple(
        replace(point, time=point.time / 3.0)
        for point in goal_of(cell, 6, n=9, size=0.01).waypoints
    )
    made = plan(Goal(waypoints=waypoints), cell.state, cell.arm, OPTIONS)
    ticks = [1e6 * segment.duration for segment in made.segments]
    assert ticks == pytest.approx([round(tick) for tick in ticks], abs=1e-4)
    for point, ends in zip(
        waypoints,
        (sum(s.duration for s in made.segments if s.waypoint <= k) for k in range(9)),
        strict=True,
    ):
        assert ends == pytest.approx(point.time, abs=1e-6)


def test_each_piece_leads_to_its_point_and_the_last_one_of_a_point_says_so(cell):
    made = plan(goal_of(cell, 7), cell.state, cell.arm, OPTIONS)
    points = [segment.waypoint for segment in made.segments]
    assert points == sorted(points)
    assert set(points) == {0, 1, 2, 3}
    notes = [segment.report_line for segment in made.segments if segment.report_line]
    assert [note.split(':')[0] for note in notes] == [f'point {k}' for k in range(4)]
    assert sum(segment.length for segment in made.segments) == pytest.approx(
        np.linalg.norm(np.diff(made.reference.poses[:, :3], axis=0), axis=1).sum()
    )
    assert made.reference.point[-1] == 3
    assert made.reference.time[-1] == pytest.approx(made.duration)


def test_twists_are_those_along_the_axes_of_the_frame_of_the_goal(cell):
    goal = goal_of(cell, 8)
    frame = Pose((0.3, 0.1, -0.2), quaternion_from_rotation_vector((0.5, 0.2, -1.0)))
    back = frame.inverse()

    def seen(values):
        return (*rotate(back.quaternion, values[:3]), *rotate(back.quaternion, values[3:]))

    turned = replace(
        goal,
        T_base_frame=frame,
        waypoints=tuple(
            replace(point, pose=back @ point.pose, twist=seen(point.twist))
            for point in goal.waypoints
        ),
    )
    made = [joints_of(plan(g, cell.state, cell.arm, OPTIONS)) for g in (goal, turned)]
    np.testing.assert_allclose(made[0].coefficients, made[1].coefficients, atol=1e-7)


def test_twists_are_those_of_the_controlled_frame(cell):
    """Another TCP, set or not: the joints are the same while the tool does not turn."""
    nozzle = cell.T_flange_tcp @ Pose((0.05, 0.0, 0.1))
    state = replace(cell.state, T_flange_tcp=cell.T_flange_tcp)
    home = cell.arm.forward(state.actual_q) @ nozzle
    points = tuple(
        Waypoint(
            time=time,
            pose=Pose(
                tuple(a + b for a, b in zip(home.position, way, strict=True)), home.quaternion
            ),
            twist=twist,
        )
        for time, way, twist in (
            (1.0, (0.03, 0.02, 0.0), (0.05, 0.0, 0.01, 0.0, 0.0, 0.0)),
            (2.0, (0.06, 0.0, 0.02), (0.0,) * 6),
        )
    )
    goal = Goal(waypoints=points, controlled_frame='nozzle', T_flange_controlled=nozzle)
    by_tcp, carried = (
        plan(goal, state, cell.arm, replace(OPTIONS, allow_tcp_change=allowed))
        for allowed in (True, False)
    )
    assert by_tcp.T_flange_tcp == nozzle
    assert carried.T_flange_tcp is None
    for a, b in zip(by_tcp.segments, carried.segments, strict=True):
        assert a.primitive.target == pytest.approx(b.primitive.target, abs=1e-6)
        assert a.primitive.velocities == pytest.approx(b.primitive.velocities, abs=1e-6)


def test_a_point_without_twist_is_a_stop_and_the_report_says_so(cell):
    goal = goal_of(cell, 9)
    stop = replace(
        goal,
        waypoints=tuple(
            replace(point, twist=(0.0,) * 6) if k == 1 else point
            for k, point in enumerate(goal.waypoints)
        ),
    )
    made = plan(stop, cell.state, cell.arm, OPTIONS)
    end = [segment for segment in made.segments if segment.waypoint == 1][-1].primitive
    assert end.velocities == pytest.approx((0.0,) * 6, abs=1e-12)
    assert (
        'point 1: the arm stops there, because the twist is 0 (NaN lets the driver choose)'
        in made.report
    )
    assert 'stops there' in made.report[1]
    assert 'passes through' in made.report[0]


def test_nan_is_chosen_and_the_report_says_so(cell):
    goal = goal_of(cell, 10)
    chosen = replace(
        goal,
        waypoints=tuple(
            replace(point, twist=CHOOSE, acceleration=CHOOSE) for point in goal.waypoints
        ),
    )
    made = plan(chosen, cell.state, cell.arm, OPTIONS)
    assert all(any(segment.primitive.velocities) for segment in made.segments[:-1])
    for field in ('twist', 'acceleration'):
        assert (
            f'points 0, 1, 2: {field} is NaN, so the driver chooses it to fit the neighbouring '
            'points' in made.report
        )


def test_the_arm_can_wait_at_a_point(cell):
    goal = Goal(
        execution=SPLINE,
        waypoints=(cell.point(0.05, time=1.5), cell.point(0.05, time=4.0), cell.point(time=5.5)),
    )
    joints = joints_of(plan(goal, cell.state, cell.arm, OPTIONS))
    q, qd, _ = joints.rows(np.linspace(1.5, 4.0, 20))
    assert np.abs(q - q[0]).max() < EXACT
    assert np.abs(qd).max() < EXACT


def test_a_first_point_at_time_0_needs_no_piece(cell):
    later = goal_of(cell, 11)
    goal = replace(later, waypoints=(cell.point(time=0.0), *later.waypoints))
    made = plan(goal, cell.state, cell.arm, OPTIONS)
    assert made.segments[0].waypoint == 1
    assert made.duration == pytest.approx(later.waypoints[-1].time)
    alone = plan(later, cell.state, cell.arm, OPTIONS)
    assert joints_of(made).coefficients == pytest.approx(joints_of(alone).coefficients)


def test_the_joints_of_a_servo_goal_are_those_of_a_spline_goal(cell):
    goal = goal_of(cell, 12)
    servo = plan(replace(goal, execution=ExecutionMode.SERVO), cell.state, cell.arm, OPTIONS)
    assert servo.execution is ExecutionMode.SERVO
    assert servo.segments == plan(goal, cell.state, cell.arm, OPTIONS).segments


# -- refusals -----------------------------------------------------------------------------------


def refused(error, cell, goal, options=OPTIONS):
    with pytest.raises(error) as caught:
        plan(goal, cell.state, cell.arm, options)
    assert type(caught.value) is error
    return str(caught.value)


def through(cell, x, y, z, time=2.0, twist=(0.02, 0.0, 0.0, 0.0, 0.0, 0.0), **fields):
    """A goal through one point, to rest at home."""
    return Goal(
        waypoints=(
            cell.point(x, y, z, time=time, twist=twist, **fields),
            cell.point(time=2.0 * time),
        )
    )


def test_a_point_out_of_reach_is_refused_with_the_place(cell):
    text = refused(
        Unreachable,
        cell,
        through(cell, -0.6, 0.0, 0.0, time=9.0),
        replace(OPTIONS, max_approach_distance=0.0, singularity_margin_elbow=0.0),
    )
    assert text.startswith('trajectory.points[0].pose, ')
    assert '% of its segment, cannot be reached' in text


def test_a_curve_that_leaves_the_reach_between_its_points_is_refused(cell):
    """Both ends are home; between them a twist carries the tool out of reach."""
    out = (-1.5, 0.0, 0.0, 0.0, 0.0, 0.0)
    goal = Goal(
        waypoints=(
            cell.point(-0.01, time=1.0, twist=out),
            cell.point(-0.01, time=4.0, twist=(1.5, 0.0, 0.0, 0.0, 0.0, 0.0)),
            cell.point(time=5.0),
        )
    )
    text = refused(
        Unreachable, cell, goal, replace(OPTIONS, max_tool_speed=0.0, singularity_margin_elbow=0.0)
    )
    assert text.startswith('trajectory.points[1].pose, ')


def test_a_singularity_on_the_curve_is_refused_with_value_and_bound(cell):
    q = cell.state.actual_q
    goal = Goal(
        execution=SPLINE,
        waypoints=tuple(
            Waypoint(time=time, pose=cell.tool((*q[:4], wrist_2, q[5])), twist=CHOOSE)
            for time, wrist_2 in ((4.0, -0.6), (8.0, 0.4))
        ),
    )
    text = refused(NearSingularity, cell, goal)
    assert 'wrist singularity' in text
    assert 'less than singularity_margin_wrist = 0.05 rad' in text
    assert 'PRIMITIVES with a JOINT segment' in text


@pytest.mark.parametrize('dense', [1, 400])
def test_a_spline_may_leave_a_singularity_but_not_come_to_one_however_dense_its_points_are(
    make_cell, dense
):
    ends = [(0.3, -1.2, 1.5, -1.4, wrist_2, 0.2) for wrist_2 in (-0.02, -0.4)]
    for begin, end, passes in (*[(*ends, True)], (*ends[::-1], False)):
        cell = make_cell(q=begin)
        shares = np.linspace(0.0, 1.0, dense + 1)[1:]
        goal = Goal(
            execution=SPLINE,
            waypoints=tuple(
                Waypoint(
                    time=4.0 * share,
                    twist=CHOOSE,
                    acceleration=CHOOSE,
                    pose=cell.home.interpolate(cell.tool(end), share * share * (3 - 2 * share)),
                )
                for share in shares.tolist()
            ),
        )
        if passes:
            plan(goal, cell.state, cell.arm, OPTIONS)
        else:
            assert 'of the wrist singularity' in refused(NearSingularity, cell, goal)


@pytest.mark.parametrize(('turn', 'passes'), [(pi, False), (pi - 5e-4, False), (3.0, True)])
def test_half_a_turn_between_two_points_is_refused(cell, turn, passes):
    goal = Goal(
        execution=SPLINE,
        waypoints=(cell.point(0.01, time=1.0), cell.point(turn=(0.0, 0.0, turn), time=9.0)),
    )
    if passes:
        plan(goal, cell.state, cell.arm, OPTIONS)
        return
    text = refused(InvalidGoal, cell, goal)
    assert text.startswith('trajectory.points[1].pose.orientation turns the tool by 1')


def test_a_joint_at_the_end_of_its_range_is_refused(make_cell):
    cell = make_cell(q=(0.0, -pi / 2, pi / 2, -pi / 2, -pi / 2, 2.0 * pi - 0.3))
    turns = [
        Goal(
            waypoints=(
                cell.point(
                    turn=(0.0, 0.0, 0.5 * s), time=3.0, twist=(0.0, 0.0, 0.0, 0.0, 0.0, 0.001)
                ),
                cell.point(time=6.0),
            )
        )
        for s in (1.0, -1.0)
    ]
    texts = []
    for goal in turns:
        try:
            plan(goal, cell.state, cell.arm, OPTIONS)
        except JointLimitExceeded as error:
            texts.append(str(error))
    assert len(texts) == 1
    assert 'moves wrist_3_joint to ' in texts[0]
    assert 'outside its range' in texts[0]
    assert 'use PRIMITIVES with a JOINT segment.' in texts[0]
    assert texts[0].startswith('trajectory.points[0].pose, ')


def test_a_posture_that_the_curve_does_not_arrive_in_is_refused(cell):
    flipped = Posture(names=('elbow_joint',), values=(-1.5,))
    text = refused(InvalidPosture, cell, through(cell, 0.05, 0.0, 0.0, posture=flipped))
    assert text.startswith('trajectory.points[0].posture cannot be reached along the spline')
    arrives = Posture(names=('elbow_joint',), values=(1.5,))
    plan(through(cell, 0.05, 0.0, 0.0, posture=arrives), cell.state, cell.arm, OPTIONS)


@pytest.mark.parametrize(
    ('goal', 'options', 'text'),
    [
        (
            {'x': 0.4, 'time': 1.5},
            {},
            r'the tool needs 0\.\d+ m/s, more than max_tool_speed = 0.250 m/s',
        ),
        (
            {'x': 0.1, 'time': 0.3},
            {'max_tool_speed': 0.0, 'max_linear_acceleration': 2.0},
            r'the tool needs \d+\.\d+ m/s\^2, more than max_linear_acceleration = 2.000 m/s\^2',
        ),
        (
            {'turn': (0.0, 0.0, 2.0), 'time': 0.5},
            {'max_angular_acceleration': 1000.0, 'max_joint_acceleration': 1000.0},
            r'wrist_3_joint needs \d+\.\d+ rad/s, more than the joint speed limit = 3.142 rad/s',
        ),
        (
            {'turn': (0.0, 0.0, 0.5), 'time': 0.3},
            {'max_joint_acceleration': 10.0},
            r'_joint needs \d+\.\d+ rad/s\^2, more than max_joint_acceleration = 10.000',
        ),
    ],
)
def test_what_is_too_fast_is_refused_with_place_value_and_bound(cell, goal, options, text):
    options = replace(OPTIONS, **options)
    fast = through(
        cell, goal.get('x', 0.0), 0.0, 0.0, time=goal['time'], turn=goal.get('turn', (0.0,) * 3)
    )
    with pytest.raises(TooFast, match=rf'^trajectory.points\[[01]\].time_from_start .*{text}'):
        plan(fast, cell.state, cell.arm, options)


def test_slow_stretches_all_times_and_keeps_the_way(cell):
    goal = goal_of(cell, 13)
    fast = replace(
        goal,
        waypoints=tuple(
            replace(point, time=point.time / 4.0, twist=tuple(4.0 * v for v in point.twist))
            for point in goal.waypoints
        ),
    )
    assert 'more than max_tool_speed = ' in refused(TooFast, cell, fast)
    made = plan(fast, cell.state, cell.arm, replace(OPTIONS, on_too_fast='slow'))
    factor = made.duration / fast.waypoints[-1].time
    assert factor > 1.0
    assert made.goal.waypoints[-1].time == pytest.approx(made.duration)
    assert any(
        line.startswith(f'all times are stretched by {factor:.4g}, because of max_tool_speed')
        for line in made.report
    )
    joints, curve = joints_of(made), curve_of(cell, goal)
    times = np.linspace(0.0, made.duration, 200)
    tool = tcp_rows(cell.arm, cell.T_flange_tcp, joints.rows(times)[0])
    asked = curve.at(times / factor * 4.0).poses
    assert np.linalg.norm(tool[:, :3] - asked[:, :3], axis=1).max() < 6e-5
    q, qd, qdd = joints.rows(times[1:-1])
    twist, _ = tool_rates(cell.arm, cell.T_flange_tcp, q, qd, qdd)
    assert np.linalg.norm(twist[:, :3], axis=1).max() == pytest.approx(0.25, rel=0.01)


@pytest.mark.parametrize('linear', [True, False], ids=['tool', 'joints'])
def test_accelerations_are_slowed_to_their_limit_and_no_further(cell, linear):
    goal, limit = goal_of(cell, 13), 0.1 if linear else 0.3
    name = 'max_linear_acceleration' if linear else 'max_joint_acceleration'
    bounds: dict[str, Any] = {name: limit}
    made = plan(goal, cell.state, cell.arm, replace(OPTIONS, on_too_fast='slow', **bounds))
    assert any(f'because of {name}' in line for line in made.report)
    # Beside the points, where the acceleration of a cubic jumps.
    ends = np.cumsum([segment.duration for segment in made.segments])
    times = np.sort(np.concatenate([np.linspace(0.0, ends[-1], 400), ends[:-1] - 1e-6]))[1:-1]
    q, qd, qdd = joints_of(made).rows(times)
    _, tool = tool_rates(cell.arm, cell.T_flange_tcp, q, qd, qdd)
    most = np.linalg.norm(tool[:, :3], axis=1).max() if linear else np.abs(qdd).max()
    assert most == pytest.approx(limit, rel=0.05)


@pytest.mark.parametrize('linear', [True, False], ids=['tool', 'joints'])
def test_the_acceleration_where_a_cubic_begins_is_slowed_to_its_limit(cell, linear):
    """
    The tool starts off from point 0 with 3 d / T^2, and arrives at point 1 with 0.

    Judged by second differences of places and joints, a millisecond apart.
    """
    d, T = 0.02, 0.2
    goal = Goal(
        waypoints=(
            cell.point(0.0, 0.01, time=1.0),
            cell.point(0.0, 0.01 + d, time=1.0 + T, twist=(0.0, 1.5 * d / T, 0, 0, 0, 0)),
            cell.point(0.0, 0.01 + 3.0 * d, time=2.0 + T),
        ),
        execution=SPLINE,
    )
    bounds: dict[str, Any] = {}
    for factor in (1.0, 0.25):
        options = replace(OPTIONS, on_too_fast='slow', **bounds)
        made = plan(goal, cell.state, cell.arm, options)
        q = joints_of(made).rows(np.arange(0.0, made.duration, 1e-3))[0]
        x = tcp_rows(cell.arm, cell.T_flange_tcp, q)[:, :3] if linear else q
        needed = np.diff(x, 2, axis=0) / 1e-3**2
        most = np.linalg.norm(needed, axis=1).max() if linear else np.abs(needed).max()
        if not bounds:
            assert most == pytest.approx(3.0 * d / T**2, rel=0.02) or not linear
            bounds = {f'max_{"linear" if linear else "joint"}_acceleration': 0.25 * most}
            needed_before = most
        # The joint pieces have a little more or less than the spline of the tool.
        assert most == pytest.approx(factor * needed_before, rel=0.02)


@pytest.mark.parametrize('T', [0.004, 0.02])
def test_the_acceleration_within_a_short_piece_is_found(cell, T):
    """From rest to rest, a quintic needs 10 / sqrt(3) of the turn / T^2."""
    most, options = 35.0, replace(OPTIONS, max_joint_acceleration=1000.0)
    turn = most * T**2 * 3.0**0.5 / 10.0
    goal = Goal(
        waypoints=(
            cell.point(0.001, time=1.0, acceleration=(1e-9, 0, 0, 0, 0, 0)),
            cell.point(0.001, time=1.0 + T, turn=(0.0, 0.0, turn)),
        ),
        execution=SPLINE,
    )
    plan(goal, cell.state, cell.arm, replace(options, max_angular_acceleration=1.003 * most))
    low = replace(options, max_angular_acceleration=0.997 * most)
    text = refused(TooFast, cell, goal, low)
    found = float(text.split('the tool needs ')[1].split(' rad/s^2')[0])
    assert found == pytest.approx(most, rel=0.002)


def test_a_workspace_plane_is_kept_between_the_points_too(cell):
    low = cell.home.position[2] - 0.03
    plane = replace(OPTIONS, workspace_planes=(f'table 0 0 {low} 0 0 1',))
    goal = through(cell, 0.0, 0.0, -0.02, twist=(0.0, 0.0, -0.1, 0.0, 0.0, 0.0))
    text = refused(CollisionPredicted, cell, goal, plane)
    assert 'trajectory.points[1].pose' in text
    assert 'beyond the workspace plane "table"' in text
    plan(through(cell, 0.0, 0.0, -0.02), cell.state, cell.arm, plane)


def test_a_way_to_the_first_point_that_is_too_far_is_refused(cell):
    assert 'max_approach_distance' in refused(
        InvalidGoal,
        cell,
        through(cell, 0.1, 0.0, 0.0),
        replace(OPTIONS, max_approach_distance=0.05),
    )


@pytest.mark.slow
@settings(
    max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    seed=st.integers(0, 10_000),
    size=st.sampled_from([0.02, 0.1, 0.4]),
    rates=st.sampled_from(['cubic', 'quintic', 'chosen']),
)
def test_any_goal_is_refused_or_its_tool_keeps_to_the_curve_and_to_the_limits(
    cell, seed, size, rates
):
    goal = goal_of(cell, seed, n=3, size=size, accelerations=rates == 'quintic')
    if rates == 'chosen':
        goal = replace(
            goal,
            execution=SPLINE,
            waypoints=tuple(
                replace(point, twist=CHOOSE, acceleration=CHOOSE) for point in goal.waypoints
            ),
        )
    try:
        made = plan(goal, cell.state, cell.arm, OPTIONS)
    except GoalRefused:
        return
    joints = joints_of(made)
    times = np.arange(0.0, joints.duration, 0.01)
    distance, angle = off(cell.arm, cell.T_flange_tcp, joints, curve_of(cell, goal), times)
    assert distance < OPTIONS.spline_tolerance * 1.02
    assert angle < OPTIONS.spline_tolerance / ANGLE_TOLERANCE_RADIUS * 1.02
    _, qd, _ = joints.rows(times)
    assert (np.abs(qd) < np.array(cell.arm.model.max_joint_speed) * 1.01).all()


# -- motions in parts ---------------------------------------------------------------------------


def parts_of(goal, n):
    """Return an open goal's first n points, and the rest."""
    return (
        replace(goal, waypoints=goal.waypoints[:n], keep_open=True),
        replace(goal, waypoints=goal.waypoints[n:], keep_open=False),
    )


@pytest.mark.parametrize('accelerations', [False, True])
def test_a_motion_in_two_parts_is_the_motion_in_one(cell, accelerations):
    goal = goal_of(cell, 14, n=6, accelerations=accelerations)
    whole = plan(goal, cell.state, cell.arm, OPTIONS)
    first, second = parts_of(goal, 3)
    begun = plan_spline(
        SplineState(q=cell.state.actual_q),
        goal_table(first),
        TcpKinematics(cell.arm, cell.T_flange_tcp),
        OPTIONS,
    )
    assert begun.end.is_moving
    assert begun.end.time == pytest.approx(goal.waypoints[2].time)
    rest = plan_spline(
        begun.end, goal_table(second), TcpKinematics(cell.arm, cell.T_flange_tcp), OPTIONS, first=3
    )
    assert not rest.end.is_moving
    assert [s.waypoint for s in rest.segments][0 :: len(rest.segments) - 1] == [3, 5]
    assert rest.reference.time[0] == begun.end.time
    assert rest.reference.point[0] == 3
    for a, b in zip(whole.segments, (*begun.segments, *rest.segments), strict=True):
        assert a.primitive.target == pytest.approx(b.primitive.target, abs=1e-7)
        assert a.primitive.velocities == pytest.approx(b.primitive.velocities, abs=1e-7)
        assert a.duration == pytest.approx(b.duration, abs=1e-9)
    assert rest.segments[-1].report_line.startswith('point 5: ')


def test_an_open_goal_may_be_planned_to_end_moving(cell):
    goal = goal_of(cell, 15, keep_open=True)
    part = plan_spline(
        SplineState(q=cell.state.actual_q),
        goal_table(goal),
        TcpKinematics(cell.arm, cell.T_flange_tcp),
        OPTIONS,
    )
    q, qd, qdd = part.end.rows()
    assert tool_rates(cell.arm, cell.T_flange_tcp, q, qd, qdd)[0][0] == pytest.approx(
        goal.waypoints[-1].twist, abs=1e-6
    )
    assert 'passes through' in part.segments[-1].report_line


def test_an_open_goal_that_moves_on_may_follow_a_twin(cell):
    goal = goal_of(cell, 15, keep_open=True, execution=SPLINE)
    twin = Twin(arm=ArmIdentity(model='ur5e'), date='2026-11-27')
    planned = plan(goal, cell.state, cell.arm, replace(OPTIONS, twin=twin))
    bare = plan(goal, cell.state, cell.arm, OPTIONS)
    assert planned.segments[-1].primitive == bare.segments[-1].primitive


def test_what_is_planned_in_parts_is_not_slowed(cell):
    goal = goal_of(cell, 16)
    slow = replace(OPTIONS, on_too_fast='slow')
    start = SplineState(q=cell.state.actual_q, qd=(0.1,) * 6)
    fast = replace(goal, waypoints=(replace(goal.waypoints[0], time=0.1),))
    text = r'multiply all times by \d+\.\d+ \(and adapt twists and accelerations\)\.$'
    with pytest.raises(TooFast, match=text):
        plan_spline(start, goal_table(fast), TcpKinematics(cell.arm, cell.T_flange_tcp), slow)
    with pytest.raises(TooFast, match=text):
        plan(replace(fast, keep_open=True, execution=SPLINE), cell.state, cell.arm, slow)


@pytest.mark.parametrize('qdd', [(0.0,) * 6, (0.3, -0.5, 0.2, 0.8, -0.4, 0.1)])
def test_a_closing_piece_brakes_smoothly_and_no_harder_than_told(cell, qdd):
    qd = (0.5, -0.8, 0.3, 0.2, -0.1, 1.0)
    state = SplineState(time=3.0, q=cell.state.actual_q, qd=qd, qdd=qdd)
    piece = plan_stop(state, cell.arm, replace(OPTIONS, keep_open_deceleration=2.0), 0)
    assert piece.velocities == piece.accelerations == (0.0,) * 6
    spline = JointSpline.of(state.q, [piece], velocities=qd, accelerations=qdd)
    _, speeds, accelerations = spline.rows(np.linspace(0.0, piece.duration, 100))
    assert speeds[0] == pytest.approx(qd)
    assert np.abs(accelerations).max() <= 2.0 + np.abs(qdd).max()
    if not any(qdd):
        assert np.abs(accelerations).max() == pytest.approx(2.0, rel=0.01)
        assert (np.diff(np.abs(speeds), axis=0) <= 1e-12).all()


@pytest.mark.parametrize('left', [0.05, 0.02, 0.0188])
def test_a_closing_piece_keeps_to_the_range_of_a_joint_as_hard_as_it_may(cell, left):
    """From 1 rad/s, a cubic needs 1.5 / 2 of v^2 / a to rest: 18.75 mrad with 40 rad/s^2."""
    q = (0.0, -pi / 2, pi / 2, -pi / 2, -pi / 2, 2.0 * pi - left)
    state = SplineState(q=q, qd=(0.0, 0.0, 0.0, 0.0, 0.0, 1.0))
    piece = plan_stop(state, cell.arm, OPTIONS, 0)
    assert piece.target[5] <= 2.0 * pi
    assert piece.duration < 1.5 / 4.0
    dense = JointSpline.of(q, [piece], velocities=state.qd).rows(
        np.linspace(0.0, piece.duration, 500)
    )[0]
    braked = np.diff(dense, 2, axis=0) / (piece.duration / 499.0) ** 2
    assert np.abs(braked).max() <= OPTIONS.max_joint_acceleration * (1.0 + 1e-6)


def test_a_closing_piece_that_would_brake_too_hard_is_refused_with_place_value_and_bound(cell):
    q = (0.0, -pi / 2, pi / 2, -pi / 2, -pi / 2, 2.0 * pi - 0.018)
    state = SplineState(q=q, qd=(0.0, 0.0, 0.0, 0.0, 0.0, 1.0))
    with pytest.raises(
        JointLimitExceeded,
        match=r'^trajectory\.points\[7\]: wrist_3_joint is too fast there to stop before the end '
        r'of its range, -6\.2832 to 6\.2832 rad: with max_joint_acceleration = 40 rad/s\^2 it '
        r'stops at 6\.2839 rad; end',
    ):
        plan_stop(state, cell.arm, OPTIONS, 7)


def test_a_closing_piece_keeps_to_the_speed_of_a_joint_that_gets_faster_still(cell):
    fastest = cell.arm.model.max_joint_speed[5]
    state = SplineState(
        q=cell.state.actual_q, qd=(0.0,) * 5 + (0.98 * fastest,), qdd=(0.0,) * 5 + (8.0,)
    )
    piece = plan_stop(state, cell.arm, replace(OPTIONS, keep_open_deceleration=1.0), 0)
    _, speeds, _ = JointSpline.of(
        state.q, [piece], velocities=state.qd, accelerations=state.qdd
    ).rows(np.linspace(0.0, piece.duration))
    assert speeds[1, 5] > speeds[0, 5]
    assert speeds.max() < 1.02 * fastest


def test_a_joint_that_gets_too_fast_while_it_stops_is_named_with_its_reason(cell):
    fastest = cell.arm.model.max_joint_speed[4]
    state = SplineState(
        q=cell.state.actual_q, qd=(*(0.0,) * 4, 0.999 * fastest, 0.0), qdd=(*(0.0,) * 4, 39.0, 0)
    )
    with pytest.raises(
        TooFast,
        match=r'^trajectory\.points\[3\]\.acceleration still speeds up wrist_2_joint, which '
        r'reaches 3\.\d+ rad/s while it stops .* more than the joint speed limit = 3\.142 rad/s; '
        r'reduce',
    ):
        plan_stop(state, cell.arm, OPTIONS, 3)


@pytest.mark.parametrize('seed', range(40))
def test_a_closing_piece_needs_no_more_than_the_greatest_acceleration(cell, seed):
    """Judged by differences of the joints, for any speeds and accelerations at the last point."""
    random = np.random.default_rng(seed)
    qd, qdd = random.uniform(-3.0, 3.0, 6), random.uniform(-40.0, 40.0, 6)
    q = np.array(cell.state.actual_q) + random.uniform(-4.0, 4.0, 6)
    state = SplineState(q=vector6(q.tolist()), qd=vector6(qd.tolist()), qdd=vector6(qdd.tolist()))
    try:
        piece = plan_stop(state, cell.arm, OPTIONS, 0)
    except (JointLimitExceeded, TooFast):
        return
    dense = JointSpline.of(state.q, [piece], velocities=state.qd, accelerations=state.qdd).rows(
        np.linspace(0.0, piece.duration, 500)
    )[0]
    braked = np.diff(dense, 2, axis=0) / (piece.duration / 499.0) ** 2
    assert np.abs(braked).max() <= OPTIONS.max_joint_acceleration * (1.0 + 1e-6)


def test_the_way_to_rest_behind_an_open_end_is_checked_too(cell):
    """The last point is above the plane, and so fast that the arm would be below it at rest."""
    goal = Goal(
        keep_open=True,
        waypoints=(cell.point(z=-0.05, time=1.0, twist=(0.0, 0.0, -0.1, 0.0, 0.0, 0.0)),),
    )
    low = cell.home.position[2] - 0.0505
    options = replace(OPTIONS, workspace_planes=(f'table 0 0 {low} 0 0 1',))
    start = SplineState(q=cell.state.actual_q)
    with pytest.raises(CollisionPredicted, match='"table"'):
        plan_spline(start, goal_table(goal), TcpKinematics(cell.arm, cell.T_flange_tcp), options)
    plan_spline(
        start,
        goal_table(replace(goal, waypoints=(replace(goal.waypoints[0], twist=(0.0,) * 6),))),
        TcpKinematics(cell.arm, cell.T_flange_tcp),
        options,
    )


def test_the_state_at_the_end_of_a_plan_is_where_it_can_be_continued():
    arm = Arm(robot_model('ur5e'))
    q = (0.0, -pi / 2, pi / 2, -pi / 2, -pi / 2, 0.0)
    home = arm.forward(q)
    made = plan(
        Goal(
            waypoints=(Waypoint(time=2.0, pose=home @ Pose((0.0, 0.0, 0.1))),),
            execution=SPLINE,
            segments=(Segment(acceleration=1.0),),
        ),
        RobotState(timestamp=0.0, actual_q=q, actual_tcp_pose=home),
        arm,
        OPTIONS,
    )
    end = end_state(made)
    assert (end.time, end.is_moving) == (pytest.approx(2.0), False)
    assert isinstance(made.segments[-1].primitive, Spline)
    assert end.q == made.segments[-1].joints
    assert (
        'point 0: the acceleration of the segment is ignored: its time sets the speed'
        in made.report
    )
