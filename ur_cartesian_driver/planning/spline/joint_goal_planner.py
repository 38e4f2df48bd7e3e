# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Plan a joint goal: joint polynomials through its points, checked along the whole motion.

The robot gets one spline piece for each of the client's points, whereas for a SPLINE goal the
driver chooses the pieces. The path of the tool is derived from the joints, so that progress, tool
limits and clearance are checked as for all goals. The joints are allowed to pass singularities.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.differential_kinematics import tool_rates
from ur_cartesian_driver.kinematics.inverse import format_distinct
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.motion.errors import InvalidGoal, JointLimitExceeded, NotAvailable
from ur_cartesian_driver.motion.geometry.arrays import Floats, Indices, Int32s
from ur_cartesian_driver.motion.geometry.polynomials import evaluate, MotionRows, values
from ur_cartesian_driver.motion.geometry.pose_rows import keep_hemisphere, length_rows
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import ContactEnd, Press, START_OF_MOTION
from ur_cartesian_driver.motion.goal.goal_columns import GoalTable, WaypointRows, zeros
from ur_cartesian_driver.motion.goal.joint_goal import JointGoal
from ur_cartesian_driver.motion.plan.plan import Plan, PlannedRows, ReferencePath
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.planning.geometry.curves import tcp_rows
from ur_cartesian_driver.planning.geometry.samples import counted
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.preflight.clearance import clearance_lines, JointSamples
from ur_cartesian_driver.planning.preflight.start_checks import check_approach, check_reported_tcp
from ur_cartesian_driver.planning.preflight.tcp_kinematics import TcpKinematics
from ur_cartesian_driver.planning.request.default_tolerances import apply_default_tolerances
from ur_cartesian_driver.planning.request.goal_fields import point_field
from ur_cartesian_driver.planning.request.joint_goal_rules import (
    check_joint_goal,
    CheckedJointGoal,
)
from ur_cartesian_driver.planning.request.point_events.safe_outputs import add_safe_outputs
from ur_cartesian_driver.planning.request.point_events.stops import Stops
from ur_cartesian_driver.planning.request.program_features import check_program
from ur_cartesian_driver.planning.request.validate import check_measurable_tolerances
from ur_cartesian_driver.planning.spline.joint_polynomials import JointKnots, piece_rows, to_ticks
from ur_cartesian_driver.planning.spline.spline_limits import (
    Rates,
    stretch_remark,
    worst_excess_between,
)
from ur_cartesian_driver.planning.spline.spline_path import coarse_samples, sample_count
from ur_cartesian_driver.planning.spline.spline_planner import stretch_times
from ur_cartesian_driver.planning.stop_prediction import at_set_point

# A joint does not overshoot on a piece if its speeds at both ends are at most this many times its
# mean speed on the piece.
_MAX_MONOTONE = 3.0
# Rounding error of a joint position [rad].
_ROUNDING = 1e-9
# A joint may leave its range between samples if a sample is closer than _NEAR [rad] to the end of
# the range. Then its positions on the piece are computed at _DENSE steps.
_NEAR, _DENSE = 0.02, 256


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Trajectory(JointKnots):
    """The joints at the ends of n pieces; the arm is at rest at the start of the first piece."""

    #: The number of the point at the end of the first piece.
    first: int
    remarks: tuple[str, ...]

    def stretched(self, factor: float) -> _Trajectory:
        """Return the same path with all times multiplied by a factor, in whole microseconds."""
        q, qd, qdd = self.joints
        return replace(
            self,
            times=to_ticks(self.times * factor),
            joints=MotionRows(q, qd / factor, qdd / factor**2),
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Samples:
    """Joints and tool along a trajectory; row 0 is the start."""

    #: (m,) the point at the end of each sample's piece.
    points: Int32s
    #: (m,) the piece of each sample.
    piece: Indices
    #: (m,) the fraction of the piece's time at each sample.
    u: Floats
    #: (m, 6) joint positions [rad].
    q: Floats
    #: (m, 7) poses of the TCP in base.
    poses: Floats


def plan_joint_goal(
    goal: JointGoal, state: RobotState, arm: Arm, options: PlanningOptions
) -> Plan:
    """
    Return the plan of a joint goal for a robot at rest.

    :param state: the state of that robot.
    :raises GoalRefused: the goal cannot be carried out; the text names point, quantity, value and
        bound.
    """
    checked = check_joint_goal(goal, options)
    state = at_set_point(state, arm)
    table = _cartesian_goal(checked, state, arm, options)
    if goal.until_contact:
        table = _until_contact(table, options)
    kinematics = TcpKinematics(arm, state.T_flange_tcp)
    check_reported_tcp(state, kinematics)
    check_approach(state, table.waypoints.pose(0), options)
    given = _trajectory(checked, state, options)
    samples = _sampled(given, state, arm)
    _check_ranges(given, samples, arm)
    trajectory, remark = _fit_to_limits(given, samples, state, arm, options)
    path = JointSamples(samples.points[1:], samples.u[1:], samples.q[1:])
    clearance = clearance_lines(arm, (state.T_flange_tcp,), options, path, state.actual_q)
    poses = samples.poses.copy()
    keep_hemisphere(poses)
    begin, durations = trajectory.times[samples.piece], np.diff(trajectory.times)
    reference = ReferencePath(
        poses=poses,
        point=samples.points,
        time=begin + samples.u * durations[samples.piece],
        fraction=samples.u,
    )
    factor = trajectory.times[-1] / given.times[-1]
    table, segments, reference = Stops(table, options).insert(
        stretch_times(table, factor), _segments(trajectory, reference), reference
    )
    return Plan(
        goal=table,
        segments=segments,
        reference=reference,
        start=state.actual_q,
        T_flange_active=state.T_flange_tcp,
        older_program=options.older_program,
        execution=ExecutionMode.SPLINE,
        joint_tolerances=checked.tolerances,
        remarks=(*trajectory.remarks, *remark, *clearance),
    )


def _cartesian_goal(
    checked: CheckedJointGoal, state: RobotState, arm: Arm, options: PlanningOptions
) -> GoalTable:
    """Return the equivalent goal of the tool, with default tolerances and safe outputs."""
    n = len(checked.times)
    table = GoalTable(
        waypoints=WaypointRows(
            times=checked.times,
            poses=tcp_rows(arm, state.T_flange_tcp, checked.joints.x),
            twists=zeros(n),
            accelerations=zeros(n),
            jerks=zeros(n),
        ),
        goal_time_tolerance=checked.goal_time_tolerance,
        execution=ExecutionMode.SPLINE,
    )
    table = apply_default_tolerances(table, options)
    check_measurable_tolerances(table, options)
    return add_safe_outputs(table, options)


def _until_contact(table: GoalTable, options: PlanningOptions) -> GoalTable:
    """
    Return the goal, changed so that it ends where the tool touches something.

    :raises NotAvailable: the robot program does not watch for contact along splines.
    """
    watch = Press(
        first_waypoint=START_OF_MOTION,
        last_waypoint=len(table.waypoints) - 1,
        contact=ContactEnd.ENDS,
    )
    table = replace(table, presses=(watch,))
    try:
        check_program(table, options)
    except NotAvailable:
        raise NotAvailable(
            'trajectory',
            'is to end where the tool touches, but robot programs of wire dialect '
            f'{options.dialect.name} do not watch for that along splines',
            'let the driver send its own robot program',
        ) from None
    return table


def _trajectory(
    checked: CheckedJointGoal, state: RobotState, options: PlanningOptions
) -> _Trajectory:
    """
    Return the trajectory from the arm's position through the points of the goal.

    The driver chooses velocities that are NaN. Accelerations are ignored unless all points have
    them.
    """
    times, joints, remarks, first = checked.times, checked.joints, [], 0
    if times[0] == 0.0:
        _check_start(checked, state, options)
        remarks.append('point 0: the robot is there at time 0, so nothing is sent for it')
        if np.nan_to_num(joints.a[0]).any():
            remarks.append('point 0: accelerations are ignored, because the arm rests there')
        times, first = times[1:], 1
        joints = MotionRows(*(rows[1:] for rows in joints))
    rest = np.zeros((1, 6))
    q = np.concatenate([[state.actual_q], joints.x])
    qd, qdd = (np.concatenate([rest, rows]) for rows in (joints.v, joints.a))
    times = to_ticks(np.concatenate([[0.0], times]))
    has_qd, has_qdd = (~np.isnan(rows).any(axis=1) for rows in (qd, qdd))
    if not has_qd.all():
        qd = np.where(np.isnan(qd), _chosen_velocities(times, q), qd)
        if len(q) > 2:
            remarks.append(
                'velocities are chosen by the driver where the goal has none, so that no joint '
                'turns beyond its points'
            )
    quintic = bool(has_qdd.all())
    if not quintic and has_qdd[1:].any():
        remarks.append('accelerations are ignored, because some points have none')
    return _Trajectory(
        times=times,
        joints=MotionRows(q, qd, qdd if quintic else np.zeros_like(q)),
        quintic=quintic,
        first=first,
        remarks=tuple(remarks),
    )


def _check_start(checked: CheckedJointGoal, state: RobotState, options: PlanningOptions) -> None:
    """Refuse a first point with time 0 if the arm is elsewhere or the point has velocities."""
    off = np.abs(checked.joints.x[0] - state.actual_q)
    k = int(np.argmax(off))
    if off[k] > options.start_tolerance_angle:
        raise InvalidGoal(
            point_field(0, 'time_from_start'),
            f'is 0, but {JOINT_NAMES[k]} is {off[k]:.4f} rad away from the point (allowed are '
            f'{options.start_tolerance_angle:g} rad)',
            'give the first point a time greater than 0',
        )
    if (np.abs(checked.joints.v[0]) > 0.0).any():
        raise InvalidGoal(
            point_field(0, 'velocities'),
            'are not zero, but the motion starts at rest there',
            'set them to 0',
        )


def _chosen_velocities(times: Floats, q: Floats) -> Floats:
    """
    Return the velocities of parabolas through each point and its neighbours; 0 at both ends.

    The velocities are limited so that each joint moves in one direction only between two points,
    and rests for a moment where it reverses (F. N. Fritsch, R. E. Carlson: Monotone piecewise
    cubic interpolation).
    """
    h = np.diff(times)[:, None]
    mean = np.diff(q, axis=0) / h
    before, after = mean[:-1], mean[1:]
    parabola = (h[1:] * before + h[:-1] * after) / (h[1:] + h[:-1])
    bound = _MAX_MONOTONE * np.minimum(np.abs(before), np.abs(after))
    qd = np.zeros_like(q)
    qd[1:-1] = np.where(before * after > 0.0, np.clip(parabola, -bound, bound), 0.0)
    return qd


def _sampled(trajectory: _Trajectory, state: RobotState, arm: Arm) -> _Samples:
    """Return samples of a trajectory, dense enough for the tool and for the fastest joint."""
    spline, times = trajectory.spline, trajectory.times
    piece, t = coarse_samples(times)
    q, qd, qdd = evaluate(spline.coefficients[piece], t)
    twists, accelerations = tool_rates(arm, state.T_flange_tcp, q, qd, qdd)
    count = sample_count(
        times,
        length_rows(twists[:, :3]),
        np.maximum(length_rows(twists[:, 3:]), np.abs(qd).max(axis=1)),
        length_rows(accelerations[:, :3]),
        trajectory.first,
    )
    piece, number = (np.concatenate([[0], rows]) for rows in counted(count))
    u = number / count[piece]
    q = values(spline.coefficients[piece], u * np.diff(times)[piece])
    return _Samples(
        points=(trajectory.first + piece).astype(np.int32),
        piece=piece,
        u=u,
        q=q,
        poses=tcp_rows(arm, state.T_flange_tcp, q),
    )


def _check_ranges(trajectory: _Trajectory, samples: _Samples, arm: Arm) -> None:
    low, high = np.array(arm.model.position_limits).T
    # A joint that turns back between two samples turns a little beyond the positions at both.
    q = samples.q
    close = ((q < low + _NEAR) | (q > high - _NEAR)).any(axis=1)
    if not close.any():
        return
    pieces, u = np.unique(samples.piece[close]), np.linspace(0.0, 1.0, _DENSE + 1)
    piece, u = np.repeat(pieces, len(u)), np.tile(u, len(pieces))
    q = values(trajectory.spline.coefficients[piece], u * np.diff(trajectory.times)[piece])
    outside = (q < low - _ROUNDING) | (q > high + _ROUNDING)
    if not outside.any():
        return
    row = int(np.flatnonzero(outside.any(axis=1))[0])
    k = int(np.argmax(outside[row]))
    bound = float(low[k] if q[row, k] < low[k] else high[k])
    raise JointLimitExceeded(
        f'{point_field(trajectory.first + int(piece[row]), "positions")}, at '
        f'{100.0 * u[row]:.1f} % of its segment: {JOINT_NAMES[k]} turns to '
        f'{format_distinct(float(q[row, k]), bound)[0]} rad, its range is '
        f'{arm.model.range_text(k)}; keep it within.'
    )


def _fit_to_limits(
    trajectory: _Trajectory,
    samples: _Samples,
    state: RobotState,
    arm: Arm,
    options: PlanningOptions,
) -> tuple[_Trajectory, tuple[str, ...]]:
    """Return the trajectory, slowed if the limits require it, and a remark on the slowing."""
    coefficients, durations = trajectory.spline.coefficients, np.diff(trajectory.times)

    def rates(piece: Indices, u: Floats) -> Rates:
        q, qd, qdd = evaluate(coefficients[piece], u * durations[piece])
        return Rates(*tool_rates(arm, state.T_flange_tcp, q, qd, qdd), qd, qdd)

    found = worst_excess_between(
        rates, samples.piece, samples.u, trajectory.first, arm.model, options
    )
    if found is None:
        return trajectory, ()
    if options.on_too_fast != 'slow':
        raise found.refusal(rates='velocities')
    slowed = trajectory.stretched(found.factor)
    found.check_slowed(slowed.times, slowed.first, options)
    return slowed, (stretch_remark(found.factor, found.speed_limit, slowed.times[-1]),)


def _segments(trajectory: _Trajectory, reference: ReferencePath) -> PlannedRows:
    turns = np.abs(np.diff(trajectory.joints.x, axis=0)).max(axis=1).tolist()
    passes = (np.abs(trajectory.joints.v[1:]).max(axis=1) > 0.0).tolist()
    kind = 'quintic' if trajectory.quintic else 'cubic'

    def lines(sizes: Floats) -> list[str]:
        return [
            f'point {trajectory.first + i}: joints in a {kind} piece, up to {turn:.3f} rad, '
            f'{length:.3f} m of the tool in {time:.3f} s, '
            f'{"passes through" if moves else "stops there"}'
            for i, (turn, moves, (length, _, time)) in enumerate(
                zip(turns, passes, sizes.tolist(), strict=True)
            )
        ]

    return piece_rows(reference, trajectory, trajectory.first + np.arange(len(turns)), lines)
