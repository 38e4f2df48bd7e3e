# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The judge of distances: brute force over triangles, with nothing but numpy.

A surface is an array (n, 3, 3) of the corners of its triangles [m].
"""

from itertools import chain, product, repeat

import numpy as np
from scipy.spatial import cKDTree, ConvexHull

# Numbers of triangle pairs that are measured at once; the nearest few rule out most others.
_CHUNKS = (128, 1024, 8192)
# Directions along which triangles are compared, besides the direction of the nearest corners.
_DIRECTIONS = np.array([d for d in product((-1.0, 0.0, 1.0), repeat=3) if d > (0.0, 0.0, 1.0)])
_TINY = 1e-300
# The corner behind each corner.
_NEXT = [1, 2, 0]


def triangle_distance(one, other):
    """
    Return the smallest distance of two surfaces [m]; 0 if a triangle passes through another.

    Only pairs of triangles that may be nearer than the best pair so far are measured. They are
    chosen by their boxes along the axes, then by their separation along some other directions.
    """
    a, b = one.reshape(-1, 3), other.reshape(-1, 3)
    corners, numbers = cKDTree(b).query(a)
    k = int(np.argmin(corners))
    # For two points this is the distance, except for rounding.
    best = float(corners[k]) * (1.0 + 1e-9)
    rows, columns, gaps = _near_pairs(one, other, best)
    directions = np.vstack([_DIRECTIONS, b[numbers[k]] - a[k]])
    directions /= np.maximum(np.linalg.norm(directions, axis=1), _TINY)[:, None]
    (a_low, a_high), (b_low, b_high) = (_bounds(each @ directions.T) for each in (one, other))
    for k in range(len(directions)):
        apart = b_low[columns, k] - a_high[rows, k], a_low[rows, k] - b_high[columns, k]
        gaps = np.maximum(gaps, np.maximum(*apart))
        near = gaps <= best
        rows, columns, gaps = rows[near], columns[near], gaps[near]
    order, begin = np.argsort(gaps), 0
    for size in chain(_CHUNKS, repeat(_CHUNKS[-1])):
        some = order[begin : begin + size]
        begin += size
        if not len(some) or gaps[some[0]] > best:
            break
        best = min(best, float(_pair_distances(one[rows[some]], other[columns[some]]).min()))
        if best == 0.0:
            break
    return best


def _near_pairs(one, other, best):
    """Return the pairs of triangles whose boxes are within a distance, and box distances."""
    (low, high), (other_low, other_high) = _bounds(one), _bounds(other)
    rows = np.flatnonzero(
        _gaps((low, high), (other_low.min(axis=0), other_high.max(axis=0))) <= best
    )
    columns = np.flatnonzero(
        _gaps((other_low, other_high), (low.min(axis=0), high.max(axis=0))) <= best
    )
    gaps = np.concatenate(
        [
            _gaps((low[some, None], high[some, None]), (other_low[columns], other_high[columns]))
            for some in np.array_split(rows, 1 + len(rows) // 64)
        ]
    )
    near = np.nonzero(gaps <= best)
    return rows[near[0]], columns[near[1]], gaps[near]


def _bounds(triangles):
    return triangles.min(axis=-2), triangles.max(axis=-2)


def _gaps(a, b):
    """Return the distances of boxes, each given by its lowest and highest corner."""
    apart = np.maximum(np.maximum(a[0] - b[1], b[0] - a[1]), 0.0)
    return np.sqrt(np.einsum('...c,...c', apart, apart))


def _pair_distances(p, q):
    """Return the distances (n,) of pairs of triangles (n, 3, 3)."""
    of_p, of_q = (each.ravel() for each in np.meshgrid(range(3), range(3)))
    edges = p[:, of_p], p[:, of_p - 2], q[:, of_q], q[:, of_q - 2]
    best = _segment_distances(*edges).min(axis=1)
    for one, other in ((p, q), (q, p)):
        edges = other[:, _NEXT] - other
        normal = _cross(edges[:, 0], edges[:, 1])
        length = np.linalg.norm(normal, axis=1)
        has_face = length >= _TINY  # a point or a line has none
        normal = normal / np.maximum(length, _TINY)[:, None]
        inwards = _cross(normal[:, None], edges)
        heights = np.einsum('nkc,nc->nk', one - other[:, :1], normal)
        for k in range(3):
            above = has_face & _is_inside(one[:, k], other, inwards)
            best = np.where(above, np.minimum(best, np.abs(heights[:, k])), best)
            start, end = heights[:, k], heights[:, k - 2]
            crossing = np.flatnonzero(has_face & (start * end < 0.0))
            part = (start[crossing] / (start[crossing] - end[crossing]))[:, None]
            edge = one[crossing, k - 2] - one[crossing, k]
            point = one[crossing, k] + part * edge
            best[crossing[_is_inside(point, other[crossing], inwards[crossing])]] = 0.0
    return best


def _cross(a, b):
    """Return cross products (..., 3); numpy's takes ten times as long for few of them."""
    (ax, ay, az), (bx, by, bz) = ([each[..., k] for k in range(3)] for each in (a, b))
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1)


def _is_inside(points, corners, inwards):
    """
    Return whether points (n, 3) are above or below their triangles (n, 3, 3).

    :param inwards: (n, 3, 3) for each edge, the inward direction in the plane.
    """
    beyond = np.einsum('nkc,nkc->nk', points[:, None] - corners, inwards)
    return (beyond >= 0.0).all(axis=1)


def _segment_distances(a, a_end, b, b_end):
    """Return the distances (...) of segments: between their lines, or at one of four ends."""
    u, v, r = a_end - a, b_end - b, a - b
    uu, vv, uv, ur, vr = (
        np.einsum('...c,...c', x, y) for x, y in ((u, u), (v, v), (u, v), (u, r), (v, r))
    )

    def apart(s, t):
        between = r + s[..., None] * u - t[..., None] * v
        return np.einsum('...c,...c', between, between)

    zero, one = np.zeros_like(uu), np.ones_like(uu)
    square = np.minimum.reduce(
        [
            apart(zero, np.clip(vr / np.maximum(vv, _TINY), 0.0, 1.0)),
            apart(one, np.clip((vr + uv) / np.maximum(vv, _TINY), 0.0, 1.0)),
            apart(np.clip(-ur / np.maximum(uu, _TINY), 0.0, 1.0), zero),
            apart(np.clip((uv - ur) / np.maximum(uu, _TINY), 0.0, 1.0), one),
        ]
    )
    cross = uu * vv - uv * uv
    crosses = cross > 1e-12 * uu * vv
    safe = np.where(crosses, cross, 1.0)
    s, t = (uv * vr - ur * vv) / safe, (uu * vr - uv * ur) / safe
    within = crosses & (s >= 0.0) & (s <= 1.0) & (t >= 0.0) & (t <= 1.0)
    return np.sqrt(np.where(within, np.minimum(square, apart(s, t)), square))


def encloses(surface, point):
    """Return whether a closed surface encloses a point: it fills the whole view (Van Oosterom)."""
    a, b, c = (surface[:, k] - point for k in range(3))
    x, y, z = (np.linalg.norm(each, axis=1) for each in (a, b, c))
    volume = np.einsum('nc,nc->n', a, np.cross(b, c))
    rest = (
        x * y * z
        + np.einsum('nc,nc->n', a, b) * z
        + np.einsum('nc,nc->n', b, c) * x
        + np.einsum('nc,nc->n', c, a) * y
    )
    return abs(np.arctan2(volume, rest).sum()) > np.pi


def hull_surface(points):
    """Return the surface of the convex hull of points (n, 3), its triangles turned outwards."""
    hull = ConvexHull(points)
    triangles = points[hull.simplices]
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    inward = np.einsum('nc,nc->n', normals, hull.equations[:, :3]) < 0.0
    triangles[inward] = triangles[inward][:, ::-1]
    return triangles


def box_surface(size):
    """Return the twelve triangles of a box around the origin."""
    signs = np.array(np.meshgrid(*[(-0.5, 0.5)] * 3)).reshape(3, -1).T
    return hull_surface(signs * np.array(size))


def cylinder_surfaces(radius, length, n=128):
    """
    Return two prisms about z, one inside of a cylinder and one around it.

    With 128 sides they are 0.06 % of the radius apart.
    """
    angle = 2.0 * np.pi / n * np.arange(n)
    rim = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    found = []
    for r in (radius, radius / np.cos(np.pi / n)):
        low, high = (np.column_stack([r * rim, np.full(n, z)]) for z in (-length / 2, length / 2))
        after = [np.roll(each, -1, axis=0) for each in (low, high)]
        bottom, top = (np.tile(each.mean(axis=0), (n, 1)) for each in (low, high))
        faces = (
            (low, after[0], high),
            (after[0], after[1], high),
            (bottom, after[0], low),
            (top, high, after[1]),
        )
        found.append(np.concatenate([np.stack(face, axis=1) for face in faces]))
    return tuple(found)


def moved(surface, T):
    """Return a surface moved by a matrix (4, 4)."""
    return surface @ T[:3, :3].T + T[:3, 3]
