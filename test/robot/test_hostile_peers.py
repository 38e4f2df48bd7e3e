# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Peers on the robot's network that mean harm: at our ports, and in the place of the robot."""

import asyncio
import contextlib
import re
import struct

from checkout import CHECKOUT, needs_checkout
import pytest
from virtual_network import HOST, VirtualLoop

from ur_cartesian_driver.motion.events import TrajectoryResult
from ur_cartesian_driver.protocol.program.script_sender import REQUEST
from ur_cartesian_driver.protocol.rtde.rtde_client import RtdeClientCodec
from ur_cartesian_driver.protocol.rtde.rtde_packages import ControllerVersion
from ur_cartesian_driver.protocol.rtde.rtde_server import RtdeServerCodec
from ur_cartesian_driver.robot.link_settings import LinkSettings
from ur_cartesian_driver.robot.program.program_sockets import ProgramCallbacks, ProgramSockets
from ur_cartesian_driver.robot.rtde.rtde_connection import RtdeConnection

PROGRAM_PORTS = ('trajectory_port', 'script_command_port', 'reverse_port')
RTDE_PORT = 30004
ATTACKS = {
    'garbage': [bytes(range(256))],
    'a flood': [b'\xff' * 65536] * 20,
    'an HTTP request': [b'GET / HTTP/1.1\r\nHost: x\r\n\r\n'],
    'half of a result': [b'\0\0\0'],
    'nothing': [],
}


async def is_served_as_ever(name, reader, peer):
    """Call after others: when the answer is there, those before have been dealt with."""
    if name == 'script_sender_port':
        peer.write(REQUEST)
        assert await asyncio.wait_for(reader.readline(), 5.0) == b'the program\n'
    else:  # turned away: the program is connected
        with contextlib.suppress(ConnectionError):
            assert await asyncio.wait_for(reader.read(), 5.0) == b''


@pytest.mark.parametrize('attack', ATTACKS)
@pytest.mark.parametrize('hangs_up', [True, False])
def test_a_peer_at_the_ports_does_not_get_between_driver_and_program(attack, hangs_up):
    """It has the robot's address, so that it is heard at all."""

    async def scene():
        results, connected = asyncio.Queue(), asyncio.Event()
        lost = []
        settings = LinkSettings(
            reverse_port=0, trajectory_port=0, script_command_port=0, script_sender_port=0
        )
        sockets = ProgramSockets(
            settings,
            ProgramCallbacks(
                connected=connected.set,
                lost=lost.append,
                result=results.put_nowait,
                contact=results.put_nowait,
                warning=lambda _: None,
            ),
        )
        await sockets.open('127.0.0.1', frozenset({'127.0.0.1'}))
        sockets.text = 'the program'
        program = {}
        for name in PROGRAM_PORTS:
            _, program[name] = await asyncio.open_connection('127.0.0.1', sockets.ports[name])
        await asyncio.wait_for(connected.wait(), 5.0)
        peers = []
        for port in sockets.ports.values():
            _, peer = await asyncio.open_connection('127.0.0.1', port)
            peers.append(peer)
            for data in ATTACKS[attack]:
                peer.write(data)
            if hangs_up:
                peer.transport.abort()
        for name, port in sockets.ports.items():
            reader, peer = await asyncio.open_connection('127.0.0.1', port)
            peers.append(peer)
            await is_served_as_ever(name, reader, peer)
        program['trajectory_port'].write(struct.pack('>i', 0))
        assert await asyncio.wait_for(results.get(), 5.0) is TrajectoryResult.SUCCESS
        assert lost == []
        assert results.empty()
        sockets.close()
        writers = [*peers, *program.values()]
        for writer in writers:
            writer.close()
        await asyncio.gather(*(w.wait_closed() for w in writers), return_exceptions=True)

    asyncio.run(scene())


async def garbage(writer):
    writer.write(bytes(range(256)))


async def an_oversized_package(writer):
    writer.write(struct.pack('>HB', 0xFFFF, 0x55) + b'x' * 70_000)


async def drops(writer):
    """A package that never ends, a byte at a time: each read is in time, the answer is not."""
    writer.write(struct.pack('>HB', 40, ord('M')))
    while True:
        await asyncio.sleep(0.5)
        writer.write(b'x')


async def silence(writer):
    await asyncio.sleep(60.0)


async def hanging_up(writer):
    writer.close()


@pytest.mark.parametrize('answer', [garbage, an_oversized_package, drops, silence, hanging_up])
def test_who_answers_in_the_place_of_the_robot_is_left_within_seconds(answer):
    async def scene():
        async def serve(_, writer):
            try:
                with contextlib.suppress(ConnectionError):
                    await answer(writer)
            finally:
                writer.close()

        await asyncio.start_server(serve, HOST, RTDE_PORT)
        values = []
        connection = RtdeConnection(
            RtdeClientCodec(outputs=['timestamp'], frequency=125.0),
            lambda *packet: values.append(packet),
        )
        begin = asyncio.get_running_loop().time()
        with pytest.raises(OSError, match=f'{RTDE_PORT}'):
            await connection.open(HOST, RTDE_PORT)
        connection.close()
        assert asyncio.get_running_loop().time() - begin < 5.0
        assert values == []

    with asyncio.Runner(loop_factory=VirtualLoop) as runner:
        runner.run(scene())


def test_a_robot_may_take_its_time_for_each_answer():
    # A controller that boots, or one behind a slow network: seven seconds for the handshake.
    async def scene():
        robot = RtdeServerCodec(ControllerVersion(major=5, minor=13, bugfix=0), set())

        async def serve(reader, writer):
            with contextlib.closing(writer):
                while data := await reader.read(4096):
                    robot.feed(data)
                    await asyncio.sleep(1.8)
                    writer.write(robot.data_to_send())

        await asyncio.start_server(serve, HOST, RTDE_PORT)
        connection = RtdeConnection(
            RtdeClientCodec(outputs=['timestamp'], frequency=125.0), lambda *_: None
        )
        assert (await connection.open(HOST, RTDE_PORT)).release == (5, 13, 0)
        connection.close()

    with asyncio.Runner(loop_factory=VirtualLoop) as runner:
        runner.run(scene())


@needs_checkout
def test_each_claim_of_the_security_page_has_the_tests_that_it_names():
    page = (CHECKOUT / 'doc' / 'security.md').read_text(encoding='utf-8')
    named = re.findall(r'`(test/[\w/]+\.py)::(test_\w+)`', page)
    assert len(named) > 20
    assert [
        f'{file}::{test}'
        for file, test in named
        if not (CHECKOUT / file).is_file()
        or f'def {test}(' not in (CHECKOUT / file).read_text(encoding='utf-8')
    ] == []
