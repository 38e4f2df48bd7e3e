# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Time laws, judged by toppra and by differences.

``golden/toppra.json`` has the durations of toppra 0.6 for the paths of :func:`smooth_path`.
``python test/planning/rounded/test_time_law.py`` writes it, where toppra is installed.
"""

import json
from pathlib import Path

import numpy as np
import pytest

from ur_cartesian_driver.planning.rounded.time_law import (
    FastestLaw,
    LawLimits,
    lowered_over,
    TimeLaw,
)

GOLDEN = Path(__file__).parent / 'golden' / 'toppra.json'
PATHS, PLACES, DIMENSIONS = 100, 1001, 9
SPEEDS = np.array([0.25] * 3 + [2.0] * 6)
ACCELERATIONS = np.array([1.0] * 3 + [10.0] * 6)


def smooth_path(seed):
    """Return places (m,) and a path with sharp bends: x, x', x'' (m, 9)."""
    rng = np.random.default_rng(seed)
    s = np.linspace(0.0, 1.0, PLACES)
    phase = s[:, None, None]
    k = 2.0 * np.pi * rng.uniform(0.2, 3.0, (DIMENSIONS, 3))
    a = rng.normal(size=(DIMENSIONS, 3)) * np.where(np.arange(DIMENSIONS) < 3, 0.05, 0.3)[:, None]
    b = rng.uniform(0.0, 2.0 * np.pi, (DIMENSIONS, 3))
    x = (a * np.sin(k * phase + b)).sum(axis=2)
    d1 = (a * k * np.cos(k * phase + b)).sum(axis=2)
    d2 = -(a * k * k * np.sin(k * phase + b)).sum(axis=2)
    for place in rng.uniform(0.1, 0.9, 3):  # bends of a fiftieth of the path
        width, turn = 0.02, rng.normal(size=DIMENSIONS) * 0.2 * np.abs(d1).mean()
        t = np.tanh((s - place) / width)[:, None]
        x = x + turn * width * np.log(np.cosh((s - place) / width))[:, None]
        d1 = d1 + turn * t
        d2 = d2 + turn * (1.0 - t * t) / width
    return s, x, d1, d2


def limits_of(d1, d2):
    return LawLimits(
        speed=(SPEEDS / np.maximum(np.abs(d1), 1e-12)).min(axis=1),
        first=d1,
        second=d2,
        bound=np.broadcast_to(ACCELERATIONS, d1.shape),
        vectors=(),
    )


def fastest_law(s, limits):
    return FastestLaw(s, limits).squares(limits.speed, np.ones(len(s)))


def duration(s, y):
    v = np.sqrt(y)
    return float(np.sum(2.0 * np.diff(s) / (v[1:] + v[:-1])))


def toppra_duration(seed):
    """Return what toppra needs along a path [s]."""
    import toppra
    from toppra import algorithm, constraint

    s, x, d1, d2 = smooth_path(seed)

    class Path(toppra.interpolator.AbstractGeometricPath):
        dof, path_interval, waypoints = DIMENSIONS, np.array([s[0], s[-1]]), None

        def __call__(self, places, order=0):
            rows = (x, d1, d2)[order]
            found = np.stack([np.interp(np.atleast_1d(places), s, row) for row in rows.T], axis=1)
            return found[0] if np.ndim(places) == 0 else found

    solver = algorithm.TOPPRA(
        [
            constraint.JointVelocityConstraint(np.stack([-SPEEDS, SPEEDS], axis=1)),
            constraint.JointAccelerationConstraint(
                np.stack([-ACCELERATIONS, ACCELERATIONS], axis=1), discretization_scheme=0
            ),
        ],
        Path(),
        gridpoints=s,
        solver_wrapper='seidel',
    )
    _, sd, _ = solver.compute_parameterization(0.0, 0.0)
    return float(np.sum(2.0 * np.diff(s) / (sd[1:] + sd[:-1])))


def test_the_law_is_as_fast_as_that_of_toppra():
    golden = json.loads(GOLDEN.read_text())
    assert len(golden) == PATHS
    ratios = []
    for seed, known in enumerate(golden):
        s, _, d1, d2 = smooth_path(seed)
        ratios.append(duration(s, fastest_law(s, limits_of(d1, d2))) / known)
    assert min(ratios) > 0.98
    assert max(ratios) < 1.02


@pytest.mark.parametrize('seed', range(10))
def test_limits_are_kept_at_every_place(seed):
    s, _, d1, d2 = smooth_path(seed)
    y = fastest_law(s, limits_of(d1, d2))
    assert y[0] == y[-1] == 0.0
    assert (y[1:-1] > 0.0).all()
    assert np.abs(d1 * np.sqrt(y)[:, None] / SPEEDS).max() <= 1.0 + 1e-9
    u = 0.5 * np.diff(y) / np.diff(s)
    reached = np.abs(d1[:-1] * u[:, None] + d2[:-1] * y[:-1, None]) / ACCELERATIONS
    assert reached[1:].max() <= 1.0 + 1e-6


@pytest.mark.parametrize('seed', range(10))
def test_vectors_are_limited_by_their_length(seed):
    s, _, d1, d2 = smooth_path(seed)
    none = np.empty((len(s), 0))
    limit = np.full(len(s), 1.0)
    y = fastest_law(
        s,
        LawLimits(
            speed=0.25 / np.linalg.norm(d1[:, :3], axis=1),
            first=none,
            second=none,
            bound=none,
            vectors=((d1[:, :3], d2[:, :3], limit),),
        ),
    )
    u = 0.5 * np.diff(y) / np.diff(s)
    reached = np.linalg.norm(d1[:-1, :3] * u[:, None] + d2[:-1, :3] * y[:-1, None], axis=1)
    assert reached.max() <= 1.0 + 1e-6
    at_speed = np.sqrt(y) * np.linalg.norm(d1[:, :3], axis=1) > 0.2499
    # Somewhere it is at one of the limits.
    assert (at_speed[1:] | (reached > 0.99)).mean() > 0.95


def test_an_average_is_smooth_and_bounds_the_jerk():
    s, _, d1, d2 = smooth_path(1)
    window = 0.1
    law = TimeLaw(s, fastest_law(s, limits_of(d1, d2)), window)
    t = np.linspace(0.0, law.duration, 40_001)
    place, v, a = law.at(t)
    assert np.abs(place[[0, -1]] - s[[0, -1]]).max() < 1e-12
    assert (np.diff(place) >= 0.0).all()
    assert np.abs(np.gradient(place, t) - v)[1:-1].max() < 1e-4
    assert np.abs(np.gradient(v, t) - a)[1:-1].max() < 2e-2 * np.abs(a).max()
    assert v[[0, -1]].max() < 1e-9
    plain = 0.5 * np.diff(law._v**2) / np.diff(s)
    assert np.abs(np.gradient(a, t)).max() <= 1.01 * np.ptp(plain) / window


def test_the_time_of_a_place_is_when_it_is_passed():
    s, _, d1, d2 = smooth_path(2)
    law = TimeLaw(s, fastest_law(s, limits_of(d1, d2)), 0.05)
    places = np.linspace(s[0], s[-1], 101)[1:-1]
    assert np.abs(law.at(law.times_of(places)).s - places).max() < 1e-6


@pytest.mark.parametrize('reach', [0.0, 0.3, 2.0, 50.0])
def test_lowered_values_are_the_least_within_reach(reach):
    rng = np.random.default_rng(5)
    times, values = np.cumsum(rng.uniform(0.0, 1.0, 60)), rng.uniform(0.0, 1.0, 60)
    found = lowered_over(values, times, reach)
    assert found.tolist() == [values[np.abs(times - t) <= reach].min() for t in times]


if __name__ == '__main__':
    GOLDEN.write_text(json.dumps([round(toppra_duration(seed), 6) for seed in range(PATHS)]))
