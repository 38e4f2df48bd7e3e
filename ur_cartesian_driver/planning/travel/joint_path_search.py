# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Search for a joint path from a configuration to one of several others, and shorten it.

The straight joint motion is tried first. Then two trees of configurations grow towards each other
(RRT-Connect: J. Kuffner and S. LaValle, "RRT-Connect: an efficient approach to single-query path
planning", ICRA 2000), one from the start, one from all goals. A :class:`JointSpace` decides which
motions are free, so the search knows neither arm nor obstacles. The search ends after a number of
samples, not after a time, and a seed determines the samples. So equal inputs lead to the same path
on every machine.

Proving that a motion is free takes much longer than checking single configurations on it. So trees
grow by motions that seem free, and a connection from the start to a goal is proved when it is
found (R. Bohlin and L. Kavraki, "Path planning using lazy PRM", ICRA 2000, do likewise). If a
motion is not free, all nodes beyond it are cut off, and the search goes on.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import Protocol

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats

#: A tree grows by motions of equal weighted length: a motion of only the joint with the greatest
#: weight turns this joint by this angle [rad].
_STEP = 0.35
#: Samples are drawn from the box around start and goals, enlarged by a random margin between these
#: two [rad]: most ways round an obstacle are near the box, but some need another turn of a joint.
_MIN_MARGIN, _MAX_MARGIN = 0.2, pi
#: Rounds of shortening, and random chords that are tried in each.
_ROUNDS, _CHORDS = 3, 30
#: A chord replaces a detour if it is shorter by more than this fraction.
_WORTHWHILE = 0.01


class JointSpace(Protocol):
    """The configurations of an arm, with checks that it touches nothing."""

    @property
    def limits(self) -> Floats:
        """Lowest and highest position of each joint, (2, 6) [rad]; infinite = no limit."""

    @property
    def weights(self) -> Floats:
        """Displacement of the arm for each radian of a joint, (6,) [m/rad]."""

    def free(self, q: Floats) -> Flags:
        """Return whether the arm touches nothing in each configuration (n, 6) [rad]."""

    def seems_free(self, a: Floats, b: Floats) -> bool:
        """Return whether the arm touches nothing at steps of the straight motion from a to b."""

    def is_free(self, a: Floats, b: Floats) -> bool:
        """Return whether the arm touches nothing anywhere on a motion that seems free."""


@dataclass(frozen=True, slots=True)
class FoundPath:
    """A joint path, and the effort of its search."""

    #: (k, 6) [rad]; between two rows the joints move straight.
    waypoints: Floats
    #: The number of samples that were drawn.
    samples: int


def search_joint_path(
    space: JointSpace, start: Floats, goals: Floats, *, max_samples: int, seed: int = 0
) -> FoundPath | None:
    """
    Return a free joint path from the start to one of the goals; None if none was found.

    :param start: (6,) [rad], a free configuration.
    :param goals: (n, 6) [rad]; goals that are not free, or out of the limits, are left out.
    :param max_samples: the number of samples after which the search gives up.
    """
    goals = goals[_within(space.limits, goals) & space.free(goals)]
    if not len(goals):
        return None
    goals = goals[np.argsort(_lengths(space, goals - start), kind='stable')]
    for goal in goals:
        if _is_free(space, start, goal):
            return FoundPath(np.array([start, goal]), 0)
    random = np.random.default_rng(seed)
    found = _grow(space, start, goals, max_samples, random)
    if found is None:
        return None
    return FoundPath(_shortened(space, found.waypoints, random), found.samples)


def path_length(space: JointSpace, waypoints: Floats) -> float:
    """Return the length [m] of a joint path (k, 6) [rad], weighted by the joints' weights."""
    return float(_lengths(space, np.diff(waypoints, axis=0)).sum())


def _is_free(space: JointSpace, a: Floats, b: Floats) -> bool:
    return space.seems_free(a, b) and space.is_free(a, b)


def _within(limits: Floats, q: Floats) -> Flags:
    inside: Flags = ((q >= limits[0]) & (q <= limits[1])).all(axis=1)
    return inside


def _lengths(space: JointSpace, changes: Floats) -> Floats:
    """Return the weighted lengths of changes of the joints (n, 6) [rad]."""
    lengths: Floats = np.linalg.norm(changes * space.weights, axis=1)
    return lengths


class _Tree:
    """Configurations that are connected to one of the roots by motions that seem free."""

    def __init__(self, space: JointSpace, roots: Floats) -> None:
        self._space = space
        self._rows = np.empty((max(64, 2 * len(roots)), 6))
        self._rows[: len(roots)] = roots
        #: The number of each node's parent; -1 = the node is a root.
        self._before = [-1] * len(roots)
        #: The nodes with a motion from their parent that is proved to be free.
        self._proved: set[int] = set()

    def nearest(self, q: Floats) -> int:
        """Return the number of the node that is nearest to a configuration."""
        nodes = self._rows[: len(self._before)]
        return int(np.argmin(_lengths(self._space, nodes - q)))

    def grow(self, node: int, q: Floats) -> tuple[int, bool]:
        """
        Grow by one step from a node towards a configuration.

        :returns: the number of the new node, or -1 if the step is not free; and whether the new
            node is at the configuration.
        """
        here = self._rows[node]
        length = float(_lengths(self._space, (q - here)[None])[0])
        step = _STEP * float(self._space.weights.max())
        arrives = length <= step
        there = q if arrives else here + (q - here) * (step / length)
        if not self._space.seems_free(here, there):
            return -1, False
        count = len(self._before)
        if count == len(self._rows):
            self._rows = np.concatenate([self._rows, np.empty_like(self._rows)])
        self._rows[count] = there
        self._before.append(node)
        return count, arrives

    def row(self, node: int) -> Floats:
        """Return the configuration of a node."""
        row: Floats = self._rows[node]
        return row

    def prove(self, node: int) -> bool:
        """
        Return whether all motions from the root to a node are free.

        If one of them is not free, the nodes beyond it are cut off.
        """
        nodes = []
        while self._before[node] >= 0:
            nodes.append(node)
            node = self._before[node]
        for k in nodes[::-1]:
            if k not in self._proved:
                if not self._space.is_free(self._rows[self._before[k]], self._rows[k]):
                    self._cut(k)
                    return False
                self._proved.add(k)
        return True

    def _cut(self, node: int) -> None:
        """Move a node and all nodes beyond it to infinity, where they are never the nearest."""
        gone = {node}
        for k in range(node + 1, len(self._before)):
            if self._before[k] in gone:
                gone.add(k)
        self._rows[list(gone)] = np.inf

    def branch(self, node: int) -> Floats:
        """Return the configurations from a node to its root."""
        nodes = []
        while node >= 0:
            nodes.append(node)
            node = self._before[node]
        rows: Floats = self._rows[nodes]
        return rows


def _grow(
    space: JointSpace, start: Floats, goals: Floats, max_samples: int, random: np.random.Generator
) -> FoundPath | None:
    """Return the first path found from the start to a goal; None after ``max_samples``."""
    from_start, from_goals = _Tree(space, start[None]), _Tree(space, goals)
    one, other = from_start, from_goals
    hull = np.vstack([start, goals])
    low, high = hull.min(axis=0), hull.max(axis=0)
    for sample in range(1, max_samples + 1):
        margin = random.uniform(_MIN_MARGIN, _MAX_MARGIN)
        target = random.uniform(
            np.maximum(low - margin, space.limits[0]), np.minimum(high + margin, space.limits[1])
        )
        new, _ = one.grow(one.nearest(target), target)
        if (
            new >= 0
            and (met := _connected(other, one.row(new))) >= 0
            and one.prove(new)
            and other.prove(met)
        ):
            path = np.concatenate([one.branch(new)[::-1], other.branch(met)[1:]])
            return FoundPath(path if one is from_start else path[::-1], sample)
        one, other = other, one
    return None


def _connected(tree: _Tree, q: Floats) -> int:
    """Grow a tree to a configuration; return its node there, -1 if a step is not free."""
    node, arrives = tree.nearest(q), False
    while node >= 0 and not arrives:
        node, arrives = tree.grow(node, q)
    return node


def _shortened(space: JointSpace, path: Floats, random: np.random.Generator) -> Floats:
    """Return the path with detours replaced by free straight motions."""
    for _ in range(_ROUNDS):
        path = _without_corners(space, path)
        if len(path) == 2:
            break
        for _ in range(_CHORDS):
            path = _cut(space, path, random)
    return _without_corners(space, path)


def _without_corners(space: JointSpace, path: Floats) -> Floats:
    """Return the path without the rows that free straight motions can skip."""
    kept, k = [0], 0
    while k < len(path) - 1:
        later = range(len(path) - 1, k + 1, -1)
        k = next((j for j in later if _is_free(space, path[k], path[j])), k + 1)
        kept.append(k)
    return path[kept]


def _cut(space: JointSpace, path: Floats, random: np.random.Generator) -> Floats:
    """
    Return the path with a chord between two random places.

    If the chord is not free, or not shorter by ``_WORTHWHILE``, the path is returned unchanged.
    """
    lengths = _lengths(space, np.diff(path, axis=0))
    ends = np.concatenate([[0.0], np.cumsum(lengths)])
    places = np.sort(random.uniform(0.0, ends[-1], 2))
    first, last = (int(k) for k in np.searchsorted(ends[1:-1], places, side='right'))
    if first == last:
        return path
    a, b = (
        path[k] + (path[k + 1] - path[k]) * ((place - ends[k]) / lengths[k])
        for k, place in zip((first, last), places, strict=True)
    )
    chord = float(_lengths(space, (b - a)[None])[0])
    if chord > (1.0 - _WORTHWHILE) * (places[1] - places[0]) or not _is_free(space, a, b):
        return path
    return np.concatenate([path[: first + 1], [a, b], path[last + 1 :]])
