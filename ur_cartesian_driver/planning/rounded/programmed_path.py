# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The lines and arcs of a goal as polylines, from stop to stop.

Arcs and turns become chains of chords, which rounding (:mod:`~.rounded_path`) makes smooth again.
The result deviates from the programmed path by at most a hundredth of a millimetre between the
points, and at the points by at most the bounds that the goal sets for its corners.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from math import radians

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats, Indices
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.pose_rows import (
    angle_rows,
    distance_rows,
    keep_hemisphere,
)
from ur_cartesian_driver.motion.goal.goal_columns import GoalTable
from ur_cartesian_driver.planning.geometry.blended_path import curves_of
from ur_cartesian_driver.planning.geometry.samples import (
    check_sample_count,
    STEP_ANGLE,
    STEP_LENGTH,
)
from ur_cartesian_driver.planning.request.validate import arc_error
from ur_cartesian_driver.planning.rounded.rounded_path import Polyline

#: The place ``s`` on a path grows by the hypotenuse of the tool's travel and of its turn times
#: this radius [m].
TURN_RADIUS = 0.05
#: Allowed deviations of the set-points from lines, arcs and turns between corners [m], [rad].
CURVE_BOUNDS = 1e-5, 2e-4
#: Greatest distance of a chord from its arc [m].
_CHORD_ERROR = 2e-6
#: Greatest turn of the tool along a chord [rad].
_CHORD_TURN = radians(2.0)
#: The remedy for a path that needs too many samples.
CHECK_SPEEDS = 'check speeds and positions'
#: Steps shorter than this [m] count as no motion.
_NO_STEP = 1e-9
#: Quaternions that differ by less than this are the same.
_NO_TURN = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SegmentEnds:
    """The ends of the segments of a section."""

    #: (k,) the segments of the goal that the section contains, in order.
    segments: Indices
    #: (k,) the place s at which each of these segments ends.
    ends: Floats

    def locate(self, s: Floats) -> tuple[Indices, Floats]:
        """Return the segment of each place s (m,), and the fraction (m,) of it that is passed."""
        row = np.minimum(np.searchsorted(self.ends, s, side='left'), len(self.ends) - 1)
        begin = np.where(row > 0, self.ends[row - 1], 0.0)
        length = np.maximum(self.ends[row] - begin, _NO_STEP)
        return self.segments[row], np.clip((s - begin) / length, 0.0, 1.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ProgrammedSection(SegmentEnds):
    """A section of the programmed path, from rest to rest; it begins at s = 0."""

    polyline: Polyline


def programmed_sections(
    goal: GoalTable,
    targets: Floats,
    start: Pose,
    corners: Floats,
    stops: Collection[int],
) -> list[ProgrammedSection]:
    """
    Return the sections of a goal's path, one from each stop to the next.

    :param targets: (n, 7) the poses of the goal's points in the frame of the path.
    :param start: pose of the tool in this frame at the beginning.
    :param corners: (n, 2) allowed deviations of the path at each point [m], [rad]; 0 = a stop.
    :param stops: further points at which the arm stops.
    :raises InvalidGoal: a segment defines no arc.
    """
    starts, n = np.concatenate([[start.row()], targets[:-1]]), len(targets)
    curves, faults = curves_of(goal.motions, goal.T_base_frame, starts, targets.copy())
    for row, fault in faults.items():
        raise arc_error(row, fault)
    # A path that needs too many samples even at the largest spacing is refused before any are
    # made.
    fewest = np.maximum(curves.length / STEP_LENGTH, curves.angle / STEP_ANGLE)
    check_sample_count(fewest, np.arange(n), CHECK_SPEEDS)
    count = curves.chord_counts(_CHORD_ERROR, _CHORD_TURN)
    last = np.cumsum(count)
    segment = np.repeat(np.arange(n), count)
    number = np.arange(1, last[-1] + 1) - (last - count)[segment]
    rows = np.concatenate([curves.start[:1], curves.rows(segment, number / count[segment])])
    keep_hemisphere(rows)
    if np.abs(rows[:, 3:] - rows[0, 3:]).max() < _NO_TURN:
        rows[:, 3:] = rows[0, 3:]  # otherwise rounding errors would count as turns
    bounds = np.empty((len(rows), 2))
    bounds[:] = CURVE_BOUNDS
    bounds[last] = corners
    steps = np.hypot(
        distance_rows(rows[:-1], rows[1:]), TURN_RADIUS * angle_rows(rows[:-1, 3:], rows[1:, 3:])
    )
    steps[steps < _NO_STEP] = 0.0
    is_stop: Flags = np.any(corners <= 0.0, axis=1)
    is_stop[list(stops)] = True
    is_stop[-1] = True
    sections = []
    first = 0
    for end in np.flatnonzero(is_stop).tolist():
        begin = int(last[first - 1]) if first else 0
        own = slice(begin, int(last[end]) + 1)
        s = np.concatenate([[0.0], np.cumsum(steps[begin : own.stop - 1])])
        kept = np.append(True, steps[begin : own.stop - 1] > 0.0)
        # Of vertices at the same place, one is kept, with the tightest of their bounds.
        kept_bounds = np.minimum.reduceat(bounds[own], np.flatnonzero(kept))
        sections.append(
            ProgrammedSection(
                polyline=Polyline(s=s[kept], rows=rows[own][kept], bounds=kept_bounds),
                segments=np.arange(first, end + 1),
                ends=s[last[first : end + 1] - begin],
            )
        )
        first = end + 1
    return sections
