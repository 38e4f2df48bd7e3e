# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Blended corners: the way from one path into the next that leaves out the waypoint between them.

The robot's maker publishes the radius within which a corner is rounded, and the shape only for
``movep`` (a circular fillet). The others are taken as the two motions crossing over: the first
slows down evenly while the second speeds up evenly, which between straight lines is a parabola.
Between two joint moves this happens in joint space, else in Cartesian space.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import acos, ceil, cos, hypot, pi, sin, sqrt, tan

from ur_cartesian_driver.motion.pose import conjugate, multiply, Pose, Vector3
from ur_cartesian_driver.planning.path import (
    ARC_CHORD_ERROR,
    CURVE_CHORD_ERROR,
    JointLine,
    Line,
    Path,
    trim_end,
    TURN_PER_SAMPLE,
)


@dataclass(frozen=True, slots=True)
class Corner:
    """
    The blend between two paths.

    ``leave`` is where it leaves the first path, ``join`` where it joins the second (their ``u``).
    """

    first: Path
    second: Path
    radius: float
    fillet: bool
    leave: float
    join: float

    @classmethod
    def between(cls, first: Path, second: Path, radius: float, *, fillet: bool) -> Corner:
        """
        Return the corner of two paths.

        :param radius: distance from the waypoint at which both paths are left [m].
        :param fillet: a circular arc (``movep``); both paths must be lines.
        """
        return cls(first, second, radius, fillet, trim_end(first, radius), second.trim(radius))

    def pose(self, s: float) -> Pose:
        """Return the pose at ``s`` in [0, 1]."""
        a = self.leave + (1.0 - self.leave) * s * (2.0 - s)
        b = self.join * s * s
        first, second = self.first, self.second
        if isinstance(first, JointLine) and isinstance(second, JointLine):
            joints = tuple(x + y - z for x, y, z in zip(
                first.joints(a), second.joints(b), second.q_start, strict=True))
            return first.arm.forward(joints) @ first.T_flange_tcp
        p_a, p_b, corner = first.pose(a), second.pose(b), second.start
        turn = multiply(multiply(p_a.quaternion, conjugate(corner.quaternion)), p_b.quaternion)
        if self.fillet and isinstance(first, Line) and isinstance(second, Line):
            return Pose(self._on_fillet(first, second, s), turn)
        (ax, ay, az), (bx, by, bz), (x, y, z) = p_a.position, p_b.position, corner.position
        return Pose((ax + bx - x, ay + by - y, az + bz - z), turn)

    @property
    def samples(self) -> int:
        """Into how many pieces to cut it so that chords follow it."""
        start, end = self.first.pose(self.leave), self.second.pose(self.join)
        # At its ends the blend turns at twice its mean rate.
        turns = ceil(2.0 * (start.angle_to(self.first.end) + self.second.start.angle_to(end))
                     / TURN_PER_SAMPLE)
        if self.fillet:
            step = sqrt(8.0 * ARC_CHORD_ERROR / max(self._fillet_radius(), 1e-3))
            return max(2, turns, ceil(pi / step * (1.0 - self._opening() / pi)))
        # A parabola with control points a, p, b leaves its chords by |a - 2 p + b| / (4 n^2).
        bend = hypot(*(a - 2.0 * p + b for a, p, b in zip(
            start.position, self.second.start.position, end.position, strict=True)))
        return max(2, turns, ceil(sqrt(bend / (4.0 * CURVE_CHORD_ERROR))))

    @property
    def room(self) -> tuple[float, float]:
        """
        How far the robot's own corner may lie beside this one, [m] and [rad].

        It may come as near to the waypoint as it likes, or cut the corner straight: this one is
        half-way between. The turn of the tool may run ahead of its way, or behind it.
        """
        start, end, corner = (self.first.pose(self.leave), self.second.pose(self.join),
                              self.second.start)
        height = corner.distance_to(start.interpolate(end, 0.5))
        turn = max(start.angle_to(corner), corner.angle_to(end))
        return 0.5 * height, 0.5 * turn

    @property
    def length(self) -> float:
        """Length of the rounded corner [m]."""
        poses = [self.pose(k / 16) for k in range(17)]
        return sum(a.distance_to(b) for a, b in pairwise(poses))

    def _opening(self) -> float:
        """Return the angle between the two legs at the waypoint [rad], pi = straight on."""
        start, end = self.first.pose(self.leave), self.second.pose(self.join)
        a = _unit(self.second.start.position, start.position)
        b = _unit(self.second.start.position, end.position)
        return acos(max(-1.0, min(1.0, a[0] * b[0] + a[1] * b[1] + a[2] * b[2])))

    def _fillet_radius(self) -> float:
        """Return the radius of the circle that touches both legs at the blend's distance [m]."""
        return self.radius * tan(min(0.5 * self._opening(), 0.5 * pi - 1e-9))

    def _on_fillet(self, first: Line, second: Line, s: float) -> Vector3:
        """Return the position on the circle that touches both legs."""
        start, end = first.pose(self.leave).position, second.pose(self.join).position
        corner, opening = second.start.position, self._opening()
        if not 1e-6 < opening < pi - 1e-6:  # straight on or straight back: no circle
            share = abs(1.0 - 2.0 * s)
            x, y, z = start if s < 0.5 else end
            return (corner[0] + share * (x - corner[0]), corner[1] + share * (y - corner[1]),
                    corner[2] + share * (z - corner[2]))
        u, w = _unit(corner, start), _unit(corner, end)
        inwards = _unit((0.0, 0.0, 0.0), (u[0] + w[0], u[1] + w[1], u[2] + w[2]))
        across = _unit(start, end)
        rho = self._fillet_radius()
        phi = (s - 0.5) * (pi - opening)
        # The center lies rho / sin(opening / 2) from the waypoint.
        depth, side = rho / sin(0.5 * opening) - rho * cos(phi), rho * sin(phi)
        return (corner[0] + depth * inwards[0] + side * across[0],
                corner[1] + depth * inwards[1] + side * across[1],
                corner[2] + depth * inwards[2] + side * across[2])


def _unit(a: Vector3, b: Vector3) -> Vector3:
    """Return the direction from a to b."""
    x, y, z = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    length = hypot(x, y, z)
    return (x / length, y / length, z / length)
