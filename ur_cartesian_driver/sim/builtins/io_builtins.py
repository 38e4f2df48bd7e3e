# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Script functions for inputs, outputs, flags, ports and registers.

Most of them read or write one item of a list in :class:`ControllerIo`; each class body is a table
of such functions.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from ur_cartesian_driver.sim.builtins.arguments import (
    index,
    int32,
    number,
    whole,
    whole_within,
)
from ur_cartesian_driver.sim.builtins.builtin_group import BuiltinGroup, without_effect
from ur_cartesian_driver.sim.state.controller_io import ControllerIo
from ur_cartesian_driver.urscript.script_errors import RuntimeException
from ur_cartesian_driver.urscript.script_values import truth, Value

T = TypeVar('T')
_Items = Callable[[ControllerIo], list[T]]


class _IoGroup(BuiltinGroup):
    @property
    def _io(self) -> ControllerIo:
        return self._controller.io


def _get_n(items: _Items[T]) -> Callable[[Any, Value], T]:
    """Return the script function that reads item ``n`` of a list."""

    def get(group: _IoGroup, n: Value) -> T:
        values = items(group._io)
        return values[index(n, 'n', len(values))]

    return get


def _set_n(items: _Items[bool]) -> Callable[[Any, Value, Value], None]:
    """Return the script function that sets item ``n`` of a list."""

    def set_(group: _IoGroup, n: Value, b: Value) -> None:
        values = items(group._io)
        values[index(n, 'n', len(values))] = truth(b)

    return set_


def _read(items: _Items[T]) -> Callable[[Any, Value], T]:
    """Return the script function that reads the item at an address."""

    def read(group: _IoGroup, address: Value) -> T:
        values = items(group._io)
        return values[index(address, 'address', len(values))]

    return read


def _write(
    items: _Items[T], checked: Callable[[Value, str], T]
) -> Callable[[Any, Value, Value], None]:
    """Return the script function that writes the item at an address."""

    def write(group: _IoGroup, address: Value, value: Value) -> None:
        values, new = items(group._io), checked(value, 'value')
        values[index(address, 'address', len(values))] = new

    return write


def _truth(value: Value, _: str) -> bool:
    return truth(value)


def _word(value: Value, name: str) -> int:
    """Return the 16 bits of a word, which programs write with or without a sign."""
    return whole_within(value, name, -(2**15), 2**16 - 1) & 0xFFFF


class DigitalBuiltins(_IoGroup):
    """Digital inputs, digital outputs and flags; flags outlive the program."""

    set_standard_digital_out = _set_n(lambda io: io.digital_out.standard)
    set_configurable_digital_out = _set_n(lambda io: io.digital_out.configurable)
    set_tool_digital_out = _set_n(lambda io: io.digital_out.tool)
    get_standard_digital_out = _get_n(lambda io: io.digital_out.standard)
    get_configurable_digital_out = _get_n(lambda io: io.digital_out.configurable)
    get_tool_digital_out = _get_n(lambda io: io.digital_out.tool)
    get_standard_digital_in = _get_n(lambda io: io.digital_in.standard)
    get_configurable_digital_in = _get_n(lambda io: io.digital_in.configurable)
    get_tool_digital_in = _get_n(lambda io: io.digital_in.tool)
    # The old numbering: standard 0-7, tool 8-9.
    get_digital_out = _get_n(lambda io: io.digital_out.standard + io.digital_out.tool)
    get_digital_in = _get_n(lambda io: io.digital_in.standard + io.digital_in.tool)
    set_flag = _set_n(lambda io: io.flags)
    get_flag = _get_n(lambda io: io.flags)

    def set_digital_out(self, n: Value, b: Value) -> None:
        """Set an output by its old number: standard 0-7, tool 8-9."""
        channel, outputs = index(n, 'n', 10), self._io.digital_out
        side, i = (outputs.standard, channel) if channel < 8 else (outputs.tool, channel - 8)
        side[i] = truth(b)


class AnalogBuiltins(_IoGroup):
    """Analog inputs and outputs [V or A], and the supply voltage of the tool."""

    get_standard_analog_out = _get_n(lambda io: io.analog_out)
    get_analog_out = get_standard_analog_out  # the old name
    get_standard_analog_in = _get_n(lambda io: io.analog_in)
    get_tool_analog_in = _get_n(lambda io: io.tool_analog_in)
    # The old numbering: standard 0-1, tool 2-3.
    get_analog_in = _get_n(lambda io: io.analog_in + io.tool_analog_in)

    def set_standard_analog_out(self, n: Value, f: Value) -> None:
        """Set an analog output to a fraction 0..1 of its range."""
        self._io.set_analog_out(index(n, 'n', 2), number(f, 'f'))

    set_analog_out = set_standard_analog_out  # the old name

    def set_analog_outputdomain(self, port: Value, domain: Value) -> None:
        """Choose the domain of an analog output: 0 = current, 1 = voltage."""
        self._io.analog_out_voltage[index(port, 'port', 2)] = bool(whole(domain, 'domain'))

    def set_standard_analog_input_domain(self, port: Value, domain: Value) -> None:
        """Choose the domain of an analog input: 0 = current, 1 = voltage."""
        self._io.analog_in_voltage[index(port, 'port', 2)] = bool(whole(domain, 'domain'))

    def set_tool_voltage(self, voltage: Value) -> None:
        """Set the supply voltage of the tool to 0, 12 or 24 V; whole floats are accepted."""
        volts = whole(voltage, 'voltage')
        if volts not in (0, 12, 24):
            raise RuntimeException(f'voltage is {volts}; it must be 0, 12 or 24')
        self._io.tool_voltage = volts

    @without_effect
    def set_tool_communication(
        self,
        enabled: Value,
        baud_rate: Value,
        parity: Value,
        stop_bits: Value,
        rx_idle_chars: Value,
        tx_idle_chars: Value,
    ) -> None:
        """Accept any settings of the tool's serial line, which has no simulated device."""


class PortBuiltins(_IoGroup):
    """Ports, shared with Modbus clients on a real robot; here, memory that outlives programs."""

    read_port_bit = _read(lambda io: io.port_bits)

    def read_port_register(self, address: Value) -> int:
        """Return a word with its sign, -32768..32767."""
        registers = self._io.port_registers
        word = registers[index(address, 'address', len(registers))]
        return word - 2**16 if word >= 2**15 else word

    write_port_bit = _write(lambda io: io.port_bits, _truth)
    write_port_register = _write(lambda io: io.port_registers, _word)


class RegisterBuiltins(_IoGroup):
    """General purpose registers; RTDE clients write the input registers, programs read them."""

    read_input_boolean_register = _read(lambda io: io.inputs.bits)
    read_input_integer_register = _read(lambda io: io.inputs.integers)
    read_input_float_register = _read(lambda io: io.inputs.floats)
    read_output_boolean_register = _read(lambda io: io.outputs.bits)
    read_output_integer_register = _read(lambda io: io.outputs.integers)
    read_output_float_register = _read(lambda io: io.outputs.floats)
    write_output_boolean_register = _write(lambda io: io.outputs.bits, _truth)
    write_output_integer_register = _write(lambda io: io.outputs.integers, int32)
    write_output_float_register = _write(lambda io: io.outputs.floats, number)
