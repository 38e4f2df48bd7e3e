# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The dashboard client with dashboards of all kinds, and its sentences for refusals."""

import asyncio
import contextlib

import pytest

from ur_cartesian_driver.motion.errors import ProtocolError
from ur_cartesian_driver.motion.state.rtde_state import (
    RobotMode,
    RobotState,
    RuntimeState,
    SafetyMode,
)
from ur_cartesian_driver.protocol.dashboard import COMMAND_SPECS
from ur_cartesian_driver.protocol.rtde.rtde_packages import ControllerVersion
from ur_cartesian_driver.robot.services import dashboard_connection
from ur_cartesian_driver.robot.services.dashboard_connection import (
    DashboardConnection,
    explain_refusal,
    REPLACEMENTS,
    TOO_EARLY,
    unavailable_reason,
)


class RecordedConnection(DashboardConnection):
    def __init__(self, port, asked):
        super().__init__('127.0.0.1', port)
        self.asked = asked


@contextlib.asynccontextmanager
async def dashboard(*chunks, greeting=b'Connected\n', hang_up=False):
    """Serve a dashboard that answers a line with chunks of bytes; yields its client."""
    asked = []

    async def serve(reader, writer):
        writer.write(greeting)
        with contextlib.suppress(ConnectionError):
            asked.append(await reader.readline())
            for chunk in chunks:
                writer.write(chunk)
                await writer.drain()
            if not hang_up:
                await reader.read()
        writer.close()

    server = await asyncio.start_server(serve, '127.0.0.1', 0)
    async with server:
        yield RecordedConnection(server.sockets[0].getsockname()[1], asked)


def run(test):
    return asyncio.run(asyncio.wait_for(test(), 10.0))


def test_an_answer_is_told_from_a_refusal():
    async def test():
        async with dashboard(b'Powering on\n') as client:
            assert (await client.request('power on')).ok
            assert client.asked == [b'power on\n']
        async with dashboard(b'Failed to execute: power on\n') as client:
            reply = await client.request('power on')
            assert not reply.ok
            assert reply.text == 'Failed to execute: power on'

    run(test)


def test_an_answer_in_pieces_is_one():
    async def test():
        async with dashboard(b'Robot', b'mode: RUN', b'NING\n') as client:
            assert (await client.request('robotmode')).value == 'RUNNING'
        async with dashboard(b'what', b'ever\n') as client:
            assert await client.request_raw('anything') == 'whatever'

    run(test)


def test_a_dashboard_that_hangs_up_is_named():
    async def test():
        async with dashboard(hang_up=True) as client:
            with pytest.raises(OSError, match=r'127\.0\.0\.1 port \d+ \(dashboard\): the other'):
                await client.request('play')

    run(test)


def test_a_dashboard_that_says_nothing_does_not_hold_anybody(monkeypatch):
    monkeypatch.setattr(dashboard_connection, 'ANSWER_TIMEOUT', 0.05)

    async def test():
        async with dashboard() as client:
            with pytest.raises(OSError, match='does not answer within'):
                await client.request('play')

    run(test)


def test_a_report_may_take_longer_than_other_answers(monkeypatch):
    monkeypatch.setattr(dashboard_connection, 'ANSWER_TIMEOUT', 0.0)

    async def test():
        answer = b'Completed successfully: ur_20241234567_2026-01-02_03-04-05.zip\n'
        async with dashboard(answer) as client:
            reply = await client.request('generate support file', '.')
            assert reply.value == 'ur_20241234567_2026-01-02_03-04-05.zip'
            assert client.asked == [b'generate support file .\n']

    run(test)


def test_nobody_there_is_named(closed_port):
    async def test():
        with pytest.raises(OSError, match=f'127.0.0.1 port {closed_port}'):
            await DashboardConnection('127.0.0.1', closed_port).request('play')

    run(test)


@pytest.mark.parametrize('noise', [b'x' * 9000 + b'\n', b'x' * 20000])
def test_a_line_without_end_is_an_error_and_not_kept(noise):
    async def test():
        async with dashboard(noise) as client:
            with pytest.raises(ProtocolError, match='longer than 8192'):
                await client.request_raw('anything')

    run(test)


def test_requests_at_the_same_time_do_not_mix():
    async def test():
        async with dashboard(b'Robotmode: IDLE\n') as client:
            replies = await asyncio.gather(*[client.request('robotmode') for _ in range(5)])
            assert [reply.value for reply in replies] == ['IDLE'] * 5

    run(test)


def version(text):
    major, minor, bugfix = (int(part) for part in text.split('.'))
    return ControllerVersion(major=major, minor=minor, bugfix=bugfix)


@pytest.mark.parametrize(
    ('command', 'software', 'reason'),
    [
        ('power on', '5.21.0', ''),
        ('power on', '3.15.0', ''),
        ('power on', '10.11.0', ''),
        ('load', '10.11.0', ''),
        ('robotmode', '10.12.0', ''),
        ('power on', '10.8.0', 'has this command from software 10.11 on, but the robot runs 10.8'),
        ('power on', '10.8.0', '; call recover, or do it on the pendant.'),
        (
            'robotmode',
            '10.11.0',
            'from software 10.12 on, but the robot runs 10.11.0.0; see the t',
        ),
        ('safetystatus', '10.14.0', 'Robot API has no such command; see the topic safety_mode.'),
        ('is in remote control', '5.5.0', 'needs software 5.6 or newer'),
        ('is in remote control', '3.15.0', 'has no command'),
        ('restart safety', '3.6.0', 'needs software 3.7 or newer'),
    ],
)
def test_software_without_a_command_is_explained(command, software, reason):
    why = unavailable_reason(command, version(software))
    assert bool(why) == bool(reason)
    assert reason in why


def test_what_serves_instead_is_said_of_commands_that_exist():
    assert set(REPLACEMENTS) <= set(COMMAND_SPECS)


def robot(**fields):
    return RobotState(timestamp=1.0, actual_q=(0.0,) * 6, **fields)


STOPPED = robot(safety_mode=SafetyMode.ROBOT_EMERGENCY_STOP)
PROTECTED = robot(safety_mode=SafetyMode.PROTECTIVE_STOP)


@pytest.mark.parametrize(
    ('command', 'answer', 'state', 'remote', 'hint'),
    [
        ('play', 'Failed to execute: play', robot(), False, 'switch it to remote control'),
        ('play', 'Failed to execute: play', None, None, 'no RTDE connection'),
        ('power on', 'Failed to execute: power on', STOPPED, True, 'ROBOT_EMERGENCY_STOP'),
        ('play', 'Failed to execute: play', robot(robot_mode=RobotMode.IDLE), True, 'brakes'),
        ('play', 'Failed to execute: play', robot(), True, 'load_program'),
        ('pause', 'Failed to execute: pause', robot(), True, 'No program is running'),
        ('load', 'File not found: x', robot(), True, 'folder of programs'),
        ('get loaded program', 'No program loaded', robot(), None, 'Load one'),
        ('load', 'Error', robot(runtime_state=RuntimeState.PLAYING), True, 'stop it first'),
        ('unlock protective stop', TOO_EARLY + ' until 5s', robot(), None, 'Wait until 5 s'),
        ('unlock protective stop', 'HTTP 409 Conflict', PROTECTED, True, 'Wait until 5 s'),
        ('power on', 'HTTP 403 Forbidden', robot(), None, 'switch it to remote control'),
    ],
)
def test_a_refusal_is_explained(command, answer, state, remote, hint):
    text = explain_refusal(command, answer, state, remote)
    assert answer in text
    assert hint in text
