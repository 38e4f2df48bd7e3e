# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
A polyline of poses with rounded corners, in closed form.

The polyline x(s) is in R^7: positions and unit quaternions. The tool turns so little on a chord
that quaternions are interpolated linearly, too. A value of s is a *place*. At the vertex j, the
derivative of x(s) jumps by d_j. Averaging with the kernel k(u) = 15/16 (1 - u^2)^2 over a width
w_j on both sides turns a single corner into

    x(s) + d_j w_j E((s - s_j) / w_j),    E(u) = G(u) - max(u, 0),    G'' = k.

This curve leaves the polyline only within the width, by at most d_j w_j E(0). The terms of several
corners are added, even if their widths overlap: a chain of short chords becomes one smooth curve.
The curve is three times continuously differentiable. Its second derivative is the sum of the terms
d_j k((s - s_j) / w_j) / w_j, so the curvature grows from 0 at a corner and falls back to 0.

Widths are as large as the bounds of the vertices allow. First, each width is fitted in rounds to
the deviation at its own vertex. Then, wherever the deviation still exceeds a bound, all widths
that reach the place are shortened together.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats, Indices
from ur_cartesian_driver.motion.geometry.pose_rows import length_rows

#: E(0): deviation of a single corner from the polyline, as a fraction of jump times width.
PEAK = 5.0 / 32.0
#: Corners are grouped by width for the spacing of samples: one group begins at this width [m].
MIN_WIDTH = 2e-6
#: In such a group, the greatest width is less than this many times the smallest.
_RATIO = 1.5
#: Fraction of a bound to which widths are fitted, so that few deviations exceed the bound.
_AIM = 0.95
#: Greatest number of rounds in which widths are fitted. The fit ends earlier if no width changes
#: by more than the fraction _SAME.
_ROUNDS, _SAME = 10, 0.006
#: Smallest and greatest factor by which a width changes in a round.
_STEPS = 0.5, 1.3
#: If more than ``_MANY`` corners lie within a corner's width, the path is smoother there, and
#: samples are farther apart by the factor ``_SMOOTHER``.
_MANY, _SMOOTHER = 5, 2.4
#: The widths of two corners differ by at most this fraction of the distance between them.
_MAX_SLOPE = 0.5
#: Factor by which widths are multiplied in each round if a bound is exceeded within them.
_SHORTENING = 0.85
#: Jumps smaller than this are rounding errors.
_NO_JUMP = 1e-9
#: Number of pairs of a corner and a sample that are processed at once, which bounds the memory.
_PAIRS = 1_000_000


class PathRows(NamedTuple):
    """A curve in R^7 at m places, and three derivatives with respect to s; (m, 7) each."""

    x: Floats
    d1: Floats
    d2: Floats
    d3: Floats


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Polyline:
    """A polyline from rest to rest."""

    #: (n,) places of the vertices, increasing: a length [m] that combines travel and turn.
    s: Floats
    #: (n, 7) positions [m] and quaternions x y z w, all in the same hemisphere.
    rows: Floats
    #: (n, 2) allowed deviations of the rounded path at each vertex [m], [rad].
    bounds: Floats

    @property
    def slopes(self) -> Floats:
        """(n - 1, 7) the derivative with respect to s on each chord."""
        slopes: Floats = np.diff(self.rows, axis=0) / np.diff(self.s)[:, None]
        return slopes


class RoundedPath:
    """
    A polyline whose corners are rounded within their bounds. Immutable.

    :param max_width: greatest width on each side of a corner, in s [m].
    """

    def __init__(self, polyline: Polyline, max_width: float) -> None:
        """Choose the widths."""
        self.polyline = polyline
        slopes = polyline.slopes
        jumps = np.diff(slopes, axis=0)
        sizes = length_rows(jumps[:, :3]), 2.0 * length_rows(jumps[:, 3:])
        corners = np.flatnonzero(np.maximum(*sizes) > _NO_JUMP) + 1
        self._slopes = slopes
        self._places = polyline.s[corners]
        self._jumps = jumps[corners - 1]
        #: The columns of R^7 that have corners; the quaternion has none if the tool never turns.
        self._columns = np.flatnonzero(self._jumps.any(axis=0))
        self._bounds = polyline.bounds[corners]
        self.corners: Indices = corners
        #: (c,) the width on each side of each corner.
        self.widths = self._choose(max_width)
        self._shorten()

    # ---- the curve ----------------------------------------------------------------------------

    def rows(self, s: Floats) -> PathRows:
        """Return the curve and its derivatives at places (m,), which must not decrease."""
        x, d1 = self._on_polyline(s)
        d2, d3 = np.zeros_like(x), np.zeros_like(x)
        for corner, sample in self._pairs(s, self._places, self.widths):
            w = self.widths[corner]
            u = (s[sample] - self._places[corner]) / w
            for rows, factor in zip((x, d1, d2, d3), _kernel_sums(u, w), strict=True):
                self._add(rows, sample, factor, corner)
        return PathRows(x, d1, d2, d3)

    def _on_polyline(self, s: Floats) -> tuple[Floats, Floats]:
        polyline = self.polyline
        chord = np.clip(np.searchsorted(polyline.s, s, side='right') - 1, 0, len(self._slopes) - 1)
        d1 = self._slopes[chord]
        return polyline.rows[chord] + (s - polyline.s[chord])[:, None] * d1, d1

    def _add(self, rows: Floats, sample: Indices, factor: Floats, corner: Indices) -> None:
        for column in self._columns:
            weights = factor * self._jumps[corner, column]
            rows[:, column] += np.bincount(sample, weights, len(rows))

    def spacing(self, places: Floats, part: float, longest: float) -> Floats:
        """
        Return the spacing of samples (m - 1,) between consecutive places (m,).

        :param part: the spacing as a fraction of the smallest width that reaches an interval.
        :param longest: the spacing where nothing is rounded.
        """
        found = np.full(len(places) - 1, longest)
        begin, end = self._places - self.widths, self._places + self.widths
        # The sum of many kernels is smoother than each of them.
        smooth = np.where(self._is_sharp(), 1.0, _SMOOTHER) * self.widths
        level = np.floor(np.log(smooth / MIN_WIDTH) / np.log(_RATIO)).astype(np.intp)
        for each in np.unique(level)[::-1]:
            those = level == each
            width = float(smooth[those].min())
            first = np.searchsorted(places, begin[those], 'right') - 1
            last = np.searchsorted(places, end[those], 'left')
            count = np.bincount(np.maximum(first, 0), minlength=len(places) + 1)
            count -= np.bincount(np.minimum(last, len(places)), minlength=len(places) + 1)
            covered = np.cumsum(count)[: len(found)] > 0
            found[covered] = np.minimum(found[covered], part * width)
        return found

    def sharp_corners(self) -> Floats:
        """Return the places of corners that are rounded alone, not as part of a chain."""
        return self._places[self._is_sharp()]

    def _is_sharp(self) -> Flags:
        before = np.searchsorted(self._places, self._places - self.widths)
        after = np.searchsorted(self._places, self._places + self.widths)
        sharp: Flags = after - before <= _MANY
        return sharp

    # ---- widths -------------------------------------------------------------------------------

    def _choose(self, max_width: float) -> Floats:
        """Return widths for which the deviation at each corner nearly reaches its bound."""
        s, places = self.polyline.s, self._places
        largest = np.minimum(np.minimum(places - s[0], s[-1] - places), max_width)
        alone = self._bounds / np.maximum(PEAK * _sizes(self._jumps), 1e-12)
        widths = self._evened(np.minimum(alone.min(axis=1), largest))
        for _ in range(_ROUNDS):
            excess = self._excess(places, widths, self._bounds)
            step = np.clip(np.maximum(excess / _AIM, 1e-6) ** -0.5, *_STEPS)
            before, widths = widths, self._evened(np.minimum(widths * step, largest))
            if np.all(np.abs(widths - before) <= _SAME * before):
                break
        return widths

    def _evened(self, widths: Floats) -> Floats:
        """
        Return widths, lowered so that neighbours differ little (see :data:`_MAX_SLOPE`).

        Then the deviations of neighbouring corners in a chain cancel each other.
        """
        rise = _MAX_SLOPE * self._places
        before = np.minimum.accumulate(widths - rise) + rise
        after = np.minimum.accumulate((widths + rise)[::-1])[::-1] - rise
        return np.minimum(before, after)

    def _excess(self, at: Floats, widths: Floats, bounds: Floats) -> Floats:
        """Return the greater ratio of a deviation to its bound (m, 2) at each place (m,)."""
        deviation = np.zeros((len(at), 7))
        for corner, sample in self._pairs(at, self._places, widths):
            w = widths[corner]
            u = (at[sample] - self._places[corner]) / w
            self._add(deviation, sample, w * _even(u), corner)
        largest: Floats = (_sizes(deviation) / np.maximum(bounds, 1e-12)).max(axis=1)
        return largest

    def _shorten(self) -> None:
        """Shorten widths until each place keeps the largest bound of all corners that reach it."""
        s = self.polyline.s
        places = at = np.sort(np.concatenate([s[1:-1], 0.5 * (s[1:] + s[:-1])]))
        while True:
            bounds = np.zeros((len(at), 2))
            for corner, sample in self._pairs(at, self._places, self.widths):
                np.maximum.at(bounds, sample, self._bounds[corner])
            bad = at[self._excess(at, self.widths, bounds) > 1.0]
            if not len(bad):
                if at is places:
                    return
                at = places  # check all again: deviations that cancelled may no longer do so
                continue
            reach = np.searchsorted(bad, self._places + self.widths) > np.searchsorted(
                bad, self._places - self.widths
            )
            self.widths[reach] *= _SHORTENING
            at = bad

    def deviations(self, s: Floats) -> Floats:
        """Return the curve's deviations from the polyline (m, 2) [m], [rad] at places (m,)."""
        deviation = self.rows(s).x - self._on_polyline(s)[0]
        return _sizes(deviation)

    @staticmethod
    def _pairs(s: Floats, places: Floats, widths: Floats) -> Iterator[tuple[Indices, Indices]]:
        """Yield pairs of a corner and a sample within its width, as two arrays (p,) at a time."""
        low = np.searchsorted(s, places - widths, side='right')
        count = np.maximum(np.searchsorted(s, places + widths, side='left') - low, 0)
        ends = np.cumsum(count)
        first = 0
        while first < len(places):
            done = ends[first - 1] if first else 0
            last = max(first + 1, int(np.searchsorted(ends, done + _PAIRS, side='right')))
            counts = count[first:last]
            corner = np.repeat(np.arange(first, last), counts)
            before = np.repeat(np.cumsum(counts) - counts, counts)
            yield corner, np.arange(len(corner)) - before + low[corner]
            first = last


def _kernel_sums(u: Floats, w: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """
    Return the terms that a corner with a jump of 1 adds to the curve and its derivatives.

    :param u: distance from the corner, as a fraction of its width; ``w``: the width.
    """
    u2 = u * u
    rest = 1.0 - u2
    step = 0.5 + 0.9375 * u * (1.0 - u2 * (2.0 / 3.0 - u2 / 5.0))
    return (
        w * _even(u),
        step - (u >= 0.0),
        0.9375 * rest * rest / w,
        -3.75 * u * rest / (w * w),
    )


def _even(u: Floats) -> Floats:
    """Return E(u) for |u| <= 1: even, with its peak at 0."""
    v = np.abs(u)
    v2 = v * v
    even: Floats = PEAK + 0.9375 * v2 * (0.5 - v2 * (1.0 / 6.0 - v2 / 30.0)) - 0.5 * v
    return even


def _sizes(deviation: Floats) -> Floats:
    """Return distances [m] and angles [rad] (m, 2) of differences in R^7."""
    return np.stack(
        [
            length_rows(deviation[:, :3]),
            2.0 * length_rows(deviation[:, 3:]),
        ],
        axis=1,
    )
