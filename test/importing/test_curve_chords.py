# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Chords stay within the tolerance of the curves that scipy evaluates, and are not too many."""

from math import tau

from curve_distance import distances
import numpy as np
import pytest
from random_cases import cases, random_of
from scipy.interpolate import BSpline

from ur_cartesian_driver.importing.dxf.curve_chords import (
    chords,
    ellipse_curves,
    spline_curves,
)

TOLERANCE = 5e-5


def random_spline(random):
    """Return degree, knots and weighted control points [m], from a millimetre to a metre."""
    degree = random.randint(1, 11)
    count = degree + 1 + random.randint(0, 12)
    inner = sorted(random.choice((random.random(), 0.3, 0.5)) for _ in range(count - degree - 1))
    knots = [0.0] * (degree + 1) + inner + [1.0] * (degree + 1)
    if random.random() < 0.3 or max(map(inner.count, inner), default=0) > degree:
        knots = list(np.cumsum([random.random() for _ in range(count + degree + 1)]))  # free ends
    size = 10.0 ** random.uniform(-3.0, 0.0)
    points = np.array([[random.gauss(0.0, size) for _ in range(3)] for _ in range(count)])
    weights = np.ones(count)
    if random.random() < 0.5:
        weights = np.array([10.0 ** random.uniform(-1.5, 1.5) for _ in range(count)])
    return degree, np.array(knots), np.column_stack((points * weights[:, None], weights))


def spline_points(degree, knots, controls):
    """Return points on the curve by scipy, so dense that lines between them are the curve."""
    spline = BSpline(knots, controls, degree)
    first, last = knots[degree], knots[len(controls)]
    at = np.union1d(np.linspace(first, last, 2001), knots[(first < knots) & (knots < last)])
    return dense_points(lambda t: spline(t)[:, :3] / spline(t)[:, 3:], at)


def dense_points(curve, at):
    for _ in range(40):
        points, between = curve(at), 0.5 * (at[1:] + at[:-1])
        off = np.linalg.norm(curve(between) - 0.5 * (points[1:] + points[:-1]), axis=1)
        if (off < 0.01 * TOLERANCE).all():
            break
        at = np.union1d(at, between[off >= 0.01 * TOLERANCE])
    return curve(at)


def least_count(points):
    """Return how many chords a greedy search with the same tolerance takes, by points alone."""

    def holds(a, b):
        chord, off = points[b] - points[a], points[a : b + 1] - points[a]
        share = np.clip(off @ chord / max(float(chord @ chord), 1e-30), 0.0, 1.0)
        return np.linalg.norm(off - share[:, None] * chord, axis=1).max() <= TOLERANCE

    start, count, last = 0, 0, len(points) - 1
    while start < last:
        end, step = start + 1, 1
        while end < last and holds(start, min(end + step, last)):
            end, step = min(end + step, last), 2 * step
        while step:
            while end + step <= last and holds(start, end + step):
                end += step
            step //= 2
        start, count = end, count + 1
    return count


def check(curve, found):
    """Assert the tolerance in both directions, and the number of chords."""
    shares = np.linspace(0.0, 1.0, 21)[:, None, None]
    on_chords = (found[:-1] + shares * np.diff(found, axis=0)).reshape(-1, 3)
    slack = 1.01 * TOLERANCE  # of the samples
    assert distances(curve, [found], 0.5 * TOLERANCE).max() <= slack
    assert distances(on_chords, [curve], 0.5 * TOLERANCE).max() <= slack
    assert found[[0, -1]] == pytest.approx(curve[[0, -1]], abs=1e-9)
    assert len(found) - 1 <= 1.3 * least_count(curve) + 1


@pytest.mark.random
@pytest.mark.parametrize('case', range(cases(200)))
def test_splines_of_all_degrees(case):
    spline = random_spline(random_of('spline', case))
    check(spline_points(*spline), chords(spline_curves(*spline), TOLERANCE))


@pytest.mark.random
@pytest.mark.parametrize('case', range(cases(100)))
def test_ellipses_and_their_images_under_a_shear(case):
    random = random_of('ellipse', case)
    length = 10.0 ** random.uniform(-3.0, 0.0)
    a = np.array([length, 0.0, 0.0])
    b = length * np.array([random.choice((0.0, random.uniform(-1, 1))), random.random(), 0.1])
    begin, sweep = random.uniform(0.0, tau), random.choice((tau, random.uniform(0.01, tau)))
    at = np.linspace(begin, begin + sweep, 1001)
    curve = dense_points(lambda t: np.outer(np.cos(t), a) + np.outer(np.sin(t), b), at)
    check(curve, chords(ellipse_curves(a, b, np.zeros(3), begin, sweep), TOLERANCE))


def test_a_straight_spline_is_one_line():
    controls = np.array([[x, 2.0 * x, 0.0, 1.0] for x in (0.0, 0.1, 0.1, 0.3, 1.0)])
    curves = spline_curves(3, np.array([0.0, 0, 0, 0, 0.5, 1, 1, 1, 1]), controls)
    assert chords(curves, TOLERANCE) == pytest.approx(np.array([[0.0, 0, 0], [1, 2, 0]]))


def test_a_cusp_is_reached():
    """At (0.5, 0.75) the curve comes to rest and turns back."""
    controls = np.array([[0.0, 0, 0, 1], [1, 1, 0, 1], [0, 1, 0, 1], [1, 0, 0, 1]])
    found = chords(controls[None], TOLERANCE)
    assert np.linalg.norm(found - [0.5, 0.75, 0.0], axis=1).min() < TOLERANCE
