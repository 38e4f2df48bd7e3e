# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Sets the temporary TCP of a goal, and restores the previous TCP.

The goal decides when to set and when to restore (:mod:`~ur_cartesian_driver.execution`).
"""

from __future__ import annotations

from collections.abc import Callable

from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.state.rtde_state import RobotState, RuntimeState
from ur_cartesian_driver.program.secondary_program import tcp_program
from ur_cartesian_driver.protocol.client_interfaces import primary_messages as primary
from ur_cartesian_driver.protocol.program import script_command
from ur_cartesian_driver.protocol.program.script_command import TcpPersistence
from ur_cartesian_driver.robot.connection_status import is_paused
from ur_cartesian_driver.robot.primary_client import PrimaryClient
from ur_cartesian_driver.robot.program.program_sockets import ProgramSockets

#: States in which a program runs, ours or a foreign one.
_RUNNING_STATES = frozenset({RuntimeState.PLAYING, RuntimeState.PAUSING, RuntimeState.RESUMING})


class TemporaryTcpSetter:
    """Sets a TCP through the robot program, or restores it by a secondary program."""

    def __init__(
        self, program: ProgramSockets, primary_client: PrimaryClient, *, headless_mode: bool
    ) -> None:
        """
        Prepare.

        :param headless_mode: whether we may send programs.
        """
        self._program, self._primary = program, primary_client
        self._headless_mode = headless_mode
        #: The connected robot program has set the temporary TCP, and remembers the previous one.
        self._program_remembers = False

    def set_temporary(self, T_flange_tcp: Pose) -> None:
        """Have the robot program set the TCP for the duration of a goal."""
        self._program_remembers = True
        self._send(T_flange_tcp, TcpPersistence.TEMPORARY)

    def restore(
        self, T_flange_tcp: Pose, robot: RobotState, is_wanted: Callable[[], bool]
    ) -> None:
        """
        Restore the TCP from before a goal.

        The robot program does so if it is connected, not paused, and remembers that TCP exactly.
        Otherwise a secondary program does, if we may send programs and no foreign program runs. If
        we may not send programs, the robot program sets the TCP, rounded as on the wire.

        :param is_wanted: returns whether the TCP still has to be restored and no foreign program
            runs; called again before a repetition, if the first connection was read-only.
        """
        listens = self._program.connected and not is_paused(robot)
        if listens and (self._program_remembers or not self._headless_mode):
            self._send(T_flange_tcp, TcpPersistence.RESTORE)
        elif self._headless_mode and (
            listens or (robot.runtime_state not in _RUNNING_STATES and is_wanted())
        ):
            program = tcp_program(T_flange_tcp.rotation_vector())
            self._primary.send(primary.encode_program(program), is_wanted)

    def program_lost(self) -> None:
        """Forget the TCP that the robot program remembered: the program is gone."""
        self._program_remembers = False

    def _send(self, T_flange_tcp: Pose, persistence: TcpPersistence) -> None:
        self._program.send_command(
            script_command.encode(
                script_command.SetTcpOffsetCommand(
                    offset=T_flange_tcp.rotation_vector(), persistence=persistence
                )
            )
        )
