# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Places along the way of a goal, as the robot will go it: parts of paths, and the corners between.

A place every 2 mm and every degree, and at least eight on each piece. Pieces shorter than 13 mm
and 6 degrees have fewer, one every 1.6 mm and 0.8 degrees: a path of 5 mm steps has four places on
each of them. Where the joints turn fast :mod:`~.lookahead` adds places.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, pi

import numpy as np
from numpy.typing import NDArray

from ur_cartesian_driver.motion.pose import Pose, pose_from_row
from ur_cartesian_driver.motion.primitive import Joints
from ur_cartesian_driver.planning.corner import Corner, corner_rows, crossing, path_rows
from ur_cartesian_driver.planning.path import JointLine, Path
from ur_cartesian_driver.planning.pose_rows import Floats
from ur_cartesian_driver.planning.tool_spline import ToolCurve

Ints = NDArray[np.int32]

#: Largest distance of two places [m], [rad].
STEP_LENGTH = 0.002
STEP_ANGLE = pi / 180.0
#: The least number of places on a piece, and how much finer than the largest distance they then
#: are at most.
LEAST_PLACES = 8
_FINER = 1.25


@dataclass(frozen=True, slots=True, kw_only=True)
class Samples:
    """All places of a goal at which the arm was looked at, in order of time."""

    #: (n,) the index of the waypoint to which the motion leads.
    segment: Ints
    #: (n,) how much of that segment lies behind, (0, 1].
    fraction: Floats
    #: (n, 6) joint positions [rad].
    q: Floats
    #: (n, 7) the TCP in base.
    poses: Floats

    def joints_at(self, segment: int, fraction: float) -> Joints:
        """Return the joint positions at the place of a segment that is nearest to a fraction."""
        first, last = np.searchsorted(self.segment, (segment, segment + 1))
        row = int(first) + int(np.argmin(np.abs(self.fraction[first:last] - fraction)))
        a, b, c, d, e, f = self.q[row].tolist()
        return (a, b, c, d, e, f)


@dataclass(frozen=True, slots=True)
class Piece:
    """A part of one path, or a whole corner."""

    #: Index of the waypoint at the end of the path; of a corner the one that it rounds.
    index: int
    curve: Path | Corner | ToolCurve
    #: From where to where: the path's ``u``, the corner's ``s``.
    begin: float
    end: float
    places: int

    @classmethod
    def part(cls, index: int, path: Path, begin: float, end: float) -> Piece:
        """Return a part of a path."""
        share = end - begin
        turn = max(path.travel) if isinstance(path, JointLine) else path.angle
        return cls(index, path, begin, end, _places(path.length * share, turn * share))

    @classmethod
    def corner(cls, index: int, corner: Corner) -> Piece:
        """Return a corner; it has places on both sides of its waypoint."""
        turn = corner.angle
        if isinstance(corner.first, JointLine):
            turn = max(turn, (1.0 - corner.leave) * max(corner.first.travel))
        if isinstance(corner.second, JointLine):
            turn = max(turn, corner.join * max(corner.second.travel))
        return cls(index, corner, 0.0, 1.0, max(2, _places(corner.length, turn)))

    def pose(self, t: float) -> Pose:
        """Return the pose at a place."""
        if isinstance(self.curve, Corner):
            return pose_from_row(self.curve.rows(np.array([t]))[0])
        return self.curve.end if t == 1.0 else self.curve.pose(t)

    def on_segment(self, t: float) -> tuple[int, float]:
        """Return the segment and the fraction of it at a place."""
        if not isinstance(self.curve, Corner):
            return self.index, t
        leave, join = self.curve.leave, self.curve.join
        if t <= 0.5:
            return self.index, leave + (1.0 - leave) * t * (2.0 - t)
        return self.index + 1, join * t * t

    @property
    def size(self) -> tuple[float, float]:
        """Length [m] and turn [rad] of its curve."""
        return self.curve.length, self.curve.angle


def _places(length: float, angle: float) -> int:
    steps = max(length / STEP_LENGTH, angle / STEP_ANGLE)
    return max(1, ceil(steps), min(LEAST_PLACES, ceil(_FINER * steps)))


@dataclass(frozen=True, slots=True)
class Places:
    """Rows of places on pieces: the number of the piece, where on it, and the pose there."""

    #: (n,) not decreasing.
    piece: NDArray[np.intp]
    #: (n,) the ``u`` or ``s``.
    t: Floats
    #: (n, 7) the TCP in base.
    poses: Floats


def places_on(pieces: Sequence[Piece]) -> Places:
    """Return the places on pieces of the tool's space; where a piece begins is none of its."""
    piece, t = along(pieces)
    poses = np.empty((len(t), 7))
    is_corner = np.array([isinstance(p.curve, Corner) for p in pieces], dtype=np.bool_)
    rounds = is_corner[piece]
    number = np.where(is_corner, np.cumsum(is_corner), np.cumsum(~is_corner)) - 1
    corners = [p.curve for p in pieces if isinstance(p.curve, Corner)]
    paths = [p.curve for p in pieces if not isinstance(p.curve, Corner)]
    if paths:
        poses[~rounds] = path_rows(paths, number[piece[~rounds]], t[~rounds])
    if corners:
        poses[rounds] = corner_rows(corners, number[piece[rounds]], t[rounds])
    return Places(piece, t, poses)


def along(pieces: Sequence[Piece]) -> tuple[NDArray[np.intp], Floats]:
    """Return the piece (n,) and the parameter (n,) of each of its places."""
    n = np.array([p.places for p in pieces], dtype=np.intp)
    begin, end = np.array([(p.begin, p.end) for p in pieces]).reshape(-1, 2).T
    piece = np.repeat(np.arange(len(pieces)), n)
    k = np.arange(1, len(piece) + 1) - np.repeat(np.cumsum(n) - n, n)
    share = k / n[piece]
    t = np.where(share == 1.0, end[piece], begin[piece] + (end - begin)[piece] * share)
    return piece, t


def segments_of(
    pieces: Sequence[Piece], piece: NDArray[np.intp], t: Floats
) -> tuple[Ints, Floats]:
    """Return the segment (n,) and the fraction (n,) of it of each place: many ``on_segment``."""
    index = np.array([p.index for p in pieces], dtype=np.int32)[piece]
    ends = np.array(
        [
            (p.curve.leave, p.curve.join) if isinstance(p.curve, Corner) else (-1.0, 0.0)
            for p in pieces
        ]
    )[piece]
    leave, join = ends.T
    first, second = crossing(leave, join, t)
    rounds, behind = leave >= 0.0, t > 0.5
    fraction = np.where(rounds, np.where(behind, second, first), t)
    return index + (rounds & behind), fraction
