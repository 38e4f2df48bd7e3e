# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The simulated robot from outside: dashboard, sockets of its programs, start and end."""

from __future__ import annotations

import gc
import socket
import struct
import threading

import pytest
from robot_ports import FREE, HOST, Primary, Wire
from rtde_requests import setup_outputs, START, VERSION_2
from waiting import wait_for

from ur_cartesian_driver.motion.state.rtde_state import SafetyMode
from ur_cartesian_driver.protocol.client_interfaces.primary_messages import (
    TextMessage,
)
from ur_cartesian_driver.sim import SimulatedRobot, SimulatorConfig


def test_the_dashboard_answers_in_the_robots_words():
    programs = {'a.urp': 'def a():\n  while True:\n    sync()\n  end\nend\n'}
    conversation = {
        'PolyscopeVersion': 'URSoftware 5.21.0.0 (Jan 01 2026)',
        'robotmode': 'Robotmode: POWER_OFF',
        'safetystatus': 'Safetystatus: NORMAL',
        'programState': 'STOPPED <unnamed>',
        'play': 'Failed to execute: play',
        'brake release': 'Brake releasing',
        'is in remote control': 'true',
        'get robot model': 'UR5',
        'load b.urp': 'File not found: b.urp',
        'load /ursim/programs/a.urp': 'Loading program: /ursim/programs/a.urp',
        'popup careful': 'showing popup',
        'close popup': 'closing popup',
        'brake_release': 'could not understand: "brake_release"',
    }
    config = SimulatorConfig(**FREE, rate=20.0, power='off', programs=programs)
    with SimulatedRobot(config) as robot, Wire(robot.ports.dashboard) as wire:
        assert wire.line() == 'Connected: Universal Robots Dashboard Server'
        for command, answer in conversation.items():
            assert wire.ask(command) == answer
        wait_for(lambda: wire.ask('robotmode') == 'Robotmode: RUNNING')
        assert wire.ask('play') == 'Starting program'
        assert wire.ask('running') == 'Program running: true'
        assert wire.ask('pause') == 'Pausing program'
        wait_for(lambda: wire.ask('programState') == 'PAUSED a.urp')
        assert wire.ask('stop') == 'Stopped'
        wait_for(lambda: wire.ask('programState') == 'STOPPED a.urp')
        assert wire.ask('quit') == 'Disconnected'
        assert wire.socket.recv(10) == b''


def test_polyscope_x_has_no_dashboard():
    with (
        SimulatedRobot(SimulatorConfig(**FREE, polyscope='10.8')) as robot,
        Wire(robot.ports.rtde) as wire,
    ):
        assert robot.ports.dashboard == 0
        wire.send(struct.pack('>HB', 3, ord('v')))
        assert struct.unpack('>4I', wire.rtde()[1][3:]) == (10, 8, 0, 0)


@pytest.mark.parametrize(
    ('settings', 'command', 'known'),
    [
        ({}, 'safetystatus', True),
        ({'polyscope': '5.3'}, 'safetystatus', False),
        ({'model': 'ur5'}, 'safetystatus', False),
        ({'model': 'ur5'}, 'getUserRole', True),
        ({}, 'getUserRole', False),
    ],
)
def test_the_dashboard_knows_what_its_software_knew(settings, command, known):
    with (
        SimulatedRobot(SimulatorConfig(**FREE, **settings)) as robot,
        Wire(robot.ports.dashboard) as wire,
    ):
        wire.line()
        assert ('could not understand' not in wire.ask(command)) is known


def test_a_script_reads_and_sends_integers_and_notices_a_closed_peer(robot):
    received = []
    robot.on_socket_data = lambda port, data: received.append((port, data))
    with socket.create_server((HOST, 0)) as server, Primary(robot.ports.primary) as wire:
        port = server.getsockname()[1]
        wire.send(
            f"""def echo():
  textmsg(socket_open("{HOST}", {port}, "s"))
  got = socket_read_binary_integer(3, "s", 0)
  textmsg(got)
  socket_send_int(got[1] + got[3], "s")
  textmsg(socket_read_binary_integer(2, "s", 0))
  textmsg(socket_send_int(1, "s"))
end
""".encode()
        )
        peer, _ = server.accept()
        with peer:
            peer.settimeout(5.0)
            peer.sendall(struct.pack('>3i', 5, -6, 7)[:6])
            peer.sendall(struct.pack('>3i', 5, -6, 7)[6:])
            assert struct.unpack('>i', peer.recv(4)) == (12,)
        texts = [wire.await_(TextMessage).text for _ in range(4)]
    assert texts == ['True', '[3, 5, -6, 7]', '[0, -1, -1]', 'False']
    assert b''.join(data for _, data in received) == struct.pack('>3i', 5, -6, 7)
    assert {p for p, _ in received} == {port}


def test_a_refused_connection_is_false_at_once(robot, closed_port):
    with Primary(robot.ports.primary) as wire:
        wire.send(f'def a():\n  textmsg(socket_open("{HOST}", {closed_port}))\nend\n'.encode())
        assert wire.await_(TextMessage).text == 'False'


def test_the_sockets_of_a_program_close_when_it_ends(robot):
    with socket.create_server((HOST, 0)) as server:
        port = server.getsockname()[1]
        robot.run_script(f'def a():\n  socket_open("{HOST}", {port})\n  sync()\nend\n')
        peer, _ = server.accept()
        with peer:
            peer.settimeout(5.0)
            assert peer.recv(10) == b''


def test_closing_leaves_no_thread_and_no_socket_behind(recwarn):
    threads = set(threading.enumerate())
    robot = SimulatedRobot(SimulatorConfig(**FREE)).start()
    ports = robot.ports
    with Wire(ports.rtde) as wire, Primary(ports.primary), Wire(ports.dashboard):
        wire.send(VERSION_2 + setup_outputs('timestamp') + START)
        wire.rtde()
        robot.close()
        robot.close()
    assert set(threading.enumerate()) == threads
    for port in (ports.rtde, ports.primary, ports.dashboard):
        with pytest.raises(ConnectionRefusedError):
            socket.create_connection((HOST, port), timeout=1.0)
    gc.collect()
    assert [str(w.message) for w in recwarn if w.category is ResourceWarning] == []


def test_a_taken_port_is_named(robot):
    with pytest.raises(OSError, match=f'primary port {robot.ports.primary} on 127.0.0.1'):
        SimulatedRobot(SimulatorConfig(**FREE | {'primary_port': robot.ports.primary})).start()


def test_an_emergency_stop_cuts_the_power(robot):
    robot.emergency_stop()
    wait_for(lambda: robot.state().robot_mode == 3)
    assert robot.state().safety_mode is SafetyMode.ROBOT_EMERGENCY_STOP
    assert 'ROBOT_EMERGENCY_STOP' in robot.status_line()
