# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Time to check and plan a goal, from a `Goal` to the plan."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from itertools import product

from figures import Figure, seconds
import numpy as np
import paths

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.geometry.vectors import vector6
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import Goal
from ur_cartesian_driver.planning import plan, PlanningOptions

#: Blend radius [m]; two blends fit between points that are 5 mm apart.
RADIUS = 0.002
#: Largest distance of rounded corners from the path [m].
DEVIATION = 0.0002
#: Time between timed points, and to the first one [s].
PERIOD = 0.1
LEAD = 3.0


def run(quick: bool) -> Iterator[Figure]:
    """Plan straight lines of 5 mm, as in a scanned or sliced path."""
    arms = {'nominal': Arm(robot_model(paths.MODEL)), 'calibrated': paths.calibrated_arm()}
    corners = {'stops': 0.0, 'blends': RADIUS}
    for points in (1_000,) if quick else (1_000, 10_000, 100_000):
        for corner, arm in product(corners, arms):
            if points > 10_000 and not corners[corner]:
                continue
            yield from _figures(
                f'{points:,} points 5 mm apart, {corner}, {arm}',
                paths.goal(points, corners[corner]),
                arms[arm],
                repeat=5 if points <= 10_000 else 1,
            )
        yield _report_figure(points, arms['nominal'])
        for arm in arms if points <= 10_000 else ():
            goal = _timed(paths.goal(points))
            yield from _figures(f'{points:,} timed points with twists, {arm}', goal, arms[arm])
            goal = replace(paths.goal(points), corner_deviation=DEVIATION)
            yield from _figures(f'{points:,} points with rounded corners, {arm}', goal, arms[arm])


def _figures(name: str, goal: Goal, arm: Arm, repeat: int = 5) -> Iterator[Figure]:
    """Plan a goal without the collision check, and with it."""
    state = paths.at_home(arm)
    alone, with_check = (
        1e3
        * seconds(
            partial(plan, goal, state, arm, PlanningOptions(self_collision=choice)), repeat=repeat
        )
        for choice in ('off', 'auto')
    )
    note = f'{1e3 * alone / len(goal.waypoints):.0f} us a point, no collisions'
    yield Figure(benchmark='planning', name=name, value=alone, unit='ms', note=note)
    yield Figure(
        benchmark='planning',
        name=f'{name}, collisions',
        value=with_check,
        unit='ms',
        baseline=alone,
        than='without',
    )


def _report_figure(points: int, arm: Arm) -> Figure:
    """Time the report of a plan, which the driver makes while the arm moves."""
    made = plan(paths.goal(points, RADIUS), paths.at_home(arm), arm, PlanningOptions())
    taken = 1e3 * seconds(lambda: made.report, repeat=1)
    return Figure(
        benchmark='planning',
        name=f'report of {points:,} points',
        value=taken,
        unit='ms',
        note=f'{1e3 * taken / points:.0f} us a line, while the arm moves',
    )


def _timed(goal: Goal) -> Goal:
    """Return a goal that passes its points every 0.1 s, with twists from neighbouring points."""
    places = np.array([point.pose.position for point in goal.waypoints])
    speeds = np.zeros((len(places), 6))
    speeds[1:-1, :3] = (places[2:] - places[:-2]) / (2.0 * PERIOD)
    return replace(
        goal,
        execution=ExecutionMode.SPLINE,
        waypoints=tuple(
            replace(point, time=LEAD + PERIOD * k, twist=vector6(speed))
            for k, (point, speed) in enumerate(zip(goal.waypoints, speeds.tolist(), strict=True))
        ),
    )
