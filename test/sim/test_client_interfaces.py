# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Primary, secondary and real-time interface side by side: what each sends, and what all take."""

from __future__ import annotations

from collections.abc import Callable, Iterator
import contextlib
import itertools
import socket
import time

import pytest
from realtime_packets import read_packet
from robot_ports import FREE

from ur_cartesian_driver.motion.state.rtde_state import RobotMode, RuntimeState, SafetyMode
from ur_cartesian_driver.protocol.client_interfaces.primary_messages import (
    PrimaryDecoder,
    RobotStateFrame,
    VersionMessage,
)
from ur_cartesian_driver.protocol.client_interfaces.realtime import RealtimeData
from ur_cartesian_driver.sim import SimulatedRobot, SimulatorConfig
from ur_cartesian_driver.sim.simulator_config import HOME

INTERFACES = ('primary', 'secondary', 'realtime')


@pytest.fixture
def robot() -> Iterator[SimulatedRobot]:
    with SimulatedRobot(SimulatorConfig(**FREE, rate=20.0)) as robot:
        yield robot


@contextlib.contextmanager
def client(robot: SimulatedRobot, interface: str) -> Iterator[socket.socket]:
    port = getattr(robot.ports, interface)
    with socket.create_connection((robot.config.host, port), timeout=5.0) as connection:
        yield connection


def packets(robot: SimulatedRobot, count: int) -> list[RealtimeData]:
    """Read from the real-time interface."""
    with client(robot, 'realtime') as connection:
        return [read_packet(connection.recv(1220, socket.MSG_WAITALL)) for _ in range(count)]


def until(happened: Callable[[], bool]) -> None:
    give_up = time.monotonic() + 60.0
    while not happened():
        assert time.monotonic() < give_up
        time.sleep(0.005)


def test_real_time_packets_come_once_per_cycle_and_say_what_the_robot_does(robot):
    robot.run_script(
        'def p():\n  set_standard_digital_out(3, True)\n'
        '  speedj([0.2, 0, 0, 0, 0, 0], 5, 10)\nend\n'
    )
    until(lambda: robot.state().qd[0] > 0.19)
    read = packets(robot, 40)
    assert [b.time - a.time for a, b in itertools.pairwise(read)] == pytest.approx([0.002] * 39)
    for a, b in itertools.pairwise(read):
        assert (b.q_actual[0] - a.q_actual[0]) / 0.002 == pytest.approx(0.2, abs=1e-6)
    last = read[-1]
    assert last.q_actual[1:] == pytest.approx(HOME[1:])
    assert last.qd_target[0] == pytest.approx(0.2)
    assert last.robot_mode == RobotMode.RUNNING
    assert last.program_state == RuntimeState.PLAYING
    assert last.safety_mode == last.safety_status == 1
    assert last.digital_output_bits == 8
    assert last.speed_scaling == 1.0
    assert last.joint_modes == (253.0,) * 6


@pytest.mark.parametrize(
    ('settings', 'size'),
    [({}, 1220), ({'polyscope': '5.4'}, 1116), ({'model': 'ur5', 'polyscope': '3.5'}, 1108)],
)
def test_a_real_time_packet_is_as_long_as_the_software_makes_it(settings, size):
    with (
        SimulatedRobot(SimulatorConfig(**FREE, **settings)) as robot,
        client(robot, 'realtime') as connection,
    ):
        data = b''
        while len(data) < 2 * size:
            data += connection.recv(2 * size - len(data))
    assert data[:4] == data[size : size + 4] == size.to_bytes(4, 'big')


def test_the_secondary_interface_sends_version_and_states_but_no_messages(robot):
    decoder, frames = PrimaryDecoder(), []
    with client(robot, 'secondary') as connection:
        connection.sendall(b'def p():\n  textmsg("hello")\nend\n')
        while len(frames) < 6:
            frames += decoder.feed(connection.recv(65536))
    assert isinstance(frames[0], VersionMessage)
    assert {type(frame) for frame in frames[1:]} == {RobotStateFrame}
    assert 'hello' in robot.state().messages


@pytest.mark.parametrize('interface', INTERFACES)
def test_programs_and_control_lines_are_taken(robot, interface):
    with client(robot, interface) as connection:
        connection.sendall(b'def spin():\n  while True:\n    sync()\n  end\nend\n')
        until(
            lambda: (
                robot.state().program == 'spin'
                and robot.state().runtime_state is RuntimeState.PLAYING
            )
        )
        connection.sendall(b'set speed 0.5\n')
        until(lambda: robot.state().speed_slider == 0.5)
        connection.sendall(b'set speed0.25\n')  # the forum's way of doing it from a program
        until(lambda: robot.state().speed_slider == 0.25)
        connection.sendall(b'stop program\n')
        until(lambda: robot.state().runtime_state is RuntimeState.STOPPED)
        connection.sendall(b'power off\n')
        until(lambda: robot.state().robot_mode is RobotMode.POWER_OFF)
        connection.sendall(b'power on\n')
        until(lambda: robot.state().robot_mode is RobotMode.IDLE)
        connection.sendall(b'set robotmode run\n')
        until(lambda: robot.state().robot_mode is RobotMode.RUNNING)


@pytest.mark.parametrize('interface', INTERFACES)
def test_local_control_makes_the_interface_read_only(interface):
    with (
        SimulatedRobot(SimulatorConfig(**FREE, remote_control=False, rate=20.0)) as robot,
        client(robot, interface) as connection,
    ):
        connection.sendall(b'set speed 0.5\n')
        until(lambda: any('C210' in line for line in robot.state().messages))
        assert robot.state().speed_slider == 1.0


@pytest.fixture
def robot_on_standard_ports():
    for last in range(1, 255):
        config = SimulatorConfig(host=f'127.0.19.{last}', rate=4.0)
        with contextlib.suppress(OSError), SimulatedRobot(config) as robot:
            yield robot
            return
    raise OSError('No address of 127.0.19.0/24 is free.')


def test_the_read_only_ports_send_the_same_and_take_no_scripts(robot_on_standard_ports):
    host = robot_on_standard_ports.config.host
    for port in (30001, 30002, 30003):
        with (
            socket.create_connection((host, port + 10), 5) as reader,
            socket.create_connection((host, port), 5) as writer,
        ):
            reader.sendall(b'set speed 0.25\nprotective_stop()\n')
            writer.sendall(b'set speed 0.5\n')
            until(lambda: robot_on_standard_ports.state().speed_slider == 0.5)
            robot_on_standard_ports.set_speed_slider(1.0)
            # The size at the start of a frame: of the version or of a real-time packet.
            start = [wire.recv(4, socket.MSG_WAITALL) for wire in (reader, writer)]
            assert start[0] == start[1]
            robot_on_standard_ports.call(lambda c: setattr(c, 'remote_control', False))
            with contextlib.suppress(ConnectionResetError):
                while writer.recv(65536):
                    pass
            reader.setblocking(False)
            with contextlib.suppress(BlockingIOError):
                while reader.recv(65536):
                    pass
            reader.settimeout(5)
            assert reader.recv(1)
            robot_on_standard_ports.call(lambda c: setattr(c, 'remote_control', True))
    assert robot_on_standard_ports.state().safety_mode is SafetyMode.NORMAL


@pytest.mark.slow
def test_a_client_that_sends_scripts_and_never_reads_is_not_dropped():
    # As many do who only have something to say.
    with (
        SimulatedRobot(SimulatorConfig(**FREE, rate=0.0)) as robot,
        client(robot, 'realtime') as connection,
    ):
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        start = robot.state().timestamp
        until(lambda: robot.state().timestamp > start + 30.0)  # 18 MB
        connection.sendall(b'set speed 0.5\n')
        until(lambda: robot.state().speed_slider == 0.5)


@pytest.mark.parametrize(
    ('settings', 'secondary', 'realtime'),
    [
        ({}, 30002, 30003),
        ({'primary_port': 0}, 0, 0),
        ({'primary_port': 40001}, 0, 0),
        ({'primary_port': 0, 'secondary_port': 40002}, 40002, 0),
        ({'realtime_port': 0}, 30002, 0),
    ],
)
def test_a_robot_on_other_ports_does_not_take_the_standard_ones(settings, secondary, realtime):
    config = SimulatorConfig(**settings)
    assert config.listening_secondary_port == secondary
    assert config.listening_realtime_port == realtime
