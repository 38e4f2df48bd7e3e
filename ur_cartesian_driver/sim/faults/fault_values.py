# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
What can go wrong with the simulated robot: each fault is a value that says what happens and when.

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

# --- When ------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class AfterTime:
    """So long after the fault was set [s] of the controller's time."""

    seconds: float = 0.0


@dataclass(frozen=True, slots=True)
class AfterDistance:
    """When the tool centre point has moved so far since the fault was set [m]."""

    metres: float


@dataclass(frozen=True, slots=True)
class PlaneCrossing:
    """When the tool centre point crosses the plane where a coordinate in the base is this [m]."""

    axis: Literal['x', 'y', 'z']
    position: float


FaultTrigger: TypeAlias = AfterTime | AfterDistance | PlaneCrossing
IMMEDIATELY = AfterTime()


# --- What ------------------------------------------------------------------------------------


class FaultEvent(Enum):
    """What somebody else does to the robot: another client, or a person at it."""

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
class EventFault:
    """Something happens to safety, power or program, without being asked for by the client."""

    action: FaultEvent
    trigger: FaultTrigger = IMMEDIATELY


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedSliderFault:
    """Somebody moves the speed slider, 0..1."""

    fraction: float
    trigger: FaultTrigger = IMMEDIATELY

    def __post_init__(self) -> None:
        """Reject what no slider shows."""
        if not 0.0 <= self.fraction <= 1.0:
            raise ValueError(f'The slider cannot stand at {self.fraction:g}; use 0 to 1.')


@dataclass(frozen=True, slots=True, kw_only=True)
class ForeignMotionFault:
    """Another client's program takes the place of the running one and moves the arm away."""

    axis: DeviationAxis
    #: In base axes, from where the tool is [m or rad].
    distance: float
    trigger: FaultTrigger = IMMEDIATELY

    def script(self) -> str:
        """Return that program."""
        step = ', '.join(
            f'{self.distance:.9f}' if axis == self.axis else '0' for axis in DEVIATION_AXES
        )
        return f'def foreign_motion():\n  movel(pose_add(get_target_tcp_pose(), p[{step}]))\nend\n'


@dataclass(frozen=True, slots=True, kw_only=True)
class DeviationFault:
    """An actual value is not what the target asks for, on one axis of the base."""

    quantity: DeviationQuantity
    axis: DeviationAxis
    shape: DeviationShape
    #: [m, rad and their derivatives]: of the offset, of the ramp per second, the standard
    #: deviation of the noise.
    amount: float
    trigger: FaultTrigger = IMMEDIATELY
    #: [s]
    duration: float = inf
    seed: int = 0

    def value(self, elapsed: float, random: Random) -> float:
        """Return by how much the value is off, so long after it began [s]."""
        if self.shape == 'noise':
            return random.gauss(0.0, self.amount)
        return self.amount * elapsed if self.shape == 'ramp' else self.amount


@dataclass(frozen=True, slots=True, kw_only=True)
class DropFault:
    """All connections of an interface are cut, and none is accepted for the duration."""

    interface: str
    trigger: FaultTrigger = IMMEDIATELY
    #: [s]
    duration: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class HalfOpenFault:
    """The connections that there are stay open and dead, new ones work: as if a cable was cut."""

    interface: str
    trigger: FaultTrigger = IMMEDIATELY


@dataclass(frozen=True, slots=True, kw_only=True)
class SilenceFault:
    """The robot hears, but what it has to say on an interface is lost, message by message."""

    interface: str
    trigger: FaultTrigger = IMMEDIATELY
    duration: float = inf


@dataclass(frozen=True, slots=True, kw_only=True)
class DelayFault:
    """Everything on an interface takes longer [s], in each direction."""

    interface: str
    seconds: float
    trigger: FaultTrigger = IMMEDIATELY
    duration: float = inf

    def __post_init__(self) -> None:
        """Reject what would answer before it is asked."""
        if self.seconds <= 0.0:
            raise ValueError(f'A delay of {self.seconds:g} s cannot be; use more than 0.')


@dataclass(frozen=True, slots=True, kw_only=True)
class ThrottleFault:
    """An interface carries no more than a rate [bytes/s], in each direction."""

    interface: str
    rate: float
    trigger: FaultTrigger = IMMEDIATELY
    duration: float = inf

    def __post_init__(self) -> None:
        """Reject what carries nothing: that is another fault."""
        if self.rate <= 0.0:
            raise ValueError(
                f'A rate of {self.rate:g} bytes/s cannot be; use more than 0, or silence.'
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class GarbageFault:
    """The robot says random bytes to all clients of an interface."""

    interface: str
    size: int = 64
    trigger: FaultTrigger = IMMEDIATELY
    seed: int = 0

    def __post_init__(self) -> None:
        """Reject what is nothing, or would not fit a connection."""
        if not 1 <= self.size <= 1_000_000:
            raise ValueError(f'Garbage of {self.size} bytes cannot be; use 1 to 1000000.')


Fault: TypeAlias = (
    EventFault
    | SpeedSliderFault
    | ForeignMotionFault
    | DeviationFault
    | DropFault
    | HalfOpenFault
    | SilenceFault
    | DelayFault
    | ThrottleFault
    | GarbageFault
)
TimedFault: TypeAlias = DeviationFault | DropFault | SilenceFault | DelayFault | ThrottleFault
InterfaceFault: TypeAlias = (
    DropFault | HalfOpenFault | SilenceFault | DelayFault | ThrottleFault | GarbageFault
)
