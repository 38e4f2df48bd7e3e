# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Stretches on which a plan is slower than asked, the reasons, and goals refused for them.

``test/acceptance/test_announced_speeds.py`` compares them with the robot's motion.
"""

from dataclasses import replace
from math import nan

import pytest

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.errors import InvalidGoal, JointLimitExceeded
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, multiply, Pose
from ur_cartesian_driver.motion.geometry.pose import quaternion_from_rotation_vector as rotated
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import Goal, Segment, SegmentType, Waypoint
from ur_cartesian_driver.motion.plan.slow_stretch import SlowCause, speed_advice
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.planning.stop_prediction import state_at_rest

ARM = Arm(robot_model('ur5e'))
Q = (0.0, -1.5708, 1.5708, -1.5708, -1.5708, 0.0)
START = ARM.forward(Q)
LINEAR, PROCESS, JOINT = SegmentType.LINEAR, SegmentType.PROCESS, SegmentType.JOINT


def at(x=0.0, y=0.0, z=0.0, turn=0.0):
    a, b, c = START.position
    return Pose((a + x, b + y, c + z), multiply(rotated((0.0, 0.0, turn)), START.quaternion))


def goal(*poses, segment, **fields):
    return Goal(
        waypoints=tuple(Waypoint(pose=pose) for pose in poses),
        segments=(segment,) * len(poses),
        **fields,
    )


def planned(of, q=Q, **options):
    return plan(of, state_at_rest(ARM, q, IDENTITY), ARM, PlanningOptions(**options))


def causes(of, **options):
    return [each.cause for each in planned(of, **options).find_slow_stretches()]


CORNER = at(y=0.1), at(x=0.1, y=0.1)
STEADY = Segment(type=PROCESS, velocity=0.05, blend_radius=0.01)


def test_a_stop_between_segments_is_one_stretch_with_its_place():
    first, stop, last = planned(
        goal(*CORNER, segment=Segment(velocity=0.1, acceleration=1.0))
    ).find_slow_stretches()
    assert (first.cause, stop.cause, last.cause) == (
        SlowCause.RAMP,
        SlowCause.STOP,
        SlowCause.RAMP,
    )
    # Up to 98 % of 0.1 m/s with 1 m/s^2 it takes 4.8 mm of the 100 mm.
    assert (stop.first, stop.last) == (0, 1)
    assert stop.first_fraction == pytest.approx(1.0 - 0.04802, abs=1e-5)
    assert stop.last_fraction == pytest.approx(0.04802, abs=1e-5)
    assert (stop.lowest, stop.asked) == (0.0, 0.1)
    assert stop.counts
    assert not first.counts


def test_process_with_blends_keeps_its_speed_between_the_ramps():
    of = goal(*CORNER, segment=STEADY)
    assert causes(of) == [SlowCause.RAMP, SlowCause.RAMP]
    report = planned(replace(of, min_speed_fraction=0.99)).report
    assert any('not known in the blends at point 0' in line for line in report)


@pytest.mark.parametrize(
    ('of', 'options', 'cause'),
    [
        (goal(*CORNER, segment=Segment(velocity=0.1)), {}, SlowCause.STOP),
        (goal(at(y=0.1), at(), segment=Segment(velocity=0.1)), {}, SlowCause.REVERSAL),
        (goal(at(y=0.002), segment=Segment(velocity=0.2)), {}, SlowCause.SHORT),
        (goal(at(y=0.1), segment=Segment(velocity=0.4)), {}, SlowCause.TOOL_LIMIT),
        (goal(at(y=0.01, turn=1.5), segment=Segment(velocity=0.1)), {}, SlowCause.TURN),
        (
            goal(*CORNER, segment=Segment(velocity=0.2, acceleration=0.5, blend_radius=0.01)),
            {},
            SlowCause.BLEND,
        ),
    ],
)
def test_the_cause_is_named_and_refused_on_demand(of, options, cause):
    assert cause in causes(of, **options)
    with pytest.raises(InvalidGoal, match=r'min_speed_fraction is 0\.9, but at point') as refusal:
        planned(replace(of, min_speed_fraction=0.9), **options)
    assert SlowCause(cause).value in str(refusal.value)
    assert any(cause.value in line for line in speed_advice(planned(of).find_slow_stretches()))


def test_the_acceleration_on_the_arc_of_a_blend_is_no_joint_limit():
    segment = Segment(type=PROCESS, velocity=0.2, blend_radius=0.005)
    of = replace(goal(*CORNER, segment=segment), min_speed_fraction=0.9)
    with pytest.raises(InvalidGoal, match='because of max_linear_acceleration = 1 m/s') as refusal:
        planned(of, max_linear_acceleration=1.0)
    assert SlowCause.ACCELERATION_LIMIT.value in str(refusal.value)


def test_the_acceleration_on_an_arc_is_no_joint_limit():
    segment = Segment(type=SegmentType.CIRCULAR, via=at(y=0.01, x=0.01), velocity=0.24)
    of = goal(at(y=0.02), segment=segment, min_speed_fraction=0.9)
    with pytest.raises(
        InvalidGoal,
        match=r'max_linear_acceleration = 1 m/s\^2 \(on an arc with a '
        r'radius of 10 mm\)',
    ) as refusal:
        planned(of, max_linear_acceleration=1.0)
    assert SlowCause.ACCELERATION_LIMIT.value in str(refusal.value)


def test_a_spline_slowed_by_the_acceleration_of_the_tool_is_not_advised_to_raise_its_speed():
    places = (0.02, 0.3), (0.04, 0.6), (0.07, 1.0), (0.09, 1.3), (0.11, 1.7)
    points = tuple(
        Waypoint(pose=at(y=y), time=time, twist=(0.0 if time == 1.7 else nan,) * 6)
        for y, time in places
    )
    of = Goal(waypoints=points, execution=ExecutionMode.SPLINE)
    found = planned(of, max_linear_acceleration=0.8, on_too_fast='slow', max_tool_speed=1.0)
    slow = [each for each in found.find_slow_stretches() if 'max_linear' in each.reason]
    assert {each.cause for each in slow} == {SlowCause.ACCELERATION_LIMIT}


def test_a_joint_limit_is_refused_as_one():
    q = (0.0, -1.2, 0.35, -0.7, -1.5708, 0.0)
    x, y, z = ARM.forward(q).position
    of = Goal(
        waypoints=(Waypoint(pose=Pose((x - 0.005, y, z), ARM.forward(q).quaternion)),),
        segments=(Segment(velocity=0.9, acceleration=50.0),),
    )
    assert SlowCause.JOINT_LIMIT in [
        each.cause for each in planned(of, q, max_tool_speed=2.0).find_slow_stretches()
    ]
    with pytest.raises(JointLimitExceeded, match='because of the joint speed limits'):
        planned(replace(of, min_speed_fraction=0.9), q, max_tool_speed=2.0)


def test_what_comes_before_and_after_a_joint_motion_is_a_ramp():
    of = replace(
        goal(at(y=0.1), at(y=0.1, z=0.1), at(z=0.1), segment=Segment(velocity=0.1)),
        segments=(Segment(velocity=0.1), Segment(type=JOINT), Segment(velocity=0.1)),
        min_speed_fraction=0.95,
    )
    assert set(causes(of)) == {SlowCause.RAMP}


def test_times_ask_for_their_mean_and_twists_for_less():
    times = (2.0, 3.0, 4.0, 6.0)
    poses = at(y=0.1), at(y=0.2), at(y=0.3), at(y=0.4)
    points = tuple(
        Waypoint(
            pose=pose, time=time, twist=(0.0, 0.1, 0.0, 0.0, 0.0, 0.0) if k < 3 else (0.0,) * 6
        )
        for k, (pose, time) in enumerate(zip(poses, times, strict=True))
    )
    of = Goal(waypoints=points, execution=ExecutionMode.SPLINE, min_speed_fraction=0.9)
    assert set(causes(of)) == {SlowCause.RAMP}
    stops = replace(of, waypoints=(points[0], replace(points[1], twist=(0.0,) * 6), *points[2:]))
    with pytest.raises(InvalidGoal, match='the twist of point 1 is 0'):
        planned(stops)
    slower = (0.0, 0.05, 0.0, 0.0, 0.0, 0.0)
    asked = replace(of, waypoints=(points[0], replace(points[1], twist=slower), *points[2:]))
    assert set(causes(asked)) == {SlowCause.RAMP}


def test_a_short_report_has_all_remarks_and_counts_what_it_leaves_out():
    made = planned(goal(*(at(y=0.002 * i) for i in range(1, 41)), segment=Segment()))
    whole, slow = made.report, [each.line for each in made.find_slow_stretches()]
    lines, remarks = list(whole[:40]), list(made.remarks)
    assert whole == (*lines, *remarks, *slow)
    assert len(slow) == 40
    assert made.short_report(80) == whole
    assert list(made.short_report(20)) == [
        *lines[:10],
        '(segments left out here: 30)',
        *remarks,
        *slow[:10],
        '(slow stretches left out here: 30)',
    ]
    assert list(made.short_report(78)) == [
        *lines[:39],
        '(segments left out here: 1)',
        *remarks,
        *slow[:39],
        '(slow stretches left out here: 1)',
    ]
