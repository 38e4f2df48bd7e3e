# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""How long a goal takes from our own terms to the bytes of its points."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

from figures import Figure, seconds
import paths

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robots import robot_model
from ur_cartesian_driver.planning import plan, PlanningOptions


def run(quick: bool) -> Iterator[Figure]:
    """Plan straight lines of 5 mm, which is what a scanned or sliced path looks like."""
    arm = Arm(robot_model(paths.MODEL))
    state, options = paths.at_home(arm), PlanningOptions()
    for points in (1_000,) if quick else (1_000, 10_000):
        goal = paths.goal(points)
        taken = seconds(partial(plan, goal, state, arm, options),
                        repeat=3 if points == 1_000 else 1)
        yield Figure(benchmark='planning', name=f'plan {points:,} points 5 mm apart',
                     value=1e3 * taken, unit='ms',
                     note=f'{1e6 * taken / points:.0f} us a point')
