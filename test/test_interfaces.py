# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The interfaces contain FZI's proposal unchanged, can be sent, and document themselves."""

import math
import re

from builtin_interfaces.msg import Duration
import pytest
from rclpy.serialization import deserialize_message, serialize_message
from tracked_files import tracked_files

from ur_cartesian_driver.action import FollowCartesianTrajectory
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import ArcMode, FreeAxis, OutputKind, SegmentType
from ur_cartesian_driver.motion.state.io_signals import AnalogDomain
from ur_cartesian_driver.motion.state.rtde_state import RobotMode, SafetyMode
from ur_cartesian_driver.msg import (
    CartesianPosture,
    CartesianTolerance,
    CartesianTrajectory,
    CartesianTrajectoryPoint,
    DriverStatus,
    IOCommand,
    IOStates,
    MotionSegment,
    ServoState,
    ToolData,
)
from ur_cartesian_driver.msg import RobotMode as RobotModeMessage
from ur_cartesian_driver.msg import SafetyMode as SafetyModeMessage
from ur_cartesian_driver.planning.append.appendable_goal import Replacement
from ur_cartesian_driver.resources import share_path
from ur_cartesian_driver.srv import (
    AppendPoints,
    Load,
    Popup,
    RawRequest,
    SetGravity,
    SetIO,
    SetPayload,
    SetSpeedSliderFraction,
    SetTCP,
)

pytestmark = pytest.mark.installation

# Section 4.2 of the proposal (FZI, 2020-09-17), with the ROS 2 names of its types.
FZI = {
    CartesianPosture: {
        'posture_joint_names': 'sequence<string>',
        'posture_joint_values': 'sequence<double>',
    },
    CartesianTrajectoryPoint: {
        'time_from_start': 'builtin_interfaces/Duration',
        'pose': 'geometry_msgs/Pose',
        'twist': 'geometry_msgs/Twist',
        'acceleration': 'geometry_msgs/Accel',
        'jerk': 'geometry_msgs/Accel',
        'posture': 'ur_cartesian_driver/CartesianPosture',
    },
    CartesianTrajectory: {
        'header': 'std_msgs/Header',
        'points': 'sequence<ur_cartesian_driver/CartesianTrajectoryPoint>',
        'controlled_frame': 'string',
    },
    CartesianTolerance: {
        'position_error': 'geometry_msgs/Vector3',
        'orientation_error': 'geometry_msgs/Vector3',
        'twist_error': 'geometry_msgs/Twist',
        'acceleration_error': 'geometry_msgs/Accel',
    },
    FollowCartesianTrajectory.Goal: {
        'trajectory': 'ur_cartesian_driver/CartesianTrajectory',
        'path_tolerance': 'ur_cartesian_driver/CartesianTolerance',
        'goal_tolerance': 'ur_cartesian_driver/CartesianTolerance',
        'goal_time_tolerance': 'builtin_interfaces/Duration',
    },
    FollowCartesianTrajectory.Result: {
        'error_code': 'int32',
        'error_string': 'string',
    },
    FollowCartesianTrajectory.Feedback: {
        'header': 'std_msgs/Header',
        'controlled_frame': 'string',
        'desired': 'ur_cartesian_driver/CartesianTrajectoryPoint',
        'actual': 'ur_cartesian_driver/CartesianTrajectoryPoint',
        'error': 'ur_cartesian_driver/CartesianTrajectoryPoint',
    },
}
FZI_CODES = {
    'SUCCESSFUL': 0,
    'INVALID_GOAL': -1,
    'INVALID_JOINTS': -2,
    'OLD_HEADER_TIMESTAMP': -3,
    'PATH_TOLERANCE_VIOLATED': -4,
    'GOAL_TOLERANCE_VIOLATED': -5,
    'INVALID_POSTURE': -6,
}
ALL = [
    *FZI,
    DriverStatus,
    IOCommand,
    IOStates,
    MotionSegment,
    RobotModeMessage,
    SafetyModeMessage,
    ServoState,
    ToolData,
    *(
        part
        for service in (
            AppendPoints,
            Load,
            Popup,
            RawRequest,
            SetGravity,
            SetIO,
            SetPayload,
            SetSpeedSliderFraction,
            SetTCP,
        )
        for part in (service.Request, service.Response)
    ),
]


def constants(message: type, pattern: str = '') -> dict[str, int]:
    return {
        name: getattr(message, name)
        for name in dir(type(message))
        if re.match('[A-Z]', name) and re.match(pattern, name)
    }


@pytest.mark.parametrize('message', FZI, ids=lambda m: m.__name__)
def test_fields_of_the_proposal_stand_first_and_are_unchanged(message):
    fields = list(message.get_fields_and_field_types().items())
    assert fields[: len(FZI[message])] == list(FZI[message].items())


@pytest.mark.parametrize('message', list(FZI)[:4], ids=lambda m: m.__name__)
def test_messages_of_the_proposal_have_no_more_fields_than_it(message):
    assert message.get_fields_and_field_types() == FZI[message]


def test_error_codes_of_the_proposal_are_unchanged():
    codes = constants(FollowCartesianTrajectory.Result)
    assert {name: codes[name] for name in FZI_CODES} == FZI_CODES


def test_error_codes_are_distinct_and_without_gaps():
    codes = constants(FollowCartesianTrajectory.Result)
    assert sorted(codes.values(), reverse=True) == [-i for i in range(len(codes))]
    assert len(codes) == 19


@pytest.mark.parametrize(
    ('message', 'pattern', 'values'),
    [
        (MotionSegment, '(?!ARC_|FREE_)', range(7)),
        (MotionSegment, 'ARC_', range(2)),
        (MotionSegment, 'FREE_', range(4)),
        (IOCommand, '.*_(DIGITAL|ANALOG)$', range(4)),
        (FollowCartesianTrajectory.Goal, 'EXECUTION_', range(4)),
        (DriverStatus, '(?!ROBOT_MODE_|SAFETY_MODE_)', range(7)),
        (ServoState, '', range(5)),
    ],
)
def test_constants_of_an_enumeration_count_up(message, pattern, values):
    assert sorted(constants(message, pattern).values()) == list(values)


@pytest.mark.parametrize(
    ('enum', 'message', 'prefix', 'only_in_the_message'),
    [
        (ErrorCode, FollowCartesianTrajectory.Result, '', {}),
        (ExecutionMode, FollowCartesianTrajectory.Goal, 'EXECUTION_', {}),
        (SegmentType, MotionSegment, '(?!ARC_|FREE_)', {}),
        (ArcMode, MotionSegment, 'ARC_', {}),
        (FreeAxis, MotionSegment, 'FREE_', {}),
        (OutputKind, IOCommand, '(?=.*_(DIGITAL|ANALOG)$)', {}),
        (RobotMode, DriverStatus, 'ROBOT_MODE_', {'UNKNOWN': -2}),
        (SafetyMode, DriverStatus, 'SAFETY_MODE_', {'UNKNOWN': 0}),
        (RobotMode, RobotModeMessage, '', {'UNKNOWN': -2}),
        (SafetyMode, SafetyModeMessage, '', {'UNKNOWN': 0}),
        (AnalogDomain, IOStates, '', {}),
        (AnalogDomain, ToolData, '', {}),
        (Replacement, AppendPoints.Request, '', {}),
        (AnalogDomain, IOCommand, '(?=CURRENT|VOLTAGE)', {}),
        (AnalogDomain, SetIO.Request, '(?=CURRENT|VOLTAGE)', {}),
        (OutputKind, SetIO.Request, '(?=.*_(DIGITAL|ANALOG)$)', {}),
    ],
)
def test_our_own_types_use_the_numbers_of_the_messages(enum, message, prefix, only_in_the_message):
    numbers = {
        re.sub(f'^{prefix}', '', name): value for name, value in constants(message, prefix).items()
    }
    assert numbers == {member.name: member.value for member in enum} | only_in_the_message


def test_a_default_message_asks_for_the_defaults():
    goal, segment = FollowCartesianTrajectory.Goal(), MotionSegment()
    assert goal.execution == goal.EXECUTION_AUTO
    assert not goal.segments
    assert not goal.validate_only
    assert segment.type == MotionSegment.AUTO
    assert segment.arc_mode == MotionSegment.ARC_UNCONSTRAINED
    assert segment.via.orientation.w == 1.0  # a pose that was not touched is a valid one


def test_a_goal_survives_serialization():
    goal = FollowCartesianTrajectory.Goal(goal_time_tolerance=Duration(sec=-1), keep_open=True)
    goal.trajectory.header.frame_id = 'base'
    goal.trajectory.controlled_frame = 'tool0'
    for i in range(3):
        point = CartesianTrajectoryPoint(time_from_start=Duration(sec=i, nanosec=5))
        point.pose.position.x = 0.1 * i
        point.jerk.angular.y = math.nan if i == 2 else 2.5
        point.posture = CartesianPosture(
            posture_joint_names=['elbow_joint'], posture_joint_values=[1.5]
        )
        goal.trajectory.points.append(point)
        goal.segments.append(MotionSegment(type=MotionSegment.CIRCULAR, blend_radius=0.01 * i))
    goal.io_commands = [IOCommand(point_index=1, output=IOCommand.STANDARD_ANALOG, value=0.5)]
    read = deserialize_message(serialize_message(goal), FollowCartesianTrajectory.Goal)
    assert math.isnan(read.trajectory.points[2].jerk.angular.y)
    read.trajectory.points[2].jerk.angular.y = goal.trajectory.points[2].jerk.angular.y = 0.0
    assert read == goal


@pytest.mark.parametrize('message', ALL, ids=lambda m: m.__name__)
def test_an_empty_message_survives_serialization(message):
    assert deserialize_message(serialize_message(message()), message) == message()


def interface_files():
    return sorted(
        path
        for kind in ('msg', 'srv', 'action')
        for path in tracked_files(share_path() / kind, f'*.{kind}')
    )


def documented_fields(text: str) -> dict[str, str]:
    """Return each field with its comments: before its block, and after it."""
    fields: dict[str, str] = {}
    comment, in_block = '', False
    for line in text.splitlines():
        code, _, behind = line.partition('#')
        if not code.strip():
            comment = comment + behind if behind and not in_block else behind
            in_block = False
            continue
        in_block = True
        if '=' not in code and code.strip() != '---':
            fields[' '.join(code.split())] = comment + behind
    return fields


def test_there_are_interface_files():
    assert {path.stem for path in interface_files()} >= {
        'CartesianTrajectory',
        'FollowCartesianTrajectory',
        'AppendPoints',
    }


@pytest.mark.parametrize('path', interface_files(), ids=lambda p: p.name)
def test_every_quantity_has_its_unit_in_a_comment(path):
    unit = re.compile(r'\[[^\]]+\]|[Ff]raction|0 to 1|from \w+ to')
    quantities = ('float64', 'geometry_msgs/', 'builtin_interfaces/Duration')
    bare = [
        field
        for field, comment in documented_fields(path.read_text()).items()
        if field.startswith(quantities) and not unit.search(comment)
    ]
    assert not bare, f'{path.name}: say the unit of {bare}'


@pytest.mark.parametrize('path', interface_files(), ids=lambda p: p.name)
def test_every_field_is_documented(path):
    bare = [
        field
        for field, comment in documented_fields(path.read_text()).items()
        if not comment.strip()
    ]
    assert not bare, f'{path.name}: say what {bare} mean'
