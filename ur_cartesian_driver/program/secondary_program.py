# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Secondary programs: they run beside the running program, within one step of the controller.

They are used while our own program does not run.
"""

from __future__ import annotations

from ur_cartesian_driver.motion.geometry.vectors import Vector6


def tcp_program(offset: Vector6) -> str:
    """Return the program that sets the TCP to ``x y z rx ry rz`` [m, rad]."""
    numbers = ', '.join(f'{value:.12f}' for value in offset)
    return f'sec ur_cartesian_driver_tcp():\n\tset_tcp(p[{numbers}])\nend\n'
