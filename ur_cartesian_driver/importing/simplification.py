# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Fewer points: sequences of short lines become long lines and arcs.

A line here is a straight piece of the path. The tolerance bounds the distance of any position on
the old path from the new path, and vice versa. A new line is within the tolerance if the points
that it leaves out are, because both paths are straight between these points. For a new arc, two
kinds of positions on the old path are checked: the points left out, and on each short line the
position nearest to the arc's centre. (Along the old path the angle about this centre only grows,
so the old path is near every position on the arc.)

A point is kept if an output, wait, dwell or posture belongs to it, if speed, acceleration or
corner change after it, or if the orientation there would change by more than `MAX_TURN` without
it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import pi, radians
from typing import NamedTuple

import numpy as np

from ur_cartesian_driver.importing.imported_path import ImportedPath
from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats
from ur_cartesian_driver.motion.geometry.pose_rows import angle_rows, interpolate_rows
from ur_cartesian_driver.motion.goal.goal import SegmentType

#: Largest angle [rad] between the old and the new orientation at a left-out point.
MAX_TURN = radians(0.5)
#: Smallest number of lines that an arc replaces.
_MIN_LINES = 4
#: Largest angle [rad] of an arc.
_MAX_ARC = 0.9 * pi
#: Smallest height [m] of an arc: the robot treats flatter arcs as lines.
_MIN_HEIGHT = 2e-5
#: Factor on the tolerance that allows for rounding errors.
_ROUNDING = 1.0 - 1e-9


class _Piece(NamedTuple):
    """A line or an arc from one row to another."""

    end: int
    via: Floats | None


def simplify(path: ImportedPath, tolerance: float, orientations: Floats) -> ImportedPath:
    """
    Return a path with fewer points that stays within a tolerance of the old path.

    :param tolerance: the largest distance [m] between the two paths.
    :param orientations: (n, 4) orientations of the tool at the points.
    """
    if tolerance <= 0.0 or len(path) < 3:
        return path
    solver = _Simplifier(path.positions, orientations, tolerance * _ROUNDING)
    rows, vias = [0], {}
    start = 0
    for stop in _ends_of_runs(path):
        while start < stop:
            piece = solver.longest(start, stop)
            rows.append(piece.end)
            if piece.via is not None:
                vias[len(rows) - 1] = piece.via
            start = piece.end
    kept = path.take(np.array(rows, dtype=np.int64))
    if not vias:
        return kept
    types, places = kept.types.copy(), kept.vias.copy()
    types[list(vias)] = SegmentType.CIRCULAR
    places[list(vias)] = list(vias.values())
    return replace(kept, types=types, vias=places)


def farthest_row(start: int, first: int, stop: int, holds: Callable[[int, int], object]) -> int:
    """
    Return a far row to which a piece is possible, by doubling the step and then bisecting.

    :param first: the nearest row to try; if no piece leads to it, the result is ``start`` + 1.
    :param holds: returns whether a piece from one row to another is possible.
    """
    if not holds(start, first):
        return start + 1
    good, step = first, max(1, first - start)
    bad = stop + 1
    while good < stop:
        trial = min(good + step, stop)
        if not holds(start, trial):
            bad = trial
            break
        good, step = trial, 2 * step
    while bad - good > 1:
        trial = (good + bad) // 2
        if holds(start, trial):
            good = trial
        else:
            bad = trial
    return good


def _ends_of_runs(path: ImportedPath) -> list[int]:
    """
    Return the rows, apart from row 0, that have to be kept.

    The rows between two of them are ends of lines with equal speed, acceleration and corner.
    """
    stays = path.rests
    stays[-1] = True
    lines = np.isin(path.types, (SegmentType.AUTO, SegmentType.LINEAR)) & ~path.lifts
    stays |= ~lines
    stays[:-1] |= ~lines[1:]
    for column in (path.speeds, path.accelerations, path.corners, path.travels.astype(float)):
        same = (column[1:] == column[:-1]) | (np.isnan(column[1:]) & np.isnan(column[:-1]))
        stays[:-1] |= ~same
    for row in (*path.postures, *(output.waypoint for output in path.outputs)):
        stays[row] = True
    return [int(row) for row in np.flatnonzero(stays) if row]


@dataclass
class _Simplifier:
    points: Floats
    orientations: Floats
    tolerance: float

    def __post_init__(self) -> None:
        self.turns = bool((self.orientations != self.orientations[0]).any())
        self.may_be_line = self._first_test()

    def longest(self, start: int, stop: int) -> _Piece:
        """Return the longest piece that begins at row ``start`` and ends at most at ``stop``."""
        end = start + 1
        if end < stop and self.may_be_line[start]:
            end = farthest_row(start, start + 2, stop, self._is_line)
        via: Floats | None = None
        first = max(end + 1, start + _MIN_LINES)
        if first <= stop and self._arc(start, first) is not None:
            end = farthest_row(start, first, stop, lambda a, b: self._arc(a, b) is not None)
            via = self._arc(start, end)
        return _Piece(end, via)

    def _first_test(self) -> Flags:
        """Test quickly, for each row, whether the point after it might be left out."""
        a, b, c = self.points[:-2], self.points[1:-1], self.points[2:]
        chord = c - a
        square = np.einsum('ij,ij->i', chord, chord)
        share = np.einsum('ij,ij->i', b - a, chord) / np.where(square > 0.0, square, 1.0)
        foot = a + np.clip(share, 0.0, 1.0)[:, None] * chord
        near = np.linalg.norm(b - foot, axis=1) <= self.tolerance
        return np.concatenate((near, (False, False)))

    def _is_line(self, start: int, end: int) -> bool:
        a, between = self.points[start], self.points[start + 1 : end]
        chord = self.points[end] - a
        length = float(np.sqrt(chord @ chord))
        if length < 1e-9:
            return False
        along = (between - a) @ chord / length**2
        off = between - a - along[:, None] * chord
        # If a point is outside the stretch from a to the end, the old path goes back and forth.
        if along.min() < 0.0 or along.max() > 1.0:
            return False
        if np.einsum('ij,ij->i', off, off).max() > self.tolerance**2:
            return False
        return self._turns_evenly(start, end, along)

    def _arc(self, start: int, end: int) -> Floats | None:
        """Return the middle of the arc from one row to another; None = no arc fits."""
        p = self.points[start : end + 1]
        a, m, b = p[0], p[(end - start) // 2], p[-1]
        u, v = m - a, b - a
        normal = np.cross(u, v)
        square = float(normal @ normal)
        if square < 1e-24:
            return None
        centre = a + np.cross((u @ u) * v - (v @ v) * u, normal) / (2.0 * square)
        ez = normal / np.sqrt(square)
        ex = a - centre
        radius = float(np.sqrt(ex @ ex))
        if radius > 100.0:
            return None
        ex = ex / radius
        ey = np.cross(ez, ex)
        r = p - centre
        x, y, z = r @ ex, r @ ey, r @ ez
        angles = np.unwrap(np.arctan2(y, x))
        sweep = float(angles[-1])
        if not 0.0 < sweep <= _MAX_ARC or (np.diff(angles) <= 0.0).any():
            return None
        if radius * (1.0 - np.cos(sweep / 2.0)) < _MIN_HEIGHT:
            return None
        # On each short line, find the position nearest to the centre.
        flat = np.stack((x, y), axis=1)
        d = flat[1:] - flat[:-1]
        share = -np.einsum('ij,ij->i', flat[:-1], d) / np.einsum('ij,ij->i', d, d)
        inner = flat[:-1] + np.clip(share, 0.0, 1.0)[:, None] * d
        radial = max(
            float(np.abs(np.hypot(x, y) - radius).max()),
            float(np.abs(np.hypot(inner[:, 0], inner[:, 1]) - radius).max()),
        )
        if np.hypot(radial, np.abs(z).max()) > self.tolerance:
            return None
        if not self._turns_evenly(start, end, angles[1:-1] / sweep):
            return None
        middle: Floats = centre + radius * (np.cos(sweep / 2.0) * ex + np.sin(sweep / 2.0) * ey)
        return middle

    def _turns_evenly(self, start: int, end: int, shares: Floats) -> bool:
        if not self.turns:
            return True
        q = self.orientations
        pose = np.zeros((len(shares), 7))
        first, last = pose.copy(), pose
        first[:, 3:], last[:, 3:] = q[start], q[end]
        between = interpolate_rows(first, last, shares)[:, 3:]
        return bool(angle_rows(between, q[start + 1 : end]).max() <= MAX_TURN)
