# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Sources of set-points for the buffered servo."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import numpy as np

from ur_cartesian_driver.motion.geometry.vectors import Vector6, vector6
from ur_cartesian_driver.motion.plan.joint_spline import JointSpline

#: Number of set-points of a spline computed at a time: in an array each takes a fiftieth of the
#: time that it takes alone.
BATCH = 128
_TIME_TOLERANCE = 1e-12


class SetpointSource(Protocol):
    """Gives joint positions one after the other, at the pace of the stream."""

    def next(self, dt: float) -> Vector6:
        """
        Return the next joint positions [rad].

        :param dt: nominal time since the last call [s]; 0 = hold.
        """

    @property
    def done(self) -> bool:
        """Whether the positions returned last are the end, where the arm rests."""


@runtime_checkable
class RestingSource(SetpointSource, Protocol):
    """A source whose path may rest at points."""

    def skip(self, rest: float) -> None:
        """Leave out the next ``rest`` seconds, in which the path rests."""


class SplineSetpoints:
    """The set-points of a joint spline, from its beginning to its end."""

    def __init__(self, spline: JointSpline) -> None:
        """Begin at the start of the spline."""
        #: The curve, without the pieces already passed.
        self.spline = spline
        #: The time of the last returned set-point [s].
        self.time = float(spline.times[0])
        self._step, self._rows, self._row = 0.0, list[Vector6](), 0
        self._current = vector6(spline.at(self.time)[0].tolist())

    @property
    def done(self) -> bool:
        """Whether the end of the spline is reached."""
        return self.time >= self.spline.duration - _TIME_TOLERANCE

    def replace_tail(self, spline: JointSpline) -> None:
        """Go on along another spline from its start, or from the present time if that is later."""
        self.spline = self.spline.followed_by(spline, self.time)
        self._rows, self._row = [], 0

    def skip(self, rest: float) -> None:
        """Leave out the next ``rest`` seconds, in which the path rests."""
        self.time += rest
        self._rows, self._row = [], 0

    def next(self, dt: float) -> Vector6:
        """Return the joint positions [rad] that follow the last ones after ``dt`` [s]."""
        if dt <= 0.0:
            return self._current
        if abs(dt - self._step) > _TIME_TOLERANCE or self._row >= len(self._rows):
            self._compute_batch(dt)
        self.time = min(self.time + dt, self.spline.duration)
        self._current = self._rows[self._row]
        self._row += 1
        return self._current

    def _compute_batch(self, dt: float) -> None:
        """Compute the next set-point; if the step is the same as before, the next BATCH ones."""
        count = BATCH if abs(dt - self._step) <= _TIME_TOLERANCE else 1
        self._step, self._row = dt, 0
        q, _, _ = self.spline.rows(self.time + dt * np.arange(1.0, count + 1.0))
        self._rows = [vector6(row) for row in q.tolist()]
