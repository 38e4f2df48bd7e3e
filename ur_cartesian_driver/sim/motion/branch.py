# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Which of its solutions the arm has: the one that it comes to on its way from where it is.

Beside a singularity the solution on the other side is the nearer one after a long step, while an
arm that passes there swings round and stays on its side. So where a step changes sides it is
looked at in shorter ones.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import ceil, log2

from ur_cartesian_driver.motion.pose import Pose, Vector6
from ur_cartesian_driver.sim.motion.paths import JointLine, Leg, Place
from ur_cartesian_driver.sim.motion.reach import lead, Reach

# The rest of a leg is walked in so many steps, or in shorter ones, down to this part of it, so
# that none turns a joint by more [rad].
_WALK = 8
_LEAST_WALK = 1e-4
_JUMP = 0.3
# Steps in which the arm changes sides are cut to this length [m, rad].
_FINE = 1e-5


@dataclass(frozen=True, slots=True)
class Branch:
    """An arm that stands somewhere, and where it comes to from there."""

    reach: Reach
    q: Vector6
    T_base_tcp: Pose
    T_tcp_flange: Pose

    def joints(self, place: Place) -> Vector6 | None:
        """Return the nearest joints at a place; None: there are none."""
        return self._nearest(place, self.q)

    def after(self, place: Place, h: float, step: Callable[[float], Place]) -> Vector6 | None:
        """
        Return the joints at a place that a step of ``h`` seconds leads to.

        :param step: where a shorter one leads to [s].
        """
        q = self.joints(place)
        if q is None or not isinstance(place, Pose) or not self.reach.changes_sides(self.q, q):
            return q
        way = self.T_base_tcp.distance_to(place) + self.T_base_tcp.angle_to(place)
        return self._continued(step, self.q, 0.0, h, ceil(log2(max(way / _FINE, 1.0))))

    def at_end_of(self, leg: Leg) -> Vector6 | None:
        """Return the joints that the arm will have at the end of a leg, or None: a jump."""
        if isinstance(leg, JointLine):
            return leg.end
        here, there = self.T_base_tcp, leg.pose(leg.length)
        q, done, step = self.q, 0.0, 1.0 / _WALK
        while done < 1.0:
            after = self._nearest(here.interpolate(there, min(done + step, 1.0)), q)
            if after is not None and lead(after, q) <= _JUMP:
                q, done, step = after, done + step, min(2.0 * step, 1.0 / _WALK)
            elif step < _LEAST_WALK:
                return None
            else:
                step *= 0.5
        return q

    def _continued(
        self, step: Callable[[float], Place], q: Vector6, begin: float, end: float, halvings: int
    ) -> Vector6 | None:
        """
        Return the joints at the end of a step, come to in small steps where the arm changes sides.

        :param q: the joints at ``begin``, which like ``end`` counts from now [s].
        """
        place = step(end)
        after = self._nearest(place, q)
        if (
            halvings <= 0
            or after is None
            or not isinstance(place, Pose)
            or not self.reach.changes_sides(q, after)
        ):
            return after
        middle = 0.5 * (begin + end)
        half = self._continued(step, q, begin, middle, halvings - 1)
        if half is None:
            return None
        return self._continued(step, half, middle, end, halvings - 1)

    def _nearest(self, place: Place, q: Vector6) -> Vector6 | None:
        if not isinstance(place, Pose):
            return place
        return self.reach.joints(place @ self.T_tcp_flange, q)
