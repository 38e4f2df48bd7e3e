# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""``ur-cartesian cell``: list and draw the bodies of a cell, and find the ones that touch."""

from __future__ import annotations

import argparse
import asyncio
from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import product
from pathlib import Path
import sys

import numpy as np
import yaml

from ur_cartesian_driver.kinematics.cell_distances import CellDistances, missing_coal, Pair
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.cell.cell import Cell, CellBody
from ur_cartesian_driver.motion.cell.cell_file import read_cell
from ur_cartesian_driver.motion.cell.cell_remarks import cell_remarks
from ur_cartesian_driver.motion.cell.shapes import HalfSpace, Mesh, Shape
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, Pose
from ur_cartesian_driver.motion.geometry.vectors import Joints, vector3, vector6
from ur_cartesian_driver.planning.stop_prediction import state_at_rest
from ur_cartesian_driver.preview import cell_page
from ur_cartesian_driver.preview.distance_curve import groups_of_pairs
from ur_cartesian_driver.robot.rtde.probe import read_state
from ur_cartesian_driver.sim import SimulatorConfig
from ur_cartesian_driver.sim.command_line.simulate import calibration


def show_or_check(arguments: argparse.Namespace) -> int:
    """Run ``cell show`` or ``cell check``; the latter returns 1 if two parts are too close."""
    cell = read_cell(arguments.file)
    model = robot_model(arguments.model)
    arm = Arm(model, calibration(arguments, model))
    if arguments.robot_ip:
        state = asyncio.run(read_state(arguments.robot_ip, arguments.rtde_port))
    else:
        q = vector6(arguments.joints or SimulatorConfig().q)
        state = state_at_rest(arm, q, arguments.tcp or IDENTITY)
    q, tcp = state.actual_q, state.T_flange_tcp
    table = cell_table(cell)
    lines, touching, status = cell_notes(cell), set[str](), 0
    if arguments.what == 'check':
        if clause := missing_coal(cell):
            raise ValueError(f'{arguments.file} {clause}')
        radius = arguments.tool_radius
        pairs = CellDistances(arm, tcp, cell, radius).pairs_below(np.array(q))
        touching = {name for pair, _ in pairs for name in (pair.a, pair.b)}
        lines = [f'{model.name}, joints {" ".join(f"{value:.4g}" for value in q)} rad']
        lines += touching_lines(pairs, cell) if pairs else closest_lines(cell, arm, q, tcp, radius)
        status = 1 if pairs else 0
    else:
        print(table)
    print(*lines, sep='\n')
    if arguments.html:
        try:
            page = cell_page(cell, arm, q, tcp, (table, '\n'.join(lines)), touching)
        except ImportError as error:
            print(f'ur-cartesian cell: {error}', file=sys.stderr)
            return 1
        Path(arguments.html).write_text(page, encoding='utf-8')
        print(f'page: {arguments.html}')
    return status


def cell_table(cell: Cell) -> str:
    """Return a table of the bodies."""
    rows = [('name', 'frame', 'shapes', 'size [mm]', 'clearance [mm]')]
    rows += [
        (
            body.name,
            body.frame,
            _shapes_text(body),
            _size_text(body),
            f'{1e3 * cell.clearance_of(body):g}',
        )
        for body in cell.bodies
    ]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return '\n'.join(
        '  '.join(f'{text:<{width}}' for text, width in zip(row, widths, strict=True)).rstrip()
        for row in rows
    )


def cell_notes(cell: Cell) -> list[str]:
    """Return lines on the pairs that may touch, and on odd features of the cell."""
    pairs = sorted(map(sorted, cell.may_touch))
    return [*(f'may touch: {a} and {b}' for a, b in pairs), *cell_remarks(cell)]


def touching_lines(pairs: Sequence[tuple[Pair, float]], cell: Cell) -> list[str]:
    """
    Return the pairs that are too close, and the field of the cell that would allow them.

    :param pairs: the pairs, each with its distance [m].
    """
    lines = []
    for (a, b, clearance), distance in pairs:
        if distance > 0.0:
            how = f'are {1e3 * distance:.1f} mm apart, and the clearance is {1e3 * clearance:g} mm'
        else:
            how = f'overlap by {-1e3 * distance:.1f} mm' if distance < 0.0 else 'touch'
        lines.append(f'{a} and {b} {how}')
    return [
        *lines,
        'Correct the places or the clearances; if these are meant to touch, the cell needs:',
        'may_touch:',
        *(f'- {_flow(sorted(pair))}' for pair in sorted(cell.may_touch, key=sorted)),
        *(f'- {_flow((pair.a, pair.b))}' for pair, _ in pairs),
    ]


def closest_lines(
    cell: Cell, arm: Arm, q: Joints, T_flange_tcp: Pose, tool_radius: float
) -> list[str]:
    """Return lines with the smallest distance in each group of pairs, if no pair is too close."""
    lines = ['nothing touches']
    for title, group in groups_of_pairs(cell).items():
        distances = CellDistances(arm, T_flange_tcp, group, tool_radius)
        (distance,), (number,) = distances.closest(np.array([q]))
        if np.isfinite(distance):
            a, b, clearance = distances.pairs[number]
            lines.append(
                f'{title}: {a} and {b} are {1e3 * distance:.1f} mm apart (clearance '
                f'{1e3 * clearance:g} mm)'
            )
    return lines


def _shapes_text(body: CellBody) -> str:
    """Return the shapes of a body, such as ``box, 2 x sphere``."""
    counts = Counter(_shape_name(placed.shape) for placed in body.shapes)
    return ', '.join(name if n == 1 else f'{n} x {name}' for name, n in counts.items())


def _shape_name(shape: Shape) -> str:
    if isinstance(shape, Mesh):
        return f'mesh of {len(shape.triangles):,} triangles'
    return 'plane' if isinstance(shape, HalfSpace) else type(shape).__name__.lower()


def _size_text(body: CellBody) -> str:
    """Return the lengths of the box around a body, along the axes of the body."""
    if any(isinstance(placed.shape, HalfSpace) for placed in body.shapes):
        return 'no end'
    corners = np.array(
        [
            placed.T_body_shape.apply(vector3(corner))
            for placed in body.shapes
            for corner in product(*placed.shape.bounds.T.tolist())
        ]
    )
    return ' x '.join(f'{1e3 * length:.0f}' for length in np.ptp(corners, axis=0))


def _flow(names: Iterable[str]) -> str:
    """Return names as a list in YAML, in one line."""
    text: str = yaml.safe_dump(list(names), default_flow_style=True, width=10_000)
    return text.strip()
