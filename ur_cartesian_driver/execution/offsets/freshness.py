# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The age of values that clients send while the arm moves, and warnings about it."""

from __future__ import annotations

from math import inf

from ur_cartesian_driver.execution.goal.goal_commands import GoalCommand, LogWarning

#: Shortest time between two warnings of one kind [s].
WARNING_PERIOD = 2.0


class Freshness:
    """
    Selects the values to use; they may come at any time and in any order.

    All times are of one steady clock.

    :param max_age: the largest age at which a value is used [s].
    """

    def __init__(self, max_age: float) -> None:
        """Begin with no value."""
        self.max_age = max_age
        #: Number of accepted values; number of values dropped, out of order or too old.
        self.accepted = self.dropped = 0
        self._stamp = -inf

    def accept(self, age: float, now: float) -> bool:
        """
        Note a value, and return whether to use it.

        :param age: how old the value is on arrival [s].
        """
        stamp = now - max(0.0, age)
        if stamp <= self._stamp or not age <= self.max_age:  # also refuses NaN
            self.dropped += 1
            return False
        self._stamp = stamp
        self.accepted += 1
        return True

    def is_stale(self, now: float) -> bool:
        """Return whether the newest value is too old, or no value has come."""
        return now - self._stamp > self.max_age


class RareWarnings:
    """Limits the rate of warnings; one that comes too soon waits, unless its reason is gone."""

    def __init__(self) -> None:
        """Begin before the first warning."""
        self._waiting, self._next = '', -inf

    def ask(self, text: str) -> None:
        """Ask for a warning."""
        self._waiting = text

    def forget(self) -> None:
        """Drop a warning that waits: its reason is gone."""
        self._waiting = ''

    def due(self, now: float) -> list[GoalCommand]:
        """Return the waiting warning, but none within :data:`WARNING_PERIOD` of the last one."""
        if not self._waiting or now < self._next:
            return []
        text, self._waiting, self._next = self._waiting, '', now + WARNING_PERIOD
        return [LogWarning(text=text)]
