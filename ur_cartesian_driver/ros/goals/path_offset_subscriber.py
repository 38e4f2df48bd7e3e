# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
``~/path_offset``: offsets for the running goal, if its ``path_offset`` allows them.

An offset that cannot be followed is ignored with a warning that says why; the previous offset
stays in effect until it is stale. A sensor publishes all the time, so its values between goals are
ignored without a warning.
"""

from __future__ import annotations

from geometry_msgs.msg import Vector3Stamped
from rclpy.node import Node

from ur_cartesian_driver.motion.errors import DriverError, InvalidGoal, shortened
from ur_cartesian_driver.ros.goals.action_server import GoalServer
from ur_cartesian_driver.ros.message_fields import checked_age
from ur_cartesian_driver.ros.node_endpoints import newest_subscription

#: The values of ``frame_id`` that mean the frame of the path.
FRAMES = ('', 'path')
#: How far a stamp may lie in the future, because clocks differ [s].
MAX_STAMP_AHEAD = 0.1
#: Shortest time between two logs of the same warning [s].
WARNING_PERIOD = 2.0


class PathOffsetSubscriber:
    """Passes offsets to the running motion; the node destroys the subscription."""

    def __init__(self, node: Node, server: GoalServer) -> None:
        """Subscribe."""
        self._clock, self._logger, self._server = node.get_clock(), node.get_logger(), server
        self._subscription = newest_subscription(node, Vector3Stamped, '~/path_offset', self._take)

    def _take(self, message: Vector3Stamped) -> None:
        try:
            self.give(message)
        except DriverError as error:
            self._logger.warning(
                f'A message on ~/path_offset is ignored: {error}',
                throttle_duration_sec=WARNING_PERIOD,
            )

    def give(self, message: Vector3Stamped) -> None:
        """
        Pass an offset to the running motion, if there is one.

        :raises DriverError: the offset cannot be followed.
        """
        header, vector = message.header, message.vector
        if header.frame_id not in FRAMES:
            raise InvalidGoal(
                'header.frame_id',
                f"is '{shortened(header.frame_id)}', but offsets are in the frame of the path",
                "leave it empty, or set it to 'path'",
            )
        now = self._clock.now().nanoseconds
        motion = self._server.running_motion
        if motion is None:
            return
        timeout, age = motion.offset_timeout, 0.0
        if timeout is not None:  # a goal without offsets refuses this one below
            age = checked_age(
                header.stamp, now, timeout, 'path_offset.timeout', ahead=MAX_STAMP_AHEAD
            )
        motion.set_path_offset(along=vector.x, across=vector.y, normal=vector.z, age=age)
