# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Calls of functions of the script prelude at points where the arm stops."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ur_cartesian_driver.motion.errors import InvalidGoal, NotAvailable
from ur_cartesian_driver.motion.geometry.vectors import vector6, ZERO6
from ur_cartesian_driver.motion.goal.field_annotations import renumbered
from ur_cartesian_driver.motion.goal.goal import ScriptCall
from ur_cartesian_driver.motion.goal.goal_columns import GoalTable
from ur_cartesian_driver.motion.plan.primitive import CallFunction
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.point_events.goal_rest import GoalRest, NO_FRACTION
from ur_cartesian_driver.planning.request.point_events.point_event import PlacedStop, PointEvent
from ur_cartesian_driver.program.prelude import MAX_ARGUMENTS, Prelude


class ScriptCalls(PointEvent[ScriptCall]):
    """Calls that the robot program makes at points."""

    field = 'script_calls'

    def check(self, goal: GoalTable, options: PlanningOptions) -> None:
        """Refuse calls that do not match a function of the prelude in name and arguments."""
        for i, call in enumerate(goal.script_calls):
            self.check_event(f'script_calls[{i}]', call)
            _check_function(f'script_calls[{i}]', call, options.prelude)

    def check_event(self, where: str, call: ScriptCall) -> None:
        """Refuse a call with more arguments than the wire carries."""
        if len(call.arguments) > MAX_ARGUMENTS:
            raise InvalidGoal(
                f'{where}.arguments',
                f'has {len(call.arguments)} entries, more than {MAX_ARGUMENTS}',
            )

    def stops(self, goal: GoalTable, options: PlanningOptions) -> Iterator[PlacedStop]:
        """Yield the calls as stops of the robot program."""
        for call in goal.script_calls:
            written = ', '.join(f'{argument:g}' for argument in call.arguments)
            stop = CallFunction(
                number=options.prelude.number(call.function, len(call.arguments)),
                arguments=vector6((*call.arguments, *ZERO6)[:6]),
                text=f'{call.function}({written})',
                timeout=call.timeout,
            )
            note = f'calls {stop.text} there, for at most {call.timeout:g} s'
            yield PlacedStop(call.waypoint, stop, note)

    def left(self, events: Sequence[ScriptCall], rest: GoalRest) -> Sequence[ScriptCall]:
        """Return the calls at points that the arm had not left when the goal was stopped."""
        return [
            renumbered(call, lambda i: rest.first if rest.is_passed(i) else rest.index(i))
            for call in events
            if call.waypoint + 1.0 >= rest.stopped - NO_FRACTION
        ]


def _check_function(where: str, call: ScriptCall, prelude: Prelude) -> None:
    if not prelude.functions:
        raise NotAvailable(
            f'{where}.function',
            f"is '{call.function}', but the driver has no functions to call",
            'set its parameters script_prelude and allow_scripts',
        )
    function = prelude.function(call.function)
    if function is None:
        names = ', '.join(each.name for each in prelude.functions)
        raise InvalidGoal(
            f'{where}.function',
            f"is '{call.function}', but {prelude.file} has {names}",
            'call one of these',
        )
    if not function.required <= len(call.arguments) <= function.allowed:
        raise InvalidGoal(
            f'{where}.arguments',
            f'has {len(call.arguments)} entries, but {call.function} takes {function.counts}',
        )
