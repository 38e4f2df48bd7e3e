# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Convert times, poses and vectors to and from ROS messages; find message classes by name."""

from __future__ import annotations

from collections.abc import Sequence
import importlib
from typing import Any

from builtin_interfaces.msg import Duration, Time
from geometry_msgs.msg import Point, Quaternion, Vector3
from geometry_msgs.msg import Pose as PoseMessage

from ur_cartesian_driver.goal_files.goal_reading import nanoseconds, pose_from_message, seconds
from ur_cartesian_driver.goal_files.goal_schema import Message
from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.geometry.pose import Pose

__all__ = [
    'AT_END',
    'Message',
    'age_of',
    'checked_age',
    'class_of',
    'duration_message',
    'nanoseconds',
    'pose_from_message',
    'pose_message',
    'quaternion_message',
    'seconds',
    'vector_message',
]

_MAX_SECONDS = 2**31 - 1
#: The ``first_index`` of an append request that means: after the last point of the goal.
AT_END = 2**32 - 1


def age_of(stamp: Time, now: int) -> float | None:
    """Return the age of a stamp [s] at a time [ns]; None if the stamp is zero (not given)."""
    sent = nanoseconds(stamp)
    return None if sent == 0 else (now - sent) / 1_000_000_000


def checked_age(stamp: Time, now: int, max_age: float, bound: str, *, ahead: float) -> float:
    """
    Return the age of a message [s]; 0 if its stamp is 0 or in the future.

    :param now: time of the node's clock [ns].
    :param max_age: largest age [s].
    :param bound: the name of ``max_age`` in error messages.
    :param ahead: how far the stamp may lie in the future [s], because clocks differ.
    :raises InvalidGoal: the stamp is too old, or too far in the future.
    """
    age = age_of(stamp, now) or 0.0
    if not -ahead <= age <= max_age:
        raise InvalidGoal(
            'header.stamp',
            f'is {abs(age):.3f} s {"old" if age > 0.0 else "in the future"}, '
            f'{bound} is {max_age:g} s',
            'compare the clocks of both computers, or leave the stamp 0: then the age counts '
            'from the receipt',
        )
    return max(0.0, age)


def duration_message(time: float) -> Duration:
    """Return seconds as a duration, rounded to 1 ns; infinity becomes the largest duration."""
    sec, nanosec = divmod(round(min(time, _MAX_SECONDS) * 1_000_000_000), 1_000_000_000)
    return Duration(sec=sec, nanosec=nanosec)


def pose_message(pose: Pose) -> PoseMessage:
    """Return a pose as a message."""
    x, y, z = pose.position
    return PoseMessage(
        position=Point(x=x, y=y, z=z), orientation=quaternion_message(pose.quaternion)
    )


def quaternion_message(quaternion: Sequence[float]) -> Quaternion:
    """Return a quaternion x, y, z, w as a message."""
    x, y, z, w = quaternion
    return Quaternion(x=x, y=y, z=z, w=w)


def vector_message(vector: Sequence[float]) -> Vector3:
    """Return three numbers as a message."""
    x, y, z = vector
    return Vector3(x=x, y=y, z=z)


def class_of(type_name: str) -> Any:
    """
    Return the class of a type such as ``control_msgs/action/FollowJointTrajectory``.

    :returns: the class; None if its package is not installed, or lacks the type.
    :raises Exception: the package is installed but broken; any exception of its import.
    """
    package, kind, name = type_name.split('/')
    module = f'{package}.{kind}'
    try:
        return getattr(importlib.import_module(module), name, None)
    except ModuleNotFoundError as error:
        if error.name not in (package, module):
            raise
        return None
