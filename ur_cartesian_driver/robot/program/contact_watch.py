# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The robot program's watch for contact of the tool, which stops every motion at contact.

START_TOOL_CONTACT begins the watch, and has one answer: contact, or an end without contact after
END_TOOL_CONTACT. A paused program reads END_TOOL_CONTACT only when it resumes, so the answer may
come long after anyone needs it.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable

from ur_cartesian_driver.motion.errors import RobotNotReady
from ur_cartesian_driver.protocol.program import script_command
from ur_cartesian_driver.protocol.program.script_command import ToolContactResult
from ur_cartesian_driver.robot.program.program_sockets import ProgramSockets

#: Longest wait for the answer to END_TOOL_CONTACT [s].
END_TIMEOUT = 1.0


class ContactWatch:
    """Begins and ends watches, one at a time, and passes their outcomes on."""

    def __init__(self, sockets: ProgramSockets, changed: Callable[[bool], None]) -> None:
        """
        Begin without a watch.

        :param changed: called with True when a watch begins, and with False when one ends without
            contact.
        """
        self._sockets, self._changed = sockets, changed
        #: The answer of the program, or the reason why it will not come; None = no watch.
        self._answer: asyncio.Future[ToolContactResult | str] | None = None
        self._ends = asyncio.Event()

    @property
    def is_active(self) -> bool:
        """Whether a watch has begun that the program has not answered yet, ended or not."""
        return self._answer is not None

    def begin(self) -> Awaitable[bool]:
        """
        Begin to watch; the result, awaited, is True at contact and False after :meth:`end`.

        :raises RobotNotReady: at once if the program watches already or does not run; when
            awaited if the watch ended with the program.
        """
        if self.is_active:
            raise RobotNotReady(
                'The robot program watches for contact already; cancel that watch, or play the '
                'program if it is paused.'
            )
        if not self._sockets.send_command(
            script_command.encode(script_command.StartToolContactCommand())
        ):
            raise RobotNotReady('The robot program, which watches for contact, does not run.')
        self._answer = asyncio.get_running_loop().create_future()
        self._ends.clear()
        self._changed(True)
        return self._outcome(self._answer)

    async def _outcome(self, answer: asyncio.Future[ToolContactResult | str]) -> bool:
        ending = asyncio.ensure_future(self._ends.wait())
        try:
            await asyncio.wait((answer, ending), return_when=asyncio.FIRST_COMPLETED)
            await asyncio.wait((answer,), timeout=END_TIMEOUT)
        finally:
            ending.cancel()
        result = answer.result() if answer.done() else ToolContactResult.CANCELED
        if isinstance(result, str):
            raise RobotNotReady(result)
        return result is ToolContactResult.SUCCESS

    def end(self) -> None:
        """End the watch; nothing happens if there is none."""
        if self.is_active and not self._ends.is_set():
            self._ends.set()
            self._sockets.send_command(
                script_command.encode(script_command.EndToolContactCommand())
            )

    def take(self, result: ToolContactResult) -> None:
        """Process the answer of the program; without a watch, nothing happens."""
        self._finish(result)

    def program_lost(self, reason: str) -> None:
        """End the watch with the program."""
        self._finish(f'The watch for contact ended with the robot program: {reason}.')

    def _finish(self, result: ToolContactResult | str) -> None:
        answer, self._answer = self._answer, None
        if answer is not None:
            answer.set_result(result)
            # Contact also ends the running goal, which must still know of the watch when its
            # result comes, perhaps a little later.
            if result is not ToolContactResult.SUCCESS:
                self._changed(False)
