# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Properties on which robot clients rely, seen by clients that know nothing of this package."""

from __future__ import annotations

import contextlib
import http.client
import json
import socket
import threading
import time

from plain_clients import PlainDashboard, PlainPrimary
import pytest
from robot_ports import FREE

from ur_cartesian_driver.sim import SimulatedRobot, SimulatorConfig

POWER_OFF, IDLE, RUNNING = 3, 5, 7
LOOP = 'def loop():\n  while True:\n    sync()\n  end\nend\n'


@pytest.fixture
def make_robot():
    """Run robots on free ports, 20 times as fast as time."""
    with contextlib.ExitStack() as stack:
        yield lambda **settings: stack.enter_context(
            SimulatedRobot(SimulatorConfig(**{**FREE, 'rate': 20.0, **settings}))
        )


def primary(robot):
    return PlainPrimary(robot.config.host, robot.ports.primary)


def dashboard(robot):
    return PlainDashboard(robot.config.host, robot.ports.dashboard)


@pytest.mark.parametrize('beside', ['', LOOP], ids=['alone', 'beside a program'])
def test_a_secondary_program_stops_the_robot_and_the_code_and_state_come_at_once(
    make_robot, beside
):
    with primary(make_robot()) as client:
        client.send(beside)
        if beside:
            client.await_('key', title='PROGRAM_XXX_STARTED')
        client.await_('state', protective=False)
        client.send('sec stop():\n  protective_stop()\nend\n')
        error = client.await_('error')
        stopped = client.await_('state', protective=True)
        assert (error['code'], error['argument']) == (209, 0)
        assert stopped['stamp'] - error['stamp'] < 5_000  # us; states are 100 ms apart
        assert client.await_('state')['stamp'] - stopped['stamp'] <= 100_000


def test_a_secondary_program_sets_the_slider_through_a_socket_to_the_robot_itself(make_robot):
    # Published programs of a laboratory with a UR10e do so.
    robot = make_robot()
    host, port = robot.config.host, robot.ports.realtime
    with primary(robot) as client:
        client.send(
            f'sec slow():\n  textmsg(socket_open("{host}", {port}))\n'
            '  socket_send_line("set speed 0.5")\n  socket_close()\nend\n'
        )
        assert client.await_('text')['text'] == 'True'
        client.await_('state', fraction=0.5)
        client.send('sec waits():\n  socket_open("no.such.host.invalid", 80)\nend\n')
        error = client.await_('key', title='SECONDARY_PROGRAM_EXCEPTION_XXX')
        assert 'socket_open takes time' in error['text']


def test_a_program_pauses_itself_and_says_why_through_the_dashboard(make_robot):
    # A gripper's published program: two commands on one socket, which it closes without reading.
    robot = make_robot()
    host, port = robot.config.host, robot.ports.dashboard
    with primary(robot) as client:
        client.send(
            f'def grip():\n  thread watch():\n    socket_open("{host}", {port}, "d")\n'
            '    socket_send_line("pause", "d")\n'
            '    socket_send_string("popup the part is lost", "d")\n'
            '    socket_send_byte(10, "d")\n    socket_close("d")\n  end\n  run watch()\n'
            '  speedj([0.1, 0, 0, 0, 0, 0], 1, 60)\nend\n'
        )
        client.await_('state', paused=True)
        deadline = time.monotonic() + 10.0
        while not robot.call(lambda controller: controller.popups):
            assert time.monotonic() < deadline
        assert robot.call(lambda controller: controller.popups[0].text) == 'the part is lost'


def test_a_line_unlocks_without_the_wait_of_the_dashboard_but_not_within_a_millisecond(make_robot):
    robot = make_robot(rate=1.0)
    with primary(robot) as client, dashboard(robot) as board:
        client.send('sec stop():\n  protective_stop()\nend\n')
        client.await_('state', protective=True)
        assert board.ask('unlock protective stop').startswith('Cannot unlock protective stop')
        sent = robot.state().timestamp
        client.send('set unlock protective stop\n')
        client.await_('state', protective=False)
        assert 0.001 < robot.state().timestamp - sent < 5.0, 'the dashboard waits 5 s'


def test_a_stop_by_a_program_is_unlocked_within_5_s_of_power_on_and_programs_run_again(make_robot):
    # A test of the manufacturer's client library does these steps without a pause.
    robot = make_robot(rate=1.0)
    with primary(robot) as client:
        client.send('power off\n')
        client.await_('state', mode=POWER_OFF)
        client.send('set robotmode run\n')
        client.await_('state', mode=RUNNING)
        client.send('def stops():\n  protective_stop()\nend\n')
        client.await_('state', protective=True)
        stopped = robot.call(lambda controller: controller.time)
        client.send('def early():\n  textmsg("early")\nend\n')
        client.send('set unlock protective stop\n')
        client.await_('state', protective=False)
        assert robot.call(lambda controller: controller.time) - stopped < 5.0
        client.send('def goes_on():\n  textmsg("on")\nend\n')
        client.await_('key', title='PROGRAM_XXX_STARTED', text='goes_on')
        client.await_('text', text='on')
        assert 'early' not in robot.state().messages


def test_a_move_of_joints_out_of_their_range_ends_the_program_before_anything_moves(make_robot):
    with primary(make_robot()) as client:
        before = client.await_('state')['q']
        client.send('def far():\n  movej([-123, 0, 0, 0, 0, 0])\n  textmsg("there")\nend\n')
        started = client.await_('key', title='PROGRAM_XXX_STARTED')
        failed = client.await_('exception')
        assert (failed['line'], 'joint 1' in failed['text']) == (2, True)
        ended = client.await_('key', title='PROGRAM_XXX_STOPPED')
        assert ended['stamp'] - started['stamp'] < 20_000
        after = client.await_('state')
        assert after['q'] == before
        assert not after['protective']


def test_a_peer_that_writes_without_a_pause_is_held_back_and_the_program_goes_on(make_robot):
    robot = make_robot()
    with socket.create_server(('127.0.0.1', 0)) as server, primary(robot) as client:
        client.send(
            'def reads():\n'
            '  global seen = 0\n'
            '  thread says():\n'
            '    while True:\n'
            '      sleep(1)\n'
            '      textmsg("seen ", seen > 0)\n'
            '    end\n'
            '  end\n'
            f'  socket_open("127.0.0.1", {server.getsockname()[1]}, "flood")\n'
            '  handle = run says()\n'
            '  while True:\n'
            '    message = socket_read_binary_integer(8, "flood", 0)\n'
            '    local i = 0\n'
            '    while i < 20:\n'
            '      i = i + message[0] / 8\n'
            '    end\n'
            '    seen = seen + 1\n'
            '  end\n'
            'end\n'
        )
        peer, _ = server.accept()
        peer.settimeout(0.05)
        stalls = []

        def flood():
            with contextlib.suppress(OSError):
                while not client.socket.fileno() < 0:
                    try:
                        peer.send(bytes([0, 0, 0, 1]) * 8 * 2048)
                    except TimeoutError:
                        stalls.append(time.monotonic())

        writer = threading.Thread(target=flood)
        writer.start()
        try:
            texts = [client.await_('text')['text'] for _ in range(10)]
            assert texts == ['seen True'] * 10
            assert client.await_('state')['running']
            deadline = time.monotonic() + 30.0
            while not stalls and time.monotonic() < deadline:
                client.next()
            assert stalls
        finally:
            peer.shutdown(socket.SHUT_RDWR)
            writer.join()
            peer.close()


def test_a_program_is_loaded_from_the_start(make_robot):
    with dashboard(make_robot()) as board:
        assert board.ask('get loaded program') == 'Loaded program: /programs/<unnamed>'
        assert board.ask('programState') == 'STOPPED <unnamed>'
        assert board.ask('play') == 'Failed to execute: play'
    robot = make_robot(programs={'loop.urp': LOOP}, program='loop.urp')
    with dashboard(robot) as board, primary(robot) as client:
        assert board.ask('get loaded program') == 'Loaded program: /programs/loop.urp'
        assert board.ask('play') == 'Starting program'
        client.await_('state', running=True)
        assert board.ask('programState') == 'PLAYING loop.urp'


def test_reports_and_support_files_are_generated_whatever_their_type(make_robot):
    with dashboard(make_robot()) as board:
        for kind in ('', ' controller', ' software', ' system'):
            answer = board.ask(f'generate flight report{kind}')
            assert answer.startswith('Flight Report generated with id: ')
        # A client that leaves the type out may send the space before it.
        assert board.ask('generate flight report ').startswith('Flight Report generated')
        answer = board.ask('generate support file .')
        assert answer.startswith('Completed successfully: ./ur_2')
        assert answer.endswith('.zip')


def test_a_client_of_the_robot_api_that_switches_off_and_on_sees_each_mode(make_robot):
    # A test of the manufacturer's client library reads the modes over the primary interface, too.
    robot = make_robot(polyscope='10.12')
    api = http.client.HTTPConnection(robot.config.host, robot.ports.robot_api, timeout=10.0)
    with primary(robot) as client, contextlib.closing(api):
        for _ in range(2):
            for action, mode, name in (
                ('POWER_OFF', POWER_OFF, 'POWER_OFF'),
                ('POWER_ON', IDLE, 'IDLE'),
                ('BRAKE_RELEASE', RUNNING, 'RUNNING'),
            ):
                body = json.dumps({'action': action})
                api.request('PUT', '/universal-robots/robot-api/robotstate/v1/state', body)
                answer = api.getresponse()
                assert (answer.status, bool(answer.read())) == (200, True)
                client.await_('state', mode=mode)
                api.request('GET', '/universal-robots/robot-api/robotstate/v1/robotmode')
                assert json.loads(api.getresponse().read())['mode'] == name


def test_the_operational_mode_is_that_of_the_robot_and_not_of_one_client(make_robot):
    robot = make_robot()
    with dashboard(robot) as one, dashboard(robot) as other:
        assert other.ask('get operational mode') == 'NONE'
        for mode in ('AUTOMATIC', 'MANUAL'):
            assert one.ask(f'set operational mode {mode}').startswith('Operational mode ')
            assert other.ask('get operational mode') == mode
        assert other.ask('clear operational mode').startswith('No longer controlling')
        assert one.ask('get operational mode') == 'NONE'


def test_without_the_feature_of_remote_control_scripts_are_taken(make_robot):
    robot = make_robot(has_remote_control=False)
    with dashboard(robot) as board, primary(robot) as client:
        assert board.ask('is in remote control') == 'false'
        client.send(LOOP)
        client.await_('key', title='PROGRAM_XXX_STARTED', text='loop')


def test_a_robot_on_an_address_of_its_own_dials_out_from_there(make_robot):
    robot = make_robot(host='127.0.0.7')
    with socket.create_server(('127.0.0.1', 0)) as server, primary(robot) as client:
        server.settimeout(10.0)
        port = server.getsockname()[1]
        client.send(f'def dials():\n  socket_open("127.0.0.1", {port})\n  sleep(1)\nend\n')
        peer, address = server.accept()
        peer.close()
        assert address[0] == '127.0.0.7'
