# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
from dataclasses import replace
from math import inf, isnan, nan

from builtin_interfaces.msg import Duration, Time
from geometry_msgs.msg import Point, Quaternion, Twist, Vector3
from hypothesis import given
from hypothesis import strategies as st
import pytest

from ur_cartesian_driver.action import FollowCartesianTrajectory
from ur_cartesian_driver.motion.errors import (
    ErrorCode,
    GoalRefused,
    InvalidGoal,
)
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, Pose
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import ArcMode, OutputKind, SafeOutput, SegmentType
from ur_cartesian_driver.motion.goal.known_frames import ArmSnapshot, Frames
from ur_cartesian_driver.motion.state.io_signals import AnalogDomain
from ur_cartesian_driver.msg import (
    CartesianPosture,
    CartesianTrajectoryPoint,
    IOCommand,
    MotionSegment,
)
from ur_cartesian_driver.msg import SafeOutput as SafeOutputMessage
from ur_cartesian_driver.planning import check, PlanningOptions
from ur_cartesian_driver.ros.message_fields import seconds
from ur_cartesian_driver.ros.messages.goal_conversion import (
    goal_from_message,
    resolve_frames,
)
from ur_cartesian_driver.ros.tf.tf_lookup import TransformLookup

NOW = 1_800_000_000_123_456_789


def point(**fields):
    message = CartesianTrajectoryPoint(**fields)
    message.pose.position = Point(x=-0.4, y=-0.1, z=0.4)
    return message


def goal(*points, **fields):
    message = FollowCartesianTrajectory.Goal(**fields)
    message.trajectory.points = list(points)
    return message


def converted(message, **options):
    return goal_from_message(message, Frames(), **{'now': NOW, **options})


def test_every_field_of_a_point_arrives():
    message = point(
        time_from_start=Duration(sec=3, nanosec=250_000_000),
        twist=Twist(linear=Vector3(x=1.0, y=2.0, z=3.0), angular=Vector3(x=4.0, y=5.0, z=6.0)),
        posture=CartesianPosture(posture_joint_names=['elbow_joint'], posture_joint_values=[1.5]),
    )
    message.pose.orientation = Quaternion(x=0.1, y=0.2, z=0.3, w=0.4)
    message.acceleration.angular.z = 7.0
    message.jerk.linear.x = 8.0
    (waypoint,) = converted(goal(message)).waypoints
    assert waypoint.time == 3.25
    assert waypoint.pose == Pose((-0.4, -0.1, 0.4), (0.1, 0.2, 0.3, 0.4))
    assert waypoint.twist == (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    assert waypoint.acceleration == (0.0, 0.0, 0.0, 0.0, 0.0, 7.0)
    assert waypoint.jerk == (8.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    assert waypoint.posture.names == ('elbow_joint',)
    assert waypoint.posture.values == (1.5,)


def test_every_field_of_a_segment_arrives():
    message = MotionSegment(type=3, blend_radius=0.01, velocity=0.2, acceleration=0.3, arc_mode=1)
    message.via.position.x = 0.5
    message.via_posture.posture_joint_names = ['wrist_1_joint']
    message.via_posture.posture_joint_values = [0.25]
    (segment,) = converted(goal(point(), segments=[message])).segments
    assert segment.type is SegmentType.CIRCULAR
    assert (segment.blend_radius, segment.velocity, segment.acceleration) == (0.01, 0.2, 0.3)
    assert segment.via == Pose((0.5, 0.0, 0.0))
    assert segment.via_posture.names == ('wrist_1_joint',)
    assert segment.arc_mode is ArcMode.FIXED


def test_every_other_field_of_a_goal_arrives():
    message = goal(
        point(),
        execution=1,
        keep_open=True,
        goal_time_tolerance=Duration(sec=-1, nanosec=500_000_000),
        io_commands=[
            IOCommand(point_index=0, output=2, pin=1, value=1.0, offset=Duration(nanosec=1)),
            IOCommand(output=3, analog_domain=1),
        ],
        safe_outputs=[
            SafeOutputMessage(output=3, pin=1, value=0.5, analog_domain=1, restore=True)
        ],
    )
    message.path_tolerance.position_error.x = 0.1
    message.goal_tolerance.orientation_error.z = -1.0
    message.goal_tolerance.twist_error.angular.y = 0.2
    result = converted(message)
    assert result.execution is ExecutionMode.PRIMITIVES
    assert result.keep_open
    assert result.goal_time_tolerance == -0.5
    assert result.path_tolerance.position == (0.1, 0.0, 0.0)
    assert result.goal_tolerance.orientation == (0.0, 0.0, -1.0)
    assert result.goal_tolerance.twist == (0.0, 0.0, 0.0, 0.0, 0.2, 0.0)
    command, analog = result.io_commands
    assert (command.output, command.pin, command.value) == (OutputKind.TOOL_DIGITAL, 1, 1.0)
    assert command.offset == 1e-9
    assert analog.domain is AnalogDomain.VOLTAGE
    assert result.safe_outputs == (
        SafeOutput(
            output=OutputKind.STANDARD_ANALOG,
            pin=1,
            value=0.5,
            domain=AnalogDomain.VOLTAGE,
            restore=True,
        ),
    )


def test_a_plain_goal_passes_the_checks_of_planning():
    check(converted(goal(point())), PlanningOptions())


def test_a_via_that_is_left_alone_does_not_count():
    assert converted(goal(point(), segments=[MotionSegment()])).segments[0].via is None


def test_an_arc_has_its_via_even_if_it_is_the_identity():
    assert converted(goal(point(), segments=[MotionSegment(type=3)])).segments[0].via == IDENTITY


@given(st.integers(-2148, 2147), st.integers(0, 999_999_999))
def test_times_keep_their_nanoseconds(sec, nanosec):
    # 2147 s are the longest segment; a double holds nanoseconds for 104 days.
    assert round(seconds(Duration(sec=sec, nanosec=nanosec)) * 10**9) == sec * 10**9 + nanosec


@pytest.mark.parametrize(
    ('stamp', 'age'),
    [
        (Time(), None),
        (Time(sec=1_800_000_000, nanosec=123_456_789), 0.0),
        (Time(sec=1_799_999_999, nanosec=123_456_788), 1.000000001),
        (Time(sec=1_800_000_010, nanosec=123_456_789), -10.0),
    ],
)
def test_the_age_of_a_stamp_is_exact(stamp, age):
    message = goal(point())
    message.trajectory.header.stamp = stamp
    assert converted(message).age == age


def test_a_time_tolerance_of_zero_is_the_default():
    assert converted(goal(point()), time_tolerance=2.5).goal_time_tolerance == 2.5


@pytest.mark.parametrize(
    ('fields', 'sentence'),
    [
        ({'execution': 4}, r'^execution is 4; it must be one of AUTO \(0\), PRIMITIVES \(1\)'),
        (
            {'segments': [MotionSegment(), MotionSegment(type=9)]},
            r'^segments\[1\]\.type is 9; .*AUTO',
        ),
        ({'segments': [MotionSegment(arc_mode=2)]}, r'^segments\[0\]\.arc_mode is 2; '),
        ({'io_commands': [IOCommand(output=4)]}, r'^io_commands\[0\]\.output is 4; '),
        (
            {'io_commands': [IOCommand(analog_domain=2)]},
            r'^io_commands\[0\]\.analog_domain is 2; ',
        ),
    ],
)
def test_numbers_that_stand_for_nothing_are_refused_by_field(fields, sentence):
    with pytest.raises(InvalidGoal, match=sentence):
        converted(goal(point(), **fields))


def test_frames_are_looked_up():
    message = goal(point())
    message.trajectory.header.frame_id = 'base_link'
    assert converted(message).T_base_frame.apply((1.0, 0.0, 0.0)) == pytest.approx((-1.0, 0, 0))
    message.trajectory.header.frame_id = 'moon'
    with pytest.raises(InvalidGoal, match='"moon"'):
        converted(message)


def test_the_controlled_frame_is_where_its_name_says():
    message = goal(point())
    message.trajectory.controlled_frame = 'tool0'
    converted_goal = converted(message)
    assert converted_goal.controlled_frame == 'tool0'
    assert converted_goal.T_flange_controlled == IDENTITY
    message.trajectory.controlled_frame = 'tool0_controller'
    converted_goal = converted(message)
    assert converted_goal.controlled_frame == ''
    assert converted_goal.T_flange_controlled is None
    message.trajectory.controlled_frame = 'moon'
    with pytest.raises(InvalidGoal, match='controlled_frame is "moon"'):
        converted(message)


def test_a_goal_on_the_arm_goes_with_it_until_it_is_planned():
    message = goal(point())
    message.trajectory.header.frame_id = 'tool0'
    first, then = (ArmSnapshot(Pose((0.1, 0.2, z)), IDENTITY) for z in (0.3, 0.4))
    before = converted(message, snapshot=first)
    assert before.T_base_frame == first.T_base_flange
    after = resolve_frames(before, message.trajectory, Frames(), now=NOW, snapshot=then)
    assert after == replace(before, T_base_frame=then.T_base_flange)


@pytest.mark.parametrize(
    ('sec', 'asked'), [(0, 0), (1_799_999_999, 1_799_999_999 * 10**9), (1_800_000_009, 0)]
)
def test_frames_of_tf_are_looked_up_at_the_stamp_once_it_has_come(sec, asked):
    class Recorder(TransformLookup):
        at = -1

        def __init__(self):
            pass  # no buffer

        def T_target_source(self, field, target, source, at=0):
            self.at = at
            return IDENTITY

    recorder, message = Recorder(), goal(point())
    message.trajectory.header.frame_id = 'camera'
    message.trajectory.header.stamp.sec = sec
    goal_from_message(message, Frames().with_transforms(recorder), now=NOW)
    assert recorder.at == asked


def _nan_position(message):
    message.trajectory.points[1].pose.position.y = nan


def _infinite_twist(message):
    message.trajectory.points[0].twist.linear.z = inf


def _zero_quaternion(message):
    message.trajectory.points[1].pose.orientation.w = 0.0


def _times_go_back(message):
    message.trajectory.points[0].time_from_start.sec = 2
    message.trajectory.points[1].time_from_start.sec = 1


def _no_points(message):
    message.trajectory.points = []


def _one_segment(message):
    message.segments = [MotionSegment()]


def _unequal_posture(message):
    message.trajectory.points[1].posture.posture_joint_names = ['elbow_joint', 'wrist_1_joint']
    message.trajectory.points[1].posture.posture_joint_values = [1.0]


def _unknown_joint(message):
    message.trajectory.points[1].posture.posture_joint_names = ['knee_joint']
    message.trajectory.points[1].posture.posture_joint_values = [1.0]


def _old_stamp(message):
    message.trajectory.header.stamp = Time(sec=1_799_999_990)


def _via_without_arc(message):
    message.segments = [MotionSegment(), MotionSegment()]
    message.segments[1].via.position.x = 0.1


@pytest.mark.parametrize(
    ('spoil', 'code', 'sentence'),
    [
        (_nan_position, ErrorCode.INVALID_GOAL, r'points\[1\]\.pose\.position'),
        (_infinite_twist, ErrorCode.INVALID_GOAL, r'points\[0\]\.twist'),
        (_zero_quaternion, ErrorCode.INVALID_GOAL, r'points\[1\]\.pose\.orientation is zero'),
        (_times_go_back, ErrorCode.INVALID_GOAL, r'points\[1\]\.time_from_start'),
        (_no_points, ErrorCode.INVALID_GOAL, r'trajectory\.points is empty'),
        (_one_segment, ErrorCode.INVALID_GOAL, 'segments has 1 entries for 2 points'),
        (
            _unequal_posture,
            ErrorCode.INVALID_JOINTS,
            r'points\[1\]\.posture has 2 joint names but 1',
        ),
        (_unknown_joint, ErrorCode.INVALID_JOINTS, 'knee_joint'),
        (_old_stamp, ErrorCode.OLD_HEADER_TIMESTAMP, 'header.stamp is 10.123 s old'),
        (_via_without_arc, ErrorCode.INVALID_GOAL, r'segments\[1\]\.via'),
    ],
)
def test_malformed_messages_end_with_the_code_and_the_field(spoil, code, sentence):
    message = goal(point(), point())
    message.trajectory.points[1].pose.position.x = -0.5
    spoil(message)
    with pytest.raises(GoalRefused, match=sentence) as refusal:
        check(converted(message), PlanningOptions())
    assert refusal.value.code is code


def test_nan_is_not_lost_on_the_way():
    message = goal(point())
    message.trajectory.points[0].pose.position.x = nan
    assert isnan(converted(message).waypoints[0].pose.position[0])
