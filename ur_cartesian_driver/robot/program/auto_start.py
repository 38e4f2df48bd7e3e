# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Starts the robot program once, on the first connection: when the arm is ready and no program runs.

Later the driver starts nothing by itself: a person who has switched the robot on, or has stopped
it, decides when the program may run.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from ur_cartesian_driver.motion.state.rtde_state import RobotMode, RobotState, RobotStatus
from ur_cartesian_driver.robot.connection_status import (
    ConnectionStatus,
    has_ended,
    UNPOWERED_MODES,
)
from ur_cartesian_driver.robot.lifecycle import ConnectionState
from ur_cartesian_driver.robot.link_settings import LinkSettings

#: Longest time for switching the arm on [s].
POWER_UP_TIMEOUT = 30.0


class ProgramAutoStart:
    """Uploads the program at most once, on the first connection."""

    def __init__(
        self,
        settings: LinkSettings,
        *,
        pending: bool,
        power_up: Callable[[], bool],
        upload: Callable[[], None],
        warn: Callable[[str], None],
    ) -> None:
        """
        Prepare; nothing happens before :meth:`review`.

        :param pending: whether the program may be started on the first connection.
        :param power_up: switches the arm on and releases its brakes; returns False if
            there is no connection.
        :param upload: sends the robot program.
        :param warn: called with a line for the log.
        """
        self._settings = settings
        self._pending = pending
        self._power_up, self._upload, self._warn = power_up, upload, warn
        self._powering_up = False

    def review(
        self, robot: RobotState, status: ConnectionStatus, *, program_connected: bool
    ) -> None:
        """Start the program as soon as the robot is accepted, or log why it is not started."""
        if not self._pending or status.state not in (
            ConnectionState.CONNECTED,
            ConnectionState.STOPPED,
        ):
            return
        if self._is_waiting_for_power(robot, status):
            return
        self._pending = False
        if not self._settings.headless_mode or program_connected:
            return
        if status.state is ConnectionState.STOPPED or robot.robot_mode is not RobotMode.RUNNING:
            self._warn(f'the robot program is not started: {status.message}')
        elif robot.robot_status & RobotStatus.PROGRAM_RUNNING or not has_ended(robot):
            self._warn(
                'the robot program is not started: another program runs on the robot, or '
                'is paused; stop it, then call resend_robot_program'
            )
        else:
            self._upload()

    def _is_waiting_for_power(self, robot: RobotState, status: ConnectionStatus) -> bool:
        """Switch the arm on if auto_power is set; return whether the program has to wait."""
        s = self._settings
        if (
            not (s.auto_power and s.headless_mode)
            or robot.robot_mode not in UNPOWERED_MODES
            or status.state is ConnectionState.STOPPED
        ):
            return False
        if not self._powering_up and self._power_up():
            self._powering_up = True
            self._warn('auto_power: the arm is switched on and its brakes are released')
            asyncio.get_running_loop().call_later(POWER_UP_TIMEOUT, self._give_up_power)
        return True

    def _give_up_power(self) -> None:
        """Give up the start if the arm is not running yet."""
        if self._pending:
            self._pending = False
            self._warn(
                f'auto_power: the arm is not running after {POWER_UP_TIMEOUT:g} s; '
                'is the robot in remote control?'
            )
