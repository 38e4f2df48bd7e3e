# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The output commands of a goal: their checks and their words in a report."""

from __future__ import annotations

from dataclasses import replace

from ur_cartesian_driver.motion.errors import InvalidGoal, NotAvailable
from ur_cartesian_driver.motion.execution_modes import EXECUTION_MODES
from ur_cartesian_driver.motion.goal import IOCommand, OutputKind, SafeOutput
from ur_cartesian_driver.motion.goal_table import GoalTable
from ur_cartesian_driver.motion.primitive import SwitchOutput
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.output_names import (
    output_fault,
    output_name,
    parse_safe_outputs,
    repeated_output,
)
from ur_cartesian_driver.planning.request.goal_fields import resolve_execution_mode

#: Maximum time after a point [s].
MAX_OUTPUT_OFFSET = 60.0


def check_outputs(goal: GoalTable, options: PlanningOptions) -> None:
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
    _check_safe_outputs(goal, options)
    for i, command in enumerate(goal.io_commands):
        _check_command(command, f'io_commands[{i}]', len(goal.waypoints))


def _check_command(command: IOCommand, field: str, points: int) -> None:
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
    _check_output(field, command)


def _check_output(field: str, named: IOCommand | SafeOutput) -> None:
    if (fault := output_fault(named.output, named.pin, named.value)) is not None:
        name, wrong, remedy = fault
        raise InvalidGoal(f'{field}.{name}', wrong, remedy)


def _check_safe_outputs(goal: GoalTable, options: PlanningOptions) -> None:
    """Check the outputs that a goal, or the parameter, wants to be safe."""
    if (goal.safe_outputs or options.safe_outputs) and not options.dialect.supports_outputs:
        raise NotAvailable(
            'safe_outputs',
            'is not empty, but robot programs of wire dialect '
            f'{options.dialect.name} do not know it',
            'leave it empty (the parameter too), or let the driver send its own robot program',
        )
    for i, output in enumerate(goal.safe_outputs):
        _check_output(f'safe_outputs[{i}]', output)
    if (twice := repeated_output(goal.safe_outputs)) is not None:
        output = goal.safe_outputs[twice]
        raise InvalidGoal(
            f'safe_outputs[{twice}]',
            f'names {output_name(output.output, output.pin)} again',
            'name it once',
        )


def add_safe_outputs(goal: GoalTable, options: PlanningOptions) -> GoalTable:
    """Return a goal with the safe outputs of the parameter that it does not name itself."""
    named = {(output.output, output.pin) for output in goal.safe_outputs}
    added = tuple(
        output
        for output in parse_safe_outputs(options.safe_outputs)
        if (output.output, output.pin) not in named
    )
    return replace(goal, safe_outputs=goal.safe_outputs + added) if added else goal


def describe_command(command: IOCommand | SwitchOutput) -> str:
    """Return a command, or the record that carries it out, in words."""
    name = output_name(command.output, command.pin)
    if command.output is OutputKind.STANDARD_ANALOG:
        return f'{name} to {command.value:g} ({command.domain.name.lower()})'
    return f'{name} {"on" if command.value else "off"}'
