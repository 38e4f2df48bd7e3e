# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Numbers that are finite and absurd: each is refused at once, or made into what can be sent."""

from __future__ import annotations

from dataclasses import replace
from time import process_time

import pytest

from ur_cartesian_driver.kinematics.inverse import nearest
from ur_cartesian_driver.motion.errors import (
    GoalRefused,
    InvalidGoal,
    InvalidJoints,
    TooFast,
    Unreachable,
)
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import (
    Goal,
    Posture,
    Segment,
    SegmentType,
    Waypoint,
)
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.protocol.program.trajectory_points import encode_points

TYPE = SegmentType


def sent(cell, goal, **options):
    """Plan a goal and encode it; return the plan."""
    made = plan(goal, cell.state, cell.arm, PlanningOptions(**options))
    encode_points(segment.primitive for segment in made.segments)
    return made


@pytest.mark.parametrize('z', [500.0, 1e9, 1e150, 1e300])
def test_a_point_in_millimetres_or_beyond_the_moon_is_refused_at_once(cell, z):
    far = Waypoint(pose=Pose((-0.5, -0.1, z), cell.home.quaternion))
    with pytest.raises(Unreachable, match=r'points\[1\]'):
        sent(cell, Goal(waypoints=(cell.point(0.01), far)))


@pytest.mark.parametrize('kind', [TYPE.LINEAR, TYPE.JOINT, TYPE.PROCESS])
@pytest.mark.parametrize(
    'point', [{'y': 0.05}, {'turn': (0.0, 0.0, 0.5)}, {'y': 0.01, 'turn': (0.0, 0.0, 0.5)}]
)
def test_a_huge_speed_or_acceleration_becomes_one_that_the_arm_has(cell, kind, point):
    segment = Segment(type=kind, velocity=1e300, acceleration=1e300)
    made = sent(cell, Goal(waypoints=(cell.point(**point),), segments=(segment,)))
    q, q_end = cell.state.actual_q, made.segments[0].joints
    fastest = max(
        abs(b - a) / speed
        for a, b, speed in zip(q, q_end, cell.arm.model.max_joint_speed, strict=True)
    )
    assert made.duration > fastest


@pytest.mark.parametrize(
    ('field', 'value', 'kind'),
    [
        ('acceleration', 1e-300, TYPE.LINEAR),
        ('acceleration', 1e-7, TYPE.JOINT),
        ('velocity', 1e-300, TYPE.LINEAR),
        ('velocity', 1e-9, TYPE.OPTIMIZED_LINEAR),
    ],
)
def test_what_would_be_zero_on_the_wire_is_refused(cell, field, value, kind):
    segment = Segment(**{'type': kind, field: value})
    with pytest.raises(InvalidGoal, match=r'points\[0\].*raise'):
        sent(cell, Goal(waypoints=(cell.point(0.01),), segments=(segment,)))


@pytest.mark.parametrize('value', [-90.0, 1e300])
def test_a_posture_in_degrees_is_refused(cell, value):
    posture = Posture(names=('elbow_joint',), values=(value,))
    with pytest.raises(InvalidJoints, match='radians'):
        sent(cell, Goal(waypoints=(cell.point(0.01, posture=posture),)))


def beside_the_wrist(make_cell, **fields):
    """Return a robot whose wrist a line takes past 10 urad from straight, and the line's goal."""
    cell = make_cell(q=(0.2, -1.2, 1.5, -1.4, 1e-5, 0.3))
    (x, y, z), turn = cell.home.position, cell.home.quaternion
    flange = Pose((x, y - 0.1, z - 0.03), turn) @ cell.T_flange_tcp.inverse()
    there = make_cell(q=nearest(cell.arm, flange, cell.state.actual_q))
    end = Waypoint(pose=Pose((x, y + 0.1, z + 0.03), turn), time=fields.pop('time', 0.0))
    return there, Goal(waypoints=(end,), segments=(Segment(**fields),))


@pytest.mark.parametrize('choice', ['slow', 'refuse'])
def test_a_time_that_the_wire_cannot_carry_is_refused_and_not_proposed(make_cell, choice):
    cell, goal = beside_the_wrist(make_cell, time=3.0)
    with pytest.raises(
        TooFast,
        match=(
            r'points\[0\]\.time_from_start .* because of .*wrist_1_joint at 50 % of the segment\) '
            r'it takes \d{5} s, more than max_segment_time = 2147 s; move the path away'
        ),
    ):
        sent(cell, goal, singularity_margin_wrist=0.0, on_too_fast=choice)


@pytest.mark.parametrize('turn', [0.0, 0.5])
def test_blends_that_touch_leave_numbers_that_can_be_sent(cell, turn):
    """Nothing is left of the line between them, so a speed on it means nothing."""
    points = tuple(
        cell.point(0.02 * k, turn=(0.0, 0.0, (k % 2) * turn), time=float(k)) for k in (1, 2, 3)
    )
    made = sent(
        cell,
        Goal(
            waypoints=points,
            segments=(Segment(blend_radius=0.01), Segment(blend_radius=0.01), Segment()),
        ),
    )
    # A time on the wire ends where the arm would rest; their sum is the time of the goal.
    times = [segment.primitive.duration for segment in made.segments]
    assert sum(times) == pytest.approx(3.0)
    assert min(times) > 0.4
    assert made.segments[1].primitive.acceleration < 10.0


def test_a_line_that_turns_so_slowly_that_no_time_carries_it_is_refused(cell):
    goal = Goal(
        waypoints=(cell.point(0.1, turn=(0.0, 0.0, 0.5)),), segments=(Segment(velocity=1e-5),)
    )
    with pytest.raises(InvalidGoal, match='more than max_segment_time = 2147 s; raise velocity'):
        sent(cell, goal)


def test_the_time_of_an_optimized_line_is_that_of_its_way_not_of_its_worst_place(make_cell):
    """Beside a singularity the arm is slow for a moment; a movel is slow all the way."""
    cell, goal = beside_the_wrist(make_cell, type=TYPE.OPTIMIZED_LINEAR)
    made = sent(cell, goal, singularity_margin_wrist=0.0, max_tool_speed=0.0)
    wrist = max(
        abs(b - a) / speed
        for a, b, speed in zip(
            cell.state.actual_q,
            made.segments[0].joints,
            cell.arm.model.max_joint_speed,
            strict=True,
        )
    )
    assert wrist < 0.3 * made.duration < 2.0 * wrist


def test_a_line_is_no_faster_than_the_joints(cell):
    """Next to the axis of the base a slow tool needs a fast shoulder."""
    turn = Goal(waypoints=(cell.point(turn=(0.0, 0.0, 3.0), time=0.5),))
    with pytest.raises(InvalidGoal, match='joint speed limits'):
        sent(cell, turn)
    assert sent(cell, turn, on_too_fast='slow').duration > 0.9


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize('value', [1e-300, 1e-9, 10.0, 99.0, 1e6, 1e300])
@pytest.mark.parametrize('field', ['linear', 'angular', 'acceleration', 'time', 'position'])
def test_absurd_numbers_in_a_spline_are_refused_at_once_or_can_be_sent(cell, field, value):
    point = cell.point(0.02, time=1.0, twist=(0.01, 0.0, 0.0, 0.0, 0.0, 0.0))
    time = 1.0
    match field:
        case 'linear':
            point = replace(point, twist=(value, 0.0, 0.0, 0.0, 0.0, 0.0))
        case 'angular':
            point = replace(point, twist=(0.0, 0.0, 0.0, value, 0.0, 0.0))
        case 'acceleration':
            point = replace(point, acceleration=(value, 0.0, 0.0, value, 0.0, 0.0))
        case 'time':
            time = min(value, 2147.0)
            point = replace(point, time=time)
        case _:
            point = replace(point, pose=Pose((value, 0.0, 0.0), point.pose.quaternion))
    goal = Goal(waypoints=(point, cell.point(time=time + 1.0)), execution=ExecutionMode.SPLINE)
    begin = process_time()
    for options in (
        {},
        {'on_too_fast': 'slow', 'max_tool_speed': 0.0, 'max_approach_distance': 0.0},
    ):
        try:
            sent(cell, goal, self_collision='off', **options)
        except GoalRefused:
            assert value > 1e-8 or field in ('time', 'position')
    assert process_time() - begin < 3.0


def test_a_spline_that_turns_the_tool_more_than_once_around_names_its_point(cell):
    spin = (0.0, 0.0, 0.0, 0.0, 0.0, 50.0)
    goal = Goal(waypoints=(cell.point(time=1.0, twist=spin), cell.point(time=2.0)))
    with pytest.raises(InvalidGoal, match=r'points\[0\] .* imply a turn of 7\.\d+ rad'):
        sent(cell, goal)


def test_a_spline_of_kilometres_is_refused_before_it_is_looked_at(cell):
    wide = tuple(
        cell.point(0.01, time=1.0 + k, twist=(40.0, 0.0, 0.0, 0.0, 0.0, 0.0)) for k in range(2000)
    )
    goal = Goal(waypoints=(*wide, cell.point(time=2001.0)))
    begin = process_time()
    with pytest.raises(InvalidGoal, match=r'a detour of|its check needs'):
        sent(cell, goal)
    assert process_time() - begin < 3.0
