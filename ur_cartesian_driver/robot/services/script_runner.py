# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Runs users' scripts on the robot; the driver does not check their effects.

The controller never confirms that a script has run. A secondary program is assumed to have run if
the robot reports no error for a while, a primary program if some program has run and ended.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable

from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.protocol.client_interfaces.primary_messages import (
    encode_program,
    PrimaryCommand,
)
from ur_cartesian_driver.robot.connection_status import has_ended
from ur_cartesian_driver.robot.link import RobotLink
from ur_cartesian_driver.robot.link_settings import LinkSettings
from ur_cartesian_driver.robot.services.polling import wait_for_state
from ur_cartesian_driver.robot.services.service_calls import (
    failed,
    RunScriptCall,
    ServiceAnswer,
    succeeded,
)
from ur_cartesian_driver.urscript import CompileError, parse

#: Time after the sending of a secondary program in which the robot may report an error [s].
REPORT_TIME = 0.3
#: Longest waits for a primary program to begin, and to end when it is stopped [s].
BEGIN_TIMEOUT, STOP_TIMEOUT = 2.0, 3.0
#: Length [characters] from which a script is parsed in a thread, so that keepalives do not wait.
MIN_THREAD_LENGTH = 1000
#: Longest time without a program between the end of ours and the start of a script [s].
CHANGE_TIME = 0.3


class ScriptRunner:
    """Runs scripts, one at a time."""

    def __init__(
        self,
        settings: LinkSettings,
        link: RobotLink,
        send_program: Callable[[], Awaitable[ServiceAnswer]],
    ) -> None:
        """
        Prepare.

        :param send_program: sends the driver's own program again.
        """
        self._settings, self._link, self._send_program = settings, link, send_program
        self._is_running = False

    async def run(self, call: RunScriptCall) -> ServiceAnswer:
        """Run a script, and answer with the robot's reaction."""
        try:
            kind = await _kind(call.script)
        except CompileError as error:
            return failed(f'The script was not sent: line {error.line}: {error.reason}.')
        if self._link.robot is None:
            return failed(self._link.status.message)
        if self._is_running:
            return failed('Another script runs; wait for its end, then try again.')
        self._is_running = True
        try:
            return await (self._secondary(call) if kind == 'sec' else self._primary(call))
        finally:
            self._is_running = False

    async def _secondary(self, call: RunScriptCall) -> ServiceAnswer:
        begin = self._link.event_log.now
        if not self._link.control.send_script(encode_program(call.script), lambda: True):
            return failed('The script was not sent: the primary interface is not connected.')
        await asyncio.sleep(REPORT_TIME)
        if error := self._link.event_log.robot_error(since=begin):
            return failed(f'The script was sent, and {error.rstrip(".")}.')
        return succeeded('The script was sent, and the robot reports no error.')

    async def _primary(self, call: RunScriptCall) -> ServiceAnswer:
        if not self._settings.headless_mode:
            return failed(
                'A primary program (def) would replace the program on the pendant: it needs '
                'headless_mode. Send a secondary one (sec), or load it on the pendant.'
            )
        link, begin = self._link, self._link.event_log.now
        if refusal := link.control.upload_refusal():
            return failed(f'The script was not sent: {refusal}.')
        if not link.control.send_script(
            encode_program(call.script), lambda: not link.control.upload_refusal()
        ):
            return failed('The script was not sent: the primary interface is not connected.')
        was_connected = link.program.connected
        has_begun = await wait_for_state(link, self._runs_script, BEGIN_TIMEOUT)
        # A short script may have run unseen; the end of our program then shows that it has run.
        has_run = has_begun or (was_connected and not link.program.connected)
        in_time = not has_begun or await self._ends_within(call.timeout)
        if not in_time:
            link.control.send_primary(
                PrimaryCommand.STOP_PROGRAM, lambda: self._runs_script(link.robot)
            )
            await wait_for_state(link, has_ended, STOP_TIMEOUT)
        error = link.event_log.robot_error(since=begin)
        if has_begun and link.program.connected:
            error = error or 'the robot program was sent again before it had ended'
        again = await self._send_program() if not link.program.connected else succeeded('')
        if not in_time:
            error = f'it took longer than {call.timeout:g} s and was stopped'
        after = '' if again.ok else f' The robot program does not run again: {again.text}'
        if error:
            return failed(f'The script was sent, and {error.rstrip(".")}.{after}')
        if not has_run:
            return failed(f'The script was sent, but the robot did not begin it.{after}')
        if after:
            return failed(f'The script was run.{after}')
        return succeeded('The script was run, and the robot program runs again.')

    def _runs_script(self, robot: RobotState | None) -> bool:
        return robot is not None and not (has_ended(robot) or self._link.program.connected)

    async def _ends_within(self, longest: float) -> bool:
        """
        Return whether the script ends, or our program replaces it, within ``longest`` [s].

        Before the script starts, no program runs for up to :data:`CHANGE_TIME`; this is not taken
        for the end of the script.
        """
        end = asyncio.get_running_loop().time() + longest
        while (left := end - asyncio.get_running_loop().time()) > 0.0:
            if await wait_for_state(self._link, lambda robot: not self._runs_script(robot), left):
                await asyncio.sleep(CHANGE_TIME)
                if not self._runs_script(self._link.robot):
                    return True
        return False


async def _kind(script: str) -> str:
    """
    Return the kind of a script, ``def`` or ``sec``.

    :raises CompileError: the script is not a program.
    """
    if len(script) < MIN_THREAD_LENGTH:
        return parse(script).kind
    return (await asyncio.to_thread(parse, script)).kind
