# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The faults of the simulated robot: each is a value with its effect and its time.

`fault_parser` reads faults from text; `injector` lets them happen.
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
#: Random bytes that a robot sends if nothing else is asked for.
GARBAGE_SIZE = 64


# --- When ------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class AfterTime:
    """A time after the fault was set, on the controller's clock [s]."""

    seconds: float = 0.0


@dataclass(frozen=True, slots=True)
class AfterDistance:
    """The TCP has moved this far since the fault was set [m]."""

    metres: float


@dataclass(frozen=True, slots=True)
class PlaneCrossing:
    """The TCP crosses a plane of the base, given by one coordinate [m]."""

    axis: Literal['x', 'y', 'z']
    position: float


FaultTrigger: TypeAlias = AfterTime | AfterDistance | PlaneCrossing
IMMEDIATELY = AfterTime()


# --- What ------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """Something that goes wrong at a moment."""

    trigger: FaultTrigger = IMMEDIATELY


@dataclass(frozen=True, slots=True, kw_only=True)
class InterfaceFault(Fault):
    """Something that goes wrong with the connections of an interface."""

    interface: str


@dataclass(frozen=True, slots=True, kw_only=True)
class LastingInterfaceFault(InterfaceFault):
    """Something that stays wrong with the connections of an interface."""

    #: [s]
    duration: float = inf


class FaultEvent(Enum):
    """An act of another client, or of a person at the robot."""

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
    """An event of safety, power or program that the client did not ask for."""

    action: FaultEvent


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedSliderFault(Fault):
    """Somebody moves the speed slider, 0..1."""

    fraction: float

    def __post_init__(self) -> None:
        """Reject a fraction that the slider does not have."""
        if not 0.0 <= self.fraction <= 1.0:
            raise ValueError(f'The speed slider is set to {self.fraction:g}; use 0 to 1.')


@dataclass(frozen=True, slots=True, kw_only=True)
class ForeignMotionFault(Fault):
    """Another client's program replaces the running one and moves the arm away."""

    axis: DeviationAxis
    #: In base axes, from where the tool is [m or rad].
    distance: float

    def script(self) -> str:
        """Return that program."""
        step = ', '.join(
            f'{self.distance:.9f}' if axis == self.axis else '0' for axis in DEVIATION_AXES
        )
        return f'def foreign_motion():\n  movel(pose_add(get_target_tcp_pose(), p[{step}]))\nend\n'


@dataclass(frozen=True, slots=True, kw_only=True)
class DeviationFault(Fault):
    """An actual value deviates from its target on one axis of the base."""

    quantity: DeviationQuantity
    axis: DeviationAxis
    shape: DeviationShape
    #: The offset, the ramp per second, or the standard deviation of the noise [m, rad and their
    #: derivatives].
    amount: float
    #: [s]
    duration: float = inf
    seed: int = 0

    def value(self, elapsed: float, random: Random) -> float:
        """Return the deviation so long after it began [s]."""
        if self.shape == 'noise':
            return random.gauss(0.0, self.amount)
        return self.amount * elapsed if self.shape == 'ramp' else self.amount


@dataclass(frozen=True, slots=True, kw_only=True)
class DropFault(LastingInterfaceFault):
    """All connections of an interface are cut, and none is accepted for the duration."""

    #: [s]
    duration: float = 0.0


class HalfOpenFault(InterfaceFault):
    """The present connections stay open and dead, new ones work: as if a cable was cut."""


class SilenceFault(LastingInterfaceFault):
    """The robot hears, but every message that it sends on an interface is lost."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DelayFault(LastingInterfaceFault):
    """Everything on an interface takes longer [s], in each direction."""

    seconds: float

    def __post_init__(self) -> None:
        """Reject a delay that is none."""
        if self.seconds <= 0.0:
            raise ValueError(f'The delay is {self.seconds:g} s; use more than 0.')


@dataclass(frozen=True, slots=True, kw_only=True)
class ThrottleFault(LastingInterfaceFault):
    """An interface carries no more than a rate [bytes/s], in each direction."""

    rate: float

    def __post_init__(self) -> None:
        """Reject a rate that carries nothing: that is another fault."""
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
        """Reject a size that is nothing or too much for a connection."""
        if not 1 <= self.size <= 1_000_000:
            raise ValueError(f'The size of the garbage is {self.size} bytes; use 1 to 1000000.')


TimedFault: TypeAlias = DeviationFault | LastingInterfaceFault
