# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Waits for inputs: the arm rests at a point until an input of the robot has a value."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.goal.goal import InputKind, InputWait
from ur_cartesian_driver.motion.goal.goal_columns import GoalTable
from ur_cartesian_driver.motion.plan.primitive import AwaitInput
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.point_events.goal_rest import GoalRest
from ur_cartesian_driver.planning.request.point_events.point_event import PlacedStop, PointEvent

#: Number of inputs of each kind.
INPUTS = {
    InputKind.STANDARD_DIGITAL: 8,
    InputKind.CONFIGURABLE_DIGITAL: 8,
    InputKind.TOOL_DIGITAL: 2,
    InputKind.STANDARD_ANALOG: 2,
    InputKind.TOOL_ANALOG: 2,
}
#: The highest level that a wait for an analog input accepts [V], or [A] for a current.
MAX_LEVEL = 10.0


class InputWaits(PointEvent[InputWait]):
    """Waits for inputs, at most one at a point."""

    field = 'input_waits'

    def check(self, goal: GoalTable, options: PlanningOptions) -> None:
        """Refuse a second wait at a point, and wrong waits (:meth:`check_event`)."""
        for i, wait in enumerate(goal.input_waits):
            if any(wait.waypoint == other.waypoint for other in goal.input_waits[:i]):
                raise InvalidGoal(
                    f'input_waits[{i}].point_index',
                    f'is {wait.waypoint}, where the goal waits for another input already',
                    'add a point for the second one',
                )
        super().check(goal, options)

    def check_event(self, where: str, wait: InputWait) -> None:
        """Refuse inputs that the robot does not have, and values that an input cannot have."""
        name = f'{wait.input.name.lower().replace("_", " ")} input'
        if not 0 <= wait.pin < INPUTS[wait.input]:
            raise InvalidGoal(
                f'{where}.pin',
                f'is {wait.pin}, but there are {name}s 0 to {INPUTS[wait.input] - 1}',
                'name one of these',
            )
        is_level = 0.0 <= wait.value <= MAX_LEVEL
        if not (is_level if wait.input.is_analog else wait.value in (0.0, 1.0)):  # or NaN
            takes = f'a level of 0 to {MAX_LEVEL:g} A or V' if wait.input.is_analog else '0 or 1'
            raise InvalidGoal(f'{where}.value', f'is {wait.value:g}; a {name} takes {takes}')
        if wait.below and not wait.input.is_analog:
            raise InvalidGoal(
                f'{where}.below',
                f'is set, but a {name} has no level',
                'set value to 0 to await off',
            )

    def stops(self, goal: GoalTable, options: PlanningOptions) -> Iterator[PlacedStop]:
        """Yield the waits as stops of the robot program."""
        for wait in goal.input_waits:
            is_analog = wait.input.is_analog
            stop = AwaitInput(
                input=wait.input,
                pin=wait.pin,
                threshold=wait.value if is_analog else 0.5,
                below=wait.below if is_analog else wait.value == 0.0,
                timeout=wait.timeout,
                go_on=wait.go_on,
            )
            end = 'then goes on' if wait.go_on else 'else ends'
            note = f'waits there for {stop.condition}, at most {stop.timeout:g} s, {end}'
            yield PlacedStop(wait.waypoint, stop, note)

    def left(self, events: Sequence[InputWait], rest: GoalRest) -> Sequence[InputWait]:
        """Return the last passed wait, whose input must be checked again, and the waits ahead."""
        return rest.with_last(events)
