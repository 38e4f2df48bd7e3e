# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Faults on demand: what goes wrong with the simulated robot, and when.

A fault is a value that says both. :class:`FaultInjector` awaits it, counts in the controller's
cycles, and so is as deterministic as these; while no fault is set it costs nothing. How faults are
written in words is in `fault_text`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum
import logging
from math import hypot, inf
from random import Random
from types import MappingProxyType
from typing import get_args, Literal, TYPE_CHECKING, TypeAlias

from ur_cartesian_driver.motion.pose import Vector6
from ur_cartesian_driver.sim.faults.impairment import Impairable, Impairment
from ur_cartesian_driver.sim.state.power_and_safety import SafetyEvent

if TYPE_CHECKING:
    from ur_cartesian_driver.sim.controller import Controller

_log = logging.getLogger(__name__)

DeviationAxis: TypeAlias = Literal['x', 'y', 'z', 'rx', 'ry', 'rz']
DeviationQuantity: TypeAlias = Literal['pose', 'twist', 'acceleration']
DeviationShape: TypeAlias = Literal['offset', 'ramp', 'noise']

DEVIATION_AXES: tuple[DeviationAxis, ...] = get_args(DeviationAxis)
DEVIATION_QUANTITIES: tuple[DeviationQuantity, ...] = get_args(DeviationQuantity)
DEVIATION_SHAPES: tuple[DeviationShape, ...] = get_args(DeviationShape)

# Cycles are summed in floats.
_ROUNDING = 1e-9


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
_TimedFault: TypeAlias = DeviationFault | DropFault | SilenceFault | DelayFault | ThrottleFault
_OnInterface = DropFault | HalfOpenFault | SilenceFault | DelayFault | ThrottleFault | GarbageFault


# --- Letting it happen -----------------------------------------------------------------------


def _safety(event: SafetyEvent) -> Callable[[Controller], str]:
    return lambda controller: controller.safety_event(event)


def _stop(controller: Controller) -> str:
    controller.programs.stop()
    return ''


def _power_off(controller: Controller) -> str:
    controller.power_off()
    return ''


_ACTIONS: Mapping[FaultEvent, Callable[[Controller], str]] = MappingProxyType(
    {
        FaultEvent.PROTECTIVE_STOP: _safety(SafetyEvent.PROTECTIVE_STOP),
        FaultEvent.EMERGENCY_STOP: _safety(SafetyEvent.EMERGENCY_STOP),
        FaultEvent.RELEASE_EMERGENCY_STOP: _safety(SafetyEvent.RELEASE),
        FaultEvent.SAFEGUARD_STOP: _safety(SafetyEvent.SAFEGUARD_STOP),
        FaultEvent.RESET_SAFEGUARD: _safety(SafetyEvent.SAFEGUARD_RESET),
        FaultEvent.VIOLATION: _safety(SafetyEvent.VIOLATION),
        FaultEvent.FAULT: _safety(SafetyEvent.FAULT),
        FaultEvent.UNLOCK: _safety(SafetyEvent.UNLOCK),
        FaultEvent.STOP: _stop,
        FaultEvent.PAUSE: lambda controller: controller.programs.pause(),
        FaultEvent.PLAY: lambda controller: controller.programs.play(),
        FaultEvent.POWER_OFF: _power_off,
    }
)


@dataclass(slots=True)
class _PendingFault:
    """A fault that has not happened, with what its moment is reckoned from."""

    fault: Fault
    set_at: float
    travelled: float
    #: On which side of the plane the tool was.
    side: bool


@dataclass(slots=True)
class _ActiveFault:
    """A fault that lasts."""

    fault: _TimedFault
    since: float
    random: Random = field(default_factory=Random)

    def is_over(self, now: float) -> bool:
        """Whether its time is up."""
        return now >= self.since + self.fault.duration - _ROUNDING


class FaultInjector:
    """The faults of one robot: those that wait for their moment and those that last."""

    def __init__(self, controller: Controller) -> None:
        """Begin with none."""
        self._controller = controller
        #: What connections can be impaired, by the name that faults call it.
        self.interfaces: dict[str, Impairable] = {}
        #: Whether there is anything to do in a cycle.
        self.active = False
        self._pending: list[_PendingFault] = []
        self._active: list[_ActiveFault] = []
        self._delayed_interfaces: dict[str, Impairable] = {}
        self._impaired: dict[str, Impairment] = {}
        self._travelled = 0.0

    def add(self, fault: Fault) -> None:
        """
        Set a fault; it happens at its moment, at the earliest in the next cycle.

        :raises ValueError: the robot has no such interface.
        """
        if isinstance(fault, _OnInterface) and fault.interface not in self.interfaces:
            known = ', '.join(self.interfaces) or 'none'
            raise ValueError(
                f'The robot has no interface {fault.interface!r}; faults know {known}.'
            )
        trigger = fault.trigger
        side = isinstance(trigger, PlaneCrossing) and self._is_beyond(trigger)
        self._pending.append(_PendingFault(fault, self._controller.time, self._travelled, side))
        self.active = True

    def clear(self) -> None:
        """
        Forget faults that wait and end those that last.

        What has happened stays: a stop, a dropped or half-open connection.
        """
        self._pending.clear()
        self._active.clear()
        self._apply_running(self._controller.time)

    def step(self) -> None:
        """Let happen what is due in this cycle."""
        now = self._controller.time
        self._measure_path()
        due = [pending for pending in self._pending if self._is_due(pending, now)]
        if due:
            self._pending = [pending for pending in self._pending if pending not in due]
        for pending in due:
            self._start_fault(pending.fault, now)
        self._apply_running(now)
        for name, interface in tuple(self._delayed_interfaces.items()):
            if not interface.pump(now):
                del self._delayed_interfaces[name]
        self.active = bool(self._pending or self._active or self._delayed_interfaces)

    # When

    def _measure_path(self) -> None:
        """Add what the tool has moved; the tool's change of another TCP is none."""
        vx, vy, vz, _, _, _ = self._controller.tcp_twist
        self._travelled += hypot(vx, vy, vz) * self._controller.cycle

    def _is_beyond(self, plane: PlaneCrossing) -> bool:
        position = self._controller.motion.T_base_tcp.position
        return position['xyz'.index(plane.axis)] >= plane.position

    def _is_due(self, pending: _PendingFault, now: float) -> bool:
        trigger = pending.fault.trigger
        if isinstance(trigger, AfterTime):
            return now >= pending.set_at + trigger.seconds - _ROUNDING
        if isinstance(trigger, AfterDistance):
            return self._travelled - pending.travelled >= trigger.metres - _ROUNDING
        return self._is_beyond(trigger) != pending.side

    # What

    def _start_fault(self, fault: Fault, now: float) -> None:
        controller = self._controller
        if isinstance(fault, _OnInterface):
            self._start_interface_fault(self.interfaces[fault.interface], fault)
        if isinstance(fault, _TimedFault):
            seed = fault.seed if isinstance(fault, DeviationFault) else 0
            self._active.append(_ActiveFault(fault, now, Random(seed)))
        elif isinstance(fault, SpeedSliderFault):
            controller.set_slider(fault.fraction)
        elif isinstance(fault, ForeignMotionFault):
            controller.programs.submit(fault.script())
        elif isinstance(fault, EventFault) and (refusal := _ACTIONS[fault.action](controller)):
            _log.warning('The fault %s had no effect: %s', fault.action.value, refusal)

    def _start_interface_fault(self, interface: Impairable, fault: Fault) -> None:
        if isinstance(fault, DropFault):
            interface.drop()
        elif isinstance(fault, HalfOpenFault):
            interface.freeze()
            self._delayed_interfaces[fault.interface] = interface
        elif isinstance(fault, GarbageFault):
            interface.inject(Random(fault.seed).randbytes(fault.size))

    def _apply_running(self, now: float) -> None:
        """Make of all faults that last what is wrong in this cycle."""
        self._active = [running for running in self._active if not running.is_over(now)]
        self._apply_deviations(now)
        impaired = self._impairments()
        for name in self._impaired.keys() | impaired.keys():
            if self._impaired.get(name) != impaired.get(name):
                self.interfaces[name].impair(impaired.get(name), now)
                self._delayed_interfaces[name] = self.interfaces[name]
        self._impaired = impaired

    def _apply_deviations(self, now: float) -> None:
        sums: dict[DeviationQuantity, list[float]] = {}
        for running in self._active:
            fault = running.fault
            if isinstance(fault, DeviationFault):
                values = sums.setdefault(fault.quantity, [0.0] * 6)
                values[DEVIATION_AXES.index(fault.axis)] += fault.value(
                    now - running.since, running.random
                )
        self._controller.actual.deviate(
            pose=_vector6(sums.get('pose')),
            twist=_vector6(sums.get('twist')),
            acceleration=_vector6(sums.get('acceleration')),
        )

    def _impairments(self) -> dict[str, Impairment]:
        """Return what is wrong with each interface: the sum of its faults."""
        found: dict[str, Impairment] = {}
        for running in self._active:
            fault = running.fault
            if not isinstance(fault, DeviationFault):
                before = found.get(fault.interface, Impairment())
                found[fault.interface] = Impairment(
                    drops_outgoing=before.drops_outgoing or isinstance(fault, SilenceFault),
                    refuses_connections=before.refuses_connections or isinstance(fault, DropFault),
                    delay=before.delay + (fault.seconds if isinstance(fault, DelayFault) else 0.0),
                    rate=min(before.rate, fault.rate if isinstance(fault, ThrottleFault) else inf),
                )
        return found


def _vector6(values: list[float] | None) -> Vector6 | None:
    if values is None:
        return None
    x, y, z, rx, ry, rz = values
    return x, y, z, rx, ry, rz
