# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""``~/cell_markers`` for RViz: the bodies of the cell, and the newest goal's collision."""

from __future__ import annotations

import contextlib

from rclpy.node import Node
from visualization_msgs.msg import MarkerArray

from ur_cartesian_driver.driver import Driver
from ur_cartesian_driver.motion.cell.cell import Cell
from ur_cartesian_driver.motion.errors import CollisionPredicted
from ur_cartesian_driver.motion.geometry.pose import IDENTITY
from ur_cartesian_driver.motion.goal.known_frames import BASE
from ur_cartesian_driver.ros.messages.cell_markers import cell_markers, refusal_markers
from ur_cartesian_driver.ros.node_endpoints import LATCHED_QOS, SHUT_DOWN_ERRORS


class CellMarkerPublisher:
    """Publishes the cell of a driver, from any thread."""

    def __init__(self, node: Node, driver: Driver) -> None:
        """Create the publisher, and publish the cell if there is one."""
        self._clock, self._driver = node.get_clock(), driver
        self._topic = node.create_publisher(MarkerArray, '~/cell_markers', LATCHED_QOS)
        self._shows_refusal = False
        if driver.options.cell:
            self.publish()

    def publish(self, refusal: CollisionPredicted | None = None) -> None:
        """
        Publish the cell as it is now, unless the node is shutting down.

        :param refusal: the refusal of the newest goal; the bodies that would touch are also shown
            at the place of the collision, in red. None = show no collision.
        """
        self._shows_refusal = False
        driver, stamp = self._driver, self._clock.now().to_msg()
        cell, prefix = driver.options.cell, driver.options.tf_prefix
        message = cell_markers(cell, prefix, stamp)
        if refusal is not None:
            tcp = IDENTITY if driver.state is None else driver.state.T_flange_tcp
            cell = refusal.cell if isinstance(refusal.cell, Cell) else cell
            red = refusal_markers(refusal, cell, driver.arm, tcp, prefix + BASE, stamp)
            others = [one for one in message.markers if one.ns not in refusal.bodies]
            message.markers = others + red.markers
            self._shows_refusal = True
        with contextlib.suppress(*SHUT_DOWN_ERRORS):
            self._topic.publish(message)

    def forget_refusal(self) -> None:
        """Show no refusal any more, because a newer goal has passed all checks."""
        if self._shows_refusal:
            self.publish()
