# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Find the joints along a tool spline: a path sampled in time, or a refusal.

On each piece, the samples are evenly spaced in time. They are dense enough where the tool is
fastest: it moves at most 2 mm and turns at most one degree from sample to sample, and chords
between samples stay within some micrometres of the curve.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import degrees, pi

import numpy as np

from ur_cartesian_driver.motion.errors import (
    GoalRefused,
    InvalidGoal,
    InvalidPosture,
    JointLimitExceeded,
    NearSingularity,
)
from ur_cartesian_driver.motion.geometry.arrays import Floats, Indices, Int32s
from ur_cartesian_driver.motion.geometry.pose_rows import angle_rows, keep_hemisphere, length_rows
from ur_cartesian_driver.motion.geometry.vectors import Joints, vector6
from ur_cartesian_driver.motion.goal.goal import Posture
from ur_cartesian_driver.motion.plan.plan import ReferencePath
from ur_cartesian_driver.planning.geometry.curves import ARC_CHORD_ERROR, HALF_TURN
from ur_cartesian_driver.planning.geometry.samples import (
    check_sample_count,
    CurvePieces,
    MIN_SAMPLES,
    STEP_ANGLE,
    STEP_LENGTH,
)
from ur_cartesian_driver.planning.geometry.tool_spline import ToolSpline, ToolSplinePath
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.preflight.clearance import JointSamples
from ur_cartesian_driver.planning.preflight.joint_path_solver import (
    JointPath,
    max_path_length,
    solve_joint_path,
)
from ur_cartesian_driver.planning.preflight.tcp_kinematics import TcpKinematics
from ur_cartesian_driver.planning.preflight.tightest_margins import (
    first_refusal,
    is_leaving_rows,
    singularity_distance_rows,
    tightest_margins,
    TightestMargins,
)
from ur_cartesian_driver.planning.request.goal_fields import point_field

# Number of samples that estimate the peak speed of a piece.
_COARSE_SAMPLES = 9
# Factor on this estimate, because the peak may lie between the samples.
_SPEED_MARGIN = 1.05
#: Maximum turn within a piece [rad]: rotation vectors of larger turns are ambiguous.
_MAX_TURN = 2.0 * pi


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SplinePath:
    """A spline that the arm can follow, with its samples."""

    spline: ToolSpline
    #: The number of the point at the end of the first segment.
    first: int
    #: (m,) the piece of each sample; row 0 is the start.
    piece: Indices
    #: (m,) the fraction of the piece's time at each sample.
    u: Floats
    #: (m,) the segment of each sample, by the number of the point at its end.
    points: Int32s
    #: (m,) the fraction of this segment at each sample.
    fractions: Floats
    #: (m, 7) poses of the tool in the frame of the path.
    poses: Floats
    #: (m, 6) joint positions [rad].
    q: Floats
    #: (m,) path length of the tool since the start [m].
    length: Floats
    #: The tightest margin of each segment.
    tightest_margins: TightestMargins

    @property
    def times(self) -> Floats:
        """(m,) the time of each sample [s]."""
        begin = self.spline.times[self.piece]
        times: Floats = begin + self.u * (self.spline.times[self.piece + 1] - begin)
        return times

    @property
    def samples(self) -> JointSamples:
        """The samples after the start."""
        return JointSamples(self.points[1:], self.fractions[1:], self.q[1:])

    @property
    def reference(self) -> ReferencePath:
        """The path of the tool, as a plan keeps it."""
        poses = self.poses.copy()
        keep_hemisphere(poses)
        return ReferencePath(
            poses=poses, point=self.points, time=self.times, fraction=self.fractions
        )

    def stretch_times(self, factor: float) -> SplinePath:
        """Return the same path with all times multiplied by a factor."""
        return replace(self, spline=self.spline.stretch_times(factor))


def solve_spline_path(
    kinematics: TcpKinematics,
    spline: ToolSpline,
    postures: Mapping[int, Posture],
    q_start: Joints,
    options: PlanningOptions,
    *,
    first: int,
    rests: bool,
    places: Callable[[Floats], tuple[Indices, Floats]] | None = None,
    count: Indices | None = None,
) -> SplinePath:
    """
    Return the path of the arm along a spline.

    :param postures: the postures at the ends of pieces, by the index of the piece.
    :param q_start: the joint positions at the start [rad].
    :param first: the number of the point at the end of the first segment.
    :param rests: whether the arm is at rest at the start.
    :param places: the segments over time, see :class:`ToolSplinePath`.
    :param count: (n,) the number of samples of each piece; None = it is computed, after lengths
        and turns of the pieces have been checked.
    :raises GoalRefused: the arm cannot follow the spline, or misses a posture.
    """
    if count is None:
        count = _measured_count(kinematics, spline, first)
    joint_path = solve_joint_path(kinematics, spline_pieces(spline, count, first, places), q_start)
    start = spline.poses(np.zeros(1, dtype=np.intp), np.zeros(1))
    poses = np.concatenate([start, joint_path.poses])
    length = _cumulative(length_rows(np.diff(poses[:, :3], axis=0)))
    angle = _cumulative(angle_rows(poses[:-1, 3:], poses[1:, 3:]))
    measures = singularity_distance_rows(kinematics.arm, joint_path.q)
    leaving = is_leaving_rows(measures, length[1:], angle[1:], rests=rests)
    _check_path(kinematics, joint_path, np.where(leaving, np.inf, measures), postures, options)
    return SplinePath(
        spline=spline,
        first=first,
        poses=poses,
        q=np.concatenate([[q_start], joint_path.q]),
        piece=np.concatenate([[0], joint_path.piece]),
        u=np.concatenate([[0.0], joint_path.t]),
        points=np.concatenate([joint_path.segments[:1], joint_path.segments]),
        fractions=np.concatenate([[0.0], joint_path.fractions]),
        length=length,
        tightest_margins=tightest_margins(
            kinematics.arm, joint_path.q, measures, joint_path.segments, joint_path.fractions
        ),
    )


def spline_pieces(
    spline: ToolSpline,
    count: Indices,
    first: int,
    places: Callable[[Floats], tuple[Indices, Floats]] | None,
) -> CurvePieces:
    """Return the pieces of a spline; for the parameters see :func:`solve_spline_path`."""
    n = len(count)
    return CurvePieces(
        path=ToolSplinePath(spline, count, places),
        first=first,
        number=2 * np.arange(n),
        begin=np.zeros(n),
        end=np.ones(n),
        sample_count=count,
    )


def _measured_count(kinematics: TcpKinematics, spline: ToolSpline, first: int) -> Indices:
    """Check lengths and turns of the pieces; return the number of samples of each piece."""
    coarse = coarse_samples(spline.times)
    _check_sizes(kinematics, spline, coarse, first)
    twists, accelerations = spline.rates(*coarse)
    speed, turn_rate = length_rows(twists[:, :3]), length_rows(twists[:, 3:])
    return sample_count(spline.times, speed, turn_rate, length_rows(accelerations[:, :3]), first)


def _check_path(
    kinematics: TcpKinematics,
    joint_path: JointPath,
    measures: Floats,
    postures: Mapping[int, Posture],
    options: PlanningOptions,
) -> None:
    """
    Raise the first refusal along the path, if any.

    :param measures: (n, 3) the distances from singularities, infinite where the arm is allowed to
        be near one.
    """
    refusal, index = first_refusal(joint_path, measures, options)
    for k, posture in postures.items():
        point = int(joint_path.pieces.index[k])
        if refusal is not None and point >= index:
            break
        row = int(np.searchsorted(joint_path.piece, k, side='right')) - 1
        q = vector6(joint_path.q[row].tolist())
        if clause := kinematics.explain_missed_posture(
            joint_path.pieces.pose(k, 1.0), posture, q, point, options.tf_prefix
        ):
            raise InvalidPosture(
                f'{point_field(point, "posture")} cannot be reached along the spline: '
                f'{clause}; start in that configuration, or use PRIMITIVES with a JOINT segment.'
            )
    if refusal is not None:
        raise _with_spline_advice(refusal)


def _with_spline_advice(refusal: GoalRefused) -> GoalRefused:
    """Return a refusal that advises PRIMITIVES for a JOINT segment, because splines have none."""
    if isinstance(refusal, NearSingularity | JointLimitExceeded):
        return refusal.reworded(
            str(refusal).replace('use a JOINT segment', 'use PRIMITIVES with a JOINT segment')
        )
    return refusal


def coarse_samples(times: Floats) -> tuple[Indices, Floats]:
    """
    Return a few samples on each piece of a spline: the piece, and the time since it began [s].

    :param times: (n + 1,) the times of the ends of the pieces [s].
    """
    h = np.diff(times)
    piece = np.repeat(np.arange(len(h)), _COARSE_SAMPLES)
    return piece, np.tile(np.linspace(0.0, 1.0, _COARSE_SAMPLES), len(h)) * h[piece]


def _check_sizes(
    kinematics: TcpKinematics,
    spline: ToolSpline,
    coarse: tuple[Indices, Floats],
    first: int,
) -> None:
    """
    Refuse pieces with half a turn of the tool, and pieces with huge detours or turns in between.

    The direction of half a turn is ambiguous; wrong rates at the ends of a piece cause detours.
    """
    n = len(spline.positions)
    x, turn = spline.vectors(*coarse)
    x = x.reshape(n, _COARSE_SAMPLES, 3)
    steps = length_rows(np.diff(x, axis=1).reshape(-1, 3)).reshape(n, -1)
    detour = steps.sum(axis=1) - length_rows(x[:, -1] - x[:, 0])
    angles = length_rows(turn).reshape(n, _COARSE_SAMPLES)
    k = int(np.argmax(angles[:, -1]))
    if angles[k, -1] > pi - HALF_TURN:
        raise InvalidGoal(
            point_field(first + k, 'pose.orientation'),
            f'turns the tool by {degrees(angles[k, -1]):.2f} degrees, so that the direction of '
            'the rotation is ambiguous',
            'add a point in between',
        )
    for sizes, bound, what, unit in (
        (detour, max_path_length(kinematics), 'a detour', 'm'),
        (angles.max(axis=1), _MAX_TURN, 'a turn', 'rad'),
    ):
        k = int(np.argmax(sizes > bound))
        if sizes[k] > bound:
            raise InvalidGoal(
                point_field(first + k),
                f'and the point before it imply {what} of {sizes[k]:.3g} {unit} by their twists '
                f'and accelerations, more than {bound:.3g} {unit}',
                'check their units and directions, and the time in between',
            )


def sample_count(
    times: Floats, speed: Floats, turn_rate: Floats, acceleration: Floats, first: int
) -> Indices:
    """
    Return the number of samples of each piece.

    :param speed: speed of the tool at the coarse samples [m/s].
    :param turn_rate: turn rate of the tool at these samples [rad/s].
    :param acceleration: acceleration of the tool at these samples [m/s^2].
    :param first: the number of the point at the end of the first piece.
    :raises InvalidGoal: there would be too many.
    """
    h = np.diff(times)
    density = sample_density(speed, turn_rate, acceleration).reshape(len(h), _COARSE_SAMPLES)
    steps = _SPEED_MARGIN * h * density.max(axis=1)
    count = np.maximum(np.ceil(steps), np.minimum(MIN_SAMPLES, np.ceil(1.25 * steps) + 1.0))
    check_sample_count(count, first + np.arange(len(h)), 'check positions, times and rates')
    found: Indices = count.astype(np.intp)
    return found


def sample_density(
    speed: Floats,
    turn_rate: Floats,
    acceleration: Floats,
    chord_error: float = ARC_CHORD_ERROR,
) -> Floats:
    """
    Return the samples per second (m,) that follow the tool closely enough at m times.

    :param acceleration: of the tool, or the part of it that bends the path [m/s^2].
    :param chord_error: greatest distance of chords between samples from the path [m].
    """
    density: Floats = np.maximum.reduce(
        [
            speed / STEP_LENGTH,
            turn_rate / STEP_ANGLE,
            np.sqrt(acceleration / (8.0 * chord_error)),
        ]
    )
    return density


def _cumulative(steps: Floats) -> Floats:
    return np.concatenate([[0.0], np.cumsum(steps)])
