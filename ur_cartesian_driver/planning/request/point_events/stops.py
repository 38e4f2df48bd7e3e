# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The stops of a plan, at points where the arm rests.

A goal is planned as if the arm did not rest, with the times of the motion only; afterwards, the
stops are inserted into the plan. So stops do not change the motions before and after them, and
are not stretched if the motions are slowed.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.goal.goal_columns import GoalTable
from ur_cartesian_driver.motion.plan.plan import LateLines, PlannedRows, ReferencePath
from ur_cartesian_driver.motion.plan.primitive import Spline, still_spline, Wait
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.goal_fields import (
    is_spline,
    is_timed,
    resolve_execution_mode,
)
from ur_cartesian_driver.planning.request.point_events.point_event import PlacedStop
from ur_cartesian_driver.planning.request.point_events.registry import OUTPUT_EVENTS, STOP_EVENTS


class Stops:
    """
    The stops of a goal that passed the checks.

    :param goal: the goal, expressed for the TCP with which it runs.
    """

    def __init__(self, goal: GoalTable, options: PlanningOptions) -> None:
        """Collect the stops."""
        dwells = goal.motions.dwells
        self._before: Floats = np.cumsum(dwells) - dwells
        stops = [stop for kind in STOP_EVENTS for stop in kind.stops(goal, options)]
        #: The stops in the order of their execution.
        self._stops: list[PlacedStop] = sorted(stops, key=lambda one: (one.waypoint, one.order))
        #: The goal without its stops, with the times of the motion only.
        self.moving_goal = goal
        #: The waypoints at which the arm stops, even if the robot has nothing to do there.
        self.waypoints = frozenset(
            [stop.waypoint for stop in self._stops]
            + [change.waypoint for change in goal.part_changes]
        )
        if self.waypoints:
            rates = {}
            for name in ('twists', 'accelerations') if is_spline(goal) else ():
                rates[name] = getattr(goal.waypoints, name).copy()
                rates[name][list(self.waypoints)] = 0.0
            mode = resolve_execution_mode(goal)
            self.moving_goal = replace(self._shifted(goal, -1.0, **rates), execution=mode)

    def delayed(self, times: Floats) -> Floats:
        """Return the times (n,) [s] of all points, delayed by the waits at the points before."""
        rests = np.zeros(len(times))
        for each in self._stops:
            if isinstance(each.stop, Wait) and each.waypoint + 1 < len(rests):
                rests[each.waypoint + 1] += each.stop.duration
        delayed: Floats = times + np.cumsum(rests)
        return delayed

    def _shifted(self, goal: GoalTable, sign: float, **rates: Any) -> GoalTable:
        points = goal.waypoints
        times = points.times + sign * self._before * is_timed(goal)
        return replace(goal, waypoints=replace(points, times=times, **rates))

    def insert(
        self, goal: GoalTable, segments: PlannedRows, reference: ReferencePath
    ) -> tuple[GoalTable, PlannedRows, ReferencePath]:
        """
        Return the goal, segments and path of a plan with the stops inserted.

        :param goal: the planned goal, with the times of the motion only.
        :param segments: the planned segments, without outputs.
        """
        if not self._stops:
            return goal, segments, reference
        waypoints = [each.waypoint for each in self._stops]
        stops = [each.stop for each in self._stops]
        at = np.searchsorted(segments.waypoints, waypoints, side='right')
        durations = [stop.duration if isinstance(stop, Wait) else 0.0 for stop in stops]
        columns = {
            name: np.insert(getattr(segments, name), at, value, axis=0)
            for name, value in (
                ('waypoints', np.maximum(waypoints, segments.waypoints[0])),
                ('lengths', 0.0),
                ('angles', 0.0),
                ('durations', durations),
                ('blend_entries', 0.0),
                ('joints', segments.joints[np.maximum(at - 1, 0)]),
            )
        }
        only_rests = self._only_rests(goal)
        primitives = list(segments.primitives)
        places = at + np.arange(len(at))
        for row, stop in zip(places.tolist(), stops, strict=True):
            before = primitives[row - 1]
            if only_rests and isinstance(stop, Wait) and isinstance(before, Spline):
                primitives.insert(row, still_spline(before, stop.duration))
            else:
                primitives.insert(row, stop)
        lines = segments.report_lines

        def with_stops() -> list[str]:
            made = list(lines)
            for row in places.tolist():
                made.insert(row, '')
            return made

        notes: dict[int, str] = {}
        motions: dict[int, int] = {}
        first_motion = next(row for row in range(len(primitives)) if row not in places)
        for row, each in zip(places.tolist(), self._stops, strict=True):
            motion = motions.setdefault(each.waypoint, max(row - 1, first_motion))
            if each.note:
                notes[motion] = f'{notes.get(motion, "")}; {each.note}'
        return (
            self._shifted(goal, 1.0),
            PlannedRows(
                **columns,
                primitives=tuple(primitives),
                report_lines=LateLines.at_once(len(primitives), with_stops),
                notes=notes,
            ),
            _resting_path(reference, np.array(waypoints), np.array(durations)),
        )

    def _only_rests(self, goal: GoalTable) -> bool:
        """Return whether set-points lead the arm, and nothing but waits happens at points."""
        return resolve_execution_mode(goal).traits.streams_setpoints and not (
            any(kind.of(goal) for kind in OUTPUT_EVENTS)
            or any(not isinstance(each.stop, Wait) for each in self._stops)
        )


def _resting_path(path: ReferencePath, points: Any, durations: Floats) -> ReferencePath:
    """Return a path with a second row for each point where the arm rests: the end of the rest."""
    points, durations = points[durations > 0.0], durations[durations > 0.0]
    at = np.searchsorted(path.point, points, side='right')
    columns = {
        name: np.insert(getattr(path, name), at, getattr(path, name)[at - 1], axis=0)
        for name in ('poses', 'point', 'time', 'blend_tolerance', 'fraction')
    }
    delays = np.zeros(len(columns['time']))
    delays[at + np.arange(len(at))] = durations
    return ReferencePath(**columns | {'time': columns['time'] + np.cumsum(delays)})
