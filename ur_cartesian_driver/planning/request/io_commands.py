# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The output commands of a goal: their checks and their words in a report."""

from __future__ import annotations

from dataclasses import replace

from ur_cartesian_driver.motion.errors import InvalidGoal, NotAvailable
from ur_cartesian_driver.motion.goal.execution_modes import EXECUTION_MODES
from ur_cartesian_driver.motion.goal.goal import (
    IOCommand,
    OutputKind,
    ProportionalOutput,
    SafeOutput,
)
from ur_cartesian_driver.motion.goal.goal_table import GoalTable
from ur_cartesian_driver.motion.goal.output_names import (
    output_fault,
    output_name,
    parse_safe_outputs,
    repeated_output,
)
from ur_cartesian_driver.motion.plan.primitive import SwitchOutput
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.goal_fields import resolve_execution_mode
from ur_cartesian_driver.planning.request.number_rules import check_output_enums

#: Maximum time after a point [s].
MAX_OUTPUT_OFFSET = 60.0
#: Larger leads and time constants [s], gains [1/(m/s)] and offsets are mistakes.
MAX_LEAD, MAX_GAIN, MAX_FRACTION = 10.0, 1000.0, 100.0


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
    check_output_enums(goal)
    _check_safe_outputs(goal, options)
    check_proportional_outputs(goal, options)
    for i, command in enumerate(goal.io_commands):
        _check_command(command, f'io_commands[{i}]', len(goal.waypoints))


def check_proportional_outputs(goal: GoalTable, options: PlanningOptions) -> None:
    """
    Check the outputs that follow the speed.

    :raises GoalRefused: as :func:`check_outputs`.
    """
    outputs = goal.proportional_outputs
    if not outputs:
        return
    mode, name = resolve_execution_mode(goal), 'proportional_outputs'
    if not mode.traits.switches_outputs:
        raise NotAvailable(
            name,
            f'is not empty, but {mode.name} switches no outputs',
            'set execution to PRIMITIVES or SPLINE',
        )
    if not options.dialect.supports_outputs:
        raise NotAvailable(
            name,
            f'is not empty, but robot programs of wire dialect {options.dialect.name} have none',
            'leave it empty, or let the driver send its own robot program',
        )
    if goal.keep_open:
        raise NotAvailable(
            name, 'is not empty, but the goal has keep_open', 'send all points at once'
        )
    for i, output in enumerate(outputs):
        check_proportional_output(f'{name}[{i}]', output, len(goal.waypoints))
        for other in outputs[:i]:
            if output.pin == other.pin and not (
                output.first_waypoint >= other.last_waypoint
                or output.last_waypoint <= other.first_waypoint
            ):
                raise InvalidGoal(
                    f'{name}[{i}].pin',
                    f'is {output.pin}, which another entry uses on the same points',
                    'let one end where the other begins',
                )
        for k, command in enumerate(goal.io_commands):
            if (
                (command.output, command.pin) == (OutputKind.STANDARD_ANALOG, output.pin)
                and output.first_waypoint <= command.waypoint < output.last_waypoint
            ):  # fmt: skip
                raise InvalidGoal(
                    f'io_commands[{k}].pin',
                    f'is {command.pin}, but that standard analog output follows the speed '
                    f'from point {output.first_waypoint} to point {output.last_waypoint}',
                    'use the other one, or end it before',
                )


def check_proportional_output(field: str, output: ProportionalOutput, points: int) -> None:
    """
    Check the numbers of one that follows the speed.

    :param points: how many the goal has.
    :raises InvalidGoal: names field, value and bound.
    """
    if not 0 <= output.first_waypoint < output.last_waypoint < points:
        raise InvalidGoal(
            f'{field}.last_point',
            f'is {output.last_waypoint} and first_point {output.first_waypoint}, but they must '
            f'follow each other within the points 0 to {points - 1}',
        )
    for name, low, high in (
        ('pin', 0, 1),
        ('begin_lead', 0.0, MAX_LEAD),
        ('end_lead', 0.0, MAX_LEAD),
        ('gain', -MAX_GAIN, MAX_GAIN),
        ('offset', -MAX_FRACTION, MAX_FRACTION),
        ('minimum', 0.0, 1.0),
        ('maximum', 0.0, 1.0),
        ('filter_time', 0.0, MAX_LEAD),
        ('idle', 0.0, 1.0),
    ):
        value = getattr(output, name)
        if not low <= value <= high:  # NaN neither
            raise InvalidGoal(f'{field}.{name}', f'is {value:g}, outside {low:g} to {high:g}')
    if not output.minimum < output.maximum:
        raise InvalidGoal(
            f'{field}.maximum',
            f'is {output.maximum:g}, not more than minimum = {output.minimum:g}',
            'set it to 1 for the whole range',
        )


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
    named |= {(output.output, output.pin) for output in added}
    # Those that follow the speed write their own value again when a pause has ended.
    following = {
        output.pin: SafeOutput(
            output=OutputKind.STANDARD_ANALOG,
            pin=output.pin,
            value=output.idle,
            domain=output.domain,
            restore=True,
        )
        for output in goal.proportional_outputs
        if (OutputKind.STANDARD_ANALOG, output.pin) not in named
    }
    added += tuple(following.values())
    return replace(goal, safe_outputs=goal.safe_outputs + added) if added else goal


def describe_command(command: IOCommand | SwitchOutput) -> str:
    """Return a command, or the record that carries it out, in words."""
    name = output_name(command.output, command.pin)
    if isinstance(command, SwitchOutput) and command.follows_speed:
        return f'{name} to follow the speed'
    if command.output is OutputKind.STANDARD_ANALOG:
        return f'{name} to {command.value:g} ({command.domain.name.lower()})'
    return f'{name} {"on" if command.value else "off"}'
