# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The interface of outputs that are switched while the arm moves."""

from __future__ import annotations

from ur_cartesian_driver.planning.request.point_events.point_event import E, PointEvent
from ur_cartesian_driver.planning.request.point_events.timed_path import PlacedOutput, TimedPath


class OutputEvent(PointEvent[E]):
    """One kind of output; the arm need not stop at its points."""

    def place(self, event: E, field: str, path: TimedPath) -> list[PlacedOutput]:
        """
        Return the records of an event, and where on the path they belong.

        :param field: its name in a refusal.
        :raises InvalidGoal: no motion leads to its point.
        """
        raise NotImplementedError
