# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The functions that programs call, one class for each of their subjects.

Each public method of a class is one function: parameter names and defaults are those of the
robot's manual, because programs pass arguments by these names.
"""

from __future__ import annotations

from collections.abc import Mapping
import functools
import inspect
from typing import Any, TYPE_CHECKING

from ur_cartesian_driver.sim.builtins.arguments import builtins_in
from ur_cartesian_driver.sim.builtins.io_builtins import (
    AnalogBuiltins,
    DigitalBuiltins,
    PortBuiltins,
    RegisterBuiltins,
)
from ur_cartesian_driver.sim.builtins.kinematics_builtins import KinematicsBuiltins
from ur_cartesian_driver.sim.builtins.motion_builtins import ModeBuiltins, MotionBuiltins
from ur_cartesian_driver.sim.builtins.pose_builtins import PoseBuiltins
from ur_cartesian_driver.sim.builtins.process_builtins import PathOffsetBuiltins, ProcessBuiltins
from ur_cartesian_driver.sim.builtins.robot_builtins import (
    PendantBuiltins,
    RobotBuiltins,
    TimeBuiltins,
)
from ur_cartesian_driver.sim.builtins.socket_builtins import SocketBuiltins
from ur_cartesian_driver.urscript import core_builtins
from ur_cartesian_driver.urscript.script_errors import RuntimeException

if TYPE_CHECKING:
    from ur_cartesian_driver.sim.controller import Controller

Builtins = Mapping[str, Any]


def controller_builtins(controller: Controller) -> Builtins:
    """Return all functions of a primary program."""
    groups = (
        DigitalBuiltins(controller.io),
        AnalogBuiltins(controller.io),
        RegisterBuiltins(controller.io),
        KinematicsBuiltins(controller),
        ModeBuiltins(controller),
        MotionBuiltins(controller),
        PathOffsetBuiltins(controller),
        PortBuiltins(controller.io),
        PoseBuiltins(),
        ProcessBuiltins(controller),
        SocketBuiltins(controller.sockets, lambda: controller.time),
        PendantBuiltins(controller),
        RobotBuiltins(controller),
        TimeBuiltins(controller),
    )
    found = dict(core_builtins())
    for group in groups:
        found |= builtins_in(group)
    return found


def refuse_timed_functions(builtins: Builtins) -> Builtins:
    """Return the functions of a secondary program: what takes time raises."""
    return {
        name: _refusing_function(name, function)
        if inspect.isgeneratorfunction(function)
        else function
        for name, function in builtins.items()
    }


def _refusing_function(name: str, function: Any) -> Any:
    @functools.wraps(function)
    def refuse(*arguments: Any, **named: Any) -> None:
        raise RuntimeException(f'{name} takes time, which a secondary program does not have.')

    # The signature stays that of the function; what counts as a generator must not.
    refuse.__signature__ = inspect.signature(  # type: ignore[attr-defined]  # all have it
        function
    )
    del refuse.__wrapped__
    return refuse
