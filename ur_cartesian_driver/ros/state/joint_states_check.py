# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Finds out whether somebody else publishes ``joint_states`` of this arm."""

from __future__ import annotations

from collections.abc import Callable

from builtin_interfaces.msg import Time
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState

#: Number of messages to listen to: enough for every publisher to have sent some.
MESSAGES = 500


class JointStatesCheck:
    """Listens to ``joint_states`` for a while; other arms and grippers may publish there, too."""

    def __init__(self, node: Node, names: tuple[str, ...], is_own: Callable[[Time], bool]) -> None:
        """
        Begin to listen.

        :param is_own: returns whether the node has published a message of this stamp lately.
        """
        self._node, self._names, self._is_own = node, frozenset(names), is_own
        self._left = MESSAGES
        self._subscription = node.create_subscription(
            JointState, 'joint_states', self._receive, qos_profile_sensor_data
        )

    def _receive(self, message: JointState) -> None:
        self._left -= 1
        shared = self._names.intersection(message.name)
        if shared and not self._is_own(message.header.stamp):
            self._warn(min(shared))
            self._left = 0
        if self._left <= 0:
            self._node.destroy_subscription(self._subscription)

    def _warn(self, joint: str) -> None:
        own = self._node.get_fully_qualified_name()
        others = {
            f'{info.node_namespace.rstrip("/")}/{info.node_name}'
            for info in self._node.get_publishers_info_by_topic('joint_states')
        } - {own}
        named = min(others) if len(others) == 1 else 'Another node'
        self._node.get_logger().warning(
            f'{named} publishes joint_states with {joint}, too: subscribers get both. Give the '
            'driver a namespace or a tf_prefix, or remap its topic '
            '(-r joint_states:=/driver_joint_states). A PolyScope X robot with its ROS 2 '
            'interface in the same domain publishes this topic by itself.'
        )
