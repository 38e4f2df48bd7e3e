# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The packet of the real-time interface (port 30003), which the controller sends in every cycle.

It begins with its ``int32`` size, these four bytes included. Then come only doubles, even for
integers such as modes and the bits of the inputs; all numbers are big-endian. Newer software
appended fields and never changed earlier ones, so one table describes all versions; the size
determines the last field::

    size [bytes]   from PolyScope    the last field
    1060           3.2               program_state
    1108           3.5, 5.0          elbow_velocity
    1116           3.10, 5.4         safety_status
    1140           3.14, 5.9         three values for the manufacturer only
    1220           5.10              payload_inertia

Source: the manufacturer's public tables of the client interfaces.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
import struct
from typing import Final

from ur_cartesian_driver.motion.errors import LocalProtocolError
from ur_cartesian_driver.motion.geometry.vectors import Vector3, Vector6, ZERO3, ZERO6

#: Versions (major, minor) that changed the size of the packet, and the new size [bytes].
_PACKET_SIZES: Final = (
    ((3, 2), 1060),
    ((3, 5), 1108),
    ((3, 10), 1116),
    ((3, 14), 1140),
    ((5, 0), 1108),
    ((5, 4), 1116),
    ((5, 9), 1140),
    ((5, 10), 1220),
)
PACKET_SIZES: Final = frozenset(size for _, size in _PACKET_SIZES)


@dataclass(frozen=True, slots=True, kw_only=True)
class RealtimeData:
    """
    One packet, with its fields in wire order; fields that an older packet lacks are 0.

    Units of the joints are rad, rad/s, rad/s^2, A, Nm and V. Poses [m, rad (rotation vector)] and
    twists [m/s, rad/s] of the TCP are in the base frame. ``reserved_*`` are for the manufacturer.
    """

    #: Time since the start of the controller [s].
    time: float
    q_target: Vector6 = ZERO6
    qd_target: Vector6 = ZERO6
    qdd_target: Vector6 = ZERO6
    current_target: Vector6 = ZERO6
    moment_target: Vector6 = ZERO6
    q_actual: Vector6 = ZERO6
    qd_actual: Vector6 = ZERO6
    current_actual: Vector6 = ZERO6
    current_control: Vector6 = ZERO6
    tcp_pose_actual: Vector6 = ZERO6
    tcp_speed_actual: Vector6 = ZERO6
    #: Force and torque [N, Nm].
    tcp_force: Vector6 = ZERO6
    tcp_pose_target: Vector6 = ZERO6
    tcp_speed_target: Vector6 = ZERO6
    digital_input_bits: float = 0.0
    #: Temperatures [degrees Celsius].
    joint_temperatures: Vector6 = ZERO6
    #: Computing time of the cycle [s].
    controller_timer: float = 0.0
    reserved_test: float = 0.0
    robot_mode: float = 0.0
    joint_modes: Vector6 = ZERO6
    safety_mode: float = 0.0
    reserved_1: Vector6 = ZERO6
    #: Acceleration of the tool [m/s^2].
    tool_accelerometer: Vector3 = ZERO3
    reserved_2: Vector6 = ZERO6
    speed_scaling: float = 0.0
    #: Momentum of the arm [kg m/s].
    momentum: float = 0.0
    reserved_3: float = 0.0
    reserved_4: float = 0.0
    main_voltage: float = 0.0
    robot_voltage: float = 0.0
    robot_current: float = 0.0
    joint_voltages: Vector6 = ZERO6
    digital_output_bits: float = 0.0
    program_state: float = 0.0
    elbow_position: Vector3 = ZERO3
    elbow_velocity: Vector3 = ZERO3
    safety_status: float = 0.0
    reserved_5: Vector3 = ZERO3
    #: Mass [kg]; centre of gravity [m]; inertia [kg m^2] as Ixx, Iyy, Izz, Ixy, Ixz, Iyz.
    payload_mass: float = 0.0
    payload_cog: Vector3 = ZERO3
    payload_inertia: Vector6 = ZERO6

    def encode(self, size: int) -> bytes:
        """
        Return the packet.

        :param size: size of the packet [bytes]; fields that do not fit into it are omitted.
        :raises LocalProtocolError: no packet has this size.
        """
        if size not in PACKET_SIZES:
            raise LocalProtocolError(
                f'A real-time packet has {sorted(PACKET_SIZES)} bytes, not {size}.'
            )
        numbers = [number for field in fields(self) for number in _flat(getattr(self, field.name))]
        count = (size - 4) // 8
        return struct.pack(f'>i{count}d', size, *numbers[:count])


def packet_size(version: tuple[int, ...]) -> int:
    """
    Return the size of a controller's packets [bytes].

    :param version: PolyScope version: major, minor; further numbers are ignored.
    """
    found = _PACKET_SIZES[0][1]
    for first, size in _PACKET_SIZES:
        if version[:2] >= first:
            found = size
    return found


def _flat(value: float | tuple[float, ...]) -> tuple[float, ...]:
    return value if isinstance(value, tuple) else (value,)
