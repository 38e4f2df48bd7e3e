# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The qualities of service of topics, and who publishes one."""

from __future__ import annotations

from typing import TypeAlias

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

#: Reliable, so that subscribers of either reliability get the topics.
STATE_QOS = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
#: Late subscribers get the last value at once.
LATCHED_QOS = QoSProfile(
    depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
#: Of targets: only the newest one is used, and a lost one is not sent again.
NEWEST_QOS = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
#: The QoS that tf2 requires.
TF_QOS = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE)
#: Ids of endpoints in the ROS graph; none is ever used twice.
Endpoints: TypeAlias = frozenset[tuple[int, ...]]


def feedback_publishers(node: Node, action: str) -> Endpoints:
    """
    Return who publishes the feedback of an action.

    A server that was started again serves under the same names, but with other endpoints.
    """
    found = node.get_publishers_info_by_topic(f'{action}/_action/feedback')
    return frozenset(tuple(each.endpoint_gid) for each in found)
