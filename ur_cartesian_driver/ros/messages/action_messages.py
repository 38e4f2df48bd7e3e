# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Feedback and result of the action.

Feedback is expressed in the frame of the goal and describes its controlled frame. NaN stands for
values that are not known: the jerk, and the acceleration if the robot does not report it.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import isnan, nan

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Accel, Twist

from ur_cartesian_driver.action import FollowCartesianTrajectory
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.events import Outcome, PathPlace, Progress
from ur_cartesian_driver.motion.geometry.pose import Pose, pose_error, rotate
from ur_cartesian_driver.motion.geometry.vectors import subtract6, Vector6
from ur_cartesian_driver.msg import CartesianTrajectoryPoint
from ur_cartesian_driver.ros.message_fields import duration_message, pose_message, vector_message

_NAN6: Vector6 = (nan,) * 6


@dataclass(frozen=True, slots=True, kw_only=True)
class FeedbackFrame:
    """The constant part of a goal's feedback messages."""

    frame_id: str
    controlled_frame: str
    T_frame_base: Pose
    joint_names: tuple[str, ...]


def feedback_message(
    progress: Progress, frame: FeedbackFrame, stamp: Time
) -> FollowCartesianTrajectory.Feedback:
    """Return the feedback message of a progress report."""
    message = FollowCartesianTrajectory.Feedback()
    message.header.stamp = stamp
    message.header.frame_id = frame.frame_id
    message.controlled_frame = frame.controlled_frame

    desired = frame.T_frame_base @ progress.desired_pose
    actual = frame.T_frame_base @ progress.actual_pose
    desired_twist = _rotate(frame.T_frame_base, progress.desired_twist)
    actual_twist = _rotate(frame.T_frame_base, progress.actual_twist)
    desired_acceleration = _rotate(frame.T_frame_base, progress.desired_acceleration or _NAN6)
    actual_acceleration = _rotate(frame.T_frame_base, progress.actual_acceleration or _NAN6)
    message.desired = _point(progress.time, desired, desired_twist, desired_acceleration)
    message.actual = _point(progress.time, actual, actual_twist, actual_acceleration)
    message.actual.posture.posture_joint_names = list(frame.joint_names)
    message.actual.posture.posture_joint_values = list(progress.actual_q)
    message.error = _point(
        0.0,
        pose_error(desired, actual),
        subtract6(desired_twist, actual_twist),
        subtract6(desired_acceleration, actual_acceleration),
    )

    message.point_index = progress.waypoint
    message.progress = progress.fraction
    message.speed_scaling = progress.speed_scaling
    message.time_remaining = duration_message(progress.time_remaining)
    message.points_received = progress.points_received
    message.buffered = duration_message(progress.buffered)
    message.lag = progress.lag
    message.path_offset = vector_message(progress.path_offset)
    message.feed_override = progress.feed_override
    return message


def result_message(outcome: Outcome) -> FollowCartesianTrajectory.Result:
    """Return the result message of an outcome."""
    stopped = outcome.stopped
    return FollowCartesianTrajectory.Result(
        error_code=int(outcome.code),
        error_string=outcome.text,
        report=list(outcome.report),
        stopped_point=stopped.point if stopped else 0,
        stopped_fraction=stopped.fraction if stopped else nan,
    )


def outcome_of(result: FollowCartesianTrajectory.Result) -> Outcome:
    """Return the outcome of a result message."""
    stopped = PathPlace(point=result.stopped_point, fraction=result.stopped_fraction)
    return Outcome(
        code=ErrorCode(result.error_code),
        text=result.error_string,
        report=tuple(result.report),
        stopped=None if isnan(stopped.fraction) else stopped,
    )


def _point(
    time: float, pose: Pose, twist: Vector6, acceleration: Vector6
) -> CartesianTrajectoryPoint:
    return CartesianTrajectoryPoint(
        time_from_start=duration_message(time),
        pose=pose_message(pose),
        twist=Twist(linear=vector_message(twist[:3]), angular=vector_message(twist[3:])),
        acceleration=_accel(acceleration),
        jerk=_accel(_NAN6),
    )


def _accel(values: Vector6) -> Accel:
    return Accel(linear=vector_message(values[:3]), angular=vector_message(values[3:]))


def _rotate(T_frame_base: Pose, twist: Vector6) -> Vector6:
    """Return a twist (or acceleration) in the axes of the goal's frame, which does not move."""
    q = T_frame_base.quaternion
    return (*rotate(q, twist[:3]), *rotate(q, twist[3:]))
