# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Time to find transfers among bodies that stand around the arm."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

from figures import Figure, seconds
import numpy as np

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.cell.cell import Cell, CellBody, PlacedShape
from ur_cartesian_driver.motion.cell.shapes import Box, Cylinder, Sphere
from ur_cartesian_driver.motion.errors import CollisionPredicted
from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import vector6
from ur_cartesian_driver.planning import PlanningOptions
from ur_cartesian_driver.planning.preflight.tcp_kinematics import TcpKinematics
from ur_cartesian_driver.planning.travel.arm_space import ArmSpace
from ur_cartesian_driver.planning.travel.transfer import find_transfer, TransferSettings

#: Number of bodies; their least and greatest distance from the base [m]; number of transfers.
BODIES, AWAY, TRANSFERS = 20, (0.45, 0.9), 20
SETTINGS = TransferSettings(retract=0.0, approach=0.0, max_samples=1000)


def run(quick: bool) -> Iterator[Figure]:
    """Find transfers between random configurations whose straight connection is not free."""
    space = ArmSpace(
        TcpKinematics(Arm(robot_model('ur5e')), Pose((0.0, 0.0, 0.12))),
        PlanningOptions(cell=_cell(), tool_radius=0.03),
    )
    count = TRANSFERS // 4 if quick else TRANSFERS
    times, samples = [], []
    for a, b in _blocked(space, count):
        found: list[int] = []
        times.append(seconds(partial(_find, space, a, b, found), repeat=1))
        samples += found
    yield Figure(
        benchmark='travels',
        name=f'transfer among {BODIES} bodies, on average',
        value=float(np.mean(times)),
        unit='s',
        note=f'at most {max(times):.1f} s; {len(samples)} of {count} found, with '
        f'{np.mean(samples):.0f} samples on average, {max(samples)} at most',
    )


def _find(space: ArmSpace, a: Floats, b: Floats, found: list[int]) -> None:
    """Find a transfer, and append the number of its samples to ``found``."""
    start, goal = vector6(a.tolist()), vector6(b.tolist())
    try:
        found.append(find_transfer(space, start, [goal], SETTINGS, 'The travel').samples)
    except CollisionPredicted:
        return


def _cell() -> Cell:
    draw = np.random.default_rng(1)
    shapes = (Box((0.1, 0.15, 0.2)), Cylinder(0.06, 0.3), Sphere(0.1))
    bodies = []
    for k in range(BODIES):
        angle, away = 2.0 * np.pi * k / BODIES, float(draw.uniform(*AWAY))
        place = away * float(np.cos(angle)), away * float(np.sin(angle)), float(draw.random())
        bodies.append(
            CellBody(
                name=f'body {k}',
                shapes=(PlacedShape(shapes[k % len(shapes)]),),
                T_frame_body=Pose(place),
            )
        )
    return Cell(bodies=tuple(bodies))


def _blocked(space: ArmSpace, count: int) -> Iterator[tuple[Floats, Floats]]:
    """Yield pairs of free configurations, between which the straight motion is not free."""
    draw = np.random.default_rng(2)
    q = draw.uniform(-np.pi, np.pi, (5000, 6))
    q[:, 1] = draw.uniform(-2.5, -0.6, len(q))
    free = iter(q[space.free(q)])
    for a, b in zip(free, free, strict=False):
        if not space.seems_free(a, b):
            yield a, b
            count -= 1
        if not count:
            return
