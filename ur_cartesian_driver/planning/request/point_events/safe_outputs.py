# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Outputs that are set to a safe value when the motion does not go on as planned."""

from __future__ import annotations

from dataclasses import replace

from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.goal.goal import OutputKind, SafeOutput
from ur_cartesian_driver.motion.goal.goal_columns import GoalTable
from ur_cartesian_driver.motion.goal.output_names import (
    output_name,
    parse_safe_outputs,
    repeated_output,
)
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.point_events.switched_outputs import check_output


def check_safe_outputs(goal: GoalTable) -> None:
    """
    Check the safe outputs of a goal.

    :raises InvalidGoal: an output is wrong or repeated; the text names the field.
    """
    for i, output in enumerate(goal.safe_outputs):
        check_output(f'safe_outputs[{i}]', output)
    if (twice := repeated_output(goal.safe_outputs)) is not None:
        output = goal.safe_outputs[twice]
        raise InvalidGoal(
            f'safe_outputs[{twice}]',
            f'names {output_name(output.output, output.pin)} again',
            'name it once',
        )


def add_safe_outputs(goal: GoalTable, options: PlanningOptions) -> GoalTable:
    """
    Return the goal with further safe outputs, for outputs that have none yet.

    These are the outputs in the parameter safe_outputs, and all outputs that follow the speed or
    give pulses.
    """
    outputs = {(output.output, output.pin): output for output in goal.safe_outputs}
    for output in parse_safe_outputs(options.safe_outputs):
        outputs.setdefault((output.output, output.pin), output)
    # An output that follows the speed is idle in a pause; afterwards it follows the speed again.
    for pin, following in {each.pin: each for each in goal.proportional_outputs}.items():
        outputs.setdefault(
            (OutputKind.STANDARD_ANALOG, pin),
            SafeOutput(
                output=OutputKind.STANDARD_ANALOG,
                pin=pin,
                value=following.idle,
                domain=following.domain,
                restore=True,
            ),
        )
    # The robot program switches an output off at the end of a pulse. It does not run in a pause,
    # so the output is switched off as a safe output.
    for train in goal.pulses:
        outputs.setdefault(
            (train.output, train.pin),
            SafeOutput(output=train.output, pin=train.pin, value=0.0, restore=True),
        )
    every = tuple(outputs.values())
    return goal if every == goal.safe_outputs else replace(goal, safe_outputs=every)
