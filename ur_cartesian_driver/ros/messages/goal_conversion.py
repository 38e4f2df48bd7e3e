# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Conversion of a goal message to a goal with resolved frames.

Only errors of the message itself are refused here: invalid enumerations and unknown frames.
Planning, which does not know messages, makes all other checks.
"""

from __future__ import annotations

from dataclasses import replace

from ur_cartesian_driver.goal_files.goal_reading import (
    enum_member,
    goal_from_fields,
    io_commands,
    nanoseconds,
    rows_of_points,
)
from ur_cartesian_driver.motion.goal.goal import Goal
from ur_cartesian_driver.motion.goal.known_frames import ArmSnapshot, Frames
from ur_cartesian_driver.planning.append.appendable_goal import AppendedPoints, Replacement
from ur_cartesian_driver.ros.message_fields import age_of, Message


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
    :param time_tolerance: the tolerance of a goal whose ``goal_time_tolerance`` is 0 [s].
    :raises InvalidGoal: a frame is unknown, or a number is not in its enumeration; the text names
        the field.
    :raises RobotNotReady: a frame moves with the arm, whose pose is not known.
    """
    trajectory = message.trajectory
    goal = goal_from_fields(message)
    return resolve_frames(
        replace(
            goal,
            age=age_of(trajectory.header.stamp, now),
            goal_time_tolerance=goal.goal_time_tolerance or time_tolerance,
        ),
        trajectory,
        frames,
        now=now,
        snapshot=snapshot,
    )


def appended_points_from_message(message: Message) -> AppendedPoints:
    """
    Return the points of an ``AppendPoints.Request``.

    :raises InvalidGoal: a number is not in its enumeration; the text names the field.
    """
    waypoints, segments = rows_of_points(message, message.points, 'points')
    replacement = enum_member(Replacement, message.replace, 'replace')
    return AppendedPoints(
        waypoints=waypoints,
        segments=segments,
        io_commands=io_commands(message),
        last=message.last,
        replace_from_point=message.first_index
        if replacement is Replacement.REPLACE_FROM_POINT
        else None,
        replace_from_time=message.replace_from_time
        if replacement is Replacement.REPLACE_FROM_TIME
        else None,
    )


def resolve_frames(
    goal: Goal, trajectory: Message, frames: Frames, *, now: int, snapshot: ArmSnapshot | None
) -> Goal:
    """
    Return a goal with its frames resolved.

    Transforms of tf2 are taken at the goal's stamp. If the goal has no stamp, or while the stamp
    lies in the future, the newest ones are taken.

    :param trajectory: the ``CartesianTrajectory`` from which the goal was made.
    :param now: time of the node's clock [ns].
    :raises InvalidGoal: a frame is unknown.
    :raises RobotNotReady: a frame moves with the arm, whose pose is not known.
    """
    stamp = nanoseconds(trajectory.header.stamp)
    return frames.resolve(
        goal,
        trajectory.header.frame_id,
        trajectory.controlled_frame,
        snapshot,
        at=stamp if stamp <= now else 0,
    )
