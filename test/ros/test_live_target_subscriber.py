# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Messages of ``~/live_target`` and ``~/servo_state``: what they mean, or why not."""

from dataclasses import fields, replace
from math import inf, isfinite, nan

from builtin_interfaces.msg import Duration, Time
from geometry_msgs.msg import PoseStamped
from hypothesis import given, settings
from hypothesis import strategies as st
import pytest

from ur_cartesian_driver.driver.live_session import check_target
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.errors import DriverError, InvalidGoal, RobotNotReady
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, Pose
from ur_cartesian_driver.motion.goal.known_frames import ArmSnapshot, Frames, StaticFrame
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.motion.state.servo_report import ServoActivity, ServoReport
from ur_cartesian_driver.planning import PlanningOptions
from ur_cartesian_driver.ros.live.live_target_subscriber import (
    target_from_message,
    TargetInhibitor,
)
from ur_cartesian_driver.ros.messages.state_messages import servo_state_message
from ur_cartesian_driver.sim.simulator_config import HOME

HERE = Arm(robot_model('ur5e')).forward(HOME)
STATE = RobotState(
    timestamp=0.0, actual_q=HOME, target_q=HOME, actual_tcp_pose=HERE, target_tcp_pose=HERE
)
SNAPSHOT = ArmSnapshot.of(STATE)
NOW = 1_800_000_000_000_000_000
FRAMES = Frames('', [StaticFrame.parse('camera tool0 0 0 0.1 0 0 0 1')])


def message(pose=HERE, frame='base', age=None):
    """Return a target; without an age it has no stamp."""
    made = PoseStamped()
    made.header.frame_id = frame
    if age is not None:
        stamp = NOW - round(age * 1e9)
        made.header.stamp.sec, made.header.stamp.nanosec = divmod(stamp, 1_000_000_000)
    made.pose.position.x, made.pose.position.y, made.pose.position.z = pose.position
    o = made.pose.orientation
    o.x, o.y, o.z, o.w = pose.quaternion
    return made


def target(made, snapshot=SNAPSHOT):
    return target_from_message(made, FRAMES, snapshot=snapshot, now=NOW, max_age=0.2)


def test_without_a_stamp_it_is_as_new_as_it_can_be():
    assert target(message()) == (HERE, 0.0)


@pytest.mark.parametrize(('age', 'told'), [(0.15, 0.15), (-0.15, 0.0)])
def test_its_age_is_that_of_its_stamp(age, told):
    assert target(message(age=age))[1] == pytest.approx(told, abs=1e-6)


@pytest.mark.parametrize(
    ('frame', 'expected'),
    [('', IDENTITY), ('camera', HERE @ Pose((0.0, 0.0, 0.1))), ('tool0_controller', HERE)],
)
def test_frames_are_those_of_goals(frame, expected):
    found, _ = target(message(IDENTITY, frame))
    assert found.distance_to(expected) < 1e-12
    assert found.angle_to(expected) < 1e-7


MALFORMED = {
    'old': (message(age=0.3), 'header.stamp is 0.300 s old'),
    'future': (message(age=-3.0), 'header.stamp is 3.000 s in the future'),
    'frame': (message(frame='part'), 'header.frame_id is "part"'),
    'nan': (message(replace(HERE, position=(nan, 0.0, 0.0))), 'position of the target is'),
    'inf': (message(replace(HERE, quaternion=(0.0, inf, 0.0, 0.0))), 'orientation of the target'),
    'zero': (message(replace(HERE, quaternion=(0.0,) * 4)), 'has length 0; a unit'),
    'long': (message(replace(HERE, quaternion=(0.0, 0.0, 0.0, 1.1))), 'has length 1.1; a unit'),
}


@pytest.mark.parametrize('what', MALFORMED)
def test_what_is_malformed_is_refused_in_words(what):
    made, words = MALFORMED[what]
    with pytest.raises(InvalidGoal) as refusal:
        target(made)
    assert words in str(refusal.value)
    assert str(refusal.value).endswith('.')


def test_a_frame_on_the_arm_needs_the_arm():
    with pytest.raises(RobotNotReady, match='camera'):
        target(message(frame='camera'), snapshot=None)


def test_what_is_far_away_is_refused_with_the_distance():
    far = Pose((HERE.position[0], HERE.position[1] + 0.6, HERE.position[2]), HERE.quaternion)
    with pytest.raises(InvalidGoal, match=r'is 0\.6 m away.*max_approach_distance = 0\.5 m'):
        check_target(far, STATE, PlanningOptions())
    check_target(far, STATE, PlanningOptions(max_approach_distance=0.0))


def test_after_a_stop_targets_have_to_pause_before_they_are_followed():
    inhibitor = TargetInhibitor(pause=2.0)
    assert not inhibitor.blocks(0.0)
    inhibitor.activate()
    assert [inhibitor.blocks(0.1 + i) for i in range(5)] == [True] * 5
    assert not inhibitor.blocks(6.2), 'none had come for 2 s'
    assert not inhibitor.blocks(6.3)


FLOATS = st.sampled_from([nan, inf, -inf, 0.0, -0.0, 1.0, -1.0, 1e-320, 1e-9, 0.7071068, 1e300])


@settings(max_examples=150, deadline=None, derandomize=True)
@given(
    numbers=st.lists(FLOATS, min_size=7, max_size=7),
    frame=st.sampled_from(['', 'base', 'camera', 'no such frame', 'ä\n\x1b']),
    sec=st.sampled_from([0, -(2**31), 2**31 - 1, NOW // 10**9]),
    nanosec=st.sampled_from([0, 2**32 - 1, NOW % 10**9]),
)
def test_anything_is_a_pose_within_reach_or_refused_with_a_sentence(numbers, frame, sec, nanosec):
    made = message(Pose(tuple(numbers[:3]), tuple(numbers[3:])), frame)
    made.header.stamp.sec, made.header.stamp.nanosec = sec, nanosec
    refused = ''
    try:
        pose, age = target(made)
        check_target(pose, STATE, PlanningOptions())
    except DriverError as error:
        refused = str(error)
    if refused:
        assert refused.endswith('.')
    else:
        assert all(map(isfinite, pose.row()))
        assert pose.distance_to(HERE) <= 0.5
        assert 0.0 <= age <= 0.2


def test_every_figure_of_a_report_has_its_field_in_the_message():
    numbers = {
        field.name: k
        for k, field in enumerate(fields(ServoReport))
        if field.name not in ('activity', 'timestamp', 'joint_error', 'buffered')
    }
    message = servo_state_message(
        ServoReport(
            timestamp=1.0,
            activity=ServoActivity.SERVOING,
            buffered=0.25,
            joint_error=(0.1, 0.2, 0.3, 0.4, 0.5, 0.6),
            **numbers,
        ),
        Time(sec=7),
    )
    assert {name: getattr(message, name) for name in numbers} == numbers
    assert message.state == message.SERVOING
    assert message.buffered == Duration(nanosec=250_000_000)
    assert list(message.joint_error) == [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]
    assert message.header.stamp == Time(sec=7)
