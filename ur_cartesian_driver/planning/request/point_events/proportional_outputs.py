# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Analog outputs that follow the speed of the tool from one point to another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ur_cartesian_driver.motion.errors import InvalidGoal, NotAvailable
from ur_cartesian_driver.motion.goal.goal import OutputKind, ProportionalOutput
from ur_cartesian_driver.motion.goal.goal_columns import GoalTable
from ur_cartesian_driver.motion.plan.primitive import SpeedLaw, SwitchOutput
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.point_events.goal_rest import GoalRest
from ur_cartesian_driver.planning.request.point_events.output_event import OutputEvent
from ur_cartesian_driver.planning.request.point_events.timed_path import (
    DrivenStretch,
    PlacedOutput,
    SAME_TIME,
    TimedPath,
)


class ProportionalOutputs(OutputEvent[ProportionalOutput]):
    """Parts of the path on which an output follows the speed."""

    field = 'proportional_outputs'

    def check(self, goal: GoalTable, options: PlanningOptions) -> None:
        """Refuse keep_open, points out of order, and entries that drive one output together."""
        super().check(goal, options)
        if goal.proportional_outputs and goal.keep_open:
            raise NotAvailable(
                self.field, 'is not empty, but the goal has keep_open', 'send all points at once'
            )
        points = len(goal.waypoints)
        for i, output in enumerate(goal.proportional_outputs):
            field, first, last = f'{self.field}[{i}]', output.first_waypoint, output.last_waypoint
            if not 0 <= first < last < points:
                raise InvalidGoal(
                    f'{field}.last_point',
                    f'is {last} and first_point {first}, but they must follow each other within '
                    f'the points 0 to {points - 1}',
                )
            if any(
                output.pin == other.pin
                and first < other.last_waypoint
                and other.first_waypoint < last
                for other in goal.proportional_outputs[:i]
            ):
                raise InvalidGoal(
                    f'{field}.pin',
                    f'is {output.pin}, which another entry uses on the same points',
                    'let one end where the other begins',
                )

    def check_event(self, where: str, output: ProportionalOutput) -> None:
        """Refuse a maximum that is not above the minimum."""
        if not output.minimum < output.maximum:
            raise InvalidGoal(
                f'{where}.maximum',
                f'is {output.maximum:g}, not more than minimum = {output.minimum:g}',
                'set it to 1 for the whole range',
            )

    def left(
        self, events: Sequence[ProportionalOutput], rest: GoalRest
    ) -> Sequence[ProportionalOutput]:
        """Return the entries ahead, and the entries already begun with ``begin_lead`` = 0."""
        return rest.stretches(events, begun=lambda output: replace(output, begin_lead=0.0))

    def place(self, output: ProportionalOutput, field: str, path: TimedPath) -> list[PlacedOutput]:
        """Return the records with which the output begins and stops following the speed."""
        switch = SwitchOutput(
            output=OutputKind.STANDARD_ANALOG,
            pin=output.pin,
            value=output.idle,
            domain=output.domain,
        )
        law = SpeedLaw(
            gain=output.gain,
            offset=output.offset,
            minimum=output.minimum,
            maximum=output.maximum,
            filter_time=output.filter_time,
        )
        name = f'standard analog output {output.pin}'
        begin = _ahead(
            # A stop carries out waiting records of value 0, and must not carry out this one.
            replace(switch, value=1.0, follows_speed=True),
            (output.first_waypoint, output.begin_lead, f'{field}.begin_lead'),
            path,
            f'{name} follows the speed',
        )
        end = _ahead(
            switch,
            (output.last_waypoint, output.end_lead, f'{field}.end_lead'),
            path,
            f'{name} follows it no more',
        )
        if end.time <= begin.time:
            raise InvalidGoal(
                f'{field}.end_lead',
                f'is {output.end_lead:g} s, so the output would end before it begins',
                'reduce it',
            )
        text = f'from point {output.first_waypoint} to point {output.last_waypoint}'
        stretch = DrivenStretch(end=end.time, text=f'follows the speed {text}')
        return [
            replace(begin, field=field, records=(law, *begin.records), stretch=stretch),
            replace(end, field=field, ends_stretch=True),
        ]


def _ahead(
    record: SwitchOutput, at: tuple[int, float, str], path: TimedPath, what: str
) -> PlacedOutput:
    """
    Return a record placed some time before a point.

    :param at: the waypoint, the time before it [s], and the field that gives this time.
    :raises InvalidGoal: no motion leads to the point, or none has ended by this time.
    """
    waypoint, lead, field = at
    point = path.point(waypoint)
    if point is None:
        raise InvalidGoal(
            field.rpartition('.')[0],
            f'names point {waypoint}, but no motion leads there: the robot is already there',
            'begin at the next point',
        )
    end = point.time
    if lead <= SAME_TIME:
        after, time, where = point.after, point.trigger_time, point.where
    else:
        after, time, where = path.last_returned(end - lead), end - lead, f'{lead:.3f} s before it'
        if after < 0:
            raise InvalidGoal(
                field,
                f'is {lead:g} s, but no motion has ended so long before point {waypoint}',
                'reduce it, or add a point before',
            )
    return PlacedOutput(
        field=field,
        time=end if time is None else time,
        after_index=after,
        report_index=point.row,
        records=(path.triggered(record, time, after),),
        text=f'{what}, {where}',
    )
