# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Plan the joint spline pieces of SPLINE and SERVO goals.

A piece is a polynomial in time for each joint. The planner makes a spline of tool poses through
the points (:mod:`~ur_cartesian_driver.planning.geometry.tool_spline`), solves the joints along it
(:mod:`~.spline_path`), checks the limits, and fits the pieces to the joints
(:mod:`~.joint_polynomials`). A motion can be planned in parts: :func:`plan_spline` starts from any
:class:`SplineState`, even of a moving arm, and :func:`plan_stop` brings a moving arm to rest.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from math import ceil, degrees, inf

import numpy as np

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.motion.errors import GoalRefused, JointLimitExceeded, TooFast
from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.geometry.polynomials import MotionRows
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import Joints, Vector6, vector6, ZERO6
from ur_cartesian_driver.motion.goal.goal import PartChange, PIECES_PER_HORIZON
from ur_cartesian_driver.motion.goal.goal_columns import GoalTable
from ur_cartesian_driver.motion.plan.joint_spline import JointSpline
from ur_cartesian_driver.motion.plan.plan import Plan, PlannedRows, ReferencePath
from ur_cartesian_driver.motion.plan.primitive import Spline
from ur_cartesian_driver.motion.plan.slow_stretch import SlowStretch, SpeedLimit
from ur_cartesian_driver.planning.geometry.tool_spline import ToolPoints, ToolSpline
from ur_cartesian_driver.planning.min_speed import slower_by
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.preflight.clearance import clearance_lines, JointSamples
from ur_cartesian_driver.planning.preflight.tcp_kinematics import TcpKinematics
from ur_cartesian_driver.planning.request.goal_fields import point_field, resolve_execution_mode
from ur_cartesian_driver.planning.spline.joint_polynomials import (
    fit_joint_polynomials,
    JointPolynomials,
    piece_rows,
    TICK,
)
from ur_cartesian_driver.planning.spline.slow_spline import slow_spline_stretches
from ur_cartesian_driver.planning.spline.spline_limits import stretch_remark, worst_excess
from ur_cartesian_driver.planning.spline.spline_path import solve_spline_path, SplinePath
from ur_cartesian_driver.planning.spline.spline_points import point_remarks, tool_points

# Number of samples at which the piece that stops the arm is checked.
_SAMPLES = 17
# Shortest time of the piece that stops the arm [s]: two cycles of the slowest controller (8 ms).
_SHORTEST_STOP = 0.017
# If the arm cannot stop in a time, the next try multiplies the time by this.
_SHORTENING = 0.8
# Tolerance for rounding: absolute for joint positions [rad], relative for speeds.
_ROUNDING = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class SplineState:
    """The motion of the joints at one time, from which a spline can go on."""

    #: Time since the start of the motion [s].
    time: float = 0.0
    #: Joint positions [rad].
    q: Joints
    #: Joint velocities [rad/s].
    qd: Vector6 = ZERO6
    #: Joint accelerations [rad/s^2]; 0 after a cubic piece, as cubics prescribe no accelerations.
    qdd: Vector6 = ZERO6

    @property
    def is_moving(self) -> bool:
        """Whether the arm is not at rest."""
        return any(self.qd) or any(self.qdd)

    def rows(self) -> MotionRows:
        """Return the joints as rows (1, 6)."""
        return MotionRows(np.array([self.q]), np.array([self.qd]), np.array([self.qdd]))

    def tool(self, kinematics: TcpKinematics) -> ToolPoints:
        """Return pose and rates of the tool, as one row, in the frame that ``kinematics`` uses."""
        q, qd, qdd = self.rows()
        twist, acceleration = kinematics.tool_rates(q, qd, qdd)
        return ToolPoints(
            times=np.array([self.time]),
            poses=kinematics.pose_rows(q),
            twists=twist,
            accelerations=acceleration,
            quintic=True,
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SplinePieces:
    """The pieces of one part of a motion, after all checks."""

    #: One row for each piece; the last piece before a point has the point's report line.
    segments: PlannedRows
    #: The path; row 0 is the start, and times are since the start of the motion.
    reference: ReferencePath
    remarks: tuple[str, ...]
    #: Returns the stretches on which the tool is slower than requested; computed when called.
    find_slow_stretches: Callable[[], Sequence[SlowStretch]]
    #: State at the last point.
    end: SplineState
    #: Factor by which all times were stretched to keep a limit; 1 = none.
    stretch: float = 1.0


def plan_spline(
    start: SplineState,
    goal: GoalTable,
    kinematics: TcpKinematics,
    options: PlanningOptions,
    *,
    first: int = 0,
    tool_tips: Sequence[Pose] = (),
) -> SplinePieces:
    """
    Return the pieces that lead from a state through the points of a goal.

    :param goal: the goal, without the waypoints up to ``start``; its times are since the start of
        the motion. With ``keep_open``, the arm may still be moving at the last point; the stop by
        :func:`plan_stop` is then checked as well.
    :param kinematics: the kinematics of the arm with the TCP of the motion.
    :param first: the index, in the whole goal, of the first waypoint in ``goal``.
    :param tool_tips: the tool tips to check for collisions; empty = only the TCP of
        ``kinematics``.
    :raises GoalRefused: the spline cannot be executed; the text names point, quantity, value and
        bound.
    """
    points = tool_points(goal, start.tool(kinematics))
    path = solve_spline_path(
        kinematics,
        ToolSpline.through(points),
        goal.waypoints.postures,
        start.q,
        options,
        first=first,
        rests=not start.is_moving,
    )
    path, stretch, limit = _fit_to_limits(kinematics, path, start, goal, options)
    polynomials = fit_joint_polynomials(
        kinematics,
        path,
        start.rows(),
        points.quintic,
        options.spline_tolerance,
        _max_piece_time(goal),
    )
    end, reference = _end_of(polynomials), path.reference
    kind = 'quintic' if polynomials.quintic else 'cubic'
    return SplinePieces(
        segments=_segments(path, reference, polynomials, goal),
        reference=reference,
        end=end,
        stretch=stretch,
        remarks=(
            *point_remarks(goal, first),
            *([stretch_remark(stretch, limit, path.spline.times[-1])] if limit else []),
            *_clearance_remarks(
                path,
                end,
                kinematics.arm,
                tool_tips or (kinematics.T_flange_tcp,),
                start,
                options,
                goal.part_changes,
            ),
            f'joints: {len(polynomials.piece)} {kind} pieces, which keep the tool within '
            f'{1e3 * polynomials.distance:.3f} mm and {polynomials.angle:.5f} rad of its spline',
            path.tightest_margins.remark,
        ),
        find_slow_stretches=cache(
            lambda: slow_spline_stretches(
                kinematics,
                path,
                polynomials,
                goal.waypoints.twists,
                stretch,
                limit,
                slower_by(goal),
            )
        ),
    )


def _end_of(polynomials: JointPolynomials) -> SplineState:
    q, qd, qdd = (vector6(rows[-1].tolist()) for rows in polynomials.joints)
    return SplineState(
        time=float(polynomials.times[-1]), q=q, qd=qd, qdd=qdd if polynomials.quintic else ZERO6
    )


def _max_piece_time(goal: GoalTable) -> float:
    """
    Return the longest duration of a piece [s].

    A piece can only be replaced as a whole. So the pieces of a goal whose points can be replaced
    take at most ``replace_horizon`` / PIECES_PER_HORIZON. Goals that are sent as set-points have
    no such limit.
    """
    if not goal.replace_horizon or resolve_execution_mode(goal).traits.streams_setpoints:
        return inf
    return goal.replace_horizon / PIECES_PER_HORIZON


def end_state(plan: Plan) -> SplineState:
    """Return the state at the end of a plan of spline pieces."""
    piece = plan.segments[-1].primitive
    assert isinstance(piece, Spline)
    return SplineState(
        time=float(plan.reference.time[-1]),
        q=piece.target,
        qd=piece.velocities,
        qdd=piece.accelerations or ZERO6,
    )


def plan_stop(state: SplineState, arm: Arm, options: PlanningOptions, point: int) -> Spline:
    """
    Return the piece that brings a moving arm to rest.

    The joint velocities are cubics of time that end at 0 with acceleration 0. From the speed v
    and the acceleration a, a stop in the time T decelerates by at most 1.5 v / T + a / 3. T is
    such that 1.5 v / T of the fastest joint is ``keep_open_deceleration``. The arm brakes harder,
    with up to ``max_joint_acceleration``, in two cases: a joint would otherwise leave its range;
    or a joint that still accelerates would exceed its speed limit.

    :param state: the moving arm.
    :param point: index of the point at which the arm has this state, for error messages.
    :raises JointLimitExceeded: a joint is too close to the end of its range.
    :raises TooFast: a joint that still accelerates is too close to its speed limit.
    """
    v, a = np.abs([state.qd, state.qdd])
    hardest = np.maximum(options.max_joint_acceleration, a)
    shortest = max(1.5 * float((v / (hardest - a / 3.0)).max()), _SHORTEST_STOP)
    shortest = round(ceil(shortest / TICK) * TICK, 6)
    T = max(1.5 * float(v.max()) / options.keep_open_deceleration, shortest)
    while True:
        T = round(T, 6)
        end = np.array([1.0, 0.5 * T, T**2 / 12.0]) @ np.array([state.q, state.qd, state.qdd])
        piece = Spline(
            target=vector6(end.tolist()), velocities=ZERO6, accelerations=ZERO6, duration=T
        )
        q, qd, _ = rows_along(piece, state, _SAMPLES)
        fault = _stop_fault(q, qd, arm, options, point)
        if fault is None:
            return piece
        if shortest >= T:
            raise fault
        T = max(_SHORTENING * T, shortest)


def _stop_fault(
    q: Floats, qd: Floats, arm: Arm, options: PlanningOptions, point: int
) -> GoalRefused | None:
    """Return the error if the joints (m, 6) of a stop are out of range or too fast, else None."""
    model = arm.model
    low, high = np.array(model.position_limits).T
    outside = ((q < low - _ROUNDING) | (q > high + _ROUNDING)).any(axis=0)
    if outside.any():
        k = int(np.argmax(outside))
        return JointLimitExceeded(
            f'{point_field(point)}: {JOINT_NAMES[k]} is too fast there to stop before the end of '
            f'its range, {model.range_text(k)}: with max_joint_acceleration = '
            f'{options.max_joint_acceleration:g} rad/s^2 it stops at {q[-1, k]:.4f} rad; '
            'end the motion earlier, or slower.'
        )
    speeds = np.abs(qd)
    bounds = np.maximum(model.max_joint_speed, speeds[0]) * (1.0 + _ROUNDING)
    too_fast = (speeds > bounds).any(axis=0)
    if not too_fast.any():
        return None
    k = int(np.argmax(too_fast))
    return TooFast(
        point_field(point, 'acceleration'),
        f'still speeds up {JOINT_NAMES[k]}, which reaches {speeds[:, k].max():.3f} rad/s while it '
        f'stops behind the point, more than the joint speed limit{model.speed_source(k)} = '
        f'{model.max_joint_speed[k]:.3f} rad/s',
        'reduce it, or the twist',
    )


@lru_cache(maxsize=8)
def rows_along(piece: Spline, state: SplineState, samples: int) -> tuple[Floats, Floats, Floats]:
    """Return q, qd and qdd (samples, 6) at equal time steps of a piece that starts at a state."""
    spline = JointSpline.of(state.q, [piece], velocities=state.qd, accelerations=state.qdd)
    return spline.rows(np.linspace(0.0, piece.duration, samples))


def _fit_to_limits(
    kinematics: TcpKinematics,
    path: SplinePath,
    start: SplineState,
    goal: GoalTable,
    options: PlanningOptions,
) -> tuple[SplinePath, float, SpeedLimit | None]:
    """
    Return the path, the factor by which its times were multiplied, and the limit that required it.

    If the path exceeds no limit, it is unchanged, the factor is 1, and the limit is None.

    :raises GoalRefused: a limit is exceeded, and the path must not be slowed, or would take too
        long.
    """
    found = worst_excess(kinematics, path, options)
    if found is None:
        return path, 1.0, None
    in_parts = start.is_moving or goal.keep_open
    if options.on_too_fast != 'slow' or in_parts:
        raise found.refusal(may_slow=not in_parts)
    path = path.stretch_times(found.factor)
    found.check_slowed(path.spline.times, path.first, options)
    return path, found.factor, found.speed_limit


def _segments(
    path: SplinePath, reference: ReferencePath, polynomials: JointPolynomials, goal: GoalTable
) -> PlannedRows:
    def lines(sizes: Floats) -> list[str]:
        """Return a line for the last piece to each point, and '' for the other pieces."""
        last = np.flatnonzero(np.diff(polynomials.piece, append=-1))
        count = np.diff(last, prepend=-1)
        done = np.add.reduceat(sizes, last + 1 - count, axis=0)
        made = [''] * len(sizes)
        for k, (row, pieces, sums, margin) in enumerate(
            zip(last.tolist(), count.tolist(), done.tolist(), path.tightest_margins, strict=True)
        ):
            line = _segment_line(goal, path.first, k, pieces, sums)
            made[row] = f'{line}; margin {margin}'
        return made

    return piece_rows(reference, polynomials, path.first + polynomials.piece, lines)


def _segment_line(goal: GoalTable, first: int, k: int, count: int, done: Sequence[float]) -> str:
    """Return the report line of a segment; ``done`` has its length, turn and time."""
    length, angle, time = done
    turn = f' and {degrees(angle):.1f} degrees' if degrees(angle) >= 0.05 else ''
    speed = (
        f'{length / time:.3f} m/s' if length > 1e-6 else f'{angle / time:.3f} rad/s'
    ) + ' mean'
    passes = (
        'stops there'
        if not goal.waypoints.twists[k].any()
        or (k + 1 == len(goal.waypoints) and not goal.keep_open)
        else 'passes through'
    )
    pieces = '1 piece' if count == 1 else f'{count} pieces'
    return (
        f'point {first + k}: SPLINE in {pieces}, {length:.3f} m{turn} in {time:.3f} s ({speed}), '
        f'{passes}'
    )


def _clearance_remarks(
    path: SplinePath,
    end: SplineState,
    arm: Arm,
    tool_tips: Sequence[Pose],
    start: SplineState,
    options: PlanningOptions,
    part_changes: Sequence[PartChange],
) -> list[str]:
    """Return the remarks on clearance; if the arm moves at the end, its stop is checked, too."""
    samples = path.samples
    if end.is_moving:
        stop = plan_stop(end, arm, options, path.first + len(path.spline.positions) - 1)
        on = rows_along(stop, end, _SAMPLES)[0]
        samples = JointSamples(
            np.append(samples.segment, np.full(len(on), samples.segment[-1])),
            np.append(samples.fraction, np.ones(len(on))),
            np.concatenate([samples.q, on]),
        )
    return clearance_lines(arm, tool_tips, options, samples, start.q, part_changes)


def stretch_times(goal: GoalTable, factor: float) -> GoalTable:
    """Return a goal with all its times multiplied by a factor."""
    points = goal.waypoints
    return replace(goal, waypoints=replace(points, times=factor * points.times))
