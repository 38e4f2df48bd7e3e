# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The tool spline: the pose of the tool over time in a SPLINE or SERVO goal.

From point to point the position is a polynomial, and so is the rotation vector from the
orientation at the start of the piece (:mod:`~.rotation_rows`): cubic if only twists are given,
quintic if accelerations are given, too. The given values are met exactly at the points.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Floats, Indices
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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ToolPoints:
    """Pose, twist and acceleration of the tool at n + 1 times, of which the first is the start."""

    #: (n + 1,) [s], increasing.
    times: Floats
    #: (n + 1, 7)
    poses: Floats
    #: (n + 1, 6) [m/s], [rad/s] along the axes of the frame.
    twists: Floats
    #: (n + 1, 6) [m/s^2], [rad/s^2]
    accelerations: Floats
    #: Whether the accelerations are used: the pieces are quintic, not cubic.
    quintic: bool


class ToolRows(NamedTuple):
    """The tool at m times."""

    #: (m, 7), (m, 6), (m, 6)
    poses: Floats
    twists: Floats
    accelerations: Floats


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ToolSpline:
    """A spline of n pieces, in the robot's base."""

    #: (n + 1,) [s]
    times: Floats
    #: (n, 6 powers, 3) [m / s^power]
    positions: Floats
    #: (n, 6 powers, 3) [rad / s^power], rotation vectors from ``orientations`` (n, 4)
    turns: Floats
    orientations: Floats

    @classmethod
    def through(cls, points: ToolPoints) -> ToolSpline:
        """Return the curve through points in base."""
        begin, end = slice(None, -1), slice(1, None)
        x, v, a = points.poses[:, :3], points.twists, points.accelerations
        orientations = points.poses[:, 3:]
        turn = log_rows(multiply_rows(orientations[end], conjugate_rows(orientations[begin])))
        zero = np.zeros_like(turn)
        between = quintic_rows if points.quintic else cubic_rows
        durations = np.diff(points.times)
        return cls(
            times=points.times,
            orientations=orientations[begin],
            positions=between(
                durations,
                MotionRows(x[begin], v[begin, :3], a[begin, :3]),
                MotionRows(x[end], v[end, :3], a[end, :3]),
            ),
            # At the start the vector is 0, so its derivatives are the angular rates.
            turns=between(
                durations,
                MotionRows(zero, v[begin, 3:], a[begin, 3:]),
                rotation_rates(turn, v[end, 3:], a[end, 3:]),
            ),
        )

    def rows(self, piece: Indices, t: Floats) -> ToolRows:
        """
        Return the tool on pieces (m,).

        :param t: (m,) time since the piece began [s].
        """
        return ToolRows(self.poses(piece, t), *self.rates(piece, t))

    def rates(self, piece: Indices, t: Floats) -> tuple[Floats, Floats]:
        """Return the twists and the accelerations of :meth:`rows` (m, 6)."""
        x, turn = evaluate(self.positions[piece], t), evaluate(self.turns[piece], t)
        w, e = angular_rates(turn)
        return np.concatenate([x.v, w], axis=1), np.concatenate([x.a, e], axis=1)

    def poses(self, piece: Indices, t: Floats) -> Floats:
        """Return the poses of :meth:`rows` (m, 7)."""
        position, turn = self.vectors(piece, t)
        turned = multiply_rows(exp_rows(turn), self.orientations[piece])
        return np.concatenate([position, normalized_rows(turned)], axis=1)

    def vectors(self, piece: Indices, t: Floats) -> tuple[Floats, Floats]:
        """Return positions [m] and rotation vectors since the piece began [rad] (m, 3)."""
        return values(self.positions[piece], t), values(self.turns[piece], t)

    def at(self, times: Floats) -> ToolRows:
        """Return the tool at times (m,) [s]; where two pieces meet, on the later piece."""
        piece = np.clip(
            np.searchsorted(self.times, times, side='right') - 1, 0, len(self.positions) - 1
        )
        return self.rows(piece, times - self.times[piece])

    def stretch_times(self, factor: float) -> ToolSpline:
        """Return the same path with all times multiplied by a factor."""
        powers = factor ** -np.arange(6.0)[:, None]
        return replace(
            self,
            times=self.times[0] + factor * (self.times - self.times[0]),
            positions=self.positions * powers,
            turns=self.turns * powers,
        )


@dataclass(frozen=True, slots=True, eq=False)
class ToolSplinePath:
    """The pieces of a spline as a :class:`~.blended_path.CurveSequence`, each a segment."""

    rests_at_points: ClassVar[bool] = False
    spline: ToolSpline
    #: (n,) the number of samples that measure the extent of each piece.
    sample_count: Indices

    def rows(self, number: Indices, t: Floats) -> Floats:
        """See :class:`~.blended_path.CurveSequence`."""
        piece = number // 2
        return self.spline.poses(piece, t * np.diff(self.spline.times)[piece])

    def extent(self, number: int) -> tuple[float, float]:
        """See :class:`~.blended_path.CurveSequence`; measured along the chords of its samples."""
        t = np.linspace(0.0, 1.0, int(self.sample_count[number // 2]) + 1)
        a, b = (rows := self.rows(np.full(len(t), number), t))[:-1], rows[1:]
        turn = angle_rows(a[:, 3:], b[:, 3:]).sum()
        return float(distance_rows(a, b).sum()), float(turn)

    def locate(self, number: Indices, t: Floats) -> tuple[Indices, Floats]:
        """See :class:`~.blended_path.CurveSequence`."""
        return number // 2, t
