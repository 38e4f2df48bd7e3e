# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""``~/feed_override``: a signal that slows the running goal, if the goal permits it."""

from __future__ import annotations

from rclpy.node import Node
from std_msgs.msg import Float64

from ur_cartesian_driver.ros.goals.action_server import GoalServer
from ur_cartesian_driver.ros.node_endpoints import newest_subscription


class FeedOverrideSubscriber:
    """
    Passes the signal to the running motion; the node destroys the subscription.

    A sensor publishes all the time, so its values between goals, and during goals without feed
    override, are ignored without a warning.
    """

    def __init__(self, node: Node, server: GoalServer) -> None:
        """Subscribe."""
        self._server = server
        self._subscription = newest_subscription(node, Float64, '~/feed_override', self.give)

    def give(self, message: Float64) -> None:
        """Pass a fraction of the planned speed to the running motion."""
        motion = self._server.running_motion
        if motion is not None and motion.feed_problem is None:
            motion.set_feed_override(message.data)
