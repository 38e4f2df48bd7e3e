# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The outputs that codes switch.

S is the power of a spindle or a laser. While M3 or M4 is active, S drives its output; a new S on a
line without M3 and M4, such as GRBL's ``G1 X1 S200``, takes effect at once. M5, M2 and M30 set the
output to 0.
"""

from __future__ import annotations

from collections.abc import Mapping

from ur_cartesian_driver.importing.gcode.codes import NO_OUTPUT
from ur_cartesian_driver.importing.import_options import CodeOutput
from ur_cartesian_driver.importing.imported_path import BrokenFile, PathCollector

_SPINDLE_OFF, _COOLANT_OFF = 'M5', 'M9'


class CodeOutputs:
    """Switches outputs at the newest point of a path."""

    def __init__(self, outputs: Mapping[str, CodeOutput], into: PathCollector) -> None:
        """Begin with spindle and coolant off."""
        self._outputs, self._into = outputs, into
        self._keys: dict[str, list[tuple[str, ...]]] = {}
        for key in outputs:
            code, *values = key.split()
            self._keys.setdefault(code, []).append(tuple(values))
        self._power_output = outputs.get('S')
        self._power: float | None = None
        self._spindle, self._coolant = _SPINDLE_OFF, _COOLANT_OFF
        self._level: float | None = None
        self._ever_on = False

    def __contains__(self, code: str) -> bool:
        """Return whether the options give an output for a code."""
        return code in self._keys

    @property
    def drives_power(self) -> bool:
        """Return whether the output of S is on."""
        return bool(self._power_output and self._power and self._spindle != _SPINDLE_OFF)

    def set_power(self, line: int, value: float, *, beside_spindle: bool) -> None:
        """
        Set the power to the number of an S word.

        :param beside_spindle: whether M3, M4 or M5 is on the same line, so that :meth:`switch`
            follows.
        """
        changed, self._power = value != self._power, value
        by_value = any(values for code in ('M3', 'M4') for values in self._keys.get(code, ()))
        if self._power_output is None and not by_value:
            self._into.remarks.add(line, 'word S', NO_OUTPUT)
        if changed and self._spindle != _SPINDLE_OFF and not beside_spindle:
            self._drive_power(line)
            if by_value:
                self._switch_spindle(line, {})

    def switch(self, line: int, code: str, values: Mapping[str, float]) -> None:
        """
        Switch the outputs that the options give for a code.

        :param values: the words that belong to the code.
        :raises BrokenFile: the code has values, but the options give an output only for the code
            without values; or S is out of range.
        """
        if code in ('M3', 'M4', 'M5'):
            was_on, self._spindle = self._spindle != _SPINDLE_OFF, code
            self._ever_on |= code != _SPINDLE_OFF
            if code != _SPINDLE_OFF or was_on:
                self._drive_power(line)
            self._switch_spindle(line, values)
            return
        if code in ('M7', 'M8', 'M9'):
            self._coolant = code
        self._switch(line, code, values, {})

    def end(self, line: int, code: str) -> None:
        """Switch off spindle and coolant, as M2 and M30 do."""
        for active, off in ((self._spindle, _SPINDLE_OFF), (self._coolant, _COOLANT_OFF)):
            if active != off and off in self._outputs:
                self.switch(line, off, {})
        if self._spindle != _SPINDLE_OFF:
            self._spindle = _SPINDLE_OFF
            self._drive_power(line)
        if code in self._outputs:
            self._switch(line, code, {}, {})

    def finish(self) -> None:
        """Make a remark if S had no effect in the whole program."""
        if self._power_output and self._power is not None and not self._ever_on:
            self._into.remarks.add(0, 'S without M3 or M4', 'its output is never switched')

    def _drive_power(self, line: int) -> None:
        output, power = self._power_output, self._power
        if output is None or power is None:
            return
        if not 0.0 <= power <= output.value:
            raise BrokenFile(line, f'S{power:g} is not within 0 and {output.value:g}')
        level = power / output.value if self._spindle != _SPINDLE_OFF else 0.0
        if level != self._level:
            self._level = level
            self._into.switch(output.command(level))

    def _switch_spindle(self, line: int, values: Mapping[str, float]) -> None:
        power = {'S': self._power} if self._power is not None else {}
        self._switch(line, self._spindle, values, power)

    def _switch(
        self, line: int, code: str, values: Mapping[str, float], modal: Mapping[str, float]
    ) -> None:
        """Switch the output of a code; if several outputs fit, the one with the most values."""
        own = [f'{letter}{value:g}' for letter, value in values.items()]
        here = {*own, *(f'{letter}{value:g}' for letter, value in modal.items())}
        keys = [key for key in self._keys.get(code, ()) if here.issuperset(key)]
        if not keys:
            what = code if code not in self._keys else ' '.join((code, *sorted(here)))
            self._into.remarks.add(line, what, NO_OUTPUT)
            return
        key = max(keys, key=len)
        if own and not key:
            example = ' '.join((code, *own))
            raise BrokenFile(
                line,
                f'{example} has values, and the output of {code} is given without; give one for '
                f"each, such as --output-of '{example}=standard:0:1'",
            )
        output = self._outputs[' '.join((code, *key))]
        self._into.switch(output.command(output.value))
