# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Plan joint spline pieces for lines and arcs with rounded corners.

The steps: programmed path -> rounded path -> time law (the way along the path over time) -> tool
spline, with knots (the ends of its pieces) at least :data:`MIN_PIECE_TIME` apart -> joint
positions along this spline, and joint polynomials, as for any spline
(:mod:`~ur_cartesian_driver.planning.spline.spline_path`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import inf

import numpy as np

from ur_cartesian_driver.motion.errors import InvalidGoal, InvalidPosture, TooFast
from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats, Indices
from ur_cartesian_driver.motion.geometry.polynomials import MotionRows
from ur_cartesian_driver.motion.geometry.pose import Pose, pose_from_row
from ur_cartesian_driver.motion.geometry.pose_rows import (
    angle_rows,
    distance_rows,
    keep_hemisphere,
    length_rows,
)
from ur_cartesian_driver.motion.geometry.vectors import Joints, vector6
from ur_cartesian_driver.motion.goal.goal_columns import GoalTable
from ur_cartesian_driver.motion.plan.joint_spline import JointSpline
from ur_cartesian_driver.motion.plan.plan import ReferencePath
from ur_cartesian_driver.planning.geometry.samples import check_sample_count, sample_parameters
from ur_cartesian_driver.planning.geometry.tool_spline import ToolPoints, ToolSpline
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.preflight.tcp_kinematics import TcpKinematics
from ur_cartesian_driver.planning.request.goal_fields import point_field
from ur_cartesian_driver.planning.request.rounded_rules import corner_bounds
from ur_cartesian_driver.planning.rounded.programmed_path import CHECK_SPEEDS, programmed_sections
from ur_cartesian_driver.planning.rounded.rounded_path import RoundedPath
from ur_cartesian_driver.planning.rounded.section_law import SectionLaw, ToolLimits
from ur_cartesian_driver.planning.rounded.tool_knots import (
    CLOSE_ENOUGH,
    MIN_PIECE_TIME,
    tool_knots,
    TRIES,
)
from ur_cartesian_driver.planning.spline.joint_polynomials import (
    ANGLE_TOLERANCE_RADIUS,
    fit_joint_polynomials,
    JointPolynomials,
)
from ur_cartesian_driver.planning.spline.spline_path import (
    solve_spline_path,
    spline_pieces,
    SplinePath,
)

#: Greatest deviation of the pieces from the rounded path [m].
PIECE_TOLERANCE = 1e-5
#: Upper bound of this deviation, as a fraction of the smallest corner_deviation of the goal.
_PIECE_PART = 0.2
#: Fraction of the allowed deviation that the tool spline may use; the joint polynomials get the
#: remainder. They need less, because pieces are short compared with the arm.
_TOOL_PART = 0.6
#: Fraction of the jerk limit that the time law may use, because the pieces have a little more
#: jerk than the law.
_JERK_PART = 0.97
#: The width of a corner, within which the path is rounded, is at most the distance that the tool
#: travels in this time [s].
_WIDTH_TIME = 0.25
#: Widths up to this [m] are allowed even if the tool is slower.
_SLOW_WIDTH = 0.001
#: A segment is a turn on the spot if the tool travels less than _NO_TRAVEL [m] on it and turns
#: farther than _NO_TURN [rad].
_NO_TRAVEL, _NO_TURN = 1e-6, 1e-6
#: Number of samples inside each piece at which its deviation and its accelerations are measured.
#: Three are enough, because a quintic that agrees with the law at its ends is farthest from it
#: near the quarters.
_SAMPLES_INSIDE = 3
#: Accelerations inside a piece are measured if they may exceed the tool spline's by more
#: than the fraction _MORE_ACCELERATION of their limit, and inside all pieces if a joint anywhere
#: exceeds the fraction _FAST of its speed or acceleration limit.
_MORE_ACCELERATION, _FAST = 0.002, 0.5


@dataclass(frozen=True, kw_only=True, eq=False)
class RoundedMotion:
    """The motion along a rounded path, as joint polynomials."""

    #: The time laws of the sections; a section runs from one stop of the arm to the next.
    laws: Sequence[SectionLaw]
    limits: ToolLimits
    kinematics: TcpKinematics
    #: (k,) times at which the sections begin [s].
    begins: Floats
    places: Places
    #: The tool spline with the samples at which the arm is checked.
    path: SplinePath
    #: (m,) the number of samples that :attr:`reference` has on each piece of the tool spline.
    sample_count: Indices
    polynomials: JointPolynomials
    #: (n,) times at which the points of the goal are passed [s].
    point_times: Floats

    @cached_property
    def reference(self) -> ReferencePath:
        """Samples of the tool's path, each with the number of its segment in the goal."""
        path = self.path
        pieces = spline_pieces(path.spline, self.sample_count, 0, self.places)
        piece, t = sample_parameters(pieces)
        point, fraction = pieces.locate(piece, t)
        begin, durations = path.spline.times[piece], np.diff(path.spline.times)
        poses = np.concatenate([path.poses[:1], pieces.rows(piece, t)])
        keep_hemisphere(poses)
        return ReferencePath(
            poses=poses,
            point=np.append(point[:1], point),
            time=np.append(0.0, begin + t * durations[piece]),
            fraction=np.append(0.0, fraction),
        )

    @cached_property
    def joint_spline(self) -> JointSpline:
        """The joints over time."""
        return self.polynomials.spline


def plan_rounded_path(
    goal: GoalTable,
    targets: Floats,
    start: Pose,
    q_start: Joints,
    kinematics: TcpKinematics,
    options: PlanningOptions,
    stops: frozenset[int],
) -> RoundedMotion:
    """
    Return the motion along a goal's lines and arcs with rounded corners.

    :param targets: (n, 7) the poses of the goal's points in the frame of the path: the robot's
        base, or a frame on a part that the arm holds.
    :param start: pose of the tool in this frame at the beginning, where the arm is at rest.
    :param q_start: joint positions at the beginning [rad].
    :param stops: indices of points at which the arm stops; it also stops at points without
        corner_deviation.
    :raises GoalRefused: the arm does not move at all, cannot follow the path, cannot follow it
        closely enough by pieces, or passes a point in another posture than asked for.
    """
    bounds = corner_bounds(goal)
    given = bounds[bounds[:, 0] > 0.0, 0]
    tolerance = min(PIECE_TOLERANCE, options.spline_tolerance, _PIECE_PART * float(given.min()))
    aimed = np.maximum(bounds - [tolerance, tolerance / ANGLE_TOLERANCE_RADIUS], 0.0)
    sections = programmed_sections(goal, targets, start, aimed, stops)
    limits = _tool_limits(goal, targets, start, options)
    laws: list[SectionLaw] = []
    q = q_start
    for section in sections:
        if len(section.polyline.s) < 2:
            continue
        own = limits.at(section.segments)
        widest = max(_SLOW_WIDTH, _WIDTH_TIME * float(own.speeds.max()))
        path = RoundedPath(section.polyline, widest)
        laws.append(SectionLaw(section, path, own, kinematics, q, options))
        q = laws[-1].q_end
    if not laws:
        raise InvalidGoal(
            'trajectory.points',
            'are all where the arm is, so there is no path whose corners could be rounded',
            'add a point elsewhere, or set corner_deviation to 0',
        )
    for attempt in range(TRIES + 1):
        motion = _fit(laws, limits, q_start, kinematics, options, tolerance)
        coarse = _coarse_times(motion, tolerance, options)
        if not len(coarse):
            _check_postures(motion, goal, targets, kinematics, options)
            return motion
        if attempt < TRIES:
            for law, begin in zip(laws, motion.begins.tolist(), strict=True):
                law.slow_around(coarse - begin)
    point = int(motion.places(coarse[:1, 0])[0][0])
    raise TooFast(
        point_field(point),
        f'lies on a path that the joints cannot follow within {1e3 * tolerance:.3f} mm by pieces '
        f'of {1e3 * MIN_PIECE_TIME:g} ms, {coarse[0, 0]:.3f} s after its start',
        'keep away from the singularity there, or ask for less speed',
    )


def _tool_limits(
    goal: GoalTable, targets: Floats, start: Pose, options: PlanningOptions
) -> ToolLimits:
    """Return the limits of the tool on the segments (n,), from the goal and the options."""
    before = np.concatenate([[start.row()], targets[:-1]])
    turns_only = (distance_rows(before, targets) < _NO_TRAVEL) & (
        angle_rows(before[:, 3:], targets[:, 3:]) > _NO_TURN
    )
    segments = goal.motions
    twists = length_rows(goal.waypoints.twists[:, :3])
    speeds = np.where(twists > 0.0, twists, options.linear_velocity)
    asked = segments.velocities > 0.0
    speeds = np.where(asked & ~turns_only, segments.velocities, speeds)
    if options.max_tool_speed > 0.0:
        speeds = np.minimum(speeds, options.max_tool_speed)
    rates = np.where(asked, segments.velocities, options.angular_velocity)
    faster = segments.accelerations > 0.0
    linear = np.where(faster & ~turns_only, segments.accelerations, options.linear_acceleration)
    angular = np.where(faster, segments.accelerations, options.angular_acceleration)
    return ToolLimits(
        speeds=speeds,
        turn_rates=np.where(turns_only, rates, inf),
        accelerations=np.minimum(linear, options.max_linear_acceleration),
        turn_accelerations=np.where(
            turns_only,
            np.minimum(angular, options.max_angular_acceleration),
            options.max_angular_acceleration,
        ),
        jerk=_JERK_PART * options.max_linear_jerk,
    )


def _fit(
    laws: Sequence[SectionLaw],
    limits: ToolLimits,
    q_start: Joints,
    kinematics: TcpKinematics,
    options: PlanningOptions,
    tolerance: float,
) -> RoundedMotion:
    # tool_knots() slows the laws where pieces are too coarse, so durations are read afterwards.
    knots = [tool_knots(law, _TOOL_PART * tolerance) for law in laws]
    durations = np.array([law.duration for law in laws])
    begins = np.cumsum(durations) - durations
    # The first row of a section is left out if it repeats the last one of the section before.
    join = [slice(1 if i else 0, None) for i in range(len(laws))]
    points = [section.points for section in knots]
    spline = ToolSpline.through(
        ToolPoints(
            times=np.concatenate(
                [
                    (rows.times + begin)[own]
                    for rows, begin, own in zip(points, begins, join, strict=True)
                ]
            ),
            **{
                name: np.concatenate(
                    [getattr(rows, name)[own] for rows, own in zip(points, join, strict=True)]
                )
                for name in ('poses', 'twists', 'accelerations')
            },
            quintic=True,
        )
    )
    places = Places(laws, begins)
    count = np.concatenate([section.sample_count for section in knots])
    check_sample_count(count, places(spline.times[1:])[0], CHECK_SPEEDS)
    path = solve_spline_path(
        kinematics,
        spline,
        {},
        q_start,
        options,
        first=0,
        rests=True,
        places=places,
        count=np.concatenate([section.check_count for section in knots]),
    )
    polynomials = fit_joint_polynomials(
        kinematics,
        path,
        MotionRows(np.array([q_start]), np.zeros((1, 6)), np.zeros((1, 6))),
        True,
        (1.0 - _TOOL_PART) * tolerance,
        min_time=MIN_PIECE_TIME,
        compared=(_SAMPLES_INSIDE, _SAMPLES_INSIDE),
    )
    return RoundedMotion(
        laws=laws,
        limits=limits,
        kinematics=kinematics,
        begins=begins,
        places=places,
        path=path,
        sample_count=count,
        polynomials=polynomials,
        point_times=places.point_times(len(limits.speeds)),
    )


class Places:
    """Finds the segment on which the tool is at a given time."""

    def __init__(self, laws: Sequence[SectionLaw], begins: Floats) -> None:
        self._laws, self._begins = laws, begins

    def __call__(self, times: Floats) -> tuple[Indices, Floats]:
        """Return the segment at each time (m,) [s], and the fraction (m,) of it that is passed."""
        number = np.clip(
            np.searchsorted(self._begins, times, side='left') - 1, 0, len(self._laws) - 1
        )
        segments, fractions = np.empty(len(times), dtype=np.intp), np.empty(len(times))
        for k in np.unique(number).tolist():
            own = number == k
            law = self._laws[k]
            t = np.clip(times[own] - self._begins[k], 0.0, law.duration)
            segments[own], fractions[own] = law.section.locate(law.law.at(t).s)
        return segments, fractions

    def point_times(self, points: int) -> Floats:
        """Return the times (n,) [s] at which the points of the goal are passed."""
        times = np.zeros(points)
        for law, begin in zip(self._laws, self._begins.tolist(), strict=True):
            times[law.section.segments] = begin + law.law.times_of(law.section.ends)
            times[law.section.segments[-1]] = begin + law.duration
        return np.maximum.accumulate(times)


def _coarse_times(motion: RoundedMotion, tolerance: float, options: PlanningOptions) -> Floats:
    """Return both ends (k, 2) [s] of each piece that deviates too far or exceeds a limit."""
    pieces = motion.polynomials
    bounds = (1.0 - _TOOL_PART) * tolerance * np.array([1.0, 1.0 / ANGLE_TOLERANCE_RADIUS])
    coarse = np.any(pieces.deviations > bounds, axis=1)
    doubtful = np.flatnonzero(_may_exceed(motion, options))
    coarse[doubtful] |= _limit_excess(motion, options, doubtful) > CLOSE_ENOUGH
    return np.stack([pieces.times[:-1][coarse], pieces.times[1:][coarse]], axis=1)


def _may_exceed(motion: RoundedMotion, options: PlanningOptions) -> Flags:
    """
    Return whether the accelerations inside each piece (n,) have to be measured.

    The tool spline keeps its limits. A piece agrees with the spline at both ends in position,
    speed and acceleration. So its deviation at the fraction t of its time is about
    64 d t^3 (1 - t)^3, where d is the deviation in the middle. The second derivative of this is at
    most 24 d.
    """
    pieces, limits = motion.polynomials, motion.limits
    durations = np.diff(pieces.times)
    more = 24.0 * pieces.deviations / (durations * durations)[:, None]
    least = np.array([limits.accelerations.min(), limits.turn_accelerations.min()])
    speeds = np.abs(pieces.joints.v).max(axis=0) / motion.kinematics.arm.model.max_joint_speed
    fast = speeds.max() > _FAST or np.abs(pieces.joints.a).max() > (
        _FAST * options.max_joint_acceleration
    )
    found: Flags = (more > _MORE_ACCELERATION * least).any(axis=1) | fast
    return found


def _limit_excess(motion: RoundedMotion, options: PlanningOptions, rows: Indices) -> Floats:
    """
    Return the greatest ratio of a quantity to its limit inside each piece of ``rows``, (k,).

    The quantities are the accelerations of the tool, and the speeds and accelerations of the
    joints.
    """
    pieces, kinematics = motion.polynomials, motion.kinematics
    model = kinematics.arm.model
    if not len(rows):
        return np.empty(0)
    part = np.arange(1, _SAMPLES_INSIDE + 1) / (_SAMPLES_INSIDE + 1)
    t = (pieces.times[rows, None] + np.diff(pieces.times)[rows, None] * part).ravel()
    q, qd, qdd = motion.joint_spline.rows(t)
    _, tool = kinematics.tool_rates(q, qd, qdd)
    segments, _ = motion.places(t)
    excess = np.maximum.reduce(
        [
            length_rows(tool[:, :3]) / motion.limits.accelerations[segments],
            length_rows(tool[:, 3:]) / motion.limits.turn_accelerations[segments],
            np.abs(qdd).max(axis=1) / options.max_joint_acceleration,
            (np.abs(qd) / model.max_joint_speed).max(axis=1),
        ]
    )
    largest: Floats = excess.reshape(-1, _SAMPLES_INSIDE).max(axis=1)
    return largest


def _check_postures(
    motion: RoundedMotion,
    goal: GoalTable,
    targets: Floats,
    kinematics: TcpKinematics,
    options: PlanningOptions,
) -> None:
    """Refuse a point if the arm does not pass it in the point's posture."""
    for i, posture in sorted(goal.waypoints.postures.items()):
        q = vector6(motion.joint_spline.rows(motion.point_times[i : i + 1])[0][0].tolist())
        if clause := kinematics.explain_missed_posture(
            pose_from_row(targets[i]), posture, q, i, options.tf_prefix
        ):
            raise InvalidPosture(
                f'{point_field(i, "posture")} cannot be reached along the rounded path: {clause}; '
                'start in that configuration, or use PRIMITIVES with a JOINT segment.'
            )
