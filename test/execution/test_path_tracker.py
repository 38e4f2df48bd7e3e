# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The position of the controller on the path, and the planned pose of the tool."""

import itertools
from math import cos, inf, pi, sin

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

from ur_cartesian_driver.execution.monitoring.path_tracker import (
    LAG_DISTANCE,
    LAG_TIME,
    PathPosition,
    PathTracker,
)
from ur_cartesian_driver.motion.geometry.pose import Pose, quaternion_from_rotation_vector
from ur_cartesian_driver.motion.geometry.vectors import ZERO6
from ur_cartesian_driver.motion.plan.plan import ReferencePath

DOWN = quaternion_from_rotation_vector((pi, 0.0, 0.0))


def path(*positions, quaternions=None, points=None, **rest):
    quaternions = quaternions or [DOWN] * len(positions)
    poses = np.array([[*p, *q] for p, q in zip(positions, quaternions, strict=True)])
    points = points or [max(0, i - 1) for i in range(len(positions))]
    return ReferencePath(
        poses=poses,
        point=np.array(points, dtype=np.int32),
        time=np.arange(len(positions), dtype=float),
        **rest,
    )


SQUARE = [(0.4, 0.0, 0.2), (0.6, 0.0, 0.2), (0.6, 0.2, 0.2), (0.4, 0.2, 0.2), (0.4, 0.0, 0.2)]


def running(begun):
    """Return the points of the motions that run when so many have begun, one for each point."""
    return (begun - 1, max(begun - 2, -1)) if begun else None


def walk(tracker, positions, begun=lambda i: 0, step=0.002):
    for i, position in enumerate(positions):
        tracker.update(Pose(position, DOWN), step, running(begun(i)))
        yield tracker.pose().position


def along(corners, n=100):
    for a, b in itertools.pairwise(corners):
        for i in range(n):
            f = (i + 1) / n
            yield tuple(x + f * (y - x) for x, y in zip(a, b, strict=True))


def test_a_tool_on_the_path_is_where_the_tracker_says():
    tracker = PathTracker(path(*SQUARE))
    for actual, found in zip(along(SQUARE), walk(tracker, along(SQUARE)), strict=True):
        assert found == pytest.approx(actual, abs=1e-12)
    assert tracker.path_position.row == tracker.last_row
    assert tracker.waypoint() == 3


def test_a_tool_beside_the_path_is_compared_with_the_foot_of_the_perpendicular():
    tracker = PathTracker(path(*SQUARE))
    shifted = [(x, y, z + 0.001) for x, y, z in along(SQUARE[:2])]
    for actual, found in zip(shifted, walk(tracker, shifted), strict=True):
        assert found == pytest.approx((actual[0], actual[1], 0.2), abs=1e-12)


def test_a_way_back_over_the_same_line_is_followed_in_order():
    there_and_back = [(0.4, 0.0, 0.2), (0.6, 0.0, 0.2), (0.4, 0.0, 0.2)]
    tracker = PathTracker(path(*there_and_back))
    times = []
    for _ in walk(tracker, along(there_and_back)):
        times.append(tracker.time())
    assert times == sorted(times)
    assert times[99] == pytest.approx(1.0, abs=0.03)
    assert times[-1] == pytest.approx(2.0)


def test_a_target_that_comes_to_a_turn_slowly_is_followed_into_it_though_the_way_back_is_nearer():
    there, end, back = (0.4, 0.0, 0.2), (0.42, 0.0, 0.2), (0.4, 0.0, 0.200002)
    tracker = PathTracker(path(there, end, back))
    target = [(x, y, z + 1e-6) for x, y, z in along([there, end, there])]
    for actual, found in zip(target, walk(tracker, target, step=4e-4), strict=True):
        assert found == pytest.approx(actual, abs=1e-5)


def test_the_program_s_own_count_keeps_the_tracker_from_running_ahead():
    there_and_back = [(0.4, 0.0, 0.2), (0.6, 0.0, 0.2), (0.4, 0.0, 0.2)]
    tracker = PathTracker(path(*there_and_back))
    for _ in walk(tracker, along(there_and_back[:2]), begun=lambda i: 1, step=1.0):
        assert tracker.time() <= 1.0


def test_the_program_s_own_count_pulls_the_tracker_past_points_that_were_missed():
    tracker = PathTracker(path(*SQUARE))
    tracker.update(Pose((0.6, 0.2, 0.2), DOWN), 0.0, running(4))
    assert tracker.pose().position == (0.6, 0.2, 0.2)


def test_a_pure_rotation_is_followed():
    turns = [quaternion_from_rotation_vector((0.0, 0.0, 0.2 * i)) for i in range(6)]
    tracker = PathTracker(path(*[(0.4, 0.0, 0.2)] * 6, quaternions=turns))
    for i in range(101):
        angle = i / 100
        tracker.update(Pose((0.4, 0.0, 0.2), quaternion_from_rotation_vector((0, 0, angle))), 0.01)
        assert tracker.time() == pytest.approx(angle / 0.2, abs=1e-3)


@given(st.floats(-0.002, 0.002), st.floats(0.01, 0.99))
def test_the_nearest_place_of_a_circle_is_on_its_radius(offset, part):
    angles = np.linspace(0.0, 2.0, 401)
    tracker = PathTracker(path(*[(0.4 + 0.1 * cos(a), 0.1 * sin(a), 0.2) for a in angles]))
    a = 2.0 * part
    r = 0.1 + offset
    tracker.update(Pose((0.4 + r * cos(a), r * sin(a), 0.2), DOWN), 0.3)
    x, y, _ = tracker.pose().position
    assert (x - 0.4, y) == pytest.approx((0.1 * cos(a), 0.1 * sin(a)), abs=1e-5)


def test_quaternions_of_either_sign_are_the_same_orientation():
    x, y, z, w = DOWN
    flipped = (-x, -y, -z, -w)
    tracker = PathTracker(path(*SQUARE, quaternions=[DOWN, flipped, DOWN, flipped, DOWN]))
    tracker.update(Pose((0.5, 0.0, 0.2), flipped), 0.2)
    assert tracker.time() == pytest.approx(0.5)
    assert tracker.pose().angle_to(Pose((0, 0, 0), DOWN)) < 1e-9


FAST = (0.1, 0.0, 0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize('side', [1.0, -1.0])
@pytest.mark.parametrize(
    ('twist', 'lag'), [(ZERO6, LAG_DISTANCE), (FAST, LAG_DISTANCE + 0.1 * LAG_TIME)]
)
def test_the_tool_may_lag_as_its_speed_explains_and_not_more(twist, lag, side):
    tracker = PathTracker(path(*SQUARE))
    tracker.update(Pose((0.5, 0.0, 0.2), DOWN), 0.2)
    near, far = 0.5 + 0.9 * side * lag, 0.5 + side * (lag + 0.003)
    assert tracker.desired(Pose((near, 0.0, 0.2), DOWN), twist).position == pytest.approx(
        (near, 0.0, 0.2)
    )
    assert tracker.desired(Pose((far, 0.0, 0.2), DOWN), twist).position == pytest.approx(
        (0.5 + side * lag, 0.0, 0.2)
    )


def test_a_tool_that_is_pushed_around_moves_nothing_but_itself():
    tracker = PathTracker(path(*SQUARE))
    tracker.update(Pose((0.5, 0.0, 0.2), DOWN), 0.2)
    for _ in range(50):
        tracker.desired(Pose((0.59, 0.05, 0.2), DOWN), FAST)
    assert tracker.time() == pytest.approx(0.5)


@pytest.mark.parametrize('x', [0.4, 0.6])
def test_there_is_no_lag_before_the_start_or_behind_the_end(x):
    line = path((0.4, 0.0, 0.2), (0.6, 0.0, 0.2))
    tracker = PathTracker(line)
    tracker.update(Pose((x, 0.0, 0.2), DOWN), 0.2)
    outside = x + (0.01 if x > 0.5 else -0.01)
    assert tracker.desired(Pose((outside, 0.0, 0.2), DOWN), FAST).position == pytest.approx(
        (x, 0.0, 0.2)
    )


def test_a_rotation_lags_as_a_translation_does():
    turns = [quaternion_from_rotation_vector((0.0, 0.0, angle)) for angle in (0.0, 0.1)]
    tracker = PathTracker(path(*[(0.4, 0.0, 0.2)] * 2, quaternions=turns))
    tracker.update(Pose((0.4, 0.0, 0.2), quaternion_from_rotation_vector((0, 0, 0.05))), 0.1)
    behind = Pose((0.4, 0.0, 0.2), quaternion_from_rotation_vector((0, 0, 0.04)))
    assert tracker.desired(behind, (0, 0, 0, 0, 0, 1.0)).angle_to(behind) < 1e-4


def test_a_target_within_the_blend_tolerance_is_on_the_plan():
    blend_tolerance = np.array([[0.0, 0.0], [0.003, 0.1], [0.0, 0.0]])
    corner = (0.4, 0.0, 0.2), (0.5, 0.0, 0.2), (0.5, 0.1, 0.2)
    beside = Pose((0.45, 0.0, 0.204), quaternion_from_rotation_vector((pi + 0.15, 0.0, 0.0)))
    for allowed, expected in ((None, (0.004, 0.15)), (blend_tolerance, (0.001, 0.05))):
        tracker = PathTracker(
            path(*corner, **({} if allowed is None else {'blend_tolerance': allowed}))
        )
        tracker.update(beside, 0.2)
        assert tracker.deviation(beside) == pytest.approx(expected, abs=1e-6)


@given(st.integers(0, 2**32 - 1))
def test_few_edges_are_searched_as_many_are(seed):
    draw = np.random.default_rng(seed)
    quaternions = draw.normal(size=(4, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1)[:, None]
    tracker = PathTracker(path(*draw.normal(size=(4, 3)), quaternions=list(quaternions)))
    point, lowest, highest = draw.normal(size=7), draw.uniform(0.0, 0.5), draw.uniform(0.5, 1.0)
    many, far = tracker._nearest_of_many(tuple(point.tolist()), 0, 3, lowest, highest)
    few, off = tracker._nearest(tuple(point.tolist()), 0, 3, lowest, highest)
    assert (few.row, few.fraction) == (many.row, pytest.approx(many.fraction, abs=1e-12))
    assert off == pytest.approx(far, abs=1e-12)


@given(st.integers(0, 2**32 - 1))
def test_a_target_surely_within_bounds_deviates_by_less(seed):
    draw = np.random.default_rng(seed)
    quaternions = draw.normal(size=(2, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1)[:, None]
    end_times = [(0.4, 0.0, 0.2), (0.5, 0.0, 0.2)]
    tracker = PathTracker(path(*end_times, quaternions=list(quaternions)))
    path_position = tracker.pose(PathPosition(0, draw.uniform(0.0, 1.0)))
    size = 10.0 ** draw.uniform(-6.0, -1.0)
    target = path_position @ Pose(
        tuple(size * draw.normal(size=3)),
        quaternion_from_rotation_vector(10.0 * size * draw.normal(size=3)),
    )
    tracker.update(target, 1.0)
    distance, angle = tracker.deviation(target)
    for part in (0.5, 0.99):  # neither limit is kept, then one of them is not
        assert not tracker.is_within(part * distance, part * angle)
        assert not tracker.is_within(inf, part * angle)
        assert not tracker.is_within(part * distance, inf)
    assert tracker.is_within(2.0 * tracker.residual, 20.0 * tracker.residual)


def test_a_target_on_the_plan_is_surely_near_it():
    tracker = PathTracker(path(*SQUARE))
    tracker.update(Pose((0.45, 0.0, 0.2001), DOWN), 0.1)
    assert tracker.is_within(0.00021, inf)


def test_a_robot_that_says_it_is_anywhere_is_somewhere_on_the_path():
    """Also where rows are all but the same, so that the way there is any number of their edges."""
    rows = [(0.4 + i * 1e-4, 0.0, i * 1e-155) for i in range(2)] + [
        (0.4001, 0.0, i * 1e-155) for i in range(2, 40)
    ]
    tracker = PathTracker(path(*rows))
    tracker.update(Pose((0.4, 0.0, 1e160), DOWN), 1e161)
    assert 0 <= tracker.path_position.row < len(rows)


@pytest.mark.parametrize('turn', [90, 170, 200, 270, 350])
def test_the_path_behind_is_found_however_far_the_tool_has_turned(turn):
    halves = 0.5 * np.radians(turn) * np.linspace(0.0, 1.0, 101)
    # As planning makes them: each has the sign of the one before it.
    quaternions = [(0.0, 0.0, sin(half), cos(half)) for half in halves]
    whole = path(*[(0.002 * i, 0.0, 0.2) for i in range(101)], quaternions=quaternions)
    tracker = PathTracker(whole)
    tracker.path_position = PathPosition(95, 0.5)
    retracted = Pose((0.002 * 92, 0.0, 0.2), quaternions[92])
    found = tracker.behind(retracted)
    assert found.distance_to(retracted) < 1e-9
    assert found.angle_to(retracted) < 1e-6
