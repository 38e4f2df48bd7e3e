# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The data of the primary and secondary interfaces: greeting, messages, ten states per second."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from ur_cartesian_driver.motion.state.rtde_state import RobotStatus, SafetyMode
from ur_cartesian_driver.protocol.client_interfaces.primary_messages import (
    encode_message,
    encode_state,
    VersionMessage,
)
from ur_cartesian_driver.protocol.client_interfaces.primary_state import (
    AdditionalInfo,
    CalibrationData,
    CartesianInfo,
    ConfigurationData,
    ForceModeData,
    JointData,
    KinematicsInfo,
    MasterboardData,
    RobotModeData,
    SAFETY_DATA,
    SubPackage,
    ToolCommunication,
    ToolData,
    ToolModeInfo,
)
from ur_cartesian_driver.sim.controller import Controller
from ur_cartesian_driver.sim.programs.program_runner import PAUSED
from ur_cartesian_driver.sim.rtde_output_values import COMPUTED, FIXED
from ur_cartesian_driver.sim.state.controller_messages import NO_TIMESTAMP

#: Field of a sub-package -> RTDE output with the same meaning.
JOINT_OUTPUTS: Mapping[str, str] = {
    'q_actual': 'actual_q',
    'q_target': 'target_q',
    'qd_actual': 'actual_qd',
    'current': 'actual_current',
    'voltage': 'actual_joint_voltage',
    'temperature': 'joint_temperatures',
    'mode': 'joint_mode',
}
MASTERBOARD_OUTPUTS: Mapping[str, str] = {
    'robot_voltage_48v': 'actual_robot_voltage',
    'robot_current': 'actual_robot_current',
}
TOOL_OUTPUTS: Mapping[str, str] = {
    'voltage_48v': 'actual_robot_voltage',
    'temperature': 'tool_temperature',
    'mode': 'tool_mode',
}

#: States per second.
STATE_RATE = 10.0
#: Reported limit of the joint accelerations [rad/s^2], as recorded on a UR5e.
_JOINT_ACCELERATION = 40.0
#: Type of the robot -> type of its controller box. The boxes of other robots are unknown; the
#: simulator reports 4 for them.
_CONTROLLER_BOXES = {1: 4, 2: 5, 3: 6, 4: 16, 7: 10, 8: 11}
_EMERGENCY = frozenset({SafetyMode.ROBOT_EMERGENCY_STOP, SafetyMode.SYSTEM_EMERGENCY_STOP})
#: Position limit [rad] that is sent for an endless joint, instead of infinity.
_UNLIMITED = 1e6


def version_frame(controller: Controller) -> bytes:
    """Return the version message, the first message on every connection."""
    major, minor, bugfix, build = controller.config.version
    return encode_message(
        VersionMessage(
            major=major,
            minor=minor,
            bugfix=bugfix,
            build=build,
            date='01-01-2026, 00:00:00',  # day first, as recorded
            timestamp=NO_TIMESTAMP,
        )
    )


class PrimaryStream:
    """The data for all clients: messages at once, states periodically and at safety changes."""

    def __init__(self, controller: Controller) -> None:
        """Compute the sub-packages that never change."""
        self._controller = controller
        self._constant = (_kinematics(controller), _configuration(controller))
        self._cycles_per_state = max(1, round(1.0 / (STATE_RATE * controller.cycle)))
        self._safety_mode = controller.safety.mode

    def messages(self) -> Iterator[bytes]:
        """Yield the messages since the last cycle."""
        for message in self._controller.messages.take():
            yield encode_message(message)

    def is_due(self) -> bool:
        """Return whether a state is due in this cycle; call this once per cycle."""
        before, self._safety_mode = self._safety_mode, self._controller.safety.mode
        return (
            self._controller.cycles % self._cycles_per_state == 0
            or self._safety_mode is not before
        )

    def state(self) -> bytes:
        """Return a state frame, with its sub-packages in the order recorded on a UR5e."""
        controller = self._controller
        kinematics, configuration = self._constant
        packages: tuple[SubPackage, ...] = (
            _mode(controller),
            _joints(controller),
            _cartesian(controller),
            kinematics,
            CalibrationData(),
            _masterboard(controller),
            _tool(controller),
            configuration,
            ForceModeData(),
            AdditionalInfo(),
            SAFETY_DATA,
            ToolCommunication(),
            ToolModeInfo(),
        )
        return encode_state(packages)


def _mode(controller: Controller) -> RobotModeData:
    state, safety = controller.programs.state, controller.safety.mode
    paused = state in PAUSED
    return RobotModeData(
        timestamp=round(controller.timestamp * 1e6),
        power_on=bool(controller.robot_status & RobotStatus.POWER_ON),
        emergency_stopped=safety in _EMERGENCY,
        protective_stopped=safety is SafetyMode.PROTECTIVE_STOP,
        program_running=controller.programs.running and not paused,
        program_paused=paused,
        robot_mode=controller.power.mode,
        target_speed_fraction=controller.speed_slider,
        speed_scaling=controller.speed_scaling,
    )


def _outputs(controller: Controller, names: Mapping[str, str]) -> dict[str, Any]:
    """Return fields with the values of RTDE outputs, so that the interface agrees with RTDE."""
    return {
        field: COMPUTED[name](controller) if name in COMPUTED else FIXED[name]
        for field, name in names.items()
    }


def _joints(controller: Controller) -> JointData:
    return JointData(**_outputs(controller, JOINT_OUTPUTS))


def _cartesian(controller: Controller) -> CartesianInfo:
    motion = controller.motion
    return CartesianInfo(
        tcp_pose=controller.actual.T_base_tcp.rotation_vector(),
        tcp_offset=motion.T_flange_tcp.rotation_vector(),
    )


def _masterboard(controller: Controller) -> MasterboardData:
    io = controller.io
    ain, aout = io.analog_in_voltage, io.analog_out_voltage
    return MasterboardData(
        digital_input_bits=io.digital_in.packed(),
        digital_output_bits=io.digital_out.packed(),
        analog_input_range=(int(ain[0]), int(ain[1])),
        analog_input=(io.analog_in[0], io.analog_in[1]),
        analog_output_domain=(int(aout[0]), int(aout[1])),
        analog_output=(io.analog_out[0], io.analog_out[1]),
        temperature=25.0,
        safety_mode=controller.safety.mode,
        **_outputs(controller, MASTERBOARD_OUTPUTS),
    )


def _tool(controller: Controller) -> ToolData:
    io = controller.io
    return ToolData(
        analog_input=(io.tool_analog_in[0], io.tool_analog_in[1]),
        output_voltage=io.tool_voltage,
        **_outputs(controller, TOOL_OUTPUTS),
    )


def _kinematics(controller: Controller) -> KinematicsInfo:
    geometry = controller.arm.geometry
    return KinematicsInfo(theta=geometry.theta, a=geometry.a, d=geometry.d, alpha=geometry.alpha)


def _configuration(controller: Controller) -> ConfigurationData:
    model, geometry = controller.arm.model, controller.arm.model.geometry
    limits = [
        (max(low, -_UNLIMITED), min(high, _UNLIMITED)) for low, high in model.position_limits
    ]
    a, b, c, d, e, f = limits
    s1, s2, s3, s4, s5, s6 = ((speed, _JOINT_ACCELERATION) for speed in model.max_joint_speed)
    return ConfigurationData(
        position_limits=(a, b, c, d, e, f),
        motion_limits=(s1, s2, s3, s4, s5, s6),
        a=geometry.a,
        d=geometry.d,
        alpha=geometry.alpha,
        theta=geometry.theta,
        controller_box_type=_CONTROLLER_BOXES.get(model.wire_type, 4),
        robot_type=model.wire_type,
        robot_sub_type=2 if model.series == 'CB3' else 3,
    )
