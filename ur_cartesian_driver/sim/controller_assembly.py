# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Puts a simulated controller together with its script functions and its fault injector."""

from __future__ import annotations

from typing import NamedTuple

from ur_cartesian_driver.sim.builtins import controller_builtins
from ur_cartesian_driver.sim.controller import Controller
from ur_cartesian_driver.sim.faults.injector import FaultInjector
from ur_cartesian_driver.sim.simulator_config import SimulatorConfig
from ur_cartesian_driver.sim.sockets.script_sockets import ScriptSockets


class Assembly(NamedTuple):
    """A controller that runs programs, and the injector of its faults."""

    controller: Controller
    faults: FaultInjector


def assemble(config: SimulatorConfig, sockets: ScriptSockets | None = None) -> Assembly:
    """
    Return a controller as configured, and an injector without faults; neither has a network.

    :param sockets: the sockets of programs; None = in memory, for tests.
    """
    controller = Controller(config, controller_builtins, sockets)
    controller.faults = faults = FaultInjector(controller)
    return Assembly(controller, faults)
