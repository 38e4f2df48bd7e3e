# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The ports on which the robot calls, called from outside."""

import asyncio
import contextlib
import fcntl
import itertools
import socket
import struct
import termios
import threading
from time import monotonic, sleep
from unittest.mock import Mock

import pytest

from ur_cartesian_driver.motion.events import TrajectoryResult
from ur_cartesian_driver.protocol.program import reverse
from ur_cartesian_driver.protocol.program.script_sender import REQUEST
from ur_cartesian_driver.protocol.rtde.rtde_packages import ControllerVersion
from ur_cartesian_driver.robot import transport
from ur_cartesian_driver.robot.link_settings import LinkSettings
from ur_cartesian_driver.robot.program.program_sockets import ProgramCallbacks, ProgramSockets
from ur_cartesian_driver.robot.transport import (
    MAX_LINES,
    plain_address,
    WARNING_PERIOD,
    WarningLimiter,
)

HOST = '127.0.0.1'
PROGRAM_PORTS = ('trajectory_port', 'script_command_port', 'reverse_port')


class Cell:
    """Open ports, and what was told about them, in order."""

    def __init__(self, **settings):
        self.news = asyncio.Queue()
        tell = self.news.put_nowait
        self.sockets = ProgramSockets(
            LinkSettings(
                reverse_port=0,
                trajectory_port=0,
                script_command_port=0,
                script_sender_port=0,
                **settings,
            ),
            ProgramCallbacks(
                connected=lambda: tell('connected'),
                lost=lambda reason: tell(f'lost, {reason}'),
                result=tell,
                contact=tell,
                warning=lambda text: tell(f'warning, {text}'),
            ),
        )
        self._writers = []

    async def dial(self, name):
        reader, writer = await asyncio.open_connection(HOST, self.sockets.ports[name])
        self._writers.append(writer)
        return reader, writer

    async def connect(self, order=PROGRAM_PORTS):
        program = {name: await self.dial(name) for name in order}
        assert await self.next() == 'connected'
        return program

    async def next(self):
        return await asyncio.wait_for(self.news.get(), 5.0)

    async def close(self):
        self.sockets.close()
        for writer in self._writers:
            writer.close()
        await asyncio.gather(*(w.wait_closed() for w in self._writers), return_exceptions=True)


@contextlib.asynccontextmanager
async def cell(allowed=frozenset(), **settings):
    made = Cell(**settings)
    await made.sockets.open(HOST, allowed)
    try:
        yield made
    finally:
        await made.close()


def test_the_ports_move_with_our_address():
    """A computer that is plugged in elsewhere gets another one, and the program is told that."""

    async def scene():
        async with cell() as here:
            await here.connect()
            before = dict(here.sockets.ports)
            await here.sockets.open(HOST, frozenset())
            assert here.sockets.connected
            assert here.sockets.ports == before
            await here.sockets.open('127.0.0.2', frozenset())
            assert await here.next() == 'lost, the address of the driver is 127.0.0.2 now'
            for port in here.sockets.ports.values():
                _, writer = await asyncio.open_connection('127.0.0.2', port)
                writer.close()

    asyncio.run(scene())


def test_a_program_is_connected_when_it_has_all_sockets():
    async def scene():
        async with cell() as here:
            for name in PROGRAM_PORTS[:2]:
                await here.dial(name)
            assert not here.sockets.connected
            await here.dial(PROGRAM_PORTS[2])
            assert await here.next() == 'connected'
            assert here.sockets.connected

    asyncio.run(scene())


@pytest.mark.parametrize(
    'stale',
    [
        names
        for n in (1, 2)
        for names in itertools.permutations(PROGRAM_PORTS, n)
        if names != PROGRAM_PORTS[:2]
    ],
)
def test_what_a_stranger_holds_makes_way_for_a_program(stale):
    async def scene():
        async with cell() as here:
            readers = [(await here.dial(name))[0] for name in stale]
            program = await here.connect()
            for reader in readers:
                assert await asyncio.wait_for(reader.read(), 5.0) == b''
            here.sockets.send_points(b'points')
            assert await program['trajectory_port'][0].readexactly(6) == b'points'

    asyncio.run(scene())


@pytest.mark.parametrize('name', PROGRAM_PORTS)
def test_the_loss_of_one_socket_is_the_loss_of_all_and_told_once(name):
    async def scene():
        async with cell() as here:
            program = await here.connect()
            program[name][1].close()
            assert await here.next() == f'lost, {name}: the other side closed the connection'
            assert not here.sockets.connected
            for other in set(PROGRAM_PORTS) - {name}:
                assert await asyncio.wait_for(program[other][0].read(), 5.0) == b''
            assert here.news.empty()

    asyncio.run(scene())


def test_the_next_program_finds_the_ports_free():
    async def scene():
        async with cell() as here:
            for _ in range(3):
                program = await here.connect()
                program['reverse_port'][1].close()
                assert (await here.next()).startswith('lost')

    asyncio.run(scene())


def test_a_second_program_is_turned_away_while_the_first_is_connected():
    async def scene():
        async with cell() as here:
            program = await here.connect()
            reader, _ = await here.dial('trajectory_port')
            assert 'is connected already' in await here.next()
            with contextlib.suppress(ConnectionError):
                assert await reader.read() == b''
            here.sockets.send_points(b'points')
            assert await program['trajectory_port'][0].readexactly(6) == b'points'

    asyncio.run(scene())


def test_a_stranger_is_turned_away_with_the_parameter_that_would_let_him_in():
    async def scene():
        async with cell(frozenset({'192.0.2.1'})) as here:
            await here.dial('reverse_port')
            assert 'allowed_peers' in await here.next()

    asyncio.run(scene())


def test_a_flood_of_strangers_is_none_of_lines_and_keeps_the_program():
    async def scene():
        async with cell(frozenset({'192.0.2.1'})) as here:
            readers = [(await here.dial('script_sender_port'))[0] for _ in range(200)]
            for reader in readers:
                with contextlib.suppress(ConnectionError):
                    assert await asyncio.wait_for(reader.read(), 5.0) == b''
            assert here.news.qsize() == MAX_LINES
            assert here.sockets._sender.connection is None

    asyncio.run(scene())


def test_lines_that_were_left_out_are_counted():
    told = []
    complaints = WarningLimiter(told.append)
    for i in range(MAX_LINES + 5):
        complaints.add(f'call {i}', 1.0)
    complaints.add('one more', 1.0 + WARNING_PERIOD)
    assert told[:-1] == [f'call {i}' for i in range(MAX_LINES)]
    assert told[-1] == 'one more (5 more lines like this were left out)'


@pytest.mark.parametrize(
    ('written', 'plain'),
    [
        ('192.0.2.1', '192.0.2.1'),
        ('::ffff:192.0.2.1', '192.0.2.1'),
        ('2001:db8:0::1', '2001:db8::1'),
        ('robot.local', 'robot.local'),
        ('', ''),
    ],
)
def test_an_address_is_the_same_in_each_way_of_writing_it(written, plain):
    assert plain_address(written) == plain


@pytest.mark.parametrize('peer', ['', 'robot.local', '192.0.2.0/24', '192.0.2'])
def test_a_peer_that_is_no_address_is_refused(peer):
    with pytest.raises(ValueError, match=r'allowed_peers has .* which is no IP address'):
        LinkSettings(allowed_peers=(peer,))


def test_a_caller_that_asks_and_does_not_read_is_hung_up_on():
    """Else each request would be a copy of the program in memory."""

    async def scene():
        async with cell() as here:
            here.sockets.text = 'x' * 100_000
            reader, writer = await here.dial('script_sender_port')
            reader._transport.pause_reading()
            writer.write(REQUEST * 300)
            await asyncio.sleep(0.05)
            reader._transport.resume_reading()
            sent = 0
            with contextlib.suppress(ConnectionError):
                while data := await asyncio.wait_for(reader.read(1 << 20), 5.0):
                    sent += len(data)
            assert sent < 300 * 100_001

    asyncio.run(scene())


def test_a_connection_that_is_closed_does_not_wait_for_a_side_that_does_not_read(monkeypatch):
    monkeypatch.setattr(transport, 'LINGER_TIMEOUT', 0.05)

    async def scene():
        async with cell() as here:
            program = await here.connect()
            program['trajectory_port'][0]._transport.pause_reading()
            unread = here.sockets._trajectory.connection._transport
            for _ in range(100):
                here.sockets.send_points(bytes(100_000))
                if unread.get_write_buffer_size():
                    break
            here.sockets.close()
            assert unread.get_write_buffer_size()
            begin = asyncio.get_running_loop().time()
            while unread.get_write_buffer_size():
                await asyncio.sleep(0.01)
                assert asyncio.get_running_loop().time() - begin < 1.0

    asyncio.run(scene())


def test_a_result_may_come_in_pieces():
    async def scene():
        async with cell() as here:
            _, writer = (await here.connect())['trajectory_port']
            for byte in (b'\0', b'\0\0', b'\1', b'\0\0\0\0'):
                writer.write(byte)
                await writer.drain()
            assert await here.next() is TrajectoryResult.CANCELED
            assert await here.next() is TrajectoryResult.SUCCESS

    asyncio.run(scene())


def test_half_a_result_is_forgotten_with_its_program():
    async def scene():
        async with cell() as here:
            _, writer = (await here.connect())['trajectory_port']
            writer.write(b'\0\0\0')
            writer.close()
            assert (await here.next()).startswith('lost, trajectory_port')
            _, writer = (await here.connect())['trajectory_port']
            writer.write(b'\0\0\0\2')
            assert await here.next() is TrajectoryResult.FAILURE

    asyncio.run(scene())


def test_a_number_that_is_no_result_ends_the_connection_with_the_number():
    async def scene():
        async with cell() as here:
            _, writer = (await here.connect())['trajectory_port']
            writer.write(b'\0\0\0\7')
            assert '7 is not a trajectory result' in await here.next()

    asyncio.run(scene())


@pytest.mark.parametrize(
    ('busy', 'mode'), [(False, reverse.ControlMode.IDLE), (True, reverse.ControlMode.FORWARD)]
)
def test_keepalives_are_those_of_what_the_program_does(busy, mode):
    async def scene():
        async with cell() as here:
            reader, _ = (await here.connect())['reverse_port']
            here.sockets.is_executing = busy
            keeping = asyncio.create_task(here.sockets.keep_alive())
            messages = [
                reverse.ReverseMessage.decode(await reader.readexactly(reverse.MESSAGE_SIZE))
                for _ in range(3)
            ]
            keeping.cancel()
            assert {message.mode for message in messages} == {mode}
            assert {message.read_timeout for message in messages} == {200}

    asyncio.run(scene())


def test_closing_tells_the_program_to_stop_first():
    async def scene():
        async with cell() as here:
            reader, _ = (await here.connect())['reverse_port']
            here.sockets.close()
            data = await asyncio.wait_for(reader.read(), 5.0)
            assert reverse.ReverseMessage.decode(data).mode is reverse.ControlMode.STOPPED

    asyncio.run(scene())


def test_the_program_is_served_to_a_request_in_pieces_and_to_the_next_caller():
    async def scene():
        async with cell() as here:
            here.sockets.text = 'the program'
            reader, writer = await here.dial('script_sender_port')
            writer.write(b'request_')
            await writer.drain()
            writer.write(b'program\nrequest_program\n')
            assert await reader.readexactly(24) == b'the program\nthe program\n'
            writer.write(b'request_pro')  # and gives up
            writer.close()
            await writer.wait_closed()
            reader, writer = await here.dial('script_sender_port')
            writer.write(b'request_program\n')
            assert await asyncio.wait_for(reader.readexactly(12), 5.0) == b'the program\n'

    asyncio.run(scene())


def read_until_pause(port, sent):
    """Fetch the program as the External Control node does: it stops when nothing is waiting."""
    with socket.create_connection((HOST, port), timeout=5.0) as node:
        node.sendall(REQUEST)
        assert sent.wait(5.0)
        node.setblocking(False)
        received = b''
        with contextlib.suppress(BlockingIOError):
            while data := node.recv(8192):
                received += data
        return received


def wait_until_acknowledged(sock):
    """Wait until the system of the other side has all that was given to ours."""
    deadline = monotonic() + 5.0
    while struct.unpack('i', fcntl.ioctl(sock.fileno(), termios.TIOCOUTQ, bytes(4)))[0]:
        assert monotonic() < deadline
        sleep(0.001)


def test_a_reader_that_stops_at_the_first_pause_gets_the_whole_program(monkeypatch):
    """It has all that one call of ours sends: the loop does nothing more until it has read."""
    sent, has_read = threading.Event(), threading.Event()

    def send_at_once(connection, data):
        result = at_once(connection, data)
        wait_until_acknowledged(connection._transport.get_extra_info('socket'))
        sent.set()
        assert has_read.wait(5.0)
        return result

    def read(port):
        try:
            return read_until_pause(port, sent)
        finally:
            has_read.set()

    at_once = transport.TcpConnection.send_at_once
    monkeypatch.setattr(transport.TcpConnection, 'send_at_once', send_at_once)

    async def scene():
        async with cell() as here:
            here.sockets.render(HOST, ControllerVersion(major=5, minor=21, bugfix=0))
            port = here.sockets.ports['script_sender_port']
            program = await asyncio.to_thread(read, port)
            assert program.decode() == here.sockets.text + '\n'

    asyncio.run(scene())


def test_the_program_leaves_in_one_call_where_the_system_keeps_little(monkeypatch):
    unsent = []

    def send_at_once(connection, data):
        sock = connection._transport.get_extra_info('socket')
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4096)
        sent = at_once(connection, data)
        unsent.append(connection._transport.get_write_buffer_size())
        return sent

    at_once = transport.TcpConnection.send_at_once
    monkeypatch.setattr(transport.TcpConnection, 'send_at_once', send_at_once)

    async def scene():
        async with cell() as here:
            here.sockets.text = 'x' * 40_000
            reader, writer = await here.dial('script_sender_port')
            writer.write(REQUEST)
            await reader.readuntil()
            assert unsent == [0]

    asyncio.run(scene())


@pytest.mark.parametrize(
    ('settings', 'reason'),
    [
        ({'wire_dialect': '2.12'}, 'wire_dialect is set to an older program'),
        ({}, 'it cannot be made from the settings; the status of the driver says why'),
    ],
)
def test_a_request_for_a_program_that_is_not_there_is_explained(settings, reason):
    async def scene():
        async with cell(**settings) as here:
            _, writer = await here.dial('script_sender_port')
            writer.write(b'request_program\n')
            assert reason in await here.next()

    asyncio.run(scene())


def test_a_robot_that_got_another_address_may_connect_to_ports_that_are_open():
    async def scene():
        async with cell(allowed=frozenset({'127.0.0.9'})) as here:
            await here.dial('reverse_port')
            assert 'may not connect' in await here.next()
            await here.sockets.open(HOST, frozenset({HOST}))
            await here.connect()

    asyncio.run(scene())


def test_nonsense_at_the_script_sender_is_reported_and_answered_by_hanging_up():
    async def scene():
        async with cell() as here:
            _, writer = await here.dial('script_sender_port')
            writer.write(b'GET / HTTP/1.1\r\n')
            assert b'GET / HTTP'.hex() in await here.next()

    asyncio.run(scene())


def test_a_port_that_is_taken_is_named_with_its_parameter():
    async def scene():
        async with cell() as here:
            port = here.sockets.ports['reverse_port']
            other = ProgramSockets(
                LinkSettings(
                    reverse_port=port,
                    trajectory_port=0,
                    script_command_port=0,
                    script_sender_port=0,
                ),
                ProgramCallbacks(
                    connected=Mock(), lost=Mock(), result=Mock(), contact=Mock(), warning=Mock()
                ),
            )
            with pytest.raises(OSError, match='set reverse_port to a free port or to 0'):
                await other.open(HOST, frozenset())
            other.close()

    asyncio.run(scene())
