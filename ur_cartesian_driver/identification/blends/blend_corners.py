# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The straight stretches in a chain of moves with blends, and the corners at which they meet."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import acos, cos, degrees, radians, sin, sqrt

import numpy as np

from ur_cartesian_driver.identification.moves import FoundMove
from ur_cartesian_driver.identification.segmentation import noise_of
from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats

#: A row is straight if it is this near to the chord of its neighbours [m or rad], and noise.
_BENT, _NOISE = 5e-7, 8.0
#: Distance of the neighbours, as a share of the smallest radius.
_WINDOW = 0.2
#: Rows that a stretch, and a blend, need at least; most that are used of a stretch.
_MIN_ROWS, _MAX_ROWS = 12, 1000
#: Corners from which the curve of a blend can be told [rad].
MIN_CORNER, MAX_CORNER = radians(10.0), radians(170.0)
#: Two lines that pass each other at a greater distance do not meet [m or rad].
_MISSED = 5e-6


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BlendCorner:
    """
    Two straight stretches and the blend between them, in the plane of both.

    Coordinates are those of the tool [m] or of the joints [rad]. The origin is where the lines
    meet; x points along the first line, y to the side of the second one.

    :param radius: radius of the call [m].
    :param of_lines: whether tool lines are joined, not joint moves.
    :param angle: by which the direction changes [rad].
    :param time: (n,) of the rows [s]; ``follows``: mask of those that come a cycle after another.
    :param plane: (n, 2) coordinates of the rows.
    :param beside: (n,) distances from the plane.
    :param tool: (n, 3) positions of the tool [m].
    :param before: rows on the first line; ``blend``: rows off both; ``after``: on the second one.
    :param unevenness: how far rows on the lines are off them, root mean square.
    """

    radius: float
    of_lines: bool
    angle: float
    time: Floats
    follows: Flags
    plane: Floats
    beside: Floats
    tool: Floats
    before: slice
    blend: slice
    after: slice
    unevenness: float


def corners_of(move: FoundMove) -> list[BlendCorner | str]:
    """Return the corners of a chain, each or all of them as the reason why there is none."""
    chain, samples = move.chain, move.samples
    if move.piece.ending or move.piece.resumed or move.piece.slowed:
        return ['its program was stopped, paused or slowed on the way']
    if len({command.name for command in chain}) > 1:
        return ['it joins a line to a joint move']
    if samples.target_pose is None:
        return ['the recording has no target_TCP_pose']
    first, last = move.piece.moving
    rows = slice(max(first, move.piece.begin), min(last + 1, move.piece.end))
    time, follows = move.rows
    part = slice(rows.start - move.piece.begin, rows.stop - move.piece.begin)
    tool = samples.target_pose[rows, :3]
    of_lines = chain[0].name == 'movel'
    places = tool if of_lines else samples.target_q[rows]
    radii = [command.r or 0.0 for command in chain[:-1]]
    stretches = _stretches(places, tool, _WINDOW * min(radii))
    if len(stretches) != len(chain):
        return [
            f'it has {len(chain)} calls, and straight stretches: {len(stretches)}; blends fill a '
            'move, a corner is too flat, or a curve bends both ways'
        ]
    table = _Rows(time[part], follows[part], places, tool)
    return [
        table.corner(one, other, radius, of_lines)
        for (one, other), radius in zip(pairwise(stretches), radii, strict=True)
    ]


def _stretches(places: Floats, tool: Floats, window: float) -> list[slice]:
    """
    Return the rows of each straight stretch, except those within the window of its ends.

    :param places: (n, d) of tool or joints; ``tool``: (n, 3) of the tool [m].
    :param window: travel of the tool over which a row is compared with its neighbours [m].
    """
    travel = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(tool, axis=0), axis=1))])
    rows = np.arange(len(tool))
    first = np.minimum(np.searchsorted(travel, travel - window), np.maximum(rows - 1, 0))
    last = np.searchsorted(travel, travel + window)
    last = np.minimum(np.maximum(last, rows + 1), len(rows) - 1)
    chords, offsets = places[last] - places[first], places - places[first]
    square = np.maximum((chords**2).sum(axis=1), 1e-30)
    along = (offsets * chords).sum(axis=1) / square
    bent = np.linalg.norm(offsets - along[:, None] * chords, axis=1)
    straight = np.concatenate([[False], bent < _BENT + _NOISE * noise_of(places), [False]])
    edges = np.flatnonzero(np.diff(straight.astype(int)))
    return [
        slice(int(a), int(b))
        for a, b in edges.reshape(-1, 2)
        if b - a >= _MIN_ROWS and travel[b - 1] - travel[a] > window
    ]


@dataclass(frozen=True, slots=True, eq=False)
class _Rows:
    """The moving rows of a chain."""

    time: Floats
    follows: Flags
    places: Floats
    tool: Floats

    def corner(self, one: slice, other: slice, radius: float, of_lines: bool) -> BlendCorner | str:
        """Return the corner between two stretches, or why its blend cannot be evaluated."""
        one = slice(max(one.start, one.stop - _MAX_ROWS), one.stop)
        other = slice(other.start, min(other.stop, other.start + _MAX_ROWS))
        (a, da), (b, db) = _line(self.places[one]), _line(self.places[other])
        c = float(da @ db)
        angle = acos(min(max(c, -1.0), 1.0))
        if not MIN_CORNER < angle < MAX_CORNER:
            return (
                f'its corner of {degrees(angle):.2g} degrees does not tell one curve from '
                f'another; {degrees(MIN_CORNER):.0f} to {degrees(MAX_CORNER):.0f} do'
            )
        # The points of both lines that are nearest to each other.
        w = b - a
        on_a = a + da * (w @ da - c * (w @ db)) / (1.0 - c * c)
        on_b = b + db * (c * (w @ da) - w @ db) / (1.0 - c * c)
        if (missed := float(np.linalg.norm(on_a - on_b))) > _MISSED:
            return f'its moves are no straight lines that meet: {1e6 * missed:.3g} um or urad off'
        offsets = self.places - 0.5 * (on_a + on_b)
        side = (db - c * da) / sqrt(1.0 - c * c)
        plane = np.stack([offsets @ da, offsets @ side], axis=1)
        beside = np.linalg.norm(offsets - plane @ np.stack([da, side]), axis=1)
        # Distances from both lines.
        near = np.abs(plane[:, 1]), np.abs(plane @ np.array([-sin(angle), cos(angle)]))
        found = plane[one, 1], (plane @ np.array([-sin(angle), cos(angle)]))[other]
        unevenness = float(np.sqrt(np.mean(np.concatenate(found) ** 2)))
        inside = slice(one.stop, other.start)
        off = np.minimum(near[0], near[1])[inside] > _BENT + _NOISE * noise_of(self.places)
        blend = one.stop + np.flatnonzero(off)
        if len(blend) < _MIN_ROWS:
            return (
                f'it was passed in {len(blend)} packets, {_MIN_ROWS} are needed: take a larger '
                'r, or a lower speed'
            )
        return BlendCorner(
            radius=radius,
            of_lines=of_lines,
            angle=angle,
            time=self.time,
            follows=self.follows,
            plane=plane,
            beside=beside,
            tool=self.tool,
            before=one,
            blend=slice(int(blend[0]), int(blend[-1]) + 1),
            after=other,
            unevenness=unevenness,
        )


def _line(places: Floats) -> tuple[Floats, Floats]:
    """Return the mean (d,) and the direction (d,) of places on a line."""
    mean = places.mean(axis=0)
    direction = np.linalg.svd(places - mean, full_matrices=False)[2][0]
    if direction @ (places[-1] - places[0]) < 0.0:
        direction = -direction
    return mean, direction
