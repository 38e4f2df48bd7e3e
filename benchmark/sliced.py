# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Time to plan goals from slicers and plotters: thousands of short lines and arcs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from math import cos, hypot, pi, sin
from time import process_time

from figures import Figure, median, seconds
import numpy as np
import paths

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.goal.goal import Goal, SegmentType
from ur_cartesian_driver.motion.goal.goal_columns import (
    goal_table,
    GoalTable,
    SegmentRows,
    WaypointRows,
)
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.sim.simulator_config import HOME

#: Speed [m/s]; largest blend radius [m]; radius below which there is no blend [m].
SPEED = 0.04
RADIUS = 0.0005
MIN_RADIUS = 0.0001
#: Part of a move that each of its two blends may take.
PART = 0.4
#: The walk turns back at this distance from its start [m].
REACH = 0.08
#: Rounds, in each of which all goals are planned in turn.
ROUNDS = 3


def run(quick: bool) -> Iterator[Figure]:
    """Measure the processor time to plan each goal, compared with equal straight lines."""
    share = 10 if quick else 1
    lines = paths.goal(10_000 // share, 0.002)
    goals = {
        'print': walk(17_000 // share, lines_per_arc=2),
        'vase': vase(7_000 // share),
        'drawing': walk(10_000 // share, lines_per_arc=4, moves_per_stroke=12),
    }
    stops = {f'{name}, without blends': goal for name, (goal, _) in goals.items()}
    blends = {f'{name}, blends': goal for name, (_, goal) in goals.items()}
    arm = Arm(robot_model(paths.MODEL))
    state, options = paths.at_home(arm), PlanningOptions(self_collision='off')
    cases = {'lines': lines, **stops, **blends}
    taken: dict[str, list[float]] = {name: [] for name in cases}
    for _ in range(ROUNDS):
        for name, goal in cases.items():
            planned = partial(plan, goal, state, arm, options)
            once = seconds(planned, repeat=1, clock=process_time)
            taken[name].append(1e6 * once / len(goal.waypoints))
    for name, goal in cases.items():
        yield Figure(
            benchmark='sliced',
            name=f'{name}, {len(goal.waypoints):,} moves',
            value=median(taken[name]),
            unit='us',
            baseline=None if name == 'lines' else median(taken['lines']),
            than='straight lines with blends',
            note='a move',
        )


def walk(moves: int, lines_per_arc: int, moves_per_stroke: int = 0) -> tuple[GoalTable, GoalTable]:
    """
    Return a walk of lines of 1 to 6 mm and arcs of 0.3 to 3 mm, without and with blends.

    :param lines_per_arc: number of lines between two arcs.
    :param moves_per_stroke: the first two of this number of moves are made with the pen lifted;
        0 = the pen is never lifted.
    """
    draw = np.random.default_rng(7)
    places, vias, heading, x, y = [(0.0, 0.0, 0.0)], [(0.0, 0.0, 0.0)], 0.0, 0.0, 0.0
    while len(places) < moves:
        k = len(places)
        is_lifted = moves_per_stroke > 0 and k % moves_per_stroke < 2
        z = 0.003 if is_lifted else 0.0 if moves_per_stroke else 3e-4 * (k // 900)
        if hypot(x, y) > REACH:
            heading = float(np.arctan2(-y, -x))
        if k % (lines_per_arc + 1) or is_lifted or z != places[-1][2]:
            length, via = draw.uniform(0.001, 0.006), (0.0, 0.0, 0.0)
            x, y = x + length * cos(heading), y + length * sin(heading)
        else:
            length, turn = draw.uniform(3e-4, 3e-3), draw.choice((-1, 1)) * draw.uniform(0.8, 2.8)
            (x, y), (via_x, via_y) = (
                (
                    x + length / turn * (sin(heading + u * turn) - sin(heading)),
                    y - length / turn * (cos(heading + u * turn) - cos(heading)),
                )
                for u in (1.0, 0.5)
            )
            via, heading = (via_x, via_y, z), heading + turn
        heading += draw.uniform(-0.3, 0.3)
        places.append((x, y, z))
        vias.append(via)
    return goals_of(np.array(places), np.array(vias))


def vase(moves: int) -> tuple[GoalTable, GoalTable]:
    """Return a rising spiral of lines of 0.2 to 1 mm, without and with blends."""
    angle = np.cumsum(np.random.default_rng(7).uniform(2e-4, 1e-3, moves)) / 0.026
    radius = 0.026 + 4e-4 * np.sin(3.0 * angle)
    places = np.stack(
        (radius * np.cos(angle), radius * np.sin(angle), 3e-4 * angle / (2.0 * pi)), axis=1
    )
    return goals_of(places, np.zeros_like(places))


def goals_of(places: Floats, vias: Floats) -> tuple[GoalTable, GoalTable]:
    """
    Return the goal through places (n, 3) [m] beside the home position, without and with blends.

    :param vias: (n, 3) positions on the arcs; zeros = the move is a line.
    """
    n, home = len(places), Arm(robot_model(paths.MODEL)).forward(HOME)
    middle = np.array(home.position) - (0.0, 0.0, 0.1)
    is_arc = vias.any(axis=1)
    gaps = np.append(1.0, np.linalg.norm(np.diff(places, axis=0), axis=1))
    radii = np.minimum(RADIUS, PART * np.minimum(gaps, np.append(gaps[1:], 0.0)))
    poses, on_arcs = (
        np.concatenate([middle + rows, np.tile(home.quaternion, (n, 1))], axis=1)
        for rows in (places, vias)
    )
    columns = {
        'types': np.where(is_arc, SegmentType.CIRCULAR, SegmentType.LINEAR),
        'vias': on_arcs,
        'has_via': is_arc,
        'velocities': np.full(n, SPEED),
    }
    stops = Goal(
        waypoints=WaypointRows.of_columns(n, {'poses': poses}),
        segments=SegmentRows.of_columns(n, columns),
    )
    columns['blend_radii'] = np.where(radii >= MIN_RADIUS, radii, 0.0)
    blends = replace(stops, segments=SegmentRows.of_columns(n, columns))
    return goal_table(stops), goal_table(blends)
