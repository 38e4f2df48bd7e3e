# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
What a link has at hand when somebody asks why something ended.

The chronicle (:mod:`~.event_log`), the robot's last report and the keepalives, read by the clock
of the event loop.
"""

from __future__ import annotations

import asyncio
from math import inf

from ur_cartesian_driver.motion.state import RobotState
from ur_cartesian_driver.robot.event_log import describe_present, EventLog, LinkTiming
from ur_cartesian_driver.robot.program.program_sockets import ProgramSockets


class LinkEventLog:
    """What happened lately, and how all stands now."""

    def __init__(self, program: ProgramSockets, timeout: float) -> None:
        """
        Begin with nothing.

        :param program: whose keepalives count.
        :param timeout: how long the robot program waits for one [s].
        """
        self._program, self._timeout = program, timeout
        self._event_log = EventLog()
        #: The last report of the robot, also when it is gone.
        self._last_state: RobotState | None = None
        #: When the robot reported last, and the longest pause between keepalives until the last
        #: time that somebody asked for it [s].
        self._last_report, self._last_gap = inf, 0.0

    def note(self, text: str, *, is_robot_error: bool = False) -> None:
        """Note what happens now; ``is_robot_error`` marks what the robot says is wrong."""
        self._event_log.add(text, _now(), is_robot_error=is_robot_error)

    def note_report(self, robot: RobotState) -> None:
        """Take what the robot reports now."""
        self._last_state, self._last_report = robot, _now()

    def keepalive_gap(self) -> float:
        """Return the longest pause between two keepalives since the last call [s]."""
        self._last_gap, self._program.max_keepalive_gap = self._program.max_keepalive_gap, 0.0
        return self._last_gap

    def event_chain(self) -> tuple[str, ...]:
        """Return what led to what has just ended, the first thing first, and how all stands."""
        return (*self._event_log.lines(_now()), *describe_present(self._last_state, self.timing()))

    def robot_error(self) -> str:
        """Return what the robot itself said lately is wrong; empty when it said nothing."""
        return self._event_log.robot_error(_now())

    def timing(self) -> LinkTiming:
        """Return how the two sides have heard of each other until now."""
        now = _now()
        return LinkTiming(
            report=now - self._last_report,
            keepalive=now - self._program.last_keepalive,
            max_gap=max(self._last_gap, self._program.max_keepalive_gap),
            timeout=self._timeout,
        )


def _now() -> float:
    return asyncio.get_running_loop().time()
