# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Whose program runs on the robot, and whether it reads what it is sent."""

from __future__ import annotations

from math import inf

from ur_cartesian_driver.motion.robot_state import RobotState
from ur_cartesian_driver.robot.connection_status import has_ended, is_paused
from ur_cartesian_driver.robot.program.program_sockets import ProgramSockets

#: How long a program may hold its sockets after the robot has reported its end [s].
DEAD_PROGRAM_TIMEOUT = 0.5


class ProgramTracker:
    """Compares what the robot reports with the sockets that its program holds."""

    def __init__(self, sockets: ProgramSockets) -> None:
        """Begin with no program."""
        self._sockets = sockets
        #: The program that is connected was told to end.
        self.is_ending = False
        #: The program that runs has called us, even if it has hung up since.
        self._is_ours = False
        #: Since when the robot reports that no program runs while one is connected [s].
        self._dead_since = inf

    def observe(self, robot: RobotState) -> None:
        """Take what the robot reports; hang up on a program that has ended without a word."""
        sockets = self._sockets
        sockets.ended = ended = has_ended(robot)
        if not (sockets.connected and ended):
            self._dead_since = inf
        else:
            self._dead_since = min(self._dead_since, robot.timestamp)
            if robot.timestamp - self._dead_since > DEAD_PROGRAM_TIMEOUT:
                sockets.drop('the robot reports that no program runs')
        if ended:
            self._is_ours = False
        elif sockets.connected:
            self._is_ours = True

    def foreign_program_runs(self, robot: RobotState | None) -> bool:
        """Tell whether a program runs that has not called us."""
        return (
            robot is not None
            and not has_ended(robot)
            and not self._sockets.connected
            and not self._is_ours
        )

    def reads(self, robot: RobotState | None) -> bool:
        """Tell whether the program would act now on what it is sent."""
        return (
            robot is not None
            and self._sockets.connected
            and not self.is_ending
            and not is_paused(robot)
            and not has_ended(robot)
        )
