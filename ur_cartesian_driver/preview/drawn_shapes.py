# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The shapes of a cell as they are drawn: planes with an end, meshes with few triangles."""

from __future__ import annotations

import numpy as np

from ur_cartesian_driver.motion.cell.cell import Cell
from ur_cartesian_driver.motion.cell.shapes import Mesh
from ur_cartesian_driver.motion.geometry.arrays import Floats, Indices

#: Side of the square that stands for a half-space [m].
SQUARE_SIDE = 1.6
#: Largest number of triangles of all meshes of a cell together.
MAX_TRIANGLES = 20_000
#: By how much the raster of the vertices grows until a mesh has few enough triangles.
_COARSER = 1.3


def triangles_per_mesh(cell: Cell) -> int:
    """Return the largest number of triangles that each mesh of a cell is drawn with."""
    meshes = sum(isinstance(placed.shape, Mesh) for body in cell.bodies for placed in body.shapes)
    return MAX_TRIANGLES // max(1, meshes)


def coarse_mesh(mesh: Mesh, most: int) -> tuple[Floats, Indices]:
    """
    Return vertices (n, 3) [m] and triangles (m, 3) of a mesh: its own, or fewer but like them.

    Vertices that share a cube of a raster become one, in their middle.

    :param most: the largest number of triangles.
    """
    vertices, triangles = mesh.vertices, mesh.triangles
    low, high = mesh.bounds
    cube = float((high - low).max()) / max(2.0, most**0.5)
    while len(triangles) > most:
        vertices, triangles = _on_raster(mesh, np.floor((mesh.vertices - low) / cube))
        cube *= _COARSER
    return vertices, triangles


def _on_raster(mesh: Mesh, cubes: Floats) -> tuple[Floats, Indices]:
    """Return vertices and triangles with the vertices of each cube (n, 3) put together."""
    _, of_vertex, counts = np.unique(cubes, axis=0, return_inverse=True, return_counts=True)
    of_vertex = of_vertex.reshape(-1)
    middles = np.zeros((len(counts), 3))
    np.add.at(middles, of_vertex, mesh.vertices)
    corners = of_vertex[mesh.triangles]
    a, b, c = corners.T
    return middles / counts[:, None], corners[(a != b) & (b != c) & (c != a)]
