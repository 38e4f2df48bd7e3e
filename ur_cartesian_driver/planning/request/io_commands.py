# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The output commands of a goal: their checks and their words in a report."""

from __future__ import annotations

from math import isfinite

from ur_cartesian_driver.motion.errors import InvalidGoal, NotAvailable
from ur_cartesian_driver.motion.execution_modes import EXECUTION_MODES
from ur_cartesian_driver.motion.goal import Goal, IOCommand, OutputKind
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.goal_fields import resolve_execution_mode

#: Maximum time after a point [s].
MAX_OUTPUT_OFFSET = 60.0
_OUTPUTS = {
    OutputKind.STANDARD_DIGITAL: ('standard digital output', 8),
    OutputKind.CONFIGURABLE_DIGITAL: ('configurable digital output', 8),
    OutputKind.TOOL_DIGITAL: ('tool digital output', 2),
    OutputKind.STANDARD_ANALOG: ('standard analog output', 2),
}


def check_outputs(goal: Goal, options: PlanningOptions) -> None:
    """
    Check the commands of a goal.

    :raises InvalidGoal: names field, value and bound.
    :raises NotAvailable: the execution mode, or a robot program that is not ours, cannot do it.
    """
    mode = resolve_execution_mode(goal)
    if goal.io_commands and not mode.traits.switches_outputs:
        able = [other.name for other, traits in EXECUTION_MODES.items() if traits.switches_outputs]
        raise NotAvailable(
            'io_commands',
            f'is not empty, but {mode.name} switches no outputs',
            f'set execution to {" or ".join(able)}',
        )
    if goal.io_commands and not options.dialect.supports_outputs:
        raise NotAvailable(
            'io_commands',
            'is not empty, but robot programs of wire dialect '
            f'{options.dialect.name} cannot switch outputs during a motion',
            'leave it empty, or let the driver send its own robot program',
        )
    for i, command in enumerate(goal.io_commands):
        _check_command(command, f'io_commands[{i}]', len(goal.waypoints))


def _check_command(command: IOCommand, field: str, points: int) -> None:
    name, pins = _OUTPUTS[command.output]
    if not 0 <= command.waypoint < points:
        raise InvalidGoal(
            f'{field}.point_index',
            f'is {command.waypoint}, but the points are 0 to {points - 1}',
            'name one of these',
        )
    if not 0.0 <= command.offset <= MAX_OUTPUT_OFFSET:
        raise InvalidGoal(
            f'{field}.offset',
            f'is {command.offset:g} s, outside 0 to {MAX_OUTPUT_OFFSET:g} s',
            'name another point',
        )
    if not 0 <= command.pin < pins:
        raise InvalidGoal(
            f'{field}.pin',
            f'is {command.pin}, but there are {name}s 0 to {pins - 1}',
            'name one of these',
        )
    is_analog = command.output is OutputKind.STANDARD_ANALOG
    if (
        not isfinite(command.value)
        or not 0.0 <= command.value <= 1.0
        or (not is_analog and command.value not in (0.0, 1.0))
    ):
        raise InvalidGoal(
            f'{field}.value',
            f'is {command.value:g}; a {name} takes '
            + ('0 to 1, the fraction of its range' if is_analog else '0 (off) or 1 (on)'),
        )


def describe_command(command: IOCommand) -> str:
    """Return a command in words."""
    name, _ = _OUTPUTS[command.output]
    if command.output is OutputKind.STANDARD_ANALOG:
        return f'{name} {command.pin} to {command.value:g} ({command.domain.name.lower()})'
    return f'{name} {command.pin} {"on" if command.value else "off"}'
