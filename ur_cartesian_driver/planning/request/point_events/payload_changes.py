# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Changes of the payload at points where the arm stops."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import isfinite

from ur_cartesian_driver.motion.errors import InvalidGoal, NotAvailable
from ur_cartesian_driver.motion.geometry.vectors import vector6, ZERO6
from ur_cartesian_driver.motion.goal.goal import PayloadChange
from ur_cartesian_driver.motion.goal.goal_columns import GoalTable
from ur_cartesian_driver.motion.goal.inertia import inertia_problem
from ur_cartesian_driver.motion.plan.primitive import ChangePayload
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.point_events.goal_rest import GoalRest
from ur_cartesian_driver.planning.request.point_events.point_event import PlacedStop, PointEvent

#: Largest plausible coordinate of a centre of gravity in the flange frame [m].
MAX_OFFSET = 5.0


class PayloadChanges(PointEvent[PayloadChange]):
    """Payloads that the robot program sets at points."""

    field = 'payload_changes'

    def check_event(self, where: str, change: PayloadChange) -> None:
        """Refuse a centre of gravity or an inertia that must be a mistake."""
        if not all(isfinite(x) and abs(x) <= MAX_OFFSET for x in change.center_of_gravity):
            raise InvalidGoal(
                f'{where}.center_of_gravity',
                f'contains a number beyond {MAX_OFFSET:g} m',
                'give it in metres, in the flange frame',
            )
        if problem := inertia_problem(change.inertia):
            raise InvalidGoal(
                f'{where}.inertia',
                problem,
                'give it about the centre of gravity, or leave it empty',
            )

    def check(self, goal: GoalTable, options: PlanningOptions) -> None:
        """Refuse wrong payloads, and inertia and transition if the robot's software lacks them."""
        super().check(goal, options)
        if options.target_payload_known:
            return
        for i, change in enumerate(goal.payload_changes):
            if any(change.inertia) or change.transition_time:
                field = 'inertia' if any(change.inertia) else 'transition_time'
                raise NotAvailable(
                    f'payload_changes[{i}].{field}',
                    "is set, but the robot's software is not known to have it (PolyScope 5 has it "
                    'from 5.10 on)',
                    'leave it out',
                )

    def stops(self, goal: GoalTable, options: PlanningOptions) -> Iterator[PlacedStop]:
        """Yield the changes as stops of the robot program."""
        for change in goal.payload_changes:
            stop = ChangePayload(
                mass=change.mass,
                center_of_gravity=change.center_of_gravity,
                inertia=vector6(change.inertia or ZERO6),
                transition_time=change.transition_time,
            )
            yield PlacedStop(change.waypoint, stop, f'sets a payload of {change.mass:g} kg there')

    def left(self, events: Sequence[PayloadChange], rest: GoalRest) -> Sequence[PayloadChange]:
        """Return the change in effect where the path is resumed, and the changes ahead."""
        return rest.with_last(events)
