# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Frames of other nodes, from tf2 if it is installed; tf2 is not on PyPI.

A goal is refused if a transform is missing or old: moving to the former place of a part is worse
than not moving.
"""

from __future__ import annotations

from collections.abc import Callable
import importlib
from typing import Protocol

from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.time import Time

from ur_cartesian_driver.motion.errors import InvalidGoal, shortened
from ur_cartesian_driver.motion.geometry.pose import normalize, Pose
from ur_cartesian_driver.ros.message_fields import Message, nanoseconds

#: Longest wait for a transform [s]. Transforms for the present time are published a moment later.
LOOKUP_TIMEOUT = 0.5


class TransformBuffer(Protocol):
    """The part of ``tf2_ros.Buffer`` that is used."""

    def lookup_transform(
        self, target_frame: str, source_frame: str, time: Time, timeout: Duration
    ) -> Message:
        """Return a ``TransformStamped`` that maps coordinates of the source to the target."""


class TransformLookup:
    """Looks up the transforms that goals need."""

    def __init__(
        self,
        buffer: TransformBuffer,
        errors: type[Exception] | tuple[type[Exception], ...],
        *,
        now: Callable[[], int],
        max_age: float,
        close: Callable[[], None] = lambda: None,
    ) -> None:
        """
        Take the buffer to look in.

        :param errors: the exceptions that the buffer raises if it has no transform.
        :param now: the node's clock [ns].
        :param max_age: largest age of the newest transform of a frame [s].
        """
        self._buffer = buffer
        self._errors = errors
        self._now = now
        self._max_age = max_age
        self.close = close

    def T_target_source(self, field: str, target: str, source: str, at: int = 0) -> Pose:
        """
        Return the pose of the source frame in the target frame.

        :param field: the field of the goal, for the text of the refusal.
        :param at: time [ns]; 0 = the newest transform, unless it is too old. Static transforms
            have the stamp 0 and no age.
        :raises InvalidGoal: there is no such transform, or only an old one.
        """
        message = self._lookup(field, target, source, at)
        stamp = nanoseconds(message.header.stamp)
        if at == 0 and stamp != 0:
            self._check_age(field, target, source, stamp)
        return _pose(message.transform)

    def _check_age(self, field: str, target: str, source: str, stamp: int) -> None:
        age = (self._now() - stamp) / 1e9
        if age > self._max_age:
            raise InvalidGoal(
                field,
                f'is "{shortened(source)}", and its newest transform to "{target}" is {age:.3f} s '
                f'old, tf_max_age is {self._max_age:g} s',
                'check why it is not published any more, or raise the parameter',
            )

    def T_static(self, field: str, target: str, source: str) -> Pose:
        """
        Return the pose of the source frame in the target frame, to which it must be fixed.

        :raises InvalidGoal: there is no such transform, or only one that can change.
        """
        message = self._lookup(field, target, source, 0)
        if nanoseconds(message.header.stamp) != 0:
            raise InvalidGoal(
                field,
                f'is "{shortened(source)}", which is not fixed to "{target}": tf2 has only a '
                'transform between them that changes',
                'publish it as a static transform if it '
                'does not, or name it in the parameter static_frames',
            )
        return _pose(message.transform)

    def _lookup(self, field: str, target: str, source: str, at: int) -> Message:
        try:
            return self._buffer.lookup_transform(
                target, source, Time(nanoseconds=at), Duration(seconds=LOOKUP_TIMEOUT)
            )
        except self._errors as error:
            when = ' for the stamp of the goal' if at else ''
            raise InvalidGoal(
                field,
                f'is "{shortened(source)}", and tf2 has no transform from it to "{target}"{when} '
                f'({str(error).replace(source, shortened(source)).rstrip(".")})',
                'check that it is published, or name the frame in the parameter static_frames',
            ) from None


def listen_to_tf(node: Node, max_age: float) -> TransformLookup | None:
    """
    Return a lookup in the transforms that a node receives; None if tf2 is not installed.

    :param max_age: largest age of the newest transform of a frame [s].
    """
    try:
        tf2_ros = importlib.import_module('tf2_ros')
    except ModuleNotFoundError as error:
        if error.name != 'tf2_ros':
            raise
        return None
    buffer = tf2_ros.Buffer()
    listener = tf2_ros.TransformListener(buffer, node)
    return TransformLookup(
        buffer,
        tf2_ros.TransformException,
        max_age=max_age,
        close=listener.unregister,
        now=lambda: int(node.get_clock().now().nanoseconds),
    )


def _pose(transform: Message) -> Pose:
    p, q = transform.translation, transform.rotation
    return Pose((p.x, p.y, p.z), normalize((q.x, q.y, q.z, q.w)))
