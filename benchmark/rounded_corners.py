# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Processor time and memory to plan rounded corners, compared with plain splines."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
import sys
from tempfile import TemporaryDirectory
from typing import Literal

from figures import Figure, memory_of, processor_seconds
import numpy as np
import paths

from ur_cartesian_driver.importing import import_file, ImportOptions
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import vector6
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import Goal, Segment, Waypoint
from ur_cartesian_driver.motion.goal.goal_columns import goal_table, GoalTable
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.sim.simulator_config import HOME

#: Pose of the origin of the files in the base.
ORIGIN = Pose((-0.5, -0.2, 0.25), (0.0, 0.0, 0.0, 1.0))
#: Prints, each with its corner_deviation [m]; the file of the bead sets another one.
PRINTS = {'vase': 5e-5, 'part': 1e-4, 'bead': 2e-4}
LINES_DEVIATION, INFILL_DEVIATION = 2e-4, 1e-4
#: Length of the infill lines, and gap between them [m]; speed [m/s].
SIDE, GAP, INFILL_SPEED = 0.02, 0.0007, 0.06
#: A segment of the spline takes the time at this speed [m/s] plus this time [s]; the way to the
#: first point takes a third time [s].
MEAN_SPEED, WHILE, LEAD = 0.05, 0.02, 20.0
#: The collision check of each arm.
CHOICES: dict[str, Literal['off', 'auto']] = {'nominal': 'off', 'calibrated': 'auto'}


def run(quick: bool) -> Iterator[Figure]:
    """Plan imitated prints, lines of 5 mm, and infill with lines of 20 mm."""
    count = 200 if quick else 1000
    goals = {
        'lines of 5 mm': replace(paths.goal(count), corner_deviation=LINES_DEVIATION),
        'infill': _infill(count),
        **{name: _print(name) for name in PRINTS},
    }
    arms = {'nominal': Arm(robot_model(paths.MODEL)), 'calibrated': paths.calibrated_arm()}
    for name, goal in goals.items():
        plain = _spline(goal)
        for arm, choice in CHOICES.items():
            collisions = ', collisions' if choice == 'auto' else ''
            options = PlanningOptions(self_collision=choice, on_too_fast='slow')
            state = paths.at_home(arms[arm])
            taken, spline = (
                1e6
                * processor_seconds(partial(plan, each, state, arms[arm], options))
                / len(each.waypoints)
                for each in (goal, plain)
            )
            yield Figure(
                benchmark='rounded_corners',
                name=f'{name}, {arm}{collisions}',
                value=taken,
                unit='us',
                baseline=spline,
                than='spline',
                note='processor time a point',
            )
        yield from _memory_figures(name, goal, plain, arms['nominal'])


def _memory_figures(name: str, goal: GoalTable, plain: GoalTable, arm: Arm) -> Iterator[Figure]:
    """Measure the peak memory of planning, and the memory that the plan keeps."""
    state, options = paths.at_home(arm), PlanningOptions(self_collision='off', on_too_fast='slow')
    rounded, spline = (
        [
            size / len(each.waypoints) / 1e3
            for size in memory_of(partial(plan, each, state, arm, options))
        ]
        for each in (goal, plain)
    )
    for what, value, baseline in zip(('peak', 'kept'), rounded, spline, strict=True):
        yield Figure(
            benchmark='rounded_corners',
            name=f'{name}, memory, {what}',
            value=value,
            unit='kB',
            baseline=baseline,
            than='spline',
            note='a point',
        )


def _print(name: str) -> GoalTable:
    """Return the goal of an imitated print."""
    sys.path.insert(0, str(Path(__file__).resolve().parents[1] / 'test' / 'support'))
    import sliced_prints

    with TemporaryDirectory() as folder:
        file = Path(folder) / f'{name}.gcode'
        file.write_text(getattr(sliced_prints, name)().text)
        options = ImportOptions(origin=ORIGIN, corner=PRINTS[name])
        return goal_table(import_file(file, options).goal)


def _infill(points: int) -> GoalTable:
    """Return a goal with parallel lines of 20 mm."""
    home = Arm(robot_model(paths.MODEL)).forward(HOME)
    k = np.arange(points)
    side = np.where(k % 4 % 3 == 0, -1.0, 1.0)
    places = np.stack([GAP * (k // 2 % 200), 0.5 * SIDE * side, 0.0 * k], axis=1) + home.position
    return goal_table(
        Goal(
            waypoints=tuple(
                Waypoint(pose=Pose((x, y, z), home.quaternion)) for x, y, z in places.tolist()
            ),
            segments=(Segment(velocity=INFILL_SPEED),) * points,
            corner_deviation=INFILL_DEVIATION,
        )
    )


def _spline(goal: GoalTable) -> GoalTable:
    """Return a plain spline through the points of a goal, at about a constant speed."""
    points = goal.waypoints
    places = np.array([point.pose.position for point in points])
    lengths = np.linalg.norm(np.diff(places, axis=0), axis=1)
    times = LEAD + np.concatenate([[0.0], np.cumsum(WHILE + lengths / MEAN_SPEED)])
    twists = np.zeros((len(points), 6))
    twists[1:-1, :3] = (places[2:] - places[:-2]) / (times[2:] - times[:-2])[:, None]
    return goal_table(
        Goal(
            waypoints=tuple(
                Waypoint(pose=point.pose, time=time, twist=vector6(twist))
                for point, time, twist in zip(points, times.tolist(), twists.tolist(), strict=True)
            ),
            execution=ExecutionMode.SPLINE,
        )
    )
