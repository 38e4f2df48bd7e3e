# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The order of paths, compared with all orders that there are."""

from itertools import permutations, product

import numpy as np
import pytest

from ur_cartesian_driver.path.travels.travel_order import best_order, Runs

WEIGHTS = np.array([1.0, 0.9, 0.5, 0.2, 0.2, 0.1])
START = np.zeros(6)


def random_ways(random, count, choices):
    return [
        Runs(random.uniform(-2, 2, (choices, 6)), random.uniform(-2, 2, (choices, 6)))
        for _ in range(count)
    ]


def length(chosen, ways):
    here, total = START, 0.0
    for k, way in chosen:
        total += float(np.linalg.norm((ways[k].entries[way] - here) * WEIGHTS))
        here = ways[k].exits[way]
    return total


@pytest.mark.parametrize('seed', range(8))
def test_few_paths_are_in_nearly_the_best_of_all_orders(seed):
    ways = random_ways(np.random.default_rng(seed), 5, 2)
    found = best_order(START, ways, WEIGHTS)
    assert sorted(k for k, _ in found) == list(range(5))
    every = (
        length(list(zip(order, choice, strict=True)), ways)
        for order in permutations(range(5))
        for choice in product(range(2), repeat=5)
    )
    assert length(found, ways) <= 1.1 * min(every)


def test_ways_of_a_given_order_are_the_best_of_all():
    """A line of places, each path from one to the next: the order is without choice."""
    places = [np.array([float(k), 0, 0, 0, 0, 0]) for k in range(8)]
    ends = [np.array([places[k], places[k + 1]]) for k in range(7)]
    ways = [Runs(each, each[::-1]) for each in ends]
    shuffled = [4, 0, 6, 2, 5, 1, 3]
    found = best_order(START, [ways[k] for k in shuffled], WEIGHTS)
    assert [shuffled[k] for k, _ in found] == list(range(7))
    assert {way for _, way in found} == {0}


def test_many_paths_take_less_way_than_the_nearest_neighbours_and_the_same_again():
    ways = random_ways(np.random.default_rng(1), 15, 4)
    found = best_order(START, ways, WEIGHTS)
    assert found == best_order(START, ways, WEIGHTS)
    here, left, greedy = START, set(range(15)), 0.0
    while left:
        rows = {
            (k, way): float(np.linalg.norm((ways[k].entries[way] - here) * WEIGHTS))
            for k in left
            for way in range(4)
        }
        k, way = min(rows, key=rows.get)
        greedy += rows[k, way]
        here = ways[k].exits[way]
        left.remove(k)
    assert length(found, ways) < 0.9 * greedy


def test_one_path_begins_in_the_way_that_is_nearest():
    ways = Runs(np.array([np.full(6, 2.0), np.full(6, 1.0)]), np.zeros((2, 6)))
    assert best_order(START, [ways], WEIGHTS) == [(0, 1)]
