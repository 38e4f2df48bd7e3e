# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The bound of simplify holds in both directions, as an independent sampling measures."""

from math import cos, pi, sin
import os

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from ur_cartesian_driver.importing.imported_path import PathCollector
from ur_cartesian_driver.importing.simplification import MAX_TURN, simplify
from ur_cartesian_driver.motion.goal.goal import IOCommand, OutputKind, SegmentType

cKDTree = pytest.importorskip('scipy.spatial').cKDTree
EXAMPLES = int(os.environ.get('IMPORT_EXAMPLES', '30'))
DOWN = (0.5**0.5, 0.5**0.5, 0.0, 0.0)


def path_of(points, speeds=None, outputs=()):
    into = PathCollector()
    for i, point in enumerate(points):
        into.add(i + 1, point, quaternion=DOWN, speed=None if speeds is None else speeds[i])
        if i in outputs:
            into.switch(
                IOCommand(
                    waypoint=0, offset=0.0, output=OutputKind.STANDARD_DIGITAL, pin=1, value=1.0
                )
            )
    return into.path()


def sampled(path, spacing):
    """Return places on lines and arcs, no farther apart than the spacing."""
    found = [path.positions[:1]]
    for i in range(1, len(path)):
        a, b = path.positions[i - 1], path.positions[i]
        if path.types[i] == SegmentType.CIRCULAR:
            found.append(circle_places(a, path.vias[i], b, spacing))
        else:
            count = max(2, int(np.linalg.norm(b - a) / spacing) + 2)
            found.append(a + np.linspace(0.0, 1.0, count)[:, None] * (b - a))
    return np.vstack(found)


def circle_places(a, m, b, spacing):
    # The centre solves three linear equations; written apart from the code under test.
    n = np.cross(m - a, b - a)
    centre = np.linalg.solve(
        np.array([m - a, b - a, n]),
        np.array([(m - a) @ (m + a) / 2, (b - a) @ (b + a) / 2, n @ a]),
    )
    u = a - centre
    v = np.cross(n / np.linalg.norm(n), u)
    angle = np.arctan2((b - centre) @ v, (b - centre) @ u) % (2.0 * pi)
    t = np.linspace(0.0, angle, int(angle * np.linalg.norm(u) / spacing) + 2)[:, None]
    return centre + np.cos(t) * u + np.sin(t) * v


def farthest(places, others):
    return cKDTree(others).query(places)[0].max()


def assert_within(old, new, tolerance):
    spacing = tolerance / 10.0
    a, b = sampled(old, spacing), sampled(new, spacing)
    # Samples are at most half a spacing beside the nearest place.
    assert max(farthest(a, b), farthest(b, a)) <= tolerance + 0.5 * spacing


@st.composite
def walks(draw):
    """Lines and arcs with noise, sometimes corners, loops and turns back."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    step = draw(st.sampled_from([3e-4, 1e-3]))
    heading, place, points = 0.0, np.zeros(3), []
    for _ in range(draw(st.integers(1, 4))):
        curvature = draw(st.sampled_from([0.0, 20.0, -60.0, 200.0]))
        climb = draw(st.sampled_from([0.0, 0.0, 0.3]))
        heading += draw(st.sampled_from([0.0, 0.0, 1.0, pi]))
        for _ in range(draw(st.integers(1, 25))):
            place = place + step * np.array([cos(heading), sin(heading), climb])
            heading += curvature * step
            points.append(place)
    noise = draw(st.sampled_from([0.0, 1e-5, 1e-4]))
    return np.array(points) + noise * rng.uniform(-1.0, 1.0, (len(points), 3))


@settings(max_examples=EXAMPLES, deadline=None)
@given(walks(), st.sampled_from([5e-5, 2e-4]))
def test_no_place_is_farther_away_than_the_tolerance(points, tolerance):
    old = path_of(points)
    new = simplify(old, tolerance, old.quaternions)
    assert_within(old, new, tolerance)
    assert (new.positions[[0, -1]] == old.positions[[0, -1]]).all()


def test_a_polygon_becomes_the_circle_that_it_was_made_of():
    t = np.linspace(0.0, 2.0 * pi, 721)
    points = np.stack((0.05 * np.cos(t), 0.05 * np.sin(t), 0.0 * t), axis=1)
    new = simplify(path_of(points), 1e-4, np.tile(DOWN, (721, 1)))
    assert len(new) <= 5
    assert (new.types[1:] == SegmentType.CIRCULAR).all()
    assert np.linalg.norm(new.vias[1:], axis=1) == pytest.approx(0.05, abs=1e-6)


def test_a_straight_row_becomes_one_line():
    points = np.stack([np.linspace(0.0, 0.1, 100), np.zeros(100), np.zeros(100)], axis=1)
    assert len(simplify(path_of(points), 1e-5, np.tile(DOWN, (100, 1)))) == 2


def test_points_with_an_output_or_another_speed_stay():
    points = np.stack([np.linspace(0.0, 0.1, 11), np.zeros(11), np.zeros(11)], axis=1)
    old = path_of(points, speeds=[0.1] * 6 + [0.2] * 5, outputs=(3,))
    new = simplify(old, 1e-3, old.quaternions)
    assert new.positions[:, 0] == pytest.approx([0.0, 0.03, 0.05, 0.1])
    assert new.speeds.tolist() == [0.1, 0.1, 0.1, 0.2]
    assert [output.waypoint for output in new.outputs] == [1]


def test_a_turn_of_the_tool_that_is_not_even_stays():
    points = np.stack([np.linspace(0.0, 0.1, 11), np.zeros(11), np.zeros(11)], axis=1)
    angles = np.where(np.arange(11) < 5, 0.0, 0.3 * (np.arange(11) - 5))
    turns = np.stack(
        (np.zeros(11), np.zeros(11), np.sin(angles / 2.0), np.cos(angles / 2.0)), axis=1
    )
    new = simplify(path_of(points), 1e-3, turns)
    kept = new.lines - 1
    shown = np.interp(np.arange(11), kept, angles[kept])
    assert np.abs(shown - angles).max() <= MAX_TURN + 1e-9
    assert len(new) == 3
