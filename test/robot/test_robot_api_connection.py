# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The Robot API's client, with a server that knows nothing of our code."""

from __future__ import annotations

import asyncio
import threading

from documented_robot import API, documented_robot
import pytest

from ur_cartesian_driver.protocol.rtde.rtde_packages import ControllerVersion
from ur_cartesian_driver.robot.services import robot_api_connection
from ur_cartesian_driver.robot.services.robot_api_connection import RobotApiConnection

NEWEST = ControllerVersion(major=10, minor=14, bugfix=0)


def connection(server, version=NEWEST):
    return RobotApiConnection('127.0.0.1', server.server_address[1], version)


def ask(server, command, argument='', version=NEWEST):
    request = connection(server, version).request(command, argument)
    return asyncio.run(asyncio.wait_for(request, 10.0))


DONE = (200, {'message': None})


@pytest.mark.parametrize(
    ('command', 'argument', 'request_', 'answer', 'value'),
    [
        ('power on', '', ('PUT', '/robotstate/v1/state', {'action': 'POWER_ON'}), {}, ''),
        ('power off', '', ('PUT', '/robotstate/v1/state', {'action': 'POWER_OFF'}), {}, ''),
        (
            'brake release',
            '',
            ('PUT', '/robotstate/v1/state', {'action': 'BRAKE_RELEASE'}),
            {},
            '',
        ),
        (
            'unlock protective stop',
            '',
            ('PUT', '/robotstate/v1/state', {'action': 'UNLOCK_PROTECTIVE_STOP'}),
            {},
            '',
        ),
        (
            'restart safety',
            '',
            ('PUT', '/robotstate/v1/state', {'action': 'RESTART_SAFETY'}),
            {},
            '',
        ),
        ('pause', '', ('PUT', '/program/v1/state', {'action': 'pause'}), {}, ''),
        ('stop', '', ('PUT', '/program/v1/state', {'action': 'stop'}), {}, ''),
        ('programState', '', ('GET', '/program/v1/state', None), {'state': 'PLAYING'}, 'PLAYING'),
        ('running', '', ('GET', '/program/v1/state', None), {'state': 'PLAYING'}, 'true'),
        ('robotmode', '', ('GET', '/robotstate/v1/robotmode', None), {'mode': 'IDLE'}, 'IDLE'),
        ('safetymode', '', ('GET', '/robotstate/v1/safetymode', None), {'mode': 'FAULT'}, 'FAULT'),
        ('get loaded program', '', ('GET', '/program/v1/loaded', None), {'name': 'a'}, 'a'),
        (
            'get operational mode',
            '',
            ('GET', '/system/v1/operationalmode', None),
            {'mode': 'MANUAL'},
            'MANUAL',
        ),
        (
            'is in remote control',
            '',
            ('GET', '/system/v1/controlmode', None),
            {'mode': 'LOCAL'},
            'false',
        ),
        (
            'PolyscopeVersion',
            '',
            ('GET', '/versions/v1', None),
            {'marketingVersion': '10.14.0', 'baselineVersion': '1'},
            '10.14.0',
        ),
        (
            'get serial number',
            '',
            ('GET', '/system/v1/information', None),
            {'robotType': 'UR7', 'serialNumber': '20245500001'},
            '20245500001',
        ),
        (
            'get robot model',
            '',
            ('GET', '/system/v1/information', None),
            {'robotType': 'UR7', 'serialNumber': '20245500001'},
            'UR7',
        ),
        (
            'popup',
            'Careful!',
            ('POST', '/popup/v1', {'title': 'Message', 'message': 'Careful!'}),
            {},
            '',
        ),
        ('close popup', '', ('DELETE', '/popup/v1', None), {}, ''),
        ('close safety popup', '', ('DELETE', '/popup/v1/safety', None), {}, ''),
        ('addToLog', 'a line', ('POST', '/system/v1/log', {'message': 'a line'}), {}, ''),
        ('generate flight report', 'system', ('POST', '/supportfiles/v1', None), {}, ''),
        ('shutdown', '', ('PUT', '/system/v1/shutdown', None), {}, ''),
    ],
)
def test_each_command_is_one_request(command, argument, request_, answer, value):
    method, path, _ = request_
    with documented_robot({(method, path): (200, {'message': None, **answer})}) as server:
        reply = ask(server, command, argument)
        assert reply.value == value
        assert server.requests == [request_]


def test_play_of_a_paused_program_is_resume():
    with documented_robot({('PUT', '/program/v1/state'): DONE}) as server:
        for state, action in ('PAUSED', 'resume'), ('STOPPED', 'play'), ('PLAYING', 'play'):
            server.answers['GET', '/program/v1/state'] = (200, {'state': state})
            assert ask(server, 'play').ok
            assert server.requests[-1] == ('PUT', '/program/v1/state', {'action': action})


def test_a_load_ends_when_the_robot_names_the_program(monkeypatch):
    monkeypatch.setattr(robot_api_connection, 'LOAD_POLL_PERIOD', 0.001)
    names = iter(['before', 'before', 'mine'])
    with documented_robot(
        {
            ('PUT', '/program/v1/loaded'): DONE,
            ('GET', '/program/v1/loaded'): lambda _: (200, {'name': next(names)}),
        }
    ) as server:
        assert ask(server, 'load', 'mine.urpx').ok
        assert server.requests[0] == ('PUT', '/program/v1/loaded', {'name': 'mine'})
        assert next(names, None) is None


def test_a_program_that_is_never_loaded_is_an_error(monkeypatch):
    monkeypatch.setattr(robot_api_connection, 'LOAD_POLL_PERIOD', 0.001)
    monkeypatch.setattr(robot_api_connection, 'LOAD_TIMEOUT', 0.02)
    with (
        documented_robot(
            {
                ('PUT', '/program/v1/loaded'): DONE,
                ('GET', '/program/v1/loaded'): (200, {'name': 'another'}),
            }
        ) as server,
        pytest.raises(OSError, match=r"to load 'mine', but has not .* in a browser"),
    ):
        ask(server, 'load', 'mine')


def test_software_that_does_not_name_it_is_not_asked():
    with documented_robot({('PUT', '/program/v1/load'): DONE}) as server:
        version = ControllerVersion(major=10, minor=11, bugfix=0)
        assert ask(server, 'load', 'mine', version).ok
        assert server.requests == [('PUT', '/program/v1/load', {'programName': 'mine'})]


@pytest.mark.parametrize(
    ('status', 'fields', 'text'),
    [
        (
            403,
            {'message': 'Forbidden', 'details': 'Not authorized under the present control mode.'},
            'HTTP 403 Forbidden: Not authorized under the present control mode',
        ),
        (409, {'message': 'Conflict', 'details': 'not possible'}, 'HTTP 409 Conflict: not poss'),
        (504, {'message': 'Gateway Timeout'}, 'HTTP 504 Gateway Timeout'),
        (404, {'detail': 'Not Found'}, 'HTTP 404 Not Found'),
    ],
)
def test_a_refusal_is_an_answer(status, fields, text):
    with documented_robot({('PUT', '/robotstate/v1/state'): (status, fields)}) as server:
        reply = ask(server, 'power on')
        assert not reply.ok
        assert text in reply.text
        assert len(server.requests) == 1  # nothing is tried twice


@pytest.mark.parametrize('status', [301, 302, 307, 308])
def test_a_request_follows_a_path_that_has_moved(status):
    old, new = '/robotstate/v1/state', '/robotstate/v2/state'
    with documented_robot(
        {('PUT', old): (status, {}, ('Location', API + new)), ('PUT', new): DONE}
    ) as server:
        assert ask(server, 'power on').ok
        assert server.requests[-1] == ('PUT', new, {'action': 'POWER_ON'})


def test_redirects_end():
    path = '/robotstate/v1/state'
    with (
        documented_robot({('PUT', path): (307, {}, ('Location', API + path))}) as server,
        pytest.raises(OSError, match='redirects more than 3 times'),
    ):
        ask(server, 'power on')


@pytest.mark.parametrize('target', ['http://127.0.0.2/', 'https://127.0.0.1/'])
def test_no_redirect_leads_away_from_the_robot(target):
    path = '/robotstate/v1/state'
    with (
        documented_robot({('PUT', path): (307, {}, ('Location', target))}) as server,
        pytest.raises(OSError, match='redirects to another host, or to HTTPS'),
    ):
        ask(server, 'power on')


def test_a_robot_that_hangs_up_is_named():
    with documented_robot({('GET', '/robotstate/v1/robotmode'): lambda _: None}) as server:
        port = server.server_address[1]
        with pytest.raises(OSError, match=rf'127\.0\.0\.1 port {port} \(Robot API\): it hangs up'):
            ask(server, 'robotmode')


def test_a_robot_that_does_not_answer_holds_neither_the_caller_nor_the_loop(monkeypatch):
    """The answer comes only after the loop has done something else."""
    is_free = threading.Event()

    def wait(_):
        assert is_free.wait(10.0)
        return 200, {'mode': 'RUNNING'}

    async def test():
        waiting = asyncio.create_task(connection(server).request('robotmode'))
        for _ in range(100):
            await asyncio.sleep(0)
        assert not waiting.done()
        monkeypatch.setattr(robot_api_connection, 'ANSWER_TIMEOUT', 0.05)
        with pytest.raises(OSError, match=r'no answer within 0\.05 s'):
            await connection(server).request('robotmode')
        is_free.set()
        assert (await waiting).value == 'RUNNING'

    with documented_robot({('GET', '/robotstate/v1/robotmode'): wait}) as server:
        asyncio.run(asyncio.wait_for(test(), 10.0))


def test_nobody_there_is_named(closed_port):
    with pytest.raises(OSError, match=rf'port {closed_port} \(Robot API\): connection refused'):
        asyncio.run(RobotApiConnection('127.0.0.1', closed_port, NEWEST).request('robotmode'))


def test_an_answer_without_end_is_not_read(monkeypatch):
    monkeypatch.setattr(robot_api_connection, 'MAX_ANSWER_SIZE', 100)
    with (
        documented_robot(
            {('GET', '/robotstate/v1/robotmode'): (200, {'mode': 'x' * 1000})}
        ) as server,
        pytest.raises(OSError, match='longer than 100 bytes'),
    ):
        ask(server, 'robotmode')


def test_a_proxy_of_the_environment_is_not_asked(monkeypatch):
    for name in 'http_proxy', 'HTTP_PROXY', 'all_proxy':
        monkeypatch.setenv(name, 'http://127.0.0.1:1')
    with documented_robot(
        {('GET', '/robotstate/v1/robotmode'): (200, {'mode': 'IDLE'})}
    ) as server:
        assert ask(server, 'robotmode').value == 'IDLE'
