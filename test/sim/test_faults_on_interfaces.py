# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Faults of connections, as clients see them: the robot runs in its thread, over TCP."""

from __future__ import annotations

from itertools import pairwise
from random import Random
import socket
import struct

import pytest
from rtde_requests import setup_outputs, START, VERSION_2

from ur_cartesian_driver.motion.state.rtde_state import RobotMode, SafetyMode
from ur_cartesian_driver.sim import SimulatedRobot, SimulatorConfig
from ur_cartesian_driver.sim.faults.fault_values import (
    GarbageFault,
    HalfOpenFault,
    SpeedSliderFault,
)


class Client:
    """A socket that can wait for what must come and see that nothing comes."""

    def __init__(self, port: int) -> None:
        self.socket = socket.create_connection(('127.0.0.1', port), timeout=5.0)

    def ask(self, line: str) -> str:
        self.socket.sendall(line.encode() + b'\n')
        return self.line()

    def line(self) -> str:
        data = b''
        while not data.endswith(b'\n'):
            data += self.some(1)
        return data.decode().rstrip('\n')

    def some(self, size: int = 65536) -> bytes:
        data = self.socket.recv(size)
        assert data, 'the robot has closed the connection'
        return data

    def is_closed(self) -> bool:
        """Read until the connection ends; False when nothing more comes and it does not."""
        try:
            while self.socket.recv(65536):
                pass
        except TimeoutError:
            return False
        except ConnectionResetError:
            pass
        return True


@pytest.fixture
def connect():
    """Connect to a port; closed after the test."""
    clients = []

    def make(port):
        clients.append(Client(port))
        return clients[-1]

    yield make
    for client in clients:
        client.socket.close()


@pytest.fixture
def robot():
    config = SimulatorConfig(
        rtde_port=0, primary_port=0, dashboard_port=0, rate=20.0, when_late='wait'
    )
    with SimulatedRobot(config) as robot:
        yield robot


def streaming(connect, robot):
    client = connect(robot.ports.rtde)
    for request in (VERSION_2, setup_outputs('timestamp'), START):
        client.socket.sendall(request)
        client.some()
    return client


def passes(robot, seconds):
    """Wait until time has passed in the robot."""
    end = robot.state().timestamp + seconds
    while robot.state().timestamp < end:
        pass


def test_dropped_rtde_clients_are_disconnected_and_may_come_back(robot, connect):
    client, dashboard = streaming(connect, robot), connect(robot.ports.dashboard)
    robot.inject('drop rtde')
    assert client.is_closed()
    assert streaming(connect, robot).some()
    assert 'Connected' in dashboard.line()


def late_dashboard(connect, robot, delay):
    """Return a client of the dashboard whose connection is delayed in each direction [s]."""
    client = connect(robot.ports.dashboard)
    assert 'Connected' in client.line()
    robot.inject(f'delay dashboard {delay} s')
    passes(robot, 0.02)
    return client


def test_what_a_client_sent_before_it_closed_arrives_late(robot, connect):
    client = late_dashboard(connect, robot, 0.1)
    client.socket.sendall(b'robotmode\n')
    client.socket.shutdown(socket.SHUT_WR)
    assert client.line() == 'Robotmode: RUNNING'
    assert client.is_closed()


def test_nothing_is_carried_out_behind_a_late_farewell(robot, connect):
    client = late_dashboard(connect, robot, 0.1)
    client.socket.sendall(b'quit\npower off\n')
    assert client.is_closed()
    passes(robot, 0.2)
    assert robot.state().robot_mode is RobotMode.RUNNING


def test_a_client_that_breaks_the_protocol_is_disconnected_from_a_late_stream(robot, connect):
    client = streaming(connect, robot)
    robot.inject('delay rtde 0.1 s')
    passes(robot, 0.02)
    client.socket.sendall(struct.pack('>HB', 3, ord('U')))
    assert client.is_closed()


def test_a_cut_cable_loses_what_was_on_its_way(robot, connect):
    client = late_dashboard(connect, robot, 0.4)
    client.socket.sendall(b'robotmode\n')
    passes(robot, 0.6)  # the answer has set out
    robot.inject('half_open dashboard')
    client.socket.settimeout(0.2)
    with pytest.raises(TimeoutError):
        client.some()


def test_a_half_open_connection_ends_with_its_client(robot, connect):
    """Else the robot keeps the RTDE inputs of a driver that comes back."""
    client = streaming(connect, robot)
    robot.inject('half_open rtde')
    passes(robot, 0.02)
    client.socket.shutdown(socket.SHUT_WR)
    assert client.is_closed()


def test_a_port_that_is_dropped_for_a_time_hangs_up_on_callers(robot, connect):
    robot.inject('drop dashboard for 1000 s')
    passes(robot, 0.1)
    assert connect(robot.ports.dashboard).is_closed()
    robot.clear_faults()
    passes(robot, 0.1)
    assert 'Connected' in connect(robot.ports.dashboard).line()


def test_a_half_open_connection_is_silent_and_open_while_new_ones_work(robot, connect):
    old = connect(robot.ports.dashboard)
    old.line()
    robot.inject(HalfOpenFault(interface='dashboard'))
    passes(robot, 0.1)
    old.socket.sendall(b'robotmode\n')
    assert connect(robot.ports.dashboard).line()
    old.socket.settimeout(0.05)
    assert not old.is_closed()


def test_silence_loses_what_is_said_and_ends(robot, connect):
    dashboard = connect(robot.ports.dashboard)
    dashboard.line()
    robot.inject('silence dashboard')
    passes(robot, 0.1)
    dashboard.socket.sendall(b'popup hello\n')
    while not robot.state().popups:  # it is heard
        pass
    robot.clear_faults()
    passes(robot, 0.1)
    assert dashboard.ask('robotmode') == 'Robotmode: RUNNING'  # not the answer to the popup


def test_silent_rtde_skips_whole_packages(robot, connect):
    client = streaming(connect, robot)
    robot.inject('silence rtde for 1 s')
    end = robot.state().timestamp + 3.0  # what was sent before may still wait to be read
    stamps, data = [], b''
    while not stamps or stamps[-1] < end:
        data += client.some(4096)
        while len(data) >= 12:
            size, kind, _, stamp = struct.unpack_from('>HBBd', data)
            assert (size, kind) == (12, ord('U'))
            stamps.append(stamp)
            data = data[size:]
    gaps = [after - before for before, after in pairwise(stamps)]
    assert max(gaps) == pytest.approx(1.002, abs=0.005)


def test_a_delayed_dashboard_answers_after_the_way_there_and_back(robot, connect):
    dashboard = connect(robot.ports.dashboard)
    dashboard.line()
    robot.inject('delay dashboard 2 s')
    passes(robot, 0.1)
    before = robot.state().timestamp
    assert dashboard.ask('robotmode') == 'Robotmode: RUNNING'
    assert robot.state().timestamp - before >= 4.0


def test_a_throttled_dashboard_trickles(robot, connect):
    robot.inject('throttle dashboard 20')
    passes(robot, 0.1)
    before = robot.state().timestamp
    greeting = connect(robot.ports.dashboard).line()
    assert robot.state().timestamp - before >= (len(greeting) - 1) / 20.0


def test_a_delayed_farewell_still_comes(robot, connect):
    dashboard = connect(robot.ports.dashboard)
    dashboard.line()
    robot.inject('delay dashboard 1 s')
    passes(robot, 0.1)
    assert dashboard.ask('quit') == 'Disconnected'
    assert dashboard.is_closed()


@pytest.mark.parametrize('interface', ['rtde', 'primary', 'secondary', 'realtime', 'dashboard'])
def test_garbage_comes_out_of_every_port(robot, connect, interface):
    client = connect(getattr(robot.ports, interface))
    if interface == 'rtde':
        client.socket.sendall(VERSION_2)
    client.some()  # it has been accepted
    robot.inject(GarbageFault(interface=interface, size=3000, seed=1))
    wanted, data = Random(1).randbytes(3000), b''
    while wanted not in data:
        data += client.some()


def test_a_client_of_a_throttled_port_that_gets_too_far_behind_is_dropped(robot, connect):
    client = connect(robot.ports.primary)
    client.some()
    robot.inject('throttle primary 1')
    for _ in range(3):
        robot.inject(GarbageFault(interface='primary', size=500_000))
        passes(robot, 0.01)
    assert client.is_closed()


def test_a_flood_into_a_throttled_port_is_left_to_the_client(robot, connect):
    client = connect(robot.ports.dashboard)
    client.line()
    robot.inject('throttle dashboard 1')
    passes(robot, 0.1)
    client.socket.settimeout(0.1)

    def flood():
        for _ in range(500):
            client.socket.send(bytes(100_000))

    with pytest.raises(TimeoutError):  # of one piece, not of all
        flood()


@pytest.mark.ur_sim(
    rate=20.0, faults=['protective_stop at 0.5 s', SpeedSliderFault(fraction=0.25)]
)
def test_the_fixture_takes_faults(ur_sim):
    while ur_sim.state().safety_mode is not SafetyMode.PROTECTIVE_STOP:
        pass
    assert ur_sim.state().speed_slider == 0.25
