# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Rounded polylines, judged by numerical averages, differences, and the distances of points."""

from curve_distance import distances
import numpy as np
import pytest

from ur_cartesian_driver.planning.rounded.rounded_path import MIN_WIDTH, Polyline, RoundedPath

WIDEST = 0.02
IDENTITY = (0.0, 0.0, 0.0, 1.0)


def polyline(points, bound, turn_bound=0.02, quaternions=None):
    """Return a polyline through positions (n, 3), measured by its length."""
    points = np.asarray(points, dtype=float)
    if quaternions is None:
        quaternions = np.tile(IDENTITY, (len(points), 1))
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return Polyline(
        s=np.concatenate([[0.0], np.cumsum(steps)]),
        rows=np.hstack([points, quaternions]),
        bounds=np.tile([bound, turn_bound], (len(points), 1)),
    )


def random_walk(seed, count=60):
    """Return points with corners of all angles, on segments from 0.1 mm to 0.1 m."""
    rng = np.random.default_rng(seed)
    steps = rng.normal(size=(count, 3))
    lengths = 10.0 ** rng.uniform(-4.0, -1.0, count)
    steps *= (lengths / np.linalg.norm(steps, axis=1))[:, None]
    return np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])


def on_polyline(line, s):
    return np.stack([np.interp(s, line.s, column) for column in line.rows.T], axis=1)


@pytest.mark.parametrize('angle', [0.01, 0.5, np.pi / 2, 3.0, np.pi])
def test_a_corner_is_the_average_over_its_width(angle):
    line = polyline(
        [(0, 0, 0), (0.1, 0, 0), (0.1 + np.cos(angle) / 10, np.sin(angle) / 10, 0)], 1e-4
    )
    path = RoundedPath(line, WIDEST)
    (width,) = path.widths
    u = np.linspace(-1.0, 1.0, 20_001)
    kernel = 15.0 / 16.0 * (1.0 - u * u) ** 2
    places = np.linspace(0.1 - 1.2 * width, 0.1 + 1.2 * width, 41)
    averages = [
        np.trapezoid(kernel[:, None] * on_polyline(line, s + width * u), u, axis=0) for s in places
    ]
    assert np.abs(path.rows(places).x - averages).max() < 1e-9


@pytest.mark.parametrize('seed', range(5))
def test_derivatives_are_those_of_the_curve(seed):
    path = RoundedPath(polyline(random_walk(seed), 1e-3), WIDEST)
    s = np.sort(np.random.default_rng(seed).uniform(0.0, path.polyline.s[-1], 200))
    step = 0.01 * path.widths.min()
    before, at, after = (path.rows(s + k * step) for k in (-1, 0, 1))
    for order in range(3):
        difference = (after[order] - before[order]) / (2.0 * step)
        size = np.abs(at[order + 1]).max()
        assert np.abs(difference - at[order + 1]).max() < 1e-2 * size


@pytest.mark.parametrize('bound', [2e-5, 5e-4, 1e-2])
@pytest.mark.parametrize('seed', range(8))
def test_the_curve_keeps_its_bound_and_its_ends(seed, bound):
    line = polyline(random_walk(seed), bound)
    path = RoundedPath(line, WIDEST)
    s = np.linspace(0.0, line.s[-1], 20_001)
    s = np.sort(np.concatenate([s, line.s, line.s[path.corners] + 0.3 * path.widths]))
    rows = path.rows(s)
    assert distances(rows.x[:, :3], [line.rows[:, :3]]).max() <= 1.02 * bound
    assert np.abs(rows.x[[0, -1]] - line.rows[[0, -1]]).max() < 1e-12
    assert (path.widths >= 0.0).all()
    # It uses what it may: the sharp corners of long segments come close to the bound.
    if bound < 1e-3:
        assert path.deviations(line.s).max() > 0.8 * bound


def test_lines_are_followed_exactly_outside_of_corners():
    line = polyline([(0, 0, 0), (0.1, 0, 0), (0.1, 0.1, 0), (0.2, 0.1, 0.05)], 1e-3)
    path = RoundedPath(line, WIDEST)
    s = np.linspace(0.0, line.s[-1], 3001)
    outside = np.all(np.abs(s[:, None] - line.s[path.corners]) > path.widths, axis=1)
    assert 0.5 < outside.mean() < 1.0
    rows = path.rows(s[outside])
    assert np.abs(rows.x - on_polyline(line, s[outside])).max() < 1e-15
    assert not rows.d2.any()


def test_a_circle_of_short_chords_is_a_smooth_circle():
    radius, bound = 0.005, 5e-5
    angle = np.linspace(0.0, 2.0 * np.pi, 200)
    line = polyline(radius * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1), bound)
    path = RoundedPath(line, WIDEST)
    s = np.linspace(0.0, line.s[-1], 5001)
    rows = path.rows(s)
    off = np.linalg.norm(rows.x[:, :2], axis=1) - radius
    assert -bound - 2e-6 < off.min() < off.max() < 1e-6
    inside = (s > 0.005) & (s < line.s[-1] - 0.005)
    curvature = np.linalg.norm(rows.d2[inside, :3], axis=1)
    assert np.abs(curvature * radius - 1.0).max() < 0.05


def test_noise_of_a_file_is_smoothed_within_the_bound():
    rng = np.random.default_rng(3)
    x = np.arange(0.0, 0.05, 2e-4)
    points = np.stack([x, 1e-5 * rng.standard_normal(len(x)), 0.0 * x], axis=1)
    rough = np.abs(np.diff(np.arctan2(*np.diff(points, axis=0).T[[1, 0]]))).max() / 2e-4
    path = RoundedPath(polyline(points, 5e-5), WIDEST)
    s = np.linspace(0.005, 0.045, 4001)
    assert np.linalg.norm(path.rows(s).d2, axis=1).max() < 0.05 * rough


def test_position_and_orientation_go_through_a_corner_together():
    half = np.array([0.0, 0.1, 0.2])
    quaternions = np.stack([np.sin(half / 2), 0 * half, 0 * half, np.cos(half / 2)], axis=1)
    quaternions[2] = (0.0, 0.0, np.sin(0.05), np.cos(0.05))
    line = polyline(
        [(0, 0, 0), (0.1, 0, 0), (0.1, 0.1, 0)], 1e-2, turn_bound=1e-3, quaternions=quaternions
    )
    path = RoundedPath(line, WIDEST)
    _, turn = path.deviations(line.s).max(axis=0)
    assert 0.8e-3 < turn <= 1e-3
    alone = RoundedPath(polyline(line.rows[:, :3], 1e-2), WIDEST)
    assert path.widths[0] < alone.widths[0]  # the orientation needs the narrower corner


def test_corners_near_the_ends_leave_room_for_them():
    line = polyline([(0, 0, 0), (1e-4, 0, 0), (1e-4, 0.1, 0), (1e-4, 0.1, 2e-5)], 1e-3)
    path = RoundedPath(line, WIDEST)
    assert path.widths[0] <= 1e-4
    assert MIN_WIDTH < path.widths[1] <= 2e-5 + 1e-15
    assert np.abs(path.rows(line.s[[0, -1]]).x - line.rows[[0, -1]]).max() < 1e-15
