# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Inputs, outputs and the tool connector of a robot, as its controller reports them."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from math import nan

from ur_cartesian_driver.motion.geometry.vectors import Vector3, Vector6


class AnalogDomain(IntEnum):
    """Unit of an analog channel: current [A] or voltage [V]."""

    CURRENT = 0
    VOLTAGE = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class AnalogChannel:
    """An analog input or output, whose value is in [A] or [V], depending on the domain."""

    domain: AnalogDomain
    value: float


@dataclass(frozen=True, slots=True, kw_only=True)
class DigitalChannels:
    """The digital inputs, or the digital outputs, by their number; True = high."""

    standard: tuple[bool, ...]
    configurable: tuple[bool, ...]
    tool: tuple[bool, ...]

    @classmethod
    def from_bits(cls, bits: int) -> DigitalChannels:
        """Return the channels in an RTDE value; from bit 0: 8 standard, 8 configurable, 2 tool."""
        flags = tuple(bool(bits >> i & 1) for i in range(18))
        return cls(standard=flags[:8], configurable=flags[8:16], tool=flags[16:])


@dataclass(frozen=True, slots=True, kw_only=True)
class Signals:
    """All inputs and outputs, and the tool connector, at one time."""

    inputs: DigitalChannels
    outputs: DigitalChannels
    analog_inputs: tuple[AnalogChannel, AnalogChannel]
    analog_outputs: tuple[AnalogChannel, AnalogChannel]
    tool_analog_inputs: tuple[AnalogChannel, AnalogChannel]
    #: Voltage setting of the tool's supply [V].
    tool_voltage: int = 0
    #: Measured current of the tool's supply [A].
    tool_current: float = 0.0
    #: Temperature of the tool [degrees Celsius].
    tool_temperature: float = 0.0
    #: Mode of the tool, as the controller numbers it.
    tool_mode: int = 0
    #: Mass of the payload [kg]; NaN = not reported.
    payload: float = nan
    #: Centre of gravity of the payload in the flange [m]; NaN = not reported.
    payload_cog: Vector3 = (nan, nan, nan)
    #: Inertia of the payload about its centre of gravity, along the axes of the flange [kg m^2]:
    #: xx, yy, zz, xy, xz, yz; NaN = not reported.
    payload_inertia: Vector6 = (nan,) * 6
    #: Acceleration that opposes gravity, in base axes [m/s^2]; NaN = not reported.
    gravity: Vector3 = (nan, nan, nan)
