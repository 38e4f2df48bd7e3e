# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Dwells: the arm rests for a time at points of its path.

A goal is planned as if it did not rest, with times that count its motion only; the rests are put
into the plan afterwards. So a dwell changes nothing of the motions before and behind it, and is
not stretched where these are slowed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ur_cartesian_driver.motion.errors import InvalidGoal, NotAvailable
from ur_cartesian_driver.motion.goal import Segment
from ur_cartesian_driver.motion.goal_table import GoalTable, rows_where, SegmentRows
from ur_cartesian_driver.motion.plan import LateLines, PlannedRows, ReferencePath
from ur_cartesian_driver.motion.pose_rows import Floats
from ur_cartesian_driver.motion.primitive import Primitive, Spline, Wait
from ur_cartesian_driver.motion.vectors import vector6, ZERO6
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.goal_fields import (
    is_spline,
    is_timed,
    point_field,
    resolve_execution_mode,
    segment_field,
)

#: Longer ones are mistakes [s].
MAX_DWELL = 600.0


def check_dwells(goal: GoalTable, options: PlanningOptions) -> None:
    """
    Refuse dwells that the robot cannot do, or where the arm does not stop.

    :raises InvalidGoal: names the segment, the value and the bound.
    :raises NotAvailable: the robot program is not ours, or the goal is kept open.
    """
    dwells = goal.motions.dwells
    rows = rows_where(dwells > 0.0)
    if not rows:
        return
    refuse_dwells_of_open_goals(goal.segments, keep_open=goal.keep_open)
    mode = resolve_execution_mode(goal)
    if not (mode.traits.streams_setpoints or options.dialect.supports_waits):
        raise NotAvailable(
            segment_field(rows[0], 'dwell'),
            f'is {dwells[rows[0]]:g} s, but robot programs of wire dialect '
            f'{options.dialect.name} cannot rest at a point of {mode.name}',
            'split the goal there, or let the driver send its own robot program',
        )
    for i in rows:
        _check_dwell(goal, i, float(dwells[i]))


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


def _check_dwell(goal: GoalTable, i: int, dwell: float) -> None:
    field, is_last = segment_field(i, 'dwell'), i + 1 == len(goal.waypoints)
    if dwell > MAX_DWELL:
        raise InvalidGoal(field, f'is {dwell:g} s, more than {MAX_DWELL:g} s', 'split the goal')
    radius = float(goal.segments.blend_radii[i])
    if radius > 0.0 and not is_last:
        raise InvalidGoal(
            field,
            f'is {dwell:g} s, but with a blend of {1e3 * radius:g} mm the arm does not stop at '
            f'points[{i}]',
            'set its blend_radius to 0',
        )
    if is_spline(goal):
        for name in ('twists', 'accelerations'):
            if np.nan_to_num(getattr(goal.waypoints, name)[i]).any():
                raise InvalidGoal(
                    field,
                    f'is {dwell:g} s, but the arm passes points[{i}] with '
                    f'{"a twist" if name == "twists" else "an acceleration"}',
                    f'set its {name[:-1]} to 0',
                )
    if not is_timed(goal):
        return
    times = goal.waypoints.times
    if times[i] == 0.0:
        raise InvalidGoal(
            field,
            f'is {dwell:g} s, but no motion leads to points[{i}]: the robot is there at time 0',
            'give the next points later times',
        )
    if not is_last and times[i + 1] - times[i] <= dwell:
        raise InvalidGoal(
            field,
            f'is {dwell:g} s, but points[{i + 1}] follows {times[i + 1] - times[i]:g} s after '
            f'{point_field(i)}',
            'the arm needs time for the motion as well: reduce it, or give the points after it '
            'later times',
        )


class Dwells:
    """
    The dwells of a goal that passed the checks.

    :param goal: for the TCP with which it runs.
    """

    def __init__(self, goal: GoalTable) -> None:
        """Take the dwells."""
        dwells = goal.motions.dwells
        #: The points that have one, and their lengths [s].
        self._points = np.flatnonzero(dwells)
        self._lengths: Floats = dwells[self._points]
        self._before: Floats = np.cumsum(dwells) - dwells
        #: The goal without them: its times count the motion only.
        self.moving_goal = goal
        if len(self._points):
            rates = {}
            for name in ('twists', 'accelerations') if is_spline(goal) else ():
                rates[name] = getattr(goal.waypoints, name).copy()
                rates[name][self._points] = 0.0
            mode = resolve_execution_mode(goal)
            self.moving_goal = replace(self._shifted(goal, -1.0, **rates), execution=mode)

    def _shifted(self, goal: GoalTable, sign: float, **rates: Any) -> GoalTable:
        points = goal.waypoints
        times = points.times + sign * self._before * is_timed(goal)
        return replace(goal, waypoints=replace(points, times=times, **rates))

    def insert(
        self, goal: GoalTable, segments: PlannedRows, reference: ReferencePath
    ) -> tuple[GoalTable, PlannedRows, ReferencePath]:
        """
        Return goal, segments and path of a plan that rests at the points.

        :param goal: as planned, with times of the motion.
        :param segments: without outputs.
        """
        if not len(self._points):
            return goal, segments, reference
        at = np.searchsorted(segments.waypoints, self._points, side='right')
        before = at - 1
        streamed = resolve_execution_mode(goal).traits.streams_setpoints
        columns = {
            name: np.insert(getattr(segments, name), at, value, axis=0)
            for name, value in (
                ('waypoints', self._points),
                ('lengths', 0.0),
                ('angles', 0.0),
                ('durations', self._lengths),
                ('blend_entries', 0.0),
                ('joints', segments.joints[before]),
            )
        }
        primitives, lines = list(segments.primitives), segments.report_lines
        rests = list(zip(at.tolist(), self._lengths.tolist(), strict=True))
        for row, length in reversed(rests):
            primitives.insert(row, _rest(primitives[row - 1], segments, row - 1, length, streamed))

        def with_rests() -> list[str]:
            made = list(lines)
            for row, _ in reversed(rests):
                made.insert(row, '')
            return made

        return (
            self._shifted(goal, 1.0),
            PlannedRows(
                **columns,
                primitives=tuple(primitives),
                report_lines=LateLines(len(primitives), with_rests),
                notes={
                    row - 1 + k: f'; rests there for {length:g} s'
                    for k, (row, length) in enumerate(rests)
                },
            ),
            self._resting_path(reference),
        )

    def _resting_path(self, path: ReferencePath) -> ReferencePath:
        """Return the path with a second row at each point where the arm rests."""
        at = np.searchsorted(path.point, self._points, side='right')
        columns = {
            name: np.insert(values, at, values[at - 1], axis=0)
            for name in ('poses', 'point', 'time', 'blend_tolerance')
            for values in (getattr(path, name),)
        }
        delays = np.zeros(len(columns['time']))
        delays[at + np.arange(len(at))] = self._lengths
        return ReferencePath(**columns | {'time': columns['time'] + np.cumsum(delays)})


def _rest(
    before: Primitive, segments: PlannedRows, row: int, duration: float, streamed: bool
) -> Primitive:
    """Return what lets the arm rest behind a motion."""
    if not streamed:
        return Wait(duration=duration)
    is_quintic = isinstance(before, Spline) and before.accelerations is not None
    return Spline(
        target=vector6(segments.joints[row].tolist()),
        velocities=ZERO6,
        accelerations=ZERO6 if is_quintic else None,
        duration=duration,
    )
