# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Arcs, circles and helices of G2 and G3: their centres, and the points that describe them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import acos, atan2, ceil, cos, hypot, pi, sin
from typing import NamedTuple

from ur_cartesian_driver.motion.geometry.vectors import Vector3

#: Allowed difference of the radii at the ends of an arc, as in LinuxCNC and GRBL: the larger of a
#: length [m] and a fraction of the radius, but at most a second length [m].
_RADIUS_TOLERANCE, _RADIUS_SHARE, _MAX_RADIUS_TOLERANCE = 5e-6, 1e-3, 5e-4
#: An arc that turns by less than this angle [rad] is a full circle, as in LinuxCNC.
_FULL_CIRCLE = 1e-6
#: Smallest rise [m] of a helix, and smallest chord [m] of an arc that is given by its radius.
_MIN_RISE = 1e-6
_MAX_LINES = 100_000


class ArcPlane(NamedTuple):
    """A plane of arcs: right-handed axes, two in the plane and one along which arcs can rise."""

    name: str
    axes: tuple[int, int, int]
    #: The letters of the words that give the centre along these three axes.
    letters: tuple[str, str, str]


PLANES = {
    'G17': ArcPlane('G17', (0, 1, 2), ('I', 'J', 'K')),
    'G18': ArcPlane('G18', (2, 0, 1), ('K', 'I', 'J')),
    'G19': ArcPlane('G19', (1, 2, 0), ('J', 'K', 'I')),
}


class Arc(NamedTuple):
    """An arc of a circle or a helix [m, rad], which can have several turns."""

    axes: tuple[int, int, int]
    centre: tuple[float, float]
    start: Sequence[float]
    end: Sequence[float]
    #: The angle at the start, measured from the first axis of the plane towards the second.
    begin: float
    #: The angle of all turns, positive in the same direction.
    sweep: float
    #: The distances of start and end from the centre.
    radii: tuple[float, float]

    @property
    def rises(self) -> bool:
        """Return whether the arc leaves its plane."""
        axis = self.axes[2]
        return abs(self.end[axis] - self.start[axis]) > _MIN_RISE

    def place(self, share: float) -> Vector3:
        """Return the point at a fraction of the arc, which is a spiral if its radii differ."""
        if share == 1.0:
            x, y, z = self.end
            return (x, y, z)
        a, b, c = self.axes
        angle = self.begin + share * self.sweep
        radius = self.radii[0] + share * (self.radii[1] - self.radii[0])
        point = [0.0, 0.0, 0.0]
        point[a] = self.centre[0] + radius * cos(angle)
        point[b] = self.centre[1] + radius * sin(angle)
        point[c] = self.start[c] + share * (self.end[c] - self.start[c])
        return (point[0], point[1], point[2])

    def lines(self, tolerance: float) -> list[Vector3]:
        """
        Return the end points of a chain of lines that stays within a tolerance [m] of the arc.

        :raises ValueError: the chain would have too many lines.
        """
        step = 2.0 * acos(max(0.0, 1.0 - min(1.0, tolerance / max(self.radii))))
        count = max(2, ceil(abs(self.sweep) / max(step, 1e-6)))
        if count > _MAX_LINES:
            raise ValueError(f'the helix would need {count} lines; give a larger tolerance')
        return [self.place(i / count) for i in range(1, count + 1)]

    def arcs(self) -> Iterator[tuple[Vector3, Vector3]]:
        """Yield the via point and the end point of each of the robot arcs that form this arc."""
        # Three points define an arc of about half a circle best.
        count = ceil(abs(self.sweep) / (0.9 * pi))
        for i in range(count):
            yield self.place((i + 0.5) / count), self.place((i + 1) / count)


def arc_between(
    plane: ArcPlane,
    start: Sequence[float],
    end: Sequence[float],
    centre: tuple[float, float] | float,
    direction: int,
    turns: int,
) -> Arc:
    """
    Return the arc from one point to another.

    :param centre: the centre in the plane, or else a radius: negative if the arc is longer than
        a half circle.
    :param direction: clockwise -1 (G2), counterclockwise 1 (G3).
    :param turns: 1 for an arc of at most a full circle; each further turn adds a full circle.
    :raises ValueError: no arc fits these values; the message is a sentence without a full stop.
    """
    a, b, _ = plane.axes
    ax, ay, bx, by = start[a], start[b], end[a], end[b]
    if isinstance(centre, float):
        centre = _centre_of_radius(ax, ay, bx, by, centre, direction)
    cx, cy = centre
    radius, other = hypot(ax - cx, ay - cy), hypot(bx - cx, by - cy)
    tolerance = min(max(_RADIUS_TOLERANCE, _RADIUS_SHARE * radius), _MAX_RADIUS_TOLERANCE)
    if abs(radius - other) > tolerance or not radius > 0.0:
        raise ValueError(
            f'the arc begins {1e3 * radius:.6g} mm and ends {1e3 * other:.6g} mm from its centre'
        )
    begin = atan2(ay - cy, ax - cx)
    sweep = direction * (atan2(by - cy, bx - cx) - begin) % (2.0 * pi)
    if sweep < _FULL_CIRCLE:
        sweep += 2.0 * pi
    sweep = direction * (sweep + 2.0 * pi * (turns - 1))
    return Arc(plane.axes, centre, start, end, begin, sweep, (radius, other))


def _centre_of_radius(
    ax: float, ay: float, bx: float, by: float, radius: float, direction: int
) -> tuple[float, float]:
    """Return the centre of an arc that is given by its radius."""
    dx, dy = bx - ax, by - ay
    chord = hypot(dx, dy)
    if chord < _MIN_RISE:
        raise ValueError('an arc with R ends where it begins; give I and J for a circle')
    if chord > 2.0 * (abs(radius) + _RADIUS_TOLERANCE):
        raise ValueError(
            f'the arc spans {1e3 * chord:.6g} mm, more than twice its radius '
            f'{1e3 * abs(radius):.6g} mm'
        )
    height = max(0.0, radius * radius - 0.25 * chord * chord) ** 0.5
    height *= direction if radius > 0.0 else -direction
    return (ax + bx) / 2.0 - height * dy / chord, (ay + by) / 2.0 + height * dx / chord
