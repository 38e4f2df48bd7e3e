# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Speeds and times: the limits that hold, and that the planned times come true.

The second part drives the primitives of a plan with the motion generator of the simulated
controller, which shares nothing with the planner.
"""

from __future__ import annotations

from dataclasses import replace
from math import pi
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

from ur_cartesian_driver.kinematics.inverse import nearest
from ur_cartesian_driver.motion.errors import InvalidGoal, TooFast
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.goal import Goal, Segment, SegmentType
from ur_cartesian_driver.motion.plan.primitive import MoveC, MoveJ, MoveL, MoveP, OptimoveJ
from ur_cartesian_driver.motion.twin.laws import MotionLaws
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.planning.moves.move_chain import MoveTimes
from ur_cartesian_driver.planning.moves.segment_timing import shortest_duration
from ur_cartesian_driver.sim.motion import MotionGenerator

TYPE = SegmentType
OPTIONS = PlanningOptions()
CYCLE = 0.002

positive = st.floats(0.01, 10.0)


@given(length=positive, velocity=positive, acceleration=positive)
def test_a_trapezoid_takes_the_time_of_the_textbook(length, velocity, acceleration):
    long = length > velocity**2 / acceleration
    expected = (
        length / velocity + velocity / acceleration
        if long
        else 2.0 * (length / acceleration) ** 0.5
    )
    assert shortest_duration(length, velocity, acceleration, 2) == pytest.approx(expected)


def one(cell, options=OPTIONS, segment=None, **point):
    """Return the plan of a goal of one point."""
    goal = Goal(waypoints=(cell.point(**point),), segments=(segment,) if segment else ())
    made = plan(goal, cell.state, cell.arm, options)
    return made.segments[0], made.remarks


def test_a_time_that_ramps_make_too_short_names_their_limit(cell):
    """Half a millimetre in 10 ms is slow enough for each speed limit, but not to begin and end."""
    slow = replace(OPTIONS, on_too_fast='slow')
    _, remarks = one(cell, slow, y=0.0005, time=0.01)
    assert any('because of max_linear_acceleration = ' in remark for remark in remarks), remarks
    _, remarks = one(cell, slow, y=0.0005, time=0.01, segment=Segment(type=TYPE.JOINT))
    assert any('because of max_joint_acceleration = 40 rad/s^2' in remark for remark in remarks), (
        remarks
    )
    _, remarks = one(cell, slow, y=0.2, time=0.3)
    assert any('because of max_tool_speed = ' in remark for remark in remarks), remarks


def test_the_lines_of_a_report_compute_no_column(cell, monkeypatch):
    """Else the report of a long path takes the square of its time."""
    goal = Goal(waypoints=tuple(cell.point(y=0.01 * k) for k in range(1, 9)))
    made = plan(goal, cell.state, cell.arm, OPTIONS)
    asked: list[str] = []

    def counted(name):
        compute = getattr(MoveTimes, name).fget

        def column(times):
            asked.append(name)
            return compute(times)

        return property(column)

    for name in ('durations', 'blend_time', 'blend_half'):
        monkeypatch.setattr(MoveTimes, name, counted(name))
    assert len(made.report) >= 8
    assert not asked


def test_speed_comes_from_the_segment_else_the_twist_else_the_default(cell):
    twist = (0.0, 0.12, 0.0, 0.0, 0.0, 0.5)
    assert one(cell, x=0.1)[0].primitive.velocity == OPTIONS.linear_velocity
    assert one(cell, x=0.1, twist=twist)[0].primitive.velocity == pytest.approx(0.12)
    assert (
        one(cell, x=0.1, twist=twist, segment=Segment(velocity=0.15, acceleration=0.7))[
            0
        ].primitive.velocity
        == 0.15
    )
    turn = one(cell, turn=(0.0, 0.0, 1.2), twist=twist)[0].primitive
    # Sent with the time in which neither reading of a turn exceeds that speed.
    assert turn.duration == pytest.approx(2.0 * 1.2 / 0.5)
    joint = one(cell, x=0.1, twist=twist, segment=Segment(type=TYPE.JOINT))
    assert joint[0].primitive.velocity <= OPTIONS.joint_velocity
    assert any('twist is ignored' in remark for remark in joint[1])


def test_a_line_that_turns_more_than_it_moves_is_sent_with_a_time(cell):
    segment, _ = one(cell, x=0.1, turn=(0.0, 0.0, pi / 2))
    # Whichever way the robot counts turns, it turns no faster than angular_velocity.
    duration = segment.primitive.duration
    assert duration == pytest.approx(2.0 * (pi / 2) / 0.5)
    assert segment.primitive.velocity == pytest.approx(1.5 * (pi / 2) / duration)
    assert segment.primitive.acceleration == pytest.approx(4.5 * (pi / 2) / duration**2)
    assert 'turn within angular_velocity' in segment.report_line


@pytest.mark.parametrize('ratio', [1.0, 4.0])
@pytest.mark.parametrize('time', [0.0, 4.0])
@pytest.mark.parametrize('x', [0.0, 0.05, 0.3])
def test_both_readings_of_a_turn_keep_its_time_and_limits(cell, ratio, time, x):
    """The robot turns the tool at 1 or 4 rad/s for each m/s: the planner sends what suits both."""
    options = replace(OPTIONS, turn_ratio=ratio)
    point = cell.point(x, turn=(0.0, 0.0, 0.8), time=time)
    made = plan(Goal(waypoints=(point,)), cell.state, cell.arm, options)
    rows = drive(made, cell, turn_ratio=ratio)
    T = made.segments[0].primitive.duration
    assert T > 0.0
    assert rows[-1, 0] == pytest.approx(T, abs=2 * CYCLE)
    assert rows[:, 4].max() <= 0.25 + 1e-6
    assert rows[:, 5].max() <= 2.0 * 0.8 / T * (1.0 + 1e-3)
    if not time:
        assert rows[:, 5].max() <= OPTIONS.angular_velocity * (1.0 + 1e-3)


@pytest.mark.parametrize('x', [0.0, 0.01, 0.05])
def test_a_turn_beside_the_wrist_singularity_keeps_the_joint_speeds_and_says_so(make_cell, x):
    cell = make_cell(q=(0.0, -pi / 2, pi / 2, -pi / 2, -0.1, 0.0))
    options = PlanningOptions(singularity_margin_wrist=0.05)
    point = {'x': x, 'turn': (0.3, 0.0, 0.0)}
    made = plan(Goal(waypoints=(cell.point(**point),)), cell.state, cell.arm, options)
    with pytest.raises(TooFast, match='give it at least') as caught:
        one(cell, options, time=0.9 * made.duration, **point)
    at_least = float(str(caught.value).split('at least ')[1].split(' s')[0])
    assert made.duration == pytest.approx(at_least, abs=1e-3)
    # The simulated arm takes longer where a joint would be too fast.
    assert drive(made, cell)[-1, 0] == pytest.approx(made.duration, abs=2 * CYCLE)
    words = 'turns in 2.2' if x else 'slowed from 0.5 to 0.27'
    assert made.remarks[0].startswith(f'point 0: {words}')
    assert 'the joint speed limits (wrist_1_joint at' in made.remarks[0]


@pytest.mark.parametrize('kind', [TYPE.PROCESS, TYPE.CIRCULAR])
def test_a_time_where_the_turn_leads_is_refused_until_it_has_been_measured(cell, kind):
    segment = Segment(type=kind, via=cell.pose(0.05, 0.05) if kind == TYPE.CIRCULAR else None)
    with pytest.raises(InvalidGoal, match='has not been measured; give velocity instead'):
        one(cell, x=0.1, turn=(0.0, 0.0, 0.8), time=4.0, segment=segment)
    assert one(cell, x=0.1, turn=(0.0, 0.0, 0.05), time=4.0, segment=segment)


@pytest.mark.parametrize('kind', [TYPE.LINEAR, TYPE.PROCESS])
def test_speeds_are_slowed_to_the_largest_tool_speed_and_it_is_said(cell, kind):
    segment, remarks = one(cell, x=0.1, segment=Segment(type=kind, velocity=0.6))
    assert segment.primitive.velocity == pytest.approx(0.25)
    assert remarks[0] == 'point 0: slowed from 0.6 to 0.25 m/s by max_tool_speed = 0.25 m/s'
    free = one(
        cell, PlanningOptions(max_tool_speed=0.0), x=0.1, segment=Segment(type=kind, velocity=0.6)
    )
    assert free[0].primitive.velocity == 0.6


@pytest.mark.parametrize(
    ('x', 'turn', 'twist', 'ignored'),
    [
        (0.1, 0.0, (0.0, 0.0, 0.0, 0.0, 0.0, 0.3), True),
        (0.1, 0.0, (0.1, 0.0, 0.0, 0.0, 0.0, 0.3), False),
        (0.0, 0.5, (0.1, 0.0, 0.0, 0.0, 0.0, 0.0), True),
        (0.0, 0.5, (0.0, 0.0, 0.0, 0.0, 0.0, 0.3), False),
    ],
)
def test_a_twist_without_the_part_that_sets_the_speed_is_told(cell, x, turn, twist, ignored):
    _, remarks = one(cell, x=x, turn=(0.0, 0.0, turn), twist=twist)
    assert any('point 0: twist is ignored' in line for line in remarks) is ignored


def test_joint_moves_keep_to_the_speed_of_the_joints(cell):
    options = PlanningOptions(max_tool_speed=0.0)
    segment, remarks = one(cell, options, x=0.1, segment=Segment(type=TYPE.JOINT, velocity=9.0))
    assert segment.primitive.velocity == pytest.approx(cell.arm.model.max_joint_speed[0])
    assert '_joint, 3.142 rad/s' in remarks[0]


@pytest.mark.parametrize(
    ('kind', 'time', 'limit'),
    [
        (TYPE.LINEAR, 0.5, 'max_tool_speed = 0.25 m/s'),
        (TYPE.PROCESS, 0.3, 'max_tool_speed = 0.25 m/s'),
        (TYPE.JOINT, 0.3, 'max_tool_speed = 0.25 m/s'),
    ],
)
def test_times_that_are_too_short_are_refused_with_the_numbers_or_slowed(cell, kind, time, limit):
    with pytest.raises(TooFast) as caught:
        one(cell, x=0.1, time=time, segment=Segment(type=kind))
    text = str(caught.value)
    assert text.startswith('trajectory.points[0].time_from_start gives the segment')
    assert limit in text
    segment, remarks = one(
        cell, PlanningOptions(on_too_fast='slow'), x=0.1, time=time, segment=Segment(type=kind)
    )
    assert segment.duration > time
    assert f'instead of {time:.3f} s' in remarks[0]
    at_least = float(text.split('at least ')[1].split(' s')[0])
    again, _ = one(cell, x=0.1, time=at_least + 1e-3, segment=Segment(type=kind))
    assert again.duration == pytest.approx(at_least, abs=2e-3)


def test_an_acceleration_of_its_own_that_is_too_low_for_the_time_is_refused(cell):
    arc = Segment(type=TYPE.CIRCULAR, via=cell.pose(0.05, 0.05), acceleration=0.1)
    with pytest.raises(TooFast, match=r'0\.100 m/s\^2'):
        one(cell, x=0.1, time=2.0, segment=arc)


def test_a_speed_that_the_wire_would_round_to_nothing_is_refused(cell):
    with pytest.raises(InvalidGoal, match='less than the 1e-05'):
        one(cell, x=0.0002, time=2000.0, segment=Segment(type=TYPE.PROCESS))


# -- driven by the motion generator of the simulated controller -----------------------------------


def drive(made, cell, turn_ratio=4.0):
    """Return time, position, speed and angular speed of the tool in every cycle."""
    laws = MotionLaws(turn_ratio=turn_ratio)
    robot = MotionGenerator(cell.arm, CYCLE, made.start, laws)
    robot.T_flange_tcp = cell.T_flange_tcp
    rows = []
    for segment in made.segments:
        move = begin(robot, segment.primitive, cell)
        while not move.returned:
            step(robot, rows)
    while robot.moving:
        step(robot, rows)
    assert robot.q == pytest.approx(made.segments[-1].joints, abs=1e-6)
    return np.array(rows)


def step(robot, rows):
    robot.step(1.0)
    assert robot.fault is None
    speeds = np.linalg.norm(np.reshape(robot.tcp_twist, (2, 3)), axis=1)
    rows.append((CYCLE * (len(rows) + 1), *robot.T_base_tcp.position, *speeds))


def begin(robot, move, cell):
    a, v, r = move.acceleration, move.velocity, move.blend_radius

    def joints():
        return nearest(cell.arm, move.target @ cell.T_flange_tcp.inverse(), move.q_near)

    def pose(target):
        return target if isinstance(target, Pose) else cell.tool(target)

    match move:
        case MoveJ():
            return robot.movej(joints(), a, v, move.duration, r)
        case MoveL():
            return robot.movel(move.target, a, v, move.duration, r)
        case MoveP():
            return robot.movep(move.target, a, v, r)
        case MoveC():
            return robot.movec(pose(move.via), pose(move.target), a, v, r, int(move.mode))
        case OptimoveJ():
            return robot.optimovej(joints(), a, v, r)
        case _:
            return robot.optimovel(move.target, a, v, r)


def away(made, rows):
    """Return how far the tool gets away from the reference path [m]."""
    path = made.reference.poses[:, :3]
    a, d = path[:-1], np.diff(path, axis=0)
    length = np.maximum(np.einsum('ij,ij->i', d, d), 1e-18)
    worst = 0.0
    for place in rows[:, 1:4]:
        u = np.clip(np.einsum('ij,ij->i', place - a, d) / length, 0.0, 1.0)
        worst = max(worst, float(np.linalg.norm(a + u[:, None] * d - place, axis=1).min()))
    return worst


@pytest.mark.parametrize(('too_fast', 'share'), [('refuse', 1.0), ('slow', 1.0), ('slow', 0.5)])
@pytest.mark.parametrize('max_tool_speed', [0.05, 0.25])
@pytest.mark.parametrize('kind', [TYPE.LINEAR, TYPE.JOINT, TYPE.PROCESS, TYPE.CIRCULAR])
def test_the_shortest_time_keeps_the_tool_speed(cell, kind, max_tool_speed, too_fast, share):
    options = PlanningOptions(max_tool_speed=max_tool_speed)
    segment = Segment(type=kind, via=cell.pose(0.15, 0.15) if kind == TYPE.CIRCULAR else None)
    with pytest.raises(TooFast) as caught:
        one(cell, options, x=0.3, time=0.1, segment=segment)
    shortest = float(str(caught.value).split('at least ')[1].split(' s')[0])
    goal = Goal(waypoints=(cell.point(x=0.3, time=share * shortest),), segments=(segment,))
    options = replace(options, on_too_fast=too_fast)
    made = plan(goal, cell.state, cell.arm, options)
    rows = drive(made, cell)
    assert rows[:, 4].max() <= max_tool_speed * (1.0 + 1e-4)
    assert rows[-1, 0] == pytest.approx(shortest, abs=2 * CYCLE)


@pytest.mark.parametrize('radius', [0.002, 0.02])
@pytest.mark.parametrize('timed', [False, True])
def test_an_arc_keeps_the_acceleration_of_the_tool(cell, radius, timed):
    """
    On half a circle, at the speed at which v^2 / r is the limit.

    Judged by second differences of the driven places. While the tool speeds up or brakes, the
    acceleration along the arc comes on top, at a right angle.
    """
    options = PlanningOptions(max_linear_acceleration=1.0, max_tool_speed=1.0)
    segment = Segment(
        type=TYPE.CIRCULAR,
        via=cell.pose(radius, radius),
        velocity=0.0 if timed else 0.9,
        acceleration=0.5,
    )
    text = f'max_linear_acceleration = 1 m/s^2 (on an arc with a radius of {1e3 * radius:g} mm)'
    point: dict[str, Any] = {'x': 2.0 * radius, 'segment': segment}
    if timed:
        with pytest.raises(TooFast) as caught:
            one(cell, options, time=0.1, **point)
        assert text in str(caught.value)
        point['time'] = float(str(caught.value).split('at least ')[1].split(' s')[0])
    found, remarks = one(cell, options, **point)
    assert found.primitive.velocity == pytest.approx(radius**0.5, rel=0.01)
    assert timed or text in remarks[0]
    goal = Goal(
        waypoints=(cell.point(2.0 * radius, time=point.get('time', 0.0)),), segments=(segment,)
    )
    rows = drive(plan(goal, cell.state, cell.arm, options), cell)
    needed = np.linalg.norm(np.diff(rows[:, 1:4], 2, axis=0), axis=1) / CYCLE**2
    cruises = np.abs(np.diff(rows[1:, 4])) < 1e-6
    assert needed[cruises].max() == pytest.approx(1.0, rel=0.02)
    assert needed.max() <= np.hypot(1.0, 0.5) * 1.01


CORNERS = ((0.1, 0.0), (0.1, 0.2), (-0.1, 0.2), (-0.1, 0.0), (0.1, 0.0))


def round_trip(cell, kind, radius, timed_by, turn=0.0):
    points = tuple(
        cell.point(x, y, 0.02 * i, time=timed_by * (i + 1), turn=(0.0, 0.0, turn * (i % 2)))
        for i, (x, y) in enumerate(CORNERS)
    )
    vias = ((0.05, 0.05), (0.15, 0.1), (0.0, 0.25), (-0.15, 0.1), (0.0, -0.05))
    return Goal(
        waypoints=points,
        segments=tuple(
            Segment(
                type=kind,
                blend_radius=radius,
                via=cell.pose(*via) if kind == TYPE.CIRCULAR else None,
            )
            for via in vias
        ),
    )


@pytest.mark.slow
@pytest.mark.parametrize('turn', [0.0, 0.9])
@pytest.mark.parametrize('radius', [0.0, 0.02])
@pytest.mark.parametrize('kind', [TYPE.LINEAR, TYPE.JOINT, TYPE.PROCESS, TYPE.CIRCULAR])
def test_times_are_met_on_the_planned_path_within_the_tool_speed(cell, kind, radius, turn):
    if kind in (TYPE.PROCESS, TYPE.CIRCULAR):
        turn /= 6.0  # where it is the larger number, times are refused
    made = plan(round_trip(cell, kind, radius, 4.0, turn), cell.state, cell.arm, OPTIONS)
    rows = drive(made, cell)
    assert rows[-1, 0] == pytest.approx(20.0, abs=5 * CYCLE)
    assert made.duration == pytest.approx(20.0, rel=1e-3)
    assert rows[:, 4].max() <= 0.25 + 1e-6
    assert away(made, rows[::5]) < (30e-6 if kind != TYPE.CIRCULAR else 200e-6)


@pytest.mark.slow
@pytest.mark.parametrize('radius', [0.0, 0.02])
@pytest.mark.parametrize('kind', [TYPE.LINEAR, TYPE.JOINT, TYPE.PROCESS, TYPE.CIRCULAR])
def test_without_times_the_expected_time_is_near(cell, kind, radius):
    made = plan(round_trip(cell, kind, radius, 0.0), cell.state, cell.arm, OPTIONS)
    rows = drive(made, cell)
    assert rows[-1, 0] == pytest.approx(made.duration, abs=5 * CYCLE)
    assert rows[:, 4].max() <= 0.25 + 1e-6


@pytest.mark.slow
@pytest.mark.parametrize('kind', [TYPE.OPTIMIZED_LINEAR, TYPE.OPTIMIZED_JOINT])
def test_optimized_moves_keep_to_the_tool_speed(cell, kind):
    made = plan(round_trip(cell, kind, 0.0, 0.0), cell.state, cell.arm, OPTIONS)
    rows = drive(made, cell)
    assert rows[:, 4].max() <= 0.25 * 1.02
    assert rows[-1, 0] == pytest.approx(made.duration, rel=0.35)
