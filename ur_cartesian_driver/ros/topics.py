# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Topics: who publishes one."""

from __future__ import annotations

from typing import TypeAlias

from rclpy.node import Node

#: Ids of endpoints in the ROS graph; none is ever used twice.
Endpoints: TypeAlias = frozenset[tuple[int, ...]]


def feedback_publishers(node: Node, action: str) -> Endpoints:
    """
    Return who publishes the feedback of an action.

    A server that was started again serves under the same names, but with other endpoints.
    """
    found = node.get_publishers_info_by_topic(f'{action}/_action/feedback')
    return frozenset(tuple(each.endpoint_gid) for each in found)
