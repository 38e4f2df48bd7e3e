# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The shapes of blends: the transitions from one curve into the next that round waypoints.

UR publishes the radius within which a blend stays. It publishes the shape only of blends of
``movep``: an arc that touches both segments (a fillet). Other blends are modelled as a crossfade
of two motions: the first slows down evenly while the second speeds up evenly. Between straight
lines this makes a parabola. Between two joint moves the crossfade is in joint space, otherwise in
Cartesian space.
"""

from __future__ import annotations

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats, Indices
from ur_cartesian_driver.motion.geometry.pose import N
from ur_cartesian_driver.motion.geometry.pose_rows import (
    angle_rows,
    conjugate_rows,
    length_rows,
    multiply_rows,
    normalized_rows,
)
from ur_cartesian_driver.planning.geometry.curves import (
    ARC_CHORD_ERROR,
    CURVE_CHORD_ERROR,
    MAX_TURN_PER_SAMPLE,
)

# Segments that go straight on or straight back, to within this angle [rad], have no fillet.
_STRAIGHT = 1e-6
# Nodes and weights of Gauss-Legendre quadrature.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)
# Least radius of the fillet between segments that go straight back [m].
_MIN_RADIUS = 1e-9


def crossfade(leave: N, join: N, s: N) -> tuple[N, N]:
    """
    Return the ``u`` on the first and on the second curve at the parameters ``s`` of blends.

    :param leave: ``u`` at which the blend leaves the first curve.
    :param join: ``u`` at which the blend joins the second curve.
    :param s: parameter of the blend, from 0 to 1.
    """
    return leave + (1.0 - leave) * s * (2.0 - s), join * s * s


def crossfade_rows(first: Floats, waypoint: Floats, second: Floats) -> Floats:
    """
    Return the poses (n, 7) in blends.

    :param first: (n, 7) the poses on the curves before the waypoints; ``second``: after them.
    """
    rows = first + second - waypoint
    rows[:, 3:] = waypoint[:, 3:]
    turns = np.flatnonzero(
        ((first[:, 3:] != waypoint[:, 3:]) | (second[:, 3:] != waypoint[:, 3:])).any(axis=1)
    )
    to_waypoint = multiply_rows(first[turns, 3:], conjugate_rows(waypoint[turns, 3:]))
    rows[turns, 3:] = normalized_rows(multiply_rows(to_waypoint, second[turns, 3:]))
    return rows


class BlendShapes:
    """
    Lengths, turns and tolerances of many blends.

    :param start: (n, 7) the poses where the blends begin; ``middle``: the waypoints; ``end``: the
        poses where the blends end.
    :param radius: (n,) the blend radii [m].
    :param fillet: (n,) whether each blend is a fillet.
    """

    def __init__(
        self,
        start: Floats,
        middle: Floats,
        end: Floats,
        radius: Floats,
        fillet: Flags,
    ) -> None:
        """Measure the turns, and the angles between the segments."""
        self.start, self.middle, self.end = start[:, :3], middle[:, :3], end[:, :3]
        self.radius, self.fillet = radius, fillet
        self.before = angle_rows(start[:, 3:], middle[:, 3:])
        self.after = angle_rows(middle[:, 3:], end[:, 3:])
        self.turns: Floats = self.before + self.after
        self.opening = opening_rows(self.start, self.middle, self.end)

    def lengths(self) -> Floats:
        """Return the lengths [m] of the fillets or parabolas, as if all segments were lines."""
        arc = self._circle_radii() * (np.pi - self.opening)
        there_and_back = length_rows(self.start - self.middle) + length_rows(
            self.end - self.middle
        )
        lengths: Floats = np.where(
            self.fillet,
            np.where(self.opening < np.pi - _STRAIGHT, arc, there_and_back),
            _parabola_lengths(self.start, self.middle, self.end),
        )
        return lengths

    def arc_radii(self) -> Floats:
        """Return the radii of the circular blends [m]; inf for the others."""
        radii: Floats = np.where(self.fillet, self._circle_radii(), np.inf)
        return radii

    def _circle_radii(self) -> Floats:
        return np.maximum(fillet_radius(self.radius, self.opening), _MIN_RADIUS)

    def samples(self) -> Indices:
        """Return the number of chords that follow each blend closely enough."""
        # At its ends, a blend turns the tool at twice the mean rate.
        turns = np.ceil(2.0 * self.turns / MAX_TURN_PER_SAMPLE)
        radius = np.maximum(fillet_radius(self.radius, self.opening), 1e-3)
        on_circle = (np.pi - self.opening) / np.sqrt(8.0 * ARC_CHORD_ERROR / radius)
        # A parabola with control points a, p, b leaves its chords by |a - 2 p + b| / (4 n^2).
        bend = length_rows(self.start - 2.0 * self.middle + self.end)
        on_parabola = np.sqrt(bend / (4.0 * CURVE_CHORD_ERROR))
        curve = np.ceil(np.where(self.fillet, on_circle, on_parabola))
        return np.maximum(2.0, np.maximum(turns, curve)).astype(np.intp)

    def tolerances(self) -> Floats:
        """Return how far the robot's own blends may be from these blends (n, 2) [m], [rad]."""
        height = length_rows(self.middle - 0.5 * (self.start + self.end))
        return 0.5 * np.stack((height, np.maximum(self.before, self.after)), axis=1)


def opening_rows(start: Floats, waypoint: Floats, end: Floats) -> Floats:
    """Return the angles between the two segments at the waypoints [rad], pi = straight on."""
    a, b = _units(start - waypoint), _units(end - waypoint)
    # For segments in line, this is more accurate than the arc cosine.
    opening: Floats = 2.0 * np.arctan2(length_rows(a - b), length_rows(a + b))
    return opening


def fillet_radius(radius: Floats, opening: Floats) -> Floats:
    """Return the radii of the circles that touch both segments at ``radius`` from the waypoint."""
    result: Floats = radius * np.tan(np.minimum(0.5 * opening, 0.5 * np.pi - 1e-9))
    return result


def fillet_rows(start: Floats, waypoint: Floats, end: Floats, radius: Floats, s: Floats) -> Floats:
    """
    Return positions (n, 3) on circles that touch both segments.

    :param s: (n,) the fraction of the arc, from 0 to 1.
    """
    opening = opening_rows(start, waypoint, end)
    rho = fillet_radius(radius, opening)
    inwards = _units(_units(start - waypoint) + _units(end - waypoint))
    across = _units(end - start)
    phi = (s - 0.5) * (np.pi - opening)
    # The center lies rho / sin(opening / 2) from the waypoint.
    depth = rho / np.maximum(np.sin(0.5 * opening), 1e-12) - rho * np.cos(phi)
    circle = waypoint + depth[:, None] * inwards + (rho * np.sin(phi))[:, None] * across
    # Segments in line have no circle, so their blend is its chord. If the path goes straight on,
    # the chord leads through the waypoint. If it goes straight back, the chord is only the point
    # at which the first segment is left. The circle, too, shrinks to it as the opening goes to 0.
    chord = start + s[:, None] * (end - start)
    has_circle = (opening > _STRAIGHT) & (opening < np.pi - _STRAIGHT)
    return np.where(has_circle[:, None], circle, chord)


def _parabola_lengths(start: Floats, waypoint: Floats, end: Floats) -> Floats:
    """
    Return the lengths of parabolas with the control points a, p and b [m].

    The speed is 2 |u + s w| with u = p - a, w = a - 2 p + b: the square root of a quadratic in s.
    Its integral is elementary, but has special cases. Gauss-Legendre quadrature has none. With
    eight points, its relative error is a millionth (for blends that lead nearly straight back, a
    thousandth).
    """
    u, w = waypoint - start, start - 2.0 * waypoint + end
    s = 0.5 * (_NODES + 1.0)
    # |u + s w|^2 = |u|^2 + 2 s u w + s^2 |w|^2
    uu, uw, ww = (np.einsum('ij,ij->i', a, b)[:, None] for a, b in ((u, u), (u, w), (w, w)))
    lengths: Floats = np.sqrt(np.maximum(uu + s * (2.0 * uw + s * ww), 0.0)) @ _WEIGHTS
    return lengths


def _units(vectors: Floats) -> Floats:
    lengths: Floats = length_rows(vectors)
    return vectors / np.maximum(lengths, 1e-300)[:, None]
