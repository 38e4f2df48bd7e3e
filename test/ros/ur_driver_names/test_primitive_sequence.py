# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Sequences of motion primitives as goals, without ROS."""

from math import isnan, nan
from types import SimpleNamespace

import pytest

from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.goal import SegmentType
from ur_cartesian_driver.ros.message_fields import pose_message
from ur_cartesian_driver.ros.ur_driver_names.primitive_sequence import (
    CIRCULAR_CARTESIAN,
    goal_of_sequence,
    LINEAR_CARTESIAN,
    LINEAR_JOINT,
)

A, B = Pose((0.1, 0.2, 0.3), (1.0, 0.0, 0.0, 0.0)), Pose((0.4, 0.5, 0.6), (0.0, 1.0, 0.0, 0.0))
Q = (0.1, -1.5, 1.6, -1.7, -1.8, 0.2)
SPEED = {'velocity': 0.5, 'acceleration': 1.5}


def stamped(pose, frame=''):
    return SimpleNamespace(pose=pose_message(pose), header=SimpleNamespace(frame_id=frame))


def primitive(kind, *poses, q=(), blend=0.0, frame='', arguments=None):
    """Return a MotionPrimitive; its arguments are a mapping, or pairs."""
    pairs = SPEED if arguments is None else arguments
    return SimpleNamespace(
        type=kind,
        poses=[stamped(pose, frame) for pose in poses],
        joint_positions=list(q),
        blend_radius=blend,
        additional_arguments=[
            SimpleNamespace(name=name, value=value) for name, value in dict(pairs).items()
        ],
    )


def line(**fields):
    return primitive(LINEAR_CARTESIAN, A, **fields)


def goal(*motions, tf_prefix=''):
    return goal_of_sequence(motions, tf_prefix)


def test_a_line():
    made = goal(line(blend=0.02))
    (point,), (segment,) = made.waypoints, made.segments
    assert (point.pose, point.time) == (A, 0.0)
    assert segment.type is SegmentType.LINEAR
    assert (segment.velocity, segment.acceleration, segment.blend_radius) == (0.5, 1.5, 0.02)


def test_an_arc_has_its_goal_first():
    made = goal(primitive(CIRCULAR_CARTESIAN, A, B))
    assert made.waypoints[0].pose == A
    assert made.segments[0].type is SegmentType.CIRCULAR
    assert made.segments[0].via == B


def test_a_joint_motion_to_joint_positions():
    made = goal(primitive(LINEAR_JOINT, q=Q), tf_prefix='left_')
    (point,) = made.waypoints
    assert all(map(isnan, point.pose.row()))
    assert point.posture.names == tuple(f'left_{name}' for name in JOINT_NAMES)
    assert point.posture.values == Q
    assert made.segments[0].type is SegmentType.JOINT


def test_a_joint_motion_to_a_pose():
    made = goal(primitive(LINEAR_JOINT, A))
    assert (made.waypoints[0].pose, made.segments[0].type) == (A, SegmentType.JOINT)
    assert not made.waypoints[0].posture


def test_a_line_to_joint_positions():
    made = goal(primitive(LINEAR_CARTESIAN, q=Q))
    assert all(map(isnan, made.waypoints[0].pose.row()))
    assert made.waypoints[0].posture.values == Q
    assert made.segments[0].type is SegmentType.LINEAR


def test_move_times_add_up_and_replace_speeds():
    made = goal(
        line(arguments={**SPEED, 'move_time': 2.0}),
        primitive(LINEAR_JOINT, q=Q, arguments={'move_time': 1.5}),
    )
    assert [point.time for point in made.waypoints] == [2.0, 3.5]
    assert {segment.velocity for segment in made.segments} == {0.0}
    assert {segment.acceleration for segment in made.segments} == {0.0}


def test_a_move_time_of_0_does_not_count():
    made = goal(line(arguments={**SPEED, 'move_time': 0.0}))
    assert (made.waypoints[0].time, made.segments[0].velocity) == (0.0, 0.5)


def test_an_arc_goes_by_its_speed_if_it_has_one():
    made = goal(primitive(CIRCULAR_CARTESIAN, A, B, arguments={**SPEED, 'move_time': 2.0}))
    assert (made.waypoints[0].time, made.segments[0].velocity) == (0.0, 0.5)
    made = goal(primitive(CIRCULAR_CARTESIAN, A, B, arguments={'move_time': 2.0}))
    assert (made.waypoints[0].time, made.segments[0].velocity) == (2.0, 0.0)


@pytest.mark.parametrize(
    ('frames', 'prefix', 'expected'),
    [
        (('', ''), '', ''),
        (('base', ''), '', ''),
        (('base_link', 'base_link'), '', 'base_link'),
        (('', 'left_base'), 'left_', ''),
        (('table', 'table'), 'left_', 'table'),
    ],
)
def test_the_frame_is_that_of_all_poses(frames, prefix, expected):
    motions = [line(frame=frame) for frame in frames]
    motions.insert(1, primitive(LINEAR_JOINT, q=Q))
    assert goal(*motions, tf_prefix=prefix).frame_id == expected


NO_SPEED = 'gives neither a velocity and an acceleration nor a move_time'


@pytest.mark.parametrize(
    ('second', 'text'),
    [
        (primitive(-1, A), r'\[1\]\.type is -1; use one of LINEAR_JOINT \(0\), LINEAR_CART'),
        (primitive(66), r'\[1\]\.type is 66'),
        (primitive(LINEAR_JOINT, q=Q[:5]), r'\[1\]\.joint_positions has 5 values'),
        (primitive(LINEAR_JOINT), r'\[1\]\.poses has 0 entries, .* or joint_positions'),
        (primitive(LINEAR_JOINT, A, q=Q), r'\[1\]\.joint_positions is given, and poses as well'),
        (primitive(CIRCULAR_CARTESIAN, A, B, q=Q), r'\[1\]\.joint_positions is given, and'),
        (primitive(CIRCULAR_CARTESIAN, q=Q), r'\[1\]\.poses has 0 entries'),
        (primitive(LINEAR_CARTESIAN, A, B), r'\[1\]\.poses has 2 entries'),
        (primitive(CIRCULAR_CARTESIAN, A), r'\[1\]\.poses has 1 entries, .* then the via'),
        (line(arguments={'speed': 0.1}), r"\[1\]\.additional_arguments 'speed' is unknown; use"),
        (line(arguments={'velocity': -0.1}), r"\[1\]\.additional_arguments 'velocity' is -0\.1,"),
        (line(arguments={'move_time': nan}), r"\[1\]\.additional_arguments 'move_time' is nan,"),
        (line(arguments={}), rf'\[1\]\.additional_arguments {NO_SPEED}'),
        (line(arguments={'velocity': 0.1}), NO_SPEED),
        (line(arguments={**SPEED, 'acceleration': 0.0}), NO_SPEED),
        (line(frame='table'), r"\[1\]\.poses\[0\]\.header\.frame_id is 'table', .* in 'base';"),
    ],
)
def test_what_cannot_be_done_is_refused(second, text):
    with pytest.raises(InvalidGoal, match=r'^trajectory\.motions.*' + text):
        goal(line(), second)


def test_an_empty_sequence_is_refused():
    with pytest.raises(InvalidGoal, match='motions is empty'):
        goal()


def test_a_speed_after_a_time_is_refused():
    timed = line(arguments={'move_time': 2.0})
    with pytest.raises(InvalidGoal, match='primitive 0 has a move_time and primitive 1 a speed'):
        goal(timed, line())
    with pytest.raises(InvalidGoal, match='primitive 2 has a move_time and primitive 0 a speed'):
        goal(line(), line(), timed)


def test_an_argument_that_is_given_twice_is_refused():
    motion = line()
    motion.additional_arguments.append(SimpleNamespace(name='velocity', value=0.1))
    with pytest.raises(InvalidGoal, match="'velocity' is given twice"):
        goal(motion)


def test_what_to_do_about_an_arc_among_times_is_said():
    both = {**SPEED, 'move_time': 2.0}
    arc = primitive(CIRCULAR_CARTESIAN, A, B, arguments=both)
    with pytest.raises(InvalidGoal, match='an arc that has a velocity and an acceleration'):
        goal(line(arguments=both), arc)


def test_poses_too_many_are_refused_with_their_number():
    with pytest.raises(InvalidGoal, match='takes one; give just one'):
        goal(primitive(LINEAR_CARTESIAN, A, B))
