# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The lines and arcs of a goal as polylines, from stop to stop.

Arcs and turns become chains of chords, which rounding makes smooth again: at the places between
the programmed points within a hundredth of a millimetre, at the points within the bounds that the
goal gives its corners.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from math import ceil, radians, sqrt

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats, Indices
from ur_cartesian_driver.motion.geometry.pose import Pose, pose_from_row
from ur_cartesian_driver.motion.geometry.pose_rows import (
    angle_rows,
    distance_rows,
    keep_hemisphere,
)
from ur_cartesian_driver.motion.goal.goal import ArcMode, SegmentType
from ur_cartesian_driver.motion.goal.goal_table import GoalTable, rows_where
from ur_cartesian_driver.planning.geometry.blended_path import CurveRows
from ur_cartesian_driver.planning.geometry.curves import ArcCurve
from ur_cartesian_driver.planning.request.validate import arc_through_via
from ur_cartesian_driver.planning.rounded.rounded_path import Polyline

#: A turn of the tool [rad] counts as its arc at this distance [m] in the length along the path.
TURN_RADIUS = 0.05
#: How far the set-points may be beside lines, arcs and turns between corners [m], [rad].
CURVE_BOUNDS = 1e-5, 2e-4
#: Chords of arcs: their error [m], and the turn of one [rad].
_CHORD_ERROR = 2e-6
_CHORD_TURN = radians(2.0)
#: Shorter steps carry the tool nowhere [m].
_NO_STEP = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ProgrammedSection:
    """The programmed path from rest to rest."""

    polyline: Polyline
    #: The segments of the goal (k,) in order, and where each of them ends.
    segments: Indices
    ends: Floats

    def locate(self, s: Floats) -> tuple[Indices, Floats]:
        """Return the segments (m,) in which places are, and the fractions of them."""
        row = np.minimum(np.searchsorted(self.ends, s, side='left'), len(self.ends) - 1)
        begin = np.where(row > 0, self.ends[row - 1], self.polyline.s[0])
        length = np.maximum(self.ends[row] - begin, _NO_STEP)
        return self.segments[row], np.clip((s - begin) / length, 0.0, 1.0)


def programmed_sections(
    goal: GoalTable,
    targets: Floats,
    start: Pose,
    corners: Floats,
    stops: Collection[int],
) -> list[ProgrammedSection]:
    """
    Return the path of a goal from stop to stop.

    :param targets: (n, 7) its points in base.
    :param start: the tool at the beginning in base.
    :param corners: (n, 2) how far the path may be beside each point [m], [rad]; 0 = a stop.
    :param stops: other points at which it stops.
    """
    curves = _curves(goal, targets, start)
    n = len(targets)
    count = np.maximum(1, np.ceil(curves.angle / _CHORD_TURN)).astype(np.intp)
    for row, arc in curves.others.items():
        assert isinstance(arc, ArcCurve)
        chords = ceil(arc.sweep / sqrt(8.0 * _CHORD_ERROR / arc.radius))
        count[row] = max(int(count[row]), chords)
    last = np.cumsum(count)
    segment = np.repeat(np.arange(n), count)
    number = np.arange(1, last[-1] + 1) - (last - count)[segment]
    rows = np.concatenate([curves.start[:1], curves.rows(segment, number / count[segment])])
    keep_hemisphere(rows)
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
        sections.append(
            ProgrammedSection(
                polyline=Polyline(s=s[kept], rows=rows[own][kept], bounds=bounds[own][kept]),
                segments=np.arange(first, end + 1),
                ends=s[last[first : end + 1] - begin],
            )
        )
        first = end + 1
    return sections


def _curves(goal: GoalTable, targets: Floats, start: Pose) -> CurveRows:
    segments = goal.motions
    curves = CurveRows(np.concatenate([[start.row()], targets[:-1]]), targets.copy(), {})
    for row in rows_where(segments.types == SegmentType.CIRCULAR):
        via, mode = segments.via(row), ArcMode(segments.arc_modes[row])
        assert via is not None
        begin = pose_from_row(curves.start[row].tolist())
        end = pose_from_row(curves.end[row].tolist())
        arc = arc_through_via(row, begin, goal.T_base_frame @ via, end, mode)
        curves.put(row, arc)
        if mode is ArcMode.FIXED and row + 1 < len(targets):
            curves.put_line(row + 1, arc.end)
    return curves
