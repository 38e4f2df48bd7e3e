# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The interface of events at the points of a goal.

A kind of event is a subclass of :class:`PointEvent` with an instance in the registry. A dataclass
in :mod:`~ur_cartesian_driver.motion.goal.goal` declares the fields of the event in goals, messages
and files; the ranges of these fields are checked before the checks here run.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import ClassVar, Generic, TypeVar

from ur_cartesian_driver.kinematics.robot_models import RobotModel
from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.field_annotations import points_of
from ur_cartesian_driver.motion.goal.goal import Goal
from ur_cartesian_driver.motion.goal.goal_columns import GoalTable
from ur_cartesian_driver.motion.plan.primitive import Stop
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.mode_rules import ModeRule
from ur_cartesian_driver.planning.request.point_events.goal_rest import GoalRest

E = TypeVar('E')


@dataclass(frozen=True, slots=True)
class PlacedStop:
    """A stop of the robot program at a waypoint where the arm rests, and a note on the stop."""

    waypoint: int
    stop: Stop
    note: str = ''
    #: The order among stops at one waypoint; stops of equal order follow the registry's order.
    order: int = 0


def check_point(field: str, waypoint: int, goal: GoalTable) -> None:
    """
    Refuse the number of a point that the goal does not have.

    :raises InvalidGoal: the goal has no point of this number; the text names the numbers it has.
    """
    if not 0 <= waypoint < len(goal.waypoints):
        raise InvalidGoal(
            field,
            f'is {waypoint}, but the points are 0 to {len(goal.waypoints) - 1}',
            'name one of these',
        )


class PointEvent(Generic[E]):
    """One kind of event."""

    #: The field of the goal that holds the events.
    field: ClassVar[str]
    #: The rule for the execution modes that support the events; None = all do.
    mode_rule: ClassVar[ModeRule | None] = None

    def of(self, goal: Goal) -> Sequence[E]:
        """Return the events of a goal."""
        events: Sequence[E] = getattr(goal, self.field)
        return events

    def places(self, goal: GoalTable) -> Iterator[tuple[str, int]]:
        """Yield each field of the events that names a point, with the point's number."""
        for i, event in enumerate(self.of(goal)):
            for name, point in points_of(event).items():
                yield f'{self.field}[{i}].{name}', point

    def check(self, goal: GoalTable, options: PlanningOptions) -> None:
        """
        Check the events of a goal, in addition to the ranges of their fields.

        :raises GoalRefused: an event is wrong; the text names field, value and bound.
        """
        for i, event in enumerate(self.of(goal)):
            self.check_event(f'{self.field}[{i}]', event)

    def check_event(self, where: str, event: E) -> None:
        """
        Check an event on its own; ``where`` is its name in refusals.

        :raises InvalidGoal: the event is wrong; the text names field, value and bound.
        """

    def check_robot(self, goal: GoalTable, model: RobotModel, T_tcp_controlled: Pose) -> None:
        """
        Refuse events that the robot of the goal cannot carry out.

        :param T_tcp_controlled: pose of the controlled frame in the TCP of the motion.
        :raises NotAvailable: the robot cannot carry out an event; the text names field and reason.
        """

    def stops(self, goal: GoalTable, options: PlanningOptions) -> Iterator[PlacedStop]:
        """Yield the stops of the robot program that carry out the events."""
        yield from ()

    def left(self, events: Sequence[E], rest: GoalRest) -> Sequence[E]:
        """Return the events that remain when a stopped goal is resumed."""
        return rest.ahead(events)
