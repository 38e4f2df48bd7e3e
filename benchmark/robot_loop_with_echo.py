# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The driver's robot loop with an echo in it, for :mod:`violation_to_cancel`.

It is run in the place of ``ur_cartesian_driver.driver``, with the same arguments, and does the
same. On the same event loop, in the same thread, it answers one more connection, of the same class
as the driver's own, on which whatever comes is answered with as many bytes as CANCEL has: what the
interpreter, asyncio and the system take from a packet to an answer, in this very process, if
nothing is done in between.
"""

from __future__ import annotations

import asyncio
import os
import socket
import sys

from processes import HOST

from ur_cartesian_driver.driver.robot_loop import serve
from ur_cartesian_driver.protocol.reverse import MESSAGE_SIZE
from ur_cartesian_driver.robot.transport import Connection, dial

#: The variable of the environment that names the port to dial.
PORT = 'BENCHMARK_ECHO_PORT'


async def _serve(pipe: socket.socket, descriptor: int) -> None:
    def answer(_: bytes) -> None:
        echo.send(bytes(MESSAGE_SIZE))

    echo = Connection(answer, lambda _: None)
    await dial(echo, HOST, int(os.environ[PORT]))
    await serve(pipe, descriptor)


if __name__ == '__main__':
    _pipe, _descriptor = (int(argument) for argument in sys.argv[1:])
    with socket.socket(fileno=_pipe) as _connection:
        asyncio.run(_serve(_connection, _descriptor))
