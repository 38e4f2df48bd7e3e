# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The geometry of motion: the set-point at a path parameter, without time.

The parameter of a move path runs from 0 to its ``length``. It is in radians of the joint with the
longest travel for joint lines, and in metres for lines and arcs of the tool; if the rotation takes
longer there, it is in (scaled) radians, see :class:`LinearMovePath`.
The parameter of a blend path runs from 0 to 1; such a path replaces the end of one move path and
the beginning of the next. A set-point is six joint positions or a pose of the TCP in the base.
Rows of set-points are (n, 6), or (n, 7) with x y z [m] and the unit quaternion x y z w.
"""

from __future__ import annotations

from collections.abc import Callable
from math import atan2, cos, pi, sin, sqrt, tan
from typing import Protocol, TypeAlias

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.geometry.pose import (
    conjugate,
    distance,
    multiply,
    Pose,
    pose_rows,
    quaternion_from_rotation_vector,
)
from ur_cartesian_driver.motion.geometry.pose_rows import (
    interpolate_rows,
    multiply_rows,
    normalized_rows,
)
from ur_cartesian_driver.motion.geometry.rotation_rows import exp_rows
from ur_cartesian_driver.motion.geometry.vectors import (
    add,
    add6,
    add_scaled6,
    cross,
    dot,
    norm,
    scale,
    subtract,
    subtract6,
    unit,
    Vector3,
    Vector6,
)
from ur_cartesian_driver.sim.motion.motion_values import MotionError

Setpoint: TypeAlias = Vector6 | Pose

# Shorter paths [m, rad] are treated as empty, because their ends differ only by rounding.
_MIN_LENGTH = 1e-9
# Three points define no circle if two of them are nearer to each other than this [m] ...
_COINCIDENT = 1e-6
# ... or if the lines from the first point to the others form an angle with a sine below this.
_COLLINEAR = 1e-6
# The point at which a path leaves a sphere is first searched among this many samples,
_SAMPLES = 24
# then found in at most this many refinements,
_REFINEMENTS = 50
# which end when its distance from the sphere is below this [m].
_ON_BORDER = 1e-12
# Two lines have no fillet if their directions are the same or opposite within this angle [rad].
_STRAIGHT = 1e-6


class MotionPath(Protocol):
    """A move path or a blend path."""

    def at(self, s: float) -> Setpoint:
        """Return the set-point at the path parameter."""
        ...

    def rows(self, s: Floats) -> Floats:
        """Return the set-points at many path parameters (n,) before the end."""
        ...


class MovePath(Protocol):
    """The path to one waypoint."""

    @property
    def length(self) -> float:
        """The largest path parameter."""
        ...

    def at(self, s: float) -> Setpoint:
        """Return the set-point at the path parameter; from ``length`` on, exactly the waypoint."""
        ...

    def pose(self, s: float) -> Pose:
        """Return T_base_tcp."""
        ...

    def rows(self, s: Floats) -> Floats:
        """Return the set-points at many path parameters (n,) before the end."""
        ...


class JointMovePath:
    """
    A straight line in joint space [rad]; all joints share the path parameter.

    :param forward: returns T_base_tcp at joint positions.
    """

    def __init__(self, start: Vector6, end: Vector6, forward: Callable[[Vector6], Pose]) -> None:
        """Set ``length`` to the longest travel of a joint [rad]."""
        self.start, self.end, self._forward = start, end, forward
        self._travel = subtract6(end, start)
        length = max(map(abs, self._travel))
        self.length = length if length > _MIN_LENGTH else 0.0

    def at(self, s: float) -> Vector6:
        """Return the joint positions [rad]."""
        if s >= self.length:
            return self.end
        return add_scaled6(self.start, self._travel, s / self.length)

    def rows(self, s: Floats) -> Floats:
        """Return joint positions (n, 6) [rad]."""
        rows: Floats = np.array(self.start) + np.outer(s / self.length, self._travel)
        return rows

    def pose(self, s: float) -> Pose:
        """Return T_base_tcp."""
        return self._forward(self.at(s))


class LinearMovePath:
    """
    A straight line of the tool with the shortest rotation.

    Its length is the larger of two numbers: the distance [m], and the angle [rad] divided by the
    turn ratio, because one speed of the call applies to both.

    :param turn_ratio: rotation [rad] that takes as long as a translation by 1 m.
    """

    def __init__(self, start: Pose, end: Pose, turn_ratio: float = 1.0) -> None:
        """Compute distance and length."""
        self.start, self.end = start, end
        self.distance = start.distance_to(end)
        length = max(self.distance, start.angle_to(end) / turn_ratio)
        self.length = length if length > _MIN_LENGTH else 0.0

    def at(self, s: float) -> Pose:
        """Return T_base_tcp."""
        return self.end if s >= self.length else self.start.interpolate(self.end, s / self.length)

    pose = at

    def rows(self, s: Floats) -> Floats:
        """Return poses (n, 7)."""
        start, end = np.array([self.start.row()]), np.array([self.end.row()])
        return interpolate_rows(start, end, s / self.length)


class CircularMovePath:
    """
    A circular arc from a start pose through a point to an end pose.

    An unconstrained orientation takes the shortest rotation from start to end; the length is the
    larger of the arc [m] and the angle of this rotation [rad]. A fixed orientation is constant
    relative to the tangent; the orientation of the end pose is then ignored, and the length is the
    arc.

    :raises MotionError: two of the three points coincide, or all lie on one line.
    """

    def __init__(self, start: Pose, via: Vector3, end: Pose, fixed: bool) -> None:
        """Find centre, axes and angle of the arc."""
        a, b = subtract(via, start.position), subtract(end.position, start.position)
        n = cross(a, b)
        _check_circle(a, b, n)
        # The centre of the circle through 0, a, b: (|a|^2 b - |b|^2 a) x n / 2|n|^2.
        aa, bb, nn = dot(a, a), dot(b, b), dot(n, n)
        offset = scale(cross(subtract(scale(b, aa), scale(a, bb)), n), 0.5 / nn)
        self.centre = add(start.position, offset)
        self.radius = norm(offset)
        self.normal = scale(n, 1.0 / sqrt(nn))
        self._x = scale(offset, -1.0 / self.radius)
        self._y = cross(self.normal, self._x)
        self.angle = self._angle_of(end.position)
        self.start, self._fixed = start, fixed
        self.end = self._setpoint(self.angle) if fixed else end
        self.length = self.radius * self.angle
        if not fixed:
            self.length = max(self.length, start.angle_to(end))

    def at(self, s: float) -> Pose:
        """Return T_base_tcp."""
        return self.end if s >= self.length else self._setpoint(self.angle * s / self.length)

    pose = at

    def rows(self, s: Floats) -> Floats:
        """Return poses (n, 7)."""
        start, end = np.array([self.start.row()]), np.array([self.end.row()])
        rows = interpolate_rows(start, end, s / self.length)
        angle = self.angle * s / self.length
        rows[:, :3] = _on_circle_rows(self.centre, self._x, self._y, self.radius, angle)
        if self._fixed:
            turn = exp_rows(np.outer(angle, self.normal))
            rows[:, 3:] = normalized_rows(multiply_rows(turn, start[:, 3:]))
        return rows

    def _angle_of(self, point: Vector3) -> float:
        # The angle grows from start through via to end, as the normal is along cross(a, b).
        r = subtract(point, self.centre)
        return atan2(dot(r, self._y), dot(r, self._x)) % (2.0 * pi)

    def _setpoint(self, angle: float) -> Pose:
        position = _on_circle(self.centre, self._x, self._y, self.radius, angle)
        if self._fixed:
            turn = quaternion_from_rotation_vector(scale(self.normal, angle))
            return Pose(position, multiply(turn, self.start.quaternion))
        fraction = angle / self.angle
        return Pose(position, self.start.interpolate(self.end, fraction).quaternion)


class JointBlendPath:
    """
    Two joint lines at once: the first brakes to the waypoint while the second starts.

    q(u) = q1(s1(u)) + q2(s2(u)) - q_waypoint with s1 = L1 - r1 (1 - u)^2 and s2 = r2 u^2, where L1
    is the length of the first line, r1 = ``tail`` and r2 = ``head``. This is a parabola that is
    tangent to both lines. ``entry_rate`` is ds1/du at u = 0, and ``exit_rate`` ds2/du at u = 1.
    """

    def __init__(
        self, before: JointMovePath, tail: float, after: JointMovePath, head: float
    ) -> None:
        """Blend the last ``tail`` of one path with the first ``head`` of the next."""
        self._before, self._after, self._tail, self._head = before, after, tail, head
        self.entry_rate, self.exit_rate = 2.0 * tail, 2.0 * head

    def at(self, u: float) -> Vector6:
        """Return the joint positions [rad]."""
        if u >= 1.0:
            return self._after.at(self._head)
        a = self._before.at(self._before.length - self._tail * (1.0 - u) ** 2)
        b = self._after.at(self._head * u * u)
        return subtract6(add6(a, b), self._before.end)

    def rows(self, u: Floats) -> Floats:
        """Return joint positions (n, 6) [rad]."""
        a = self._before.rows(self._before.length - self._tail * (1.0 - u) ** 2)
        rows: Floats = a + self._after.rows(self._head * u * u) - np.array(self._before.end)
        return rows


class ToolBlendPath:
    """
    The blend of :class:`JointBlendPath` for poses: positions add, rotations are composed.

    p = p1 + p2 - p_waypoint, R = R1 R_waypoint^-1 R2. Between straight lines the position runs on
    the parabola with the waypoint as its control point.
    """

    def __init__(self, before: MovePath, tail: float, after: MovePath, head: float) -> None:
        """Blend the last ``tail`` of one path with the first ``head`` of the next."""
        self._before, self._after, self._tail, self._head = before, after, tail, head
        self._waypoint = before.pose(before.length)
        self.entry_rate, self.exit_rate = 2.0 * tail, 2.0 * head

    def at(self, u: float) -> Pose:
        """Return T_base_tcp."""
        if u >= 1.0:
            return self._after.pose(self._head)
        a = self._before.pose(self._before.length - self._tail * (1.0 - u) ** 2)
        b = self._after.pose(self._head * u * u)
        back = conjugate(self._waypoint.quaternion)
        return Pose(
            subtract(add(a.position, b.position), self._waypoint.position),
            multiply(a.quaternion, multiply(back, b.quaternion)),
        )

    def rows(self, u: Floats) -> Floats:
        """Return poses (n, 7)."""
        if isinstance(self._before, JointMovePath) or isinstance(self._after, JointMovePath):
            return pose_rows(self.at(x) for x in u.tolist())
        a = self._before.rows(self._before.length - self._tail * (1.0 - u) ** 2)
        b = self._after.rows(self._head * u * u)
        back = np.array([conjugate(self._waypoint.quaternion)])
        rows: Floats = a + b - np.array(self._waypoint.row())
        turns = multiply_rows(a[:, 3:], normalized_rows(multiply_rows(back, b[:, 3:])))
        rows[:, 3:] = normalized_rows(turns)
        return rows


class FilletBlendPath:
    """
    A circular arc tangent to two lines at equal distances d from the waypoint.

    If the direction turns by phi, the radius is d / tan(phi/2), which is d for a right angle.
    The orientation changes as in :class:`ToolBlendPath`; the position moves in proportion to u.
    """

    def __init__(
        self, before: LinearMovePath, tail: float, after: LinearMovePath, head: float
    ) -> None:
        """Blend the last ``tail`` of one line with the first ``head`` of the next."""
        self._turn = ToolBlendPath(before, tail, after, head)
        entry = before.pose(before.length - tail).position
        waypoint = before.end.position
        into = unit(subtract(waypoint, entry))
        onwards = unit(subtract(after.end.position, waypoint))
        self.angle = fillet_angle(before, after)
        self.radius = distance(entry, waypoint) / tan(0.5 * self.angle)
        inwards = unit(subtract(onwards, scale(into, dot(onwards, into))))
        self.centre = add(entry, scale(inwards, self.radius))
        self._x, self._y = scale(inwards, -1.0), into
        arc = self.radius * self.angle
        self.entry_rate = arc * before.length / before.distance
        self.exit_rate = arc * after.length / after.distance

    def at(self, u: float) -> Pose:
        """Return T_base_tcp."""
        turned = self._turn.at(u)
        if u >= 1.0:
            return turned
        position = _on_circle(self.centre, self._x, self._y, self.radius, self.angle * u)
        return Pose(position, turned.quaternion)

    def rows(self, u: Floats) -> Floats:
        """Return poses (n, 7)."""
        rows = self._turn.rows(u)
        rows[:, :3] = _on_circle_rows(self.centre, self._x, self._y, self.radius, self.angle * u)
        return rows


BlendPath: TypeAlias = JointBlendPath | ToolBlendPath | FilletBlendPath


def fillet_angle(before: LinearMovePath, after: LinearMovePath) -> float:
    """Return the angle between the directions of two lines [rad]."""
    a = unit(subtract(before.end.position, before.start.position))
    b = unit(subtract(after.end.position, after.start.position))
    return 2.0 * atan2(norm(subtract(a, b)), norm(add(a, b)))


def make_blend(
    before: MovePath, tail: float, after: MovePath, head: float, circular: bool
) -> BlendPath:
    """
    Return the blend of two paths: in joint space if both are joint lines, else in tool space.

    :param circular: whether to join two tool lines that meet at an angle by an arc.
    :raises MotionError: ``circular`` is set, and the second line leads straight back.
    """
    if isinstance(before, JointMovePath) and isinstance(after, JointMovePath):
        return JointBlendPath(before, tail, after, head)
    if circular and isinstance(before, LinearMovePath) and isinstance(after, LinearMovePath):
        angle = fillet_angle(before, after)
        if angle > pi - _STRAIGHT:
            raise MotionError(
                'MoveP cannot maintain speed when reversing direction. Adjust waypoint to make '
                'robot able to blend.'
            )
        if angle > _STRAIGHT:
            return FilletBlendPath(before, tail, after, head)
    return ToolBlendPath(before, tail, after, head)


def start_within_radius(move_path: MovePath, radius: float) -> float | None:
    """Return the length of the path's start within ``radius`` [m] of its start; None = all."""
    if isinstance(move_path, LinearMovePath):
        return (
            move_path.length * radius / move_path.distance if move_path.distance > radius else None
        )
    return _exit_parameter(move_path.pose, radius, move_path.length)


def end_within_radius(move_path: MovePath, radius: float) -> float | None:
    """Return the length of the path's end within ``radius`` [m] of its waypoint; None = all."""
    if isinstance(move_path, LinearMovePath):
        return start_within_radius(move_path, radius)
    return _exit_parameter(
        lambda s: move_path.pose(move_path.length - s), radius, move_path.length
    )


def _exit_parameter(pose: Callable[[float], Pose], radius: float, length: float) -> float | None:
    """Return the first s at which ``pose(s)`` is ``radius`` [m] from ``pose(0)``; None = never."""
    origin = pose(0.0).position
    low, f_low = 0.0, -radius
    for i in range(1, _SAMPLES + 1):
        high = length * i / _SAMPLES
        f_high = distance(pose(high).position, origin) - radius
        if f_high > 0.0:
            break
        low, f_low = high, f_high
    else:
        return None
    # Regula falsi with the Illinois correction: if the same end stays twice, its value is halved.
    side = 0
    for _ in range(_REFINEMENTS):
        middle = (low * f_high - high * f_low) / (f_high - f_low)
        f = distance(pose(middle).position, origin) - radius
        if abs(f) < _ON_BORDER:
            return middle
        if f < 0.0:
            low, f_low = middle, f
            f_high, side = (0.5 * f_high if side < 0 else f_high), -1
        else:
            high, f_high = middle, f
            f_low, side = (0.5 * f_low if side > 0 else f_low), 1
    return 0.5 * (low + high)


def _on_circle(centre: Vector3, x: Vector3, y: Vector3, radius: float, angle: float) -> Vector3:
    """Return a point of a circle; the angle [rad] is measured from x towards y."""
    offset = add(scale(x, radius * cos(angle)), scale(y, radius * sin(angle)))
    return add(centre, offset)


def _on_circle_rows(
    centre: Vector3, x: Vector3, y: Vector3, radius: float, angle: Floats
) -> Floats:
    """Return points (n, 3) of a circle at angles (n,), see :func:`_on_circle`."""
    rows: Floats = (
        np.array(centre)
        + np.outer(radius * np.cos(angle), x)
        + np.outer(radius * np.sin(angle), y)
    )
    return rows


def _check_circle(a: Vector3, b: Vector3, n: Vector3) -> None:
    sides = norm(a), norm(b), norm(subtract(b, a))
    if min(sides) < _COINCIDENT:
        raise MotionError(
            'movec needs three different points: start, via and target; two of them are '
            f'{min(sides):.2g} m apart. A full circle takes two arcs.'
        )
    if norm(n) < _COLLINEAR * sides[0] * sides[1]:
        raise MotionError(
            'movec: start, via and target lie on one straight line, which is no circle; '
            'use movel or move the via point aside.'
        )
