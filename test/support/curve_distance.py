# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Distances between curves, and the curves that a path follows."""

from collections.abc import Iterable, Sequence
from math import degrees

import numpy as np
from scipy.spatial import cKDTree

#: Largest distance of curves from the lines between their points, and between these points [m].
SAG, SPACING = 5e-7, 2e-3


def path_curves(positions, vias, travels) -> list[np.ndarray]:
    """
    Return points (n, 3) on each contour of a path.

    :param vias: (n, 3) points on the arcs that end at positions; NaN = it is a line.
    :param travels: (n,) whether a contour begins.
    """
    found: list[list[np.ndarray]] = []
    for row, point in enumerate(positions):
        if travels[row] or not found:
            found.append([point[None]])
        elif np.isnan(vias[row, 0]):
            found[-1].append(point[None])
        else:
            found[-1].append(arc_points(positions[row - 1], vias[row], point))
    return [np.vstack(parts) for parts in found]


def arc_points(a, via, b):
    """Return points on the arc through three points, without the first."""
    u, v = via - a, b - a
    normal = np.cross(u, v)
    centre = a + np.cross((u @ u) * v - (v @ v) * u, normal) / (2.0 * normal @ normal)
    ex = a - centre
    ey = np.cross(normal / np.linalg.norm(normal), ex)
    angle = np.arctan2((b - centre) @ ey, (b - centre) @ ex) % (2.0 * np.pi)
    t = np.linspace(0.0, angle, arc_count(np.degrees(angle), float(np.linalg.norm(ex))))[1:]
    return centre + np.cos(t)[:, None] * ex + np.sin(t)[:, None] * ey


def arc_count(angle: float, radius: float) -> int:
    """Return the number of points for an arc [degrees, m]; an ellipse has its larger radius."""
    return 2 + int(angle / min(1.0, degrees((8.0 * SAG / max(radius, 1e-9)) ** 0.5)))


def distances(points: np.ndarray, curves: Sequence[np.ndarray], enough: float = 0.0) -> np.ndarray:
    """Return distances (n,) of points from polylines; those below `enough` are upper bounds."""
    polylines = [_dense(curve) for curve in curves]
    starts = np.vstack([p[:-1] for p in polylines])
    spans = np.vstack([np.diff(p, axis=0) for p in polylines])
    tree = cKDTree(starts + 0.5 * spans)
    longest = np.linalg.norm(spans, axis=1).max()
    found = np.full(len(points), np.inf)
    rest, k = np.arange(len(points)), 4
    while len(rest):
        k = min(4 * k, len(starts))
        apart, near = tree.query(points[rest], k=[*range(1, k + 1)])
        a, d = starts[near], spans[near]
        square = np.einsum('nkj,nkj->nk', d, d)
        along = np.einsum('nkj,nkj->nk', points[rest, None] - a, d)
        foot = a + np.clip(along / np.where(square > 0, square, 1), 0, 1)[..., None] * d
        found[rest] = np.linalg.norm(points[rest, None] - foot, axis=2).min(axis=1)
        # The middles of all other lines are farther away than the last one.
        is_known = (found[rest] <= enough) | (found[rest] <= apart[:, -1] - 0.5 * longest)
        rest = rest[~is_known] if k < len(starts) else rest[:0]
    return found


def samples(curves: Iterable[np.ndarray]) -> np.ndarray:
    """Return points on polylines, at most ``SPACING`` apart."""
    return np.vstack([_dense(curve) for curve in curves])


def _dense(curve):
    spans = np.diff(curve, axis=0)
    counts = 1 + (np.linalg.norm(spans, axis=1) / SPACING).astype(int)
    row = np.repeat(np.arange(len(spans)), counts)
    part = (np.arange(len(row)) - np.repeat(np.cumsum(counts) - counts, counts)) / counts[row]
    return np.vstack([curve[row] + part[:, None] * spans[row], curve[-1:]])


def places_along(curve: np.ndarray, positions: np.ndarray, reach: float):
    """
    Return, for each position (n, 3), its side of a polyline and its distance from the side [m].

    :param reach: from one position to the next, no longer stretch of sides is skipped [m].
    """
    side, found = 0, []
    a, along = curve[:-1], np.diff(curve, axis=0)
    square = np.einsum('ij,ij->i', along, along)
    begins = np.concatenate(((0.0,), np.cumsum(square**0.5)))[:-1]
    for position in positions:
        last = int(np.searchsorted(begins, begins[side] + square[side] ** 0.5 + reach))
        near = slice(side, last)
        share = np.einsum('ij,ij->i', position - a[near], along[near]) / square[near]
        foot = a[near] + np.clip(share, 0.0, 1.0)[:, None] * along[near]
        off = np.linalg.norm(foot - position, axis=1)
        side += int(np.argmin(off))
        found.append((side, float(off.min())))
    return found
