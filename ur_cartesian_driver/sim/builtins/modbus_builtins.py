# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The Modbus signals of programs, kept in memory without any devices.

To a program, each device seems to answer but does nothing: inputs stay 0, and outputs keep the
values that were written. A program therefore runs until it waits for a machine to react.
"""

from __future__ import annotations

from dataclasses import dataclass

from ur_cartesian_driver.sim.builtins.arguments import index, not_negative, one_of, text
from ur_cartesian_driver.sim.builtins.builtin_group import BuiltinGroup
from ur_cartesian_driver.sim.controller import Controller
from ur_cartesian_driver.urscript.script_errors import RuntimeException
from ur_cartesian_driver.urscript.script_values import truth, type_name, Value

#: Initial value of a signal, and whether the signal is an output; the index is `signal_type`.
SIGNAL_TYPES = ((False, False), (False, True), (0, False), (0, True))
MAX_REGISTERS = 123


@dataclass(slots=True)
class _Signal:
    value: Value
    is_output: bool
    registers_to_write: int = 1


class ModbusBuiltins(BuiltinGroup):
    """Signals exist until they are deleted, even after their program has ended."""

    def __init__(self, controller: Controller) -> None:
        """Begin without signals, like a robot whose installation has none."""
        super().__init__(controller)
        self._signals: dict[str, _Signal] = {}

    def _signal(self, name: Value) -> _Signal:
        signal = self._signals.get(text(name, 'signal_name'))
        if signal is None:
            raise RuntimeException(
                f'There is no Modbus signal {name!r}; add it with modbus_add_signal.'
            )
        return signal

    def modbus_add_signal(
        self,
        IP: Value,
        slave_number: Value,
        signal_address: Value,
        signal_type: Value,
        signal_name: Value,
        sequential_mode: Value = False,
        register_count: Value = 1,
    ) -> None:
        """
        Add or replace a signal.

        :param signal_type: 0 = digital input, 1 = digital output, 2 = input register, 3 = output
            register.
        :param register_count: if it is more than one, the value of the signal is a list.
        """
        text(IP, 'IP')
        index(slave_number, 'slave_number', 256)
        index(signal_address, 'signal_address', 2**16)
        count = index(register_count, 'register_count', MAX_REGISTERS + 1)
        value, is_output = SIGNAL_TYPES[index(signal_type, 'signal_type', 4)]
        self._signals[text(signal_name, 'signal_name')] = _Signal(
            [value] * count if count > 1 else value, is_output, registers_to_write=count
        )

    def modbus_add_rw_signal(
        self,
        IP: Value,
        slave_number: Value,
        read_address: Value,
        read_register_count: Value,
        write_address: Value,
        write_register_count: Value,
        signal_name: Value,
        sequential_mode: Value = False,
    ) -> None:
        """Add or replace a signal that reads some registers and writes others."""
        text(IP, 'IP')
        index(slave_number, 'slave_number', 256)
        index(read_address, 'read_address', 2**16)
        index(write_address, 'write_address', 2**16)
        count = index(read_register_count, 'read_register_count', MAX_REGISTERS + 1)
        written = index(write_register_count, 'write_register_count', MAX_REGISTERS + 1)
        signal = _Signal([0] * count, is_output=False, registers_to_write=written)
        self._signals[text(signal_name, 'signal_name')] = signal

    def modbus_delete_signal(self, signal_name: Value) -> None:
        """Delete a signal; an unknown name is no error."""
        self._signals.pop(text(signal_name, 'signal_name'), None)

    def modbus_get_signal_status(
        self, signal_name: Value, is_secondary_program: Value = False
    ) -> Value:
        """Return the value of a signal: a bool, a register, or a list of registers."""
        value = self._signal(signal_name).value
        return value[:] if type(value) is list else value

    def modbus_get_error(self, signal_name: Value) -> int:
        """Return 0 (no error), because every device seems to answer."""
        self._signal(signal_name)
        return 0

    def modbus_set_output_register(
        self, signal_name: Value, register_value: Value, is_secondary_program: Value = False
    ) -> None:
        """Write one register or, for a signal that reads and writes, the list of all registers."""
        signal = self._signal(signal_name)
        given = register_value if type(register_value) is list else [register_value]
        if len(given) != signal.registers_to_write:
            raise RuntimeException(
                f'register_value has {len(given)} registers; the signal {signal_name!r} writes '
                f'{signal.registers_to_write}'
            )
        values = [index(value, 'register_value', 2**16) for value in given]
        if signal.is_output:
            _check_kind(signal, int, signal_name)
            signal.value = values[0]

    def modbus_set_output_signal(
        self, signal_name: Value, digital_value: Value, is_secondary_program: Value = False
    ) -> None:
        """Write a digital output."""
        signal = self._signal(signal_name)
        _check_kind(signal, bool, signal_name)
        if signal.is_output:
            signal.value = truth(digital_value)

    def modbus_send_custom_command(
        self, IP: Value, slave_number: Value, function_code: Value, data: Value
    ) -> None:
        """Check the arguments; no device is simulated that could receive the bytes."""
        text(IP, 'IP')
        index(slave_number, 'slave_number', 256)
        index(function_code, 'function_code', 256)
        if type(data) is not list:
            raise RuntimeException(f'Type error: data must be a list, not a {type_name(data)}')

    def modbus_set_digital_input_action(self, signal_name: Value, action: Value) -> None:
        """Assign an action to an input."""
        self._signal(signal_name)
        text(action, 'action')

    def modbus_set_runstate_dependent_choice(
        self, signal_name: Value, runstate_choice: Value
    ) -> None:
        """Tie an output to the program state."""
        self._signal(signal_name)
        one_of(runstate_choice, 'runstate_choice', (0, 1, 2, 3))

    def modbus_set_signal_update_frequency(
        self, signal_name: Value, update_frequency: Value
    ) -> None:
        """Check the rate [Hz] at which a real device would be polled."""
        self._signal(signal_name)
        not_negative(update_frequency, 'update_frequency')


def _check_kind(signal: _Signal, kind: type, name: Value) -> None:
    if type(signal.value) is not kind:
        wanted = 'register' if kind is int else 'digital'
        raise RuntimeException(f'The Modbus signal {name!r} is no {wanted} signal.')
