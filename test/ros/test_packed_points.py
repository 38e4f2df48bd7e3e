# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Goals in flat arrays mean the same as goals with points and segments."""

from array import array
from dataclasses import replace
from math import inf, nan, pi

from builtin_interfaces.msg import Duration
from geometry_msgs.msg import Accel, Point, Pose, Quaternion, Twist, Vector3
import numpy as np
import pytest

from ur_cartesian_driver.action import FollowCartesianTrajectory
from ur_cartesian_driver.motion.errors import ErrorCode, GoalRefused, InvalidGoal
from ur_cartesian_driver.motion.goal.goal import Posture, SegmentType
from ur_cartesian_driver.motion.goal.known_frames import Frames
from ur_cartesian_driver.msg import (
    CartesianPosture,
    CartesianTrajectoryPoint,
    MotionSegment,
    PackedPoints,
)
from ur_cartesian_driver.planning import check, PlanningOptions
from ur_cartesian_driver.ros.client import add_tf_prefix, load_goal
from ur_cartesian_driver.ros.messages.goal_conversion import (
    appended_points_from_message,
    goal_from_message,
)
from ur_cartesian_driver.ros.messages.packed_points import in_flat_arrays
from ur_cartesian_driver.srv import AppendPoints

TYPES = (MotionSegment.LINEAR, MotionSegment.JOINT, MotionSegment.CIRCULAR, MotionSegment.PROCESS)
JOINTS = ('shoulder_pan_joint', 'elbow_joint', 'wrist_2_joint')


def converted(message):
    return goal_from_message(message, Frames(), now=0)


def any_goal(seed):
    """Return a goal of the plain form in which every column may be used, or none."""
    rng = np.random.default_rng(seed)
    uses = iter(rng.random(10) < 0.6)
    n = int(rng.integers(1, 12))
    goal = FollowCartesianTrajectory.Goal(keep_open=bool(rng.random() < 0.5))
    goal.trajectory.header.frame_id = 'base'
    times, twists, accelerations, postures, segments, speeds, arcs, via_postures, radii, free = (
        uses
    )
    for i in range(n):
        point = CartesianTrajectoryPoint(pose=any_pose(rng))
        if times:
            point.time_from_start = Duration(sec=i, nanosec=int(rng.integers(1, 10**9)))
        if twists:
            point.twist = Twist(linear=any_vector(rng), angular=any_vector(rng))
        if accelerations:
            point.acceleration = Accel(linear=any_vector(rng), angular=any_vector(rng))
        if postures:
            point.posture = any_posture(rng)
        goal.trajectory.points.append(point)
        if not segments:
            continue
        segment = MotionSegment(type=int(rng.choice(TYPES)))
        if speeds:
            segment.velocity, segment.acceleration = map(float, rng.random(2))
        if radii:
            segment.blend_radius = float(rng.random())
        if free:
            segment.free_axis = int(rng.integers(0, 4))
            segment.free_min, segment.free_max = map(float, rng.random(2))
        if arcs and segment.type == MotionSegment.CIRCULAR:
            segment.via, segment.arc_mode = any_pose(rng), int(rng.integers(0, 2))
            segment.via_posture = any_posture(rng) if via_postures else CartesianPosture()
        goal.segments.append(segment)
    return goal


def any_vector(rng):
    x, y, z = map(float, rng.normal(size=3))
    return Vector3(x=nan if rng.random() < 0.2 else x, y=y, z=z)


def any_pose(rng):
    q = rng.normal(size=4)
    x, y, z, w = (q / np.linalg.norm(q)).tolist()
    a, b, c = rng.normal(size=3).tolist()
    return Pose(position=Point(x=a, y=b, z=c), orientation=Quaternion(x=x, y=y, z=z, w=w))


def any_posture(rng):
    names = [name for name in JOINTS if rng.random() < 0.5]
    return CartesianPosture(
        posture_joint_names=names,
        posture_joint_values=rng.uniform(-pi, pi, len(names)).tolist(),
    )


@pytest.mark.parametrize('seed', range(100))
def test_packing_changes_nothing(seed):
    message = any_goal(seed)
    packed = in_flat_arrays(message)
    assert packed is not message
    assert not packed.trajectory.points
    assert not packed.segments
    a, b = converted(message), converted(packed)
    assert [without_order(point, 'posture') for point in a.waypoints] == [
        without_order(point, 'posture') for point in b.waypoints
    ]
    assert [without_order(segment, 'via_posture') for segment in a.segments] == [
        without_order(segment, 'via_posture') for segment in b.segments
    ]
    assert replace(a, waypoints=b.waypoints, segments=b.segments) == b


def without_order(row, field):
    """Return a point or segment as a text: NaN equals itself, and joints are sorted by name."""
    posture = getattr(row, field)
    pairs = sorted(zip(posture.names, posture.values, strict=True))
    return f'{replace(row, **{field: Posture()})} {pairs}'


def packed_goal(**columns):
    goal = FollowCartesianTrajectory.Goal()
    goal.packed = PackedPoints(
        **{'poses': [0.1, 0.2, 0.3, 0.0, 0.0, 0.0, 1.0, 0.2, 0.2, 0.3, 0.0, 0.0, 0.0, 1.0]}
        | columns
    )
    return goal


def test_columns_left_empty_are_the_defaults():
    goal = converted(packed_goal())
    assert [point.pose.position for point in goal.waypoints] == [(0.1, 0.2, 0.3), (0.2, 0.2, 0.3)]
    assert not goal.segments
    assert not goal.waypoints.times.any()
    goal = converted(packed_goal(blend_radii=[0.01, 0.0]))
    assert [segment.type for segment in goal.segments] == [SegmentType.AUTO] * 2
    assert [segment.via for segment in goal.segments] == [None, None]


def test_nan_is_no_preference_for_a_joint():
    goal = converted(
        packed_goal(
            posture_joint_names=['elbow_joint', 'wrist_1_joint'], postures=[nan, 1.0, nan, nan]
        )
    )
    assert {row: p.names for row, p in goal.waypoints.postures.items()} == {0: ('wrist_1_joint',)}
    assert goal.waypoints[0].posture.values == (1.0,)


@pytest.mark.parametrize(
    ('columns', 'sentence'),
    [
        ({'poses': [0.0] * 13}, r'packed\.poses has 13 numbers, but each point needs 7'),
        ({'poses': [], 'times': [1.0]}, r'packed\.poses has 0 numbers'),
        ({'times': [1.0]}, r'packed\.times has 1 numbers for 2 points; give 2, or none'),
        ({'twists': [0.0] * 7}, r'packed\.twists has 7 numbers for 2 points; give 6 for each'),
        ({'vias': [0.0] * 7}, r'packed\.vias has 7 numbers for 2 points'),
        ({'types': [1]}, r'packed\.types has 1 numbers'),
        ({'types': [1, 9]}, r'packed\.types\[1\] is 9; it must be one of AUTO \(0\)'),
        ({'arc_modes': [2, 0]}, r'packed\.arc_modes\[0\] is 2'),
        ({'free_axes': [0, 4]}, r'packed\.free_axes\[1\] is 4; it must be one of NONE \(0\)'),
        ({'free_minima': [0.0]}, r'packed\.free_minima has 1 numbers for 2 points'),
        ({'postures': [1.0, 2.0]}, r'packed\.postures has numbers, but posture_joint_names'),
        (
            {'postures': [1.0], 'posture_joint_names': ['elbow_joint']},
            r'packed\.postures has 1 numbers for 2 points',
        ),
    ],
)
def test_arrays_that_do_not_fit_are_refused_by_name(columns, sentence):
    with pytest.raises(InvalidGoal, match=sentence):
        converted(packed_goal(**columns))


def test_one_form_or_the_other():
    both = packed_goal()
    both.trajectory.points.append(CartesianTrajectoryPoint())
    with pytest.raises(InvalidGoal, match=r'packed is given beside trajectory\.points; use one'):
        converted(both)
    both = packed_goal()
    both.segments.append(MotionSegment())
    with pytest.raises(InvalidGoal, match=r'packed is given beside segments'):
        converted(both)
    request = AppendPoints.Request(packed=packed_goal().packed)
    assert len(appended_points_from_message(request).waypoints) == 2
    request.points.append(CartesianTrajectoryPoint())
    with pytest.raises(InvalidGoal, match=r'packed is given beside points'):
        appended_points_from_message(request)


@pytest.mark.parametrize(
    ('columns', 'code', 'sentence'),
    [
        ({'times': [1.0, nan]}, ErrorCode.INVALID_GOAL, r'points\[1\]\.time_from_start contains'),
        ({'velocities': [0.1, inf]}, ErrorCode.INVALID_GOAL, r'segments\[1\]\.velocity contains'),
        (
            {'postures': [1.0, 1.0], 'posture_joint_names': ['knee']},
            ErrorCode.INVALID_JOINTS,
            r"points\[0\]\.posture\.posture_joint_names\[0\] is 'knee'",
        ),
        (
            {'postures': [1.0, inf], 'posture_joint_names': ['elbow_joint']},
            ErrorCode.INVALID_JOINTS,
            r'points\[1\]\.posture',
        ),
    ],
)
def test_the_same_rules_hold_and_name_point_and_field(columns, code, sentence):
    with pytest.raises(GoalRefused, match=sentence) as refused:
        check(converted(packed_goal(**columns)), PlanningOptions())
    assert refused.value.code is code


def test_what_cannot_be_packed_is_sent_as_it_is():
    jerky = any_goal(1)
    jerky.trajectory.points[0].jerk.linear.x = 1.0
    unknown = any_goal(1)
    unknown.segments = [MotionSegment(type=99)] * len(unknown.trajectory.points)
    unequal = any_goal(1)
    unequal.trajectory.points[0].posture = CartesianPosture(posture_joint_names=['elbow_joint'])
    for goal in (jerky, unknown, unequal, packed_goal()):
        assert in_flat_arrays(goal) is goal


def test_a_packed_goal_can_be_written_in_yaml_and_gets_a_prefix():
    goal = load_goal(
        'packed: {poses: [0.1, 0, 0, 0, 0, 0, 1], types: [1], postures: [1],\n'
        '  posture_joint_names: [elbow_joint]}'
    )
    assert goal.packed.poses == array('d', [0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
    assert add_tf_prefix(goal, 'left_').packed.posture_joint_names == ['left_elbow_joint']
