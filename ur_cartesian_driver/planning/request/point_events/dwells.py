# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Dwells: the arm rests at the end of a segment for a time that the segment gives."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ur_cartesian_driver.motion.errors import InvalidGoal, NotAvailable
from ur_cartesian_driver.motion.goal.goal import MAX_STOP_TIME, Segment
from ur_cartesian_driver.motion.goal.goal_columns import GoalTable, rows_where, SegmentRows
from ur_cartesian_driver.motion.plan.joint_spline import SAME_TIME
from ur_cartesian_driver.motion.plan.primitive import Wait
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.goal_fields import is_timed, point_field, segment_field
from ur_cartesian_driver.planning.request.point_events.point_event import PlacedStop, PointEvent
from ur_cartesian_driver.planning.request.spline_rules import MIN_SPLINE_TIME


class Dwells(PointEvent[Segment]):
    """Segments with a dwell: the arm rests at their end."""

    field = 'segments'

    def places(self, goal: GoalTable) -> Iterator[tuple[str, int]]:
        """Yield the field name and the point of each dwell."""
        for i in rows_where(goal.motions.dwells > 0.0):
            yield segment_field(i, 'dwell'), i

    def check(self, goal: GoalTable, options: PlanningOptions) -> None:
        """Refuse dwells that are too long, or that leave no time for the motion after them."""
        times = goal.waypoints.times
        for field, i in self.places(goal):
            dwell = float(goal.motions.dwells[i])
            if dwell > MAX_STOP_TIME:
                raise InvalidGoal(
                    field, f'is {dwell:g} s, more than {MAX_STOP_TIME:g} s', 'split the goal'
                )
            is_followed = is_timed(goal) and i + 1 < len(times)
            if is_followed and times[i + 1] - times[i] - dwell < MIN_SPLINE_TIME - SAME_TIME:
                raise InvalidGoal(
                    field,
                    f'is {dwell:g} s, but points[{i + 1}] follows {times[i + 1] - times[i]:g} s '
                    f'after {point_field(i)}',
                    'the arm needs time for the motion as well: reduce it, or give the points '
                    'after it later times',
                )

    def stops(self, goal: GoalTable, options: PlanningOptions) -> Iterator[PlacedStop]:
        """Yield the dwells as stops of the robot program."""
        for _, i in self.places(goal):
            rest = Wait(duration=float(goal.motions.dwells[i]))
            yield PlacedStop(i, rest, f'rests there for {rest.duration:g} s', order=1)


def refuse_dwells_of_open_goals(
    segments: Sequence[Segment], *, keep_open: bool, first: int = 0
) -> None:
    """
    Refuse dwells in a goal that stays open for points.

    :param first: the number of the first of ``segments`` in the goal.
    """
    rows = rows_where(SegmentRows.of(segments).dwells > 0.0) if keep_open else []
    if rows:
        raise NotAvailable(
            segment_field(first + rows[0], 'dwell'),
            f'is {segments[rows[0]].dwell:g} s, but a goal with keep_open does not rest at points',
            'append the next points later: the arm waits for them',
        )
