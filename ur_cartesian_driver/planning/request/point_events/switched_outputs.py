# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Outputs that are switched when the tool passes a point, or some time after that."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ur_cartesian_driver.motion.errors import InvalidGoal, NotAvailable
from ur_cartesian_driver.motion.goal.goal import IOCommand, OutputKind, SafeOutput
from ur_cartesian_driver.motion.goal.goal_table import GoalTable
from ur_cartesian_driver.motion.goal.output_names import output_fault, output_name
from ur_cartesian_driver.motion.plan.primitive import SwitchOutput
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.goal_fields import resolve_execution_mode
from ur_cartesian_driver.planning.request.point_events.goal_rest import GoalRest
from ur_cartesian_driver.planning.request.point_events.output_event import OutputEvent
from ur_cartesian_driver.planning.request.point_events.point_event import check_point
from ur_cartesian_driver.planning.request.point_events.timed_path import (
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
        """Refuse commands whose point or output does not exist."""
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

    def check_event(self, where: str, command: IOCommand) -> None:
        """Refuse an output that the robot does not have, or a value that it does not accept."""
        check_output(where, command)

    def left(self, events: Sequence[IOCommand], rest: GoalRest) -> Sequence[IOCommand]:
        """Return commands that restore the outputs at the resumption, and the commands ahead."""
        state: dict[tuple[int, int], IOCommand] = {}
        left = []
        for i, command in sorted(
            enumerate(events), key=lambda each: (each[1].waypoint, each[1].offset)
        ):
            if not rest.is_passed(command.waypoint):
                left.append(replace(command, waypoint=rest.index(command.waypoint)))
                continue
            field, offset = f'io_commands[{i}].offset', command.offset
            due = offset - rest.time_since(command.waypoint, field, offset)
            command = replace(command, waypoint=rest.first, offset=max(round(due, _DIGITS), 0.0))
            if due > 0.0:
                left.append(command)
            else:
                state[command.output, command.pin] = command
        return [*state.values(), *left]

    def place(self, command: IOCommand, field: str, path: TimedPath) -> list[PlacedOutput]:
        """Return the record that switches the output, with its time and place."""
        point = path.point(command.waypoint)
        if point is None:
            raise InvalidGoal(
                f'{field}.point_index',
                f'is {command.waypoint}, but no motion leads there: the robot is already there',
                'switch the output before the goal',
            )
        time, last = point.time + command.offset, len(path.ends) - 1
        late, delay, trigger_time = time - float(path.ends[last]), 0.0, None
        rest = path.rests.get(command.waypoint)
        if command.offset <= SAME_TIME:
            after, trigger_time, where = point.after, point.trigger_time, point.where
        elif rest is not None and time <= path.ends[rest]:
            after, delay = rest - 1, command.offset
            where = f'{command.offset:.3f} s after stopping there'
        elif late > -SAME_TIME:
            after, delay = last, max(late, 0.0)
            where = f'{delay:.3f} s after the end'
        else:
            after, trigger_time = path.last_returned(time), time
            where = f'{command.offset:.3f} s after it'
        record = SwitchOutput(
            output=command.output,
            pin=command.pin,
            value=command.value,
            domain=command.domain,
            delay=delay,
        )
        return [
            PlacedOutput(
                time=time if trigger_time is None else trigger_time,
                after_index=after,
                report_index=point.row,
                records=(path.triggered(record, trigger_time, after),),
                text=f'switches {describe_command(command)} {where}',
            )
        ]


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
