# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
What happens at points where the arm stops.

It rests, waits for an input, calls a function of the script prelude, gets another payload, begins
or ends to press.

A goal is planned as if it did not rest, with times that count its motion only; the stops are put
into the plan afterwards. So they change nothing of the motions before and behind them, and are not
stretched where these are slowed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import isfinite
from typing import Any

import numpy as np

from ur_cartesian_driver.motion.errors import InvalidGoal, NotAvailable
from ur_cartesian_driver.motion.geometry.pose_rows import Floats
from ur_cartesian_driver.motion.geometry.vectors import vector6, ZERO6
from ur_cartesian_driver.motion.goal.goal import (
    InputKind,
    InputWait,
    PayloadChange,
    ScriptCall,
    Segment,
)
from ur_cartesian_driver.motion.goal.goal_table import GoalTable, rows_where, SegmentRows
from ur_cartesian_driver.motion.plan.plan import LateLines, PlannedRows, ReferencePath
from ur_cartesian_driver.motion.plan.primitive import (
    AwaitInput,
    CallFunction,
    ChangePayload,
    EndPress,
    Primitive,
    Spline,
    Stop,
    Wait,
)
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.goal_fields import (
    is_spline,
    is_timed,
    point_field,
    resolve_execution_mode,
    segment_field,
)
from ur_cartesian_driver.planning.request.presses import press_records
from ur_cartesian_driver.program.prelude import MAX_ARGUMENTS, Prelude

#: Longer rests and time-outs are mistakes [s].
MAX_DWELL = 600.0
#: How many inputs there are of each kind.
INPUTS = {
    InputKind.STANDARD_DIGITAL: 8,
    InputKind.CONFIGURABLE_DIGITAL: 8,
    InputKind.TOOL_DIGITAL: 2,
    InputKind.STANDARD_ANALOG: 2,
    InputKind.TOOL_ANALOG: 2,
}
#: The highest level of an analog input [V].
MAX_LEVEL = 10.0
#: Larger payloads are mistakes [kg], [m].
MAX_MASS, MAX_OFFSET = 100.0, 5.0
#: The largest argument that the wire carries.
MAX_ARGUMENT = 2147.0


def check_stops(goal: GoalTable, options: PlanningOptions) -> None:
    """
    Refuse what the robot cannot do at a point, or where the arm does not stop.

    :raises InvalidGoal: names the field, the value and the bound.
    :raises NotAvailable: the robot program is not ours, or the goal is kept open.
    """
    dwells, mode = goal.motions.dwells, resolve_execution_mode(goal)
    for name in ('input_waits', 'script_calls', 'payload_changes'):
        if getattr(goal, name) and mode.traits.streams_setpoints:
            raise NotAvailable(
                name,
                f'is not empty, but {mode.name} does nothing at points but rest',
                'set execution to PRIMITIVES or SPLINE',
            )
    refuse_dwells_of_open_goals(goal.segments, keep_open=goal.keep_open)
    for field, waypoint in _places(goal):
        if not 0 <= waypoint < len(goal.waypoints):
            raise InvalidGoal(
                field,
                f'is {waypoint}, but the points are 0 to {len(goal.waypoints) - 1}',
                'name one of these',
            )
        if not (mode.traits.streams_setpoints or options.dialect.supports_stops):
            raise NotAvailable(
                field,
                f'is set, but robot programs of wire dialect {options.dialect.name} do nothing at '
                f'points of {mode.name}',
                'split the goal there, or let the driver send its own robot program',
            )
        if goal.keep_open:
            raise NotAvailable(
                field,
                'is set, but a goal with keep_open does nothing at points but switch outputs',
                'split the goal there',
            )
        _check_place(goal, field, waypoint)
    for i in rows_where(dwells > 0.0):
        _check_dwell(goal, i, float(dwells[i]))
    for i, wait in enumerate(goal.input_waits):
        if any(wait.waypoint == other.waypoint for other in goal.input_waits[:i]):
            raise InvalidGoal(
                f'input_waits[{i}].point_index',
                f'is {wait.waypoint}, where the goal waits for another input already',
                'add a point for the second one',
            )
        check_input_wait(f'input_waits[{i}]', wait)
    for i, call in enumerate(goal.script_calls):
        check_script_call(f'script_calls[{i}]', call)
        _check_function(f'script_calls[{i}]', call, options.prelude)
    for i, change in enumerate(goal.payload_changes):
        check_payload(f'payload_changes[{i}]', change)


def _places(goal: GoalTable) -> Iterator[tuple[str, int]]:
    """Yield the points at which something happens, with the fields that say so."""
    for i in rows_where(goal.motions.dwells > 0.0):
        yield segment_field(i, 'dwell'), i
    for i, wait in enumerate(goal.input_waits):
        yield f'input_waits[{i}].point_index', wait.waypoint
    for i, call in enumerate(goal.script_calls):
        yield f'script_calls[{i}].point_index', call.waypoint
    for i, change in enumerate(goal.payload_changes):
        yield f'payload_changes[{i}].point_index', change.waypoint
    for i, press in enumerate(goal.presses):
        yield f'presses[{i}].first_point', press.first_waypoint
        yield f'presses[{i}].last_point', press.last_waypoint


def refuse_dwells_of_open_goals(
    segments: Sequence[Segment], *, keep_open: bool, first: int = 0
) -> None:
    """
    Refuse dwells in a goal to which points can be appended.

    :param first: the number of the first segment.
    """
    rows = rows_where(SegmentRows.of(segments).dwells > 0.0) if keep_open else []
    if rows:
        raise NotAvailable(
            segment_field(first + rows[0], 'dwell'),
            f'is {segments[rows[0]].dwell:g} s, but a goal with keep_open does not rest at points',
            'append the next points later: the arm waits for them',
        )


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


def _check_dwell(goal: GoalTable, i: int, dwell: float) -> None:
    field, times = segment_field(i, 'dwell'), goal.waypoints.times
    if dwell > MAX_DWELL:
        raise InvalidGoal(field, f'is {dwell:g} s, more than {MAX_DWELL:g} s', 'split the goal')
    if is_timed(goal) and i + 1 < len(times) and times[i + 1] - times[i] <= dwell:
        raise InvalidGoal(
            field,
            f'is {dwell:g} s, but points[{i + 1}] follows {times[i + 1] - times[i]:g} s after '
            f'{point_field(i)}',
            'the arm needs time for the motion as well: reduce it, or give the points after it '
            'later times',
        )


def check_input_wait(field: str, wait: InputWait) -> None:
    """
    Check what is waited for, and how long.

    :raises InvalidGoal: names the field, the value and the bound.
    """
    name = f'{wait.input.name.lower().replace("_", " ")} input'
    if not 0 <= wait.pin < INPUTS[wait.input]:
        raise InvalidGoal(
            f'{field}.pin',
            f'is {wait.pin}, but there are {name}s 0 to {INPUTS[wait.input] - 1}',
            'name one of these',
        )
    is_level = 0.0 <= wait.value <= MAX_LEVEL
    if not (is_level if wait.input.is_analog else wait.value in (0.0, 1.0)):  # NaN neither
        takes = f'a level of 0 to {MAX_LEVEL:g} A or V' if wait.input.is_analog else '0 or 1'
        raise InvalidGoal(f'{field}.value', f'is {wait.value:g}; a {name} takes {takes}')
    if wait.below and not wait.input.is_analog:
        raise InvalidGoal(
            f'{field}.below', f'is set, but a {name} has no level', 'set value to 0 to await off'
        )
    if not 0.0 < wait.timeout <= MAX_DWELL:
        raise InvalidGoal(
            f'{field}.timeout',
            f'is {wait.timeout:g} s; it must be more than 0, and at most {MAX_DWELL:g} s',
        )


def check_script_call(field: str, call: ScriptCall) -> None:
    """
    Check arguments and time-out.

    :raises InvalidGoal: names the field, the value and the bound.
    """
    if len(call.arguments) > MAX_ARGUMENTS:
        raise InvalidGoal(
            f'{field}.arguments', f'has {len(call.arguments)} entries, more than {MAX_ARGUMENTS}'
        )
    for k, argument in enumerate(call.arguments):
        if not abs(argument) <= MAX_ARGUMENT:
            raise InvalidGoal(
                f'{field}.arguments[{k}]',
                f'is {argument:g}, outside -{MAX_ARGUMENT:g} to {MAX_ARGUMENT:g}',
            )
    if not 0.0 < call.timeout <= MAX_DWELL:
        raise InvalidGoal(
            f'{field}.timeout',
            f'is {call.timeout:g} s; it must be more than 0, and at most {MAX_DWELL:g} s',
        )


def _check_function(field: str, call: ScriptCall, prelude: Prelude) -> None:
    """Refuse a function that the prelude does not have, or has with other parameters."""
    if not prelude.functions:
        raise NotAvailable(
            f'{field}.function',
            f"is '{call.function}', but the driver has no functions to call",
            'set its parameters script_prelude and allow_scripts',
        )
    function = prelude.function(call.function)
    if function is None:
        names = ', '.join(each.name for each in prelude.functions)
        raise InvalidGoal(
            f'{field}.function',
            f"is '{call.function}', but {prelude.file} has {names}",
            'call one of these',
        )
    if not function.required <= len(call.arguments) <= function.allowed:
        raise InvalidGoal(
            f'{field}.arguments',
            f'has {len(call.arguments)} entries, but {call.function} takes {function.counts}',
        )


def check_payload(field: str, change: PayloadChange) -> None:
    """
    Check mass and centre of gravity.

    :raises InvalidGoal: names the field, the value and the bound.
    """
    if not 0.0 <= change.mass <= MAX_MASS:
        raise InvalidGoal(f'{field}.mass', f'is {change.mass:g} kg, outside 0 to {MAX_MASS:g} kg')
    if not all(isfinite(x) and abs(x) <= MAX_OFFSET for x in change.center_of_gravity):
        raise InvalidGoal(
            f'{field}.center_of_gravity',
            f'contains a number beyond {MAX_OFFSET:g} m',
            'give it in metres, in the flange frame',
        )


class Stops:
    """
    What happens at the points of a goal that passed the checks.

    :param goal: for the TCP with which it runs.
    :param prelude: of the robot program.
    """

    def __init__(self, goal: GoalTable, prelude: Prelude) -> None:
        """Collect it."""
        dwells = goal.motions.dwells
        self._before: Floats = np.cumsum(dwells) - dwells
        #: By point, in the order in which it happens, with a note for the report.
        self._stops: dict[int, list[tuple[Stop, str]]] = {}
        for press in goal.presses:
            self._add(press.last_waypoint, (EndPress(), 'ends to press there'))
        for wait in goal.input_waits:
            self._add(wait.waypoint, _await_input(wait))
        for call in goal.script_calls:
            self._add(call.waypoint, _call_function(call, prelude))
        for change in goal.payload_changes:
            payload = ChangePayload(mass=change.mass, center_of_gravity=change.center_of_gravity)
            self._add(change.waypoint, (payload, f'sets a payload of {change.mass:g} kg there'))
        for i in np.flatnonzero(dwells).tolist():
            rest = Wait(duration=float(dwells[i]))
            self._add(i, (rest, f'rests there for {rest.duration:g} s'))
        for press in goal.presses:
            for record in press_records(press, goal.T_base_frame):
                self._add(press.first_waypoint, record)
        #: The goal without them: its times count the motion only.
        self.moving_goal = goal
        if self._stops:
            rates = {}
            for name in ('twists', 'accelerations') if is_spline(goal) else ():
                rates[name] = getattr(goal.waypoints, name).copy()
                rates[name][list(self._stops)] = 0.0
            mode = resolve_execution_mode(goal)
            self.moving_goal = replace(self._shifted(goal, -1.0, **rates), execution=mode)

    def _add(self, waypoint: int, stop: tuple[Stop, str]) -> None:
        self._stops.setdefault(waypoint, []).append(stop)

    def _shifted(self, goal: GoalTable, sign: float, **rates: Any) -> GoalTable:
        points = goal.waypoints
        times = points.times + sign * self._before * is_timed(goal)
        return replace(goal, waypoints=replace(points, times=times, **rates))

    def insert(
        self, goal: GoalTable, segments: PlannedRows, reference: ReferencePath
    ) -> tuple[GoalTable, PlannedRows, ReferencePath]:
        """
        Return goal, segments and path of a plan that stops at the points.

        :param goal: as planned, with times of the motion.
        :param segments: without outputs.
        """
        if not self._stops:
            return goal, segments, reference
        points = [(i, stop) for i, each in sorted(self._stops.items()) for stop, _ in each]
        waypoints = [i for i, _ in points]
        at = np.searchsorted(segments.waypoints, waypoints, side='right')
        durations = [stop.duration if isinstance(stop, Wait) else 0.0 for _, stop in points]
        columns = {
            name: np.insert(getattr(segments, name), at, value, axis=0)
            for name, value in (
                ('waypoints', waypoints),
                ('lengths', 0.0),
                ('angles', 0.0),
                ('durations', durations),
                ('blend_entries', 0.0),
                ('joints', segments.joints[at - 1]),
            )
        }
        streamed = resolve_execution_mode(goal).traits.streams_setpoints
        primitives = list(segments.primitives)
        places = at + np.arange(len(at))
        for row, (_, stop) in zip(places.tolist(), points, strict=True):
            primitives.insert(
                row,
                _still_spline(stop, primitives[row - 1], columns['joints'][row])
                if streamed
                else stop,
            )
        lines = segments.report_lines

        def with_stops() -> list[str]:
            made = list(lines)
            for row in places.tolist():
                made.insert(row, '')
            return made

        own_rows = np.searchsorted(columns['waypoints'], sorted(self._stops), side='right')
        return (
            self._shifted(goal, 1.0),
            PlannedRows(
                **columns,
                primitives=tuple(primitives),
                report_lines=LateLines(len(primitives), with_stops),
                notes={
                    int(row) - 1 - len(each): ''.join(f'; {note}' for _, note in each if note)
                    for row, (_, each) in zip(own_rows, sorted(self._stops.items()), strict=True)
                },
            ),
            _resting_path(reference, np.array(waypoints), np.array(durations)),
        )


def _await_input(wait: InputWait) -> tuple[Stop, str]:
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
    return stop, f'waits there for {stop.condition}, at most {stop.timeout:g} s, {end}'


def _call_function(call: ScriptCall, prelude: Prelude) -> tuple[Stop, str]:
    written = ', '.join(f'{argument:g}' for argument in call.arguments)
    stop = CallFunction(
        number=prelude.number(call.function, len(call.arguments)),
        arguments=vector6((*call.arguments, *ZERO6)[:6]),
        text=f'{call.function}({written})',
        timeout=call.timeout,
    )
    return stop, f'calls {stop.text} there, for at most {call.timeout:g} s'


def _still_spline(stop: Stop, before: Primitive, joints: Floats) -> Spline:
    """Return what lets a servo rest behind a motion."""
    assert isinstance(stop, Wait)
    is_quintic = isinstance(before, Spline) and before.accelerations is not None
    return Spline(
        target=vector6(joints.tolist()),
        velocities=ZERO6,
        accelerations=ZERO6 if is_quintic else None,
        duration=stop.duration,
    )


def _resting_path(path: ReferencePath, points: Any, durations: Floats) -> ReferencePath:
    """Return a path with a second row at each point where the arm rests."""
    points, durations = points[durations > 0.0], durations[durations > 0.0]
    at = np.searchsorted(path.point, points, side='right')
    columns = {
        name: np.insert(getattr(path, name), at, getattr(path, name)[at - 1], axis=0)
        for name in ('poses', 'point', 'time', 'blend_tolerance', 'fraction')
    }
    delays = np.zeros(len(columns['time']))
    delays[at + np.arange(len(at))] = durations
    return ReferencePath(**columns | {'time': columns['time'] + np.cumsum(delays)})
