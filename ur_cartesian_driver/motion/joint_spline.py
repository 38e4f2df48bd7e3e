# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Joint positions over time, as the polynomials that the robot evaluates too.

Each piece is fixed by positions, velocities and accelerations at its two ends (quintic), or by
positions and velocities (cubic). So what is planned, sent, streamed as set-points and drawn is one
curve.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ur_cartesian_driver.motion.pose import Vector6
from ur_cartesian_driver.motion.primitive import Joints, Spline

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JointSpline:
    """Pieces that follow each other in time; before the first and after the last it rests."""

    #: (n + 1,) [s], increasing.
    times: Floats
    #: (n, 6 powers, 6 joints): the polynomial of the time since the piece began, [rad / s^power].
    coefficients: Floats

    @classmethod
    def of(cls, start: Joints, pieces: Iterable[Spline], *, velocities: Vector6 | None = None,
           accelerations: Vector6 | None = None) -> JointSpline:
        """
        Return the curve through pieces, from joint positions [rad].

        :param velocities: those at the start [rad/s]; None = at rest. So ``accelerations``.
        """
        q, qd, qdd = (np.array(v if v is not None else np.zeros(6))
                      for v in (start, velocities, accelerations))
        times, rows = [0.0], []
        for piece in pieces:
            rows.append(_piece(q, qd, qdd, piece))
            times.append(times[-1] + piece.duration)
            q, qd = np.array(piece.target), np.array(piece.velocities)
            qdd = np.zeros(6) if piece.accelerations is None else np.array(piece.accelerations)
        return cls(times=np.array(times), coefficients=np.array(rows).reshape(-1, 6, 6))

    @property
    def duration(self) -> float:
        """The time of its end [s]."""
        return float(self.times[-1])

    def at(self, time: float) -> tuple[Floats, Floats, Floats]:
        """Return position [rad], velocity [rad/s], acceleration [rad/s^2] (6,) at a time."""
        q, qd, qdd = self.rows(np.array([time]))
        return q[0], qd[0], qdd[0]

    def rows(self, times: Floats) -> tuple[Floats, Floats, Floats]:
        """Return the same (m, 6) for many times (m,); times outside count as the ends, at rest."""
        inside = np.clip(times, self.times[0], self.times[-1])
        k = np.clip(np.searchsorted(self.times, inside, side='right') - 1,
                    0, len(self.coefficients) - 1)
        t = (inside - self.times[k])[:, None]
        c = self.coefficients[k]
        q = c[:, 5]
        qd = np.zeros_like(q)
        qdd = np.zeros_like(q)
        for power in range(4, -1, -1):  # Horner, with both derivatives
            qdd = qdd * t + 2.0 * qd
            qd = qd * t + q
            q = q * t + c[:, power]
        outside = ((times < self.times[0]) | (times > self.times[-1]))[:, None]
        return q, np.where(outside, 0.0, qd), np.where(outside, 0.0, qdd)

    def piece(self, time: float) -> int:
        """Return the index of the piece that runs at a time."""
        return min(max(bisect_right(self.times, time) - 1, 0), len(self.coefficients) - 1)


def _piece(q: Floats, qd: Floats, qdd: Floats, piece: Spline) -> Floats:
    """Return the coefficients (6 powers, 6 joints) of one piece from a state to its end."""
    T = piece.duration
    d, vd = np.array(piece.target) - q, np.array(piece.velocities)
    if piece.accelerations is None:
        a = np.stack([q, qd, 3.0 * d / T**2 - (2.0 * qd + vd) / T,
                      -2.0 * d / T**3 + (qd + vd) / T**2])
        return np.concatenate([a, np.zeros((2, 6))])
    e = np.array(piece.accelerations)
    return np.stack([
        q, qd, 0.5 * qdd,
        (20.0 * d - (8.0 * vd + 12.0 * qd) * T - (3.0 * qdd - e) * T**2) / (2.0 * T**3),
        (-30.0 * d + (14.0 * vd + 16.0 * qd) * T + (3.0 * qdd - 2.0 * e) * T**2) / (2.0 * T**4),
        (12.0 * d - 6.0 * (vd + qd) * T - (qdd - e) * T**2) / (2.0 * T**5)])
