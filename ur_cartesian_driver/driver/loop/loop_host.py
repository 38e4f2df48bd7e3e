# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Run the robot loop in its own process, or in a thread; no other module depends on the choice.

The process is not forked, because the owner may be a ROS node with many threads. It inherits the
open descriptors of the pipe and the shared memory. If the process dies, its sockets close and
the robot program stops the arm; if the owner dies, the pipe closes and the loop stops the arm.
"""

from __future__ import annotations

import asyncio
import gc
import os
import socket
import subprocess
import sys
import threading
from typing import Protocol

from ur_cartesian_driver.driver.ipc import state_memory
from ur_cartesian_driver.driver.loop.robot_loop import serve

#: The module that the process runs.
MODULE = 'ur_cartesian_driver.driver'
#: A robot loop that sends nothing for this long [s] counts as hanging: its heartbeats come every
#: 0.5 s.
SILENCE_TIMEOUT = 5.0
#: Longest wait for a robot loop's first message [s]: a new process first imports modules.
START_TIMEOUT = 20.0
#: Time for the robot loop to stop the arm and end, before its process is killed [s].
JOIN_TIMEOUT = 2.0


class LoopHost(Protocol):
    """The host of a robot loop: a process or a thread."""

    #: The owner's end of the pipe, a blocking socket. Its timeout is :data:`START_TIMEOUT`; after
    #: the first message, the owner shortens it to :data:`SILENCE_TIMEOUT`.
    pipe: socket.socket
    #: The owner's view of the newest robot state.
    memory: state_memory.StateMemory

    def join(self) -> None:
        """End the loop, if necessary by killing its process, and release pipe and memory."""


def start(robot_loop: str) -> LoopHost:
    """Start a robot loop in a ``process`` or a ``thread``."""
    return ProcessHost() if robot_loop == 'process' else ThreadHost()


class ProcessHost:
    """The loop in its own process."""

    def __init__(self) -> None:
        """Start the process."""
        self.pipe, loop_end = socket.socketpair()
        self.pipe.settimeout(START_TIMEOUT)
        descriptor = state_memory.create()
        try:
            self._process = subprocess.Popen(
                [sys.executable, '-m', MODULE, str(loop_end.fileno()), str(descriptor)],
                pass_fds=(loop_end.fileno(), descriptor),
                env=_environment(),
                stdin=subprocess.DEVNULL,
                # Only the owner gets a Ctrl-C; it then shuts the loop down.
                start_new_session=True,
            )
            self.memory = state_memory.StateMemory(descriptor)
        finally:
            loop_end.close()
            os.close(descriptor)

    @property
    def pid(self) -> int:
        """Return the process's id."""
        return self._process.pid

    def join(self) -> None:
        """End the process."""
        self.pipe.close()
        try:
            self._process.wait(JOIN_TIMEOUT)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self.memory.close()


class ThreadHost:
    """The loop in a thread of the owner's process."""

    def __init__(self) -> None:
        """Start the thread."""
        self.pipe, loop_end = socket.socketpair()
        self.pipe.settimeout(START_TIMEOUT)
        descriptor = state_memory.create()
        self.memory = state_memory.StateMemory(descriptor)
        self._thread = threading.Thread(
            target=self._run, args=(loop_end, descriptor), name='robot loop', daemon=True
        )
        self._thread.start()

    @staticmethod
    def _run(pipe: socket.socket, descriptor: int) -> None:
        try:
            asyncio.run(serve(pipe, descriptor))
        finally:
            os.close(descriptor)

    def join(self) -> None:
        """End the thread; a hanging thread ends later, because the pipe is closed."""
        self.pipe.close()
        self._thread.join(JOIN_TIMEOUT)
        self.memory.close()


def _environment() -> dict[str, str]:
    """Return an environment in which the process imports this package."""
    path = os.pathsep.join(entry for entry in sys.path if entry)
    return {**os.environ, 'PYTHONPATH': path}


def main() -> None:
    """Run the loop in this process; the arguments are the two descriptors."""
    gc.freeze()  # so that the collector does not scan imported objects in the middle of a motion
    pipe, descriptor = (int(argument) for argument in sys.argv[1:])
    with socket.socket(fileno=pipe) as connection:
        asyncio.run(serve(connection, descriptor))
