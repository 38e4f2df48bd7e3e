# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The search of joint paths, in worlds that this module makes and judges itself.

The worlds are balls in the space of the joints, a wall with a gap, and balls around a whole motion
of an arm, whose links pinocchio places.
"""

from math import inf, pi, sqrt

import numpy as np
import pytest

from ur_cartesian_driver.planning.travel.joint_path_search import path_length, search_joint_path

WEIGHTS = np.array([1.0, 0.9, 0.5, 0.2, 0.2, 0.1])
LIMITS = np.array([[-2 * pi] * 6, [2 * pi] * 6])
#: The search looks at a motion at every degree, the judge at every tenth of one.
DEGREE = pi / 180


def rows_between(a, b, step):
    count = max(1, int(np.ceil(np.abs(np.subtract(b, a)).max() / step)))
    return np.asarray(a) + np.linspace(0.0, 1.0, count + 1)[:, None] * np.subtract(b, a)


class World:
    """
    A space of joints with bodies, given by the distance of rows from them [rad].

    The search keeps the distance that the arm can move between two rows that it looks at.
    """

    def __init__(self, distances, limits=LIMITS, weights=WEIGHTS):
        self.distances, self.limits, self.weights = distances, limits, weights
        self.edges = 0

    def free(self, q):
        return self.distances(q) > 0.5 * DEGREE * sqrt(6.0)

    def is_free(self, a, b):
        return True  # it has been looked at densely enough

    def seems_free(self, a, b):
        self.edges += 1
        return bool(self.free(rows_between(a, b, DEGREE)).all())


def balls(centres, radii):
    centres, radii = np.array(centres, dtype=float), np.array(radii, dtype=float)
    return World(lambda q: (np.linalg.norm(q[:, None] - centres, axis=2) - radii).min(axis=1))


def joints(*values):
    return np.array([*values, *[0.0] * (6 - len(values))])


def judge(world, found, start, goals):
    """A found path leads from the start to a goal, and is free, looked at ten times as densely."""
    assert np.array_equal(found.waypoints[0], start)
    assert any(np.array_equal(found.waypoints[-1], goal) for goal in goals)
    for a, b in zip(found.waypoints[:-1], found.waypoints[1:], strict=True):
        rows = rows_between(a, b, 0.1 * DEGREE)
        assert ((rows >= world.limits[0]) & (rows <= world.limits[1])).all()
        assert (world.distances(rows) > 0.0).all()


BALL = balls([joints(0.5)], [0.3])
AT = joints(0.0), joints(1.0)


def test_a_free_straight_motion_needs_no_sample():
    world = balls([joints(0.5, 1.0)], [0.3])
    found = search_joint_path(world, AT[0], AT[1][None], max_samples=0)
    assert found.samples == 0
    assert np.array_equal(found.waypoints, AT)
    assert world.edges == 1


def test_a_way_around_is_found_and_is_short():
    found = search_joint_path(BALL, AT[0], AT[1][None], max_samples=500)
    judge(BALL, found, AT[0], [AT[1]])
    assert 0 < found.samples < 100
    # Wrist 3 moves the arm least, so the shortest way round turns it.
    assert path_length(BALL, found.waypoints) < 1.3


def test_a_seed_makes_the_same_path_again_and_another_seed_another():
    one, same, other = (
        search_joint_path(BALL, AT[0], AT[1][None], max_samples=500, seed=seed)
        for seed in (3, 3, 4)
    )
    assert np.array_equal(one.waypoints, same.waypoints)
    assert one.samples == same.samples
    assert not np.array_equal(one.waypoints, other.waypoints)


def test_the_search_gives_up_when_the_samples_are_spent():
    shell = World(lambda q: np.abs(np.linalg.norm(q - AT[1], axis=1) - 0.5) - 0.05)
    for count in (0, 20, 100):
        assert search_joint_path(shell, AT[0], AT[1][None], max_samples=count) is None
        grown, shell.edges = shell.edges, 0
        assert grown <= 1 + 40 * count


def test_limits_are_kept_where_the_short_way_is_beyond_them():
    """A wall from the lower limit up to joint 2 = 1.5 leaves a gap above only."""
    limits = np.array([[-0.1] * 6, [1.2, 2.0, 0.1, 0.1, 0.1, 0.1]])
    wall = World(lambda q: np.maximum(np.abs(q[:, 0] - 0.5) - 0.1, q[:, 1] - 1.5), limits)
    found = search_joint_path(wall, AT[0], AT[1][None], max_samples=500)
    judge(wall, found, AT[0], [AT[1]])
    assert found.waypoints[:, 1].max() > 1.5


def test_an_endless_joint_has_no_limit():
    limits = LIMITS.copy()
    limits[:, 5] = -inf, inf
    world = World(BALL.distances, limits)
    found = search_joint_path(world, AT[0], AT[1][None], max_samples=500)
    judge(world, found, AT[0], [AT[1]])


def test_the_nearest_free_goal_is_taken_and_goals_out_of_limits_or_not_free_are_not():
    goals = np.array([joints(0.5), joints(0.0, 3.0), joints(0.0, -2.0), joints(7.0)])
    found = search_joint_path(BALL, AT[0], goals, max_samples=0)
    assert np.array_equal(found.waypoints[-1], goals[2])
    assert search_joint_path(BALL, AT[0], goals[[0, 3]], max_samples=100) is None


def test_another_goal_is_reached_where_the_nearest_is_walled_in():
    goals = np.array([AT[1], joints(-2.0)])
    shell = World(lambda q: np.abs(np.linalg.norm(q - AT[1], axis=1) - 0.5) - 0.05)
    found = search_joint_path(shell, AT[0], goals, max_samples=0)
    assert np.array_equal(found.waypoints[-1], goals[1])


@pytest.mark.parametrize('seed', range(5))
def test_a_narrow_gap_in_a_wall_is_found(seed):
    """The wall is 0.4 rad thick, and its gap 0.6 rad wide in two of the joints."""
    gap = joints(0.0, 0.8, -0.7)

    def distances(q):
        in_gap = 0.3 - np.abs(q[:, 1:3] - gap[1:3]).max(axis=1)
        return np.maximum(np.abs(q[:, 0] - 0.5) - 0.2, in_gap)

    world = World(distances)
    found = search_joint_path(world, AT[0], AT[1][None], max_samples=2000, seed=seed)
    judge(world, found, AT[0], [AT[1]])
    assert len(found.waypoints) >= 4


def test_motions_that_only_seem_free_are_cut_off_and_others_are_found():
    """A thin shell slips through between the places that are looked at, but for the proof."""
    thin = World(lambda q: np.abs(np.linalg.norm(q - joints(0.5), axis=1) - 0.3) - 1e-3)

    class Coarse(World):
        def free(self, q):
            return np.ones(len(q), dtype=bool)

        def is_free(self, a, b):
            return bool((self.distances(rows_between(a, b, 4e-4)) > 0.0).all())

    world = Coarse(thin.distances)
    found = search_joint_path(world, AT[0], AT[1][None], max_samples=500)
    judge(world, found, AT[0], [AT[1]])
    inside = search_joint_path(world, joints(0.5), AT[1][None], max_samples=50)
    assert inside is None
