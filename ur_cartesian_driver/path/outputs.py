# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The outputs of a robot, to be set at points of a path, and the inputs to wait for."""

from __future__ import annotations

from dataclasses import dataclass
from numbers import Integral

from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.goal.goal import (
    InputKind,
    InputWait,
    IOCommand,
    OutputKind,
    SafeOutput,
)
from ur_cartesian_driver.motion.goal.output_names import output_fault, output_name, OUTPUTS
from ur_cartesian_driver.motion.state.io_signals import AnalogDomain
from ur_cartesian_driver.path.path_numbers import any_number


@dataclass(frozen=True, slots=True)
class Output:
    """One output of the robot; made by :func:`digital`, :func:`analog` and similar functions."""

    kind: OutputKind
    pin: int
    domain: AnalogDomain = AnalogDomain.CURRENT

    def __post_init__(self) -> None:
        """Refuse a pin that the robot does not have."""
        if not isinstance(self.pin, Integral):
            name = OUTPUTS[self.kind][0]
            raise InvalidGoal(f'the pin of a {name}', f'is {self.pin!r:.60}', 'give its number')
        self._check(0.0)

    def __str__(self) -> str:
        """Return the name of the output for a sentence."""
        return output_name(self.kind, self.pin)

    def command(self, value: float, waypoint: int, offset: float) -> IOCommand:
        """
        Return the command that sets the output at a waypoint.

        :raises InvalidGoal: the output cannot have this value.
        """
        return IOCommand(
            waypoint=waypoint,
            offset=offset,
            output=self.kind,
            pin=self.pin,
            value=self._check(value),
            domain=self.domain,
        )

    def safe(self, value: float, restore: bool) -> SafeOutput:
        """
        Return the value that the output takes when the motion does not go on as planned.

        :raises InvalidGoal: the output cannot have this value.
        """
        return SafeOutput(
            output=self.kind,
            pin=self.pin,
            value=self._check(value),
            domain=self.domain,
            restore=restore,
        )

    def _check(self, value: float) -> float:
        number = any_number(str(self), 'value', value)
        if (fault := output_fault(self.kind, self.pin, number)) is not None:
            field, wrong, remedy = fault
            raise InvalidGoal(f'the {field} of {self}', wrong, remedy)
        return number


def digital(pin: int) -> Output:
    """Return a standard digital output, 0 to 7; its values are True and False."""
    return Output(OutputKind.STANDARD_DIGITAL, pin)


def configurable(pin: int) -> Output:
    """Return a configurable digital output, 0 to 7."""
    return Output(OutputKind.CONFIGURABLE_DIGITAL, pin)


def tool_digital(pin: int) -> Output:
    """Return a digital output of the tool connector, 0 or 1."""
    return Output(OutputKind.TOOL_DIGITAL, pin)


def analog(pin: int, domain: AnalogDomain = AnalogDomain.CURRENT) -> Output:
    """Return a standard analog output, 0 or 1; its values are fractions of its range."""
    return Output(OutputKind.STANDARD_ANALOG, pin, domain)


@dataclass(frozen=True, slots=True)
class Input:
    """One input of the robot; made by :func:`digital_input` and similar functions."""

    kind: InputKind
    pin: int

    def wait(self, value: float, timeout: float, below: bool, go_on: bool) -> InputWait:
        """Return the event that waits for a value of the input; no number is checked."""
        return InputWait(
            waypoint=0,
            input=self.kind,
            pin=self.pin,
            value=value,
            below=below,
            timeout=timeout,
            go_on=go_on,
        )


def digital_input(pin: int) -> Input:
    """Return a standard digital input, 0 to 7; its values are True and False."""
    return Input(InputKind.STANDARD_DIGITAL, pin)


def configurable_input(pin: int) -> Input:
    """Return a configurable digital input, 0 to 7."""
    return Input(InputKind.CONFIGURABLE_DIGITAL, pin)


def tool_digital_input(pin: int) -> Input:
    """Return a digital input of the tool connector, 0 or 1."""
    return Input(InputKind.TOOL_DIGITAL, pin)


def analog_input(pin: int) -> Input:
    """Return a standard analog input, 0 or 1; its levels are in A or V."""
    return Input(InputKind.STANDARD_ANALOG, pin)


def tool_analog_input(pin: int) -> Input:
    """Return an analog input of the tool connector, 0 or 1."""
    return Input(InputKind.TOOL_ANALOG, pin)
