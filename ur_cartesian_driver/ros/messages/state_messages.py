# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Messages of the state topics.

The fields of ``DriverStatus`` are filled by name, so that a new field of
:class:`~ur_cartesian_driver.motion.state.rtde_state.RobotState` needs no line here.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from enum import IntEnum
from math import nan
from typing import Any

from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped, Transform, TransformStamped, Wrench, WrenchStamped
import numpy as np
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from ur_cartesian_driver.driver import ConnectionStatus
from ur_cartesian_driver.kinematics.link_shapes import LinkFrames
from ur_cartesian_driver.kinematics.robot_description import LINK_NAMES
from ur_cartesian_driver.motion.events import Progress, Pulse
from ur_cartesian_driver.motion.geometry.pose import conjugate, Pose, pose_from_row, rotate
from ur_cartesian_driver.motion.goal.known_frames import (
    BASE,
    BASE_LINK,
    FLANGE,
    T_BASE_BASE_LINK,
    T_TOOL0_FLANGE,
    TOOL0,
)
from ur_cartesian_driver.motion.state.io_signals import AnalogChannel, Signals
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.motion.state.servo_report import ServoReport
from ur_cartesian_driver.msg import DriverStatus, IOStates, ServoState, ToolData
from ur_cartesian_driver.msg import Pulse as PulseMessage
from ur_cartesian_driver.msg import RobotMode as RobotModeMessage
from ur_cartesian_driver.msg import SafetyMode as SafetyModeMessage
from ur_cartesian_driver.ros.message_fields import (
    duration_message,
    pose_message,
    quaternion_message,
    vector_message,
)


def joint_state_message(state: RobotState, names: tuple[str, ...], stamp: Time) -> JointState:
    """
    Return positions [rad], velocities [rad/s] and efforts [Nm].

    Efforts are left out if the robot does not report them.
    """
    return JointState(
        header=Header(stamp=stamp),
        name=list(names),
        position=list(state.actual_q),
        velocity=list(state.actual_qd),
        effort=list(state.joint_torque or ()),
    )


def tcp_pose_message(state: RobotState, base: str, stamp: Time) -> PoseStamped:
    """Return the measured pose of the active TCP in the robot's base."""
    return PoseStamped(
        header=Header(stamp=stamp, frame_id=base), pose=pose_message(state.actual_tcp_pose)
    )


def wrench_message(state: RobotState, tcp: str, stamp: Time) -> WrenchStamped:
    """
    Return force [N] and torque [Nm] at the TCP, in the axes of the TCP.

    The robot reports both at the TCP, but in the axes of the base.
    """
    to_tcp = conjugate(state.actual_tcp_pose.quaternion)
    wrench = state.actual_tcp_wrench
    return WrenchStamped(
        header=Header(stamp=stamp, frame_id=tcp),
        wrench=Wrench(
            force=vector_message(rotate(to_tcp, wrench[:3])),
            torque=vector_message(rotate(to_tcp, wrench[3:])),
        ),
    )


def tcp_transform(state: RobotState, base: str, tcp: str, stamp: Time) -> TransformStamped:
    """Return the measured pose of the active TCP as a transform for tf."""
    return _transform(state.actual_tcp_pose, base, tcp, stamp)


def link_transforms(
    state: RobotState, frames: LinkFrames, tf_prefix: str, stamp: Time
) -> list[TransformStamped]:
    """Return the present poses of the robot description's frames, all of them in ``base``."""
    rows = frames.poses(np.array([state.actual_q]))[0]
    T_base_tool0 = pose_from_row(rows[-1]) @ frames.flange
    found = {
        BASE_LINK: T_BASE_BASE_LINK,
        **dict(zip(LINK_NAMES[1:], map(pose_from_row, rows[1:]), strict=True)),
        TOOL0: T_base_tool0,
        FLANGE: T_base_tool0 @ T_TOOL0_FLANGE,
    }
    return [
        _transform(pose, tf_prefix + BASE, tf_prefix + name, stamp) for name, pose in found.items()
    ]


def _transform(pose: Pose, parent: str, child: str, stamp: Time) -> TransformStamped:
    return TransformStamped(
        header=Header(stamp=stamp, frame_id=parent),
        child_frame_id=child,
        transform=Transform(
            translation=vector_message(pose.position),
            rotation=quaternion_message(pose.quaternion),
        ),
    )


def status_message(
    connection: ConnectionStatus,
    state: RobotState | None,
    stamp: Time,
    progress: Progress | None = None,
) -> DriverStatus:
    """
    Return the state of the connection and the modes of the robot.

    Each field has the value of the same name in the connection status or in the robot's state;
    only ``speed_scaling`` has the value of ``effective_speed``, and ``feed_override`` and
    ``slowed_by`` come from the progress of the running goal. The topic is published when the
    connection, a mode or a cause in ``slowed_by`` changes, and at least once a second.

    :param progress: of the running goal; None = no goal runs.
    """
    message = DriverStatus()
    for name in message.get_fields_and_field_types():
        if name != 'header':
            # Messages have called the effective speed ``speed_scaling`` from the beginning.
            source = 'effective_speed' if name == 'speed_scaling' else name
            value = getattr(connection if hasattr(connection, source) else state, source, None)
            if value is None:
                value = _unknown(name, getattr(message, name))
            setattr(message, name, int(value) if isinstance(value, IntEnum) else value)
    message.header.stamp = stamp
    message.feed_override = 1.0 if progress is None else progress.feed_override
    message.slowed_by = ', '.join(
        f'{who} {fraction:.0%}{why}' for who, fraction, why in slowed_by(state, progress)
    )
    return message


def slowed_by(
    state: RobotState | None, progress: Progress | None
) -> Iterator[tuple[str, float, str]]:
    """Yield each cause that slows the running goal, its speed fraction, and a reason or ''."""
    if state is None or progress is None:
        return
    if state.target_speed_fraction < 1.0:
        yield 'speed slider', state.target_speed_fraction, ''
    if progress.feed_override < 1.0:
        why = '' if progress.feed_is_valid else ' (no valid signal)'
        yield 'feed override', progress.feed_override, why


def _unknown(name: str, value: Any) -> Any:
    """
    Return the content of a status field whose value is not known.

    This is NaN for floats, the message's constant ``..._UNKNOWN`` for modes, else ``value``.

    :param value: the default of the field in the message.
    """
    if isinstance(value, float | np.ndarray):
        return value + nan
    return getattr(DriverStatus, f'{name.upper()}_UNKNOWN', value)


def robot_mode_message(state: RobotState | None) -> RobotModeMessage:
    """Return the mode of the robot with its name."""
    return _mode_message(RobotModeMessage, None if state is None else state.robot_mode)


def safety_mode_message(state: RobotState | None) -> SafetyModeMessage:
    """Return the safety mode with its name."""
    return _mode_message(SafetyModeMessage, None if state is None else state.safety_mode)


def _mode_message(kind: Any, mode: IntEnum | None) -> Any:
    if mode is None:
        return kind(mode=kind.UNKNOWN, name='UNKNOWN')
    return kind(mode=int(mode), name=mode.name)


def io_states_message(signals: Signals, stamp: Time) -> IOStates:
    """Return all inputs and outputs."""
    return IOStates(
        header=Header(stamp=stamp),
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


def tool_data_message(signals: Signals, stamp: Time) -> ToolData:
    """Return the state of the tool connector and the payload."""
    return ToolData(
        header=Header(stamp=stamp),
        analog_inputs=_values(signals.tool_analog_inputs),
        analog_input_domains=_domains(signals.tool_analog_inputs),
        output_voltage=signals.tool_voltage,
        output_current=signals.tool_current,
        temperature=signals.tool_temperature,
        mode=signals.tool_mode,
        payload=signals.payload,
        payload_center_of_gravity=vector_message(signals.payload_cog),
        payload_inertia=signals.payload_inertia,
    )


def pulse_message(pulse: Pulse, base: str, stamp: Time) -> PulseMessage:
    """Return a pulse; a pose that is not known is NaN."""
    return PulseMessage(
        header=Header(stamp=stamp, frame_id=base),
        timestamp=pulse.timestamp,
        output=int(pulse.output),
        pin=pulse.pin,
        number=pulse.number,
        pose=pose_message(pose_from_row([nan] * 7) if pulse.pose is None else pulse.pose),
    )


def servo_state_message(report: ServoReport, stamp: Time) -> ServoState:
    """Return the state of the set-point stream; fields not named here are copied by name."""
    values = asdict(report)
    del values['timestamp']
    return ServoState(
        header=Header(stamp=stamp),
        state=int(values.pop('activity')),
        buffered=duration_message(values.pop('buffered')),
        **values,
    )


def _values(channels: Sequence[AnalogChannel]) -> list[float]:
    return [channel.value for channel in channels]


def _domains(channels: Sequence[AnalogChannel]) -> list[int]:
    return [int(channel.domain) for channel in channels]
