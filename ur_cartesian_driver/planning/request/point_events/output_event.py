# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The interface of outputs that are switched while the arm moves."""

from __future__ import annotations

from typing import ClassVar

from ur_cartesian_driver.motion.errors import NotAvailable
from ur_cartesian_driver.motion.goal.goal_table import GoalTable
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.point_events.point_event import E, PointEvent
from ur_cartesian_driver.planning.request.point_events.timed_path import PlacedOutput, TimedPath


class OutputEvent(PointEvent[E]):
    """One kind of output; the arm need not stop at its points."""

    #: What other robot programs do not do, as part of a sentence.
    cannot: ClassVar[str]

    def check_dialect(self, goal: GoalTable, options: PlanningOptions) -> None:
        """
        Refuse outputs that the robot program cannot switch.

        :raises NotAvailable: names the dialect.
        """
        if self.of(goal) and not options.dialect.is_own:
            raise NotAvailable(
                self.field,
                f'is not empty, but robot programs of wire dialect {options.dialect.name} '
                f'{self.cannot}',
                'leave it empty, or let the driver send its own robot program',
            )

    def place(self, event: E, field: str, path: TimedPath) -> list[PlacedOutput]:
        """
        Return the records of an event, and where on the path they belong.

        :param field: its name in a refusal.
        :raises InvalidGoal: no motion leads to its point.
        """
        raise NotImplementedError
