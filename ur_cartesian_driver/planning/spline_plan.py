# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
From points with times, twists and accelerations to joint spline pieces: SPLINE and SERVO.

Points -> the tool over time (:mod:`~.tool_spline`) -> the arm along it (:mod:`~.spline_way`) ->
limits -> joint polynomials (:mod:`~.spline_joints`). A motion may be planned in parts, each from
where the one before ends: :func:`plan_pieces` takes any :class:`SplineState`, also a moving one,
and :func:`closing` brings such a motion to rest.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import degrees

import numpy as np

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.rates import tool_rates
from ur_cartesian_driver.kinematics.robots import JOINT_NAMES
from ur_cartesian_driver.motion.errors import InvalidGoal, JointLimitExceeded
from ur_cartesian_driver.motion.goal import Goal, ZERO6
from ur_cartesian_driver.motion.joint_spline import JointSpline
from ur_cartesian_driver.motion.plan import Plan, PlannedSegment, ReferencePath
from ur_cartesian_driver.motion.polynomials import Rates
from ur_cartesian_driver.motion.pose import Pose, Vector6
from ur_cartesian_driver.motion.primitive import Joints, Spline
from ur_cartesian_driver.planning.clearance import Clearance
from ur_cartesian_driver.planning.clearance import remarks as clearance_remarks
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.path import tcp_rows
from ur_cartesian_driver.planning.pose_rows import Floats
from ur_cartesian_driver.planning.postures import Reach
from ur_cartesian_driver.planning.reference import keep_hemisphere
from ur_cartesian_driver.planning.spline_joints import joint_track, JointTrack
from ur_cartesian_driver.planning.spline_limits import excess
from ur_cartesian_driver.planning.spline_points import remarks as point_remarks
from ur_cartesian_driver.planning.spline_points import tool_points
from ur_cartesian_driver.planning.spline_way import SplineWay, way_along
from ur_cartesian_driver.planning.tool_spline import ToolPoints, ToolSpline
from ur_cartesian_driver.planning.validate import point_field

#: What an angle counts as a length: tolerances of a tool spline are as much at this distance [m].
ANGLE_LEVER = 0.1
# Places at which a closing piece is looked at, and how much shorter the next try is.
_LOOKS = 17
_SHORTER = 0.8
_TRIES = 20


@dataclass(frozen=True, slots=True, kw_only=True)
class SplineState:
    """Where a motion in spline pieces is at the end of one, as the robot program carries it on."""

    #: From the start of the motion [s].
    time: float = 0.0
    #: [rad], [rad/s], [rad/s^2]; behind a cubic piece the acceleration counts as 0.
    q: Joints
    qd: Vector6 = ZERO6
    qdd: Vector6 = ZERO6

    @classmethod
    def after(cls, piece: Spline, time: float) -> SplineState:
        """Return the state at the end of a piece that ends at a time [s]."""
        return cls(
            time=time, q=piece.target, qd=piece.velocities, qdd=piece.accelerations or ZERO6
        )

    @property
    def moves(self) -> bool:
        """Whether the arm is not at rest."""
        return any(self.qd) or any(self.qdd)

    def rows(self) -> Rates:
        """Return the joints in rows (1, 6)."""
        return Rates(np.array([self.q]), np.array([self.qd]), np.array([self.qdd]))

    def tool(self, arm: Arm, T_flange_tcp: Pose) -> ToolPoints:
        """Return the TCP in base, one row."""
        q, qd, qdd = self.rows()
        twist, acceleration = tool_rates(arm, T_flange_tcp, q, qd, qdd)
        return ToolPoints(
            times=np.array([self.time]),
            poses=tcp_rows(arm, T_flange_tcp, q),
            twists=twist,
            accelerations=acceleration,
            quintic=True,
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SplinePieces:
    """A part of a motion that passed all checks."""

    #: One for each piece; the note stands at the last piece to a point.
    segments: tuple[PlannedSegment, ...]
    #: Row 0 is the start; times are from the start of the motion.
    reference: ReferencePath
    remarks: tuple[str, ...]
    #: At the last point.
    end: SplineState
    #: By how much all times were stretched, 1 = not.
    stretch: float = 1.0


def plan_pieces(
    start: SplineState,
    goal: Goal,
    arm: Arm,
    T_flange_tcp: Pose,
    options: PlanningOptions,
    *,
    first: int = 0,
    tools: Sequence[Pose] = (),
) -> SplinePieces:
    """
    Return the pieces from a state to points.

    :param goal: its waypoints are those behind the state, and their times are from the start of
        the motion. With ``keep_open`` it may end moving; then the way on which :func:`closing`
        brings it to rest is checked as well.
    :param T_flange_tcp: the TCP of the motion.
    :param first: the number of the first of the waypoints in the whole goal.
    :param tools: where tools reach behind the flange, for collisions; empty = the TCP.
    :raises GoalRefused: the subclass that fits; its text names point, quantity, value and bound.
    """
    reach = Reach(arm, T_flange_tcp)
    points = tool_points(goal, start.tool(arm, T_flange_tcp))
    way = way_along(
        reach,
        ToolSpline.through(points),
        goal.waypoints,
        start.q,
        options,
        first=first,
        rests=not start.moves,
    )
    way, stretch, said = _in_time(reach, way, start, goal, options)
    track = joint_track(
        reach,
        way,
        start.rows(),
        points.quintic,
        options.spline_tolerance,
        options.spline_tolerance / ANGLE_LEVER,
    )
    segments = tuple(_segments(way, track, goal))
    piece = segments[-1].primitive
    assert isinstance(piece, Spline)
    end = SplineState.after(piece, float(track.times[-1]))
    said += _clearances(way, end, arm, tools or (T_flange_tcp,), start, options)
    return SplinePieces(
        segments=segments,
        reference=_reference(way),
        end=end,
        stretch=stretch,
        remarks=(*point_remarks(goal, first), *said, _precision(track), _smallest(way)),
    )


def end_state(plan: Plan) -> SplineState:
    """Return where a plan of spline pieces ends."""
    piece = plan.segments[-1].primitive
    assert isinstance(piece, Spline)
    return SplineState.after(piece, float(plan.reference.time[-1]))


def closing(state: SplineState, arm: Arm, deceleration: float) -> Spline:
    """
    Return the piece that brings a moving arm to rest, each joint on as it goes.

    Velocities end as cubics with no acceleration at the end, so the joint that is the fastest
    brakes 1.5 times as hard as on average. It brakes harder than it is told to where it would
    leave the range of a joint or, being accelerated still, exceed its speed.

    :param deceleration: of the fastest joint, at the most [rad/s^2].
    :raises JointLimitExceeded: the end of a range is too near.
    """
    v, a = np.array(state.qd), np.array(state.qdd)
    speed = np.maximum(arm.model.max_joint_speed, np.abs(v))
    T = max(1.5 * float(np.abs(v).max()) / deceleration, _LOOKS * 1e-3)
    for _ in range(_TRIES):
        T = round(T, 6)
        target = np.array(state.q) + 0.5 * T * v + T**2 / 12.0 * a
        piece = Spline(target=_six(target), velocities=ZERO6, accelerations=ZERO6, duration=T)
        q, qd, _ = _rows_of(state, piece)
        beyond = _beyond(arm, q)
        if beyond is None and (np.abs(qd) <= speed * (1.0 + 1e-9)).all():
            return piece
        T *= _SHORTER
    raise JointLimitExceeded(
        f'{JOINT_NAMES[beyond or 0]} is so near to the end of its range, and so fast, that it '
        'cannot be stopped before it; end the motion earlier.'
    )


def _rows_of(state: SplineState, piece: Spline) -> tuple[Floats, Floats, Floats]:
    spline = JointSpline.of(state.q, [piece], velocities=state.qd, accelerations=state.qdd)
    return spline.rows(np.linspace(0.0, piece.duration, _LOOKS))


def _beyond(arm: Arm, q: Floats) -> int | None:
    """Return the joint that leaves its range, None if none does."""
    low, high = np.array(arm.model.position_limits).T
    outside = ((q < low - 1e-9) | (q > high + 1e-9)).any(axis=0)
    return int(np.argmax(outside)) if outside.any() else None


def _in_time(
    reach: Reach, way: SplineWay, start: SplineState, goal: Goal, options: PlanningOptions
) -> tuple[SplineWay, float, list[str]]:
    """Return the way in the time that the limits allow, the factor, and what is said of it."""
    found = excess(reach, way, options)
    if found is None:
        return way, 1.0, []
    in_parts = start.moves or goal.keep_open
    if options.on_too_fast != 'slow' or in_parts:
        raise found.refusal(may_slow=not in_parts)
    way = way.stretched(found.factor)
    longest = int(np.argmax(np.diff(way.spline.times)))
    time = float(np.diff(way.spline.times)[longest])
    if time > options.max_segment_time:
        raise InvalidGoal(
            point_field(way.first + longest, 'time_from_start'),
            f'would take {time:.0f} s because of {found.name}, more than max_segment_time = '
            f'{options.max_segment_time:.0f} s',
            'go around the place where it has to be slow',
        )
    return (
        way,
        found.factor,
        [
            f'all times are stretched by {found.factor:.4g}, because of {found.name} = '
            f'{found.allowed:.3f} {found.unit} of {found.what} on the way to point {found.point}: '
            f'{way.spline.times[-1]:.3f} s in all'
        ],
    )


def _segments(way: SplineWay, track: JointTrack, goal: Goal) -> Iterator[PlannedSegment]:
    length = np.interp(track.times, way.times, way.length)
    angle = np.interp(track.times, way.times, way.angle)
    columns = (
        track.piece,
        np.diff(track.piece, append=-1) != 0,
        np.diff(length),
        np.diff(angle),
        np.round(np.diff(track.times), 6),
        track.q[1:],
        track.qd[1:],
        track.qdd[1:],
    )
    since, far, turned, count = 0.0, 0.0, 0.0, 0
    for k, is_last, metres, radians, duration, q, qd, qdd in zip(
        *(column.tolist() for column in columns), strict=True
    ):
        since, far, turned, count = since + duration, far + metres, turned + radians, count + 1
        note = ''
        if is_last:
            note = _note(way, goal, k, count, (far, turned, since))
            since, far, turned, count = 0.0, 0.0, 0.0, 0
        yield PlannedSegment(
            primitive=Spline(
                target=tuple(q),
                velocities=tuple(qd),
                duration=duration,
                accelerations=tuple(qdd) if track.quintic else None,
            ),
            waypoint=way.first + k,
            length=metres,
            angle=radians,
            duration=duration,
            joints=tuple(q),
            note=note,
        )


def _note(way: SplineWay, goal: Goal, k: int, count: int, done: tuple[float, float, float]) -> str:
    """Return the line of the segment to a point: ``done`` are its length, turn and time."""
    length, angle, time = done
    turn = f' and {degrees(angle):.1f} degrees' if degrees(angle) >= 0.05 else ''
    speed = (
        f'{length / time:.3f} m/s' if length > 1e-6 else f'{angle / time:.3f} rad/s'
    ) + ' on average'
    point = way.first + k
    passes = (
        'stops there'
        if not any(goal.waypoints[k].twist)
        or (k + 1 == len(goal.waypoints) and not goal.keep_open)
        else 'passes it'
    )
    pieces = '1 piece' if count == 1 else f'{count} pieces'
    return (
        f'point {point}: SPLINE in {pieces}, {length:.3f} m{turn} in {time:.3f} s ({speed}), '
        f'{passes}; nearest: {way.nearest[point]}'
    )


def _clearances(
    way: SplineWay,
    end: SplineState,
    arm: Arm,
    tools: Sequence[Pose],
    start: SplineState,
    options: PlanningOptions,
) -> list[str]:
    """Return what is said of collisions; behind a moving end the way to rest counts as well."""
    q, points, u = way.q[1:], way.points[1:], way.u[1:]
    if end.moves:
        on = _rows_of(end, closing(end, arm, options.closing_deceleration))[0]
        q = np.concatenate([q, on])
        points = np.concatenate([points, np.full(len(on), points[-1])])
        u = np.concatenate([u, np.ones(len(on))])
    said = (
        line
        for T_flange_tcp in tools
        for line in clearance_remarks(
            Clearance(arm, T_flange_tcp, options).check(q, start.q), points, u
        )
    )
    return list(dict.fromkeys(said))


def _reference(way: SplineWay) -> ReferencePath:
    poses = way.poses.copy()
    keep_hemisphere(poses)
    return ReferencePath(poses=poses, point=way.points, time=way.times)


def _precision(track: JointTrack) -> str:
    kind = 'quintic' if track.quintic else 'cubic'
    return (
        f'joints: {len(track.piece)} {kind} pieces, along which the tool stays within '
        f'{1e3 * track.distance:.3f} mm and {track.angle:.5f} rad of its spline'
    )


def _smallest(way: SplineWay) -> str:
    point, nearest = min(way.nearest.items(), key=lambda item: item[1].share)
    return f'nearest of all: {nearest} of the way to point {point}'


def _six(values: Floats) -> Vector6:
    a, b, c, d, e, f = values.tolist()
    return (a, b, c, d, e, f)


def stretched(goal: Goal, factor: float) -> Goal:
    """Return a goal with all its times stretched."""
    return replace(
        goal, waypoints=tuple(replace(point, time=factor * point.time) for point in goal.waypoints)
    )
