# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Time to plan a goal in a cell: bodies within reach, and a mesh just below the path."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

from figures import Figure, processor_seconds
import numpy as np
import paths

from ur_cartesian_driver.kinematics.cell_distances import CellDistances
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.cell.cell import Cell, CellBody, PlacedShape
from ur_cartesian_driver.motion.cell.shapes import Box, Cylinder, Mesh, Shape, Sphere
from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, Pose
from ur_cartesian_driver.motion.geometry.vectors import vector6
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.planning.preflight.cell_clearance import CellClearance

#: Blend radius [m], and distance of the plate below the path [m].
RADIUS, BELOW = 0.002, 0.025
#: Number of cells of the plate along x and along y, each of two triangles; its size [m].
CELLS, SIZE = 100, 0.4
#: Number of boxes, cylinders and spheres (in turn), and their distance from the base [m].
BODIES, AWAY = 20, 0.75
#: Number of runs, of which the fastest counts.
REPEAT = 5
#: Number of rows in which brute force is measured.
ROWS = 20


def run(quick: bool) -> Iterator[Figure]:
    """Plan the lines of :mod:`planning` with blends, without and with a cell."""
    points = 1_000 if quick else 10_000
    arm = Arm(robot_model(paths.MODEL))
    goal, state, cell = paths.goal(points, RADIUS), paths.at_home(arm), _cell(points)
    name = f'{points:,} points in reach of {BODIES} bodies and a mesh'
    without, within = (
        1e3 * processor_seconds(partial(plan, goal, state, arm, options), repeat=REPEAT)
        for options in (PlanningOptions(), PlanningOptions(cell=cell))
    )
    yield Figure(
        benchmark='cell', name=name, value=within, unit='ms', baseline=without, than='without'
    )
    segments = plan(goal, state, arm, PlanningOptions(cell=cell)).segments
    q = np.array([segment.joints for segment in segments])
    bodies, some = CellDistances(arm, IDENTITY, cell), q[:: len(q) // ROWS]
    start = vector6(q[0].tolist())
    check = 1e3 * processor_seconds(lambda: CellClearance(bodies).check(q, start), repeat=REPEAT)
    brute = 1e3 * processor_seconds(partial(_brute_force, bodies, some), repeat=1)
    yield Figure(
        benchmark='cell',
        name='check of the joints at the points, and between',
        value=check,
        unit='ms',
        baseline=brute * len(q) / len(some),
        than=f'all {len(bodies.pairs)} pairs in each row',
        note=f'the latter by {len(some)} rows',
    )


def _cell(points: int) -> Cell:
    """Return 20 bodies around the base, and a bumpy plate below the lowest point of the path."""
    draw = np.random.default_rng(1)
    places = np.array([pose.position for pose in paths.meander(points)])
    x, y = places[:, :2].mean(axis=0).tolist()
    z = float(places[:, 2].min()) - BELOW
    bodies = [
        CellBody(
            name='plate',
            shapes=(PlacedShape(_plate(draw)),),
            T_frame_body=Pose((x, y, z)),
        )
    ]
    shapes: tuple[Shape, ...] = (Box((0.1, 0.15, 0.2)), Cylinder(0.06, 0.3), Sphere(0.1))
    for k in range(BODIES):
        # Not above the plate, where the arm works.
        angle = float(np.arctan2(y, x)) + np.pi * (0.3 + 1.4 * k / (BODIES - 1))
        place = (AWAY * np.cos(angle), AWAY * np.sin(angle), 0.1 + 0.8 * float(draw.random()))
        bodies.append(
            CellBody(
                name=f'body {k}',
                shapes=(PlacedShape(shapes[k % len(shapes)]),),
                T_frame_body=Pose((float(place[0]), float(place[1]), place[2])),
            )
        )
    return Cell(bodies=tuple(bodies))


def _plate(draw: np.random.Generator) -> Mesh:
    """Return a plate of 20,000 triangles, with random heights between z = -2 mm and 0."""
    sides = np.linspace(-SIZE / 2, SIZE / 2, CELLS + 1)
    x, y = np.meshgrid(sides, sides)
    points = np.stack([x, y, draw.uniform(-0.002, 0.0, x.shape)], axis=-1).reshape(-1, 3)
    corner = (np.arange(CELLS)[:, None] * (CELLS + 1) + np.arange(CELLS)).ravel()
    beside, above, across = corner + 1, corner + CELLS + 1, corner + CELLS + 2
    triangles = np.concatenate(
        [np.stack([corner, beside, above], axis=1), np.stack([beside, across, above], axis=1)]
    )
    return Mesh(points, triangles)


def _brute_force(bodies: CellDistances, q: Floats) -> None:
    """Measure all pairs in all rows (n, 6), exactly."""
    poses = bodies.poses(q)
    for column in range(len(bodies.pairs)):
        bodies.distances(column, poses, np.inf)
