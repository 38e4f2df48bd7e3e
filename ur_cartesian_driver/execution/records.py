# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The records of a goal on the wire, and what they are to the goal.

A goal counts points, the wire counts records, and the robot program counts the motions that it
has begun. These are three things: a spline takes several motions from point to point, an output
that is switched on the way is a record and no motion, and a first point at time 0 has no record.
"""

from __future__ import annotations

from array import array
from bisect import bisect_left

from ur_cartesian_driver.execution.order import Order


class Records:
    """What is known of each record; they are numbered from the start of the goal."""

    def __init__(self, order: Order) -> None:
        """Take the records of an order."""
        self._waypoints = array('i', order.waypoint.tobytes())
        self._ends = array('d', order.ends.tobytes())
        self._asks = array('d', order.asks.tobytes())
        #: The numbers of those that are motions.
        self._motions = array('q', order.is_motion.nonzero()[0].astype('int64').tobytes())

    @property
    def total(self) -> int:
        """How many there are."""
        return len(self._waypoints)

    @property
    def points(self) -> int:
        """How many points the goal has."""
        return self._waypoints[-1] + 1

    def begun(self, motions: int) -> int:
        """Return how many records are begun when so many motions are."""
        if motions <= 0:
            return 0
        return self._motions[min(motions, len(self._motions)) - 1] + 1

    def running(self, motions: int) -> tuple[int, int] | None:
        """
        Return to which points the motion that was begun last and the one before it lead.

        :param motions: how many are begun; None is returned for 0.
        """
        if motions <= 0:
            return None
        last = min(motions, len(self._motions)) - 1
        return (self._waypoints[self._motions[last]],
                self._waypoints[self._motions[max(last - 1, 0)]] if last else -1)

    def before(self, waypoint: int) -> int:
        """Return how many records stand before those of a point."""
        return bisect_left(self._waypoints, waypoint)

    def end(self, records: int) -> float:
        """Return when the last one of so many is planned to end [s]."""
        return self._ends[records - 1] if records > 0 else 0.0
