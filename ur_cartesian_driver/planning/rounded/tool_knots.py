# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The knots between which quintics follow the tool along a section of a rounded path.

Knots lie on a grid of times whose steps are no shorter than the shortest piece. The grid begins
anew at the anchors of the section, which are places on the path. So if the time law is slowed
somewhere, only the pieces between the nearest anchors change; others are only shifted in time.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats, Indices
from ur_cartesian_driver.motion.geometry.pose_rows import angle_rows, length_rows
from ur_cartesian_driver.planning.geometry.samples import counted
from ur_cartesian_driver.planning.geometry.tool_spline import ToolPoints, ToolSpline
from ur_cartesian_driver.planning.rounded.section_law import SectionLaw, tool_rows
from ur_cartesian_driver.planning.rounded.time_law import PathTimes
from ur_cartesian_driver.planning.spline.joint_polynomials import ANGLE_TOLERANCE_RADIUS
from ur_cartesian_driver.planning.spline.spline_path import sample_density

#: Shortest time of a piece [s] that robot program and sockets sustain over any number of pieces.
MIN_PIECE_TIME = 0.02
#: Greatest accepted ratio to its limit: of an acceleration inside a piece of one grid step, of an
#: acceleration inside a longer piece, and of the jerk inside a longer piece. A longer piece is
#: split if it exceeds one of its ratios.
CLOSE_ENOUGH, _SPLIT_EXCESS, _SPLIT_JERK = 1.017, 1.012, 1.01
#: Greatest number of times that the law is slowed around pieces that are too coarse.
TRIES = 6
#: Number of grid steps in a piece at first; pieces are then split as necessary.
_JOINED = 8
#: Fractions of its time at which the accelerations of a piece are measured: of a piece of one grid
#: step, and of a longer piece. The latter is also measured at all half steps, but its acceleration
#: may be greatest closer to its ends.
_QUARTERS, _MEASURED = (0.25, 0.5, 0.75), (0.08, 0.16, 0.3, 0.42, 0.58, 0.7, 0.84, 0.92)
#: Greatest error of the acceleration, as a fraction of its limit, on pieces of several grid steps.
_ACCELERATION_PART = 0.15
#: Greatest distance [m] between the path and the chord from one sample to the next, the same as
#: between path and pieces.
_CHORD_ERROR = 1e-5
#: Greatest error along the path [m] if a place is interpolated in time between two samples.
_TIME_ERROR = 5e-5
#: A tool slower than this [m/s] rests.
_REST = 1e-9


class ToolKnots(NamedTuple):
    """The knots of a section."""

    #: The tool at the n + 1 knots; times are since the beginning of the section.
    points: ToolPoints
    #: (n,) the number of samples between two knots that describe the path.
    sample_count: Indices
    #: (n,) the number of samples between two knots at which the arm is checked, the same as if the
    #: path were straight.
    check_count: Indices


def tool_knots(law: SectionLaw, tolerance: float) -> ToolKnots:
    """
    Return as few knots as possible; slow the law where even the shortest pieces are too coarse.

    :param tolerance: bound on deviations of the quintics from the law: of the position [m]; of the
        orientation, as the angle times ANGLE_TOLERANCE_RADIUS [m].
    """
    for attempt in range(TRIES + 1):
        steps = _HalfSteps(law)
        ends = _piece_ends(steps, tolerance)
        shortest = ends[:-1][np.diff(ends) == 1]
        coarse = shortest[steps.excess(shortest) > CLOSE_ENOUGH]
        if not len(coarse) or attempt == TRIES:
            break
        law.slow_around(np.stack([steps.grid[coarse], steps.grid[coarse + 1]], axis=1))
    return ToolKnots(steps.points(2 * ends), *steps.sample_counts(ends))


class _Pieces(NamedTuple):
    """Pieces of a spline, ``number`` (r,), between rows ``begin`` and ``end`` (r,) of the grid."""

    spline: ToolSpline
    number: Indices
    begin: Indices
    end: Indices

    def take(self, rows: Indices) -> _Pieces:
        """Return some of the pieces."""
        return _Pieces(self.spline, self.number[rows], self.begin[rows], self.end[rows])


class _HalfSteps:
    """The law at the times of a grid and halfway between them: rows 0, 2, ... are on the grid."""

    def __init__(self, law: SectionLaw) -> None:
        self.grid = _grid(law)
        times = np.empty(2 * len(self.grid) - 1)
        times[::2], times[1::2] = self.grid, 0.5 * (self.grid[1:] + self.grid[:-1])
        at = law.law.at(times)
        self._law = law
        self._points = _points_at(law, times, at)
        self._limits = law.acceleration_limits(at.s)

    def points(self, rows: Indices) -> ToolPoints:
        """Return the law in some rows."""
        points = self._points
        return ToolPoints(
            times=points.times[rows],
            poses=points.poses[rows],
            twists=points.twists[rows],
            accelerations=points.accelerations[rows],
            quintic=True,
        )

    def sample_counts(self, ends: Indices) -> tuple[Indices, ...]:
        """
        Return the two numbers of samples in :class:`ToolKnots` for pieces between grid rows (n,).

        Samples are at most 2 mm and one degree apart. Those that describe the path are denser
        where the path is curved, and where the tool accelerates.
        """
        twists, accelerations = self._points.twists, self._points.accelerations[:, :3]
        speed = length_rows(twists[:, :3])
        along = np.einsum('ij,ij->i', twists[:, :3], accelerations) / np.maximum(speed, _REST)
        size = length_rows(accelerations)
        across = np.sqrt(np.maximum(size * size - along * along, 0.0))
        rates = speed, length_rows(twists[:, 3:])
        bent = sample_density(*rates, across, _CHORD_ERROR)
        first, last = 2 * ends[:-1], 2 * ends[1:]

        def count(density: Floats) -> Indices:
            greatest = np.maximum(np.maximum.reduceat(density, first), density[last])
            return np.maximum(np.ceil(greatest * np.diff(self.grid[ends])), 1.0).astype(np.intp)

        return (
            count(np.maximum(bent, np.sqrt(size / (8.0 * _TIME_ERROR)))),
            count(sample_density(*rates, np.zeros(len(speed)))),
        )

    def fits(self, begin: Indices, end: Indices, tolerance: float) -> Flags:
        """Return whether quintics between grid times (r,) follow the law closely enough."""
        pieces, fits = self._pieces(begin, end), np.ones(len(begin), dtype=np.bool_)
        # Most pieces that do not fit fail near a quarter, so long ones are compared there first.
        long = np.flatnonzero(end - begin > 2)
        if len(long):
            fits[long] = self._follows(pieces.take(long), tolerance, at_quarters=True)
        rows = np.flatnonzero(fits)
        if len(rows):
            few = pieces.take(rows)
            fits[rows] = self._follows(few, tolerance, at_quarters=False)
            fits[rows] &= self._excess(few, _MEASURED) <= _SPLIT_EXCESS
        return fits

    def _follows(self, pieces: _Pieces, tolerance: float, *, at_quarters: bool) -> Flags:
        """Return whether pieces follow the law at all half steps, or only near the quarters."""
        begin, end = pieces.begin, pieces.end
        exact, times = self._points, self._points.times
        steps = 2 * (end - begin)
        piece, inner = counted(np.full(len(begin), 3) if at_quarters else steps - 1)
        rows = 2 * begin[piece] + (inner * steps[piece] // 4 if at_quarters else inner)
        made = pieces.spline.rows(pieces.number[piece], times[rows] - times[2 * begin[piece]])
        limits = self._limits[0][rows], self._limits[1][rows]
        worst = np.maximum.reduce(
            [
                length_rows(exact.poses[rows, :3] - made.poses[:, :3]) / tolerance,
                _ratios(made.accelerations - exact.accelerations[rows], limits)
                / _ACCELERATION_PART,
                _ratios(made.accelerations, limits) / _SPLIT_EXCESS,
            ]
        )
        if not at_quarters:
            # The jerk is measured from the half step before each row to the half step after it.
            accelerations = exact.accelerations[:, :3].copy()
            accelerations[rows] = made.accelerations[:, :3]
            jerk = length_rows(accelerations[rows + 1] - accelerations[rows - 1])
            jerk /= times[rows + 1] - times[rows - 1]
            worst = np.maximum(worst, jerk / (_SPLIT_JERK * self._law.jerk))
        turned = np.flatnonzero(np.any(exact.poses[rows, 3:] != made.poses[:, 3:], axis=1))
        if len(turned):
            angle = angle_rows(exact.poses[rows[turned], 3:], made.poses[turned, 3:])
            worst[turned] = np.maximum(worst[turned], ANGLE_TOLERANCE_RADIUS * angle / tolerance)
        follows: Flags = np.maximum.reduceat(worst, np.flatnonzero(inner == 1)) <= 1.0
        return follows

    def excess(self, begin: Indices) -> Floats:
        """Return the greatest ratio of an acceleration to its limit on pieces of one step (r,)."""
        if not len(begin):
            return np.empty(0)
        return self._excess(self._pieces(begin, begin + 1), _QUARTERS)

    def _excess(self, pieces: _Pieces, parts: tuple[float, ...]) -> Floats:
        """Return the ratios of :meth:`excess` (r,), measured at fractions of each piece's time."""
        begin, end = pieces.begin[:, None], pieces.end[:, None]
        t = ((self.grid[end] - self.grid[begin]) * parts).ravel()
        _, accelerations = pieces.spline.rates(np.repeat(pieces.number, len(parts)), t)
        rows = (2 * begin + 2 * (end - begin) * np.array(parts)).astype(np.intp).ravel()
        ratios = _ratios(accelerations, (self._limits[0][rows], self._limits[1][rows]))
        largest: Floats = ratios.reshape(-1, len(parts)).max(axis=1)
        return largest

    def _pieces(self, begin: Indices, end: Indices) -> _Pieces:
        knots = np.flatnonzero(np.bincount(np.concatenate([begin, end])))
        # The spline also has pieces across the gaps between the given ones.
        spline = ToolSpline.through(self.points(2 * knots))
        return _Pieces(spline, np.searchsorted(knots, begin), begin, end)


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


def _piece_ends(steps: _HalfSteps, tolerance: float) -> Indices:
    """Return the rows of the grid between which pieces follow the law closely enough."""
    last = len(steps.grid) - 1
    # The first piece is short, so that an output can be sent soon after the start.
    ends = np.unique([0, 1, *range(_JOINED, last, _JOINED), last])
    open_rows, tried = np.arange(len(ends) - 1), np.empty(0, dtype=np.intp)
    while len(open_rows := open_rows[np.diff(ends)[open_rows] > 1]):
        begin, end = ends[open_rows], ends[open_rows + 1]
        split = open_rows[~steps.fits(begin, end, tolerance)]
        tried = np.append(tried, _names(ends[split], ends[split + 1]))
        ends = np.insert(ends, split + 1, (ends[split] + ends[split + 1]) // 2)
        moved = split + np.arange(len(split))
        open_rows = np.sort(np.concatenate([moved, moved + 1]))
    # Neighbours that are halves of different pieces may make one piece. First the pairs that begin
    # with an odd piece are tried, then the other pairs.
    for first in (1, 2):
        left = np.arange(first, len(ends) - 2, 2)
        left = left[ends[left + 2] - ends[left] <= _JOINED]
        left = left[~np.isin(_names(ends[left], ends[left + 2]), tried)]
        if len(left):
            joined = left[steps.fits(ends[left], ends[left + 2], tolerance)]
            ends = np.delete(ends, joined + 1)
    return ends


def _names(begin: Indices, end: Indices) -> Indices:
    """Return a number that identifies each piece between rows of the grid (r,)."""
    return 2 * _JOINED * begin + end - begin


def _ratios(accelerations: Floats, limits: tuple[Floats, Floats]) -> Floats:
    """Return the ratios (m,) of accelerations (m, 6) to the limits of travel and turn."""
    linear, angular = limits
    ratios: Floats = np.maximum(
        length_rows(accelerations[:, :3]) / linear, length_rows(accelerations[:, 3:]) / angular
    )
    return ratios
