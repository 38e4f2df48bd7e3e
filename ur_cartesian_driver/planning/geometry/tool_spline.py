# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The tool spline: the pose of the tool over time in a SPLINE or SERVO goal.

A piece of the spline leads from one point to the next. On each piece, the position of the tool and
its rotation vector since the start of the piece (:mod:`~.rotation_rows`) are polynomials in time:
cubic if only twists are given, quintic if accelerations are given, too. At each point the spline
has exactly the given pose and rates.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats, Indices
from ur_cartesian_driver.motion.geometry.polynomials import (
    cubic_rows,
    evaluate,
    MotionRows,
    quintic_rows,
    values,
)
from ur_cartesian_driver.motion.geometry.pose_rows import (
    angle_rows,
    conjugate_rows,
    distance_rows,
    multiply_rows,
    normalized_rows,
)
from ur_cartesian_driver.motion.geometry.rotation_rows import (
    angular_rates,
    exp_rows,
    log_rows,
    rotation_rates,
)

# Rows per block, so that their coefficients stay in the CPU cache.
_BLOCK = 2048


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ToolPoints:
    """Pose, twist and acceleration of the tool at the start of a spline and at n later times."""

    #: (n + 1,) [s], increasing.
    times: Floats
    #: (n + 1, 7) x y z [m], unit quaternion x y z w
    poses: Floats
    #: (n + 1, 6) [m/s], [rad/s], in the axes of the frame that the poses refer to.
    twists: Floats
    #: (n + 1, 6) [m/s^2], [rad/s^2], likewise
    accelerations: Floats
    #: Whether the pieces are quintic and have the given accelerations; if not, they are cubic.
    quintic: bool


class ToolRows(NamedTuple):
    """Poses (m, 7), twists (m, 6) and accelerations (m, 6) of the tool at m times."""

    poses: Floats
    twists: Floats
    accelerations: Floats


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ToolSpline:
    """A spline of n pieces, in the frame of its points."""

    #: (n + 1,) the times of the points [s]
    times: Floats
    #: (n, 6 powers, 3) coefficients of the position [m / s^power]
    positions: Floats
    #: (n, 6 powers, 3) coefficients of the rotation vector [rad / s^power]
    turns: Floats
    #: (n, 4) the orientation at the start of each piece, where its rotation vector is zero
    orientations: Floats
    #: (n,) whether the tool may turn on each piece
    is_turning: Flags

    @classmethod
    def through(cls, points: ToolPoints) -> ToolSpline:
        """Return the spline through points."""
        begin, end = slice(None, -1), slice(1, None)
        x, v, a = points.poses[:, :3], points.twists, points.accelerations
        orientations = points.poses[:, 3:]
        between = quintic_rows if points.quintic else cubic_rows
        durations = np.diff(points.times)
        positions = between(
            durations,
            MotionRows(x[begin], v[begin, :3], a[begin, :3]),
            MotionRows(x[end], v[end, :3], a[end, :3]),
        )
        turns = np.zeros_like(positions)
        rates = np.concatenate([v[:, 3:], a[:, 3:]], axis=1)
        changes = np.concatenate(
            [rates[begin], rates[end], orientations[end] - orientations[begin]], axis=1
        )
        is_turning: Flags = np.any(changes, axis=1)
        turning = np.flatnonzero(is_turning)
        if len(turning):
            to, since = orientations[end][turning], orientations[begin][turning]
            turn = log_rows(multiply_rows(to, conjugate_rows(since)))
            # At the start of a piece the rotation vector is 0, so its derivatives are the angular
            # rates.
            turns[turning] = between(
                durations[turning],
                MotionRows(np.zeros_like(turn), v[begin, 3:][turning], a[begin, 3:][turning]),
                rotation_rates(turn, v[end, 3:][turning], a[end, 3:][turning]),
            )
        return cls(
            times=points.times,
            orientations=orientations[begin],
            positions=positions,
            turns=turns,
            is_turning=is_turning,
        )

    def rows(self, piece: Indices, t: Floats) -> ToolRows:
        """
        Return poses, twists and accelerations of the tool at m times.

        :param piece: (m,) the piece of each time.
        :param t: (m,) time since this piece began [s].
        """
        return ToolRows(self.poses(piece, t), *self.rates(piece, t))

    def rates(self, piece: Indices, t: Floats) -> tuple[Floats, Floats]:
        """Return the twists and the accelerations that :meth:`rows` returns, (m, 6) each."""
        twists, accelerations = np.zeros((2, len(piece), 6))
        for begin in range(0, len(piece), _BLOCK):
            some = slice(begin, begin + _BLOCK)
            _, v, a = evaluate(self.positions[piece[some]], t[some])
            twists[some, :3], accelerations[some, :3] = v, a
        rows = self._turning(piece)
        if len(rows):
            turn = evaluate(self.turns[piece[rows]], t[rows])
            twists[rows, 3:], accelerations[rows, 3:] = angular_rates(turn)
        return twists, accelerations

    def poses(self, piece: Indices, t: Floats) -> Floats:
        """Return the poses (m, 7) that :meth:`rows` returns."""
        position, orientations = values(self.positions[piece], t), self.orientations[piece]
        rows = self._turning(piece)
        if len(rows):
            turn = values(self.turns[piece[rows]], t[rows])
            turned = multiply_rows(exp_rows(turn), orientations[rows])
            orientations[rows] = normalized_rows(turned)
        return np.concatenate([position, orientations], axis=1)

    def _turning(self, piece: Indices) -> Indices:
        """Return the rows of pieces (m,) on which the tool turns; often there are none."""
        return np.flatnonzero(self.is_turning[piece])

    def vectors(self, piece: Indices, t: Floats) -> tuple[Floats, Floats]:
        """Return positions [m] and rotation vectors since the piece began [rad], (m, 3) each."""
        return values(self.positions[piece], t), values(self.turns[piece], t)

    def at(self, times: Floats) -> ToolRows:
        """Return the tool's motion at times (m,) [s]; where two pieces meet, on the later one."""
        piece = np.clip(
            np.searchsorted(self.times, times, side='right') - 1, 0, len(self.positions) - 1
        )
        return self.rows(piece, times - self.times[piece])

    def stretch_times(self, factor: float) -> ToolSpline:
        """Return the same path with the time since the start multiplied by a factor."""
        powers = factor ** -np.arange(6.0)[:, None]
        return replace(
            self,
            times=self.times[0] + factor * (self.times - self.times[0]),
            positions=self.positions * powers,
            turns=self.turns * powers,
        )


@dataclass(frozen=True, slots=True, eq=False)
class ToolSplinePath:
    """A spline as a :class:`~.blended_path.CurveSequence`, whose curves are the pieces."""

    rests_at_points: ClassVar[bool] = False
    spline: ToolSpline
    #: (n,) the number of samples that measure the extent of each piece.
    sample_count: Indices
    #: Returns the segment at each time (m,) [s] and the fraction of the segment before it; None =
    #: each piece is a segment.
    places: Callable[[Floats], tuple[Indices, Floats]] | None = None

    def rows(self, number: Indices, t: Floats) -> Floats:
        """See :class:`~.blended_path.CurveSequence`."""
        piece = number // 2
        return self.spline.poses(piece, t * np.diff(self.spline.times)[piece])

    def extent(self, number: int) -> tuple[float, float]:
        """See :class:`~.blended_path.CurveSequence`; measured along chords between samples."""
        t = np.linspace(0.0, 1.0, int(self.sample_count[number // 2]) + 1)
        a, b = (rows := self.rows(np.full(len(t), number), t))[:-1], rows[1:]
        turn = angle_rows(a[:, 3:], b[:, 3:]).sum()
        return float(distance_rows(a, b).sum()), float(turn)

    def locate(self, number: Indices, t: Floats) -> tuple[Indices, Floats]:
        """See :class:`~.blended_path.CurveSequence`."""
        piece = number // 2
        if self.places is None:
            return piece, t
        return self.places(self.spline.times[piece] + t * np.diff(self.spline.times)[piece])
