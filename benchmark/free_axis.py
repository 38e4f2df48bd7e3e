# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Time to plan a goal with a free rotation about an axis, compared with a plain search."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from math import pi, tau

from figures import Figure, seconds
import numpy as np
from numpy.typing import NDArray
import paths

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.inverse import solutions
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.geometry.pose import Pose, quaternion_from_rotation_vector
from ur_cartesian_driver.motion.geometry.vectors import Joints
from ur_cartesian_driver.motion.goal.goal import FreeAxis
from ur_cartesian_driver.motion.goal.goal_columns import GoalTable, WaypointRows
from ur_cartesian_driver.planning import plan, PlanningOptions

Floats = NDArray[np.float64]

#: Blend radius [m]; rotations of the plain search, and its largest step of a joint [rad].
RADIUS = 0.002
ROTATIONS = 72
MAX_STEP = pi / 6.0


def run(quick: bool) -> Iterator[Figure]:
    """Plan straight lines of 5 mm with the rotations given, and with a free axis z."""
    for points in (100,) if quick else (1_000, 10_000):
        for name, arm in {
            'nominal': Arm(robot_model(paths.MODEL)),
            'calibrated': paths.calibrated_arm(),
        }.items():
            given = paths.goal(points, RADIUS)
            axes = np.full(points, FreeAxis.Z)
            free = replace(given, segments=replace(given.segments, free_axes=axes))
            for collisions in ('off', 'auto'):
                options = PlanningOptions(self_collision=collisions)
                yield _figure(
                    f'{points:,} points, {name}, collisions {collisions}',
                    given,
                    free,
                    arm,
                    options,
                )
            if points <= 1_000 and name == 'nominal':
                yield _plain_figure(free.waypoints[:100], arm)


def _figure(
    name: str, given: GoalTable, free: GoalTable, arm: Arm, options: PlanningOptions
) -> Figure:
    state = paths.at_home(arm)
    times, turns = [], []
    for goal in (given, free):
        made = plan(goal, state, arm, options)
        turns.append(_turns([state.actual_q, *(each.joints for each in made.segments)]))
        times.append(1e3 * seconds(partial(plan, goal, state, arm, options), repeat=3))
    return Figure(
        benchmark='free_axis',
        name=name,
        value=times[1],
        unit='ms',
        baseline=times[0],
        than='rotations given',
        note=f'joints turn {turns[1]:.1f} rad in all, {turns[0]:.1f} as given',
    )


def _plain_figure(points: WaypointRows, arm: Arm) -> Figure:
    found: list[Floats] = []
    search = partial(plain_search, arm, points, paths.at_home(arm).actual_q)
    taken = seconds(lambda: found.append(search()), repeat=1)
    return Figure(
        benchmark='free_axis',
        name=f'{len(points):,} points, plain search, no plan',
        value=1e3 * taken,
        unit='ms',
        note=f'joints turn {_turns(found[-1]):.1f} rad in all',
    )


def _turns(q: object) -> float:
    """Return the sum of the turns of all joints along configurations (n, 6) [rad]."""
    return float(np.abs(np.diff(np.array(q), axis=0)).sum())


def plain_search(arm: Arm, points: WaypointRows, q_start: Joints) -> Floats:
    """
    Return the configurations (n, 6) [rad] of the shortest path through a ladder of solutions.

    Each point has a rung of all solutions for 72 rotations about z, one pose after the other, and
    all steps from rung to rung are compared. The search ignores limits, margins, speeds,
    collisions, and the motion between points.
    """
    turns = [
        Pose((0.0,) * 3, quaternion_from_rotation_vector((0.0, 0.0, tau * k / ROTATIONS)))
        for k in range(ROTATIONS)
    ]
    rungs, back, cost = [np.array([q_start])], [], np.zeros(1)
    for point in points:
        rung = np.array([q for turn in turns for q in solutions(arm, point.pose @ turn)])
        change = rung[:, None] - rungs[-1]
        change = np.abs(change - tau * np.rint(change / tau))
        step = np.where(change.max(axis=2) > MAX_STEP, np.inf, change.sum(axis=2))
        total = cost + step
        back.append(np.argmin(total, axis=1))
        cost = total.min(axis=1)
        rungs.append(rung)
    k = int(np.argmin(cost))
    found = [rungs[-1][k]]
    for best, rung in zip(back[::-1], rungs[-2::-1], strict=True):
        k = int(best[k])
        found.append(rung[k])
    unwrapped: Floats = np.unwrap(np.array(found[::-1]), axis=0)
    return unwrapped
