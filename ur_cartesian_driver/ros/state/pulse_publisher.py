# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""``~/pulses``: each pulse that the robot program has given, with its time and pose."""

from __future__ import annotations

import contextlib

from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy

from ur_cartesian_driver.driver import Driver
from ur_cartesian_driver.motion.events import Pulse
from ur_cartesian_driver.msg import Pulse as PulseMessage
from ur_cartesian_driver.ros.messages.state_messages import pulse_message
from ur_cartesian_driver.ros.node_endpoints import SHUT_DOWN_ERRORS

#: Reliable, and deep enough for the pulses of some seconds.
PULSES_QOS = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)


class PulsePublisher:
    """Publishes the pulses of the driver, in the driver's thread."""

    def __init__(self, node: Node, driver: Driver, base: str) -> None:
        """
        Start to publish.

        :param base: name of the frame of the robot's base.
        """
        self._clock, self._base = node.get_clock(), base
        self._topic = node.create_publisher(PulseMessage, '~/pulses', PULSES_QOS)
        driver.add_pulse_listener(self._publish)

    def _publish(self, pulse: Pulse) -> None:
        with contextlib.suppress(*SHUT_DOWN_ERRORS):
            self._topic.publish(pulse_message(pulse, self._base, self._clock.now().to_msg()))
