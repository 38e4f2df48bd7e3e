# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Timing errors of outputs by place and of pulses, and the computing time that they need."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from importlib import import_module
from pathlib import Path
import sys
from time import process_time
from typing import Any

from figures import Figure, percentile, processor_seconds
import paths

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.geometry.pose import IDENTITY
from ur_cartesian_driver.motion.goal.goal import IOCommand, OutputKind, PulseTrain
from ur_cartesian_driver.motion.goal.goal_columns import GoalTable
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.planning.stop_prediction import state_at_rest
from ur_cartesian_driver.sim.simulator_config import HOME

NAME = 'outputs'
#: Number of random goals that run; number of points of the goal that is planned.
GOALS, POINTS = 60, 1000
OPTIONS = PlanningOptions(self_collision='off')


def run(quick: bool) -> Iterator[Figure]:
    """Measure the timing of edges in random goals, then the computing time for outputs."""
    sys.path.insert(0, str(Path(__file__).resolve().parents[1] / 'test' / 'support'))
    yield from _edges(6 if quick else GOALS)
    yield from _cycles()
    yield from _planning(50 if quick else POINTS)


def _edges(goals: int) -> Iterator[Figure]:
    """Yield the timing errors of edges, as the judge of the tests finds them."""
    # The modules of the tests have no types.
    support: Any = import_module('random_outputs')
    resolution: float = import_module('output_judge').RESOLUTION
    robot: Any = import_module('robot_in_memory').RobotInMemory('ur5e')
    found: dict[str, list[float]] = {'outputs by place': [], 'pulses': []}
    for number in range(goals):
        of_commands, *of_pulses = support.verdicts(support.accepted(number, robot)[0], robot)
        for name, judged in (('outputs by place', [of_commands]), ('pulses', of_pulses)):
            found[name] += [
                abs(late)
                for each in judged
                for late, off in zip(each.late, each.off, strict=True)
                if abs(off) > resolution or abs(late) < 1.0
            ]
    for name, late in found.items():
        for percent in (50.0, 99.0, 100.0):
            yield Figure(
                benchmark=NAME,
                name=f'{name}, late or early, p{percent:g}',
                value=percentile(late, percent),
                unit='cycles',
                note=f'{len(late)} edges of {goals} random goals',
            )


def _cycles() -> Iterator[Figure]:
    """Yield the time of a cycle with outputs, compared with a cycle without."""
    robot: Any = import_module('robot_in_memory').RobotInMemory(paths.MODEL)
    times = []
    for goal in _with_and_without(40, leads=8):
        state = robot.place(HOME, IDENTITY)
        records = list(plan(goal, state, _arm(), OPTIONS).instructions)
        robot.controller.set_slider(0.2)
        begin = process_time()
        cycles = len(robot.run(records).joints)
        times.append((process_time() - begin) / cycles)
    yield Figure(
        benchmark=NAME,
        name='cycle with 8 leads and 4 trains of pulses',
        value=1e6 * times[0],
        unit='us',
        baseline=1e6 * times[1],
        than='without outputs',
        note='simulated controller, slider at 20 %',
    )


def _planning(points: int) -> Iterator[Figure]:
    """Yield the time to plan a goal with outputs, compared with the goal without."""
    state = state_at_rest(_arm(), HOME)
    times = [
        processor_seconds(partial(plan, goal, state, _arm(), OPTIONS), 3)
        for goal in _with_and_without(points, leads=points - 4)
    ]
    yield Figure(
        benchmark=NAME,
        name=f'plan, {points} points, as many leads, 4 trains',
        value=1e3 * times[0],
        unit='ms',
        baseline=1e3 * times[1],
        than='without outputs',
    )


def _with_and_without(points: int, leads: int) -> tuple[GoalTable, GoalTable]:
    """Return a goal with pulses and with outputs 50 mm before its last points, and without."""
    plain = paths.goal(points, blend_radius=0.002)
    commands = tuple(
        IOCommand(
            waypoint=points - 1 - k,
            offset=-0.05,
            output=OutputKind.CONFIGURABLE_DIGITAL,
            pin=k % 8,
            value=float(k // 8 % 2),
        )
        for k in range(leads)
    )
    trains = tuple(
        PulseTrain(
            first_waypoint=0,
            last_waypoint=points - 1,
            output=OutputKind.STANDARD_DIGITAL,
            pin=pin,
            distance=0.002,
        )
        for pin in range(4)
    )
    return replace(plain, io_commands=commands, pulses=trains), plain


def _arm() -> Arm:
    return Arm(robot_model(paths.MODEL))
