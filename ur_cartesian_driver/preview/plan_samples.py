# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Preview a plan: tool and joints over time, and tables.

The samples are for pictures, for markers, and for checking a plan before the arm moves. Their
times are predictions for full speed; the robot uses its own speed profile.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from math import ceil, degrees

import numpy as np

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.geometry.pose import Pose, pose_from_row
from ur_cartesian_driver.motion.geometry.vectors import ZERO6
from ur_cartesian_driver.motion.plan.joint_spline import JointSpline
from ur_cartesian_driver.motion.plan.plan import Plan, PlannedSegment, ReferencePath
from ur_cartesian_driver.motion.plan.primitive import OptimoveJ, OptimoveL, Spline, Stop
from ur_cartesian_driver.planning.preflight.held_part_kinematics import kinematics_of
from ur_cartesian_driver.planning.preflight.planned_joints import (
    joint_moves,
    joints_along,
    row_places,
)


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
    places = row_places(reference, time)
    row = np.minimum(places.astype(np.intp), max(len(reference.time) - 2, 0))
    poses = [_between(reference, int(k), float(f)) for k, f in zip(row, places - row, strict=True)]
    if plan.execution.traits.is_spline:
        joints = _spline(plan).rows(time)[0]
    else:
        kinematics = kinematics_of(plan.goal.moving_frame, arm, plan.T_flange_tcp or T_flange_tcp)
        flange = kinematics.flange_rows(np.array([pose.row() for pose in poses]))
        joints = joints_along(arm, flange, places, joint_moves(plan), plan.start)
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
    """Return the time of segments as text; the time of OPTIMIZED moves is not known."""
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
