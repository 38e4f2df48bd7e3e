# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The topics with the state of the robot."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from geometry_msgs.msg import PoseStamped, WrenchStamped
from std_msgs.msg import Bool, Float64

from ur_cartesian_driver.motion.goal.known_frames import TCP, TOOL0
from ur_cartesian_driver.msg import IOStates, RobotMode, SafetyMode, ToolData
from ur_cartesian_driver.ros.message_fields import class_of, Message
from ur_cartesian_driver.ros.ur_driver_names.names_settings import NamesSettings
from ur_cartesian_driver.ros.ur_driver_names.offered_name import ByDriver, Topic, UrName

IO = 'io_and_status_controller'
_WRENCH = 'force_torque_sensor_broadcaster'


def _same(kind: Any, message: Message, settings: NamesSettings) -> Message:
    return message


def _percent(kind: Any, message: Message, settings: NamesSettings) -> Message:
    """Return 0 to 100: what that driver publishes, although its documentation says 0 to 1."""
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


def _topics() -> Iterable[UrName]:
    yield ByDriver(name='joint_states', type='sensor_msgs/msg/JointState')
    yield Topic(
        name=f'{IO}/io_states',
        type='ur_msgs/msg/IOStates',
        source='io_states',
        source_type=IOStates,
        convert=_io_states,
        repeated=True,
    )
    yield Topic(
        name=f'{IO}/tool_data',
        type='ur_msgs/msg/ToolDataMsg',
        source='tool_data',
        source_type=ToolData,
        convert=_tool_data,
        repeated=True,
    )
    for name, kind in (('robot_mode', RobotMode), ('safety_mode', SafetyMode)):
        yield Topic(
            name=f'{IO}/{name}',
            type=f'ur_dashboard_msgs/msg/{kind.__name__}',
            source=name,
            source_type=kind,
            convert=_mode,
            latched=True,
        )
    yield Topic(
        name=f'{IO}/robot_program_running',
        type='std_msgs/msg/Bool',
        source='robot_program_running',
        source_type=Bool,
        convert=_same,
        latched=True,
    )
    yield Topic(
        name='speed_scaling_state_broadcaster/speed_scaling',
        type='std_msgs/msg/Float64',
        source='speed_scaling',
        source_type=Float64,
        convert=_percent,
    )
    for name in ('wrench', 'ft_data'):
        yield Topic(
            name=f'{_WRENCH}/{name}',
            type='geometry_msgs/msg/WrenchStamped',
            source='wrench',
            source_type=WrenchStamped,
            convert=_wrench,
        )
    yield Topic(
        name='tcp_pose_broadcaster/pose',
        type='geometry_msgs/msg/PoseStamped',
        source='tcp_pose',
        source_type=PoseStamped,
        convert=_same,
    )


STATE_TOPICS = tuple(_topics())
