# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The pieces of a spline that were planned in one go, and the state of the joints on them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Indices, Int32s
from ur_cartesian_driver.motion.geometry.polynomials import evaluate
from ur_cartesian_driver.motion.geometry.vectors import vector6, ZERO6
from ur_cartesian_driver.motion.plan.joint_spline import JointSpline, SAME_TIME
from ur_cartesian_driver.motion.plan.plan import PlannedSegment
from ur_cartesian_driver.motion.plan.primitive import Spline
from ur_cartesian_driver.planning.spline.spline_planner import SplineState

# Digits of joint rates (further ones are rounding errors) and of times (microseconds).
_DIGITS, _TIME_DIGITS = 12, 6


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlannedPart:
    """The pieces of one append plan; a new tail may begin on them."""

    #: The joints in motion time, including the ending.
    spline: JointSpline
    #: For each piece up to the last point: the point to which it leads, and the number of records
    #: of the goal before it.
    waypoints: Int32s
    records_before: Indices

    def begin(self, row: int) -> float:
        """Return the time at which a piece begins, or at which the piece before it ends [s]."""
        return float(self.spline.times[row])

    def row_at(self, time: float) -> int:
        """Return the row of the piece that runs at a time [s]."""
        times = self.spline.times[: len(self.waypoints)]
        return max(int(np.searchsorted(times, time + SAME_TIME, side='right')) - 1, 0)

    def state(self, row: int, time: float) -> SplineState:
        """Return the state on a piece at a time [s], as the robot program continues from it."""
        coefficients = self.spline.coefficients[row : row + 1]
        rows = evaluate(coefficients, np.array([time - self.begin(row)]))
        q, qd, qdd = (vector6(values[0].tolist()) for values in rows)
        qd, qdd = (vector6(round(rate, _DIGITS) + 0.0 for rate in rates) for rates in (qd, qdd))
        return SplineState(time=time, q=q, qd=qd, qdd=ZERO6 if self._is_cubic(row) else qdd)

    def piece(self, row: int, end_time: float) -> PlannedSegment:
        """Return a piece that is cut off at a time [s]."""
        end, duration = self.state(row, end_time), end_time - self.begin(row)
        return PlannedSegment(
            primitive=Spline(
                target=end.q,
                velocities=end.qd,
                accelerations=None if self._is_cubic(row) else end.qdd,
                duration=round(duration, _TIME_DIGITS),
            ),
            waypoint=int(self.waypoints[row]),
            length=0.0,
            angle=0.0,
            duration=round(duration, _TIME_DIGITS),
            joints=end.q,
            report_line='',
        )

    def _is_cubic(self, row: int) -> bool:
        return not self.spline.coefficients[row, 4:].any()
