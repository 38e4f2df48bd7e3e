# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Secondary programs: the controller runs them in parallel with its main program, within one step.

The driver uses a secondary program to restore a TCP that the robot program cannot restore.
"""

from __future__ import annotations

from ur_cartesian_driver.motion.geometry.vectors import Vector6


def tcp_program(offset: Vector6) -> str:
    """Return the secondary program that sets the TCP to ``x y z rx ry rz`` [m, rad]."""
    numbers = ', '.join(f'{value:.12f}' for value in offset)
    return f'sec ur_cartesian_driver_tcp():\n\tset_tcp(p[{numbers}])\nend\n'
