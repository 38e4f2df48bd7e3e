# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The newest robot state in the robot loop, and its publication in the shared memory."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from math import inf

from ur_cartesian_driver.driver.ipc.state_memory import StateMemory
from ur_cartesian_driver.motion.state.rtde_state import RobotState


class NewestState:
    """
    Keeps the newest state, and publishes it later.

    A packet may lead to a CANCEL, which must not wait for the shared memory. So a state is
    published after the packet was handled, but before any notification is sent: an owner that gets
    a notification finds the state that belongs to the notification.
    """

    def __init__(self, memory: StateMemory, on_publish: Callable[[RobotState], None]) -> None:
        """
        Begin with no state.

        :param on_publish: called once with each published state.
        """
        self._memory, self._on_publish = memory, on_publish
        self.latest: RobotState | None = None
        self._is_published = True
        self._last_report = inf
        self._longest_gap = self._oldest = 0.0

    def keep(self, state: RobotState) -> None:
        """Keep a state for :meth:`publish`."""
        self.latest, self._is_published = state, False

    def publish(self) -> None:
        """Write the newest state into the shared memory, unless it is there already."""
        if self._is_published or self.latest is None:
            return
        self._is_published = True
        self._memory.write(self.latest)
        self._on_publish(self.latest)
        now = asyncio.get_running_loop().time()
        self._longest_gap = max(self._longest_gap, now - self._last_report)
        self._last_report = now
        self._oldest = max(self._oldest, self.latest.state_age)

    def clear(self) -> None:
        """Publish that there is no state, because the robot is disconnected."""
        self._memory.clear()
        self._last_report = inf

    def take_gap(self) -> float:
        """Return the longest gap between two published states since the last call [s]."""
        gap, self._longest_gap = self._longest_gap, 0.0
        return gap

    def take_oldest(self) -> float:
        """Return the largest age of a state published since the last call [s]."""
        oldest, self._oldest = self._oldest, 0.0
        return oldest
