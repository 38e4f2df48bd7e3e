# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The robot state on the real-time interface: the same values as in RTDE, once per cycle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields

from ur_cartesian_driver.protocol.client_interfaces.realtime import packet_size, RealtimeData
from ur_cartesian_driver.sim.controller import Controller
from ur_cartesian_driver.sim.rtde_output_values import output_getter

#: Field of the packet -> RTDE output with the same meaning.
OUTPUTS: Mapping[str, str] = {
    'time': 'timestamp',
    'q_target': 'target_q',
    'qd_target': 'target_qd',
    'qdd_target': 'target_qdd',
    'current_target': 'target_current',
    'moment_target': 'target_moment',
    'q_actual': 'actual_q',
    'qd_actual': 'actual_qd',
    'current_actual': 'actual_current',
    'current_control': 'joint_control_output',
    'tcp_pose_actual': 'actual_TCP_pose',
    'tcp_speed_actual': 'actual_TCP_speed',
    'tcp_force': 'actual_TCP_force',
    'tcp_pose_target': 'target_TCP_pose',
    'tcp_speed_target': 'target_TCP_speed',
    'digital_input_bits': 'actual_digital_input_bits',
    'joint_temperatures': 'joint_temperatures',
    'controller_timer': 'actual_execution_time',
    'robot_mode': 'robot_mode',
    'joint_modes': 'joint_mode',
    'safety_mode': 'safety_mode',
    'tool_accelerometer': 'actual_tool_accelerometer',
    'speed_scaling': 'speed_scaling',
    'momentum': 'actual_momentum',
    'main_voltage': 'actual_main_voltage',
    'robot_voltage': 'actual_robot_voltage',
    'robot_current': 'actual_robot_current',
    'joint_voltages': 'actual_joint_voltage',
    'digital_output_bits': 'actual_digital_output_bits',
    'program_state': 'runtime_state',
    'elbow_position': 'elbow_position',
    'elbow_velocity': 'elbow_velocity',
    'safety_status': 'safety_status',
    'payload_mass': 'payload',
    'payload_cog': 'payload_cog',
    'payload_inertia': 'payload_inertia',
}


class RealtimeStream:
    """The packets that all clients of the real-time interface get."""

    def __init__(self, controller: Controller) -> None:
        """Look up the function that computes each field."""
        self._controller = controller
        self._size = packet_size(controller.config.version)
        self._getters = [
            (field.name, output_getter(OUTPUTS[field.name], field.default))
            for field in fields(RealtimeData)
            if field.name in OUTPUTS
        ]

    def packet(self) -> bytes:
        """Return the packet of this cycle."""
        controller = self._controller
        return RealtimeData(**{name: get(controller) for name, get in self._getters}).encode(
            self._size
        )
