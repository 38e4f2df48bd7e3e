# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Time to write the page of a motion, and its size."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

from figures import Figure, seconds
import paths

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.preview import motion_page, table


def run(quick: bool) -> Iterator[Figure]:
    """Write the pages of paths with steps of 5 mm; the baseline is the table of the same plan."""
    arm = Arm(robot_model(paths.MODEL))
    for points in (100,) if quick else (100, 10_000):
        made = plan(paths.goal(points), paths.at_home(arm), arm, PlanningOptions())
        text = 1e3 * seconds(partial(table, made), repeat=3)
        page = motion_page(made, arm)  # imports viser, too
        yield Figure(
            benchmark='page of a motion',
            name=f'{points:,} points 5 mm apart, {1e-6 * len(page):.1f} MB',
            value=1e3 * seconds(partial(motion_page, made, arm), repeat=3),
            unit='ms',
            baseline=text,
            than='the table alone',
        )
