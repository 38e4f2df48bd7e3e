# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The ROS interface: the node, its action, topics, services and parameters, and their messages.

No package of a lower layer imports ROS. A program runs the node like this::

    rclpy.init()
    node = CartesianDriverNode(parameter_overrides={'robot_ip': '192.168.56.101'})
    executor.add_node(node)
"""

from typing import Any, TYPE_CHECKING

if TYPE_CHECKING:
    from ur_cartesian_driver.ros.node import CartesianDriverNode

__all__ = ['CartesianDriverNode']


def __getattr__(name: str) -> Any:
    """Import the node on first use: `python -m` warns if its module is imported already."""
    if name in __all__:
        from ur_cartesian_driver.ros import node

        return getattr(node, name)
    raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
