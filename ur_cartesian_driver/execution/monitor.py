# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Where the tool is on the planned path, and whether that is near enough.

The reference path is compared as a geometric line: a robot that was slowed down, or that has its
own speed profile, is not off the path because of that.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ur_cartesian_driver.motion.goal import Tolerance
from ur_cartesian_driver.motion.plan import ReferencePath
from ur_cartesian_driver.motion.pose import (
    conjugate,
    Pose,
    pose_error,
    pose_from_row,
    rotate,
    rotation_vector_from_quaternion,
    Vector6,
)

#: How much a radian counts in the distance that decides which place is the nearest [m/rad].
RADIAN = 0.1
#: How far the tool may be from the place found before, beyond what its speed explains [m].
SLACK = 0.005
_AXES = ('x', 'y', 'z')


@dataclass(frozen=True, slots=True)
class Place:
    """A place on the reference path: between row ``row`` and the next, at ``fraction``."""

    row: int
    fraction: float


class PathTracker:
    """
    Follows the tool along the reference path, only ever forwards.

    Poses are compared as points of seven dimensions, position and twice the quaternion times
    :data:`RADIAN`: for small angles the distance of two quaternions is half the angle, so a
    straight line in these coordinates is a straight line of the tool with a steady turn. The
    search reaches as far as the tool can have come since the last packet, and, where the robot
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

    def update(self, actual: Pose, reach: float, begun: int = 0) -> Place:
        """
        Move on to the place nearest to the tool.

        :param actual: pose of the TCP in base.
        :param reach: the longest way that the tool can have come since the last call [m].
        :param begun: how many points the robot program has begun; 0 = unknown.
        :returns: the new place, never behind the one before.
        """
        first, end = self._window(reach, begun)
        if end > first:
            self.place = self._nearest(self._coordinates(actual, first), first, end)
        return self.place

    def finish(self) -> Place:
        """Move on to the end of the path."""
        self.place = Place(self.last_row, 0.0)
        return self.place

    def pose(self) -> Pose:
        """Return the planned pose at the place."""
        row, fraction = self.place.row, self.place.fraction
        here = pose_from_row(self.path.poses[row])
        if fraction == 0.0:
            return here
        return here.interpolate(pose_from_row(self.path.poses[row + 1]), fraction)

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
        first, fraction = self.place.row, self.place.fraction
        here = self._arc[first]
        if fraction > 0.0:
            here += fraction * (self._arc[first + 1] - here)
        end = int(np.searchsorted(self._arc, here + reach + SLACK, side='left'))
        end = min(max(end, first + 1), self.last_row)
        if begun > 0:
            end = min(end, int(np.searchsorted(points, begun - 1, side='right')) - 1)
        return first, max(end, first)

    def _coordinates(self, pose: Pose, row: int) -> NDArray[np.float64]:
        """Return the pose in the seven coordinates, its quaternion's sign as at the row."""
        point = np.array(pose.row())
        point[3:] *= 2.0 * RADIAN
        if float(point[3:] @ self._rows[row, 3:]) < 0.0:
            point[3:] *= -1.0
        return point

    def _nearest(self, point: NDArray[np.float64], first: int, end: int) -> Place:
        """Return the nearest place on the edges ``first`` to ``end``, the earliest of equals."""
        start = self._rows[first:end]
        edge = self._rows[first + 1:end + 1] - start
        square = np.einsum('ij,ij->i', edge, edge)
        along = np.einsum('ij,ij->i', point - start, edge)
        fraction = np.clip(np.divide(along, square, out=np.ones_like(along), where=square > 0.0),
                           0.0, 1.0)
        if first == self.place.row:
            fraction[0] = max(fraction[0], self.place.fraction)
        miss = point - start - fraction[:, None] * edge
        best = int(np.argmin(np.einsum('ij,ij->i', miss, miss)))
        at = float(fraction[best])
        return Place(first + best + 1, 0.0) if at >= 1.0 else Place(first + best, at)


def _continuous_signs(quaternions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the signs that make neighbouring quaternions of a path near to each other."""
    dots = np.einsum('ij,ij->i', quaternions[1:], quaternions[:-1])
    return np.concatenate(([1.0], np.cumprod(np.where(dots < 0.0, -1.0, 1.0))))


@dataclass(frozen=True, slots=True, kw_only=True)
class Deviation:
    """
    ``desired - actual`` in the terms of the tolerances.

    Position [m] in the frame of the goal, orientation [rad] as the rotation vector of
    ``q_actual^-1 q_desired`` in the tool.
    """

    position: tuple[float, float, float]
    orientation: tuple[float, float, float]


def deviation(desired: Pose, actual: Pose, T_base_frame: Pose) -> Deviation:
    """Return the deviation of two poses in base for a goal that was given in another frame."""
    error = pose_error(desired, actual)
    return Deviation(
        position=rotate(conjugate(T_base_frame.quaternion), error.position),
        orientation=rotation_vector_from_quaternion(error.quaternion))


def violation(error: Deviation, tolerance: Tolerance) -> str | None:
    """
    Return a clause that names the first axis outside its tolerance, or None.

    Zero and negative tolerances are unchecked here: defaults were filled in before.
    """
    for name, unit, errors, limits in (
        ('position', 'm', error.position, tolerance.position),
        ('orientation', 'rad', error.orientation, tolerance.orientation),
    ):
        for axis, value, limit in zip(_AXES, errors, limits, strict=True):
            if 0.0 < limit < abs(value):
                return (f'{name} {axis} is off by {abs(value):.6f} {unit}, '
                        f'the tolerance is {limit:.6f} {unit}')
    return None


def speed(twist: Vector6) -> float:
    """Return how fast a twist moves in the coordinates of :class:`PathTracker` [m/s]."""
    x, y, z, rx, ry, rz = twist
    return float((x * x + y * y + z * z) ** 0.5 + RADIAN * (rx * rx + ry * ry + rz * rz) ** 0.5)
