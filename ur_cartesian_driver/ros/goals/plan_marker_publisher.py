# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""``~/plan_markers``: the newest plan, for RViz."""

from __future__ import annotations

import contextlib

from rclpy.action.server import RCLError
from rclpy.exceptions import InvalidHandle
from rclpy.node import Node
from visualization_msgs.msg import MarkerArray

from ur_cartesian_driver.motion.plan.plan import Plan
from ur_cartesian_driver.ros.messages.marker_messages import plan_markers
from ur_cartesian_driver.ros.topics import LATCHED_QOS


class PlanMarkerPublisher:
    """Publishes plans, from any thread."""

    def __init__(self, node: Node, base: str) -> None:
        """
        Create the publisher.

        :param base: the frame of the robot's base.
        """
        self._clock, self._base = node.get_clock(), base
        self._topic = node.create_publisher(MarkerArray, '~/plan_markers', LATCHED_QOS)

    def publish(self, plan: Plan) -> None:
        """Publish a plan, unless the node is shutting down."""
        with contextlib.suppress(InvalidHandle, RCLError):
            self._topic.publish(plan_markers(plan, self._base, self._clock.now().to_msg()))
