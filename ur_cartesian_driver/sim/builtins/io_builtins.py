# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Functions of a program on inputs, outputs, flags and registers."""

from __future__ import annotations

from ur_cartesian_driver.sim.builtins.arguments import index, number, whole
from ur_cartesian_driver.sim.state.controller_io import (
    ControllerIo,
    PORTS,
    REGISTER_BITS,
    REGISTER_FLOATS,
    REGISTER_INTEGERS,
)
from ur_cartesian_driver.urscript.script_errors import RuntimeException
from ur_cartesian_driver.urscript.script_values import INT_MAX, INT_MIN, truth, Value


class DigitalBuiltins:
    """Digital inputs and outputs, and flags."""

    def __init__(self, io: ControllerIo) -> None:
        """Work on these signals."""
        self._io = io

    def set_standard_digital_out(self, n: Value, b: Value) -> None:
        """Set one of 8."""
        self._io.digital_out.standard[index(n, 'n', 8)] = truth(b)

    def set_configurable_digital_out(self, n: Value, b: Value) -> None:
        """Set one of 8."""
        self._io.digital_out.configurable[index(n, 'n', 8)] = truth(b)

    def set_tool_digital_out(self, n: Value, b: Value) -> None:
        """Set one of 2."""
        self._io.digital_out.tool[index(n, 'n', 2)] = truth(b)

    def set_digital_out(self, n: Value, b: Value) -> None:
        """Set standard 0-7, or tool 0-1 as 8-9: the old numbering."""
        channel = index(n, 'n', 10)
        if channel < 8:
            self.set_standard_digital_out(channel, b)
        else:
            self.set_tool_digital_out(channel - 8, b)

    def get_standard_digital_out(self, n: Value) -> bool:
        """Read one of 8."""
        return self._io.digital_out.standard[index(n, 'n', 8)]

    def get_configurable_digital_out(self, n: Value) -> bool:
        """Read one of 8."""
        return self._io.digital_out.configurable[index(n, 'n', 8)]

    def get_tool_digital_out(self, n: Value) -> bool:
        """Read one of 2."""
        return self._io.digital_out.tool[index(n, 'n', 2)]

    def get_digital_out(self, n: Value) -> bool:
        """Read with the old numbering."""
        outputs = self._io.digital_out
        return (outputs.standard + outputs.tool)[index(n, 'n', 10)]

    def get_standard_digital_in(self, n: Value) -> bool:
        """Read one of 8."""
        return self._io.digital_in.standard[index(n, 'n', 8)]

    def get_configurable_digital_in(self, n: Value) -> bool:
        """Read one of 8."""
        return self._io.digital_in.configurable[index(n, 'n', 8)]

    def get_tool_digital_in(self, n: Value) -> bool:
        """Read one of 2."""
        return self._io.digital_in.tool[index(n, 'n', 2)]

    def get_digital_in(self, n: Value) -> bool:
        """Read with the old numbering."""
        inputs = self._io.digital_in
        return (inputs.standard + inputs.tool)[index(n, 'n', 10)]

    def set_flag(self, n: Value, b: Value) -> None:
        """Set one of 32 flags, which survive the program."""
        self._io.flags[index(n, 'n', 32)] = truth(b)

    def get_flag(self, n: Value) -> bool:
        """Read a flag."""
        return self._io.flags[index(n, 'n', 32)]


class AnalogBuiltins:
    """Analog inputs and outputs and the tool's supply."""

    def __init__(self, io: ControllerIo) -> None:
        """Work on these signals."""
        self._io = io

    def set_standard_analog_out(self, n: Value, f: Value) -> None:
        """Set to a fraction 0..1 of the range."""
        self._io.set_analog_out(index(n, 'n', 2), number(f, 'f'))

    def set_analog_out(self, n: Value, f: Value) -> None:
        """Do as `set_standard_analog_out`: the old name."""
        self.set_standard_analog_out(n, f)

    def get_standard_analog_out(self, n: Value) -> float:
        """Read [V or A]."""
        return self._io.analog_out[index(n, 'n', 2)]

    def get_analog_out(self, n: Value) -> float:
        """Read [V or A]: the old name."""
        return self.get_standard_analog_out(n)

    def get_standard_analog_in(self, n: Value) -> float:
        """Read [V or A]."""
        return self._io.analog_in[index(n, 'n', 2)]

    def get_tool_analog_in(self, n: Value) -> float:
        """Read [V or A]."""
        return self._io.tool_analog_in[index(n, 'n', 2)]

    def get_analog_in(self, n: Value) -> float:
        """Read standard 0-1, or tool 0-1 as 2-3: the old numbering."""
        return (self._io.analog_in + self._io.tool_analog_in)[index(n, 'n', 4)]

    def set_analog_outputdomain(self, port: Value, domain: Value) -> None:
        """Choose 0 = current, 1 = voltage."""
        self._io.analog_out_voltage[index(port, 'port', 2)] = bool(whole(domain, 'domain'))

    def set_standard_analog_input_domain(self, port: Value, domain: Value) -> None:
        """Choose 0 = current, 1 = voltage."""
        self._io.analog_in_voltage[index(port, 'port', 2)] = bool(whole(domain, 'domain'))

    def set_tool_voltage(self, voltage: Value) -> None:
        """Set the tool's supply to 0, 12 or 24 V; a float will do."""
        volts = whole(voltage, 'voltage')
        if volts not in (0, 12, 24):
            raise RuntimeException(f'voltage is {volts}; it must be 0, 12 or 24')
        self._io.tool_voltage = volts

    def set_tool_communication(
        self,
        enabled: Value,
        baud_rate: Value,
        parity: Value,
        stop_bits: Value,
        rx_idle_chars: Value,
        tx_idle_chars: Value,
    ) -> None:
        """Accept settings of the tool's serial line, which ends nowhere."""


class PortBuiltins:
    """Ports: on a robot Modbus clients see them, here they are memory that survives programs."""

    def __init__(self, io: ControllerIo) -> None:
        """Work on these signals."""
        self._io = io

    def read_port_bit(self, address: Value) -> bool:
        """Read one of 256."""
        return self._io.port_bits[index(address, 'address', PORTS)]

    def read_port_register(self, address: Value) -> int:
        """Read one of 256."""
        return self._io.port_registers[index(address, 'address', PORTS)]

    def write_port_bit(self, address: Value, value: Value) -> None:
        """Write one of 256."""
        self._io.port_bits[index(address, 'address', PORTS)] = truth(value)

    def write_port_register(self, address: Value, value: Value) -> None:
        """Write one of 256, with 16 bits each."""
        self._io.port_registers[index(address, 'address', PORTS)] = index(value, 'value', 2**16)


class RegisterBuiltins:
    """General purpose registers: what RTDE clients write is read-only here."""

    def __init__(self, io: ControllerIo) -> None:
        """Work on these signals."""
        self._in, self._out = io.inputs, io.outputs

    def read_input_boolean_register(self, address: Value) -> bool:
        """Read one of 128."""
        return self._in.bits[index(address, 'address', REGISTER_BITS)]

    def read_input_integer_register(self, address: Value) -> int:
        """Read one of 48."""
        return self._in.integers[index(address, 'address', REGISTER_INTEGERS)]

    def read_input_float_register(self, address: Value) -> float:
        """Read one of 48."""
        return self._in.floats[index(address, 'address', REGISTER_FLOATS)]

    def read_output_boolean_register(self, address: Value) -> bool:
        """Read one of 128."""
        return self._out.bits[index(address, 'address', REGISTER_BITS)]

    def read_output_integer_register(self, address: Value) -> int:
        """Read one of 48."""
        return self._out.integers[index(address, 'address', REGISTER_INTEGERS)]

    def read_output_float_register(self, address: Value) -> float:
        """Read one of 48."""
        return self._out.floats[index(address, 'address', REGISTER_FLOATS)]

    def write_output_boolean_register(self, address: Value, value: Value) -> None:
        """Write one of 128."""
        self._out.bits[index(address, 'address', REGISTER_BITS)] = truth(value)

    def write_output_integer_register(self, address: Value, value: Value) -> None:
        """Write one of 48."""
        number_ = whole(value, 'value')
        if not INT_MIN <= number_ <= INT_MAX:
            raise RuntimeException(f'value is {number_}; it must fit into 32 bits')
        self._out.integers[index(address, 'address', REGISTER_INTEGERS)] = number_

    def write_output_float_register(self, address: Value, value: Value) -> None:
        """Write one of 48."""
        self._out.floats[index(address, 'address', REGISTER_FLOATS)] = number(value, 'value')
