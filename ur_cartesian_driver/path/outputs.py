# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The outputs of a robot, to be set at points of a path."""

from __future__ import annotations

from dataclasses import dataclass

from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.goal import IOCommand, OutputKind, SafeOutput
from ur_cartesian_driver.motion.io_signals import AnalogDomain
from ur_cartesian_driver.planning.output_names import output_fault, output_name


@dataclass(frozen=True, slots=True)
class Output:
    """One output of the robot; :func:`digital`, :func:`analog` and their like make it."""

    kind: OutputKind
    pin: int
    domain: AnalogDomain = AnalogDomain.CURRENT

    def __post_init__(self) -> None:
        """Refuse a pin that the robot does not have."""
        self._check(0.0)

    def command(self, value: float, waypoint: int, offset: float) -> IOCommand:
        """
        Return the command that sets it at a waypoint.

        :raises InvalidGoal: the output does not take this value.
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
        Return the value that it takes when the motion does not go on as planned.

        :raises InvalidGoal: the output does not take this value.
        """
        return SafeOutput(
            output=self.kind,
            pin=self.pin,
            value=self._check(value),
            domain=self.domain,
            restore=restore,
        )

    def _check(self, value: float) -> float:
        number = float(value)
        if (fault := output_fault(self.kind, self.pin, number)) is not None:
            field, wrong, remedy = fault
            raise InvalidGoal(f'the {field} of {output_name(self.kind, self.pin)}', wrong, remedy)
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
