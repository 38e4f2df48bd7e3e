# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Check the clearance of the arm, and of the bodies that it carries, from the cell.

A motion is given as rows of joint positions. It is checked everywhere, not only at its rows. Each
body moves with a carrier: the base or a link of the arm. The box around all bodies on a carrier
bounds the motion of each of them. The distance of a pair is measured in the middle of a stretch of
rows. If it exceeds the clearance by more than the bodies move between there and the ends of the
stretch, the pair keeps its clearance on the whole stretch; otherwise the stretch is halved.
Halving continues between two rows, along the straight line between their poses, until the bodies
move less than :data:`RESOLUTION`. The deviation of the true motion from this line is bounded by
second differences of the boxes and by the turns of the joints.

A pair that is too close at the start is accepted while its distance only grows, as in the check
for self-collisions (:mod:`~.clearance`).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, floor, inf
from typing import NamedTuple

import numpy as np

from ur_cartesian_driver.kinematics.cell_distances import CARRIERS, CellDistances
from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats, Indices
from ur_cartesian_driver.motion.geometry.vectors import Joints, vector6

#: Stretches in which bodies move less than this [m] are not halved any more.
RESOLUTION = 2e-5
# Rows of the longest stretch, and rows per block: blocks bound the memory.
_STRETCH, _BLOCK = 64, 8192
# Blocks with enough rows are divided into at least this many stretches, because bounding the
# distances on one more stretch costs less than halving a stretch.
_PARTS = 8
# A separating pair may come closer by this much [m], because of rounding.
_RECEDING_TOLERANCE = 1e-4
# The bodies of a separating pair together move at most this far between two measurements [m].
_LEAVING_STEP = 0.002
# A pair that is too close between two rows is measured at this many places from one to the other.
_LOOKS = 9
# Larger than any distance in a cell [m].
_FAR = 1e3
# The smallest distance on a path is found to within this fraction of it or this length [m],
# whichever is larger.
_CLOSEST_FRACTION, _CLOSEST_LENGTH = 0.25, 0.001


class Place(NamedTuple):
    """A place on a path at which two bodies are close."""

    #: The index of the row before the place, plus the fraction of the way to the next row; the
    #: start configuration counts as row -1.
    at: float
    #: The index of the pair in :attr:`CellDistances.pairs`.
    pair: int
    #: The distance between the two bodies [m], at most 0 where they touch.
    distance: float

    @property
    def row(self) -> int:
        """The first checked row at or after the place."""
        return max(ceil(self.at), 0)

    def joints(self, q: Floats, q_start: Joints) -> Joints:
        """Return the joints at the place [rad]; ``q``: (n, 6) the rows that were checked."""
        before = floor(self.at)
        first = np.array(q_start) if before < 0 else q[before]
        change = q[min(before + 1, len(q) - 1)] - first
        return vector6((first + (self.at - before) * change).tolist())


class CellResult(NamedTuple):
    """The clearance of a path from the cell."""

    #: The first place at which a pair is closer than its clearance; if this is between two rows,
    #: the place between them at which the pair is closest. None = no pair is refused.
    violation: Place | None
    #: The place with the smallest distance of all pairs; None = no distance was recorded. Pairs on
    #: neighbouring links are left out, because they are always close.
    closest: Place | None
    #: Lower bound of the distances of these pairs [m], on the whole path or up to the violation;
    #: infinite if ``closest`` is None.
    at_least: float


@dataclass(slots=True)
class _Stretches:
    """Stretches of a block, by the row indices of their ends; fractions lie between two rows."""

    begin: Floats
    end: Floats

    @property
    def middle(self) -> Floats:
        """The middle of each stretch, rounded down to a row if the stretch has a row inside."""
        middle = 0.5 * (self.begin + self.end)
        return np.where(self.end - self.begin > 1.0, np.floor(middle), middle)

    def halves(self, which: Flags) -> _Stretches:
        """Return the halves of the flagged stretches, in order."""
        middle = self.middle[which]
        begin = np.stack([self.begin[which], middle], axis=1).ravel()
        end = np.stack([middle, self.end[which]], axis=1).ravel()
        return _Stretches(begin, end)


class _Motion:
    """Consecutive rows of joints, with bounds on the motion of bodies between any two rows."""

    def __init__(self, bodies: CellDistances, q: Floats) -> None:
        self.poses = bodies.poses(q)
        points = bodies.box_points(self.poses)
        changes = np.diff(points, axis=0)
        steps, bends = _summed_lengths(changes), _summed_lengths(np.diff(changes, axis=0))
        # A curve deviates from its chord by about an eighth of its second difference. A quarter is
        # used as a safe bound.
        padded = np.pad(bends, ((1, 1), (0, 0)))
        bends = 0.25 * np.maximum(padded[1:], padded[:-1])
        # In a corner of the path this bound is far too large. The turns of the joints give
        # another bound, and the smaller one is used.
        turns = np.cumsum(np.abs(np.diff(q, axis=0)), axis=1)
        turned = np.pad(turns, ((0, 0), (1, 0)))[:, :CARRIERS]
        by_turns = 0.25 * turned**2 * bodies.reaches
        #: (n - 1, carriers) bound on the deviation of bodies from the line between two rows [m].
        self.bends = np.minimum(bends, by_turns) if len(q) > 2 else by_turns
        #: (n, carriers) bound on the distance that bodies have moved since the first row [m].
        self.moved = np.vstack([np.zeros(CARRIERS), np.cumsum(steps + 2.0 * self.bends, axis=0)])

    def at(self, places: Floats) -> Floats:
        """Return the poses of the carriers (k, carriers, 7) at fractional row indices (k,)."""
        row = np.minimum(places.astype(np.intp), len(self.poses) - 1)
        part = places - row
        poses = self.poses[row]
        between = np.flatnonzero(part)
        if len(between):
            some = poses[between]
            after = self.poses[row[between] + 1].copy()
            dots = np.einsum('nck,nck->nc', some[..., 3:], after[..., 3:])
            after[..., 3:] *= np.where(dots < 0.0, -1.0, 1.0)[..., None]
            some = some + part[between, None, None] * (after - some)
            some[..., 3:] /= np.linalg.norm(some[..., 3:], axis=2, keepdims=True)
            poses[between] = some
        return poses

    def moved_of(self, carriers: Indices) -> Floats:
        """Return the summed motion (n,) [m] of two carriers from the first row to each row."""
        a, b = carriers.tolist()
        return self.moved[:, a] + self.moved[:, b] if b else self.moved[:, a]

    def bend(self, places: Floats, carriers: Indices) -> Floats:
        """Return bounds (k,) [m] on the errors of two interpolated carriers; 0 in a row."""
        row = places.astype(np.intp)
        bends = self.bends[np.minimum(row, len(self.bends) - 1)][:, carriers].sum(axis=1)
        return np.where(places == row, 0.0, bends)


def _summed_lengths(changes: Floats) -> Floats:
    """Return the summed lengths (n, carriers) [m] of the four vectors of each carrier's box."""
    lengths = np.sqrt(np.einsum('nckx,nckx->nck', changes, changes))
    together: Floats = np.einsum('nck->nc', lengths)
    return together


def _at(moved: Floats, places: Floats) -> Floats:
    """Return the motion since the first row [m], interpolated at fractional row indices."""
    row = np.minimum(places.astype(np.intp), len(moved) - 2)
    found: Floats = moved[row] + (places - row) * (moved[row + 1] - moved[row])
    return found


def _dense_places(moved: Floats) -> Floats:
    """Return all rows but the first, and places between, at most :data:`_LEAVING_STEP` apart."""
    counts = np.maximum(1, np.ceil(np.diff(moved) / _LEAVING_STEP)).astype(np.intp)
    row = np.repeat(np.arange(len(counts)), counts)
    number = np.arange(len(row)) - np.repeat(np.cumsum(counts) - counts, counts)
    places: Floats = row + (number + 1.0) / counts[row]
    return places


class CellClearance:
    """The clearance of one arm from the bodies of its cell."""

    def __init__(self, bodies: CellDistances) -> None:
        self.bodies = bodies

    def too_close(self, q: Floats) -> Flags:
        """Return for each configuration (n, 6) [rad] whether a pair is below its clearance."""
        close = np.zeros(len(q), dtype=np.bool_)
        bodies = self.bodies
        for begin in range(0, len(q), _BLOCK):
            poses = bodies.poses(q[begin : begin + _BLOCK])
            near = bodies.lower_bounds(poses) < bodies.clearances
            of_block = close[begin : begin + _BLOCK]
            for column in np.flatnonzero(near.any(axis=0)).tolist():
                rows = np.flatnonzero(near[:, column] & ~of_block)
                clearance = float(bodies.clearances[column])
                if len(rows):
                    found = bodies.distances(column, poses[rows], clearance)
                    of_block[rows[found < clearance]] = True
        return close

    def check(self, q: Floats, q_start: Joints, *, closest: bool = True) -> CellResult:
        """
        Check a motion along rows of joints, and from the start to the first of them.

        :param q: (n, 6) [rad], in order of time.
        :param q_start: the start configuration; pairs that are too close there may separate.
        :param closest: whether to search for the closest pair as well, which takes longer.
        """
        search = _Search(self.bodies, closest)
        before = np.array([q_start])
        for begin in range(0, len(q), _BLOCK):
            rows = np.concatenate([before, q[begin : begin + _BLOCK]])
            search.block(_Motion(self.bodies, rows), begin - 1, is_first=begin == 0)
            if search.violation is not None:
                break
            before = rows[-1:]
        return CellResult(search.violation, search.closest, search.at_least)


class _Search:
    """The search for the first violation and for the closest pair, block after block."""

    def __init__(self, bodies: CellDistances, seeks_closest: bool) -> None:
        self._bodies, self._seeks_closest = bodies, seeks_closest
        self.violation: Place | None = None
        self.closest: Place | None = None
        #: The pairs that have been too close since the start, with their greatest distances [m].
        self._pending: dict[int, float] = {}

    @property
    def at_least(self) -> float:
        """Proved lower bound of the distances so far [m], neighbouring links excepted."""
        if self.closest is None:
            return inf
        distance = self.closest.distance
        proved = distance - max(_CLOSEST_LENGTH, _CLOSEST_FRACTION * distance)
        # A pair keeps its clearance, unless it has been too close since the start. Then it has
        # been measured, and is no closer than ``distance``.
        return max(proved, min(distance, float(self._bodies.clearances.min())))

    def block(self, motion: _Motion, offset: int, *, is_first: bool) -> None:
        """
        Search the rows of a block.

        :param offset: the index of the block's first row among all rows; -1 = the start.
        """
        bodies, last = self._bodies, len(motion.poses) - 1
        length = min(_STRETCH, max(1, last // _PARTS))
        begins = np.arange(0, last, length, dtype=np.float64)
        stretches = _Stretches(begins, np.minimum(begins + length, last))
        middle = stretches.middle.astype(np.intp)
        # The first row is bounded in the same call, because a call costs more than a row.
        first, *_ = lower = bodies.lower_bounds(motion.poses[np.append(0, middle)])
        lower = lower[1:]
        moved = motion.moved
        reach = np.maximum(
            moved[middle] - moved[begins.astype(np.intp)],
            moved[stretches.end.astype(np.intp)] - moved[middle],
        )[:, bodies.carriers].sum(axis=2)
        proved = lower - reach
        nearest = proved.min(axis=0).tolist()
        if is_first:
            self._find_pending(motion, first)
        self._look_where_close(motion, middle, lower, offset)
        for column in np.argsort(lower.min(axis=0)).tolist():
            if column in self._pending:
                begin = self._leave(column, motion, offset)
                if begin is not None and begin < last:
                    rest = _Stretches(np.array([begin]), np.array([float(last)]))
                    self._search_pair(column, motion, offset, rest)
                continue
            if nearest[column] < (enough := self._enough(column)):
                open_ = proved[:, column] < enough
                of_pair = _Stretches(stretches.begin[open_], stretches.end[open_])
                self._search_pair(column, motion, offset, of_pair)

    def _look_where_close(
        self, motion: _Motion, rows: Indices, lower: Floats, offset: int
    ) -> None:
        """
        Measure the distance of the pair and row with the smallest lower bound.

        Most other pairs then need no measurement, because their lower bounds are larger.
        """
        if not (self._seeks_closest and lower.size):
            return
        far = np.where(self._bodies.are_neighbours, inf, lower)
        k, column = np.unravel_index(int(np.argmin(far)), far.shape)
        some = rows[k : k + 1]
        distance = self._bodies.distances(int(column), motion.poses[some], _FAR)
        self._remember(int(column), some.astype(np.float64), distance, offset)

    def _enough(self, column: int) -> float:
        """Return the distance [m] at and above which a pair needs no exact measurement."""
        clearance = float(self._bodies.clearances[column])
        if not self._seeks_closest or self._bodies.are_neighbours[column]:
            return clearance
        return max(clearance, min(self.at_least, _FAR))

    def _find_pending(self, motion: _Motion, lower: Floats) -> None:
        """Find the pairs that are too close in the first row, from the lower bounds (pairs,)."""
        bodies, first = self._bodies, motion.poses[:1]
        near = lower < bodies.clearances
        for column in np.flatnonzero(near).tolist():
            clearance = float(bodies.clearances[column])
            distance = float(bodies.distances(column, first, inf)[0])
            if distance < clearance:
                self._pending[column] = distance
                self._remember(column, np.zeros(1), np.array([distance]), -1)

    def _leave(self, column: int, motion: _Motion, offset: int) -> float | None:
        """
        Follow a pair that was too close at the start.

        :returns: the place in the block from which on the pair is clear; None = it stays too close
            to the end of the block, or comes closer, which is recorded as a violation.
        """
        clearance = float(self._bodies.clearances[column])
        moved = motion.moved_of(self._bodies.carriers[column])
        for begin in range(0, len(moved) - 1, _STRETCH):
            places = begin + _dense_places(moved[begin : begin + _STRETCH + 1])
            distances = self._bodies.distances(column, motion.at(places), inf)
            reached = np.maximum.accumulate(np.append(self._pending[column], distances))
            free = distances >= clearance
            end = int(np.argmax(free)) if free.any() else len(free)
            nearer = np.flatnonzero(distances[:end] < reached[:end] - _RECEDING_TOLERANCE)
            if len(nearer):
                k = int(nearer[0])
                self._violate(Place(offset + places[k], column, float(distances[k])))
                return None
            self._remember(column, places[:end], distances[:end], offset)
            self._pending[column] = float(reached[-1])
            if end < len(free):
                del self._pending[column]
                return float(places[end])
        return None

    def _search_pair(
        self, column: int, motion: _Motion, offset: int, stretches: _Stretches
    ) -> None:
        """
        Search stretches for a violation and the smallest distance of one pair.

        Stretches on which its distance may be below :meth:`_enough` are halved.
        """
        bodies, carriers = self._bodies, self._bodies.carriers[column]
        clearance, moved = float(bodies.clearances[column]), motion.moved_of(carriers)
        first = float(stretches.begin[0]) if len(stretches.begin) else 0.0
        while len(stretches.begin):
            middle, enough = stretches.middle, self._enough(column)
            here = _at(moved, middle)
            reach = np.maximum(
                here - _at(moved, stretches.begin), _at(moved, stretches.end) - here
            )
            bend = motion.bend(middle, carriers)
            needed = enough + float(bend.max())
            proof = enough + reach + bend
            distances = bodies.distances(column, motion.at(middle), needed, proof)
            self._remember(column, middle, distances, offset)
            sure = distances - bend
            open_ = (sure < enough + reach) & (reach > RESOLUTION)
            bad = np.flatnonzero(sure < clearance)
            if len(bad):
                self._violate(self._nearest(column, motion, float(middle[bad[0]]), first, offset))
            if self.violation is not None:
                open_ &= stretches.begin < self.violation.at - offset
            stretches = stretches.halves(open_)

    def _nearest(
        self, column: int, motion: _Motion, place: float, first: float, offset: int
    ) -> Place:
        """
        Return the place between the two rows around ``place`` at which a pair is closest.

        :param first: the first place to measure; before it, the pair may still be separating.
        """
        places = np.array([place])
        if place != floor(place):
            around = np.linspace(max(floor(place), first), ceil(place), _LOOKS)
            places = np.append(around, place)
        sure = self._bodies.distances(column, motion.at(places), inf)
        sure = sure - motion.bend(places, self._bodies.carriers[column])
        k = int(np.argmin(sure))
        return Place(offset + float(places[k]), column, float(sure[k]))

    def _remember(self, column: int, places: Floats, distances: Floats, offset: int) -> None:
        """Record the smallest of some distances if it is smaller than all before."""
        if not (self._seeks_closest and len(places)) or self._bodies.are_neighbours[column]:
            return
        k = int(np.argmin(distances))
        before = inf if self.closest is None else self.closest.distance
        # A distance that is not below ``_enough`` may be only a lower bound.
        if distances[k] < min(before, self._enough(column)):
            self.closest = Place(offset + float(places[k]), column, float(distances[k]))

    def _violate(self, place: Place) -> None:
        """Record a violation if it is the first one on the path."""
        if self.violation is None or place.at < self.violation.at:
            self.violation = place
