# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Fit joint polynomials that keep the tool on a tool spline.

At both ends of a piece, the joints have the positions and velocities (in quintics, also the
accelerations) that follow from the tool spline. Between the ends, the tool deviates from the
spline. Forward kinematics gives the deviation, and pieces are halved until none deviates more than
allowed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import inf

import numpy as np

from ur_cartesian_driver.kinematics.inverse_rows import nearest_rows
from ur_cartesian_driver.motion.errors import TooFast
from ur_cartesian_driver.motion.geometry.arrays import Floats, Indices
from ur_cartesian_driver.motion.geometry.polynomials import (
    cubic_rows,
    MotionRows,
    quintic_rows,
    values,
)
from ur_cartesian_driver.motion.geometry.pose_rows import angle_rows, distance_rows, length_rows
from ur_cartesian_driver.motion.plan.joint_spline import JointSpline
from ur_cartesian_driver.motion.plan.move_rows import SplineRows
from ur_cartesian_driver.motion.plan.plan import LateLines, PlannedRows, ReferencePath
from ur_cartesian_driver.planning.preflight.tcp_kinematics import TcpKinematics
from ur_cartesian_driver.planning.request.goal_fields import point_field
from ur_cartesian_driver.planning.spline.spline_path import SplinePath

#: Unit of the times of pieces [s]: a microsecond, as on the wire, so that their sums do not drift.
TICK = 1e-6
#: The angular tolerance of a tool spline is the linear one divided by this radius [m].
ANGLE_TOLERANCE_RADIUS = 0.1
#: Pieces are not halved to less than this time [s]: one cycle of the fastest controllers.
_MIN_PIECE_TIME = 0.002
# Decimal places of joint rates; further digits are rounding errors.
_DIGITS = 12
#: Minimum and maximum number of samples inside a piece at which the deviation is computed.
COMPARED_SAMPLES = 7, 23
# Number of pieces that are compared at a time, so that the arrays stay in the CPU cache.
_BLOCK = 256


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JointKnots:
    """The joints at the ends of n pieces."""

    #: (n + 1,) times of the ends [s], in whole ticks.
    times: Floats
    #: Joint positions, velocities and accelerations at the ends, each (n + 1, 6).
    joints: MotionRows
    quintic: bool

    @property
    def spline(self) -> JointSpline:
        """The joints over time."""
        return JointSpline.through(self.times, self.joints, quintic=self.quintic)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JointPolynomials(JointKnots):
    """Pieces that keep the tool on a tool spline."""

    #: (n,) the piece of the tool spline on which each joint piece lies.
    piece: Indices
    #: (n, 2) maximum deviation of the tool from the tool spline [m], [rad].
    deviations: Floats

    @property
    def distance(self) -> float:
        """Maximum deviation of the tool from the tool spline [m]."""
        return float(self.deviations[:, 0].max())

    @property
    def angle(self) -> float:
        """Maximum turn of the tool away from the tool spline [rad]."""
        return float(self.deviations[:, 1].max())


def piece_rows(
    reference: ReferencePath,
    knots: JointKnots,
    waypoints: Indices,
    lines: Callable[[Floats], Sequence[str]],
) -> PlannedRows:
    """
    Return joint pieces as the segments of a plan.

    :param reference: the path of the tool.
    :param waypoints: (n,) the point of the goal to which each piece leads.
    :param lines: returns the line of the report for each piece, from lengths [m], turns [rad] and
        times [s] of the pieces (n, 3).
    """
    durations = np.round(np.diff(knots.times), 6)
    a, b = reference.poses[:-1], reference.poses[1:]
    lengths, angles = (
        np.diff(np.interp(knots.times, reference.time, np.append(0.0, np.cumsum(steps))))
        for steps in (distance_rows(a, b), angle_rows(a[:, 3:], b[:, 3:]))
    )
    n = len(durations)
    q, qd, qdd = (rows[1:] for rows in knots.joints)
    return PlannedRows.of_pieces(
        SplineRows(
            targets=q,
            velocities=qd,
            accelerations=qdd,
            durations=durations,
            quintic=np.full(n, knots.quintic),
        ),
        waypoints.astype(np.int32),
        lengths,
        angles,
        LateLines.at_once(n, lambda: lines(np.stack([lengths, angles, durations], axis=1))),
    )


def fit_joint_polynomials(
    kinematics: TcpKinematics,
    path: SplinePath,
    start: MotionRows,
    quintic: bool,
    tolerance: float,
    max_time: float = inf,
    min_time: float = 0.0,
    compared: tuple[int, int] = COMPARED_SAMPLES,
) -> JointPolynomials:
    """
    Return the joint pieces for a spline path.

    :param start: the joints at the start of the path, in rows (1, 6).
    :param tolerance: maximum deviation of the tool [m]; the maximum angle [rad] is this length
        divided by ANGLE_TOLERANCE_RADIUS.
    :param max_time: longest time of a piece [s].
    :param min_time: shortest time of a piece [s]; a piece that is not twice as long is kept, even
        if it deviates more.
    :param compared: minimum and maximum number of samples inside a piece at which the deviation is
        computed.
    :raises TooFast: even pieces of one controller cycle deviate too much.
    """
    bounds = np.array([tolerance, tolerance / ANGLE_TOLERANCE_RADIUS])
    refinement = _PieceRefinement(kinematics, path, start, quintic, min_time, compared)
    refinement.halve_longer_than(max_time)
    return refinement.refine_within(bounds)


class _PieceRefinement:
    """The joint pieces so far, in order of time; ``pending`` flags pieces of unknown deviation."""

    def __init__(
        self,
        kinematics: TcpKinematics,
        path: SplinePath,
        start: MotionRows,
        quintic: bool,
        min_time: float,
        compared: tuple[int, int],
    ) -> None:
        self.kinematics, self.path, self.quintic = kinematics, path, quintic
        self._min_time, self._compared = min_time, compared
        self._sample_times = path.times
        spline = path.spline
        n = len(spline.positions)
        #: The piece of the tool spline on which each joint piece lies.
        self.piece = np.arange(n)
        #: The times of the joint pieces' ends [s].
        self.times = np.concatenate([spline.times[:1], to_ticks(spline.times[1:])])
        # The last sample of a piece is at its end.
        ends = np.searchsorted(path.piece, self.piece, side='right') - 1
        joints = self._rates(self.piece, np.diff(spline.times), path.q[ends])
        self.joints = MotionRows(
            *(np.concatenate([a, b]) for a, b in zip(start, joints, strict=True))
        )
        self.pending = np.ones(n, dtype=np.bool_)
        self.deviation = np.zeros((n, 2))

    def halve_longer_than(self, time: float) -> None:
        """Halve pieces until none takes longer than a time [s]."""
        while len(rows := np.flatnonzero(np.diff(self.times) > time + TICK)):
            self._halve(rows)

    def refine_within(self, bounds: Floats) -> JointPolynomials:
        """
        Halve pieces until the tool deviates by no more than the bounds, distance [m], angle [rad].

        Pieces that would become shorter than ``min_time`` are not halved.
        """
        while True:
            rows = np.flatnonzero(self.pending)
            self.deviation[rows] = self._deviations(rows)
            self.pending[rows] = False
            bad = rows[(self.deviation[rows] > bounds).any(axis=1)]
            bad = bad[np.diff(self.times)[bad] > 2.0 * self._min_time - TICK]
            if not len(bad):
                break
            self._halve(bad)
        return JointPolynomials(
            times=self.times,
            joints=self.joints,
            piece=self.piece,
            quintic=self.quintic,
            deviations=self.deviation,
        )

    def _joints(self, piece: Indices, t: Floats, times: Floats) -> MotionRows:
        """
        Return the joints on pieces of the tool spline.

        :param t: times since the beginnings of the pieces [s]; ``times``: the same times since the
            start of the spline.
        """
        near = self.path.q[
            np.clip(np.searchsorted(self._sample_times, times), 0, len(self._sample_times) - 1)
        ]
        flange = self.kinematics.flange_rows(self.path.spline.poses(piece, t))
        return self._rates(piece, t, nearest_rows(self.kinematics.arm, flange, near))

    def _rates(self, piece: Indices, t: Floats, q: Floats) -> MotionRows:
        """Return the joint positions ``q`` with the joint rates that follow from the tool's."""
        qd, qdd = self.kinematics.joint_rates(q, *self.path.spline.rates(piece, t))
        # The rates are rounded, so that they are exactly 0 at rest.
        return MotionRows(q, np.round(qd, _DIGITS) + 0.0, np.round(qdd, _DIGITS) + 0.0)

    def _coefficients(self, rows: Indices) -> Floats:
        between = quintic_rows if self.quintic else cubic_rows
        start, end = (MotionRows(*(x[rows + k] for x in self.joints)) for k in (0, 1))
        return between(np.diff(self.times)[rows], start, end)

    def _deviations(self, rows: Indices) -> Floats:
        """Return the maximum deviations (n, 2) of the tool on pieces [m], [rad]."""
        begin, end = np.searchsorted(self._sample_times, self.times[[rows, rows + 1]])
        count = int(np.clip((end - begin).max(), *self._compared))
        parts = np.arange(1, count + 1) / (count + 1)
        blocks = [rows[k : k + _BLOCK] for k in range(0, len(rows), _BLOCK)]
        return np.concatenate([self._deviations_at(parts, block) for block in blocks])

    def _deviations_at(self, parts: Floats, rows: Indices) -> Floats:
        """Return the maximum deviations (n, 2) at the fractions ``parts`` of the pieces' times."""
        begin, end = self.times[rows], self.times[rows + 1]
        t = parts[:, None] * (end - begin)
        q = values(self._coefficients(rows), t).reshape(-1, 6)
        tool = self.kinematics.pose_rows(q)
        spline, piece = self.path.spline, np.tile(self.piece[rows], len(parts))
        wanted = spline.poses(piece, (begin + t).ravel() - spline.times[piece])
        sizes = length_rows(tool[:, :3] - wanted[:, :3]), angle_rows(wanted[:, 3:], tool[:, 3:])
        return np.stack([size.reshape(t.shape).max(axis=0) for size in sizes], axis=1)

    def _halve(self, rows: Indices) -> None:
        begin, end = self.times[rows], self.times[rows + 1]
        middle = to_ticks(0.5 * (begin + end))
        short = np.flatnonzero(end - begin < 2.0 * _MIN_PIECE_TIME)
        if len(short):
            self._refuse(int(rows[short[0]]))
        piece = self.piece[rows]
        joints = self._joints(piece, middle - self.path.spline.times[piece], middle)
        self.joints = MotionRows(
            *(np.insert(x, rows + 1, y, axis=0) for x, y in zip(self.joints, joints, strict=True))
        )
        self.times = np.insert(self.times, rows + 1, middle)
        self.piece = np.insert(self.piece, rows, piece)
        self.deviation = np.insert(self.deviation, rows, 0.0, axis=0)
        self.pending[rows] = True
        self.pending = np.insert(self.pending, rows, True)

    def _refuse(self, row: int) -> None:
        distance, angle = self.deviation[row].tolist()
        raise TooFast(
            point_field(self.path.first + int(self.piece[row])),
            f'cannot be reached along the spline: {self.times[row]:.3f} s after the start the '
            f'joints turn so fast that the tool would leave it by {1e3 * distance:.3f} mm and '
            f'{angle:.4f} rad within a controller cycle',
            'give it more time, or keep away from the singularity there',
        )


def to_ticks(times: Floats) -> Floats:
    """Return times [s] rounded to whole multiples of :data:`TICK`."""
    rounded: Floats = np.round(times / TICK) * TICK
    return rounded
