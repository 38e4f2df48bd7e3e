# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
A polyline of poses with rounded corners, in closed form.

The polyline x(s) is in R^7: positions and unit quaternions, whose chords are short enough to be
taken for arcs. At its vertex j the derivative jumps by d_j. Averaged with the kernel
k(u) = 15/16 (1 - u^2)^2 over a width w_j to both sides, a corner alone becomes

    x(s) + d_j w_j E((s - s_j) / w_j),    E(u) = G(u) - max(u, 0),    G'' = k,

which leaves the polyline only within the width, by d_j w_j E(0) at most. Corners add up, so the
same sum also holds where widths overlap: a chain of short chords becomes one smooth curve. All of
it is three times continuously differentiable, and its second derivative is the sum of the kernels
d_j k / w_j: curvature that grows from 0 and falls back to 0.

Widths are as large as the bounds of the vertices allow: first each as if its neighbours had the
same width, which settles chains, then shortened together wherever the true sum still exceeds a
bound.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats, Indices

#: Deviation of a corner from the polyline, as a part of jump times width.
PEAK = 5.0 / 32.0
#: The least width that samples resolve [m], and the ratio of the levels of density.
MIN_WIDTH = 2e-6
_RATIO = 1.5
#: Part of a bound that is aimed at, so that few sums exceed it; rounds, and steps of a round.
_AIM = 0.95
_ROUNDS = 10
_STEPS = 0.5, 1.3
#: With more corners than this within a width, samples may be this much farther apart.
_MANY, _SMOOTHER = 5, 2.4
#: Largest change of the width along the path.
_MAX_SLOPE = 0.5
#: How much widths are shortened at a time where a sum exceeds its bound.
_SHORTENING = 0.85
#: Smaller jumps are rounding.
_NO_JUMP = 1e-9
#: Pairs of corners and samples at a time, which bounds the memory.
_PAIRS = 1_000_000


class PathRows(NamedTuple):
    """A curve in R^7 and its first three derivatives by s at m places, (m, 7) each."""

    x: Floats
    d1: Floats
    d2: Floats
    d3: Floats


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Polyline:
    """A polyline from rest to rest."""

    #: (n,) increasing; any length that combines travel [m] and turn.
    s: Floats
    #: (n, 7) positions [m] and quaternions x y z w of one hemisphere.
    rows: Floats
    #: (n, 2) how far the rounded path may be beside each vertex [m], [rad].
    bounds: Floats

    @property
    def slopes(self) -> Floats:
        """(n - 1, 7) the derivative on each chord."""
        slopes: Floats = np.diff(self.rows, axis=0) / np.diff(self.s)[:, None]
        return slopes


class RoundedPath:
    """
    A polyline whose corners are rounded within their bounds. Immutable.

    :param max_width: rounding needs no larger width than this.
    """

    def __init__(self, polyline: Polyline, max_width: float) -> None:
        """Choose the widths."""
        self.polyline = polyline
        slopes = polyline.slopes
        jumps = np.diff(slopes, axis=0)
        sizes = np.linalg.norm(jumps[:, :3], axis=1), 2.0 * np.linalg.norm(jumps[:, 3:], axis=1)
        corners = np.flatnonzero(np.maximum(*sizes) > _NO_JUMP) + 1
        self._slopes = slopes
        self._places = polyline.s[corners]
        self._jumps = jumps[corners - 1]
        #: The columns of R^7 that have any corner: a tool that does not turn saves four.
        self._columns = np.flatnonzero(self._jumps.any(axis=0))
        self._bounds = polyline.bounds[corners]
        self.corners: Indices = corners
        #: (c,) to both sides of each corner.
        self.widths = self._choose(max_width)
        self._shorten()

    # ---- the curve ----------------------------------------------------------------------------

    def rows(self, s: Floats) -> PathRows:
        """Return the curve at places (m,), which must not decrease."""
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
        Return how dense samples have to be between consecutive places (m,), (m - 1,).

        :param part: of the least width that reaches there.
        :param longest: spacing where nothing is rounded.
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
        """Return the places of corners that are rounded by themselves, not as one of a chain."""
        return self._places[self._is_sharp()]

    def _is_sharp(self) -> Flags:
        before = np.searchsorted(self._places, self._places - self.widths)
        after = np.searchsorted(self._places, self._places + self.widths)
        sharp: Flags = after - before <= _MANY
        return sharp

    # ---- widths -------------------------------------------------------------------------------

    def _choose(self, max_width: float) -> Floats:
        """Return widths with which each corner just keeps its own bound."""
        s, places = self.polyline.s, self._places
        largest = np.minimum(np.minimum(places - s[0], s[-1] - places), max_width)
        alone = self._bounds / np.maximum(PEAK * _sizes(self._jumps), 1e-12)
        widths = self._evened(np.minimum(alone.min(axis=1), largest))
        for _ in range(_ROUNDS):
            excess = self._excess(places, widths, self._bounds)
            step = np.clip(np.maximum(excess / _AIM, 1e-6) ** -0.5, *_STEPS)
            widths = self._evened(np.minimum(widths * step, largest))
        return widths

    def _evened(self, widths: Floats) -> Floats:
        """Return widths lowered until neighbours differ little: only then does noise cancel."""
        rise = _MAX_SLOPE * self._places
        before = np.minimum.accumulate(widths - rise) + rise
        after = np.minimum.accumulate((widths + rise)[::-1])[::-1] - rise
        return np.minimum(before, after)

    def _excess(self, at: Floats, widths: Floats, bounds: Floats) -> Floats:
        """Return the deviations at places (m,), as parts of their bounds (m, 2)."""
        deviation = np.zeros((len(at), 7))
        for corner, sample in self._pairs(at, self._places, widths):
            w = widths[corner]
            u = (at[sample] - self._places[corner]) / w
            self._add(deviation, sample, w * _even(u), corner)
        largest: Floats = (_sizes(deviation) / np.maximum(bounds, 1e-12)).max(axis=1)
        return largest

    def _shorten(self) -> None:
        """Shorten widths until every place keeps the bound of a corner that reaches there."""
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
                at = places  # corners that compensated each other may have lost their balance
                continue
            reach = np.searchsorted(bad, self._places + self.widths) > np.searchsorted(
                bad, self._places - self.widths
            )
            self.widths[reach] *= _SHORTENING
            at = bad

    def deviations(self, s: Floats) -> Floats:
        """Return how far the curve is from the polyline at places (m,), (m, 2) [m], [rad]."""
        deviation = self.rows(s).x - self._on_polyline(s)[0]
        return _sizes(deviation)

    @staticmethod
    def _pairs(s: Floats, places: Floats, widths: Floats) -> Iterator[tuple[Indices, Indices]]:
        """Yield the corners and the samples (p,) that they reach, some pairs at a time."""
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
    """Return what a corner adds to the curve and its derivatives, for a jump of 1."""
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
            np.linalg.norm(deviation[:, :3], axis=1),
            2.0 * np.linalg.norm(deviation[:, 3:], axis=1),
        ],
        axis=1,
    )
