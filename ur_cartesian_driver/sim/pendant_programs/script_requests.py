# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Requests programs from a script sender over TCP, while the cycles of the controller go on.

An answer has no length and no end mark. As in the URCapX, it is complete when the host hangs up or
has been silent for :data:`SILENCE`. The real URCap of CB3 and PolyScope 5 does not wait at all:
it takes the lines that have arrived, and loses the rest if the host pauses.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
import socket

from ur_cartesian_driver.sim.pendant_programs.external_control import HostAnswer, RequestLimits

#: The request; defined here and in the driver's protocol, which the simulator does not use.
REQUEST = b'request_program\n'
#: Silence of the host after which its answer is complete [s].
SILENCE = 0.1


class _AnswerCollector(asyncio.Protocol):
    """The connection to the host; ``answer`` is set when the answer is complete."""

    def __init__(self, limit: float | None) -> None:
        """
        Prepare.

        :param limit: limit for the first byte [s]; None = no limit.
        """
        self._loop = asyncio.get_running_loop()
        self.answer: asyncio.Future[HostAnswer] = self._loop.create_future()
        self._limit, self._text = limit, bytearray()
        self._timer: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Request the program."""
        assert isinstance(transport, asyncio.WriteTransport)
        transport.write(REQUEST)
        if self._limit is not None:
            self._restart(self._limit, TimeoutError('Connection timeout'))

    def data_received(self, data: bytes) -> None:
        """Keep a part of the answer, and wait for the next part."""
        self._text += data
        self._restart(SILENCE, None)

    def connection_lost(self, exc: Exception | None) -> None:
        """End the answer; a connection that was reset is a failure."""
        self._finish(exc if isinstance(exc, OSError) else None)

    def _restart(self, delay: float, failure: OSError | None) -> None:
        self._stop_timer()
        self._timer = self._loop.call_later(delay, self._finish, failure)

    def _stop_timer(self) -> None:
        if self._timer is not None:
            self._timer.cancel()

    def _finish(self, failure: OSError | None) -> None:
        self._stop_timer()
        if not self.answer.done():
            self.answer.set_result(failure or self._text.decode(errors='replace'))


class ScriptRequests:
    """Requests programs from one host, in tasks of the running event loop."""

    def __init__(self, host: str, port: int, limits: RequestLimits, own_host: str) -> None:
        """
        Prepare.

        :param own_host: the address of the robot. On loopback, requests come from this address, so
            that the host can distinguish several robots on one computer.
        """
        self._host, self._port, self._limits, self._own_host = host, port, limits, own_host
        self._tasks: set[asyncio.Task[None]] = set()
        #: The last program, and the time until which it is used again.
        self._cached: tuple[str, float] | None = None

    def request(self, then: Callable[[HostAnswer], None]) -> None:
        """Request the program; ``then`` is called in the event loop with the answer."""
        loop = asyncio.get_running_loop()
        if self._cached is not None and loop.time() < self._cached[1]:
            then(self._cached[0])
            return

        async def fetch() -> None:
            answer = await self._fetch()
            if isinstance(answer, str) and answer:
                self._cached = answer, loop.time() + self._limits.cache
            then(answer)

        for earlier in self._tasks:  # only the last start of a program counts
            earlier.cancel()
        task = loop.create_task(fetch())
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _fetch(self) -> HostAnswer:
        transport: asyncio.BaseTransport | None = None
        try:
            async with asyncio.timeout(self._limits.connect):
                transport, collector = await asyncio.get_running_loop().create_connection(
                    lambda: _AnswerCollector(self._limits.answer),
                    self._host,
                    self._port,
                    family=socket.AF_INET,
                    local_addr=self._local_address(),
                )
            return await collector.answer
        except UnicodeError as error:  # the name cannot be a host
            return socket.gaierror(socket.EAI_NONAME, str(error))
        except OSError as error:
            return error
        finally:
            if transport is not None:
                transport.close()

    def _local_address(self) -> tuple[str, int] | None:
        both = (self._host, self._own_host)
        on_loopback = all(host.startswith('127.') or host == 'localhost' for host in both)
        return (self._own_host, 0) if on_loopback else None

    async def close(self) -> None:
        """Cancel all requests; their answers are not passed on."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
