# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The knots between which quintics follow the tool along a section of a rounded path.

Knots lie on a grid whose steps are no shorter than the shortest piece. The grid begins anew at
the anchors of the section, which are places on the path: where the law is slowed, pieces change,
and pieces elsewhere are only shifted in time.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Floats, Indices
from ur_cartesian_driver.motion.geometry.pose_rows import angle_rows, distance_rows
from ur_cartesian_driver.planning.geometry.tool_spline import ToolPoints, ToolSpline
from ur_cartesian_driver.planning.rounded.section_law import SectionLaw, tool_rows
from ur_cartesian_driver.planning.rounded.time_law import PathTimes
from ur_cartesian_driver.planning.spline.joint_polynomials import ANGLE_TOLERANCE_RADIUS

#: Shortest time of a piece [s] that robot program and sockets sustain over any number of pieces.
MIN_PIECE_TIME = 0.02
#: Greatest acceptable ratio of an acceleration inside a piece to its limit.
CLOSE_ENOUGH = 1.017
#: Greatest number of times that the law is slowed around pieces that are too coarse.
TRIES = 6
#: Number of shortest pieces that are joined into one at first; the result is split as necessary.
_JOINED = 8
#: Number of samples inside a piece at which it is compared with the law, and at which only its
#: accelerations are measured.
_COMPARED, _MEASURED = 7, 3
#: Greatest error of the acceleration, as a fraction of its limit, on pieces that can be split.
_ACCELERATION_PART = 0.02


def tool_knots(law: SectionLaw, tolerance: float) -> Floats:
    """
    Return the knots (n,) [s], as few as possible, and slow the law where pieces are too coarse.

    :param tolerance: bound on deviations of the quintics from the law: of the position [m]; for
        turns, of the arc at ANGLE_TOLERANCE_RADIUS.
    """
    for attempt in range(TRIES + 1):
        grid = _grid(law)
        ends = _piece_ends(law, grid, tolerance)
        times = grid[ends]
        shortest = np.flatnonzero(np.diff(ends) == 1)
        coarse = shortest[_accelerations(law, times, shortest) > CLOSE_ENOUGH]
        if not len(coarse) or attempt == TRIES:
            break
        law.slow_around(np.stack([times[coarse], times[coarse + 1]], axis=1))
    return times


def tool_points(law: SectionLaw, times: Floats) -> ToolPoints:
    """Return pose and rates of the tool at times (m,) since the beginning of the section [s]."""
    return _points_at(law, times, law.law.at(times))


def _points_at(law: SectionLaw, times: Floats, at: PathTimes) -> ToolPoints:
    rows = law.path.rows(at.s)
    poses, w1, w2 = tool_rows(rows)
    v, a = at.v[:, None], at.a[:, None]
    first = np.concatenate([rows.d1[:, :3], w1], axis=1)
    second = np.concatenate([rows.d2[:, :3], w2], axis=1)
    return ToolPoints(
        times=times,
        poses=poses,
        twists=first * v,
        accelerations=first * a + second * v * v,
        quintic=True,
    )


def _grid(law: SectionLaw) -> Floats:
    """Return the times [s] at which pieces may begin or end."""
    edges = [0.0, *law.law.times_of(law.anchors).tolist(), law.duration]
    parts: list[Floats] = []
    for begin, end in pairwise(edges):
        count = max(1, int((end - begin) / MIN_PIECE_TIME))
        parts.append(np.linspace(begin, end, count + 1)[1 if parts else 0 :])
    return np.concatenate(parts)


def _piece_ends(law: SectionLaw, grid: Floats, tolerance: float) -> Indices:
    """Return the rows of the grid at which the pieces end that follow the law closely enough."""
    # The first piece is short, so that an output can be sent soon after the start.
    ends = np.unique([0, 1, *range(_JOINED, len(grid) - 1, _JOINED), len(grid) - 1])
    open_rows = np.arange(len(ends) - 1)
    while len(open_rows := open_rows[np.diff(ends)[open_rows] > 1]):
        deviations, accelerations = _compared(law, grid[ends], open_rows, tolerance)
        split = open_rows[(deviations > 1.0) | (accelerations > CLOSE_ENOUGH)]
        ends = np.insert(ends, split + 1, (ends[split] + ends[split + 1]) // 2)
        moved = split + np.arange(len(split))
        open_rows = np.sort(np.concatenate([moved, moved + 1]))
    return ends


def _compared(
    law: SectionLaw, times: Floats, rows: Indices, tolerance: float
) -> tuple[Floats, Floats]:
    """
    Compare quintics with the law between their knots.

    :param times: the knots [s].
    :param rows: (r,) the knot at which each quintic begins.
    :return: their deviations from the law (r,) as fractions of their bounds, and their
        accelerations (r,) as fractions of their limits.
    """
    spline, number, t = _samples(law, times, rows, _COMPARED)
    at = law.law.at(spline.times[number] + t)
    exact = _points_at(law, spline.times[number] + t, at)
    made = spline.rows(number, t)
    limits = law.acceleration_limits(at.s)
    deviations = np.maximum.reduce(
        [
            distance_rows(exact.poses, made.poses) / tolerance,
            ANGLE_TOLERANCE_RADIUS * angle_rows(exact.poses[:, 3:], made.poses[:, 3:]) / tolerance,
            _ratios(made.accelerations - exact.accelerations, limits) / _ACCELERATION_PART,
        ]
    )
    accelerations = _ratios(made.accelerations, limits)
    shape = len(rows), _COMPARED
    return deviations.reshape(shape).max(axis=1), accelerations.reshape(shape).max(axis=1)


def _accelerations(law: SectionLaw, times: Floats, rows: Indices) -> Floats:
    """Return the accelerations that :func:`_compared` returns."""
    spline, number, t = _samples(law, times, rows, _MEASURED)
    _, accelerations = spline.rates(number, t)
    limits = law.acceleration_limits(law.law.at(spline.times[number] + t).s)
    largest: Floats = _ratios(accelerations, limits).reshape(-1, _MEASURED).max(axis=1)
    return largest


def _samples(
    law: SectionLaw, times: Floats, rows: Indices, count: int
) -> tuple[ToolSpline, Indices, Floats]:
    """Return a spline, and for ``count`` samples inside each quintic its number and time on it."""
    ends = np.unique(np.concatenate([rows, rows + 1]))
    # The spline also has pieces across the gaps between ``rows``; these have no samples.
    spline = ToolSpline.through(tool_points(law, times[ends]))
    part = np.arange(1, count + 1) / (count + 1)
    number = np.repeat(np.searchsorted(ends, rows), count)
    return spline, number, (np.diff(times)[rows][:, None] * part).ravel()


def _ratios(accelerations: Floats, limits: tuple[Floats, Floats]) -> Floats:
    """Return the ratios (m,) of accelerations (m, 6) to the limits of travel and turn."""
    linear, angular = limits
    ratios: Floats = np.maximum(
        np.linalg.norm(accelerations[:, :3], axis=1) / linear,
        np.linalg.norm(accelerations[:, 3:], axis=1) / angular,
    )
    return ratios
