# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""``~/servo_state``: the state of the set-point stream, while there is one."""

from __future__ import annotations

import contextlib
from math import inf
from time import monotonic

from rclpy.action.server import RCLError
from rclpy.exceptions import InvalidHandle
from rclpy.node import Node

from ur_cartesian_driver.driver import Driver
from ur_cartesian_driver.motion.state.servo_report import ServoActivity, ServoReport
from ur_cartesian_driver.msg import ServoState
from ur_cartesian_driver.ros.messages.state_messages import servo_state_message
from ur_cartesian_driver.ros.topics import STATE_QOS


class ServoStatePublisher:
    """Publishes the servo reports of the driver, at a limited rate."""

    def __init__(self, node: Node, driver: Driver, rate: float) -> None:
        """
        Start to publish.

        :param rate: the largest rate [Hz], above 0.
        """
        self._clock, self._period, self._due = node.get_clock(), 1.0 / rate, -inf
        self._topic = node.create_publisher(ServoState, '~/servo_state', STATE_QOS)
        driver.add_servo_listener(self._publish)

    def _publish(self, report: ServoReport) -> None:
        """Publish a report, in the driver's thread; never leave out the last one of a stream."""
        now = monotonic()
        if now < self._due and report.activity is not ServoActivity.IDLE:
            return
        self._due = max(self._due + self._period, now)
        # The node, or all of ROS, may have been shut down meanwhile.
        with contextlib.suppress(InvalidHandle, RCLError):
            self._topic.publish(servo_state_message(report, self._clock.now().to_msg()))
