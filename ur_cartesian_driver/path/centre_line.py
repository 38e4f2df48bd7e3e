# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Arcs through three points; the centre line of a weave, which consists of lines and arcs."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate
from math import atan2, cos, pi, sin, sqrt

from ur_cartesian_driver.motion.geometry.pose import (
    Pose,
    quaternion_from_rotation_vector,
    rotate,
    slerp,
)
from ur_cartesian_driver.motion.geometry.vectors import (
    add,
    cross,
    dot,
    norm,
    scale,
    subtract,
    unit,
    Vector3,
)

#: A change of direction larger than this [rad] is a corner.
MAX_CORNER = 0.02
#: Three points that are closer than this [m] to one line make no arc.
_FLAT = 1e-6


@dataclass(frozen=True, slots=True)
class Stroke:
    """A straight line or an arc, from one pose to another."""

    start: Pose
    end: Pose
    length: float
    #: Centre of an arc [m].
    centre: Vector3 = (0.0, 0.0, 0.0)
    #: Unit vector of the axis of an arc.
    axis: Vector3 = (0.0, 0.0, 0.0)
    #: Angle of an arc about its axis, from start to end [rad]; 0 = a straight line.
    angle: float = 0.0

    def position(self, s: float) -> Vector3:
        """Return the position after a distance s [m]."""
        if not self.angle:
            step = subtract(self.end.position, self.start.position)
            return add(self.start.position, scale(step, s / self.length))
        turned = rotate(self._turn(s), subtract(self.start.position, self.centre))
        return add(self.centre, turned)

    def tangent(self, s: float) -> Vector3:
        """Return the direction after a distance s [m]."""
        if not self.angle:
            return unit(subtract(self.end.position, self.start.position))
        return unit(cross(self.axis, subtract(self.position(s), self.centre)))

    def orientation(self, s: float) -> tuple[float, float, float, float]:
        """Return the orientation after a distance s [m]."""
        return slerp(self.start.quaternion, self.end.quaternion, s / self.length)

    def is_smooth_into(self, after: Stroke) -> bool:
        """Return whether the next stroke continues in the same direction."""
        return dot(self.tangent(self.length), after.tangent(0.0)) > cos(MAX_CORNER)

    def _turn(self, s: float) -> tuple[float, float, float, float]:
        return quaternion_from_rotation_vector(scale(self.axis, self.angle * s / self.length))


def line(start: Pose, end: Pose) -> Stroke:
    """Return a straight line."""
    return Stroke(start, end, start.distance_to(end))


def arc(start: Pose, via: Vector3, end: Pose) -> Stroke | None:
    """Return the arc through three points; None if they lie on one line."""
    a, b = subtract(via, start.position), subtract(end.position, start.position)
    normal = cross(a, b)
    longest = max(norm(a), norm(b), norm(subtract(b, a)))
    if norm(normal) <= _FLAT * longest:
        return None
    # From the start to the centre of the circumscribed circle.
    square = dot(normal, normal)
    offset = scale(
        add(scale(cross(b, normal), dot(a, a)), scale(cross(normal, a), dot(b, b))),
        0.5 / square,
    )
    axis = unit(normal)
    centre = add(start.position, offset)
    first, last = scale(offset, -1.0), subtract(b, offset)
    angle = atan2(dot(axis, cross(first, last)), dot(first, last)) % (2.0 * pi)
    return Stroke(start, end, norm(offset) * angle, centre, axis, angle)


def turned(stroke: Stroke) -> Pose:
    """Return the end pose of an arc along which the tool turns with the tangent."""
    turn = Pose((0.0, 0.0, 0.0), stroke._turn(stroke.length))
    return Pose(stroke.end.position, (turn @ Pose(quaternion=stroke.start.quaternion)).quaternion)


class CentreLine:
    """Consecutive strokes, about which a wave swings across the stroke and the tool's z axis."""

    def __init__(self, strokes: Sequence[Stroke]) -> None:
        """
        Join strokes.

        :param strokes: at least one; each begins where the one before ends.
        """
        self._strokes = strokes
        self._begins = [0.0, *accumulate(stroke.length for stroke in strokes)]
        self.length = self._begins[-1]

    def swing(self, s: float, amplitude: float, waves: int) -> Pose:
        """
        Return the pose after a distance s [m] along the centre line, on a sine wave about it.

        :param amplitude: largest distance of the wave to either side [m].
        :param waves: number of waves on the whole centre line.

        :raises ZeroDivisionError: the tool points along the centre line.
        """
        k = min(bisect_right(self._begins, s) - 1, len(self._strokes) - 1)
        stroke, along = self._strokes[k], s - self._begins[k]
        q = stroke.orientation(along)
        side = unit(cross(rotate(q, (0.0, 0.0, 1.0)), stroke.tangent(along)))
        sideways = amplitude * sin(2.0 * pi * waves * s / self.length)
        return Pose(add(stroke.position(along), scale(side, sideways)), q)


@dataclass(frozen=True, slots=True)
class RestToRest:
    """A motion from rest to rest: its length [m], largest speed [m/s] and acceleration [m/s^2]."""

    length: float
    speed: float
    acceleration: float

    @property
    def _ramp(self) -> float:
        return min(0.5 * self.length, 0.5 * self.speed**2 / self.acceleration)

    @property
    def duration(self) -> float:
        """Duration of the motion [s]."""
        return self.time(self.length)

    def time(self, s: float) -> float:
        """Return the time [s] at which a distance s [m] is reached."""
        a, ramp = self.acceleration, self._ramp
        if s <= ramp:
            return sqrt(2.0 * s / a)
        top = sqrt(2.0 * ramp * a)
        cruise_end = self.length - ramp
        if s <= cruise_end:
            return top / a + (s - ramp) / top
        left = max(0.0, self.length - s)
        return 2.0 * top / a + (cruise_end - ramp) / top - sqrt(2.0 * left / a)

    def rate(self, s: float) -> float:
        """Return the speed [m/s] after a distance s [m]."""
        return sqrt(2.0 * self.acceleration * min(s, self._ramp, max(0.0, self.length - s)))
