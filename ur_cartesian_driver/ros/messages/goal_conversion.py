# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
From a goal message to :class:`~ur_cartesian_driver.motion.goal.Goal`.

Only errors of the message itself are refused here: invalid enumerations and unknown frames. The
planning, which knows no messages, checks the rest. A goal of 20,000 points passes through one
plain loop, in which every attribute lookup counts.
"""

from __future__ import annotations

from dataclasses import replace
from enum import IntEnum
from typing import TypeVar

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
    Waypoint,
)
from ur_cartesian_driver.motion.io_signals import AnalogDomain
from ur_cartesian_driver.motion.pose import IDENTITY, Pose
from ur_cartesian_driver.motion.vectors import Vector3, Vector6, ZERO6
from ur_cartesian_driver.planning.append.appendable_goal import AppendedPoints
from ur_cartesian_driver.ros.message_fields import (
    Message,
    nanoseconds,
    pose_from_message,
    seconds,
)
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
    return resolve_frames(
        Goal(
            waypoints=tuple(map(_waypoint, trajectory.points)),
            segments=_segments(message),
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
    return AppendedPoints(
        waypoints=tuple(map(_waypoint, message.points)),
        segments=_segments(message),
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


def _waypoint(point: Message) -> Waypoint:
    time = point.time_from_start
    return Waypoint(
        time=(time.sec * 1_000_000_000 + time.nanosec) / 1_000_000_000,
        pose=pose_from_message(point.pose),
        twist=_six(point.twist),
        acceleration=_six(point.acceleration),
        jerk=_six(point.jerk),
        posture=_posture(point.posture),
    )


def _three(vector: Message) -> Vector3:
    return (vector.x, vector.y, vector.z)


def _six(twist: Message) -> Vector6:
    """Return a ``Twist`` or ``Accel``; almost all points share one tuple of zeros."""
    u, v = twist.linear, twist.angular
    values = (u.x, u.y, u.z, v.x, v.y, v.z)
    return values if any(values) else ZERO6


def _posture(posture: Message) -> Posture:
    names, values = posture.posture_joint_names, posture.posture_joint_values
    if not names and not values:
        return _NO_POSTURE
    return Posture(names=tuple(names), values=tuple(values))


def _segments(message: Message) -> tuple[Segment, ...]:
    return tuple(_segment(each, f'segments[{i}]') for i, each in enumerate(message.segments))


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
