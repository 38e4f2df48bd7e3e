# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""From the state of the robot to messages for everybody who wants to know it."""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum
from math import nan
from typing import Any

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Quaternion, Transform, TransformStamped, Vector3, WrenchStamped
import numpy as np

from ur_cartesian_driver.driver import DriverStatus as Connection
from ur_cartesian_driver.motion.pose import conjugate, rotate
from ur_cartesian_driver.motion.signals import AnalogChannel, Signals
from ur_cartesian_driver.motion.state import RobotMode, RobotState, SafetyMode
from ur_cartesian_driver.msg import DriverStatus, IOStates, ToolData
from ur_cartesian_driver.msg import RobotMode as RobotModeMessage
from ur_cartesian_driver.msg import SafetyMode as SafetyModeMessage


def wrench_message(state: RobotState, tcp: str, stamp: Time) -> WrenchStamped:
    """
    Return force [N] and torque [Nm] at the TCP, in its own axes.

    The robot reports them at the TCP, but along the axes of its base.
    """
    to_tcp = conjugate(state.actual_tcp_pose.quaternion)
    fx, fy, fz, tx, ty, tz = state.actual_tcp_wrench
    message = WrenchStamped()
    message.header.stamp = stamp
    message.header.frame_id = tcp
    message.wrench.force = _vector(rotate(to_tcp, (fx, fy, fz)))
    message.wrench.torque = _vector(rotate(to_tcp, (tx, ty, tz)))
    return message


def tcp_transform(state: RobotState, base: str, tcp: str, stamp: Time) -> TransformStamped:
    """Return where the active TCP is measured to be, as a transform for tf."""
    message = TransformStamped(child_frame_id=tcp)
    message.header.stamp = stamp
    message.header.frame_id = base
    x, y, z, w = state.actual_tcp_pose.quaternion
    message.transform = Transform(
        translation=_vector(state.actual_tcp_pose.position),
        rotation=Quaternion(x=x, y=y, z=z, w=w),
    )
    return message


def status_message(connection: Connection, state: RobotState | None, stamp: Time) -> DriverStatus:
    """
    Return how far the connection is, with what the robot reports.

    Each field of the message has the value of the same name of the connection or of the state.
    """
    message = DriverStatus()
    for name in message.get_fields_and_field_types():
        if name != 'header':
            value = getattr(connection if hasattr(connection, name) else state, name, None)
            if value is None:
                value = _unknown(name, getattr(message, name))
            setattr(message, name, int(value) if isinstance(value, IntEnum) else value)
    message.header.stamp = stamp
    return message


def _unknown(name: str, value: Any) -> Any:
    """Return what a field of the status says while the robot does not report it."""
    if isinstance(value, float | np.ndarray):
        return value + nan
    return getattr(DriverStatus, f'{name.upper()}_UNKNOWN', value)


def robot_mode_message(state: RobotState | None) -> RobotModeMessage:
    """Return the mode of the robot with its name."""
    if state is None:
        return RobotModeMessage(mode=RobotModeMessage.UNKNOWN, name='UNKNOWN')
    return RobotModeMessage(mode=int(state.robot_mode), name=RobotMode(state.robot_mode).name)


def safety_mode_message(state: RobotState | None) -> SafetyModeMessage:
    """Return the safety mode with its name."""
    if state is None:
        return SafetyModeMessage(mode=SafetyModeMessage.UNKNOWN, name='UNKNOWN')
    return SafetyModeMessage(mode=int(state.safety_mode), name=SafetyMode(state.safety_mode).name)


def io_states_message(signals: Signals, stamp: Time) -> IOStates:
    """Return all inputs and outputs."""
    message = IOStates(
        standard_digital_inputs=list(signals.inputs.standard),
        standard_digital_outputs=list(signals.outputs.standard),
        configurable_digital_inputs=list(signals.inputs.configurable),
        configurable_digital_outputs=list(signals.outputs.configurable),
        tool_digital_inputs=list(signals.inputs.tool),
        tool_digital_outputs=list(signals.outputs.tool),
        analog_inputs=_values(signals.analog_inputs),
        analog_input_domains=_domains(signals.analog_inputs),
        analog_outputs=_values(signals.analog_outputs),
        analog_output_domains=_domains(signals.analog_outputs),
    )
    message.header.stamp = stamp
    return message


def tool_data_message(signals: Signals, stamp: Time) -> ToolData:
    """Return the tool connector and the payload."""
    message = ToolData(
        analog_inputs=_values(signals.tool_analog_inputs),
        analog_input_domains=_domains(signals.tool_analog_inputs),
        output_voltage=signals.tool_voltage,
        output_current=signals.tool_current,
        temperature=signals.tool_temperature,
        mode=signals.tool_mode,
        payload=signals.payload,
        payload_center_of_gravity=_vector(signals.payload_cog),
    )
    message.header.stamp = stamp
    return message


def _values(channels: Sequence[AnalogChannel]) -> list[float]:
    return [channel.value for channel in channels]


def _domains(channels: Sequence[AnalogChannel]) -> list[int]:
    return [int(channel.domain) for channel in channels]


def _vector(values: Sequence[float]) -> Vector3:
    x, y, z = values
    return Vector3(x=x, y=y, z=z)
