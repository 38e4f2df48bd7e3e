# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""How long checking and planning a goal takes, from our own terms to the plan."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from itertools import product

from figures import Figure, seconds
import paths

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robots import robot_model
from ur_cartesian_driver.planning import plan, PlanningOptions

#: Of the corners that are blended [m]; two of them fit between points that are 5 mm apart.
RADIUS = 0.002


def run(quick: bool) -> Iterator[Figure]:
    """Plan straight lines of 5 mm, which is what a scanned or sliced path looks like."""
    arms = {'nominal': Arm(robot_model(paths.MODEL)), 'calibrated': paths.calibrated_arm()}
    corners = {'stops': 0.0, 'blends': RADIUS}
    for points in (1_000,) if quick else (1_000, 10_000):
        for corner, arm in product(corners, arms):
            goal = paths.goal(points, corners[corner])
            state = paths.at_home(arms[arm])
            taken = [1e3 * seconds(partial(
                plan, goal, state, arms[arm], PlanningOptions(self_collision=choice)),
                repeat=3 if points == 1_000 else 1) for choice in ('off', 'auto')]
            name = f'{points:,} points 5 mm apart, {corner}, {arm}'
            yield Figure(benchmark='planning', name=name, value=taken[0], unit='ms',
                         note=f'{1e3 * taken[0] / points:.0f} us a point, no collisions')
            yield Figure(benchmark='planning', name=f'{name}, collisions', value=taken[1],
                         unit='ms', baseline=taken[0], than='without')
