# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Bodies of the cell that the tool takes or puts down at points where the arm stops.

Nothing is sent to the robot for them: they change the bodies on the tool from a point on, in the
checks and in the driver's cell. Outputs of a gripper and payloads are events of their own.
"""

from __future__ import annotations

from collections.abc import Sequence

from ur_cartesian_driver.motion.cell.cell import Cell
from ur_cartesian_driver.motion.cell.shapes import HalfSpace
from ur_cartesian_driver.motion.errors import InvalidGoal, NotAvailable
from ur_cartesian_driver.motion.goal.field_annotations import renumbered
from ur_cartesian_driver.motion.goal.goal import Goal, PartAction, PartChange
from ur_cartesian_driver.motion.goal.goal_columns import GoalTable
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.point_events.goal_rest import GoalRest, NO_FRACTION
from ur_cartesian_driver.planning.request.point_events.point_event import PointEvent


class PartChanges(PointEvent[PartChange]):
    """Bodies that the tool takes or puts down at points."""

    field = 'part_changes'

    def check(self, goal: GoalTable, options: PlanningOptions) -> None:
        """Refuse unknown bodies, attaching an attached body, and releasing a free one."""
        check_part_changes(goal, options.cell)

    def left(self, events: Sequence[PartChange], rest: GoalRest) -> Sequence[PartChange]:
        """Return the changes at points that the arm had not left when the goal was stopped."""
        return [
            renumbered(change, lambda i: rest.first if rest.is_passed(i) else rest.index(i))
            for change in events
            if change.waypoint + 1.0 >= rest.stopped - NO_FRACTION
        ]


def check_part_changes(goal: Goal | GoalTable, cell: Cell) -> None:
    """
    Refuse changes to the bodies of a cell that are impossible in the order of their points.

    :raises InvalidGoal: a change is impossible; the text names field and body.
    """
    on_tool = {body.name for body in cell.bodies if body.is_on_tool}
    order = sorted(range(len(goal.part_changes)), key=lambda i: goal.part_changes[i].waypoint)
    for i in order:
        change, where = goal.part_changes[i], f'part_changes[{i}]'
        _check_body(where, change, cell)
        attaches = change.action is PartAction.ATTACH
        if attaches is (change.body in on_tool):
            raise InvalidGoal(
                f'{where}.action',
                f'is {change.action.name}, but "{change.body}" '
                + ('is on the tool already' if attaches else 'is not on the tool'),
                'release it before' if attaches else 'attach it before',
            )
        (on_tool.add if attaches else on_tool.remove)(change.body)


def _check_body(where: str, change: PartChange, cell: Cell) -> None:
    if not cell:
        raise NotAvailable(
            f'{where}.body',
            f'is "{change.body}", but the driver has no bodies',
            'set its parameter cell_file, or add the body with change_cell',
        )
    try:
        body = cell.body(change.body)
    except ValueError as error:
        raise InvalidGoal(f'{where}.body', f'names what is not there: {error}') from None
    if any(isinstance(each.shape, HalfSpace) for each in body.shapes):
        raise InvalidGoal(
            f'{where}.body',
            f'is "{change.body}", but a plane has no end, so no tool can take it',
            'name another body',
        )
