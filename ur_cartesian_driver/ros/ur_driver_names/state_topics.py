# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The topics with the state of the robot."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from geometry_msgs.msg import PoseStamped, WrenchStamped
from std_msgs.msg import Bool, Float64

from ur_cartesian_driver.motion.goal.known_frames import TCP, TOOL0
from ur_cartesian_driver.msg import IOStates, RobotMode, SafetyMode, ToolData
from ur_cartesian_driver.ros.message_fields import class_of, Message
from ur_cartesian_driver.ros.ur_driver_names.names_settings import NamesSettings
from ur_cartesian_driver.ros.ur_driver_names.offered_name import ByDriver, Topic, UrName

IO = 'io_and_status_controller'
_SPEED, _FORCE, _POSE = (
    'speed_scaling_state_broadcaster',
    'force_torque_sensor_broadcaster',
    'tcp_pose_broadcaster',
)
_GEOMETRY, _MODES = 'geometry_msgs/msg', 'ur_dashboard_msgs/msg'


def _same(kind: Any, message: Message, settings: NamesSettings) -> Message:
    return message


def _percent(kind: Any, message: Message, settings: NamesSettings) -> Message:
    """Return 0 to 100, as the UR driver publishes, although its documentation says 0 to 1."""
    return kind(data=100.0 * message.data)


def _wrench(kind: Any, message: Message, settings: NamesSettings) -> Message:
    """Return the same numbers; Jazzy's release calls the axes of the TCP tool0."""
    if settings.release == 'jazzy':
        message.header.frame_id = message.header.frame_id.removesuffix(TCP) + TOOL0
    return message


def _mode(kind: Any, message: Message, settings: NamesSettings) -> Message | None:
    """Return the mode; None while the robot reports none."""
    return None if message.mode == type(message).UNKNOWN else kind(mode=message.mode)


def _io_states(kind: Any, message: Message, settings: NamesSettings) -> Message:
    """Return all channels; digital ones: 0 to 7 standard, 8 to 15 configurable, 16 and 17 tool."""
    return kind(
        digital_in_states=_digital(message, 'inputs'),
        digital_out_states=_digital(message, 'outputs'),
        analog_in_states=_analog(message.analog_inputs, message.analog_input_domains),
        analog_out_states=_analog(message.analog_outputs, message.analog_output_domains),
    )


def _digital(message: Message, direction: str) -> list[Message]:
    channel = class_of('ur_msgs/msg/Digital')
    groups = (f'{group}_digital_{direction}' for group in ('standard', 'configurable', 'tool'))
    states = (bool(state) for group in groups for state in getattr(message, group))
    return [channel(pin=pin, state=state) for pin, state in enumerate(states)]


def _analog(values: Sequence[float], domains: Sequence[int]) -> list[Message]:
    channel = class_of('ur_msgs/msg/Analog')
    return [
        channel(pin=pin, domain=int(domain), state=float(value))
        for pin, (value, domain) in enumerate(zip(values, domains, strict=True))
    ]


def _tool_data(kind: Any, message: Message, settings: NamesSettings) -> Message:
    """Return the tool's connector; the driver does not read its voltage of 48 V, which stays 0."""
    (range2, range3), (input2, input3) = message.analog_input_domains, message.analog_inputs
    return kind(
        analog_input_range2=int(range2),
        analog_input_range3=int(range3),
        analog_input2=float(input2),
        analog_input3=float(input3),
        tool_output_voltage=message.output_voltage,
        tool_current=message.output_current,
        tool_temperature=message.temperature,
        tool_mode=message.mode & 0xFF,
    )


def _topic(
    name: str,
    kind: str,
    source_type: Any,
    convert: Callable[[Any, Message, NamesSettings], Message | None] = _same,
    source: str = '',
    **flags: Any,
) -> UrName:
    """
    Return the row of a topic.

    :param source: the driver's topic; empty = it has the last part of the name.
    """
    return Topic(
        name=name,
        type=kind,
        source=source or name.rpartition('/')[2],
        source_type=source_type,
        convert=convert,
        **flags,
    )


STATE_TOPICS = (
    ByDriver(name='joint_states', type='sensor_msgs/msg/JointState'),
    _topic(f'{IO}/io_states', 'ur_msgs/msg/IOStates', IOStates, _io_states, repeated=True),
    _topic(f'{IO}/tool_data', 'ur_msgs/msg/ToolDataMsg', ToolData, _tool_data, repeated=True),
    _topic(f'{IO}/robot_mode', f'{_MODES}/RobotMode', RobotMode, _mode, latched=True),
    _topic(f'{IO}/safety_mode', f'{_MODES}/SafetyMode', SafetyMode, _mode, latched=True),
    _topic(f'{IO}/robot_program_running', 'std_msgs/msg/Bool', Bool, latched=True),
    _topic(f'{_SPEED}/speed_scaling', 'std_msgs/msg/Float64', Float64, _percent),
    _topic(f'{_FORCE}/wrench', f'{_GEOMETRY}/WrenchStamped', WrenchStamped, _wrench),
    _topic(f'{_FORCE}/ft_data', f'{_GEOMETRY}/WrenchStamped', WrenchStamped, _wrench, 'wrench'),
    _topic(f'{_POSE}/pose', f'{_GEOMETRY}/PoseStamped', PoseStamped, source='tcp_pose'),
)
