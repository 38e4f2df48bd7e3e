# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
A simulated UR controller: it interprets the URScript it is sent, on the ports of a real robot.

:class:`SimulatedRobot` is the robot, :class:`SimulatorConfig` what it is. :func:`assemble` makes
its :class:`Controller` without network and clock, for tests that count cycles.
"""

from typing import Any, TYPE_CHECKING

if TYPE_CHECKING:
    from ur_cartesian_driver.sim import (
        assemble,
        Controller,
        ExternalControlNode,
        HOME,
        MemorySockets,
        Ports,
        ProgramTree,
        read_urp,
        RobotSnapshot,
        ScriptText,
        SimulatedRobot,
        SimulatorConfig,
    )

__all__ = [
    'HOME',
    'Controller',
    'ExternalControlNode',
    'MemorySockets',
    'Ports',
    'ProgramTree',
    'RobotSnapshot',
    'ScriptText',
    'SimulatedRobot',
    'SimulatorConfig',
    'assemble',
    'read_urp',
]


def __getattr__(name: str) -> Any:
    """Import the simulator when it is first used: pytest loads our plugin in every project."""
    if name not in __all__:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    from ur_cartesian_driver import sim

    return getattr(sim, name)
