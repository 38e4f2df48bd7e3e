# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Samples along the path of a goal: on parts of curves, and on the blends between them.

One sample every 2 mm and every degree, and at least eight on each piece. Pieces shorter than 13 mm
and 6 degrees have fewer, one every 1.6 mm and 0.8 degrees: a path of 5 mm steps has four samples
on each of them. Where the joints turn fast
:mod:`~ur_cartesian_driver.planning.preflight.joint_path_solver` adds samples.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, pi

import numpy as np
from numpy.typing import NDArray

from ur_cartesian_driver.motion.pose import Pose
from ur_cartesian_driver.motion.pose_rows import Floats
from ur_cartesian_driver.motion.primitive import Joints
from ur_cartesian_driver.motion.vectors import vector6
from ur_cartesian_driver.planning.geometry.blend import Blend, crossfade, curve_rows
from ur_cartesian_driver.planning.geometry.curves import Curve, JointLineCurve, SegmentCurve

Ints = NDArray[np.int32]

#: Maximum distance of two samples [m], [rad].
STEP_LENGTH = 0.002
STEP_ANGLE = pi / 180.0
#: Minimum number of samples on a piece, as long as they are no closer than the maximum distance
#: divided by this.
MIN_SAMPLES = 8
_MIN_REFINEMENT = 1.25


@dataclass(frozen=True, slots=True, kw_only=True)
class PathSamples:
    """All samples of a goal, in order of time."""

    #: (n,) the index of the waypoint to which the motion leads.
    segment: Ints
    #: (n,) the fraction of that segment, (0, 1].
    fraction: Floats
    #: (n, 6) joint positions [rad].
    q: Floats
    #: (n, 7) the TCP in base.
    poses: Floats

    def joints_at(self, segment: int, fraction: float) -> Joints:
        """Return the joint positions at the sample of a segment closest to a fraction."""
        first, last = np.searchsorted(self.segment, (segment, segment + 1))
        row = int(first) + int(np.argmin(np.abs(self.fraction[first:last] - fraction)))
        return vector6(self.q[row].tolist())


@dataclass(frozen=True, slots=True)
class CurvePiece:
    """A part of the curve of one segment, or a whole blend."""

    #: Index of the waypoint at the end of the curve; of a blend the one that it rounds.
    index: int
    curve: Curve
    #: Its range: the curve's ``u``, the blend's ``s``.
    begin: float
    end: float
    sample_count: int

    @classmethod
    def part(cls, index: int, path: SegmentCurve, begin: float, end: float) -> CurvePiece:
        """Return a part of a segment's curve."""
        part, turn = end - begin, path.joint_travel or path.angle
        return cls(index, path, begin, end, _sample_count(path.length * part, turn * part))

    @classmethod
    def blend(cls, index: int, blend: Blend) -> CurvePiece:
        """Return a blend; it has samples on both sides of its waypoint."""
        turn = max(blend.angle, blend.joint_travel)
        return cls(index, blend, 0.0, 1.0, max(2, _sample_count(blend.length, turn)))

    @property
    def is_blend(self) -> bool:
        """Whether it is a blend."""
        return isinstance(self.curve, Blend)

    @property
    def is_in_joint_space(self) -> bool:
        """Whether joint positions, and not poses, define it."""
        return isinstance(self.curve, JointLineCurve) or (
            isinstance(self.curve, Blend) and self.curve.in_joint_space
        )

    def pose(self, t: float) -> Pose:
        """Return the pose at a parameter."""
        return self.curve.end if t == 1.0 else self.curve.pose(t)

    def joint_rows(self, t: Floats) -> Floats:
        """Return the joint positions (n, 6) [rad] at parameters (n,) of a piece in joint space."""
        assert isinstance(self.curve, JointLineCurve | Blend)
        return self.curve.joint_rows(t)

    def on_segment(self, t: float) -> tuple[int, float]:
        """Return the segment and the fraction of it at a parameter."""
        if not isinstance(self.curve, Blend):
            return self.index, t
        after, fraction = self.curve.locate(t)
        return self.index + after, fraction


def _sample_count(length: float, angle: float) -> int:
    steps = max(length / STEP_LENGTH, angle / STEP_ANGLE)
    return max(1, ceil(steps), min(MIN_SAMPLES, ceil(_MIN_REFINEMENT * steps)))


@dataclass(frozen=True, slots=True)
class PoseSamples:
    """Rows of samples on pieces: the number of the piece, the parameter, and the pose."""

    #: (n,) not decreasing.
    piece: NDArray[np.intp]
    #: (n,) the ``u`` or ``s``.
    t: Floats
    #: (n, 7) the TCP in base.
    poses: Floats


def sample_poses(pieces: Sequence[CurvePiece]) -> PoseSamples:
    """Return the samples on Cartesian pieces; the start of a piece belongs to the one before."""
    piece, t = sample_parameters(pieces)
    return PoseSamples(piece, t, curve_rows([p.curve for p in pieces], piece, t))


def sample_parameters(pieces: Sequence[CurvePiece]) -> tuple[NDArray[np.intp], Floats]:
    """Return the piece (n,) and the parameter (n,) of each sample."""
    n = np.array([p.sample_count for p in pieces], dtype=np.intp)
    begin, end = np.array([(p.begin, p.end) for p in pieces]).reshape(-1, 2).T
    piece = np.repeat(np.arange(len(pieces)), n)
    k = np.arange(1, len(piece) + 1) - np.repeat(np.cumsum(n) - n, n)
    part = k / n[piece]
    t = np.where(part == 1.0, end[piece], begin[piece] + (end - begin)[piece] * part)
    return piece, t


def segments_of(
    pieces: Sequence[CurvePiece], piece: NDArray[np.intp], t: Floats
) -> tuple[Ints, Floats]:
    """Return the segment (n,) of each sample and the fraction (n,) of it; see ``on_segment``."""
    index = np.array([p.index for p in pieces], dtype=np.int32)[piece]
    ends = np.array(
        [
            (p.curve.leave, p.curve.join) if isinstance(p.curve, Blend) else (-1.0, 0.0)
            for p in pieces
        ]
    )[piece]
    leave, join = ends.T
    first, second = crossfade(leave, join, t)
    on_blend, after_waypoint = leave >= 0.0, t > 0.5
    fraction = np.where(on_blend, np.where(after_waypoint, second, first), t)
    return index + (on_blend & after_waypoint), fraction
