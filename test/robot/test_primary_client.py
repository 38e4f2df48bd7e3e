# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The primary interface: what the robot says goes to who listens, nonsense ends the connection."""

import asyncio
import contextlib
from math import nan

from virtual_network import HOST, VirtualLoop

from ur_cartesian_driver.protocol.client_interfaces import primary_messages as primary
from ur_cartesian_driver.protocol.client_interfaces.primary_state import KinematicsInfo
from ur_cartesian_driver.robot.primary_client import PrimaryCallbacks, PrimaryClient

PORT = 30001
SIX = (0.0,) * 6


def told_by(*frames):
    """Let a server say something; return what the client tells, until it has hung up or 0.5 s."""
    news = []

    async def scene():
        def note(kind):
            return lambda value: news.append((kind, value))

        client = PrimaryClient(
            PrimaryCallbacks(
                **{
                    kind: note(kind)
                    for kind in ('configuration', 'geometry', 'error', 'connection_error', 'text')
                }
            )
        )
        hung_up = asyncio.Event()

        async def serve(reader, writer):
            writer.write(b''.join(frames))
            with contextlib.suppress(ConnectionError):
                await reader.read()
            writer.close()
            hung_up.set()

        await asyncio.start_server(serve, HOST, PORT)
        holding = asyncio.create_task(client.stay_connected(HOST, PORT))
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(hung_up.wait(), 0.5)
        holding.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await holding

    with asyncio.Runner(loop_factory=VirtualLoop) as runner:
        runner.run(scene())
    return news


def test_kinematics_that_cannot_be_are_refused_with_the_numbers():
    frame = primary.encode_state([KinematicsInfo(theta=SIX, a=(nan, *SIX[1:]), d=SIX, alpha=SIX)])
    (kind, text), *_ = told_by(frame)
    assert kind == 'connection_error'
    assert 'impossible kinematics: The column a of a DH table' in text


def test_a_text_of_the_robot_is_one_line():
    news = told_by(primary.encode_message(primary.TextMessage(text='first\n\x1b[31msecond')))
    assert news[0] == ('text', 'first  [31msecond')
