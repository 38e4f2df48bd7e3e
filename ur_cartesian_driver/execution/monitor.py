# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Where the controller is on the planned path, and where the tool should be.

The reference path is compared as a geometric line: a robot that was slowed down, or that has its
own speed profile, is not off the path because of that.

Progress is that of the controller's own target, which has no noise and which nothing pushes: only
where *it* leaves the path does the robot another motion than it was told. What is desired of the
tool is the place nearest to it within what a lag behind the target explains. The controller goes
on while the arm is pushed along its path, so that is an error too, beyond the lag.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import inf

import numpy as np
from numpy.typing import NDArray

from ur_cartesian_driver.motion.plan import ReferencePath
from ur_cartesian_driver.motion.pose import Pose, pose_from_row, Vector6

#: How much a radian counts in the distance that decides which place is the nearest [m/rad].
RADIAN = 0.1
#: How far the target may be from the place found before, beyond what its speed explains [m].
SLACK = 0.005
#: How far the tool may be before or behind its target and be on time: this long at the speed of
#: the target [s], and this far [m]. Position controllers of arms lag by some cycles.
LAG_TIME = 0.02
LAG_WAY = 0.0005
#: Up to so many edges are looked at one by one.
FEW = 2


@dataclass(frozen=True, slots=True)
class Place:
    """A place on the reference path: between row ``row`` and the next, at ``fraction``."""

    row: int
    fraction: float


class PathTracker:
    """
    Follows the controller's target along the reference path, only ever forwards.

    Poses are compared as points of seven dimensions, position and twice the quaternion times
    :data:`RADIAN`: for small angles the distance of two quaternions is half the angle, so a
    straight line in these coordinates is a straight line of the tool with a steady turn. The
    search reaches as far as the target can have come since the last packet, and, where the robot
    program reports it, not beyond the point that it is running; so a path that crosses itself or
    goes back the way it came is followed in the right order.
    """

    def __init__(self, path: ReferencePath) -> None:
        """
        Prepare a path.

        :param path: the plan's reference; it is not changed.
        """
        self.path = path
        self._rows = np.array(path.poses)
        self._rows[:, 3:] *= 2.0 * RADIAN * _continuous_signs(path.poses[:, 3:])[:, None]
        steps = np.linalg.norm(np.diff(self._rows, axis=0), axis=1)
        self._arc = np.concatenate(([0.0], np.cumsum(steps)))
        self.place = Place(0, 0.0)

    @property
    def last_row(self) -> int:
        """The row of the end of the path."""
        return len(self._rows) - 1

    def update(self, target: Pose, reach: float, begun: int = 0) -> Place:
        """
        Move on to the place nearest to the controller's target.

        :param target: pose of the TCP in base.
        :param reach: the longest way that the target can have come since the last call [m].
        :param begun: how many points the robot program has begun; 0 = unknown.
        :returns: the new place, never behind the one before.
        """
        first, end = self._window(reach, begun)
        if end > first:
            lowest = self.place.fraction if first == self.place.row else 0.0
            self.place = self._nearest(self._coordinates(target, first), first, end, lowest)
        return self.place

    def desired(self, actual: Pose, twist: Vector6) -> Pose:
        """
        Return the planned pose that is nearest to the tool, around the place of the target.

        :param actual: pose of the TCP in base.
        :param twist: of the target, which says how far a lag may reach.
        """
        here, lag = self._way(), LAG_WAY + LAG_TIME * speed(twist)
        first = max(int(np.searchsorted(self._arc, here - lag, side='right')) - 1, 0)
        end = min(int(np.searchsorted(self._arc, here + lag, side='left')), self.last_row)
        if end <= first:
            return self.pose()
        place = self._nearest(self._coordinates(actual, first), first, end,
                              self._fraction(first, here - lag),
                              self._fraction(end - 1, here + lag))
        return self.pose(place)

    def deviation(self, target: Pose) -> tuple[float, float]:
        """
        Return how far the controller's target is from the plan, [m] and [rad].

        In a corner whose shape only the robot knows, the room for that shape is taken off.
        """
        here, row = self.pose(), self.place.row
        room, angle = self.path.room[row]
        if self.place.fraction > 0.0:
            room, angle = np.maximum(self.path.room[row], self.path.room[row + 1])
        return (max(0.0, here.distance_to(target) - float(room)),
                max(0.0, here.angle_to(target) - float(angle)))

    def finish(self) -> Place:
        """Move on to the end of the path."""
        self.place = Place(self.last_row, 0.0)
        return self.place

    def pose(self, place: Place | None = None) -> Pose:
        """Return the planned pose at a place, the present one if none is given."""
        at = self.place if place is None else place
        here = pose_from_row(self.path.poses[at.row])
        if at.fraction == 0.0:
            return here
        return here.interpolate(pose_from_row(self.path.poses[at.row + 1]), at.fraction)

    def time(self) -> float:
        """Return the planned time at the place [s]."""
        row, fraction = self.place.row, self.place.fraction
        here = float(self.path.time[row])
        if fraction == 0.0:
            return here
        return here + fraction * (float(self.path.time[row + 1]) - here)

    def waypoint(self) -> int:
        """Return the index of the goal's point that the place leads to."""
        row = self.place.row + (1 if self.place.fraction > 0.0 else 0)
        return int(self.path.point[min(row, self.last_row)])

    def _window(self, reach: float, begun: int) -> tuple[int, int]:
        """Return the rows between which the tool may be."""
        points = self.path.point
        if begun > 0:
            # The program runs the motion to point begun - 1, or is in the blend that leads to it:
            # what comes before was passed, perhaps between two packets.
            passed = int(np.searchsorted(points, begun - 2, side='left')) - 1
            if passed > self.place.row:
                self.place = Place(passed, 0.0)
        first = self.place.row
        end = int(np.searchsorted(self._arc, self._way() + reach + SLACK, side='left'))
        end = min(max(end, first + 1), self.last_row)
        if begun > 0:
            end = min(end, int(np.searchsorted(points, begun - 1, side='right')) - 1)
        return first, max(end, first)

    def _way(self) -> float:
        """Return the length of the path up to the place [m]."""
        row, fraction = self.place.row, self.place.fraction
        here = float(self._arc[row])
        return here if fraction == 0.0 else here + fraction * (float(self._arc[row + 1]) - here)

    def _fraction(self, row: int, way: float) -> float:
        """Return where an edge has that much of the path behind it, within 0 to 1."""
        start, end = float(self._arc[row]), float(self._arc[row + 1])
        return min(1.0, max(0.0, (way - start) / (end - start))) if end > start else 1.0

    def _coordinates(self, pose: Pose, row: int) -> NDArray[np.float64]:
        """Return the pose in the seven coordinates, its quaternion's sign as at the row."""
        point = np.array(pose.row())
        point[3:] *= 2.0 * RADIAN
        if float(point[3:] @ self._rows[row, 3:]) < 0.0:
            point[3:] *= -1.0
        return point

    def _nearest(self, point: NDArray[np.float64], first: int, end: int, lowest: float,
                 highest: float = 1.0) -> Place:
        """
        Return the nearest place on the edges ``first`` to ``end``, the earliest of equals.

        :param lowest: where it may be on the first edge at the earliest.
        :param highest: where it may be on the last edge at the latest.
        """
        if end - first <= FEW:
            return self._nearest_of_few(point.tolist(), first, end, lowest, highest)
        start = self._rows[first:end]
        edge = self._rows[first + 1:end + 1] - start
        away = point - start
        square = np.einsum('ij,ij->i', edge, edge)
        along = np.einsum('ij,ij->i', away, edge)
        fraction = np.divide(along, square, out=np.ones_like(along), where=square > 0.0)
        np.minimum(np.maximum(fraction, 0.0, out=fraction), 1.0, out=fraction)
        fraction[-1] = min(fraction[-1], highest)
        fraction[0] = max(fraction[0], lowest)
        miss = away - fraction[:, None] * edge
        best = int(np.argmin(np.einsum('ij,ij->i', miss, miss)))
        at = float(fraction[best])
        return Place(first + best + 1, 0.0) if at >= 1.0 else Place(first + best, at)

    def _nearest_of_few(self, point: list[float], first: int, end: int, lowest: float,
                        highest: float) -> Place:
        """Return the same without arrays, whose overhead is most of the time for a few edges."""
        rows = self._rows[first:end + 1].tolist()
        nearest, place = inf, Place(first, 0.0)
        for row, (start, stop) in enumerate(pairwise(rows), first):
            edge = [b - a for a, b in zip(start, stop, strict=True)]
            away = [b - a for a, b in zip(start, point, strict=True)]
            square = sum([e * e for e in edge])
            along = sum([e * a for e, a in zip(edge, away, strict=True)])
            at = min(1.0, max(0.0, along / square)) if square > 0.0 else 1.0
            if row == end - 1:
                at = min(at, highest)
            if row == first:
                at = max(at, lowest)
            miss = sum([(a - at * e) ** 2 for a, e in zip(away, edge, strict=True)])
            if miss < nearest:
                nearest = miss
                place = Place(row + 1, 0.0) if at >= 1.0 else Place(row, at)
        return place


def _continuous_signs(quaternions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the signs that make neighbouring quaternions of a path near to each other."""
    dots = np.einsum('ij,ij->i', quaternions[1:], quaternions[:-1])
    return np.concatenate(([1.0], np.cumprod(np.where(dots < 0.0, -1.0, 1.0))))


def speed(twist: Vector6) -> float:
    """Return how fast a twist moves in the coordinates of :class:`PathTracker` [m/s]."""
    x, y, z, rx, ry, rz = twist
    return float((x * x + y * y + z * z) ** 0.5 + RADIAN * (rx * rx + ry * ry + rz * rz) ** 0.5)
