# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""What the look ahead has seen: all its places, and what of them burdens each segment most."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

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
            poses=np.concatenate([seen.found.poses for seen in self._seen]),
        )

    def nearest(self) -> dict[int, Nearest]:
        """Return what comes nearest to its bound, by segment."""
        samples = self.samples()
        measures = np.concatenate([seen.measures for seen in self._seen])
        return nearest_of(self._arm, samples.q, measures, samples.segment, samples.fraction)

    def paces(self) -> dict[int, Pace]:
        """Return the time that the joints need for each whole segment, by segment."""
        limits = np.array(self._arm.model.max_joint_speed)
        parts = [_paces(seen, limits) for seen in self._seen]
        segment, time, joint, fraction, burden, quick = (
            np.concatenate(column) for column in zip(*parts, strict=True)
        )
        order = np.lexsort((time, segment))
        bounds = np.flatnonzero(np.diff(segment[order], append=segment[order[-1]] + 1))
        last = order[bounds]
        quickest = np.minimum.reduceat(quick[order], np.concatenate([[0], bounds[:-1] + 1]))
        columns = (
            time[last],
            joint[last],
            fraction[last],
            np.minimum(quickest, time[last]),
            np.bincount(segment, burden)[segment[last]],
        )
        return {
            index: Pace(*row)
            for index, *row in zip(
                segment[last].tolist(), *(column.tolist() for column in columns), strict=True
            )
        }


class _Paces(NamedTuple):
    """What places say of their segments, each (n,); those in corners do so of two."""

    segment: Ints
    #: The time of the whole segment at the pace there [s], and the joint that is the slowest.
    time: Floats
    joint: NDArray[np.intp]
    fraction: Floats
    #: The time from the place before [s]; half of it where that counts for two segments.
    burden: Floats
    #: The time at the pace there, inf in corners, where joints may turn round.
    quick: Floats


def _paces(seen: Surveyed, limits: Floats) -> _Paces:
    """Return how fast a segment may go at each place."""
    found = seen.found
    begin = np.array([piece.begin for piece in seen.pieces])[found.piece]
    before = np.concatenate([[0.0], found.t[:-1]])
    is_first = np.diff(found.piece, prepend=-1) != 0
    way = found.t - np.where(is_first, begin, before)
    change = np.abs(np.diff(found.q, axis=0, prepend=np.array([seen.q_start])))
    burdens = change / limits
    joint = np.argmax(burdens, axis=1)
    burden = np.take_along_axis(burdens, joint[:, None], axis=1)[:, 0]
    pace = np.where(way > _NO_WAY, burden / np.maximum(way, _NO_WAY), 0.0)
    quick = np.where(way > _NO_WAY, pace, np.inf)
    index = np.array([p.index for p in seen.pieces], dtype=np.int32)[found.piece]
    leaving, joining = (rate[found.piece] for rate in _rates(seen.pieces))
    rounds = np.flatnonzero(joining > 0.0)
    burden[rounds] *= 0.5
    quick[rounds] = np.inf
    return _Paces(
        np.concatenate([index, index[rounds] + 1]),
        np.concatenate([pace / leaving, pace[rounds] / joining[rounds]]),
        np.concatenate([joint, joint[rounds]]),
        np.concatenate([seen.fractions, seen.fractions[rounds]]),
        np.concatenate([burden, burden[rounds]]),
        np.concatenate([quick, quick[rounds]]),
    )


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
