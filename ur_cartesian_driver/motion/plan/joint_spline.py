# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Joint positions over time, as the polynomials that the robot evaluates too.

Each piece is fixed by positions, velocities and accelerations at its two ends (quintic), or by
positions and velocities (cubic). So one and the same curve is planned, sent as pieces, streamed
as set-points, and drawn.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.geometry.polynomials import (
    cubic_rows,
    evaluate,
    MotionRows,
    quintic_rows,
)
from ur_cartesian_driver.motion.geometry.vectors import Joints, Vector6, ZERO6
from ur_cartesian_driver.motion.plan.move_rows import SplineRows
from ur_cartesian_driver.motion.plan.primitive import Spline

#: Times that differ by less than this [s] are the same; the robot gets them in microseconds.
SAME_TIME = 5e-7


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JointSpline:
    """Consecutive pieces; before the first and after the last one, the joints are at rest."""

    #: (n + 1,) times at which pieces begin or end [s], increasing.
    times: Floats
    #: (n, 6 powers, 6 joints): polynomials in the time since the piece began, [rad / s^power].
    coefficients: Floats

    @classmethod
    def of(
        cls,
        start: Joints,
        pieces: Iterable[Spline],
        *,
        velocities: Vector6 | None = None,
        accelerations: Vector6 | None = None,
        start_time: float = 0.0,
    ) -> JointSpline:
        """
        Return the spline of consecutive pieces, of which the first begins at ``start`` [rad].

        :param velocities: joint velocities at the start [rad/s]; None = zero.
        :param accelerations: joint accelerations at the start [rad/s^2]; None = zero.
        :param start_time: when the first piece begins [s].
        """
        rows = SplineRows.of(pieces)
        reached = np.where(rows.quintic[:, None], rows.accelerations, 0.0)
        after = MotionRows(rows.targets, rows.velocities, reached)
        first = start, velocities or ZERO6, accelerations or ZERO6
        before = MotionRows(
            *(np.concatenate([[a], b])[:-1] for a, b in zip(first, after, strict=True))
        )
        coefficients = np.where(
            rows.quintic[:, None, None],
            quintic_rows(rows.durations, before, after),
            cubic_rows(rows.durations, before, after),
        )
        times = start_time + np.concatenate([[0.0], np.cumsum(rows.durations)])
        return cls(times=times, coefficients=coefficients)

    @classmethod
    def through(cls, times: Floats, rows: MotionRows, *, quintic: bool) -> JointSpline:
        """Return the spline that has the states ``rows`` (n + 1, 6) at ``times`` (n + 1,) [s]."""
        before, after = (
            MotionRows(*(column[k] for column in rows)) for k in (slice(None, -1), slice(1, None))
        )
        polynomials = quintic_rows if quintic else cubic_rows
        return cls(times=times, coefficients=polynomials(np.diff(times), before, after))

    @property
    def duration(self) -> float:
        """The time at which the last piece ends [s]: the duration if the first begins at 0."""
        return float(self.times[-1])

    def followed_by(self, other: JointSpline, since: float) -> JointSpline:
        """
        Return this spline up to the start of another one, followed by the other one.

        :param since: time [s]; pieces that end before it are left out.
        """
        end = int(np.searchsorted(self.times, other.times[0] - SAME_TIME))
        first = min(self.piece(since), end)
        return JointSpline(
            times=np.concatenate([self.times[first:end], other.times]),
            coefficients=np.concatenate([self.coefficients[first:end], other.coefficients]),
        )

    def at(self, time: float) -> tuple[Floats, Floats, Floats]:
        """Return positions [rad], velocities [rad/s], accelerations [rad/s^2] at a time, (6,)."""
        q, qd, qdd = self.rows(np.array([time]))
        return q[0], qd[0], qdd[0]

    def rows(self, times: Floats) -> tuple[Floats, Floats, Floats]:
        """
        Return joint positions, velocities and accelerations, (m, 6) each, at times (m,) [s].

        Before the first piece and after the last one, the joints are at rest.
        """
        inside = np.clip(times, self.times[0], self.times[-1])
        k = np.clip(
            np.searchsorted(self.times, inside, side='right') - 1, 0, len(self.coefficients) - 1
        )
        q, qd, qdd = evaluate(self.coefficients[k], inside - self.times[k])
        outside = ((times < self.times[0]) | (times > self.times[-1]))[:, None]
        return q, np.where(outside, 0.0, qd), np.where(outside, 0.0, qdd)

    def piece(self, time: float) -> int:
        """Return the index of the piece that runs at a time, or of the nearest piece."""
        return min(max(bisect_right(self.times, time) - 1, 0), len(self.coefficients) - 1)
