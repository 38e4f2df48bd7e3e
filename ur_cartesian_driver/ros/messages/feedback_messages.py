# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Feedback and result of the action.

Feedback is expressed in the frame of the goal and describes its controlled frame. NaN stands for
values that are not known: jerk, and acceleration where the robot does not report it.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import nan

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Accel, Twist, Vector3

from ur_cartesian_driver.action import FollowCartesianTrajectory
from ur_cartesian_driver.motion.events import Outcome, Progress
from ur_cartesian_driver.motion.pose import Pose, pose_error, rotate
from ur_cartesian_driver.motion.vectors import Vector6
from ur_cartesian_driver.msg import CartesianTrajectoryPoint
from ur_cartesian_driver.ros.message_fields import duration_message, pose_message

_NAN6: Vector6 = (nan,) * 6


@dataclass(frozen=True, slots=True, kw_only=True)
class FeedbackFrame:
    """What all feedback messages of a goal share."""

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
        _difference(desired_twist, actual_twist),
        _difference(desired_acceleration, actual_acceleration),
    )

    message.point_index = progress.waypoint
    message.progress = progress.fraction
    message.speed_scaling = progress.speed_scaling
    message.time_remaining = duration_message(progress.time_remaining)
    message.points_received = progress.points_received
    message.buffered = duration_message(progress.buffered)
    message.lag = progress.lag
    return message


def result_message(outcome: Outcome) -> FollowCartesianTrajectory.Result:
    """Return the result message of an outcome."""
    message = FollowCartesianTrajectory.Result()
    message.error_code = int(outcome.code)
    message.error_string = outcome.text
    message.report = list(outcome.report)
    return message


def _point(
    time: float, pose: Pose, twist: Vector6, acceleration: Vector6
) -> CartesianTrajectoryPoint:
    vx, vy, vz, wx, wy, wz = twist
    return CartesianTrajectoryPoint(
        time_from_start=duration_message(time),
        pose=pose_message(pose),
        twist=Twist(linear=Vector3(x=vx, y=vy, z=vz), angular=Vector3(x=wx, y=wy, z=wz)),
        acceleration=_accel(acceleration),
        jerk=_accel(_NAN6),
    )


def _accel(values: Vector6) -> Accel:
    ax, ay, az, ex, ey, ez = values
    return Accel(linear=Vector3(x=ax, y=ay, z=az), angular=Vector3(x=ex, y=ey, z=ez))


def _rotate(T_frame_base: Pose, twist: Vector6) -> Vector6:
    """Return a twist (or acceleration) along the axes of the goal's frame, which stands still."""
    vx, vy, vz, wx, wy, wz = twist
    q = T_frame_base.quaternion
    return (*rotate(q, (vx, vy, vz)), *rotate(q, (wx, wy, wz)))


def _difference(a: Vector6, b: Vector6) -> Vector6:
    u0, u1, u2, u3, u4, u5 = a
    v0, v1, v2, v3, v4, v5 = b
    return (u0 - v0, u1 - v1, u2 - v2, u3 - v3, u4 - v4, u5 - v5)
