# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
From a goal message to :class:`~ur_cartesian_driver.motion.goal.Goal`.

Only errors of the message itself are refused here: invalid enumerations and unknown frames. The
planning, which knows no messages, checks the rest. Points become rows of arrays at once, from
either form (:mod:`~ur_cartesian_driver.ros.messages.packed_points`); of the plain form each
attribute lookup counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from enum import IntEnum
from typing import TypeVar

import numpy as np

from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal import (
    ArcMode,
    Goal,
    IOCommand,
    OutputKind,
    Posture,
    SafeOutput,
    Segment,
    SegmentType,
    Tolerance,
)
from ur_cartesian_driver.motion.goal_table import (
    GoalTable,
    rows_where,
    SegmentRows,
    WaypointRows,
    zeros,
)
from ur_cartesian_driver.motion.io_signals import AnalogDomain
from ur_cartesian_driver.motion.pose import IDENTITY, Pose
from ur_cartesian_driver.motion.pose_rows import Floats
from ur_cartesian_driver.motion.vectors import Vector3, Vector6
from ur_cartesian_driver.planning.append.appendable_goal import AppendedPoints
from ur_cartesian_driver.ros.message_fields import (
    Message,
    nanoseconds,
    pose_from_message,
    seconds,
)
from ur_cartesian_driver.ros.messages.packed_points import is_packed, rows_from_message
from ur_cartesian_driver.ros.tf.known_frames import ArmSnapshot, Frames

_Enum = TypeVar('_Enum', bound=IntEnum)

_NO_POSTURE = Posture()


def goal_from_message(
    message: Message,
    frames: Frames,
    *,
    now: int,
    snapshot: ArmSnapshot | None = None,
    time_tolerance: float = 0.0,
) -> Goal:
    """
    Return the goal of a ``FollowCartesianTrajectory.Goal``.

    :param now: time of the node's clock when the goal was received [ns].
    :param snapshot: pose of the arm; None if it is not known.
    :param time_tolerance: the value for a ``goal_time_tolerance`` of zero [s].
    :raises InvalidGoal: a frame is unknown or an enumeration has no such value; the text names
        the field.
    :raises RobotNotReady: a frame moves with the arm, whose pose is not known.
    """
    trajectory = message.trajectory
    waypoints, segments = _rows(message, trajectory.points, 'trajectory.points')
    return resolve_frames(
        GoalTable(
            waypoints=waypoints,
            segments=segments,
            frame_id=trajectory.header.frame_id,
            age=_age(trajectory.header.stamp, now),
            path_tolerance=_tolerance(message.path_tolerance),
            goal_tolerance=_tolerance(message.goal_tolerance),
            goal_time_tolerance=seconds(message.goal_time_tolerance) or time_tolerance,
            execution=_member(ExecutionMode, message.execution, 'execution'),
            io_commands=_io_commands(message),
            keep_open=message.keep_open,
            safe_outputs=tuple(
                _safe_output(output, f'safe_outputs[{i}]')
                for i, output in enumerate(message.safe_outputs)
            ),
        ),
        trajectory,
        frames,
        now=now,
        snapshot=snapshot,
    )


def appended_points_from_message(message: Message) -> AppendedPoints:
    """
    Return the points of an ``AppendPoints.Request``.

    :raises InvalidGoal: an enumeration has no such value; the text names the field.
    """
    waypoints, segments = _rows(message, message.points, 'points')
    return AppendedPoints(
        waypoints=waypoints,
        segments=segments,
        io_commands=_io_commands(message),
        last=message.last,
    )


def resolve_frames(
    goal: Goal, trajectory: Message, frames: Frames, *, now: int, snapshot: ArmSnapshot | None
) -> Goal:
    """
    Return a goal with its frames resolved to their present poses.

    A stamp in the future is used when its time has come; until then the newest transforms are.

    :param trajectory: the ``CartesianTrajectory`` from which the goal was made.
    :param now: time of the node's clock [ns].
    :raises InvalidGoal: a frame is unknown.
    :raises RobotNotReady: a frame moves with the arm, whose pose is not known.
    """
    stamp = nanoseconds(trajectory.header.stamp)
    T_flange_controlled = frames.T_flange_frame(trajectory.controlled_frame, snapshot)
    return replace(
        goal,
        T_base_frame=frames.T_base_frame(
            trajectory.header.frame_id, snapshot, at=stamp if stamp <= now else 0
        ),
        T_flange_controlled=T_flange_controlled,
        # Empty for the active TCP, also if it was given by name.
        controlled_frame='' if T_flange_controlled is None else trajectory.controlled_frame,
    )


def _age(stamp: Message, now: int) -> float | None:
    """Return the age of a stamp [s]; None if it is zero."""
    sent = nanoseconds(stamp)
    return None if sent == 0 else (now - sent) / 1_000_000_000


def _rows(
    message: Message, points: Sequence[Message], field: str
) -> tuple[WaypointRows, SegmentRows]:
    """Return the points and segments of a message, whichever form they have."""
    if not is_packed(message.packed):
        return point_rows(points), segment_rows(message.segments)
    if given := field if points else 'segments' if message.segments else '':
        raise InvalidGoal('packed', f'is given beside {given}', 'use one form or the other')
    waypoints, segments = rows_from_message(message.packed)
    for name, enum in (('types', SegmentType), ('arc_modes', ArcMode)):
        column = getattr(segments, name)
        for i in rows_where(~np.isin(column, list(enum)))[:1]:
            _member(enum, int(column[i]), f'packed.{name}[{i}]')
    return waypoints, segments


def point_rows(points: Sequence[Message]) -> WaypointRows:
    """Return ``CartesianTrajectoryPoint`` messages as rows."""
    n = len(points)
    postures = ((i, _posture(point.posture)) for i, point in enumerate(points))
    return WaypointRows(
        times=np.array([nanoseconds(point.time_from_start) for point in points]) / 1_000_000_000,
        poses=np.array([_seven(point.pose) for point in points]).reshape(n, 7),
        twists=_six_rows([point.twist for point in points]),
        accelerations=_six_rows([point.acceleration for point in points]),
        jerks=_six_rows([point.jerk for point in points]),
        postures={i: posture for i, posture in postures if posture},
    )


def _seven(pose: Message) -> tuple[float, ...]:
    p, q = pose.position, pose.orientation
    return (p.x, p.y, p.z, q.x, q.y, q.z, q.w)


def _six_rows(rates: Sequence[Message]) -> Floats:
    """Return ``Twist`` or ``Accel`` messages as an array (n, 6); most goals have only zeros."""
    rows = np.array([_six(rate) for rate in rates]).reshape(len(rates), 6)
    return rows if rows.any() else zeros(len(rates))


def _three(vector: Message) -> Vector3:
    return (vector.x, vector.y, vector.z)


def _six(twist: Message) -> Vector6:
    """Return a ``Twist`` or ``Accel``."""
    u, v = twist.linear, twist.angular
    return (u.x, u.y, u.z, v.x, v.y, v.z)


def _posture(posture: Message) -> Posture:
    names, values = posture.posture_joint_names, posture.posture_joint_values
    if not names and not values:
        return _NO_POSTURE
    return Posture(names=tuple(names), values=tuple(values))


def segment_rows(segments: Sequence[Message]) -> SegmentRows:
    """
    Return ``MotionSegment`` messages as rows.

    :raises InvalidGoal: an enumeration has no such value; the text names the field.
    """
    return SegmentRows.of([_segment(each, f'segments[{i}]') for i, each in enumerate(segments)])


def _segment(segment: Message, field: str) -> Segment:
    type_ = _member(SegmentType, segment.type, f'{field}.type')
    via: Pose | None = pose_from_message(segment.via)
    if type_ is not SegmentType.CIRCULAR and via == IDENTITY:
        via = None  # the default; another value is kept, so that it is refused and not ignored
    return Segment(
        type=type_,
        blend_radius=segment.blend_radius,
        velocity=segment.velocity,
        acceleration=segment.acceleration,
        via=via,
        via_posture=_posture(segment.via_posture),
        arc_mode=_member(ArcMode, segment.arc_mode, f'{field}.arc_mode'),
    )


def _io_commands(message: Message) -> tuple[IOCommand, ...]:
    commands = message.io_commands
    return tuple(_io_command(each, f'io_commands[{i}]') for i, each in enumerate(commands))


def _io_command(command: Message, field: str) -> IOCommand:
    return IOCommand(
        waypoint=command.point_index,
        offset=seconds(command.offset),
        output=_member(OutputKind, command.output, f'{field}.output'),
        pin=command.pin,
        value=command.value,
        domain=_member(AnalogDomain, command.analog_domain, f'{field}.analog_domain'),
    )


def _safe_output(output: Message, field: str) -> SafeOutput:
    return SafeOutput(
        output=_member(OutputKind, output.output, f'{field}.output'),
        pin=output.pin,
        value=output.value,
        domain=_member(AnalogDomain, output.analog_domain, f'{field}.analog_domain'),
        restore=output.restore,
    )


def _tolerance(tolerance: Message) -> Tolerance:
    return Tolerance(
        position=_three(tolerance.position_error),
        orientation=_three(tolerance.orientation_error),
        twist=_six(tolerance.twist_error),
        acceleration=_six(tolerance.acceleration_error),
    )


def _member(enum: type[_Enum], value: int, field: str) -> _Enum:
    """Return the member of a value, or refuse the value and list the members."""
    try:
        return enum(value)
    except ValueError:
        names = ', '.join(f'{member.name} ({member.value})' for member in enum)
        raise InvalidGoal(field, f'is {value}', f'it must be one of {names}') from None
