# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The robot loop and an owner that does not read its notifications."""

import asyncio
import os
import socket

from ur_cartesian_driver.driver import DriverConfig
from ur_cartesian_driver.driver.ipc import channel
from ur_cartesian_driver.driver.ipc.state_memory import create, StateMemory
from ur_cartesian_driver.driver.loop.owner_pipe import MAX_UNREAD
from ur_cartesian_driver.driver.loop.robot_loop import RobotLoop
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.events import Outcome


def test_an_owner_that_does_not_read_costs_no_memory_and_misses_no_end():
    ended = channel.MotionEnded(motion=1, outcome=Outcome(code=ErrorCode.SUCCESSFUL, text='Done.'))

    async def scene():
        ours, theirs = socket.socketpair()
        _, writer = await asyncio.open_connection(sock=theirs)
        descriptor = create()
        memory = StateMemory(descriptor)
        loop = RobotLoop(channel.Configure(config=DriverConfig()), memory, writer)
        line = channel.LogMessage(level=20, text='x' * 10_000)
        for _ in range(1000):
            loop._pipe.send(line)
        assert writer.transport.get_write_buffer_size() < MAX_UNREAD + 20_000
        loop._pipe.send(ended)
        ours.settimeout(5.0)
        told: list[object] = [line]
        while told[-1] == line:
            told.append(await asyncio.to_thread(channel.receive, ours))
        assert told[-1] == ended
        writer.close()
        ours.close()
        memory.close()
        os.close(descriptor)

    asyncio.run(scene())
