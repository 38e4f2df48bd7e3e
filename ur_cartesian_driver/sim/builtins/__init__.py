# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The functions that programs can call, with one class for each subject.

To add a function, add a public method to the class of its subject; a function that needs no robot
belongs to ``urscript/core_builtins.py``. Programs can call every public method of the classes in
:data:`BUILTIN_GROUPS` by the method's name. The parameters of a method have the names and defaults
of the script manual, because programs can pass arguments by name. A function that takes time is a
generator that yields once per controller cycle. A function that only checks its arguments is
marked with `without_effect`. `scripts/make_script_functions.py` makes the page
doc/script_functions.md from the methods, the first lines of their docstrings and these marks.
`test/sim/programs` has at least one program for each function.
"""

from __future__ import annotations

from ur_cartesian_driver.sim.builtins.builtin_group import BuiltinGroup
from ur_cartesian_driver.sim.builtins.conveyor_builtins import ConveyorBuiltins
from ur_cartesian_driver.sim.builtins.dynamics_builtins import DynamicsBuiltins
from ur_cartesian_driver.sim.builtins.installation_builtins import (
    EuromapBuiltins,
    InstallationBuiltins,
    StoredSettingsBuiltins,
)
from ur_cartesian_driver.sim.builtins.io_builtins import (
    AnalogBuiltins,
    DigitalBuiltins,
    PortBuiltins,
    RegisterBuiltins,
)
from ur_cartesian_driver.sim.builtins.kinematics_builtins import KinematicsBuiltins
from ur_cartesian_driver.sim.builtins.modbus_builtins import ModbusBuiltins
from ur_cartesian_driver.sim.builtins.motion_builtins import ModeBuiltins, MotionBuiltins
from ur_cartesian_driver.sim.builtins.pendant_builtins import PendantBuiltins
from ur_cartesian_driver.sim.builtins.pose_builtins import PoseBuiltins
from ur_cartesian_driver.sim.builtins.process_builtins import PathOffsetBuiltins, ProcessBuiltins
from ur_cartesian_driver.sim.builtins.robot_builtins import RobotBuiltins, TimeBuiltins
from ur_cartesian_driver.sim.builtins.rpc_builtins import RpcBuiltins
from ur_cartesian_driver.sim.builtins.socket_builtins import SocketBuiltins
from ur_cartesian_driver.sim.controller import Controller
from ur_cartesian_driver.sim.programs.timed_function_guard import Builtins
from ur_cartesian_driver.urscript import core_builtins

BUILTIN_GROUPS: tuple[type[BuiltinGroup], ...] = (
    AnalogBuiltins,
    ConveyorBuiltins,
    DigitalBuiltins,
    DynamicsBuiltins,
    EuromapBuiltins,
    InstallationBuiltins,
    KinematicsBuiltins,
    ModbusBuiltins,
    ModeBuiltins,
    MotionBuiltins,
    PathOffsetBuiltins,
    PendantBuiltins,
    PortBuiltins,
    PoseBuiltins,
    ProcessBuiltins,
    RegisterBuiltins,
    RobotBuiltins,
    RpcBuiltins,
    SocketBuiltins,
    StoredSettingsBuiltins,
    TimeBuiltins,
)


def controller_builtins(controller: Controller) -> Builtins:
    """Return all functions that a primary program can call, the language's own included."""
    found = dict(core_builtins())
    for group in BUILTIN_GROUPS:
        found |= group(controller).functions()
    return found
