# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Times, poses and vectors of ROS messages, in both directions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

from builtin_interfaces.msg import Duration
from geometry_msgs.msg import Point, Quaternion, Vector3
from geometry_msgs.msg import Pose as PoseMessage

from ur_cartesian_driver.motion.pose import Pose

#: Generated message classes carry no types.
Message: TypeAlias = Any

_MAX_SECONDS = 2**31 - 1


def nanoseconds(time: Message) -> int:
    """Return a ``Duration`` or ``Time`` in nanoseconds."""
    return int(time.sec) * 1_000_000_000 + int(time.nanosec)


def seconds(time: Message) -> float:
    """Return a ``Duration`` or ``Time`` in seconds, rounded once, so nanoseconds survive."""
    return nanoseconds(time) / 1_000_000_000


def duration_message(time: float) -> Duration:
    """Return seconds to the nearest nanosecond; infinity becomes the largest duration."""
    sec, nanosec = divmod(round(min(time, _MAX_SECONDS) * 1_000_000_000), 1_000_000_000)
    return Duration(sec=sec, nanosec=nanosec)


def pose_from_message(pose: Message) -> Pose:
    """Return a ``geometry_msgs/Pose`` unchanged: not normalized, not checked."""
    p, q = pose.position, pose.orientation
    return Pose((p.x, p.y, p.z), (q.x, q.y, q.z, q.w))


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
