# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The state of the robot as messages."""

from dataclasses import fields
from math import isnan, pi

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus
from hypothesis import given
from hypothesis import strategies as st
import pytest

from ur_cartesian_driver.driver import ConnectionState, ConnectionStatus
from ur_cartesian_driver.motion.events import Progress
from ur_cartesian_driver.motion.geometry.pose import Pose, quaternion_from_rotation_vector, rotate
from ur_cartesian_driver.motion.state.rtde_state import (
    RobotMode,
    RobotState,
    SafetyMode,
    STATE_TABLE,
)
from ur_cartesian_driver.msg import DriverStatus, IOStates, ToolData
from ur_cartesian_driver.robot.rtde.signal_stream import (
    OPTIONAL_FIELDS,
    REQUIRED_FIELDS,
    signals_from_rtde,
)
from ur_cartesian_driver.ros.messages.state_messages import (
    io_states_message,
    joint_state_message,
    robot_mode_message,
    safety_mode_message,
    slowed_by,
    tcp_transform,
    tool_data_message,
    wrench_message,
)
from ur_cartesian_driver.ros.state.diagnostics import LEVELS

STAMP = Time(sec=5)
#: The tool looks down: its z is -z of the base, its x is x.
DOWN = Pose((0.3, 0.1, 0.2), quaternion_from_rotation_vector((pi, 0.0, 0.0)))


def state(**fields):
    return RobotState(timestamp=1.0, actual_q=(0.0,) * 6, **fields)


def three(vector):
    return vector.x, vector.y, vector.z


def test_a_push_from_below_is_felt_along_the_tool():
    message = wrench_message(
        state(actual_tcp_pose=DOWN, actual_tcp_wrench=(0.0, 0.0, 10.0, 0.0, 2.0, 0.0)),
        'tool0_controller',
        STAMP,
    )
    assert message.header.frame_id == 'tool0_controller'
    assert message.header.stamp == STAMP
    assert three(message.wrench.force) == pytest.approx((0.0, 0.0, -10.0))
    assert three(message.wrench.torque) == pytest.approx((0.0, -2.0, 0.0))


@given(st.tuples(*[st.floats(-3.0, 3.0)] * 3), st.tuples(*[st.floats(-100.0, 100.0)] * 6))
def test_a_wrench_turned_back_is_what_the_robot_reported(rotation, wrench):
    pose = Pose((0.0, 0.0, 0.0), quaternion_from_rotation_vector(rotation))
    message = wrench_message(state(actual_tcp_pose=pose, actual_tcp_wrench=wrench), 'tcp', STAMP)
    back = (
        *rotate(pose.quaternion, three(message.wrench.force)),
        *rotate(pose.quaternion, three(message.wrench.torque)),
    )
    assert back == pytest.approx(wrench, abs=1e-9)


def test_the_transform_is_the_pose_of_the_tcp():
    message = tcp_transform(state(actual_tcp_pose=DOWN), 'base', 'tool0_controller', STAMP)
    assert (message.header.frame_id, message.child_frame_id) == ('base', 'tool0_controller')
    assert three(message.transform.translation) == DOWN.position
    q = message.transform.rotation
    assert (q.x, q.y, q.z, q.w) == DOWN.quaternion


def test_efforts_are_torques_or_missing():
    names = ('a', 'b', 'c', 'd', 'e', 'f')
    assert not joint_state_message(state(), names, STAMP).effort
    torques = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    message = joint_state_message(state(joint_torque=torques), names, STAMP)
    assert tuple(message.effort) == torques


def values(**known):
    return dict.fromkeys(REQUIRED_FIELDS, 0) | known


def test_old_software_reports_what_it_has():
    message = io_states_message(signals_from_rtde(values()), STAMP)
    assert not any(message.standard_digital_inputs)
    assert all(map(isnan, message.analog_inputs))
    assert not set(OPTIONAL_FIELDS) & set(values())


@pytest.mark.parametrize('bit', range(18))
def test_every_digital_channel_has_its_place(bit):
    message = io_states_message(
        signals_from_rtde(
            values(
                actual_digital_input_bits=1 << bit,
                actual_digital_output_bits=(1 << 18) - 1 - (1 << bit),
            )
        ),
        STAMP,
    )
    inputs = [
        *message.standard_digital_inputs,
        *message.configurable_digital_inputs,
        *message.tool_digital_inputs,
    ]
    outputs = [
        *message.standard_digital_outputs,
        *message.configurable_digital_outputs,
        *message.tool_digital_outputs,
    ]
    assert inputs == [i == bit for i in range(18)]
    assert outputs == [i != bit for i in range(18)]


@pytest.mark.parametrize('types', range(16))
def test_every_analog_channel_has_its_domain(types):
    message = io_states_message(
        signals_from_rtde(
            values(
                analog_io_types=types,
                standard_analog_input0=1.0,
                standard_analog_input1=2.0,
                standard_analog_output0=3.0,
                standard_analog_output1=4.0,
            )
        ),
        STAMP,
    )
    domains = [*message.analog_input_domains, *message.analog_output_domains]
    assert domains == [types >> i & 1 for i in range(4)]
    assert [*message.analog_inputs, *message.analog_outputs] == [1.0, 2.0, 3.0, 4.0]
    assert IOStates.VOLTAGE == 1


def test_tool_data_say_what_is_not_known():
    message = tool_data_message(
        signals_from_rtde(
            values(
                tool_analog_input_types=2,
                tool_output_voltage=24,
                tool_output_current=0.3,
                tool_temperature=31.5,
                tool_mode=253,
            )
        ),
        STAMP,
    )
    assert list(message.analog_input_domains) == [ToolData.CURRENT, ToolData.VOLTAGE]
    assert (message.output_voltage, message.output_current) == (24, 0.3)
    assert (message.temperature, message.mode) == (31.5, 253)
    assert isnan(message.payload)
    assert isnan(message.payload_center_of_gravity.x)
    known = tool_data_message(
        signals_from_rtde(values(payload=1.5, payload_cog=(0.0, 0.0, 0.1))), STAMP
    )
    assert (known.payload, known.payload_center_of_gravity.z) == (1.5, 0.1)


def test_modes_come_with_their_names():
    assert robot_mode_message(None).name == 'UNKNOWN'
    assert safety_mode_message(None).name == 'UNKNOWN'
    for mode in RobotMode:
        message = robot_mode_message(state(robot_mode=mode))
        assert (message.mode, message.name) == (mode.value, mode.name)
    for safety in SafetyMode:
        message = safety_mode_message(state(safety_mode=safety))
        assert (message.mode, message.name) == (safety.value, safety.name)


def test_every_state_of_the_connection_has_a_level():
    assert set(LEVELS) == set(ConnectionState)
    ready = {at for at, level in LEVELS.items() if level == DiagnosticStatus.OK}
    assert ready == {ConnectionState.READY, ConnectionState.EXECUTING}


def test_each_field_of_the_status_has_the_name_of_what_it_shows():
    known = {row.name for row in STATE_TABLE} | {
        name for name in dir(ConnectionStatus) if not name.startswith('_')
    }
    # The running goal adds the feed, and who slows the goal follows from feed and slider.
    known |= {field.name for field in fields(Progress)} | {slowed_by.__name__}
    assert set(DriverStatus.get_fields_and_field_types()) - {'header'} <= known
