# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Requests of External Control over real sockets, of a robot whose cycles go on meanwhile."""

import contextlib
import errno
import socket
import threading

import pytest
from robot_ports import FREE
from waiting import wait_for

from ur_cartesian_driver.sim import SimulatedRobot, SimulatorConfig
from ur_cartesian_driver.sim.pendant_programs.program_tree import ProgramTree, ScriptText

PROGRAM = b'textmsg("from ', b'the host")\nwhile True:\nsync()\nend\n'


class Host:
    """A script sender by the letter of the protocol; it handles one request after the other."""

    def __init__(self, host='127.0.0.1'):
        self._listener = socket.create_server((host, 0))
        self.port = self._listener.getsockname()[1]
        self._accepted = []
        #: The peers that have sent their request, and the connections to them.
        self.peers, self.clients = [], []
        #: The parts of the answers to come; None = hang up.
        self.parts = [*PROGRAM]
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def _serve(self):
        with contextlib.suppress(OSError):
            while True:
                client, (peer, _) = self._listener.accept()
                self._accepted.append(client)
                assert client.recv(100) == b'request_program\n'
                self.peers.append(peer)
                self.clients.append(client)
                for part in self.parts:
                    client.sendall(part) if part is not None else client.close()

    def close(self):
        self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        for client in self._accepted:
            client.close()
        self._thread.join()


@pytest.fixture
def host():
    host = Host()
    yield host
    host.close()


@contextlib.contextmanager
def robot_of(port, **settings):
    config = {'program': 'external_control.urp', 'external_control_port': port} | settings
    with SimulatedRobot(SimulatorConfig(**FREE, **config)) as robot:
        yield robot


@pytest.mark.parametrize('polyscope', ['5.21', '10.12'])
@pytest.mark.parametrize('hangs_up', [False, True])
def test_a_program_is_fetched_and_runs(host, polyscope, hangs_up):
    host.parts += [None] * hangs_up
    with robot_of(host.port, polyscope=polyscope) as robot:
        robot.play_program()
        wait_for(lambda: 'from the host' in robot.state().messages)
        assert robot.state().program == 'external_control.urp'


def test_robots_on_loopback_call_from_their_addresses(host):
    with robot_of(host.port, host='127.0.0.3') as robot:
        robot.play_program()
        wait_for(lambda: 'from the host' in robot.state().messages)
    assert host.peers == ['127.0.0.3']


@pytest.mark.parametrize(
    ('polyscope', 'sentence'),
    [
        ('5.21', 'could not be established. Reason: Connection refused'),
        ('10.12', f'[Errno {errno.ECONNREFUSED}] Connection refused'),
    ],
)
def test_a_closed_port_is_refused(closed_port, polyscope, sentence):
    with robot_of(closed_port, polyscope=polyscope) as robot:
        robot.play_program()
        wait_for(lambda: any(sentence in line for line in robot.state().messages))


@pytest.fixture
def deaf_port():
    """Return a port to which nobody can connect, as if a firewall dropped what comes."""
    with contextlib.ExitStack() as stack:
        listener = stack.enter_context(socket.socket())
        listener.bind(('127.0.0.1', 0))
        listener.listen(0)
        for _ in range(4):  # fill the queue of those who wait to be accepted
            client = stack.enter_context(socket.socket())
            client.setblocking(False)
            client.connect_ex(listener.getsockname())
        yield listener.getsockname()[1]


@pytest.mark.parametrize(
    ('polyscope', 'reason'), [('5.21', 'Reason: connect timed out'), ('10.12', ': timed out')]
)
def test_a_host_that_drops_what_comes_is_given_up(deaf_port, polyscope, reason):
    with robot_of(deaf_port, polyscope=polyscope) as robot:
        robot.play_program()
        wait_for(lambda: robot.state().messages, 20.0)
        assert robot.state().messages[0].endswith(reason)


@pytest.mark.parametrize('name', ['no-such-host.invalid', 'a' * 70])
def test_a_name_that_nobody_has(name):
    with robot_of(50002, external_control_host=name) as robot:
        robot.play_program()
        wait_for(lambda: robot.state().popups, 20.0)
        assert robot.state().popups[0].endswith(f' Reason: {name}')


def test_cycles_go_on_while_a_host_is_silent_and_stop_gives_up(host):
    host.parts = []
    with robot_of(host.port) as robot:
        robot.play_program()
        wait_for(lambda: host.clients)
        begin = robot.state().timestamp
        wait_for(lambda: robot.state().timestamp > begin + 0.2)
        assert robot.state().runtime_state.name == 'STOPPED'
        robot.stop_program()
        host.clients[0].sendall(b''.join(PROGRAM))
        host.parts = [*PROGRAM]
        robot.play_program()
        wait_for(lambda: len(host.clients) == 2)
        wait_for(lambda: 'from the host' in robot.state().messages)
        assert robot.state().messages.count('from the host') == 1


def test_the_urcapx_waits_five_seconds_for_a_silent_host(host):
    host.parts = []
    with robot_of(host.port, polyscope='10.12') as robot:
        robot.play_program()
        wait_for(lambda: robot.state().messages, 20.0)
        assert robot.state().messages[0].endswith(': Connection timeout')


def test_the_urcapx_takes_the_same_program_for_two_seconds(host):
    with robot_of(host.port, polyscope='10.12') as robot:
        robot.play_program()
        wait_for(lambda: robot.state().messages.count('from the host') == 1)
        robot.stop_program()
        robot.play_program()
        wait_for(lambda: robot.state().messages.count('from the host') == 2)
    assert len(host.clients) == 1


def test_a_robot_closes_while_a_host_is_silent(host):
    host.parts = []
    with robot_of(host.port) as robot:
        robot.play_program()
        wait_for(lambda: host.clients)
    assert host.clients[0].recv(1) == b''


def test_a_program_without_external_control_asks_nobody(host):
    tree = ProgramTree((ScriptText('textmsg("alone")'),))
    with robot_of(host.port, program='alone.urp', programs={'alone.urp': tree}) as robot:
        robot.play_program()
        wait_for(lambda: 'alone' in robot.state().messages)
    assert host.clients == []
