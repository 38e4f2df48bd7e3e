# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The shapes of a cell as they are drawn: planes of finite size, meshes with few triangles."""

from __future__ import annotations

from math import ceil

import numpy as np

from ur_cartesian_driver.motion.cell.cell import Cell
from ur_cartesian_driver.motion.cell.shapes import Mesh
from ur_cartesian_driver.motion.geometry.arrays import Floats, Indices

#: Side of the square that stands for a half-space [m].
SQUARE_SIDE = 1.6
#: Largest number of triangles of all meshes of a cell together. Each mesh may have an equal share,
#: or the second number if that is larger.
MAX_TRIANGLES, _MIN_TRIANGLES = 20_000, 100
#: Factor by which the cubes of the raster grow, from try to try, until few triangles are left.
_COARSER = 1.3


def triangles_per_mesh(cell: Cell) -> int:
    """Return the largest number of triangles with which each mesh of a cell is drawn."""
    meshes = sum(isinstance(placed.shape, Mesh) for body in cell.bodies for placed in body.shapes)
    return max(_MIN_TRIANGLES, MAX_TRIANGLES // max(1, meshes))


def coarse_mesh(mesh: Mesh, most: int) -> tuple[Floats, Indices]:
    """
    Return vertices (n, 3) [m] and triangles (m, 3) of a mesh: its own, or fewer similar ones.

    Vertices that share a cube of a raster become one, at their mean. If no triangle is left, as
    of a cloud of small triangles, some of the mesh's own triangles are returned.

    :param most: the largest number of triangles.
    """
    vertices, triangles = mesh.vertices, mesh.triangles
    low, high = mesh.bounds
    cubes = max(2.0, most**0.5)
    while len(triangles) > most:
        numbers = ((mesh.vertices - low) * (cubes / (high - low).max())).astype(np.int64)
        vertices, triangles = _on_raster(mesh, numbers, int(cubes) + 1)
        cubes /= _COARSER
    if not len(triangles):
        return mesh.vertices, mesh.triangles[:: ceil(len(mesh.triangles) / most)]
    return vertices, triangles


def _on_raster(mesh: Mesh, cubes: Indices, count: int) -> tuple[Floats, Indices]:
    """
    Return vertices and triangles, with the vertices of each cube merged.

    :param cubes: (n, 3) numbers, along each axis, of the cube that contains each vertex.
    :param count: larger than all these numbers.
    """
    x, y, z = cubes.T
    _, of_vertex, counts = np.unique(
        (x * count + y) * count + z, return_inverse=True, return_counts=True
    )
    middles = np.stack([np.bincount(of_vertex, column) for column in mesh.vertices.T], axis=1)
    corners = of_vertex[mesh.triangles]
    a, b, c = np.sort(corners, axis=1).T
    n = len(counts)  # the keys below fit into 64 bits for up to two million
    _, first = np.unique((a * n + b) * n + c, return_index=True)
    first = first[(a[first] < b[first]) & (b[first] < c[first])]
    return middles / counts[:, None], corners[first]
