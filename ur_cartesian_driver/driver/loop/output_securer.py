# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Write outputs for a motion whose robot program cannot set them, and report failures."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any

from ur_cartesian_driver.driver.ipc.driver_config import DriverConfig
from ur_cartesian_driver.motion.events import OutputsSecured
from ur_cartesian_driver.motion.goal.goal import SafeOutput
from ur_cartesian_driver.robot.link import RobotLink
from ur_cartesian_driver.robot.services.output_writer import write_outputs

#: Period and total time of the retries of a failed write [s]; a later write could take people
#: by surprise.
RETRY_PERIOD, RETRY_TIMEOUT = 0.25, 5.0


class OutputSecurer:
    """
    Writes the outputs of one order after the other; a new order replaces all unwritten ones.

    An order is one call of :meth:`secure`.
    """

    def __init__(
        self,
        config: DriverConfig,
        link: RobotLink,
        spawn: Callable[[Coroutine[None, None, None]], None],
        on_event: Callable[[OutputsSecured], None],
    ) -> None:
        """
        Begin with nothing to write.

        :param spawn: runs a coroutine concurrently.
        :param on_event: called with the result of securing the running motion's outputs.
        """
        self._config, self._link = config, link
        self._spawn, self._on_event = spawn, on_event
        #: Number of the newest order; number of the first order of this motion.
        self._newest = self._first = 0
        #: Number of orders whose first attempt has not ended.
        self._pending = 0
        #: The changed outputs with their values before the first change, until they are restored.
        self._originals: dict[tuple[int, int], SafeOutput] = {}
        #: Allows only one write at a time.
        self._lock = asyncio.Lock()
        #: Why outputs of the motion are not safe, as a sentence; empty = no failure is known.
        self.failure = ''
        self._on_done: Callable[[], None] | None = None

    def secure(self, outputs: tuple[SafeOutput, ...]) -> None:
        """Write the safe values of outputs, with retries after a failure."""
        self._newest += 1
        self._pending += 1
        self._spawn(self._secure(outputs, self._newest))

    def give_back(self) -> None:
        """Stop writing: the pause has ended, and the robot program restores the values."""
        self._newest += 1
        self._originals = {}

    def forget(self) -> None:
        """Drop the orders of the previous motion, because another motion begins."""
        self._newest += 1
        self._first = self._newest
        self._pending, self._originals, self.failure = 0, {}, ''

    def when_done(self, callback: Callable[[], None]) -> None:
        """Call back after the first attempt to secure outputs; at once if none is pending."""
        if self._pending:
            self._on_done = callback
        else:
            callback()

    async def _secure(self, outputs: tuple[SafeOutput, ...], number: int) -> None:
        loop = asyncio.get_running_loop()
        give_up, is_first = loop.time() + RETRY_TIMEOUT, True
        before: dict[str, Any] = {}
        try:
            while number == self._newest:
                async with self._lock:
                    result = await self._write(outputs, before)
                    if number < self._first:
                        return
                    for output in result.changed:
                        self._originals.setdefault((output.output, output.pin), output)
                if number == self._newest:
                    self.failure = result.failure
                if is_first and result.failure:
                    self._link.report_error(result.failure)
                if is_first or result.changed:
                    originals = tuple(self._originals.values())
                    self._on_event(OutputsSecured(changed=originals, failure=result.failure))
                if is_first:
                    is_first = False
                    self._end_first_attempt(number)
                if not result.failure or loop.time() >= give_up:
                    return
                await asyncio.sleep(RETRY_PERIOD)
        finally:
            if is_first:
                self._end_first_attempt(number)

    def _end_first_attempt(self, number: int) -> None:
        if number < self._first:
            return
        self._pending -= 1
        if not self._pending and self._on_done is not None:
            done, self._on_done = self._on_done, None
            done()

    async def _write(
        self, outputs: tuple[SafeOutput, ...], before: dict[str, Any]
    ) -> OutputsSecured:
        return await write_outputs(self._config.robot_ip, self._config.rtde_port, outputs, before)
