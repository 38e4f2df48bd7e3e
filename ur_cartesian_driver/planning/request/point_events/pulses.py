# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Pulses of digital outputs, evenly along the path between two points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import ceil, floor, inf

from ur_cartesian_driver.motion.errors import InvalidGoal, NotAvailable
from ur_cartesian_driver.motion.goal.goal import Goal, MAX_PULSE_COUNT, OutputKind, PulseTrain
from ur_cartesian_driver.motion.goal.goal_columns import GoalTable
from ur_cartesian_driver.motion.goal.output_names import output_fault, output_name, pulse_outputs
from ur_cartesian_driver.motion.plan.primitive import PulseLaw, SwitchOutput
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.goal_fields import resolve_execution_mode
from ur_cartesian_driver.planning.request.point_events.goal_rest import GoalRest
from ur_cartesian_driver.planning.request.point_events.output_event import OutputEvent
from ur_cartesian_driver.planning.request.point_events.path_clock import PathClock
from ur_cartesian_driver.planning.request.point_events.timed_path import (
    DrivenStretch,
    PassedPoint,
    PlacedOutput,
    TimedPath,
)
from ur_cartesian_driver.protocol.program.trajectory_points import MAX_PULSE_TRAINS

#: A pulse is in place if it is within this distance of its place [m].
_SAME_PLACE = 1e-6
#: Fraction by which the planned speed may exceed the highest speed for a pulse distance.
_SAME_SPEED = 1e-3
#: Decimal places to which the remaining phase [m] is rounded.
_DIGITS = 9


class Pulses(OutputEvent[PulseTrain]):
    """Parts of the path on which an output gives pulses."""

    field = 'pulses'

    def check(self, goal: GoalTable, options: PlanningOptions) -> None:
        """Refuse points out of order, pulses that overlap others or presses, too many outputs."""
        super().check(goal, options)
        if goal.pulses and goal.keep_open:
            _check_open(goal)
        points = len(goal.waypoints)
        for i, train in enumerate(goal.pulses):
            field, first, last = f'{self.field}[{i}]', train.first_waypoint, train.last_waypoint
            if not 0 <= first < last < points:
                raise InvalidGoal(
                    f'{field}.last_point',
                    f'is {last} and first_point {first}, but they must follow each other within '
                    f'the points 0 to {points - 1}',
                )
            _check_others(goal, field, train, goal.pulses[:i])
        if len(pulse_outputs(goal.pulses)) > MAX_PULSE_TRAINS:
            raise InvalidGoal(
                self.field,
                f'names {len(pulse_outputs(goal.pulses))} outputs, but the robot program gives '
                f'pulses of {MAX_PULSE_TRAINS} in a goal',
                'split the goal',
            )

    def of(self, goal: Goal) -> Sequence[PulseTrain]:
        """Return the entries; in an open goal, an entry to the last point goes on beyond it."""
        last = len(goal.waypoints) - 1
        return tuple(
            replace(train, goes_on=goal.keep_open and train.last_waypoint == last)
            for train in goal.pulses
        )

    def check_event(self, where: str, train: PulseTrain) -> None:
        """Refuse an analog output, or one that the robot does not have."""
        if train.output is OutputKind.STANDARD_ANALOG:
            raise InvalidGoal(
                f'{where}.output', 'is STANDARD_ANALOG, which gives no pulses', 'use a digital one'
            )
        if (fault := output_fault(train.output, train.pin, 0.0)) is not None:
            name, wrong, remedy = fault
            raise InvalidGoal(f'{where}.{name}', wrong, remedy)

    def left(self, events: Sequence[PulseTrain], rest: GoalRest) -> Sequence[PulseTrain]:
        """Return the entries ahead, and the remaining pulses of entries already begun."""
        return [left for train in events for left in _left(train, rest)]

    def place_all(self, events: Sequence[PulseTrain], path: TimedPath) -> list[PlacedOutput]:
        """Return the records of all entries; the pulses of an output have a slot of their own."""
        slots = pulse_outputs(events)
        placed = []
        for i, train in enumerate(events):
            for found in self.place(train, f'{self.field}[{i}]', path):
                law, begin = found.records
                assert isinstance(law, PulseLaw)
                slot = slots.index((train.output, train.pin))
                placed.append(replace(found, records=(replace(law, slot=slot), begin)))
        return placed

    def place(self, train: PulseTrain, field: str, path: TimedPath) -> list[PlacedOutput]:
        """Return the records with which the pulses begin."""
        begin, end = (
            _passed(path, f'{field}.{name}', waypoint)
            for name, waypoint in (
                ('first_point', train.first_waypoint),
                ('last_point', train.last_waypoint),
            )
        )
        length = path.arc_length_of(train.last_waypoint) - path.arc_length_of(train.first_waypoint)
        count = (train.count or MAX_PULSE_COUNT) if train.goes_on else _count(train, field, length)
        check_speed(train, field, path.clock, path.control_cycle, (begin.time, end.time))
        law = PulseLaw(
            slot=0,
            output=train.output,
            pin=train.pin,
            distance=train.distance,
            phase=train.phase,
            width=train.width,
            count=count,
            goes_on=train.goes_on,
        )
        # A stop carries out waiting records of value 0, and must not carry out this one.
        record = SwitchOutput(
            output=train.output, pin=train.pin, value=1.0, begins_pulses=True
        )  # fmt: skip
        stretch = DrivenStretch(
            end=inf if train.goes_on else end.time + max(train.width, path.control_cycle),
            text=f'gives pulses from point {train.first_waypoint} to '
            + ('the end of the goal' if train.goes_on else f'point {train.last_waypoint}'),
        )
        number = f'{count} pulses' if train.count or not train.goes_on else 'pulses'
        to = ' to the end of the goal' if train.goes_on else ''
        return [
            PlacedOutput(
                field=field,
                stretch=stretch,
                time=begin.time if begin.trigger_time is None else begin.trigger_time,
                after_index=begin.after,
                report_index=begin.row,
                records=(law, path.triggered(record, begin.trigger_time, begin.after)),
                text=f'begins {number} of {output_name(train.output, train.pin)}, every '
                f'{1e3 * train.distance:.4g} mm{to}, {begin.where}',
            )
        ]


def _check_open(goal: GoalTable) -> None:
    """Refuse pulses in an open goal whose mode or horizon rules them out."""
    mode = resolve_execution_mode(goal)
    if mode.traits.streams_setpoints:
        raise NotAvailable(
            'pulses',
            f'is not empty, but a {mode.name} goal with keep_open gives no pulses',
            'set execution to SPLINE or PRIMITIVES, or send all points at once',
        )
    if goal.replace_horizon:
        raise NotAvailable(
            'pulses',
            'is not empty, but the goal has a replace_horizon, so its path may change',
            'set replace_horizon to 0, or send all points at once',
        )


def _check_others(
    goal: GoalTable, field: str, train: PulseTrain, before: Sequence[PulseTrain]
) -> None:
    """Refuse other pulses of the same output, and presses, on an entry's part of the path."""
    first, last = train.first_waypoint, train.last_waypoint
    name = output_name(train.output, train.pin)
    for other in before:
        if (
            (other.output, other.pin) == (train.output, train.pin)
            and first < other.last_waypoint
            and other.first_waypoint < last
        ):
            raise InvalidGoal(
                f'{field}.pin',
                f'is {train.pin}, but {name} already gives pulses on the same points',
                'let one end where the other begins',
            )
    for k, press in enumerate(goal.presses):
        if first < press.last_waypoint and press.first_waypoint < last:
            raise NotAvailable(
                field,
                f'gives pulses from point {first} to point {last}, but during presses[{k}] the '
                'tool gives way, which counts as way along the path',
                'end the press before',
            )


def _passed(path: TimedPath, field: str, waypoint: int) -> PassedPoint:
    """Return the passage of the tool through a point; refuse a point to which no motion leads."""
    point = path.point(waypoint)
    if point is None:
        raise InvalidGoal(
            field,
            f'is {waypoint}, but no motion leads there: the robot is already there',
            'begin at the next point',
        )
    return point


def _count(train: PulseTrain, field: str, length: float) -> int:
    """Return the number of pulses of an entry whose part of the path has a ``length`` [m]."""
    most = floor((length - train.phase + _SAME_PLACE) / train.distance) + 1
    between = (
        f'but the path from point {train.first_waypoint} to point {train.last_waypoint} is '
        f'{1e3 * length:.4g} mm long'
    )
    if most < 1:
        raise InvalidGoal(f'{field}.phase', f'is {train.phase:g} m, {between}', 'reduce it')
    if train.count > most:
        raise InvalidGoal(
            f'{field}.count',
            f'is {train.count}, {between}, with room for {most}',
            'reduce count or distance, or set count to 0 for as many as there is room for',
        )
    return train.count or most


def check_speed(
    train: PulseTrain, field: str, clock: PathClock, cycle: float, times: tuple[float, float]
) -> None:
    """
    Refuse a pulse distance that the tool covers in less time than a pulse and one more cycle.

    :param cycle: cycle of the controller [s].
    :param times: when the pulses begin and end [s].
    :raises InvalidGoal: the text names the smallest distance and the highest speed.
    """
    # The output is off for at least one cycle.
    period = cycle * (max(ceil(train.width / cycle - 0.5), 1) + 1)
    speed = clock.max_speed(*times)
    if speed * period > train.distance * (1.0 + _SAME_SPEED):
        raise InvalidGoal(
            f'{field}.distance',
            f'is {1e3 * train.distance:.4g} mm, but from pulse to pulse {1e3 * period:.4g} ms '
            f'must pass (cycles of {1e3 * cycle:g} ms), and the tool is planned at up to '
            f'{1e3 * speed:.4g} mm/s: the smallest distance at this speed is '
            f'{1e3 * speed * period:.4g} mm, the highest speed for this distance '
            f'{1e3 * train.distance / period:.4g} mm/s',
            'increase the distance, or reduce speed or width',
        )


def _left(train: PulseTrain, rest: GoalRest) -> list[PulseTrain]:
    """Return the remainder of an entry when a stopped goal is resumed; empty = nothing."""
    begin = train.first_waypoint + 1.0
    if rest.is_passed(train.last_waypoint):
        return []
    given = 0
    if rest.stopped > begin:
        passed = rest.distance(begin, rest.stopped) - train.phase
        given = max(ceil((passed - _SAME_PLACE) / train.distance), 0)
    if train.count and given >= train.count:
        return []
    first = (
        rest.first if rest.is_passed(train.first_waypoint) else rest.index(train.first_waypoint)
    )
    start = rest.places[first]
    phase = train.phase + given * train.distance - rest.distance(begin, start)
    last = rest.index(train.last_waypoint)
    if first >= last or phase > rest.distance(start, train.last_waypoint + 1.0) + _SAME_PLACE:
        return []
    return [
        replace(
            train,
            first_waypoint=first,
            last_waypoint=last,
            phase=round(max(phase, 0.0), _DIGITS),
            count=train.count - given if train.count else 0,
        )
    ]
