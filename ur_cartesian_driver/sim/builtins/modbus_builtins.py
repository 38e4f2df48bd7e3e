# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The Modbus signals of programs, kept in memory without any devices.

To a program, each device seems to answer but does nothing: inputs stay 0, and outputs keep the
values that programs write. A program therefore runs until it waits for a machine to react.
"""

from __future__ import annotations

from dataclasses import dataclass

from ur_cartesian_driver.sim.builtins.arguments import (
    index,
    one_of,
    text,
    whole_within,
    within,
)
from ur_cartesian_driver.sim.builtins.builtin_group import BuiltinGroup, without_effect
from ur_cartesian_driver.sim.controller import Controller
from ur_cartesian_driver.urscript.script_errors import RuntimeException
from ur_cartesian_driver.urscript.script_values import truth, type_name, Value

#: Initial value of a signal, and whether the signal is an output, by `signal_type`.
SIGNAL_TYPES = {
    0: (False, False),
    1: (False, True),
    2: (0, False),
    3: (0, True),
    15: (False, True),
    16: (0, True),
}
#: Largest number of values of a signal.
MAX_REGISTERS = 123


@dataclass(slots=True)
class _Signal:
    values: list[Value]
    is_output: bool
    #: Number of values that a program can write.
    writable: int

    @property
    def kind(self) -> type:
        return type(self.values[0])


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
            register, 15 = several digital outputs, 16 = several output registers.
        :param register_count: if it is more than one, the value of the signal is a list.
        """
        text(IP, 'IP')
        index(slave_number, 'slave_number', 256)
        index(signal_address, 'signal_address', 2**16)
        count = _count(register_count, 'register_count')
        value, is_output = SIGNAL_TYPES[one_of(signal_type, 'signal_type', tuple(SIGNAL_TYPES))]
        signal = _Signal([value] * count, is_output, writable=count)
        self._signals[text(signal_name, 'signal_name')] = signal

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
        """Add or replace a signal that reads registers (always 0) and writes others (ignored)."""
        text(IP, 'IP')
        index(slave_number, 'slave_number', 256)
        index(read_address, 'read_address', 2**16)
        index(write_address, 'write_address', 2**16)
        count = _count(read_register_count, 'read_register_count')
        written = _count(write_register_count, 'write_register_count')
        signal = _Signal([0] * count, is_output=False, writable=written)
        self._signals[text(signal_name, 'signal_name')] = signal

    def modbus_delete_signal(self, signal_name: Value) -> None:
        """Delete a signal; an unknown name is no error."""
        self._signals.pop(text(signal_name, 'signal_name'), None)

    def modbus_get_signal_status(
        self, signal_name: Value, is_secondary_program: Value = False
    ) -> Value:
        """Return the value of a signal: a bool, a register, or a list of registers."""
        values = self._signal(signal_name).values
        return values[:] if len(values) > 1 else values[0]

    def modbus_get_error(self, signal_name: Value, error_source: Value = 0) -> int:
        """
        Return 0 (no error), because every device seems to answer.

        :param error_source: 0 = device and connection, 1 = device, 2 = connection.
        """
        self._signal(signal_name)
        one_of(error_source, 'error_source', (0, 1, 2))
        return 0

    def modbus_get_time_since_signal_invalid(self, signal_name: Value) -> float:
        """Return 0 [s], because every device seems to answer."""
        self._signal(signal_name)
        return 0.0

    @without_effect
    def modbus_request_update_signal_value(self, signal_name: Value) -> None:
        """Check the name; a real robot would read the signal at once."""
        self._signal(signal_name)

    @without_effect
    def modbus_reset_connection(self, connection_id: Value, is_blocking: Value = True) -> None:
        """Check that the address is a string; there is no connection to reset."""
        text(connection_id, 'connection_id')

    @without_effect
    def modbus_set_signal_watchdog(self, signal_name: Value, new_timeout_in_sec: Value) -> None:
        """Check the time [s], 0..300, for which errors of the device would be tolerated."""
        self._signal(signal_name)
        within(new_timeout_in_sec, 'new_timeout_in_sec', 0, 300)

    def modbus_set_output_register(
        self, signal_name: Value, register_value: Value, is_secondary_program: Value = False
    ) -> None:
        """Write one or several registers; the ones after them, and inputs, do not change."""
        signal = self._signal(signal_name)
        given = _given(signal, int, signal_name, register_value, 'register_value')
        values: list[Value] = [index(value, 'register_value', 2**16) for value in given]
        if signal.is_output:
            signal.values[: len(values)] = values

    def modbus_set_output_signal(
        self, signal_name: Value, digital_value: Value, is_secondary_program: Value = False
    ) -> None:
        """Write one or several digital outputs; the ones after them, and inputs, do not change."""
        signal = self._signal(signal_name)
        given = _given(signal, bool, signal_name, digital_value, 'digital_value')
        values: list[Value] = [truth(value) for value in given]
        if signal.is_output:
            signal.values[: len(values)] = values

    @without_effect
    def modbus_send_custom_command(
        self, IP: Value, slave_number: Value, function_code: Value, data: Value
    ) -> None:
        """Check the arguments; no device is simulated that could receive the bytes."""
        text(IP, 'IP')
        index(slave_number, 'slave_number', 256)
        index(function_code, 'function_code', 256)
        if type(data) is not list:
            raise RuntimeException(f'Type error: data must be a list, not a {type_name(data)}')

    @without_effect
    def modbus_set_digital_input_action(self, signal_name: Value, action: Value) -> None:
        """Check the name of the signal, and that the action is a string."""
        self._signal(signal_name)
        text(action, 'action')

    @without_effect
    def modbus_set_runstate_dependent_choice(
        self, signal_name: Value, runstate_choice: Value
    ) -> None:
        """Check the name of the signal and the number of the program state."""
        self._signal(signal_name)
        index(runstate_choice, 'runstate_choice', 6)

    @without_effect
    def modbus_set_signal_update_frequency(
        self, signal_name: Value, update_frequency: Value
    ) -> None:
        """Check the rate [Hz], 0..500, at which a real device would be polled; -1 or 0 = never."""
        self._signal(signal_name)
        within(update_frequency, 'update_frequency', -1, 500)


def _count(value: Value, name: str) -> int:
    return whole_within(value, name, 1, MAX_REGISTERS)


def _given(
    signal: _Signal, kind: type, signal_name: Value, value: Value, name: str
) -> list[Value]:
    """
    Return the values to write as a list; a program passes one value or a list.

    :param kind: the type that the values of the signal must have.
    :param name: the argument's name.
    :raises RuntimeException: the signal is of the other kind, or the number of values is not from
        1 to the signal's number of values.
    """
    if signal.kind is not kind:
        wanted = 'register' if kind is int else 'digital'
        raise RuntimeException(f'The Modbus signal {signal_name!r} is no {wanted} signal.')
    given = value if type(value) is list else [value]
    if not 1 <= len(given) <= signal.writable:
        raise RuntimeException(
            f'{name} has {len(given)} values; the signal {signal_name!r} takes 1 to '
            f'{signal.writable}'
        )
    return given
