# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Restore the original TCP if a goal that had set another TCP ended without restoring it."""

from __future__ import annotations

import asyncio
import logging

from ur_cartesian_driver.driver.ipc.channel import TemporaryTcpRestored
from ur_cartesian_driver.driver.loop.owner_pipe import OwnerPipe
from ur_cartesian_driver.execution.goal.temporary_tcp import TemporaryTcp
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.robot.link import RobotLink


class TcpRestorer:
    """Retries until the robot no longer reports the temporary TCP; no goal starts before that."""

    def __init__(self, link: RobotLink, pipe: OwnerPipe) -> None:
        """Begin with nothing to restore."""
        self._link, self._pipe = link, pipe
        self._pending: TemporaryTcp | None = None

    def restore_later(self, temporary_tcp: TemporaryTcp) -> None:
        """Restore the original TCP as soon as the robot program can."""
        self._pending = temporary_tcp
        self._link.set_tcp_restore_pending(True)

    def retry_now(self) -> None:
        """Make the next attempt at once, because the robot program has started or ended."""
        if self._pending is not None:
            self._pending.retry_now()

    def observe(self, state: RobotState) -> None:
        """Process a robot state: restore the TCP if that is due, or finish if it is restored."""
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
        """Have the robot restore the TCP, if a restore is pending and due."""
        now = asyncio.get_running_loop().time()
        if (
            self._pending is not None
            and state is not None
            and self._pending.is_restore_due(state, now)
        ):
            self._link.control.restore_tcp(self._pending.T_flange_original)
