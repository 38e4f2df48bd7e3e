# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Find the controller's position on the planned path, and the desired pose of the tool.

Poses are compared with the path as a geometric line, so a robot that was slowed down, or that has
its own speed profile, is not off the path.

Progress is measured by the controller's target, which has no noise and cannot be pushed: if the
*target* leaves the path, the robot makes a motion other than the planned one. The desired pose is
the pose on the path nearest to the tool, at most a plausible lag ahead of or behind the target.
The controller goes on while somebody pushes the arm along its path, so a push beyond the lag is an
error too.

All of this runs between a packet and a CANCEL, so it must be fast. Most packets concern only one
or two edges of the path. A few edges are computed in plain floats: calling numpy costs more than
computing with seven numbers.
"""

from __future__ import annotations

from array import array
from bisect import bisect_left, bisect_right
from math import dist, hypot, inf, sqrt
from operator import mul
from typing import NamedTuple, TypeAlias

import numpy as np

from ur_cartesian_driver.motion.events import PathPlace
from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.geometry.pose import Pose, pose_from_row
from ur_cartesian_driver.motion.geometry.pose_rows import length_rows
from ur_cartesian_driver.motion.geometry.vectors import norm, scale, Vector3, Vector6, ZERO3
from ur_cartesian_driver.motion.plan.joint_spline import SAME_TIME
from ur_cartesian_driver.motion.plan.plan import ReferencePath

#: Weight of a radian in the distance that decides which position is the nearest [m/rad].
METRES_PER_RADIAN = 0.1
#: Allowance for a target that has come farther than its speed explains [m].
SEARCH_MARGIN = 0.005
#: The search reaches at least this far ahead in planned time [s], because a lagging servo turns
#: back before it has come to the place where the set-points turn back.
SEARCH_TIME = 0.1
#: A position farther on than the speed explains is chosen only if it is nearer to the target by
#: this distance [m]: where a path turns back, both branches are equally near.
CLEARLY_NEARER = 0.0005
#: Bounds on the lag or lead of the tool: this time at the target's speed [s], plus this distance
#: [m]. Position controllers of arms lag by some cycles.
LAG_TIME = 0.02
LAG_DISTANCE = 0.0005
#: When the plan waits, the target is at most this far from the planned place [m]: the wire rounds
#: to a micrometre, and a servo creeps.
SAME_PLACE = 2e-5
#: Beyond this fraction of an edge the path has the direction of the next edge.
AT_END = 0.999
#: Planned time of the path kept behind the target, because the tool may lag [s].
HISTORY_TIME = 1.0
#: Up to this many edges are searched one by one; more edges are searched with arrays.
MAX_SCALAR_EDGES = 8
#: Largest number of edges cached as plain floats.
MAX_CACHED_EDGES = 256

#: A pose in the coordinates of :class:`PathTracker`.
TrackerPoint: TypeAlias = tuple[float, float, float, float, float, float, float]


class PathPosition(NamedTuple):
    """A position on the reference path: between row ``row`` and the next, at ``fraction``."""

    row: int
    fraction: float


class Edge(NamedTuple):
    """The edge from a row of the path to the next, as poses and in the tracker's coordinates."""

    start: Pose
    end: Pose
    origin: TrackerPoint
    vector: TrackerPoint
    #: Square of the length of the vector.
    length_squared: float

    def nearest(self, point: TrackerPoint, lowest: float, highest: float) -> tuple[float, float]:
        """Return the fraction nearest to a point, ``lowest`` to ``highest``, and its distance."""
        # Seven numbers written out take half the time of loops over them.
        px, py, pz, pa, pb, pc, pd = point
        ox, oy, oz, oa, ob, oc, od = self.origin
        ex, ey, ez, ea, eb, ec, ed = self.vector
        away, at = (px - ox, py - oy, pz - oz, pa - oa, pb - ob, pc - oc, pd - od), 1.0
        if self.length_squared > 0.0:
            at = sum(map(mul, away, self.vector)) / self.length_squared
        at = max(lowest, min(max(at, 0.0), 1.0, highest))
        foot = (at * ex, at * ey, at * ez, at * ea, at * eb, at * ec, at * ed)
        return at, dist(away, foot)


class PathTracker:
    """
    Follows the controller's target along the reference path, only forwards.

    Poses are compared as points in seven dimensions: the position, and the quaternion times twice
    :data:`METRES_PER_RADIAN`. For small angles the distance of two quaternions is half the angle,
    so a straight line in these coordinates is a straight line of the tool with a steady turn. The
    search reaches as far as the target can have come since the last packet, and farther only if
    the path is clearly nearer there. If the robot program reports to which point it is moving, the
    search ends at that point. So a path that crosses itself or turns back is followed in order.
    """

    def __init__(self, path: ReferencePath) -> None:
        """
        Begin at the start of a path.

        :param path: the plan's reference; it is not changed.
        """
        self._load(path)
        self.path_position = PathPosition(0, 0.0)
        #: Distance of the target from the path at the last update, in the tracker's coordinates.
        self.residual = inf

    def _load(self, path: ReferencePath) -> None:
        """Compute the arrays for the search."""
        self.path = path
        self._rows = np.array(path.poses)
        self._rows[:, 3:] *= (
            2.0 * METRES_PER_RADIAN * _continuous_signs(path.poses[:, 3:])[:, None]
        )
        steps = length_rows(np.diff(self._rows, axis=0))
        # An ``array`` is searched faster than a numpy array: its items are plain numbers.
        self._arc = array('d', np.concatenate(([0.0], np.cumsum(steps))).tobytes())
        self._time = array('d', path.time.astype(np.float64).tobytes())
        self._points = array('i', path.point.tobytes())
        waits = (steps == 0.0) & (np.diff(path.time) > SAME_TIME)
        #: The rows at which the plan waits, in order.
        self._waits = array('l', np.flatnonzero(waits).tolist())
        self._has_blend_tolerance = bool(path.blend_tolerance.any())
        self._edges: dict[int, Edge] = {}
        self._end = pose_from_row(path.poses[-1])

    @property
    def last_row(self) -> int:
        """The row of the end of the path."""
        return len(self._rows) - 1

    # ---- the target ---------------------------------------------------------------------------

    def update(
        self, target: Pose, max_advance: float, running: tuple[int, int] | None = None
    ) -> PathPosition:
        """
        Move on to the position nearest to the controller's target.

        :param target: pose of the TCP in base.
        :param max_advance: longest path that the target can have covered since the last call [m].
        :param running: the points to which the motion begun last and the motion before it lead (-1
            = there was none); None = unknown.
        :returns: the new position, never behind the previous one.
        """
        first, end = self._window(max_advance, running)
        explained = self._at(self._arc) + max_advance
        near = min(max(bisect_right(self._arc, explained + SAME_PLACE), first + 1), end)
        found = self._search(target, first, near, explained)
        if found[1] > CLEARLY_NEARER:
            farther = self._search(target, first, end)
            if farther[1] < found[1] - CLEARLY_NEARER:
                found = farther
        self.path_position, self.residual = found
        return self.path_position

    def _window(self, max_advance: float, running: tuple[int, int] | None) -> tuple[int, int]:
        """Return the rows between which the target may be."""
        if running is not None:
            # The program runs the motion begun last, or is in the blend that leads to it: the path
            # before that blend was passed, perhaps between two packets.
            passed = bisect_left(self._points, running[1]) - 1
            if passed > self.path_position.row:
                self.path_position = PathPosition(passed, 0.0)
        first = self.path_position.row
        end = max(
            bisect_left(self._arc, self._at(self._arc) + max_advance + SEARCH_MARGIN),
            bisect_left(self._time, self.time() + SEARCH_TIME),
        )
        end = min(max(end, first + 1), self.last_row)
        if running is not None:
            end = min(end, bisect_right(self._points, running[0]) - 1)
        return first, max(end, first)

    def _search(
        self, target: Pose, first: int, end: int, limit: float = inf
    ) -> tuple[PathPosition, float]:
        """
        Return the position nearest to the target between two rows, and its distance.

        :param limit: the distance along the path from its start at which the search ends [m].
        """
        nearest = self.path_position, inf
        while end > first:
            # The search goes past a place where the plan waits only if the target is there.
            wait = self._next_wait(first, end)
            if wait > first:
                lowest = self.path_position.fraction if first == self.path_position.row else 0.0
                highest = self._fraction(wait - 1, limit)
                if first == wait - 1:
                    highest = max(highest, lowest)
                point = self._coordinates(target, first)
                found = self._nearest(point, first, wait, lowest, highest)
                if found[1] <= nearest[1]:
                    nearest = found
            if wait >= end or self._arc[wait] - self._at(self._arc, nearest[0]) > SAME_PLACE:
                break
            here = self._edge(wait).start
            distance = here.distance_to(target) + METRES_PER_RADIAN * here.angle_to(target)
            if distance <= SAME_PLACE:
                is_there = nearest[0].row >= wait
                return nearest[0] if is_there else PathPosition(wait, 0.0), distance
            first = wait + 1
        return nearest

    def _next_wait(self, first: int, end: int) -> int:
        """Return the first row from ``first`` on at which the plan waits; ``end`` if none does."""
        k = bisect_left(self._waits, first)
        return min(self._waits[k], end) if k < len(self._waits) else end

    @property
    def waits(self) -> bool:
        """Whether the target is at a place where the plan waits."""
        row = self.path_position.row
        return self._next_wait(row, row + 1) == row

    def wait(self, time: float) -> None:
        """Advance the planned time at a place where the plan waits, by a time [s]."""
        row, fraction = self.path_position
        fraction += time / (self._time[row + 1] - self._time[row])
        self.path_position = _position(row, fraction)

    def finish(self, time: float = inf) -> None:
        """Move on to the end of the path, or to the path's position at a planned time [s]."""
        row = max(bisect_right(self._time, time + SAME_TIME) - 1, 0)
        self.path_position = PathPosition(row, 0.0)

    def pass_stop(self, waypoint: int) -> None:
        """Move on to a point of the goal that the program has left, if the point has no blend."""
        row = bisect_right(self._points, waypoint) - 1
        if row > self.path_position.row and not self.path.blend_tolerance[row].any():
            self.path_position = PathPosition(row, 0.0)

    def append(self, path: ReferencePath, since: float) -> None:
        """
        Append a path that replaces the old one after a time [s]; forget rows far behind the arm.

        If the arm is already past that time, both paths are the same up to the arm.
        """
        old, row, now = self.path, self.path_position.row, self.time()
        first = max(0, min(bisect_left(self._time, self._time[row] - HISTORY_TIME), row))
        end = max(bisect_right(self._time, since + SAME_TIME), row + 1)
        known = max(self._time[end - 1], now, since - 2.0 * SAME_TIME)
        new = bisect_right(path.time, known + SAME_TIME)
        self._load(
            ReferencePath(
                **{
                    name: np.concatenate(
                        [getattr(old, name)[first:end], getattr(path, name)[new:]]
                    )
                    for name in ('poses', 'point', 'time', 'blend_tolerance', 'fraction')
                }
            )
        )
        row -= first
        time = self._time[row + 1] - self._time[row]
        self.path_position = PathPosition(
            row, (now - self._time[row]) / time if time > 0.0 else 0.0
        )

    # ---- the plan at the target's position ----------------------------------------------------

    def desired(self, actual: Pose, twist: Vector6) -> Pose:
        """
        Return the planned pose nearest to the tool, within a plausible lag of the target.

        :param actual: pose of the TCP in base.
        :param twist: twist of the target, whose speed bounds the lag.
        """
        here, lag = self._at(self._arc), LAG_DISTANCE + LAG_TIME * tracker_speed(twist)
        first = max(bisect_right(self._arc, here - lag) - 1, 0)
        end = min(bisect_left(self._arc, here + lag), self.last_row)
        if end <= first:
            return self.pose()
        lowest, highest = self._fraction(first, here - lag), self._fraction(end - 1, here + lag)
        point = self._coordinates(actual, first)
        return self.pose(self._nearest(point, first, end, lowest, highest)[0])

    def behind(self, pose: Pose) -> Pose:
        """Return the planned pose nearest to a pose, on the path up to the target's position."""
        row, fraction = self.path_position
        if row == 0 and not fraction:
            return self.pose()
        end = row + 1 if fraction else row
        # The sign is matched to the last row: along a large turn, quaternions change their sign.
        point = self._coordinates(pose, end - 1)
        found, _ = self._nearest(point, 0, end, 0.0, fraction or 1.0)
        return self.pose(found)

    def deviation(self, target: Pose) -> tuple[float, float]:
        """
        Return the distance [m] and angle [rad] of the controller's target from the plan.

        In a blend, whose shape only the robot knows, the blend tolerance is subtracted.
        """
        here = self.pose()
        distance, angle = here.distance_to(target), here.angle_to(target)
        if not self._has_blend_tolerance:
            return distance, angle
        row, fraction = self.path_position
        rows = self.path.blend_tolerance[row : row + (2 if fraction > 0.0 else 1)]
        tolerance, tolerance_angle = rows.max(axis=0).tolist()
        return max(0.0, distance - tolerance), max(0.0, angle - tolerance_angle)

    def is_within(self, distance: float, angle: float) -> bool:
        """
        Return whether the target is certainly within a distance [m] and angle [rad] of the path.

        A radian weighs :data:`METRES_PER_RADIAN` in :attr:`residual`. Only half of the bound is
        used, because the straight line between two quaternions is not quite the turn from one to
        the other. If the two are so far apart that half of the bound is too much, the line is far
        from every unit quaternion, so the residual is large.
        """
        return self.residual <= 0.5 * min(distance, METRES_PER_RADIAN * angle)

    def pose(self, path_position: PathPosition | None = None) -> Pose:
        """Return the planned pose at a position, by default the present one."""
        row, fraction = path_position or self.path_position
        if row == self.last_row:
            return self._end
        edge = self._edge(row)
        return edge.start.interpolate(edge.end, fraction) if fraction else edge.start

    def time(self) -> float:
        """Return the planned time of the present position [s]."""
        return self._at(self._time)

    def direction(self) -> Vector3:
        """
        Return the direction of the path ahead, a unit vector.

        Zeros if the path only turns there, or has ended.
        """
        row = self.path_position.row + (self.path_position.fraction > AT_END)
        while row < self.last_row:
            x, y, z, *turn = self._edge(row).vector
            length = norm((x, y, z))
            if length > 0.0:
                return scale((x, y, z), 1.0 / length)
            if any(turn):
                break
            row += 1
        return ZERO3

    def waypoint(self) -> int:
        """Return the index of the next point of the goal."""
        row = self.path_position.row + (1 if self.path_position.fraction > 0.0 else 0)
        return self._points[min(row, self.last_row)]

    def place(self) -> PathPlace:
        """Return the present position as a place on the path of the goal."""
        point, (row, fraction) = self.waypoint(), self.path_position
        fractions, last = self.path.fraction, min(row + 1, self.last_row)
        # A segment begins where the one before it ends.
        begin = float(fractions[row]) if self._points[row] == point else 0.0
        end = float(fractions[last]) if self._points[last] == point else begin
        part = begin + fraction * (end - begin)
        return PathPlace(point=point, fraction=min(max(part, 0.0), 1.0))

    # ---- geometry -----------------------------------------------------------------------------

    def _at(self, values: array[float], path_position: PathPosition | None = None) -> float:
        """Return the length or time of the path at a position, by default the present one."""
        row, fraction = path_position or self.path_position
        here = values[row]
        return here + fraction * (values[row + 1] - here) if fraction else here

    def _fraction(self, row: int, distance: float) -> float:
        """Return the fraction of an edge, 0 to 1, at a distance from the start of the path."""
        start, end = self._arc[row], self._arc[row + 1]
        return min(1.0, max(0.0, (distance - start) / (end - start))) if end > start else 1.0

    def _edge(self, row: int) -> Edge:
        """Return the edge that begins at a row."""
        edge = self._edges.get(row)
        if edge is None:
            if len(self._edges) >= MAX_CACHED_EDGES:
                self._edges.clear()
            poses, (start, end) = self.path.poses, self._rows[row : row + 2]
            vector = end - start
            edge = self._edges[row] = Edge(
                pose_from_row(poses[row]),
                pose_from_row(poses[row + 1]),
                tuple(start.tolist()),
                tuple(vector.tolist()),
                float(vector @ vector),
            )
        return edge

    def _coordinates(self, pose: Pose, row: int) -> TrackerPoint:
        """Return a pose in the seven coordinates, with the quaternion's sign matched to a row."""
        (x, y, z), (a, b, c, d) = pose.position, pose.quaternion
        _, _, _, ra, rb, rc, rd = self._edge(row).origin
        sign = 1.0 if a * ra + b * rb + c * rc + d * rd >= 0.0 else -1.0
        weight = sign * 2.0 * METRES_PER_RADIAN
        return x, y, z, weight * a, weight * b, weight * c, weight * d

    def _nearest(
        self, point: TrackerPoint, first: int, end: int, lowest: float, highest: float
    ) -> tuple[PathPosition, float]:
        """
        Return the nearest position on the edges ``first`` to ``end``, and its distance.

        Of several equally near positions, the earliest is returned.

        :param lowest: smallest fraction of the first edge.
        :param highest: largest fraction of the last edge.
        """
        if end - first > MAX_SCALAR_EDGES:
            return self._nearest_of_many(point, first, end, lowest, highest)
        nearest, best, fraction = inf, first, 0.0
        for row in range(first, end):
            at, residual = self._edge(row).nearest(
                point, lowest if row == first else 0.0, highest if row == end - 1 else 1.0
            )
            if residual < nearest:
                nearest, best, fraction = residual, row, at
        return _position(best, fraction), nearest

    def _nearest_of_many(
        self, point: TrackerPoint, first: int, end: int, lowest: float, highest: float
    ) -> tuple[PathPosition, float]:
        """Do the same as :meth:`_nearest` by arrays, which are faster for many edges."""
        start = self._rows[first:end]
        edge = self._rows[first + 1 : end + 1] - start
        away = np.array(point) - start
        length_squared = np.einsum('ij,ij->i', edge, edge)
        along = np.einsum('ij,ij->i', away, edge)
        with np.errstate(over='ignore'):  # an absurd reported position: an edge's end is nearest
            fraction = np.divide(
                along, length_squared, out=np.ones_like(along), where=length_squared > 0.0
            )
        np.minimum(np.maximum(fraction, 0.0, out=fraction), 1.0, out=fraction)
        fraction[-1] = min(fraction[-1], highest)
        fraction[0] = max(fraction[0], lowest)
        residual = away - fraction[:, None] * edge
        squares = np.einsum('ij,ij->i', residual, residual)
        best = int(np.argmin(squares))
        return _position(first + best, float(fraction[best])), sqrt(float(squares[best]))


def _position(row: int, fraction: float) -> PathPosition:
    """Return a position; the end of an edge is the beginning of the next one."""
    return PathPosition(row + 1, 0.0) if fraction >= 1.0 else PathPosition(row, fraction)


def _continuous_signs(quaternions: Floats) -> Floats:
    """Return the signs that make neighbouring quaternions of a path close to each other."""
    dots = np.einsum('ij,ij->i', quaternions[1:], quaternions[:-1])
    return np.concatenate(([1.0], np.cumprod(np.where(dots < 0.0, -1.0, 1.0))))


def tracker_speed(twist: Vector6) -> float:
    """Return the speed of a twist in the coordinates of :class:`PathTracker` [m/s]."""
    x, y, z, rx, ry, rz = twist
    return hypot(x, y, z) + METRES_PER_RADIAN * hypot(rx, ry, rz)
