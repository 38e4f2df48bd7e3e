# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
What a link has at hand when somebody asks why something ended.

The chronicle (:mod:`~.chronicle`), the robot's last report and the keepalives, read by the clock
of the event loop.
"""

from __future__ import annotations

import asyncio
from math import inf

from ur_cartesian_driver.motion.state import RobotState
from ur_cartesian_driver.robot.chronicle import Chronicle, Pulse, standing
from ur_cartesian_driver.robot.program_sockets import ProgramSockets


class Evidence:
    """What happened lately, and how all stands now."""

    def __init__(self, program: ProgramSockets, timeout: float) -> None:
        """
        Begin with nothing.

        :param program: whose keepalives count.
        :param timeout: how long the robot program waits for one [s].
        """
        self._program, self._timeout = program, timeout
        self._chronicle = Chronicle()
        #: The last report of the robot, also when it is gone.
        self._reported: RobotState | None = None
        #: When the robot reported last, and the longest pause between keepalives until the last
        #: time that somebody asked for it [s].
        self._last_report, self._gap_before = inf, 0.0

    def note(self, text: str, *, is_robot_error: bool = False) -> None:
        """Note what happens now; ``is_robot_error`` marks what the robot says is wrong."""
        self._chronicle.add(text, _now(), is_robot_error=is_robot_error)

    def take_report(self, robot: RobotState) -> None:
        """Take what the robot reports now."""
        self._reported, self._last_report = robot, _now()

    def keepalive_gap(self) -> float:
        """Return the longest pause between two keepalives since the last call [s]."""
        self._gap_before, self._program.longest_gap = self._program.longest_gap, 0.0
        return self._gap_before

    def chain(self) -> tuple[str, ...]:
        """Return what led to what has just ended, the first thing first, and how all stands."""
        return (*self._chronicle.lines(_now()), *standing(self._reported, self.pulse()))

    def robot_error(self) -> str:
        """Return what the robot itself said lately is wrong; empty when it said nothing."""
        return self._chronicle.robot_error(_now())

    def pulse(self) -> Pulse:
        """Return how the two sides have heard of each other until now."""
        now = _now()
        return Pulse(
            report=now - self._last_report,
            sign=now - self._program.last_keepalive,
            longest=max(self._gap_before, self._program.longest_gap),
            timeout=self._timeout,
        )


def _now() -> float:
    return asyncio.get_running_loop().time()
