# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
A simulated UR controller: it interprets any URScript, with no special cases for this driver.

:class:`SimulatedRobot` is a whole robot, on the ports of a real one. :func:`assemble` makes only a
:class:`Controller` and its fault injector, without network and clock, for tests that count cycles.
"""

from typing import TYPE_CHECKING

from ur_cartesian_driver.lazy_names import lazy_names

if TYPE_CHECKING:
    from ur_cartesian_driver.sim.controller import Controller
    from ur_cartesian_driver.sim.controller_assembly import assemble
    from ur_cartesian_driver.sim.pendant_programs.program_tree import (
        ExternalControlNode,
        ProgramTree,
        ScriptText,
    )
    from ur_cartesian_driver.sim.pendant_programs.urp_file import read_urp
    from ur_cartesian_driver.sim.simulated_robot import Ports, RobotSnapshot, SimulatedRobot
    from ur_cartesian_driver.sim.simulator_config import HOME, SimulatorConfig
    from ur_cartesian_driver.sim.sockets.script_sockets import MemorySockets

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

# Lazy, because every command imports the simulator's options but few need the simulator.
__getattr__ = lazy_names(
    __name__,
    {
        'ur_cartesian_driver.sim.controller': 'Controller',
        'ur_cartesian_driver.sim.controller_assembly': 'assemble',
        'ur_cartesian_driver.sim.pendant_programs.program_tree': (
            'ExternalControlNode ProgramTree ScriptText'
        ),
        'ur_cartesian_driver.sim.pendant_programs.urp_file': 'read_urp',
        'ur_cartesian_driver.sim.simulated_robot': 'Ports RobotSnapshot SimulatedRobot',
        'ur_cartesian_driver.sim.simulator_config': 'HOME SimulatorConfig',
        'ur_cartesian_driver.sim.sockets.script_sockets': 'MemorySockets',
    },
)
