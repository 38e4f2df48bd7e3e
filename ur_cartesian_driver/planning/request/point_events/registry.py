# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The registry of events at points: a row for each kind, and the checks of all kinds.

A new kind needs a dataclass in ``motion.goal.goal``, a module here, and a row.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ur_cartesian_driver.motion.errors import InvalidGoal, NotAvailable
from ur_cartesian_driver.motion.goal.field_annotations import goal_fields, index_fields
from ur_cartesian_driver.motion.goal.goal import Goal
from ur_cartesian_driver.motion.goal.goal_columns import GoalTable
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.field_rules import check_record
from ur_cartesian_driver.planning.request.goal_fields import is_spline, is_timed
from ur_cartesian_driver.planning.request.mode_rules import check_mode
from ur_cartesian_driver.planning.request.point_events.dwells import (
    Dwells,
    refuse_dwells_of_open_goals,
)
from ur_cartesian_driver.planning.request.point_events.input_waits import InputWaits
from ur_cartesian_driver.planning.request.point_events.output_event import OutputEvent
from ur_cartesian_driver.planning.request.point_events.part_changes import PartChanges
from ur_cartesian_driver.planning.request.point_events.payload_changes import PayloadChanges
from ur_cartesian_driver.planning.request.point_events.point_event import check_point, PointEvent
from ur_cartesian_driver.planning.request.point_events.presses import Presses
from ur_cartesian_driver.planning.request.point_events.proportional_outputs import (
    ProportionalOutputs,
)
from ur_cartesian_driver.planning.request.point_events.pulses import Pulses
from ur_cartesian_driver.planning.request.point_events.safe_outputs import check_safe_outputs
from ur_cartesian_driver.planning.request.point_events.script_calls import ScriptCalls
from ur_cartesian_driver.planning.request.point_events.switched_outputs import SwitchedOutputs

#: Events at points where the arm stops.
STOP_EVENTS: tuple[PointEvent[Any], ...] = (
    Dwells(),
    InputWaits(),
    ScriptCalls(),
    PayloadChanges(),
    PartChanges(),
    Presses(),
)
#: Events that happen while the arm moves.
OUTPUT_EVENTS: tuple[OutputEvent[Any], ...] = (
    SwitchedOutputs(),
    ProportionalOutputs(),
    Pulses(),
)
POINT_EVENTS: tuple[PointEvent[Any], ...] = (*OUTPUT_EVENTS, *STOP_EVENTS)
#: By dataclass: the kinds of events that have a dataclass of their own.
EVENT_KINDS: Mapping[type, PointEvent[Any]] = {
    each.type: kind
    for kind in POINT_EVENTS
    for each in goal_fields(Goal)
    if each.name == kind.field and index_fields(each.type)
}


def check_event(where: str, event: Any) -> None:
    """
    Check an event on its own, before its goal is complete.

    :param where: name of the event in the refusal.
    :raises InvalidGoal: the event is wrong; the text names field, value and bound.
    """
    check_record(where, event)
    EVENT_KINDS[type(event)].check_event(where, event)


def check_outputs(goal: GoalTable, options: PlanningOptions) -> None:
    """
    Refuse outputs that cannot be switched while the arm moves.

    :raises InvalidGoal: an output is wrong; the text names field, value and bound.
    :raises NotAvailable: the execution mode cannot switch outputs.
    """
    for kind in OUTPUT_EVENTS:
        check_mode(goal, kind.mode_rule)
    check_safe_outputs(goal)
    for kind in OUTPUT_EVENTS:
        kind.check(goal, options)


def check_stops(goal: GoalTable, options: PlanningOptions) -> None:
    """
    Refuse events that the robot cannot carry out, and events at points that the arm passes.

    :raises InvalidGoal: an event is wrong; the text names field, value and bound.
    :raises NotAvailable: the execution mode does not support an event, or the goal has keep_open.
    """
    for kind in STOP_EVENTS:
        check_mode(goal, kind.mode_rule)
    refuse_dwells_of_open_goals(goal.segments, keep_open=goal.keep_open)
    for kind in STOP_EVENTS:
        for field, waypoint in kind.places(goal):
            check_point(field, waypoint, goal)
            if goal.keep_open:
                raise NotAvailable(
                    field,
                    'is set, but a goal with keep_open does nothing at points but switch outputs',
                    'split the goal there',
                )
            _check_place(goal, field, waypoint)
    for kind in STOP_EVENTS:
        kind.check(goal, options)


def _check_place(goal: GoalTable, field: str, i: int) -> None:
    """Refuse a point at which the arm does not stop."""
    radius = float(goal.motions.blend_radii[i])
    if radius > 0.0 and i + 1 < len(goal.waypoints):
        raise InvalidGoal(
            field,
            f'needs a stop at points[{i}], but with a blend of {1e3 * radius:g} mm the arm passes '
            'it',
            'set its blend_radius to 0',
        )
    for name in ('twists', 'accelerations') if is_spline(goal) else ():
        if np.nan_to_num(getattr(goal.waypoints, name)[i]).any():
            what = name.removesuffix('s')
            raise InvalidGoal(
                field,
                f'needs a stop at points[{i}], which the arm passes with a {what} of its own',
                f'set the {what} to 0',
            )
    if is_timed(goal) and goal.waypoints.times[i] == 0.0:
        raise InvalidGoal(
            field,
            f'needs a motion to points[{i}], but the robot is there at time 0',
            'give this and the next points later times',
        )
