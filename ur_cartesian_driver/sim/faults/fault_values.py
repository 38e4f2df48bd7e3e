# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The faults of the simulated robot: each fault is a value that contains its effect and its trigger.

`fault_parser` reads faults from text; `injector` triggers them.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from math import inf
from random import Random
from typing import get_args, Literal, TypeAlias

DeviationAxis: TypeAlias = Literal['x', 'y', 'z', 'rx', 'ry', 'rz']
DeviationQuantity: TypeAlias = Literal['pose', 'twist', 'acceleration']
DeviationShape: TypeAlias = Literal['offset', 'ramp', 'noise']

DEVIATION_AXES: tuple[DeviationAxis, ...] = get_args(DeviationAxis)
DEVIATION_QUANTITIES: tuple[DeviationQuantity, ...] = get_args(DeviationQuantity)
DEVIATION_SHAPES: tuple[DeviationShape, ...] = get_args(DeviationShape)
#: Number of random bytes in a garbage fault, if no other number is given.
GARBAGE_SIZE = 64


# --- Triggers --------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class AfterTime:
    """Trigger: a time [s] has passed on the controller's clock since the fault was set."""

    seconds: float = 0.0


@dataclass(frozen=True, slots=True)
class AfterDistance:
    """Trigger: the TCP has travelled a distance [m] since the fault was set."""

    metres: float


@dataclass(frozen=True, slots=True)
class PlaneCrossing:
    """Trigger: the TCP crosses the plane ``axis = position`` [m] of the base frame."""

    axis: Literal['x', 'y', 'z']
    position: float


FaultTrigger: TypeAlias = AfterTime | AfterDistance | PlaneCrossing
IMMEDIATELY = AfterTime()


# --- Effects ---------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """Something that goes wrong when its trigger is reached."""

    trigger: FaultTrigger = IMMEDIATELY


@dataclass(frozen=True, slots=True, kw_only=True)
class InterfaceFault(Fault):
    """Something that goes wrong with the connections of an interface."""

    #: Name of the interface, such as rtde or dashboard.
    interface: str


@dataclass(frozen=True, slots=True, kw_only=True)
class LastingInterfaceFault(InterfaceFault):
    """Something that goes wrong with the connections of an interface for a duration."""

    #: Time until the connections are sound again [s].
    duration: float = inf


class FaultEvent(Enum):
    """An event that another client, a person at the robot or the robot itself causes."""

    PROTECTIVE_STOP = 'protective_stop'
    EMERGENCY_STOP = 'emergency_stop'
    RELEASE_EMERGENCY_STOP = 'release_emergency_stop'
    SAFEGUARD_STOP = 'safeguard_stop'
    RESET_SAFEGUARD = 'reset_safeguard'
    VIOLATION = 'violation'
    FAULT = 'fault'
    UNLOCK = 'unlock'
    STOP = 'stop'
    PAUSE = 'pause'
    PLAY = 'play'
    POWER_OFF = 'power_off'


@dataclass(frozen=True, slots=True, kw_only=True)
class EventFault(Fault):
    """An event of safety, power or program that the client under test did not request."""

    action: FaultEvent


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedSliderFault(Fault):
    """The speed slider is moved to a fraction 0..1."""

    fraction: float

    def __post_init__(self) -> None:
        """Reject a fraction outside the range of the slider."""
        if not 0.0 <= self.fraction <= 1.0:
            raise ValueError(f'The speed slider is set to {self.fraction:g}; use 0 to 1.')


@dataclass(frozen=True, slots=True, kw_only=True)
class ForeignMotionFault(Fault):
    """Another client's program replaces the running one and moves the arm away."""

    axis: DeviationAxis
    #: Displacement from the present target pose along or about the base axis [m or rad].
    distance: float

    def script(self) -> str:
        """Return the program of the other client."""
        step = ', '.join(
            f'{self.distance:.9f}' if axis == self.axis else '0' for axis in DEVIATION_AXES
        )
        return f'def foreign_motion():\n  movel(pose_add(get_target_tcp_pose(), p[{step}]))\nend\n'


@dataclass(frozen=True, slots=True, kw_only=True)
class DeviationFault(Fault):
    """A measured quantity of the TCP deviates from its target on one axis of the base."""

    quantity: DeviationQuantity
    axis: DeviationAxis
    shape: DeviationShape
    #: The offset, the growth of the ramp per second, or the standard deviation of the noise [m or
    #: rad; per s for a twist, per s^2 for an acceleration].
    amount: float
    #: Time until the deviation ends [s].
    duration: float = inf
    seed: int = 0

    def value(self, elapsed: float, random: Random) -> float:
        """Return the deviation ``elapsed`` seconds after the start of the fault."""
        if self.shape == 'noise':
            return random.gauss(0.0, self.amount)
        return self.amount * elapsed if self.shape == 'ramp' else self.amount


@dataclass(frozen=True, slots=True, kw_only=True)
class DropFault(LastingInterfaceFault):
    """All connections of an interface are cut, and no new ones are accepted for a duration."""

    #: Time during which no new connections are accepted [s].
    duration: float = 0.0


class HalfOpenFault(InterfaceFault):
    """The present connections stay open but carry no data; new connections work."""


class SilenceFault(LastingInterfaceFault):
    """The robot receives, but every message that it sends on an interface is lost."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DelayFault(LastingInterfaceFault):
    """All data on an interface is delayed by a time [s], in each direction."""

    seconds: float

    def __post_init__(self) -> None:
        """Reject a delay of zero or less."""
        if self.seconds <= 0.0:
            raise ValueError(f'The delay is {self.seconds:g} s; use more than 0.')


@dataclass(frozen=True, slots=True, kw_only=True)
class ThrottleFault(LastingInterfaceFault):
    """An interface carries at most a rate [bytes/s] in each direction."""

    rate: float

    def __post_init__(self) -> None:
        """Reject a rate of zero or less."""
        if self.rate <= 0.0:
            raise ValueError(
                f'The rate is {self.rate:g} bytes/s; use more than 0, or the fault silence.'
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class GarbageFault(InterfaceFault):
    """The robot sends random bytes to all clients of an interface."""

    size: int = GARBAGE_SIZE
    seed: int = 0

    def __post_init__(self) -> None:
        """Reject a size of zero or less, or of more than a million bytes."""
        if not 1 <= self.size <= 1_000_000:
            raise ValueError(f'The size of the garbage is {self.size} bytes; use 1 to 1000000.')


TimedFault: TypeAlias = DeviationFault | LastingInterfaceFault
