# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Compiles programs beside the controller's cycle.

Compiling takes some 7 us a byte, so a large program would keep the controller from its cycles for
seconds. A thread does it, one program after the other. Compiled programs are
used in the event loop, between two cycles.
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

#: How long a compiling thread may keep the interpreter lock when the cycle wants it [s]; Python's
#: own 5 ms are longer than a cycle.
SWITCH_INTERVAL = 1e-4
#: A program of more objects is never looked through by the garbage collector, which would keep the
#: controller from its cycles for a second; what remains of it when it ends stays in memory.
MAX_NEW_OBJECTS = 100_000


class CompileThread:
    """Runs work in a thread, and what follows from it in an event loop; in the order of calls."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        """Start the thread."""
        self._loop = loop
        self._jobs: SimpleQueue[Callable[[], None] | None] = SimpleQueue()
        self._pending = 0
        self._closed = False
        self._idle = asyncio.Event()
        self._idle.set()
        # A daemon: the process may end while it compiles.
        threading.Thread(target=self._run, name='ur-sim compiler', daemon=True).start()

    def compile(self, work: Callable[[], T], then: Callable[[T], None]) -> None:
        """
        Compile something.

        :param then: called in the event loop, with the result.
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
        End the thread after the program that it compiles, without waiting.

        To be called in the event loop.
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
    While something compiles: switches between threads in time for a cycle, and collects nothing.

    Simulators in one process may compile at once: the first one to begin changes the interpreter,
    the last one to end changes it back.
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
