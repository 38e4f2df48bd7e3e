# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The curves of the robot's motions: lines, arcs and joint lines.

A curve leads from waypoint to waypoint. It maps ``u`` in [0, 1] to poses of the tool in the *frame
of the path*, which is the robot's base or the frame of a held part. ``u`` is the fraction of the
way: by length on a line or an arc, by joint travel on a joint line. :mod:`~.blended_path` holds
the curves of a goal in columns, and adds the blends between them.

Positions are rounded to micrometres when they are sent to the robot; the comments below call this
*the rounding*.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, degrees, hypot, pi, sqrt
from typing import Any, NamedTuple

import numpy as np

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats, Indices
from ur_cartesian_driver.motion.geometry.pose import multiply, Pose
from ur_cartesian_driver.motion.geometry.pose_rows import (
    compose_rows,
    cross_rows,
    distance_rows,
    multiply_rows,
    normalized_rows,
    transform_rows,
)
from ur_cartesian_driver.motion.geometry.vectors import Joints, vector6
from ur_cartesian_driver.motion.goal.goal import ArcMode, SegmentType
from ur_cartesian_driver.motion.goal.goal_columns import rows_where, SegmentRows

#: If a line turns the tool by half a turn, give or take this angle [rad], the direction of the
#: turn depends on the rounding and on the arm's actual pose.
HALF_TURN = 1e-3

#: Poses that differ by no more than this [m], [rad] are the same, because of the rounding.
SAME_POSITION = 1e-6
SAME_ANGLE = 1e-6
#: Three points make a circle only if each distance between two of them, and the height of their
#: triangle above its longest side, is at least this [m].
MIN_ARC_HEIGHT = 1e-5
#: Displacement of three points relative to each other by the rounding [m].
_ROUNDING = 1.5e-6
#: A FIXED arc is refused if the rounding may turn the tool at its end by more than this [rad].
MAX_ARC_TURN_ERROR = 0.005
#: Arcs through points that are farther apart than this [m] are refused: no arm reaches that far.
MAX_ARC_SIZE = 1000.0
#: Largest distance between an arc and the chords that join its samples [m].
ARC_CHORD_ERROR = 5e-6
#: The same for joint lines and for blends that are no arcs [m].
CURVE_CHORD_ERROR = 20e-6
#: Largest turn between two samples [rad].
MAX_TURN_PER_SAMPLE = pi / 18.0
#: :meth:`JointLineCurve.trim` divides ever shorter intervals of the line into these numbers of
#: parts.
_TRIM_DIVISIONS = (32,) * 6


class ArcRows(NamedTuple):
    """
    Circular arcs, one per row.

    Positions turn about the axis through the center. Either the orientation changes from the start
    to the end by the shortest rotation (UNCONSTRAINED), or it turns along with the tangent
    (FIXED), as in the modes of URScript's ``movec``.
    """

    #: (n, 3) [m]
    center: Floats
    #: (n, 3) vectors from the center to the start, and to the position a quarter turn later [m]
    spoke: Floats
    across: Floats
    #: (n, 3) unit vectors
    axis: Floats
    #: (n,) [m]
    radius: Floats
    #: (n,) angles of the arcs, in (0, 2 pi)
    sweep: Floats
    #: (n,) the ``u`` of the vias, in (0, 1)
    u_via: Floats
    #: (n,) whether the tool turns along with the tangent
    is_fixed: Flags

    @classmethod
    def through(cls, start: Floats, via: Floats, end: Floats, is_fixed: Flags) -> ArcRows:
        """
        Return the arcs through three positions each [m], the first three columns of the arrays.

        Rows of positions that make no arc (:func:`arc_faults`) contain meaningless numbers.
        """
        ab, ac = via[:, :3] - start[:, :3], end[:, :3] - start[:, :3]
        normal = cross_rows(ab, ac)
        # Circumcenter seen from a: ((|ab|^2 ac - |ac|^2 ab) x (ab x ac)) / (2 |ab x ac|^2).
        with np.errstate(divide='ignore', invalid='ignore', over='ignore'):
            area, ab2, ac2 = (np.sum(each**2, axis=1)[:, None] for each in (normal, ab, ac))
            offset = cross_rows(ab2 * ac - ac2 * ab, normal) * 0.5 / area
            axis, spoke = normal / np.sqrt(area), -offset
            across = cross_rows(axis, spoke)
            to_via, sweep = (
                np.arctan2(np.sum(across * v, axis=1), np.sum(spoke * v, axis=1)) % (2.0 * pi)
                for v in (ab + spoke, ac + spoke)
            )
            radius, center = np.sqrt(np.sum(offset**2, axis=1)), start[:, :3] + offset
            return cls(center, spoke, across, axis, radius, sweep, to_via / sweep, is_fixed)

    def take(self, row: Any) -> ArcRows:
        """Return the arcs that ``row`` (a numpy index) selects."""
        return ArcRows(*[column[row] for column in self])

    def turn(self, u: Floats) -> Floats:
        """Return the quaternions (n, 4) of the turns from the arcs' starts to ``u`` (n,)."""
        half = (0.5 * u * self.sweep)[:, None]
        return np.concatenate([np.sin(half) * self.axis, np.cos(half)], axis=1)

    def turn_ends(self, row: Indices, start: Floats, end: Floats) -> None:
        """
        Set, in place, the orientations at the ends of FIXED arcs and at the next curves' starts.

        :param row: (n,) the rows of the arcs among the m curves of the goal.
        :param start: (m, 7) the poses at which the curves start; ``end``: at which they end.
        """
        turns = self.turn(np.ones(len(row)))
        for k in rows_where(self.is_fixed):  # in order, because each arc turns the next start
            i = int(row[k])
            end[i, 3:] = multiply(tuple(turns[k].tolist()), tuple(start[i, 3:].tolist()))
            start[i + 1 : i + 2] = end[i]

    def places(self, u: Floats) -> Floats:
        """Return the positions (..., 3) [m] at ``u``, which has the shape of ``sweep``."""
        angle = (u * self.sweep)[..., None]
        places: Floats = self.center + np.cos(angle) * self.spoke + np.sin(angle) * self.across
        return places

    def rows(self, start: Floats, rows: Floats, u: Floats) -> Floats:
        """
        Return the poses (n, 7) at ``u`` (n,) of arcs that begin at ``start`` (n, 7).

        :param rows: (n, 7) the poses at ``u`` on straight lines between the ends of the arcs, from
            which UNCONSTRAINED arcs take the orientations; changed in place and returned.
        """
        rows[:, :3] = self.places(u)
        fixed = np.flatnonzero(self.is_fixed)
        if len(fixed):
            turned = multiply_rows(self.take(fixed).turn(u[fixed]), start[fixed, 3:])
            rows[fixed, 3:] = normalized_rows(turned)
        return rows

    def trim(self, radius: Floats) -> Floats:
        """Return the ``u`` (n,) at which arcs are ``radius`` (n,) [m] away from their starts."""
        half = np.arcsin(np.minimum(1.0, 0.5 * radius / self.radius))
        return np.minimum(1.0, 2.0 * half / self.sweep)


def unset_arcs(n: int) -> ArcRows:
    """Return n rows that are still to be filled."""
    places = np.zeros((n, 3))
    return ArcRows.through(places, places, places, np.zeros(n, dtype=np.bool_))


NO_ARCS = unset_arcs(0)


@dataclass(frozen=True, slots=True)
class JointLineCurve:
    """A straight line in joint space; forward kinematics gives the poses of the tool."""

    arm: Arm
    T_flange_tcp: Pose
    q_start: Joints
    q_end: Joints
    start: Pose
    end: Pose
    length: float
    #: Number of chords that follow the path of the tool within CURVE_CHORD_ERROR.
    samples: int
    #: Ratio of the tool's peak speed to its mean speed.
    unevenness: float

    @classmethod
    def between(
        cls, arm: Arm, T_flange_tcp: Pose, q_start: Joints, q_end: Joints
    ) -> JointLineCurve:
        """Return the joint line from one configuration to another."""
        # If the turns of all joints add up to delta, a point within `max_reach` of all axes
        # deviates from its chord by at most max_reach delta^2 / 8.
        max_reach = arm.model.max_reach + hypot(*T_flange_tcp.position)
        step = sqrt(8.0 * CURVE_CHORD_ERROR / max_reach)
        samples = max(1, ceil(sum(abs(b - a) for a, b in zip(q_start, q_end, strict=True)) / step))
        q = np.linspace(q_start, q_end, samples + 1)
        chords = np.linalg.norm(np.diff(tcp_rows(arm, T_flange_tcp, q)[:, :3], axis=0), axis=1)
        length = float(chords.sum())
        unevenness = samples * float(chords.max()) / length if length > 0.0 else 1.0
        start, end = (arm.forward(q) @ T_flange_tcp for q in (q_start, q_end))
        return cls(arm, T_flange_tcp, q_start, q_end, start, end, length, samples, unevenness)

    @property
    def travel(self) -> Joints:
        """The turn of each joint [rad], all >= 0."""
        return vector6(abs(y - x) for x, y in zip(self.q_start, self.q_end, strict=True))

    @property
    def joint_travel(self) -> float:
        """Largest turn of a joint [rad]."""
        return max(self.travel)

    def joints(self, u: float) -> Joints:
        """Return the joint positions at ``u``."""
        return vector6(x + u * (y - x) for x, y in zip(self.q_start, self.q_end, strict=True))

    def pose(self, u: float) -> Pose:
        """Return the pose at ``u``."""
        return self.arm.forward(self.joints(u)) @ self.T_flange_tcp

    def joint_rows(self, u: Floats) -> Floats:
        """Return the joint positions (n, 6) [rad] at many ``u`` (n,)."""
        q_start, q_end = np.array(self.q_start), np.array(self.q_end)
        rows: Floats = q_start + np.outer(u, q_end - q_start)
        return rows

    def rows(self, u: Floats) -> Floats:
        """Return the poses (n, 7) at many ``u`` (n,)."""
        return tcp_rows(self.arm, self.T_flange_tcp, self.joint_rows(u))

    def trim(self, radius: float, *, at_end: bool) -> float:
        """Return the ``u`` nearest to the start (or end) with the tool ``radius`` [m] from it."""
        center = np.array([(self.end if at_end else self.start).row()])
        low, high = 0.0, 1.0
        for n in (max(16, self.samples), *_TRIM_DIVISIONS):
            v = np.linspace(low, high, n + 1)
            between = self.rows(1.0 - v[1:-1] if at_end else v[1:-1])
            k = int(np.argmin(np.append(distance_rows(center, between) < radius, False)))
            low, high = v[k : k + 2].tolist()
        return 1.0 - high if at_end else high


def tcp_rows(arm: Arm, T_flange_tcp: Pose, q: Floats) -> Floats:
    """Return ``T_base_tcp`` (n, 7) of joint positions (n, 6) [rad]."""
    return compose_rows(arm.forward_rows(q), T_flange_tcp)


def is_same_pose(a: Pose, b: Pose) -> bool:
    """Return whether two poses differ by no more than SAME_POSITION and SAME_ANGLE."""
    return a.distance_to(b) <= SAME_POSITION and a.angle_to(b) <= SAME_ANGLE


def goal_arcs(
    segments: SegmentRows, T_base_frame: Pose, start: Floats, end: Floats
) -> tuple[Indices, ArcRows, dict[int, str]]:
    """
    Return the rows of CIRCULAR segments that make arcs, their arcs, and the faults of the others.

    :param T_base_frame: the pose, in the frame of the path, of the frame in which the vias are
        given.
    :param start: (n, 7) the pose in the frame of the path at which each segment begins; ``end``:
        at which it ends. Both are changed in place: ends of FIXED arcs, and starts after them, get
        the orientations in which the arcs arrive.
    """
    rows = np.flatnonzero(segments.types == int(SegmentType.CIRCULAR))
    if not len(rows):
        return rows, NO_ARCS, {}
    vias = transform_rows(T_base_frame, segments.vias[rows])
    is_fixed = segments.arc_modes[rows] == ArcMode.FIXED
    found = arc_faults(start[rows], vias, end[rows], is_fixed)
    faults = {int(rows[k]): fault for k, fault in found.items()}
    fine = ~np.isin(rows, [*faults])
    rows = rows[fine]
    arcs = ArcRows.through(start[rows], vias[fine], end[rows], is_fixed[fine])
    arcs.turn_ends(rows, start, end)
    return rows, arcs, faults


def arc_faults(start: Floats, via: Floats, end: Floats, is_fixed: Flags) -> dict[int, str]:
    """
    Return, by row, a clause for each start, via and end (n, 3 or more) [m] that make no arc.

    The rounding of the three points tilts their circle by the angle rounding / height of the
    triangle. This turns the tool at the end of a FIXED arc by 2 sin(sweep / 2) times that angle,
    which follows from the distances between start, via and end by the law of sines.
    """
    pairs = (('start', 'end'), ('start', 'via'), ('via', 'end'))
    with np.errstate(over='ignore', divide='ignore', invalid='ignore'):
        places = {'start': start, 'via': via, 'end': end}
        chord, from_start, to_end = sides = [distance_rows(places[a], places[b]) for a, b in pairs]
        longest, size = np.maximum.reduce(sides), np.maximum(chord, from_start)
        normal = cross_rows(via[:, :3] - start[:, :3], end[:, :3] - start[:, :3])
        height = np.linalg.norm(normal, axis=1) / longest
        error = np.where(is_fixed, 2.0 * _ROUNDING * longest / (from_start * to_end), 0.0)
    is_flat = np.minimum.reduce([*sides, height]) < MIN_ARC_HEIGHT
    faults: dict[int, str] = {}
    for row in rows_where(is_flat | (size > MAX_ARC_SIZE) | (error > MAX_ARC_TURN_ERROR)):
        near = [k for k in range(3) if sides[k][row] < MIN_ARC_HEIGHT]
        if near:
            (a, b), apart = pairs[near[0]], 1e3 * sides[near[0]][row]
            faults[row] = f'the {a} and the {b} of the arc coincide ({apart:.3f} mm apart)'
        elif size[row] > MAX_ARC_SIZE:
            faults[row] = f'the points of the arc are more than {MAX_ARC_SIZE:g} m apart'
        elif is_flat[row]:
            faults[row] = 'the start, the via and the end of the arc lie on one straight line'
        else:
            faults[row] = (
                f'its via is {1e3 * from_start[row]:.3f} mm and {1e3 * to_end[row]:.3f} mm from '
                f'its ends, so that micrometres on the wire may turn the tool by '
                f'{degrees(error[row]):.1f} degrees at its end, more than '
                f'{degrees(MAX_ARC_TURN_ERROR):.1f}'
            )
    return faults
