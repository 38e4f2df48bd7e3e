# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Samples along the path of a goal: on parts of curves, and on the blends between them.

A piece is a part of a curve, or a blend. Samples are at most 2 mm and one degree apart, and a
piece has at least eight. Only a piece of up to 11.2 mm and 5.6 degrees has fewer, at most 1.6 mm
and 0.8 degrees apart; for example, a piece of 5 mm has four. Where the joints turn fast,
:mod:`~ur_cartesian_driver.planning.preflight.joint_path_solver` adds samples.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import pi
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats, Indices, Int32s
from ur_cartesian_driver.motion.geometry.pose import Pose, pose_from_row
from ur_cartesian_driver.planning.geometry.blended_path import BlendedPath, CurveSequence

#: Columns of consecutive rows.
Part = TypeVar('Part', bound=tuple[NDArray[Any], ...])

#: Maximum distance between neighbouring samples [m], [rad].
STEP_LENGTH = 0.002
STEP_ANGLE = pi / 180.0
#: Minimum number of samples on a piece. Only a short piece has fewer: just enough that neighbours
#: are no farther apart than the maximum distance divided by _MIN_REFINEMENT.
MIN_SAMPLES = 8
_MIN_REFINEMENT = 1.25
#: Maximum number of samples of a goal; each needs a quarter of a kilobyte while it is checked.
MAX_SAMPLES = 2_000_000


def joined_columns(parts: list[Part]) -> Iterator[NDArray[Any]]:
    """Yield the columns of consecutive rows, joined. The list is emptied to save memory."""
    columns = [[*column] for column in zip(*parts, strict=True)]
    parts.clear()
    while columns:
        column = columns.pop(0)
        yield column[0] if len(column) == 1 else np.concatenate(column)


def counted(counts: Indices) -> tuple[Indices, Indices]:
    """Return each k ``counts[k]`` times (0, 0, 1, 1, ...), and 1 to ``counts[k]`` for each k."""
    rows = np.repeat(np.arange(len(counts)), counts)
    return rows, np.arange(1, len(rows) + 1) - np.repeat(np.cumsum(counts) - counts, counts)


def group_begins(segments: Int32s) -> Indices:
    """Return the first row of each segment; ``segments`` (n,) must not decrease."""
    changes = np.ones(len(segments), dtype=np.bool_)
    np.not_equal(segments[1:], segments[:-1], out=changes[1:])
    return np.flatnonzero(changes)


def first_least(values: Floats, segments: Int32s) -> Indices:
    """
    Return the row of the least value of each segment, the first one if there are several.

    :param segments: (n,) the segment of each value, not decreasing.
    """
    begins = group_begins(segments)
    sizes = np.diff(begins, append=len(segments))
    rows = np.flatnonzero(values == np.repeat(np.minimum.reduceat(values, begins), sizes))
    return rows[group_begins(segments[rows])]


def last_greatest(values: Floats, segments: Int32s) -> Indices:
    """Return the row of the greatest value of each segment, the last one if there are several."""
    return len(values) - 1 - first_least(-values[::-1], -segments[::-1])[::-1]


def check_sample_count(
    count: Floats | Indices,
    points: Indices | Int32s,
    remedy: str,
    *,
    before: int = 0,
    most: int = MAX_SAMPLES,
) -> None:
    """
    Refuse a goal that needs too many samples.

    :param count: (n,) the number of samples of each part; ``points``: (n,) the point at its end.
    :param remedy: the first advice of the refusal.
    :param before: the number of samples on the path before these parts.
    """
    if (total := before + count.sum()) > most:
        raise InvalidGoal(
            'trajectory.points',
            f'describe a path whose check needs {total:.3g} samples, more than {most:,}, most of '
            f'all on the way to points[{points[np.argmax(count)]}]',
            f'{remedy}, or split the goal',
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class CurvePieces:
    """Parts of the curves of a path, one after the other; columns (n,)."""

    path: CurveSequence
    #: Index of the waypoint at the end of the path's first segment.
    first: int
    #: Number of each piece's curve, as in :class:`~.blended_path.CurveSequence`.
    number: Indices
    #: The parameter at which each piece begins: ``u`` of a segment's curve, ``s`` of a blend.
    begin: Floats
    #: The parameter at which each piece ends, likewise.
    end: Floats
    #: Number of samples on each piece.
    sample_count: Indices

    @classmethod
    def of(
        cls, path: BlendedPath, first: int, number: Indices, begin: Floats, end: Floats
    ) -> CurvePieces:
        """Return pieces of a path: parts of the segments' curves, and whole blends."""
        length, turn = path.extents(number)
        part, is_blend = end - begin, number % 2 == 1
        steps = np.maximum(length * part / STEP_LENGTH, turn * part / STEP_ANGLE)
        count = np.maximum(
            np.maximum(1.0 + is_blend, np.ceil(steps)),  # a blend has one on each half
            np.minimum(MIN_SAMPLES, np.ceil(_MIN_REFINEMENT * steps)),
        )
        return cls(
            path=path,
            first=first,
            number=number,
            begin=begin,
            end=end,
            sample_count=count.astype(np.intp),
        )

    def __len__(self) -> int:
        return len(self.number)

    @property
    def index(self) -> Int32s:
        """Index of the waypoint at the end of each curve; of a blend, the waypoint it rounds."""
        return (self.first + self.number // 2).astype(np.int32)

    @property
    def is_blend(self) -> Flags:
        """Whether each piece is a blend."""
        is_blend: Flags = self.number % 2 == 1
        return is_blend

    def extent(self, k: int) -> tuple[float, float]:
        """Return length [m] and turn [rad] of the whole curve of a piece."""
        return self.path.extent(int(self.number[k]))

    def pose(self, k: int, t: float) -> Pose:
        """Return the pose at the parameter ``t`` of a piece's curve."""
        return pose_from_row(self.rows(np.array([k]), np.array([t]))[0])

    def rows(self, piece: Indices, t: Floats) -> Floats:
        """Return poses (n, 7) at ``t`` (n,) on pieces, whose indices (n,) must not decrease."""
        return self.path.rows(self.number[piece], t)

    def locate(self, piece: Indices, t: Floats) -> tuple[Int32s, Floats]:
        """Return the segment (n,) of each place on pieces, and the fraction (n,) before it."""
        row, fraction = self.path.locate(self.number[piece], t)
        return (self.first + row).astype(np.int32), fraction

    def locate_one(self, k: int, t: float) -> tuple[int, float]:
        """Return the segment of a place on a piece, and the fraction of it before the place."""
        segment, fraction = self.locate(np.array([k]), np.array([t]))
        return int(segment[0]), float(fraction[0])


def sample_parameters(pieces: CurvePieces) -> tuple[Indices, Floats]:
    """
    Return the piece (n,) and the parameter (n,) of each sample.

    The start of a piece is no sample, because the piece before it ends with this sample.
    """
    n = pieces.sample_count
    piece, k = counted(n)
    part = k / n[piece]
    begin, end = pieces.begin[piece], pieces.end[piece]
    return piece, np.where(part == 1.0, end, begin + (end - begin) * part)
