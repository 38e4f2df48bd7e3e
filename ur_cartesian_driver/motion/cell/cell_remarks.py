# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Remarks on a cell that can be used but looks odd."""

from __future__ import annotations

import numpy as np

from ur_cartesian_driver.motion.cell.cell import Cell
from ur_cartesian_driver.motion.cell.shapes import Mesh

#: Meshes larger or smaller than these probably have the wrong scale [m].
_LARGE, _SMALL = 5.0, 0.002


def cell_remarks(cell: Cell) -> tuple[str, ...]:
    """Return sentences on odd features of a cell, after the remarks of its files."""
    remarks = dict.fromkeys(cell.remarks)
    for body in cell.bodies:
        for placed in body.shapes:
            if isinstance(placed.shape, Mesh):
                remarks.update(dict.fromkeys(_mesh_remarks(body.name, placed.shape)))
    return tuple(remarks)


def _mesh_remarks(name: str, mesh: Mesh) -> list[str]:
    size = float(np.ptp(mesh.bounds, axis=0).max())
    remarks = []
    if size > _LARGE:
        remarks.append(
            f'The mesh of {name} is {size:.3g} m long; if its file is in millimetres, multiply '
            'its scale by 0.001.'
        )
    elif size < _SMALL:
        remarks.append(
            f'The mesh of {name} is only {1e3 * size:.3g} mm long; if its file is in metres, '
            'leave out its scale.'
        )
    if not mesh.is_closed:
        remarks.append(
            f'The mesh of {name} is not closed; its file may be damaged. Distances are those to '
            'its triangles.'
        )
    return remarks
