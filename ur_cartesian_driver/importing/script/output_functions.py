# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Rests, outputs, and waits for inputs: each method is a URScript function."""

from __future__ import annotations

from ur_cartesian_driver.importing.script.collected_events import CollectedEvents, Steps
from ur_cartesian_driver.motion.goal.goal import (
    InputKind,
    InputWait,
    IOCommand,
    MAX_STOP_TIME,
    OutputKind,
)
from ur_cartesian_driver.motion.state.io_signals import AnalogDomain
from ur_cartesian_driver.sim.builtins.arguments import index, not_negative, within
from ur_cartesian_driver.sim.controller import Controller
from ur_cartesian_driver.urscript.script_values import truth, Value

_INPUT_KINDS = {
    'get_standard_digital_in': InputKind.STANDARD_DIGITAL,
    'get_configurable_digital_in': InputKind.CONFIGURABLE_DIGITAL,
    'get_tool_digital_in': InputKind.TOOL_DIGITAL,
}


class OutputFunctions:
    """Sleeps, waits and outputs of a program, which can read its own outputs back."""

    def __init__(self, events: CollectedEvents, controller: Controller) -> None:
        """Collect outputs and waits into ``events``."""
        self._events, self._controller = events, controller
        self._domains: dict[int, AnalogDomain] = {}

    def sleep(self, t: Value) -> Steps:
        """Rest at the last point."""
        time = not_negative(t, 't')
        self._controller.cycles += int(min(time, MAX_STOP_TIME) / self._controller.cycle)
        if self._events.acts:
            self._events.rest(time)
        yield

    def wait_for_input(self, function: Value, n: Value, level: Value) -> Steps:
        """Wait for a digital input; this call replaces a loop that waits for the input."""
        while not self._events.acts:
            yield
        if function == 'get_digital_in':  # the old numbering: pins 8 and 9 are on the tool
            pin = index(n, 'n', 10)
            kind = InputKind.STANDARD_DIGITAL if pin < 8 else InputKind.TOOL_DIGITAL
            pin %= 8
        else:
            kind = _INPUT_KINDS[function]
            pin = index(n, 'n', 2 if kind is InputKind.TOOL_DIGITAL else 8)
        inputs = self._controller.io.digital_in
        (inputs.standard, inputs.configurable, inputs.tool)[kind][pin] = level
        self._events.wait(
            InputWait(waypoint=0, input=kind, pin=pin, value=float(level), timeout=MAX_STOP_TIME)
        )
        yield

    def set_digital_out(self, n: Value, b: Value) -> None:
        """Switch an output by its old number: outputs 8 and 9 are on the tool."""
        pin = index(n, 'n', 10)
        kind = OutputKind.STANDARD_DIGITAL if pin < 8 else OutputKind.TOOL_DIGITAL
        self._switch(kind, pin % 8, b)

    def set_standard_digital_out(self, n: Value, b: Value) -> None:
        """Switch a standard output."""
        self._switch(OutputKind.STANDARD_DIGITAL, index(n, 'n', 8), b)

    def set_configurable_digital_out(self, n: Value, b: Value) -> None:
        """Switch a configurable output."""
        self._switch(OutputKind.CONFIGURABLE_DIGITAL, index(n, 'n', 8), b)

    def set_tool_digital_out(self, n: Value, b: Value) -> None:
        """Switch an output of the tool."""
        self._switch(OutputKind.TOOL_DIGITAL, index(n, 'n', 2), b)

    def _switch(self, kind: OutputKind, pin: int, b: Value) -> None:
        outputs, on = self._controller.io.digital_out, truth(b)
        (outputs.standard, outputs.configurable, outputs.tool)[kind][pin] = on
        self._events.switch(
            IOCommand(waypoint=0, offset=0.0, output=kind, pin=pin, value=float(on))
        )

    def set_standard_analog_out(self, n: Value, f: Value) -> None:
        """Set an analog output to a fraction of its range."""
        pin, value = index(n, 'n', 2), within(f, 'f', 0, 1)
        self._controller.io.set_analog_out(pin, value)
        if pin not in self._domains:
            self._events.run.say(
                'an analog output', 'no set_analog_outputdomain before it; it is set as a current'
            )
        self._events.switch(
            IOCommand(
                waypoint=0,
                offset=0.0,
                output=OutputKind.STANDARD_ANALOG,
                pin=pin,
                value=value,
                domain=self._domains.get(pin, AnalogDomain.CURRENT),
            )
        )

    set_analog_out = set_standard_analog_out  # the old name

    def set_analog_outputdomain(self, port: Value, domain: Value) -> None:
        """Choose the domain of an analog output: 0 = current, 1 = voltage."""
        pin, voltage = index(port, 'port', 2), index(domain, 'domain', 2)
        self._domains[pin] = AnalogDomain.VOLTAGE if voltage else AnalogDomain.CURRENT
        self._controller.io.analog_out_voltage[pin] = bool(voltage)
