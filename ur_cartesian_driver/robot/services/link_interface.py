# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""What calls need to know of a robot, and the ways to it that belong to others."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Protocol

from ur_cartesian_driver.motion.signals import Signals
from ur_cartesian_driver.motion.state import RobotState
from ur_cartesian_driver.protocol.client_interfaces import primary_messages as primary
from ur_cartesian_driver.protocol.rtde.rtde_packages import ControllerVersion
from ur_cartesian_driver.robot.driver_status import DriverStatus

#: How often an effect is looked for [s].
POLL_PERIOD = 0.02


class LinkInterface(Protocol):
    """What is known of a robot, and the ways to it that belong to others."""

    @property
    def robot(self) -> RobotState | None:
        """What it reported last; None = it is not connected."""

    @property
    def status(self) -> DriverStatus:
        """How far the connection is."""

    @property
    def version(self) -> ControllerVersion | None:
        """Its software; None = it never answered."""

    @property
    def signals(self) -> Signals | None:
        """Its inputs, outputs and payload; None = not reported yet."""

    @property
    def program_connected(self) -> bool:
        """Whether the robot program holds its sockets."""

    @property
    def tcp_restore_pending(self) -> bool:
        """Whether the TCP of a goal is still to be put back."""

    def send_primary(self, command: primary.PrimaryCommand) -> bool:
        """Send a command to the primary interface; False = there is no connection."""

    def send_command(self, data: bytes) -> bool:
        """Send a single command to the robot program; False = it is not there."""

    def upload_program(self) -> None:
        """Upload the robot program."""


async def wait_for_state(
    robot: LinkInterface, predicate: Callable[[RobotState], bool], within: float
) -> bool:
    """
    Wait until the robot reports something; one that is lost may come back.

    :param within: how long [s].
    :returns: whether it was seen.
    """
    loop = asyncio.get_running_loop()
    end = loop.time() + within
    while loop.time() < end:
        state = robot.robot
        if state is not None and predicate(state):
            return True
        await asyncio.sleep(POLL_PERIOD)
    return False


def describe_modes(robot: LinkInterface) -> str:
    """Return what the robot is doing, as the end of a sentence."""
    state = robot.robot
    if state is None:
        return robot.status.message
    return (
        f'robot mode {state.robot_mode.name}, safety mode {state.safety_mode.name}, '
        f'program {state.runtime_state.name}.'
    )
