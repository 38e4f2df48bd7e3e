# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Packets of the real-time interface, read by the manufacturer's tables of field places."""

from __future__ import annotations

import struct
from typing import Any

from ur_cartesian_driver.protocol.client_interfaces.realtime import RealtimeData

#: First byte of a field, from the manufacturer's tables.
PLACES = {
    'time': 4,
    'q_target': 12,
    'qd_target': 60,
    'qdd_target': 108,
    'current_target': 156,
    'moment_target': 204,
    'q_actual': 252,
    'qd_actual': 300,
    'current_actual': 348,
    'current_control': 396,
    'tcp_pose_actual': 444,
    'tcp_speed_actual': 492,
    'tcp_force': 540,
    'tcp_pose_target': 588,
    'tcp_speed_target': 636,
    'digital_input_bits': 684,
    'joint_temperatures': 692,
    'controller_timer': 740,
    'robot_mode': 756,
    'joint_modes': 764,
    'safety_mode': 812,
    'tool_accelerometer': 868,
    'speed_scaling': 940,
    'momentum': 948,
    'main_voltage': 972,
    'robot_voltage': 980,
    'robot_current': 988,
    'joint_voltages': 996,
    'digital_output_bits': 1044,
    'program_state': 1052,
    'elbow_position': 1060,
    'elbow_velocity': 1084,
    'safety_status': 1108,
    'payload_mass': 1140,
    'payload_cog': 1148,
    'payload_inertia': 1172,
}
EMPTY = RealtimeData(time=0.0)


def size_of(name: str) -> int:
    """Return the number of doubles in a field."""
    value = getattr(EMPTY, name)
    return len(value) if isinstance(value, tuple) else 1


def read_packet(packet: bytes) -> RealtimeData:
    """Return the content of a packet of 1220 bytes; fields for the manufacturer are 0."""
    values: dict[str, Any] = {}
    for name, place in PLACES.items():
        numbers = struct.unpack_from(f'>{size_of(name)}d', packet, place)
        values[name] = numbers[0] if len(numbers) == 1 else numbers
    return RealtimeData(**values)
