# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Checks that RTDE inputs are written as often as a program demands."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(slots=True)
class _InputWatch:
    period: float
    action: str
    last: float
    expired: bool = False


class Watchdogs:
    """The watches that `rtde_set_watchdog` has set; they end with the program."""

    def __init__(self) -> None:
        """Begin without watches."""
        self._watches: dict[str, _InputWatch] = {}

    def watch(self, variable: str, frequency: float, action: str, now: float) -> None:
        """Watch an input from now on; a frequency of 0 ends the watch."""
        if frequency > 0.0:
            self._watches[variable] = _InputWatch(1.0 / frequency, action, now)
        else:
            self._watches.pop(variable, None)

    def written(self, variables: tuple[str, ...], now: float) -> None:
        """Note the time [s] at which inputs were written."""
        for variable in variables:
            if watch := self._watches.get(variable):
                watch.last, watch.expired = now, False

    def expired(self, now: float) -> list[tuple[str, str]]:
        """Return the inputs that have become late since the last call, with their actions."""
        late = []
        for variable, watch in self._watches.items():
            if not watch.expired and now - watch.last > watch.period:
                watch.expired = True
                late.append((variable, watch.action))
        return late

    def clear(self) -> None:
        """End all watches."""
        self._watches.clear()
