# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Programs that run beside whatever runs on the robot, within one step of its controller.

They are for what has to be done when our own program is not there to do it.
"""

from __future__ import annotations

from ur_cartesian_driver.motion.pose import Vector6


def tcp_program(offset: Vector6) -> str:
    """Return the program that sets the TCP to ``x y z rx ry rz`` [m, rad]."""
    numbers = ', '.join(f'{value:.12f}' for value in offset)
    return f'sec ur_cartesian_driver_tcp():\n\tset_tcp(p[{numbers}])\nend\n'
