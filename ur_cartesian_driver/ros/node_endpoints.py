# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Common parts of topics, services and timers: QoS, a steady timer, errors during shutdown."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

from rclpy.action.server import RCLError
from rclpy.callback_groups import CallbackGroup, MutuallyExclusiveCallbackGroup
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.exceptions import InvalidHandle
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription
from rclpy.timer import Timer

#: Reliable, because then subscribers of either reliability get the messages.
STATE_QOS = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
#: Late subscribers get the last value at once.
LATCHED_QOS = QoSProfile(
    depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
#: The QoS that tf2 requires.
TF_QOS = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE)
#: Ids of endpoints in the ROS graph; none is ever used twice.
Endpoints: TypeAlias = frozenset[tuple[int, ...]]
#: Raised in our threads while the node, or all of ROS, is being shut down.
SHUT_DOWN_ERRORS = (InvalidHandle, RCLError)


def steady_timer(
    node: Node,
    period: float,
    callback: Callable[[], None],
    group: CallbackGroup | None = None,
) -> Timer:
    """Create a timer whose clock does not stop with simulated time; the period is in [s]."""
    return node.create_timer(
        period, callback, callback_group=group, clock=Clock(clock_type=ClockType.STEADY_TIME)
    )


def newest_subscription(
    node: Node, kind: Any, name: str, callback: Callable[[Any], None]
) -> Subscription:
    """Subscribe to a stream: only its newest message is used, and a lost one is not sent again."""
    return node.create_subscription(
        kind,
        name,
        callback,
        QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT),
        callback_group=MutuallyExclusiveCallbackGroup(),
    )


def feedback_publishers(node: Node, action: str) -> Endpoints:
    """
    Return the ids of the publishers of an action's feedback.

    They tell a restarted server from the one before it: names are equal, ids are not.
    """
    found = node.get_publishers_info_by_topic(f'{action}/_action/feedback')
    return frozenset(tuple(each.endpoint_gid) for each in found)
