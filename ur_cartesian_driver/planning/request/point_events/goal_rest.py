# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The remainder of a stopped goal, as needed for the events at its points."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

from ur_cartesian_driver.motion.goal.field_annotations import points_of, renumbered

E = TypeVar('E')

#: Smaller fractions of a segment are neglected.
NO_FRACTION = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class GoalRest:
    """
    The points of a resumed goal, as places on the path of the goal that was stopped.

    A place on that path is a number ``k + u``: the fraction u of the segment to point k. So point
    k itself is at the place k + 1.
    """

    #: Place where the path is resumed.
    begin: float
    #: Place where the arm was stopped; the path is resumed a little before it.
    stopped: float
    #: Places of the points of the resumed goal.
    places: Sequence[float]
    #: Function that returns the time from a place to ``begin`` [s]; inf = unknown. Its other
    #: arguments are the name and value of the time offset of an event at the place; it refuses an
    #: offset > 0 if the time is unknown.
    time_since: Callable[[float, str, float], float]
    #: Function that returns the distance from one place to another along the path [m].
    distance: Callable[[float, float], float]
    #: Function that returns the place at a distance [m] after another one, negative = before it.
    behind: Callable[[float, float], float]

    @property
    def first(self) -> int:
        """The number of the resumed goal's last point at or before ``begin``; 0 if it has none."""
        return max(sum(place <= self.begin + NO_FRACTION for place in self.places) - 1, 0)

    def is_passed(self, waypoint: int) -> bool:
        """Return whether the path is resumed at or after a waypoint of the stopped goal."""
        return waypoint + 1.0 <= self.begin + NO_FRACTION

    def index(self, waypoint: int) -> int:
        """Return the number that a waypoint of the stopped goal has in the resumed goal."""
        places = self.places
        return min(range(len(places)), key=lambda i: abs(places[i] - waypoint - 1.0))

    def ahead(self, events: Sequence[E]) -> list[E]:
        """Return the events whose points are all ahead, with the points' new numbers."""
        return [
            renumbered(event, self.index)
            for event in events
            if not any(map(self.is_passed, points_of(event).values()))
        ]

    def with_last(self, events: Sequence[E]) -> list[E]:
        """
        Return the events ahead, and before them the events at the last passed point with events.

        The latter are moved to the start of the resumed goal; they are left out if it has no point
        there.
        """
        first, left = self.first, self.ahead(events)
        passed = [event for event in events if self.is_passed(*points_of(event).values())]
        if not passed or self.places[first] > self.begin + NO_FRACTION:  # no point there
            return left
        last = max(point for event in passed for point in points_of(event).values())
        again = [event for event in passed if last in points_of(event).values()]
        return [*(renumbered(event, lambda _: first) for event in again), *left]

    def stretches(self, events: Sequence[E], begun: Callable[[E], E]) -> list[E]:
        """
        Return the events that last from point to point, cut to the remaining path.

        :param begun: returns the continuation of an event that has already begun.
        """
        left = []
        for event in events:
            first, last = points_of(event).values()
            if self.is_passed(last):
                continue
            begin = self.first if self.is_passed(first) else self.index(first)
            if begin < self.index(last):
                numbers = {first: begin, last: self.index(last)}
                event = begun(event) if self.is_passed(first) else event
                left.append(renumbered(event, numbers.__getitem__))
        return left
