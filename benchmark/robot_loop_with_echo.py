# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The driver's robot loop with an echo in it, for :mod:`violation_to_cancel`.

It replaces ``ur_cartesian_driver.driver``, takes the same arguments, and does the same. On the
same event loop, in the same thread, it serves one more connection, of the same class as the
driver's own, and answers alternately:

* with as many zeros as CANCEL has bytes: the time of interpreter, asyncio and system from a packet
  to an answer, in this process, without work in between;
* with an encoded CANCEL, after reading the packet into a ``RobotState``: the time of any answer
  that depends on the content of the packet.
"""

from __future__ import annotations

import asyncio
import gc
import os
import socket
import sys

from processes import HOST

from ur_cartesian_driver.driver.loop.robot_loop import serve
from ur_cartesian_driver.protocol.program.reverse import MESSAGE_SIZE, trajectory, TrajectoryAction
from ur_cartesian_driver.protocol.rtde.rtde_fields import OUTPUT_TYPES
from ur_cartesian_driver.protocol.rtde.rtde_recipe import Recipe
from ur_cartesian_driver.robot.rtde.state_decoding import robot_state_from_rtde, STATE_FIELDS
from ur_cartesian_driver.robot.transport import dial, TcpConnection

#: Environment variable with the port to connect to.
PORT = 'BENCHMARK_ECHO_PORT'


RECIPE = Recipe(STATE_FIELDS, [OUTPUT_TYPES[name] for name in STATE_FIELDS])
ZEROS = bytes(MESSAGE_SIZE)


class Echo:
    """Answers packets of the robot's state."""

    def __init__(self) -> None:
        """Prepare; :meth:`open` connects."""
        self._connection = TcpConnection(self._answer, lambda _: None)
        self._reads = False

    async def open(self) -> None:
        """Connect to the sender of the packets."""
        await dial(self._connection, HOST, int(os.environ[PORT]))

    def _answer(self, data: bytes) -> None:
        self._reads = not self._reads
        self._connection.send(_read(data) if self._reads else ZEROS)


def _read(data: bytes) -> bytes:
    """Return CANCEL, whatever the robot reports."""
    values = RECIPE.unpack_frame(data)
    assert values is not None
    robot_state_from_rtde(values)
    return trajectory(TrajectoryAction.CANCEL, 1).encode()


async def _serve(pipe: socket.socket, descriptor: int) -> None:
    await Echo().open()
    await serve(pipe, descriptor)


if __name__ == '__main__':
    gc.freeze()
    _pipe, _descriptor = (int(argument) for argument in sys.argv[1:])
    with socket.socket(fileno=_pipe) as _connection:
        asyncio.run(_serve(_connection, _descriptor))
