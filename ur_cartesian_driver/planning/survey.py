# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""What the look ahead has seen: all its places, and what of them burdens each segment most."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.motion.primitive import Joints
from ur_cartesian_driver.planning.corner import Corner
from ur_cartesian_driver.planning.leg import Pace
from ur_cartesian_driver.planning.lookahead import Followed
from ur_cartesian_driver.planning.margins import measured, Nearest, nearest_of
from ur_cartesian_driver.planning.pose_rows import Floats
from ur_cartesian_driver.planning.samples import Ints, Piece, Samples

# Places nearer than this are one, and say nothing about a speed.
_NO_WAY = 1e-12


@dataclass(frozen=True, slots=True)
class Surveyed:
    """Pieces that the arm can go along, one after the other, and the places on them."""

    pieces: Sequence[Piece]
    found: Followed
    #: (n,) and the fraction (n,) of it.
    segments: Ints
    fractions: Floats
    #: (n, 3) distances from singularities, inf where they do not count.
    measures: Floats
    #: The configuration before the first place [rad].
    q_start: Joints


class Survey:
    """Collects places in order of time."""

    def __init__(self, arm: Arm) -> None:
        """Begin with none."""
        self._arm = arm
        self._seen: list[Surveyed] = []

    def measured(self, q: Floats) -> Floats:
        """Return how far configurations (n, 6) are from singularities (n, 3)."""
        return measured(self._arm, q)

    def add(self, seen: Surveyed) -> None:
        """Add what comes next."""
        self._seen.append(seen)

    def samples(self) -> Samples:
        """Return all places."""
        return Samples(
            segment=np.concatenate([seen.segments for seen in self._seen]),
            fraction=np.concatenate([seen.fractions for seen in self._seen]),
            q=np.concatenate([seen.found.q for seen in self._seen]),
            poses=np.concatenate([seen.found.poses for seen in self._seen]))

    def nearest(self) -> dict[int, Nearest]:
        """Return what comes nearest to its bound, by segment."""
        samples = self.samples()
        measures = np.concatenate([seen.measures for seen in self._seen])
        return nearest_of(self._arm, samples.q, measures, samples.segment, samples.fraction)

    def paces(self) -> dict[int, Pace]:
        """Return the time that the joints need for each whole segment, by segment."""
        parts = [_paces(seen, self._arm.model.max_joint_speed) for seen in self._seen]
        segment, time, joint, fraction = (
            np.concatenate(column) for column in zip(*parts, strict=True))
        order = np.lexsort((time, segment))
        last = order[np.flatnonzero(np.diff(segment[order], append=segment[order[-1]] + 1))]
        mean = self._means()
        return {index: Pace(t, k, at, mean[index]) for index, t, k, at in zip(
            segment[last].tolist(), time[last].tolist(), joint[last].tolist(),
            fraction[last].tolist(), strict=True)}

    def _means(self) -> list[float]:
        """Return the time that the busiest joint needs at its limit, by segment [s]."""
        segments = np.concatenate([seen.segments for seen in self._seen])
        burdens = np.concatenate([
            _burdens(seen, self._arm.model.max_joint_speed) for seen in self._seen])
        means: list[float] = np.max([np.bincount(segments, column) for column in burdens.T],
                                    axis=0).tolist()
        return means


def _paces(seen: Surveyed, limits: Sequence[float]
           ) -> tuple[Ints, Floats, NDArray[np.intp], Floats]:
    """
    Return for places the segment, and the time [s] of the whole segment at the pace there.

    :returns: segment, time, the joint that is the slowest, fraction; each (n,). Places in corners
        are there twice, once for each of their segments.
    """
    found = seen.found
    begin = np.array([piece.begin for piece in seen.pieces])[found.piece]
    before = np.concatenate([[0.0], found.t[:-1]])
    is_first = np.diff(found.piece, prepend=-1) != 0
    way = found.t - np.where(is_first, begin, before)
    burdens = _burdens(seen, limits)
    joint = np.argmax(burdens, axis=1)
    burden = np.take_along_axis(burdens, joint[:, None], axis=1)[:, 0]
    pace = np.where(way > _NO_WAY, burden / np.maximum(way, _NO_WAY), 0.0)
    index = np.array([p.index for p in seen.pieces], dtype=np.int32)[found.piece]
    leaving, joining = (rate[found.piece] for rate in _rates(seen.pieces))
    rounds = np.flatnonzero(joining > 0.0)
    return (np.concatenate([index, index[rounds] + 1]),
            np.concatenate([pace / leaving, pace[rounds] / joining[rounds]]),
            np.concatenate([joint, joint[rounds]]),
            np.concatenate([seen.fractions, seen.fractions[rounds]]))


def _burdens(seen: Surveyed, limits: Sequence[float]) -> Floats:
    """Return the time that each joint needs from place to place (n, 6) [s]."""
    change = np.abs(np.diff(seen.found.q, axis=0, prepend=np.array([seen.q_start])))
    burdens: Floats = change / np.array(limits)
    return burdens


def _rates(pieces: Sequence[Piece]) -> tuple[Floats, Floats]:
    """
    Return how fast the paths' ``u`` goes per parameter of each piece, where it leaves and joins.

    A corner's ``s`` goes at a pace between those of its two legs, see the timing of corners: so
    what a leg may have there, it may have at that end of the corner.
    """
    leaving, joining = np.ones(len(pieces)), np.zeros(len(pieces))
    for k, piece in enumerate(pieces):
        corner = piece.curve
        if isinstance(corner, Corner):
            if corner.fillet:
                leaving[k] = corner.length / corner.first.length
                joining[k] = corner.length / corner.second.length
            else:
                leaving[k], joining[k] = 2.0 * (1.0 - corner.leave), 2.0 * corner.join
    return leaving, joining
