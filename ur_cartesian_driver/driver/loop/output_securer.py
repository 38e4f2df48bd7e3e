# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Has the outputs of a motion written that its robot program cannot set, and says where not."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
import logging

from ur_cartesian_driver.driver.ipc.driver_config import DriverConfig
from ur_cartesian_driver.driver.loop.owner_pipe import OwnerPipe
from ur_cartesian_driver.motion.events import OutputsSecured
from ur_cartesian_driver.motion.goal.goal import SafeOutput
from ur_cartesian_driver.robot.link import RobotLink
from ur_cartesian_driver.robot.services.output_writer import write_outputs

#: How often and how long a write that failed is repeated [s]; much later nobody expects it.
RETRY_PERIOD, RETRY_TIMEOUT = 0.25, 5.0


class OutputSecurer:
    """Writes one thing after the other: to secure outputs replaces whatever was to be written."""

    def __init__(
        self,
        config: DriverConfig,
        link: RobotLink,
        pipe: OwnerPipe,
        spawn: Callable[[Coroutine[None, None, None]], None],
        on_event: Callable[[OutputsSecured], None],
    ) -> None:
        """
        Begin with nothing to write.

        :param spawn: runs a coroutine beside everything else.
        :param on_event: the outputs were secured, or not, for the motion that runs.
        """
        self._config, self._link, self._pipe = config, link, pipe
        self._spawn, self._on_event = spawn, on_event
        #: Which write is the newest; the others end.
        self._newest = 0
        self._is_pending = False
        #: Values are written one after the other: a late restore must not undo a safe value.
        self._lock = asyncio.Lock()
        #: Why outputs of the motion are not safe.
        self.failure = ''
        self._on_done: Callable[[], None] | None = None

    def secure(self, outputs: tuple[SafeOutput, ...]) -> None:
        """Write the safe values."""
        self._newest += 1
        self._is_pending = True
        self._spawn(self._secure(outputs, self._newest))

    def restore(self, outputs: tuple[SafeOutput, ...]) -> None:
        """Write the values from before a pause."""
        self._newest += 1
        self._spawn(self._restore(outputs, self._newest))

    def forget(self) -> None:
        """Another motion begins: nothing of the one before is written any more."""
        self._newest += 1
        self._is_pending, self.failure = False, ''

    def when_done(self, callback: Callable[[], None]) -> None:
        """Call when the first attempt to secure outputs has ended; at once if none is made."""
        if self._is_pending:
            self._on_done = callback
        else:
            callback()

    async def _secure(self, outputs: tuple[SafeOutput, ...], number: int) -> None:
        loop = asyncio.get_running_loop()
        give_up, is_first = loop.time() + RETRY_TIMEOUT, True
        while number == self._newest:
            async with self._lock:
                result = await self._write(outputs)
            if number != self._newest:
                return
            self.failure = result.failure
            if is_first:
                is_first = False
                self._report(result)
            if not result.failure or loop.time() >= give_up:
                return
            await asyncio.sleep(RETRY_PERIOD)

    def _report(self, result: OutputsSecured) -> None:
        self._is_pending = False
        if result.failure:
            self._link.report_error(result.failure)
        self._on_event(result)
        done, self._on_done = self._on_done, None
        if done is not None:
            done()

    async def _restore(self, outputs: tuple[SafeOutput, ...], number: int) -> None:
        async with self._lock:
            if number != self._newest:
                return
            result = await self._write(outputs)
        if result.failure:
            self._pipe.log(logging.WARNING, f'not restored after the pause: {result.failure}')

    async def _write(self, outputs: tuple[SafeOutput, ...]) -> OutputsSecured:
        return await write_outputs(self._config.robot_ip, self._config.rtde_port, outputs)
