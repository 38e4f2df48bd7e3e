# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Find out whose program runs on the robot, and whether it reads messages."""

from __future__ import annotations

import asyncio
from math import inf

from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.protocol.program.registers import PROGRAM_VERSION
from ur_cartesian_driver.robot.connection_status import has_ended, is_paused
from ur_cartesian_driver.robot.program.program_sockets import ProgramSockets

#: Time for which the robot has to report that no program runs before the sockets are closed [s].
DEAD_PROGRAM_TIMEOUT = 0.5
#: Time in which our own program proves its identity after connecting [s].
IDENTITY_TIMEOUT = 0.5
#: The remedy if a feature needs our own program; the end of a sentence.
NEEDS_OWN_PROGRAM = (
    "for which the robot has to run this driver's program, and the running program has not "
    'identified itself as ours; call resend_robot_program (headless_mode), or play a program '
    'whose External Control node fetches it from here.'
)


class ProgramTracker:
    """Compares the robot's reports with the sockets that its program holds."""

    def __init__(self, sockets: ProgramSockets) -> None:
        """Begin with no program."""
        self._sockets = sockets
        #: Whether the connected program was told to end.
        self.is_ending = False
        #: Whether the running program has connected to us, even if it has hung up since.
        self._has_called = False
        #: Whether the connected program may have ended while the robot sent no states. Its sockets
        #: may still look connected then, and another program may run.
        self._may_have_ended = False
        #: The robot's time [s] of its first report that no program runs although one is connected;
        #: inf = it does not report this now.
        self._dead_since = inf
        self._has_shown_itself = False
        #: The newest reported count of the robot program's connections; the count that was newest
        #: when the present program connected.
        self._run = self._run_at_connection = 0
        #: Set when it is known whether the program is ours: it has shown itself, or is gone.
        self._identified = asyncio.Event()
        self._connected_at = -inf

    @property
    def is_own(self) -> bool:
        """Return whether the connected program has proved that we rendered it."""
        return self._sockets.connected and self._has_shown_itself

    def program_connected(self) -> None:
        """Require a new proof of identity, which a program has to give on each connection."""
        self.is_ending = self._may_have_ended = False
        self._run_at_connection = self._run
        self._connected_at = asyncio.get_running_loop().time()
        self._forget_identity()

    def program_lost(self) -> None:
        """End the wait for a proof of identity, because the program is gone."""
        self._identified.set()

    def robot_lost(self) -> None:
        """
        Forget the robot's reports about its program, because another one can start unseen.

        The count of connections stays: a program that connects meanwhile proves itself by raising
        it.
        """
        self._has_called, self._may_have_ended = False, True
        self._dead_since = inf
        self._forget_identity()

    def _forget_identity(self) -> None:
        self._has_shown_itself = False
        self._identified.clear()

    async def wait_for_identity(self) -> bool:
        """Return whether the connected program is ours, as soon as that is known."""
        try:
            async with asyncio.timeout_at(self._connected_at + IDENTITY_TIMEOUT):
                await self._identified.wait()
        except TimeoutError:
            pass
        return self.is_own

    def observe(self, robot: RobotState) -> None:
        """Process a state; disconnect a program that has ended without closing its sockets."""
        sockets = self._sockets
        sockets.ended = ended = has_ended(robot)
        if not (sockets.connected and ended):
            self._dead_since = inf
        else:
            self._dead_since = min(self._dead_since, robot.timestamp)
            if robot.timestamp - self._dead_since > DEAD_PROGRAM_TIMEOUT:
                sockets.drop('the robot reports that no program runs')
        if ended:
            self._has_called = False
        elif sockets.connected:
            self._has_called = not self._may_have_ended
        self._run = robot.program_run
        if (
            sockets.connected
            and not self._has_shown_itself
            and robot.program_run != self._run_at_connection
            and robot.program_version == PROGRAM_VERSION
            and robot.program_number == sockets.program_number
        ):
            self._has_shown_itself = True
            self._identified.set()

    def foreign_program_runs(self, robot: RobotState | None) -> bool:
        """Return whether the robot runs a program that has not connected to us."""
        return (
            robot is not None
            and not has_ended(robot)
            and not self._sockets.connected
            and not self._has_called
        )

    def reads(self, robot: RobotState | None) -> bool:
        """Return whether the program would act on a message now."""
        return (
            robot is not None
            and self._sockets.connected
            and not self.is_ending
            and not is_paused(robot)
            and not has_ended(robot)
        )
