# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The path of a goal in columns: the curve of each segment, and the blends between them.

Goals have up to 100,000 segments, and nearly all of them are lines and arcs. So lines, arcs and
blends are stored as rows of arrays; joint lines are objects.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar, Protocol

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats, Indices
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.pose_rows import (
    angle_rows,
    distance_rows,
    interpolate_rows,
)
from ur_cartesian_driver.motion.goal.goal_columns import rows_where, SegmentRows
from ur_cartesian_driver.planning.geometry.blend_shapes import (
    BlendShapes,
    crossfade,
    crossfade_rows,
    fillet_rows,
)
from ur_cartesian_driver.planning.geometry.curves import (
    ARC_CHORD_ERROR,
    ArcRows,
    goal_arcs,
    JointLineCurve,
    MAX_TURN_PER_SAMPLE,
    NO_ARCS,
    tcp_rows,
    unset_arcs,
)

# Rows per block, so that the intermediate arrays stay in the CPU cache.
_BLOCK = 8192
# Number of chords that measure the length of a blend for which there is no formula.
_CHORDS = 16


class CurveSequence(Protocol):
    """
    Consecutive curves, for the checks along a path.

    The curve of segment k has the number 2k, and the blend after it has the number 2k + 1.
    """

    #: Whether the arm stops at points without a blend.
    rests_at_points: ClassVar[bool]

    def rows(self, number: Indices, t: Floats) -> Floats:
        """
        Return poses (n, 7) on many curves.

        :param number: (n,) the number of the curve of each row, not decreasing.
        :param t: (n,) the parameter on the curve, in [0, 1].
        """

    def extent(self, number: int) -> tuple[float, float]:
        """Return the length [m] of a curve, and the turn [rad] of tool or leading joint."""

    def locate(self, number: Indices, t: Floats) -> tuple[Indices, Floats]:
        """
        Return the segment (n,) of each place, and the fraction (n,) of the segment before it.

        For the parameters see :meth:`rows`.
        """


class CurveRows:
    """
    The curves of consecutive segments, a row for each.

    :param start: (n, 7) the pose where each curve begins; ``end``: (n, 7) where it ends.
    """

    def __init__(self, start: Floats, end: Floats) -> None:
        """Create lines; they can be replaced by other curves."""
        self.start, self.end = start, end
        #: (n,) lengths [m].
        self.length = distance_rows(start, end)
        #: (n,) turns of the tool [rad].
        self.angle = angle_rows(start[:, 3:], end[:, 3:])
        #: (n,) travels of the leading joint on joint lines [rad], 0 on other curves.
        self.joint_travel = np.zeros(len(start))
        self.is_line = np.ones(len(start), dtype=np.bool_)
        self.is_joint_line = ~self.is_line
        #: The arcs, in the rows in which ``is_arc`` is true; empty if there are no arcs.
        self.arcs = NO_ARCS
        #: The joint lines, by row.
        self.joint_lines: dict[int, JointLineCurve] = {}

    def __len__(self) -> int:
        return len(self.length)

    @property
    def is_arc(self) -> Flags:
        """(n,) whether each curve is an arc."""
        return ~(self.is_line | self.is_joint_line)

    def put_joint_line(self, row: int, curve: JointLineCurve) -> None:
        """Replace the curve of a row by a joint line."""
        self.put_line(row, curve.start.row(), curve.end.row())
        self.joint_lines[row] = curve
        self.length[row], self.joint_travel[row] = curve.length, curve.joint_travel
        self.is_line[row], self.is_joint_line[row] = False, True

    def put_arcs(self, row: Indices, arcs: ArcRows) -> None:
        """Replace lines of some rows by arcs between the same poses."""
        if not len(row):
            return
        if not len(self.arcs.sweep):
            self.arcs = unset_arcs(len(self))
        for column, values in zip(self.arcs, arcs, strict=True):
            column[row] = values
        self.length[row], self.is_line[row] = arcs.radius * arcs.sweep, False
        self.angle[row] = np.where(arcs.is_fixed, arcs.sweep, self.angle[row])

    def put_line(
        self, row: int, start: Floats | Sequence[float], end: Floats | Sequence[float]
    ) -> None:
        """Replace the curve of a row by the line between two poses (7,)."""
        self.start[row], self.end[row] = start, end
        one = slice(row, row + 1)
        self.length[one] = distance_rows(self.start[one], self.end[one])
        self.angle[one] = angle_rows(self.start[one, 3:], self.end[one, 3:])
        self.joint_travel[row] = 0.0
        self.is_line[row], self.is_joint_line[row] = True, False
        self.joint_lines.pop(row, None)

    def chord_counts(
        self, error: float = ARC_CHORD_ERROR, turn: float = MAX_TURN_PER_SAMPLE
    ) -> Indices:
        """
        Return the number of chords (n,) that follow each curve closely enough.

        :param error: greatest distance of a chord from its arc [m]; ``turn``: greatest turn of the
            tool along a chord [rad]. The number for a joint line does not depend on them.
        """
        counts = np.maximum(1, np.ceil(self.angle / turn)).astype(np.intp)
        at = np.flatnonzero(self.is_arc)
        arcs = self.arcs.take(at)
        chords = np.ceil(arcs.sweep / np.sqrt(8.0 * error / arcs.radius))
        counts[at] = np.maximum(counts[at], chords)
        for row, line in self.joint_lines.items():
            counts[row] = line.samples
        return counts

    def rows(self, row: Indices, u: Floats) -> Floats:
        """Return poses (n, 7) at ``u`` (n,) on curves; ``row`` (n,) must not decrease."""
        rows = interpolate_rows(self.start[row], self.end[row], u)
        if self.is_line[row].all():
            return rows
        at = np.flatnonzero(self.is_arc[row])
        rows[at] = self.arcs.take(row[at]).rows(self.start[row[at]], rows[at], u[at])
        for k in np.unique(row[self.is_joint_line[row]]).tolist():
            first, last = np.searchsorted(row, (k, k + 1))
            rows[first:last] = self.joint_lines[k].rows(u[first:last])
        return rows

    def trim(self, row: Indices, radius: Floats, *, at_end: bool = False) -> Floats:
        """Return the ``u`` (n,) at distances (n,) [m] from the starts, or the ends, of curves."""
        length = self.length[row]
        u: Floats = np.minimum(1.0, radius / np.maximum(length, 1e-300)) * (length > 0.0)
        on_arc = np.flatnonzero(self.is_arc[row])
        u[on_arc] = self.arcs.take(row[on_arc]).trim(radius[on_arc])
        if at_end:
            u = 1.0 - u
        for k in rows_where(self.is_joint_line[row]):
            u[k] = self.joint_lines[int(row[k])].trim(float(radius[k]), at_end=at_end)
        return u


def curves_of(
    segments: SegmentRows, T_base_frame: Pose, start: Floats, end: Floats
) -> tuple[CurveRows, dict[int, str]]:
    """
    Return the lines and arcs of segments, and the faults of arcs by row.

    Rows with faults, and joint moves, remain lines. For the parameters see
    :func:`~.curves.goal_arcs`.
    """
    rows, arcs, faults = goal_arcs(segments, T_base_frame, start, end)
    curves = CurveRows(start, end)
    curves.put_arcs(rows, arcs)
    return curves, faults


class BlendedPath:
    """
    The curves of consecutive segments with the blends between them; columns (n,).

    It is a :class:`CurveSequence`.
    """

    rests_at_points: ClassVar[bool] = True

    def __init__(self, curves: CurveRows) -> None:
        """Create a path without blends."""
        n = len(curves)
        self.curves = curves
        #: The ``u`` at which the blend before each curve joins it, and the ``u`` at which the
        #: blend after it leaves it.
        self.u_join, self.u_leave = np.zeros(n), np.ones(n)
        #: The blend radius after each curve [m], 0 = no blend; and whether this blend is a fillet,
        #: a circular arc between lines (``movep``).
        self.radius, self.fillet = np.zeros(n), np.zeros(n, dtype=np.bool_)
        #: The distance from the waypoint at which the blend begins and ends [m]: the blend radius,
        #: or less, if the blends of the robot were measured.
        self.reach = np.zeros(n)
        #: Radius of the circle of the fillet after each curve [m]; inf for other blends.
        self.arc_radius = np.full(n, np.inf)
        #: Length of the blend after each curve [m]; turn of the tool in the blend [rad].
        self.blend_length, self.blend_angle = np.zeros((2, n))
        #: Number of chords that follow the blend after each curve closely enough.
        self.blend_samples = np.zeros(n, dtype=np.intp)
        #: Largest distance of the robot's own blend from the modelled one (n, 2) [m], [rad]. The
        #: robot's blend may come arbitrarily close to the waypoint, or cut the corner on a
        #: straight line; the modelled blend is half-way between. The robot may also turn the tool
        #: earlier or later.
        self.blend_tolerance = np.zeros((n, 2))

    @property
    def has_blend_after(self) -> Flags:
        """Whether there is a blend after each curve."""
        return self.radius > 0.0

    @property
    def has_blend_before(self) -> Flags:
        """Whether there is a blend before each curve."""
        return np.append(False, self.has_blend_after[:-1])

    def remove_blends(self, first: int, stop: int) -> None:
        """Remove the blends after the curves of rows ``first`` to ``stop`` (excluded)."""
        self.radius[first:stop], self.u_leave[first:stop] = 0.0, 1.0
        self.u_join[first + 1 : stop + 1] = 0.0

    def leave(self, row: Indices, radius: Floats) -> None:
        """
        End curves where the blends after them will begin; the next curves need not be known.

        :param radius: (n,) the distances from the waypoints [m].
        """
        self.u_leave[row] = self.curves.trim(row, radius, at_end=True)

    def make_blends(self, row: Indices, radius: Floats, reach: Floats, fillet: Flags) -> None:
        """
        Make the blends after the curves of some rows (n,).

        :param radius: (n,) blend radii [m].
        :param reach: (n,) distances from the waypoints at which the blends begin and end [m].
        :param fillet: (n,) whether each blend is a fillet.
        """
        if not len(row):
            return
        curves, after = self.curves, row + 1
        self.leave(row, reach)
        self.u_join[after] = curves.trim(after, reach)
        self.radius[row], self.reach[row], self.fillet[row] = radius, reach, fillet
        shapes = BlendShapes(
            curves.rows(row, self.u_leave[row]),
            curves.start[after],
            curves.rows(after, self.u_join[after]),
            radius,
            fillet,
        )
        self.blend_length[row], self.blend_angle[row] = shapes.lengths(), shapes.turns
        self.blend_samples[row] = shapes.samples()
        self.arc_radius[row] = shapes.arc_radii()
        self.blend_tolerance[row] = shapes.tolerances()
        curved = row[~(curves.is_line[row] & curves.is_line[after])]
        s = np.linspace(0.0, 1.0, _CHORDS + 1)
        for k in range(0, len(curved), _BLOCK // _CHORDS):
            row = curved[k : k + _BLOCK // _CHORDS]
            rows = self.blend_rows(np.repeat(row, len(s)), np.tile(s, len(row)))
            places = rows[:, :3].reshape(len(row), len(s), 3)
            chords = np.linalg.norm(np.diff(places, axis=1), axis=2)
            self.blend_length[row] = chords.sum(axis=1)

    def extents(self, number: Indices) -> tuple[Floats, Floats]:
        """Return lengths (n,) [m] and turns (n,) [rad] of curves, as :meth:`extent` does."""
        row, is_blend = number // 2, number % 2 == 1
        travel, own = self.curves.joint_travel, self.curves.joint_travel[row]
        length, turn = self.curves.length[row], np.where(own > 0.0, own, self.curves.angle[row])
        blends, after = row[is_blend], row[is_blend] + 1
        length[is_blend] = self.blend_length[blends]
        turn[is_blend] = np.maximum(
            self.blend_angle[blends],
            np.maximum(
                (1.0 - self.u_leave[blends]) * travel[blends], self.u_join[after] * travel[after]
            ),
        )
        return length, turn

    def extent(self, number: int) -> tuple[float, float]:
        """See :class:`CurveSequence`."""
        length, turn = self.extents(np.array([number]))
        return float(length[0]), float(turn[0])

    def rows(self, number: Indices, t: Floats) -> Floats:
        """See :class:`CurveSequence`."""
        rows = np.empty((len(t), 7))
        for begin in range(0, len(t), _BLOCK):
            block = slice(begin, begin + _BLOCK)
            rows[block] = self._rows(number[block], t[block])
        return rows

    def _rows(self, number: Indices, t: Floats) -> Floats:
        row, on_blend = number // 2, number % 2 == 1
        if not on_blend.any():
            return self.curves.rows(row, t)
        rows = np.empty((len(t), 7))
        rows[~on_blend] = self.curves.rows(row[~on_blend], t[~on_blend])
        rows[on_blend] = self.blend_rows(row[on_blend], t[on_blend])
        return rows

    def blend_rows(self, row: Indices, s: Floats) -> Floats:
        """Return poses (n, 7) at ``s`` (n,) in blends after curves; ``row`` must not decrease."""
        curves = self.curves
        in_joint_space = curves.is_joint_line[row] & curves.is_joint_line[row + 1]
        if not in_joint_space.any():
            return self._crossfaded(row, s)
        rows = np.empty((len(s), 7))
        rows[~in_joint_space] = self._crossfaded(row[~in_joint_space], s[~in_joint_space])
        for k in np.unique(row[in_joint_space]).tolist():
            first, last = np.searchsorted(row, (k, k + 1))
            line, q = curves.joint_lines[k], self.joint_rows(2 * k + 1, s[first:last])
            rows[first:last] = tcp_rows(line.arm, line.T_flange_tcp, q)
        return rows

    def is_in_joint_space(self, number: int) -> bool:
        """Return whether a curve is a joint line, or a blend between two joint lines."""
        row, is_blend = divmod(number, 2)
        return bool(self.curves.is_joint_line[row : row + is_blend + 1].all())

    def joint_rows(self, number: int, t: Floats) -> Floats:
        """Return the joint positions (n, 6) [rad] on a curve in joint space."""
        row, is_blend = divmod(number, 2)
        first = self.curves.joint_lines[row]
        if not is_blend:
            return first.joint_rows(t)
        second = self.curves.joint_lines[row + 1]
        a, b = crossfade(self.u_leave[row : row + 1], self.u_join[row + 1 : row + 2], t)
        rows: Floats = first.joint_rows(a) + second.joint_rows(b) - np.array(second.q_start)
        return rows

    def _crossfaded(self, row: Indices, s: Floats) -> Floats:
        """Return poses (n, 7) in blends in Cartesian space."""
        curves, after = self.curves, row + 1
        a, b = crossfade(self.u_leave[row], self.u_join[after], s)
        waypoint = curves.start[after]
        rows = crossfade_rows(curves.rows(row, a), waypoint, curves.rows(after, b))
        filleted = np.flatnonzero(self.fillet[row])
        if len(filleted):
            of = row[filleted]
            rows[filleted, :3] = fillet_rows(
                curves.rows(of, self.u_leave[of])[:, :3],
                waypoint[filleted, :3],
                curves.rows(of + 1, self.u_join[of + 1])[:, :3],
                self.radius[of],
                s[filleted],
            )
        return rows

    def locate(self, number: Indices, t: Floats) -> tuple[Indices, Floats]:
        """See :class:`CurveSequence`; the second half of a blend belongs to the next segment."""
        row, on_blend = number // 2, number % 2 == 1
        after = on_blend & (t > 0.5)
        first, second = crossfade(self.u_leave[row], self.u_join[row + on_blend], t)
        return row + after, np.where(on_blend, np.where(after, second, first), t)
