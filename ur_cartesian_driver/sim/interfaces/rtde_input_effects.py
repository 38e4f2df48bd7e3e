# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The effects of writing RTDE inputs.

The inputs that set the controller's outputs or its slider are accompanied by inputs with the masks
of the channels to set. A package is applied as a whole, so the order of masks and values in the
recipe does not matter.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from ur_cartesian_driver.sim.controller import Controller
from ur_cartesian_driver.sim.state.controller_io import Registers, single_registers

_DIGITAL = (
    ('standard', 'standard_digital_output'),
    ('configurable', 'configurable_digital_output'),
    ('tool', 'tool_digital_output'),
)


def apply_inputs(controller: Controller, values: Mapping[str, Any]) -> None:
    """Apply one input package, given as name -> value."""
    if values.get('speed_slider_mask', 0) & 1 and 'speed_slider_fraction' in values:
        controller.set_slider(values['speed_slider_fraction'])
    for side, name in _DIGITAL:
        mask = values.get(f'{name}_mask', 0)
        if mask and name in values:
            _set_masked(getattr(controller.io.digital_out, side), mask, values[name])
    if values.get('standard_analog_output_mask', 0):
        _set_analog(controller, values)
    if 'external_force_torque' in values:
        controller.io.external_force = values['external_force_torque']
    for name, value in values.items():
        if write := _WRITE.get(name):
            write(controller.io.inputs, value)
    controller.watchdogs.written(tuple(values), controller.time)


def _set_masked(bits: list[bool], mask: int, value: int) -> None:
    for i in range(len(bits)):
        if mask >> i & 1:
            bits[i] = bool(value >> i & 1)


def _set_analog(controller: Controller, values: Mapping[str, Any]) -> None:
    mask, io = values['standard_analog_output_mask'], controller.io
    types = values.get('standard_analog_output_type')
    for i in (0, 1):
        if mask >> i & 1:
            if types is not None:
                io.analog_out_voltage[i] = bool(types >> i & 1)
            if f'standard_analog_output_{i}' in values:
                io.set_analog_out(i, values[f'standard_analog_output_{i}'])


Write = Callable[[Registers, Any], None]


def _write_packed(first: int) -> Write:
    def write(registers: Registers, value: int) -> None:
        registers.bits[first : first + 32] = [bool(value >> i & 1) for i in range(32)]

    return write


def _write_item(values: str, i: int) -> Write:
    def write(registers: Registers, value: Any) -> None:
        getattr(registers, values)[i] = value

    return write


#: Input register -> the function that writes it; values have the types of the recipe.
_WRITE: Mapping[str, Write] = {
    'input_bit_registers0_to_31': _write_packed(0),
    'input_bit_registers32_to_63': _write_packed(32),
    **{name: _write_item(values, i) for name, values, i in single_registers('input')},
}
