# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Injects faults into the simulated robot when they are triggered.

:class:`FaultInjector` uses the controller's clock, so it is as deterministic as the controller.
While no fault is set, the controller does not call the injector.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
import logging
from math import hypot, inf
from random import Random

from ur_cartesian_driver.motion.geometry.vectors import vector6
from ur_cartesian_driver.sim.controller import Controller
from ur_cartesian_driver.sim.faults.fault_values import (
    AfterDistance,
    AfterTime,
    DelayFault,
    DEVIATION_AXES,
    DEVIATION_QUANTITIES,
    DeviationFault,
    DeviationQuantity,
    DropFault,
    EventFault,
    Fault,
    FaultEvent,
    ForeignMotionFault,
    GarbageFault,
    HalfOpenFault,
    InterfaceFault,
    PlaneCrossing,
    SilenceFault,
    SpeedSliderFault,
    ThrottleFault,
    TimedFault,
)
from ur_cartesian_driver.sim.faults.impairment import Impairable, Impairment
from ur_cartesian_driver.sim.state.power_and_safety import SafetyEvent

_log = logging.getLogger(__name__)

# Tolerance [s, m] for triggers and durations, because times and travel are sums of floats.
_ROUNDING = 1e-9


def _safety(event: SafetyEvent) -> Callable[[Controller], object]:
    return lambda controller: controller.safety_event(event)


#: Event -> function that causes the event; it returns the reason if the controller refuses.
_ACTIONS: Mapping[FaultEvent, Callable[[Controller], object]] = {
    FaultEvent.PROTECTIVE_STOP: _safety(SafetyEvent.PROTECTIVE_STOP),
    FaultEvent.EMERGENCY_STOP: _safety(SafetyEvent.EMERGENCY_STOP),
    FaultEvent.RELEASE_EMERGENCY_STOP: _safety(SafetyEvent.RELEASE),
    FaultEvent.SAFEGUARD_STOP: _safety(SafetyEvent.SAFEGUARD_STOP),
    FaultEvent.RESET_SAFEGUARD: _safety(SafetyEvent.SAFEGUARD_RESET),
    FaultEvent.VIOLATION: _safety(SafetyEvent.VIOLATION),
    FaultEvent.FAULT: _safety(SafetyEvent.FAULT),
    FaultEvent.UNLOCK: _safety(SafetyEvent.UNLOCK),
    FaultEvent.STOP: lambda controller: controller.programs.stop(),
    FaultEvent.PAUSE: lambda controller: controller.programs.pause(),
    FaultEvent.PLAY: lambda controller: controller.programs.play(),
    FaultEvent.POWER_OFF: Controller.power_off,
}


@dataclass(slots=True)
class _PendingFault:
    """A pending fault, with the time [s] and the travel of the TCP [m] when the fault was set."""

    fault: Fault
    set_at: float
    travelled: float
    #: Whether the coordinate of the TCP was at or above the plane when the fault was set.
    side: bool


@dataclass(slots=True)
class _ActiveFault:
    """A lasting fault, the time of its start [s], and the random numbers of its noise."""

    fault: TimedFault
    since: float
    random: Random = field(default_factory=Random)

    def is_over(self, now: float) -> bool:
        """Return whether the duration of the fault has passed."""
        return now >= self.since + self.fault.duration - _ROUNDING


class FaultInjector:
    """The faults of one robot: pending ones, which wait for their trigger, and lasting ones."""

    def __init__(self, controller: Controller) -> None:
        """Begin without faults."""
        self._controller = controller
        #: The interfaces that can be impaired, by their names in faults.
        self.interfaces: dict[str, Impairable] = {}
        #: Whether `step` has to be called in each cycle.
        self.active = False
        self._pending: list[_PendingFault] = []
        self._active: list[_ActiveFault] = []
        self._delayed_interfaces: dict[str, Impairable] = {}
        self._impaired: dict[str, Impairment] = {}
        self._travelled = 0.0

    def add(self, *faults: Fault) -> None:
        """
        Set faults; each happens when it is triggered, in the next cycle at the earliest.

        :raises ValueError: the robot has no such interface; none of the faults is set.
        """
        for fault in faults:
            if isinstance(fault, InterfaceFault) and fault.interface not in self.interfaces:
                known = ', '.join(self.interfaces) or 'none'
                raise ValueError(
                    f'The robot has no interface {fault.interface!r}; it has {known}.'
                )
        for fault in faults:
            trigger = fault.trigger
            side = isinstance(trigger, PlaneCrossing) and self._is_beyond(trigger)
            self._pending.append(
                _PendingFault(fault, self._controller.time, self._travelled, side)
            )
            self.active = True

    def clear(self) -> None:
        """
        Forget pending faults, and end lasting faults.

        Effects that have happened remain, such as a stop, or a dropped or half-open connection.
        """
        self._pending.clear()
        self._active.clear()
        self._apply_running(self._controller.time)

    def step(self) -> None:
        """Trigger the faults due in this cycle, and apply the lasting faults."""
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

    # Triggers

    def _measure_path(self) -> None:
        """Add the travel of the TCP in this cycle; a change of the active TCP adds nothing."""
        vx, vy, vz, _, _, _ = self._controller.motion.tcp_twist
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

    # Effects

    def _start_fault(self, fault: Fault, now: float) -> None:
        controller = self._controller
        if isinstance(fault, InterfaceFault):
            self._start_interface_fault(self.interfaces[fault.interface], fault)
        if isinstance(fault, TimedFault):
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
        """Apply all lasting faults to this cycle."""
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
            **{
                quantity: vector6(sums[quantity]) if quantity in sums else None
                for quantity in DEVIATION_QUANTITIES
            }
        )

    def _impairments(self) -> dict[str, Impairment]:
        """Return the impairment of each impaired interface, combined from all its faults."""
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
