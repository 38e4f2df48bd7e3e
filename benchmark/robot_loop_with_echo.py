# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The driver's robot loop with an echo in it, for :mod:`violation_to_cancel`.

It is run in the place of ``ur_cartesian_driver.driver``, with the same arguments, and does the
same. On the same event loop, in the same thread, it answers one more connection, on which whatever
comes is answered with as many bytes as CANCEL has: what the interpreter, asyncio and the system
take from a packet to an answer, in this very process, if nothing is done in between.
"""

from __future__ import annotations

import asyncio
import os
import socket
import sys

from processes import HOST

from ur_cartesian_driver.driver.robot_loop import serve
from ur_cartesian_driver.protocol.reverse import MESSAGE_SIZE

#: The variable of the environment that names the port to dial.
PORT = 'BENCHMARK_ECHO_PORT'


class Echo(asyncio.Protocol):
    """Answers whatever comes with bytes of the size of CANCEL."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Switch off Nagle's delay, as the driver does."""
        assert isinstance(transport, asyncio.Transport)
        transport.get_extra_info('socket').setsockopt(
            socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._transport = transport

    def data_received(self, data: bytes) -> None:
        """Answer."""
        self._transport.write(bytes(MESSAGE_SIZE))


async def _serve(pipe: socket.socket, descriptor: int) -> None:
    await asyncio.get_running_loop().create_connection(Echo, HOST, int(os.environ[PORT]))
    await serve(pipe, descriptor)


if __name__ == '__main__':
    _pipe, _descriptor = (int(argument) for argument in sys.argv[1:])
    with socket.socket(fileno=_pipe) as _connection:
        asyncio.run(_serve(_connection, _descriptor))
