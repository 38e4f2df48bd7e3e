# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Restores the TCP that a goal had replaced, when the goal ended before it could."""

from __future__ import annotations

import asyncio
import logging

from ur_cartesian_driver.driver.ipc.channel import TemporaryTcpRestored
from ur_cartesian_driver.driver.loop.owner_pipe import OwnerPipe
from ur_cartesian_driver.execution.goal.temporary_tcp import TemporaryTcp
from ur_cartesian_driver.motion.state.robot_state import RobotState
from ur_cartesian_driver.robot.link import RobotLink


class TcpRestorer:
    """Tries again until the robot reports the TCP; no goal starts before."""

    def __init__(self, link: RobotLink, pipe: OwnerPipe) -> None:
        """Begin with nothing to restore."""
        self._link, self._pipe = link, pipe
        self._pending: TemporaryTcp | None = None

    def restore_later(self, temporary_tcp: TemporaryTcp) -> None:
        """Restore the TCP as soon as the robot program can."""
        self._pending = temporary_tcp
        self._link.set_tcp_restore_pending(True)

    def retry_now(self) -> None:
        """Do not wait for the next attempt: the robot program has connected or gone."""
        if self._pending is not None:
            self._pending.retry_now()

    def observe(self, state: RobotState) -> None:
        """Take note of a robot state: restore the TCP if that is due, or be done with it."""
        if self._pending is None:
            return
        self._pending.observe(state, asyncio.get_running_loop().time())
        if self._pending.is_restored:
            self._pending = None
            self._link.set_tcp_restore_pending(False)
            self._pipe.send(TemporaryTcpRestored())
            self._pipe.log(logging.INFO, 'the TCP of the last goal is no longer active')
        else:
            self.restore_if_due(state)

    def restore_if_due(self, state: RobotState | None) -> None:
        """Have the robot restore the TCP, if there is one to restore and it can be done now."""
        now = asyncio.get_running_loop().time()
        if (
            self._pending is not None
            and state is not None
            and self._pending.is_restore_due(state, now)
        ):
            self._link.control.restore_tcp(self._pending.T_flange_original)
