# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
from dataclasses import replace
from math import cos, inf, isnan, pi, sin, sqrt

from builtin_interfaces.msg import Time
from hypothesis import given
from hypothesis import strategies as st
import pytest

from ur_cartesian_driver.driver import ConnectionState, ConnectionStatus
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.events import Outcome, Progress, Pulse
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, Pose, pose_error
from ur_cartesian_driver.motion.goal.goal import OutputKind
from ur_cartesian_driver.motion.goal.known_frames import Frames
from ur_cartesian_driver.motion.state.rtde_state import RobotMode, RobotState, SafetyMode
from ur_cartesian_driver.msg import DriverStatus
from ur_cartesian_driver.ros.message_fields import duration_message, seconds
from ur_cartesian_driver.ros.messages.action_messages import (
    feedback_message,
    FeedbackFrame,
    result_message,
)
from ur_cartesian_driver.ros.messages.state_messages import (
    joint_state_message,
    pulse_message,
    status_message,
    tcp_pose_message,
)

STAMP = Time(sec=5, nanosec=6)
NAMES = tuple('abcdef')
FRAME = FeedbackFrame(
    frame_id='base', controlled_frame='tool0_controller', T_frame_base=IDENTITY, joint_names=NAMES
)
PROGRESS = Progress(
    waypoint=3,
    fraction=0.25,
    desired_pose=Pose((0.5, 0.2, 0.3)),
    desired_twist=(0.1, 0.0, 0.0, 0.0, 0.0, 0.2),
    actual_pose=Pose((0.4, 0.2, 0.3)),
    actual_twist=(0.05, 0.0, 0.0, 0.0, 0.0, 0.0),
    actual_q=(1.0, 2.0, 3.0, 4.0, 5.0, 6.0),
    time=1.5,
    time_remaining=6.0,
    speed_scaling=0.5,
    points_received=7,
    buffered=0.125,
)
angles = st.floats(-pi, pi)


def about_z(angle):
    return Pose((0.0, 0.0, 0.0), (0.0, 0.0, sin(angle / 2), cos(angle / 2)))


def vector(v):
    return (v.x, v.y, v.z)


def test_feedback_says_where_when_and_how_far():
    message = feedback_message(PROGRESS, FRAME, STAMP)
    assert message.header.stamp == STAMP
    assert message.header.frame_id == 'base'
    assert message.controlled_frame == 'tool0_controller'
    assert seconds(message.desired.time_from_start) == 1.5
    assert vector(message.desired.pose.position) == (0.5, 0.2, 0.3)
    assert vector(message.actual.pose.position) == (0.4, 0.2, 0.3)
    assert vector(message.error.pose.position) == pytest.approx((0.1, 0.0, 0.0))
    assert vector(message.error.twist.linear) == pytest.approx((0.05, 0.0, 0.0))
    assert vector(message.error.twist.angular) == pytest.approx((0.0, 0.0, 0.2))
    assert message.actual.posture.posture_joint_names == list(NAMES)
    assert list(message.actual.posture.posture_joint_values) == [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    assert message.point_index == 3
    assert message.progress == 0.25
    assert message.speed_scaling == 0.5
    assert message.points_received == 7
    assert seconds(message.buffered) == 0.125


def test_the_time_that_remains_is_planned_time_also_while_the_arm_stands():
    assert seconds(feedback_message(PROGRESS, FRAME, STAMP).time_remaining) == 6.0


def test_what_nobody_knows_is_nan():
    message = feedback_message(PROGRESS, FRAME, STAMP)
    for point in (message.desired, message.actual, message.error):
        assert all(map(isnan, vector(point.acceleration.linear)))
        assert all(map(isnan, vector(point.jerk.angular)))
    assert isnan(message.lag)


def test_accelerations_are_reported_where_the_robot_does():
    progress = replace(
        PROGRESS,
        desired_acceleration=(1.0, 2.0, 3.0, 4.0, 5.0, 6.0),
        actual_acceleration=(0.5,) * 6,
    )
    frame = replace(
        FRAME, frame_id='base_link', T_frame_base=Frames().T_base_frame('base_link').inverse()
    )
    message = feedback_message(progress, frame, STAMP)
    assert vector(message.desired.acceleration.linear) == pytest.approx((-1.0, -2.0, 3.0))
    assert vector(message.desired.acceleration.angular) == pytest.approx((-4.0, -5.0, 6.0))
    assert vector(message.actual.acceleration.linear) == pytest.approx((-0.5, -0.5, 0.5))
    assert vector(message.error.acceleration.angular) == pytest.approx((-3.5, -4.5, 5.5))
    half = feedback_message(replace(progress, actual_acceleration=None), frame, STAMP)
    assert all(map(isnan, vector(half.error.acceleration.linear)))
    assert not any(map(isnan, vector(half.desired.acceleration.linear)))


def test_feedback_comes_in_the_frame_of_the_goal():
    frame = replace(
        FRAME, frame_id='base_link', T_frame_base=Frames().T_base_frame('base_link').inverse()
    )
    message = feedback_message(PROGRESS, frame, STAMP)
    assert vector(message.actual.pose.position) == pytest.approx((-0.4, -0.2, 0.3))
    assert vector(message.actual.twist.linear) == pytest.approx((-0.05, 0.0, 0.0))
    assert vector(message.error.pose.position) == pytest.approx((-0.1, 0.0, 0.0))
    assert vector(message.desired.twist.angular) == pytest.approx((0.0, 0.0, 0.2))


@given(angles, angles)
def test_the_orientation_error_leads_from_actual_to_desired_the_short_way(a, b):
    desired, actual = about_z(a), about_z(b)
    error = pose_error(desired, actual)
    assert error.quaternion[3] >= 0.0
    assert (actual @ Pose((0.0, 0.0, 0.0), error.quaternion)).angle_to(desired) < 1e-7


def test_the_orientation_error_is_in_the_axes_of_the_actual_frame():
    actual = Pose((0.0, 0.0, 0.0), (sqrt(0.5), 0.0, 0.0, sqrt(0.5)))  # its y is up
    error = pose_error(about_z(0.1) @ actual, actual)
    assert error.quaternion == pytest.approx((0.0, sin(0.05), 0.0, cos(0.05)))


@given(st.floats(-1e6, 1e6))
def test_durations_are_right_to_a_nanosecond(time):
    message = duration_message(time)
    assert 0 <= message.nanosec < 10**9
    assert abs(seconds(message) - time) <= 0.6e-9


def test_an_endless_duration_is_the_longest_there_is():
    assert duration_message(inf).sec == 2**31 - 1


def test_a_result_carries_code_sentence_and_report():
    message = result_message(
        Outcome(code=ErrorCode.UNREACHABLE, text='Too far.', report=('one', 'two'))
    )
    assert (message.error_code, message.error_string) == (-7, 'Too far.')
    assert message.report == ['one', 'two']


STATE = RobotState(
    timestamp=1.0,
    actual_q=(1.0, 2.0, 3.0, 4.0, 5.0, 6.0),
    actual_qd=(0.1, 0.2, 0.3, 0.4, 0.5, 0.6),
    actual_tcp_pose=Pose((1.0, 2.0, 3.0)),
    robot_mode=RobotMode.IDLE,
    safety_mode=SafetyMode.PROTECTIVE_STOP,
    effective_speed=0.75,
)


def test_the_robot_state_becomes_joint_states_and_a_pose():
    joints = joint_state_message(STATE, NAMES, STAMP)
    assert joints.name == list(NAMES)
    assert list(joints.position) == [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    assert list(joints.velocity) == [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]
    pose = tcp_pose_message(STATE, 'left_base', STAMP)
    assert pose.header.frame_id == 'left_base'
    assert vector(pose.pose.position) == (1.0, 2.0, 3.0)


def test_the_status_joins_connection_and_modes():
    message = status_message(
        ConnectionStatus(state=ConnectionState.STOPPED, message='Unlock it.', robot_model='ur5e'),
        STATE,
        STAMP,
    )
    assert message.state == DriverStatus.STOPPED
    assert message.message == 'Unlock it.'
    assert message.robot_model == 'ur5e'
    assert message.robot_mode == DriverStatus.ROBOT_MODE_IDLE
    assert message.safety_mode == DriverStatus.SAFETY_MODE_PROTECTIVE_STOP
    assert message.speed_scaling == 0.75


def test_the_status_says_who_slows_the_running_goal():
    def slowed(slider, **progress):
        return status_message(
            ConnectionStatus(),
            replace(STATE, target_speed_fraction=slider),
            STAMP,
            Progress(
                waypoint=0, fraction=0.5, desired_pose=Pose(), actual_pose=Pose(), **progress
            ),
        )

    assert slowed(1.0).slowed_by == ''
    assert slowed(1.0).feed_override == 1.0
    assert slowed(0.5).slowed_by == 'speed slider 50%'
    both = slowed(0.5, feed_override=0.3, feed_is_valid=False)
    assert both.slowed_by == 'speed slider 50%, feed override 30% (no valid signal)'
    assert both.feed_override == 0.3
    assert slowed(1.0, feed_override=0.8).slowed_by == 'feed override 80%'
    assert status_message(ConnectionStatus(), STATE, STAMP).slowed_by == ''


def test_the_status_without_a_robot_knows_no_modes():
    message = status_message(ConnectionStatus(), None, STAMP)
    assert message.robot_mode == DriverStatus.ROBOT_MODE_UNKNOWN
    assert message.safety_mode == DriverStatus.SAFETY_MODE_UNKNOWN
    assert message.motion_version == 0
    assert isnan(message.speed_scaling)


def test_the_motion_version_is_that_of_the_program_that_is_ours():
    left_behind = RobotState(timestamp=1.0, actual_q=(0.0,) * 6, motion_version=2)
    for connection, shown in (
        (ConnectionStatus(), 0),
        (ConnectionStatus(program_is_own=True, motion_version=2), 2),
    ):
        assert status_message(connection, left_behind, STAMP).motion_version == shown


def test_a_pulse_has_its_output_and_pose_or_nan_where_its_packet_was_lost():
    pulse = Pulse(
        output=OutputKind.TOOL_DIGITAL, pin=1, number=7, timestamp=2.5, pose=Pose((1.0, 2.0, 3.0))
    )
    message = pulse_message(pulse, 'left_base', STAMP)
    assert (message.header.frame_id, message.timestamp) == ('left_base', 2.5)
    assert (message.output, message.pin, message.number) == (2, 1, 7)
    assert (message.pose.position.x, message.pose.orientation.w) == (1.0, 1.0)
    lost = pulse_message(replace(pulse, pose=None), 'left_base', STAMP)
    assert isnan(lost.pose.position.x)
    assert isnan(lost.pose.orientation.w)
