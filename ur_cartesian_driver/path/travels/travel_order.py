# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The order of paths with the least travel between them.

Each path can be run in several ways: in one of two directions, in one of several postures. For a
given order the best runs follow from dynamic programming; the order is found by the nearest
neighbour, 2-opt and or-opt, all of them deterministic.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Floats

#: A change of the order is made if it shortens the order by more than this fraction.
_WORTHWHILE = 1e-9
#: The number of paths that are tried as the first one.
_BEGINNINGS = 4
#: The longest run of paths that or-opt moves together.
_LONGEST_RUN = 3


@dataclass(frozen=True, slots=True)
class Runs:
    """The joints at both ends of a path, a row for each way of running it; (m, 6) [rad]."""

    entries: Floats
    exits: Floats


def best_order(start: Floats, runs: Sequence[Runs], weights: Floats) -> list[tuple[int, int]]:
    """
    Return the paths in the best order that was found, each with the number of its run.

    :param start: (6,) joint positions of the arm at the beginning [rad].
    :param weights: (6,) how far each joint moves the arm [m/rad].
    """
    costs = _Costs(start, runs, weights)
    order = min((costs.improved(order) for order in costs.first_orders()), key=costs.of)
    return list(zip(order, costs.choices(order), strict=True))


class _Costs:
    """The costs of travels from each run of each path to each run of another [m]."""

    def __init__(self, start: Floats, runs: Sequence[Runs], weights: Floats) -> None:
        self._from_start = [_distances(start[None], each.entries, weights)[0] for each in runs]
        self._between = [
            [_distances(one.exits, other.entries, weights) for other in runs] for one in runs
        ]

    def first_orders(self) -> Iterator[list[int]]:
        """Yield orders that begin with a near path, and continue with the nearest one left."""
        count = len(self._from_start)
        near = sorted(range(count), key=lambda k: float(self._from_start[k].min()))
        for first in near[:_BEGINNINGS]:
            order, left = [first], set(near) - {first}
            while left:
                last = self._between[order[-1]]
                order.append(min(sorted(left), key=lambda k: float(last[k].min())))
                left.remove(order[-1])
            yield order

    def improved(self, order: list[int]) -> list[int]:
        """Return the order, changed as long as a change makes it shorter."""
        best = self.of(order)
        while True:
            for other in _changes(order):
                cost = self.of(other)
                if cost < (1.0 - _WORTHWHILE) * best:
                    order, best = other, cost
                    break
            else:
                return order

    def of(self, order: Sequence[int]) -> float:
        """Return the least cost of an order [m]."""
        return float(self._totals(order)[-1].min())

    def choices(self, order: Sequence[int]) -> list[int]:
        """Return the runs with which an order has its least cost."""
        totals = self._totals(order)
        chosen = [int(np.argmin(totals[-1]))]
        for k in range(len(order) - 1, 0, -1):
            step = self._between[order[k - 1]][order[k]][:, chosen[-1]]
            chosen.append(int(np.argmin(totals[k - 1] + step)))
        return chosen[::-1]

    def _totals(self, order: Sequence[int]) -> list[Floats]:
        """Return for each path of an order the least costs to the entries of its runs [m]."""
        totals = [self._from_start[order[0]]]
        for before, after in pairwise(order):
            totals.append((totals[-1][:, None] + self._between[before][after]).min(axis=0))
        return totals


def _distances(a: Floats, b: Floats, weights: Floats) -> Floats:
    """Return the weighted joint distances between rows, (len(a), len(b)) [m]."""
    distances: Floats = np.linalg.norm((b[None] - a[:, None]) * weights, axis=2)
    return distances


def _changes(order: list[int]) -> Iterator[list[int]]:
    """Yield the orders in which a run of paths is turned round, or is moved elsewhere."""
    count = len(order)
    for i in range(count):
        for j in range(i + 2, count + 1):
            yield order[:i] + order[i:j][::-1] + order[j:]
    for length in range(1, min(_LONGEST_RUN, count - 1) + 1):
        for i in range(count - length + 1):
            run, rest = order[i : i + length], order[:i] + order[i + length :]
            for j in range(len(rest) + 1):
                if j != i:
                    yield rest[:j] + run + rest[j:]
