# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Outputs that are switched when the tool passes a point, or some way or time before or after."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ur_cartesian_driver.motion.errors import InvalidGoal, NotAvailable
from ur_cartesian_driver.motion.goal.goal import IOCommand, OutputKind, SafeOutput
from ur_cartesian_driver.motion.goal.goal_columns import GoalTable
from ur_cartesian_driver.motion.goal.output_names import output_fault, output_name
from ur_cartesian_driver.motion.plan.primitive import SwitchOutput
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.goal_fields import resolve_execution_mode
from ur_cartesian_driver.planning.request.point_events.goal_rest import GoalRest, NO_FRACTION
from ur_cartesian_driver.planning.request.point_events.output_event import OutputEvent
from ur_cartesian_driver.planning.request.point_events.point_event import check_point
from ur_cartesian_driver.planning.request.point_events.timed_path import (
    PassedPoint,
    PlacedOutput,
    SAME_TIME,
    TimedPath,
)

#: Decimal places to which the remaining time of a command [s] is rounded.
_DIGITS = 9


class SwitchedOutputs(OutputEvent[IOCommand]):
    """The output commands of a goal."""

    field = 'io_commands'

    def check(self, goal: GoalTable, options: PlanningOptions) -> None:
        """Refuse wrong commands, and commands that a goal with keep_open cannot carry out."""
        super().check(goal, options)
        mode = resolve_execution_mode(goal)
        if goal.io_commands and goal.keep_open and mode.traits.streams_setpoints:
            raise NotAvailable(
                self.field,
                f'is not empty, but a {mode.name} goal with keep_open switches no outputs',
                'set execution to SPLINE or PRIMITIVES, or send all points at once',
            )
        for field, waypoint in self.places(goal):
            check_point(field, waypoint, goal)
        # The path to the last point of an open spline no longer changes.
        if goal.keep_open and (goal.replace_horizon or not mode.traits.is_spline):
            for i, command in enumerate(goal.io_commands):
                _check_open(f'{self.field}[{i}]', command)

    def check_event(self, where: str, command: IOCommand) -> None:
        """Refuse a wrong output or value, and both a distance and a fraction."""
        check_output(where, command)
        if command.distance and command.fraction:
            raise InvalidGoal(
                f'{where}.fraction',
                f'is {command.fraction:g}, but distance = {command.distance:g} m gives the place '
                'already',
                'leave one of them out',
            )

    def left(self, events: Sequence[IOCommand], rest: GoalRest) -> Sequence[IOCommand]:
        """Return commands that restore the outputs at the resumption, and the commands ahead."""
        left, passed = [], []
        for i, command in enumerate(events):
            place = _place(command, rest)
            if place > rest.begin + NO_FRACTION:
                left.append(_ahead(command, place, rest))
                continue
            field, offset = f'io_commands[{i}].offset', command.offset
            passed.append((offset - rest.time_since(place, field, offset), place, i))
        state: dict[tuple[int, int], IOCommand] = {}
        for due, _, i in sorted(passed):
            command = events[i]
            command = replace(
                command,
                waypoint=rest.first,
                offset=max(round(due, _DIGITS), 0.0),
                distance=0.0,
                fraction=0.0,
                lead='',  # the arm rests there, so a lead is impossible
            )
            if due > 0.0:
                left.append(command)
            else:
                state[command.output, command.pin] = command
        return [*state.values(), *left]

    def place(self, command: IOCommand, field: str, path: TimedPath) -> list[PlacedOutput]:
        """Return the record that switches the output, with its time and place."""
        point, lead = self._passed(command, field, path), max(-command.offset, 0.0)
        lead_field = _lead_field(field, command)
        time, last = point.time + max(command.offset, 0.0), len(path.ends) - 1
        late, delay, trigger_time, law = time - float(path.ends[last]), 0.0, None, None
        rest = path.rests.get(command.waypoint)
        has_place = bool(command.distance or command.fraction)
        if lead > 0.0:
            time = point.time if point.trigger_time is None else point.trigger_time
            after, trigger_time, law = path.ahead(time, lead, lead_field)
            where = f'{lead:.3f} s ahead, {point.where}'
        elif command.offset <= SAME_TIME:
            after, trigger_time, where = point.after, point.trigger_time, point.where
        elif rest is not None and time <= path.ends[rest] and not has_place:
            after, delay = rest - 1, command.offset
            where = f'{command.offset:.3f} s after stopping there'
        elif late > -SAME_TIME:
            after, delay = last, max(late, 0.0)
            where = f'{delay:.3f} s after the end'
        else:
            after, trigger_time = path.last_returned(time), time
            where = f'{command.offset:.3f} s after {point.where if has_place else "it"}'
        record = SwitchOutput(
            output=command.output,
            pin=command.pin,
            value=command.value,
            domain=command.domain,
            delay=delay,
        )
        return [
            PlacedOutput(
                field=field,
                lead=lead,
                lead_field=lead_field,
                time=time if trigger_time is None else trigger_time,
                after_index=after,
                report_index=point.row,
                records=(*filter(None, (law,)), path.triggered(record, trigger_time, after)),
                text=f'switches {describe_command(command)} {where}',
            )
        ]

    def _passed(self, command: IOCommand, field: str, path: TimedPath) -> PassedPoint:
        """Return the passage of the tool through the place of a command."""
        if command.distance or command.fraction:
            return path.beside(command.waypoint, command.distance, command.fraction, field)
        point = path.point(command.waypoint)
        if point is None:
            raise InvalidGoal(
                f'{field}.point_index',
                f'is {command.waypoint}, but no motion leads there: the robot is already there',
                'switch the output before the goal',
            )
        return point


def _check_open(where: str, command: IOCommand) -> None:
    """Refuse places and leads in a goal whose path changes when points are appended."""
    for field, value in (
        (f'{where}.distance', command.distance),
        (f'{where}.fraction', command.fraction),
        (_lead_field(where, command), min(command.offset, 0.0)),
    ):
        if value:
            raise NotAvailable(
                field,
                f'is {value:g}, but a goal with keep_open switches outputs at its points or '
                'later, unless it is a SPLINE without replace_horizon: points that are yet to '
                'come change the path and its times',
                'add a point there, or set execution to SPLINE',
            )


def _lead_field(where: str, command: IOCommand) -> str:
    """Return the field that gives the lead of a command."""
    return f'{where}.lead' if command.lead_name else f'{where}.offset'


def _place(command: IOCommand, rest: GoalRest) -> float:
    """Return the place of a command on the path of the goal that was stopped."""
    point = command.waypoint + 1.0
    if command.distance:
        return rest.behind(point, command.distance)
    return point + command.fraction


def _ahead(command: IOCommand, place: float, rest: GoalRest) -> IOCommand:
    """Return a command whose place is ahead, with its point in the resumed goal."""
    point, distance, fraction = command.waypoint, command.distance, command.fraction
    if rest.is_passed(point):
        number, distance, fraction = rest.first, rest.distance(rest.begin, place), 0.0
    else:
        number = rest.index(point)
        if fraction < 0.0 and rest.begin > point:  # a fraction of a segment that is cut
            distance, fraction = rest.distance(point + 1.0, place), 0.0
    return replace(command, waypoint=number, distance=round(distance, _DIGITS), fraction=fraction)


def check_output(where: str, named: IOCommand | SafeOutput) -> None:
    """
    Refuse an output that the robot does not have, or a value that the output does not accept.

    :raises InvalidGoal: output or value is wrong; the text names field, value and bound.
    """
    if (fault := output_fault(named.output, named.pin, named.value)) is not None:
        name, wrong, remedy = fault
        raise InvalidGoal(f'{where}.{name}', wrong, remedy)


def describe_command(command: IOCommand | SwitchOutput) -> str:
    """Return a description of a command, or of the record that carries it out."""
    name = output_name(command.output, command.pin)
    if isinstance(command, SwitchOutput) and command.follows_speed:
        return f'{name} to follow the speed'
    if command.output is OutputKind.STANDARD_ANALOG:
        return f'{name} to {command.value:g} ({command.domain.name.lower()})'
    return f'{name} {"on" if command.value else "off"}'
