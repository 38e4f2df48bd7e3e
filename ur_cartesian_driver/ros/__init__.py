# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The ROS border: the node, its action, and the way between messages and our own types.

Nothing below this package knows ROS::

    rclpy.init()
    node = CartesianDriverNode(parameter_overrides={'robot_ip': '192.168.56.101'})
    executor.add_node(node)
"""

from typing import Any, TYPE_CHECKING

if TYPE_CHECKING:
    from ur_cartesian_driver.ros.node import CartesianDriverNode

__all__ = ['CartesianDriverNode']


def __getattr__(name: str) -> Any:
    """Load the node when it is asked for: `python -m` of a module here must not load it first."""
    if name in __all__:
        from ur_cartesian_driver.ros import node

        return getattr(node, name)
    raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
