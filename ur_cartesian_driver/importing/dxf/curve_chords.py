# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Chords of curves: lines that lie within a tolerance of rational Bézier curves.

The bound is proven, not sampled. A curve lies in the convex hull of its control points, so it is
no farther from its chord than these points. If the control points advance along the chord, so does
the curve, because a plane meets the curve no more often than the control polygon; then each point
of the chord has a point of the curve beside it, and the bound holds in both directions. (G.
Farin, Curves and Surfaces for CAGD: both properties hold for positive weights.) Each curve is
halved until every piece is within a small fraction of the tolerance of its chord.

Then pieces are merged greedily: a chord spans as many pieces as the remaining tolerance allows.
Only the ends of pieces are checked, because a polyline is farthest from a line at one of its
points, and its projection covers the whole line. A chord ends where the curve turns back by more
than the remaining tolerance.

Curves are arrays (m, n + 1, 4): m curves of degree n with control points (w x, w y, w z, w).
"""

from __future__ import annotations

from math import ceil, cos, pi, sin

import numpy as np

from ur_cartesian_driver.importing.simplification import farthest_row
from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats

#: Fraction of the tolerance for the pieces; a smaller one takes more time and saves few chords.
_FINE = 1.0 / 8.0
#: Chords of up to this many pieces are tried for all points at once; few chords have more.
_WINDOW = 10
_MAX_PIECES = 200_000
#: Rounding errors [m] of lengths along a chord.
_ROUNDING = 1e-12


def spline_curves(degree: int, knots: Floats, controls: Floats) -> Floats:
    """
    Return the Bézier curves of a B-spline, one for each knot span that is not empty.

    :param controls: (n, 4) weighted control points.
    :raises ValueError: degree, knots and control points do not define one continuous spline.
    """
    if degree < 1:
        raise ValueError(f'its degree is {degree}')
    if len(controls) <= degree or len(knots) != len(controls) + degree + 1:
        raise ValueError(
            f'degree {degree} and {len(controls)} control points need '
            f'{len(controls) + degree + 1} knots, and at least {degree + 1} points; '
            f'it has {len(knots)} knots'
        )
    if (np.diff(knots) < 0.0).any():
        raise ValueError('its knots do not rise')
    if not (controls[:, 3] > 0.0).all():
        raise ValueError('a weight is not positive')
    spans = np.flatnonzero(np.diff(knots[degree : len(controls) + 1]) > 0.0) + degree
    if not len(spans):
        raise ValueError('its knots are all the same')
    rows = spans[:, None] + np.arange(-degree, 1)
    curves = np.empty((len(spans), degree + 1, 4))
    for k in range(degree + 1):
        # Control point k is the blossom with k arguments at the span's end, the rest at its start.
        points = controls[rows]
        for r in range(1, degree + 1):
            at = knots[spans + 1 if r <= k else spans]
            low, high = knots[rows[:, r:]], knots[rows[:, r:] + degree + 1 - r]
            share = ((at[:, None] - low) / (high - low))[..., None]
            points = (1.0 - share) * points[:, :-1] + share * points[:, 1:]
        curves[:, k] = points[:, 0]
    gaps = np.linalg.norm(_places(curves[1:, 0]) - _places(curves[:-1, -1]), axis=1)
    if len(gaps) and gaps.max() > 1e-9 * (1.0 + np.abs(_places(controls)).max()):
        raise ValueError('its knots break it into parts')
    return curves


def ellipse_curves(a: Floats, b: Floats, centre: Floats, begin: float, sweep: float) -> Floats:
    """Return the Bézier curves of centre + a cos t + b sin t, t from begin to begin + sweep."""
    count = max(1, ceil(abs(sweep) / (0.5 * pi)))
    step = sweep / count
    weight = cos(0.5 * step)
    curves = np.empty((count, 3, 4))
    for i in range(count):
        for k, (t, w) in enumerate(((0.0, 1.0), (0.5, weight), (1.0, 1.0))):
            angle = begin + (i + t) * step
            # The end tangents meet at the middle control point: centre + (middle - centre) / w.
            curves[i, k, :3] = w * centre + cos(angle) * a + sin(angle) * b
            curves[i, k, 3] = w
    return curves


def chords(curves: Floats, tolerance: float) -> Floats:
    """
    Return the ends (k, 3) of chords of consecutive curves.

    :param tolerance: the largest distance [m] of the curves from the chords, and of the chords
        from the curves.
    :raises ValueError: there would be too many chords.
    """
    fine = _FINE * tolerance
    while True:
        is_bent = ~(_chord_errors(curves) <= fine)
        if not is_bent.any():
            break
        if len(curves) + int(is_bent.sum()) > _MAX_PIECES:
            raise ValueError('it would take too many lines; check the unit, or the tolerance')
        curves = _halved(curves, is_bent)
    points = _places(np.vstack((curves[:, 0], curves[-1:, -1])))
    return points[_merged(points, tolerance - fine)]


def _places(weighted: Floats) -> Floats:
    places: Floats = weighted[..., :3] / weighted[..., 3:]
    return places


def _chord_errors(curves: Floats) -> Floats:
    """Return bounds (m,) on the distances of curves from chords, and of chords from curves."""
    windows = _places(curves)
    windows = windows - windows[:, :1]
    off, along = _beside(windows)
    size = np.linalg.norm(windows, axis=2).max(axis=1)
    goes_on = (np.diff(along, axis=1) >= -_ROUNDING).all(axis=1)
    bound: Floats = np.where(goes_on, np.minimum(off.max(axis=1), size), size)
    return bound


def _beside(windows: Floats) -> tuple[Floats, Floats]:
    """
    Measure rows of points (m, k, 3) against the line from a row's first point to its last.

    :param windows: the rows; the first point of each has to be 0.
    :returns: the distances from the line, and the lengths along it, each (m, k).
    """
    chord = windows[:, -1:]
    length = np.sqrt(np.einsum('mij,mij->mi', chord, chord))
    chord = chord / np.where(length > 0.0, length, 1.0)[..., None]
    along = np.matmul(windows, chord.swapaxes(1, 2))[..., 0]
    off = windows - np.clip(along, 0.0, length)[..., None] * chord
    return np.sqrt(np.einsum('mij,mij->mi', off, off)), along


def _halved(curves: Floats, which: Flags) -> Floats:
    """Return the curves in order, with each marked curve split into two halves (de Casteljau)."""
    halves = curves[which]
    left, right = np.empty_like(halves), np.empty_like(halves)
    for k in range(curves.shape[1]):
        left[:, k], right[:, -1 - k] = halves[:, 0], halves[:, -1]
        halves = 0.5 * (halves[:, :-1] + halves[:, 1:])
    found = np.repeat(curves, 1 + which, axis=0)
    first = np.flatnonzero(which) + np.arange(which.sum())
    found[first], found[first + 1] = left, right
    return found


def _merged(points: Floats, tolerance: float) -> list[int]:
    """Return the rows of the points to keep; all others are near the lines between these."""
    last = len(points) - 1
    reach = np.minimum(np.arange(1, len(points) + 1), last)
    rows = np.arange(len(points))
    for count in range(2, _WINDOW + 1):  # for all rows at once
        rows = rows[rows + count <= last]
        rows = rows[_are_straight(points[rows[:, None] + np.arange(count + 1)], tolerance)]
        reach[rows] = rows + count
    found = [0]
    while found[-1] < last:
        start, end = found[-1], int(reach[found[-1]])
        if start + _WINDOW == end < last:
            farther = farthest_row(
                start,
                end + 1,
                last,
                lambda a, b: bool(_are_straight(points[None, a : b + 1], tolerance)[0]),
            )
            end = max(end, farther)
        found.append(end)
    return found


def _are_straight(windows: Floats, tolerance: float) -> Flags:
    """Return whether each row of points (m, k, 3) is near its chord and never turns back far."""
    off, along = _beside(windows - windows[:, :1])
    back = (np.maximum.accumulate(along, axis=1) - along).max(axis=1)
    straight: Flags = (off.max(axis=1) <= tolerance) & (back <= tolerance)
    return straight
