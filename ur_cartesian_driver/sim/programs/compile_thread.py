# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Compiles programs in parallel with the controller's cycles.

Compiling takes about 7 us per byte, so a large program would delay the cycles by seconds. A thread
therefore compiles the programs, one after the other. The event loop starts each compiled program
between two cycles.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
import gc
from queue import SimpleQueue
import sys
import threading
from typing import TypeVar

T = TypeVar('T')

#: Longest time [s] for which a compiling thread keeps the interpreter lock when a cycle needs the
#: lock; Python's default of 5 ms is longer than a cycle.
SWITCH_INTERVAL = 1e-4
#: If compiling creates more new objects than this, the objects are frozen (``gc.freeze``), because
#: a collection would delay the cycles by a second; reference cycles among them stay in memory.
MAX_NEW_OBJECTS = 100_000


class CompileThread:
    """Does work in a thread and passes the results to an event loop, in the order of the calls."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        """Start the thread."""
        self._loop = loop
        self._jobs: SimpleQueue[Callable[[], None] | None] = SimpleQueue()
        self._pending = 0
        self._closed = False
        self._idle = asyncio.Event()
        self._idle.set()
        # A daemon, so that the process can end while the thread compiles.
        threading.Thread(target=self._run, name='ur-sim compiler', daemon=True).start()

    def compile(self, work: Callable[[], T], then: Callable[[T], None]) -> None:
        """
        Call ``work`` in the thread.

        :param then: called in the event loop, with the result of ``work``.
        """

        def finish(result: T) -> None:
            if self._closed:
                return
            self._pending -= 1
            if not self._pending:
                self._idle.set()
            then(result)

        def job() -> None:
            result = work()
            with suppress(RuntimeError):  # the loop has ended
                self._loop.call_soon_threadsafe(finish, result)

        self._pending += 1
        self._idle.clear()
        self._jobs.put(job)

    async def wait_until_idle(self) -> None:
        """Wait until nothing is being compiled."""
        await self._idle.wait()

    def close(self) -> None:
        """
        Make the thread end after its current program, without waiting for the end.

        Call this in the event loop.
        """
        self._closed = True
        self._jobs.put(None)

    def _run(self) -> None:
        while (job := self._jobs.get()) is not None and not self._closed:
            with _interpreter_for_cycles():
                job()
                if gc.get_count()[0] > MAX_NEW_OBJECTS:
                    gc.freeze()


class _InterpreterForCycles:
    """
    Changes Python's settings during compiling: fast thread switches and no garbage collection.

    Several simulators in one process can compile at the same time: the first to begin changes the
    settings, and the last to end restores the settings.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._users = 0

    @contextmanager
    def __call__(self) -> Iterator[None]:
        with self._lock:
            if not self._users:
                self._before = sys.getswitchinterval(), gc.isenabled()
                sys.setswitchinterval(SWITCH_INTERVAL)
                gc.disable()
            self._users += 1
        try:
            yield
        finally:
            with self._lock:
                self._users -= 1
                if not self._users:
                    interval, collects = self._before
                    sys.setswitchinterval(interval)
                    if collects:
                        gc.enable()


_interpreter_for_cycles = _InterpreterForCycles()
