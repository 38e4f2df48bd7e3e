# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Names and types of all RTDE fields, and the first software versions of newer fields.

A controller answers ``NOT_FOUND`` for a field that its software does not have.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
import re


class DataType(Enum):
    """A type with its name on the wire and its ``struct`` codes (big-endian, unpadded)."""

    BOOL = '?'
    UINT8 = 'B'
    UINT32 = 'I'
    UINT64 = 'Q'
    INT32 = 'i'
    DOUBLE = 'd'
    VECTOR3D = 'ddd'
    VECTOR6D = 'dddddd'
    VECTOR6INT32 = 'iiiiii'
    VECTOR6UINT32 = 'IIIIII'

    @property
    def codes(self) -> str:
        """Return one struct code for each number."""
        return self.value

    @property
    def length(self) -> int:
        """Return the count of numbers in a value; 1 = not a vector."""
        return len(self.value)

    @property
    def zero(self) -> float | tuple[float, ...]:
        """Return the value that is zero everywhere: a number, or a vector of them."""
        number = 0.0 if self.value[0] == 'd' else 0
        return number if self.length == 1 else (number,) * self.length


#: Number of int registers, and of double registers, reserved for fieldbuses: from 0 on.
LOWER_REGISTERS = 24
#: Matches the name of an int or double register, and captures its number.
REGISTER = re.compile(r'(?:in|out)put_(?:int|double)_register_(\d+)')


def in_lower_half(name: str) -> str:
    """Return a register's name, 24 to 47, moved to 0 to 23; any other name stays as it is."""
    match = REGISTER.fullmatch(name)
    if match is None:
        return name
    return f'{name[: match.start(1)]}{int(match[1]) - LOWER_REGISTERS}'


def _registers(direction: str) -> dict[str, DataType]:
    """Return the general purpose registers of one direction."""
    return {
        f'{direction}_bit_registers0_to_31': DataType.UINT32,
        f'{direction}_bit_registers32_to_63': DataType.UINT32,
        **{f'{direction}_bit_register_{i}': DataType.BOOL for i in range(64, 128)},
        **{f'{direction}_int_register_{i}': DataType.INT32 for i in range(48)},
        **{f'{direction}_double_register_{i}': DataType.DOUBLE for i in range(48)},
    }


def _table(names: Mapping[DataType, str]) -> dict[str, DataType]:
    return {name: data_type for data_type, text in names.items() for name in text.split()}


#: Fields that a client may write.
INPUT_TYPES: Mapping[str, DataType] = {
    **_table(
        {
            DataType.UINT32: 'speed_slider_mask',
            DataType.DOUBLE: (
                'speed_slider_fraction standard_analog_output_0 standard_analog_output_1'
            ),
            DataType.UINT8: """
            standard_digital_output_mask standard_digital_output configurable_digital_output_mask
            configurable_digital_output tool_digital_output_mask tool_digital_output
            standard_analog_output_mask standard_analog_output_type""",
            DataType.VECTOR6D: 'external_force_torque',
        }
    ),
    **_registers('input'),
}

#: Fields that a client may read; the input registers can be read back.
OUTPUT_TYPES: Mapping[str, DataType] = {
    **_table(
        {
            DataType.DOUBLE: """
            timestamp actual_execution_time target_execution_time speed_scaling
            target_speed_fraction actual_momentum actual_main_voltage actual_robot_voltage
            actual_robot_current standard_analog_input0 standard_analog_input1
            standard_analog_output0 standard_analog_output1 io_current
            actual_robot_energy_consumed actual_robot_braking_energy_dissipated
            euromap67_24V_voltage euromap67_24V_current tool_analog_input0 tool_analog_input1
            tool_output_current tool_temperature tcp_force_scalar joint_position_deviation_ratio
            collision_detection_ratio payload""",
            DataType.VECTOR6D: """
            target_q target_qd target_qdd target_current target_moment actual_q actual_qd
            actual_current actual_current_window actual_current_as_torque joint_control_output
            actual_TCP_pose actual_TCP_speed actual_TCP_force target_TCP_pose target_TCP_speed
            tcp_offset actual_TCP_acceleration target_TCP_acceleration joint_temperatures
            actual_joint_voltage ft_raw_wrench wrench_calc_from_currents payload_inertia
            target_base_acceleration target_base_wrench""",
            DataType.VECTOR3D: """
            actual_tool_accelerometer elbow_position elbow_velocity payload_cog target_gravity""",
            DataType.VECTOR6INT32: 'joint_mode',
            DataType.UINT64: """
            actual_digital_input_bits actual_configurable_digital_input_bits
            actual_digital_output_bits actual_configurable_digital_output_bits control_step""",
            DataType.INT32: """
            robot_mode safety_mode safety_status encoder0_raw encoder1_raw tool_output_voltage
            time_scale_source""",
            DataType.UINT32: """
            runtime_state robot_status_bits safety_status_bits analog_io_types
            euromap67_input_bits euromap67_output_bits tool_mode tool_analog_input_types
            script_control_line""",
            DataType.UINT8: """
            tool_output_mode tool_digital_output0_mode tool_digital_output1_mode""",
        }
    ),
    **_registers('input'),
    **_registers('output'),
}

#: Fields for which the manufacturer's guide gives a first software version: this version on CB3
#: (None = no version has them), the same on e-Series, and the pattern of their names. Registers
#: for fieldbuses are not in the table.
_INTRODUCED: tuple[tuple[tuple[int, ...] | None, tuple[int, ...], str], ...] = (
    ((3, 5), (5, 0), r'elbow_(position|velocity)'),
    ((3, 9), (5, 3), r'\w+_bit_register_\d+|\w+_(int|double)_register_(2[4-9]|[34]\d)'),
    ((3, 10), (5, 4), r'safety_status'),
    ((3, 11), (5, 5, 1), r'payload(_cog)?'),
    ((3, 14), (5, 9), r'script_control_line'),
    ((3, 15), (5, 11), r'payload_inertia'),
    (None, (5, 9), r'ft_raw_wrench'),
)


def fields_of(types: Mapping[str, DataType], version: tuple[int, ...]) -> dict[str, DataType]:
    """Return the fields of ``types`` that a software version has."""
    missing = [
        re.compile(pattern)
        for cb3, e_series, pattern in _INTRODUCED
        if (first := e_series if version >= (5,) else cb3) is None or version < first
    ]
    return {
        name: data_type
        for name, data_type in types.items()
        if not any(pattern.fullmatch(name) for pattern in missing)
    }
