# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Which of the values that come at any time, and in any order, is the newest, and how long."""

from __future__ import annotations

from math import inf


class Freshness:
    """
    Takes the stamps of values; all times are of one steady clock.

    :param max_age: how old a value may be to count [s].
    """

    def __init__(self, max_age: float) -> None:
        """Begin with no value."""
        self.max_age = max_age
        #: How many values were newer than those before, and how many were not, or were too old.
        self.accepted = self.dropped = 0
        self._stamp = -inf

    def accept(self, age: float, now: float) -> bool:
        """
        Take a value, and tell whether it counts.

        :param age: how long ago it was true [s].
        """
        stamp = now - max(0.0, age)
        if stamp <= self._stamp or not age <= self.max_age:  # NaN is no age
            self.dropped += 1
            return False
        self._stamp = stamp
        self.accepted += 1
        return True

    def is_stale(self, now: float) -> bool:
        """Tell whether the newest value is too old, or there is none."""
        return now - self._stamp > self.max_age
