# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Spline pieces that were planned together, and the state of the joints on them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Indices, Int32s
from ur_cartesian_driver.motion.geometry.polynomials import evaluate
from ur_cartesian_driver.motion.geometry.vectors import vector6, ZERO6
from ur_cartesian_driver.motion.plan.joint_spline import JointSpline, SAME_TIME
from ur_cartesian_driver.motion.plan.move_rows import SplineRows
from ur_cartesian_driver.motion.plan.plan import LateLines, PlannedRows
from ur_cartesian_driver.motion.plan.primitive import Spline
from ur_cartesian_driver.planning.spline.spline_planner import SplineState

# Decimal places of joint rates (further digits are rounding errors) and of times (microseconds).
_DIGITS, _TIME_DIGITS = 12, 6


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlannedPart:
    """
    The spline pieces of one append plan.

    The tail of the goal can be replaced from any time on these pieces.
    """

    #: The joints over motion time, including the stop after the last point, if there is one.
    spline: JointSpline
    #: For each piece but that stop, the point at its end.
    waypoints: Int32s
    #: For each piece but that stop, the number of records of the goal before the piece.
    records_before: Indices

    def begin(self, row: int) -> float:
        """Return the motion time [s] at which piece ``row`` begins and piece ``row - 1`` ends."""
        return float(self.spline.times[row])

    def row_at(self, time: float) -> int:
        """Return the row of the piece that runs at a motion time [s]."""
        times = self.spline.times[: len(self.waypoints)]
        return max(int(np.searchsorted(times, time + SAME_TIME, side='right')) - 1, 0)

    def state(self, row: int, time: float) -> SplineState:
        """
        Return the state at a motion time [s] on piece ``row``.

        On a cubic piece, the acceleration is given as 0, because a cubic piece fixes none.
        """
        coefficients = self.spline.coefficients[row : row + 1]
        rows = evaluate(coefficients, np.array([time - self.begin(row)]))
        q, qd, qdd = (vector6(values[0].tolist()) for values in rows)
        qd, qdd = (vector6(round(rate, _DIGITS) + 0.0 for rate in rates) for rates in (qd, qdd))
        return SplineState(time=time, q=q, qd=qd, qdd=ZERO6 if self._is_cubic(row) else qdd)

    def piece(self, row: int, end_time: float) -> PlannedRows:
        """Return the piece of a row, cut off at the motion time ``end_time`` [s]."""
        end = self.state(row, end_time)
        piece = Spline(
            target=end.q,
            velocities=end.qd,
            accelerations=None if self._is_cubic(row) else end.qdd,
            duration=round(end_time - self.begin(row), _TIME_DIGITS),
        )
        return unreported_piece(piece, int(self.waypoints[row]))

    def _is_cubic(self, row: int) -> bool:
        return not self.spline.coefficients[row, 4:].any()


def unreported_piece(piece: Spline, waypoint: int) -> PlannedRows:
    """Return a piece to a waypoint as a row without a line in the report."""
    number, none = np.array([waypoint], dtype=np.int32), np.zeros(1)
    line = LateLines(range(1), lambda _: [''])
    return PlannedRows.of_pieces(SplineRows.of([piece]), number, none, none, line)
