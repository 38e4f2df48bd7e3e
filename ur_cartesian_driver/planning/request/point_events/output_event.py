# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The interface of events that switch outputs while the arm moves."""

from __future__ import annotations

from collections.abc import Sequence

from ur_cartesian_driver.planning.request.point_events.point_event import E, PointEvent
from ur_cartesian_driver.planning.request.point_events.timed_path import PlacedOutput, TimedPath


class OutputEvent(PointEvent[E]):
    """A kind of event that switches an output; the arm need not stop at its points."""

    def place_all(self, events: Sequence[E], path: TimedPath) -> list[PlacedOutput]:
        """
        Return the records of all events of this kind, each with its place on the path.

        :raises InvalidGoal: as for :meth:`place`.
        """
        return [
            found
            for i, event in enumerate(events)
            for found in self.place(event, f'{self.field}[{i}]', path)
        ]

    def place(self, event: E, field: str, path: TimedPath) -> list[PlacedOutput]:
        """
        Return the records of an event, each with its place on the path.

        :param field: name of the event in a refusal.
        :raises InvalidGoal: no motion leads to the event's point.
        """
        raise NotImplementedError
