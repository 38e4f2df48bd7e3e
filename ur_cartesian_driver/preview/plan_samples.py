# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Preview a plan: tool and joints over time, and tables.

The samples are for pictures, for markers, and for checking a plan before the arm moves. Their
times are predictions for full speed; the robot uses its own speed profile.
"""

from __future__ import annotations

from bisect import bisect_left
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from math import ceil, degrees

import numpy as np

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.inverse import nearest
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.geometry.pose import Pose, pose_from_row
from ur_cartesian_driver.motion.geometry.vectors import Joints, vector6, ZERO6
from ur_cartesian_driver.motion.plan.joint_spline import JointSpline
from ur_cartesian_driver.motion.plan.plan import Plan, PlannedSegment, ReferencePath
from ur_cartesian_driver.motion.plan.primitive import MoveJ, OptimoveJ, OptimoveL, Spline, Stop

# Times that differ by less than this [s] are the same.
_INSTANT = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Preview:
    """Samples of a plan, one row for each time."""

    #: (n,) the times since the start of the motion [s]; the last one is its end.
    time: Floats
    #: (n, 7) poses of the TCP in the robot's base: x y z [m], unit quaternion x y z w. On a held
    #: part, poses of the fixed tool in the frame on the part.
    poses: Floats
    #: (n, 6) joint positions [rad]; NaN where the arm has no solution for the pose.
    joints: Floats


def sample(plan: Plan, arm: Arm, T_flange_tcp: Pose, period: float) -> Preview:
    """
    Return the expected motion of tool and joints.

    :param T_flange_tcp: the TCP of the robot, used if the plan does not set another one.
    :param period: time between two samples [s].
    :raises ValueError: the period is not positive.
    """
    if not period > 0.0:
        raise ValueError(f'period is {period}; it must be positive')
    reference = plan.reference
    end = float(reference.time[-1])
    time = np.minimum(np.arange(ceil(end / period - 1e-9) + 1) * period, end)
    # If rows have the same time, the last of them is used.
    row = np.clip(
        np.searchsorted(reference.time, time, side='right') - 1, 0, max(len(reference.time) - 2, 0)
    )
    span = reference.time[np.minimum(row + 1, len(reference.time) - 1)] - reference.time[row]
    fraction = np.clip((time - reference.time[row]) / np.where(span > 0.0, span, 1.0), 0.0, 1.0)
    fraction[time >= end] = 1.0
    poses = [_between(reference, int(k), float(f)) for k, f in zip(row, fraction, strict=True)]
    tcp = T_flange_tcp if plan.T_flange_tcp is None else plan.T_flange_tcp
    if plan.execution.traits.is_spline:
        joints = _spline(plan).rows(time)[0]
    else:
        joints = _joints(plan, arm, tcp.inverse(), poses, row + fraction)
    return Preview(time=time, poses=np.array([pose.row() for pose in poses]), joints=joints)


def table(plan: Plan) -> str:
    """Return the plan as text: a line for the motion to each point, and one for the sum."""
    length = sum(segment.length for segment in plan.segments)
    motions = _to_points(plan)
    commands = [_command(segments) for segments in motions]
    width = max(10, *map(len, commands))
    head = f'{"point":>5}  {"command":<{width}} {"length":>9} {"turn":>7} {"time":>9} {"blend":>7}'
    lines = [
        _line(segments, f'{command:<{width}}')
        for segments, command in zip(motions, commands, strict=True)
    ]
    total = f'{"sum":>5}  {"":<{width}} {length:7.3f} m {"":>7} {_time(plan.segments)}'
    return '\n'.join([head, *lines, total])


def postures(plan: Plan) -> str:
    """Return the predicted joint positions at the start and each point [rad], a line for each."""
    names = [name.removesuffix('_joint') for name in JOINT_NAMES]
    lines = [f'{"point":>5}  ' + ' '.join(f'{name:>13}' for name in names) + ' [rad]']
    ends = (segments[-1] for segments in _to_points(plan))
    for point, joints in [
        ('start', plan.start),
        *((str(segment.waypoint), segment.joints) for segment in ends),
    ]:
        # + 0.0 turns -0.0 into 0.0
        lines.append(f'{point:>5}  ' + ' '.join(f'{round(q, 4) + 0.0:13.4f}' for q in joints))
    return '\n'.join(lines)


def _to_points(plan: Plan) -> list[list[PlannedSegment]]:
    """Return the segments that lead to each point; in a spline there may be several."""
    return [
        list(segments)
        for _, segments in groupby(plan.segments, key=lambda segment: segment.waypoint)
    ]


def _moving(segments: Sequence[PlannedSegment]) -> list[PlannedSegment]:
    return [segment for segment in segments if not isinstance(segment.primitive, Stop)]


def _command(segments: Sequence[PlannedSegment]) -> str:
    """Return the name of the motion to a point, and the number of its pieces if several."""
    moving = _moving(segments)
    name = type(moving[-1].primitive).__name__
    return f'{name} x {len(moving)}' if len(moving) > 1 else name


def _line(segments: Sequence[PlannedSegment], command: str) -> str:
    blend = 1e3 * getattr(_moving(segments)[-1].primitive, 'blend_radius', 0.0)
    length, angle = (
        sum(getattr(segment, quantity) for segment in segments) for quantity in ('length', 'angle')
    )
    return (
        f'{segments[0].waypoint:>5}  {command} {length:7.3f} m {degrees(angle):6.1f}'
        f'\N{DEGREE SIGN} {_time(segments)} {blend:4.0f} mm'
    )


def _time(segments: Sequence[PlannedSegment]) -> str:
    """Return the time of segments as text; OPTIMIZED moves have none that is known."""
    if any(isinstance(segment.primitive, OptimoveJ | OptimoveL) for segment in segments):
        return '      ? s'
    return f'{sum(segment.duration for segment in segments):7.3f} s'


def _spline(plan: Plan) -> JointSpline:
    pieces = (
        Spline(target=segment.joints, velocities=ZERO6, duration=segment.duration)
        if isinstance(segment.primitive, Stop)
        else segment.primitive
        for segment in plan.segments
        if segment.duration > 0.0
    )
    return JointSpline.of(plan.start, (piece for piece in pieces if isinstance(piece, Spline)))


def _between(reference: ReferencePath, row: int, fraction: float) -> Pose:
    after = min(row + 1, len(reference.poses) - 1)
    return pose_from_row(reference.poses[row]).interpolate(
        pose_from_row(reference.poses[after]), fraction
    )


def _joints(
    plan: Plan, arm: Arm, T_tcp_flange: Pose, poses: list[Pose], row_position: Floats
) -> Floats:
    """
    Return joint positions for poses at row positions (row + fraction) of the reference path.

    Each row is the solution nearest to the previous one. In joint moves, which may pass through
    singularities where branches meet, it is the solution nearest to the straight joint line.
    """
    lines = _joint_moves(plan)
    firsts = [line.first for line in lines]
    rows = np.full((len(poses), 6), np.nan)
    q = plan.start
    for k, (pose, position) in enumerate(zip(poses, row_position.tolist(), strict=True)):
        line = lines[bisect_left(firsts, position) - 1] if lines else None
        q_near = line.at(position) if line and line.first < position <= line.last else q
        found = nearest(arm, pose @ T_tcp_flange, q_near)
        if found is not None:
            rows[k] = q = found
    return rows


@dataclass(frozen=True, slots=True)
class _JointMove:
    """A joint move between two rows of the reference path; its rows are evenly spaced."""

    q_start: Joints
    q_end: Joints
    first: int
    last: int

    def at(self, row_position: float) -> Joints:
        u = min(1.0, max(0.0, (row_position - self.first) / max(1, self.last - self.first)))
        return vector6(x + u * (y - x) for x, y in zip(self.q_start, self.q_end, strict=True))


def _joint_moves(plan: Plan) -> list[_JointMove]:
    """Return the joint moves in order."""
    reference, planned = plan.reference, plan.rows
    ends = np.cumsum(planned.durations)
    # A travel has several motions to the same point; their rows are told apart by their times.
    shared = Counter(planned.waypoints.tolist())
    lines = []
    q = plan.start
    for segment, end in zip(plan.segments, ends.tolist(), strict=True):
        if isinstance(segment.primitive, MoveJ | OptimoveJ):
            first, last = np.searchsorted(
                reference.point, [segment.waypoint, segment.waypoint + 1]
            )
            if shared[segment.waypoint] > 1:
                times = [end - segment.duration + _INSTANT, end + _INSTANT]
                begin, stop = np.searchsorted(reference.time, times)
                first, last = max(first, begin), min(last, stop)
            lines.append(_JointMove(q, segment.joints, max(0, int(first) - 1), int(last) - 1))
        q = segment.joints
    return lines
