# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Inputs, outputs and registers of the simulated controller.

RTDE clients and programs read and write these values. Registers are plain lists, indexed as in the
robot's manual: bits 0-127, integers 0-47, floats 0-47.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, fields

from ur_cartesian_driver.motion.geometry.vectors import Vector6

REGISTER_BITS, REGISTER_INTEGERS, REGISTER_FLOATS = 128, 48, 48
STANDARD, CONFIGURABLE, TOOL = 8, 8, 2
#: Number of port addresses, which Modbus clients of a real robot share with its programs.
PORTS = 256


#: Registers that RTDE transfers one by one: type in RTDE, list in :class:`Registers`, indices.
#: (RTDE transfers bits 0-63 in integers.)
_SINGLE_REGISTERS = (
    ('bit', 'bits', range(64, REGISTER_BITS)),
    ('int', 'integers', range(REGISTER_INTEGERS)),
    ('double', 'floats', range(REGISTER_FLOATS)),
)


def single_registers(direction: str) -> Iterator[tuple[str, str, int]]:
    """Yield RTDE name, list in :class:`Registers` and index of each single register."""
    for kind, values, numbers in _SINGLE_REGISTERS:
        for i in numbers:
            yield f'{direction}_{kind}_register_{i}', values, i


def pack_bits(bits: list[bool]) -> int:
    """Return the number whose bit i is ``bits[i]``."""
    return sum(1 << i for i, bit in enumerate(bits) if bit)


@dataclass(slots=True)
class Registers:
    """The general purpose registers of one direction, input or output."""

    bits: list[bool] = field(default_factory=lambda: [False] * REGISTER_BITS)
    integers: list[int] = field(default_factory=lambda: [0] * REGISTER_INTEGERS)
    floats: list[float] = field(default_factory=lambda: [0.0] * REGISTER_FLOATS)


@dataclass(slots=True)
class DigitalPort:
    """The digital channels of one direction, input or output."""

    standard: list[bool] = field(default_factory=lambda: [False] * STANDARD)
    configurable: list[bool] = field(default_factory=lambda: [False] * CONFIGURABLE)
    tool: list[bool] = field(default_factory=lambda: [False] * TOOL)

    def switch_on(self, channel: str) -> None:
        """
        Switch on a channel such as ``standard 3``.

        :raises ValueError: there is no such channel.
        """
        side, _, pin = channel.strip().partition(' ')
        values = {each.name: getattr(self, each.name) for each in fields(self)}.get(side, ())
        if pin.strip() not in map(str, range(len(values))):
            raise ValueError(
                f'"{channel}" is no digital channel; use standard 0 to 7, configurable 0 to 7, '
                'tool 0 or tool 1.'
            )
        values[int(pin)] = True

    def packed(self) -> int:
        """Return all channels in one number: bits 0-7 standard, 8-15 configurable, 16-17 tool."""
        return pack_bits(self.standard + self.configurable + self.tool)


@dataclass(slots=True)
class ControllerIo:
    """All inputs, outputs, registers, flags and ports."""

    digital_in: DigitalPort = field(default_factory=DigitalPort)
    digital_out: DigitalPort = field(default_factory=DigitalPort)
    #: Values of the analog inputs [V or A].
    analog_in: list[float] = field(default_factory=lambda: [0.0, 0.0])
    #: Domain of each analog input; True = voltage.
    analog_in_voltage: list[bool] = field(default_factory=lambda: [True, True])
    #: Values of the analog outputs [V or A]; 4 mA at first, as recorded in URSim and as set by
    #: programs from the pendant.
    analog_out: list[float] = field(default_factory=lambda: [0.004, 0.004])
    #: Domain of each analog output; True = voltage.
    analog_out_voltage: list[bool] = field(default_factory=lambda: [False, False])
    tool_analog_in: list[float] = field(default_factory=lambda: [0.0, 0.0])
    tool_voltage: int = 0
    #: Force [N] and torque [Nm] of an external sensor, as an RTDE client has written them.
    external_force: Vector6 = (0.0,) * 6
    inputs: Registers = field(default_factory=Registers)
    outputs: Registers = field(default_factory=Registers)
    #: Flags of ``set_flag`` and ``get_flag``, which outlive programs.
    flags: list[bool] = field(default_factory=lambda: [False] * 32)
    port_bits: list[bool] = field(default_factory=lambda: [False] * PORTS)
    port_registers: list[int] = field(default_factory=lambda: [0] * PORTS)

    def set_analog_out(self, index: int, fraction: float) -> None:
        """Set an analog output to a fraction 0 to 1 of its range: 0-10 V, or 4-20 mA."""
        fraction = min(1.0, max(0.0, fraction))
        self.analog_out[index] = (
            10.0 * fraction if self.analog_out_voltage[index] else 0.004 + 0.016 * fraction
        )

    def analog_types(self) -> int:
        """Return the domains as RTDE packs them: inputs in bits 0-1, outputs in bits 2-3."""
        return pack_bits(self.analog_in_voltage + self.analog_out_voltage)
