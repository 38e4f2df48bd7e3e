# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The primary interface: messages go to their listeners, nonsense ends the connection."""

import asyncio
import contextlib
from math import nan

import pytest
from virtual_network import HOST, VirtualLoop

from ur_cartesian_driver.protocol.client_interfaces import primary_messages as primary
from ur_cartesian_driver.protocol.client_interfaces.primary_state import KinematicsInfo
from ur_cartesian_driver.robot.primary_client import PrimaryCallbacks, PrimaryClient

PORT = 30001
SIX = (0.0,) * 6


def told_by(*frames):
    """Let a server send frames; return the client's reports until it hangs up, at most 0.5 s."""
    news = []

    async def scene():
        def note(kind):
            return lambda value: news.append((kind, value))

        client = PrimaryClient(
            PrimaryCallbacks(
                **{
                    kind: note(kind)
                    for kind in (
                        'configuration',
                        'geometry',
                        'error',
                        'connection_error',
                        'failures',
                        'text',
                    )
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


@pytest.mark.parametrize(
    ('text', 'report'),
    [
        (
            'compile_error_name_not_found:nope:',
            'the robot cannot compile a program that it was sent: an error in line 2, column 3: '
            'compile_error_name_not_found:nope:',
        ),
        (
            'syntax_error_on_line:2:  x = = 1:',
            'the robot cannot compile a program that it was sent: an error in line 2, column 3: '
            'syntax_error_on_line:2:  x = = 1:',
        ),
        (
            'Index is out of range',
            'the robot program failed in line 2, column 3: Index is out of range',
        ),
    ],
)
def test_a_program_that_never_ran_is_not_said_to_have_failed(text, report):
    """It may be another client's, while ours goes on."""
    frame = primary.encode_message(primary.RuntimeExceptionMessage(line=2, column=3, text=text))
    assert told_by(frame)[0] == ('error', report)


# ---- requests on a connection that is read-only -------------------------------------------------

READ_ONLY = primary.encode_message(primary.ErrorCodeMessage(code=210, level=3))
REQUEST = b'stop program\n'


class Robot:
    """A port that refuses what comes on its first connections."""

    def __init__(self, refusing=1):
        self.refusing = refusing
        #: What came on each connection.
        self.received = []

    async def serve(self, reader, writer):
        number = len(self.received)
        self.received.append(b'')
        with contextlib.suppress(ConnectionError):
            while data := await reader.read(1000):
                self.received[number] += data
                if number < self.refusing:
                    writer.write(READ_ONLY)
        writer.close()


def sent_to(robot, scene):
    """Run ``scene(client)`` with a client that is connected; return the errors that it reports."""
    errors = []

    async def scenario():
        client = PrimaryClient(
            PrimaryCallbacks(
                configuration=lambda _: None,
                geometry=lambda _: None,
                error=errors.append,
                connection_error=errors.append,
                failures=errors.append,
                text=lambda _: None,
            )
        )
        await asyncio.start_server(robot.serve, HOST, PORT)
        holding = asyncio.create_task(client.stay_connected(HOST, PORT))
        await asyncio.sleep(0.1)
        await scene(client)
        await asyncio.sleep(0.1)
        holding.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await holding

    with asyncio.Runner(loop_factory=VirtualLoop) as runner:
        runner.run(scenario())
    return errors


def request(*, is_wanted=lambda: True):
    async def scene(client):
        assert client.send(REQUEST, is_wanted)

    return scene


def test_a_request_that_was_refused_is_sent_on_a_new_connection():
    robot = Robot()
    assert sent_to(robot, request()) == []
    assert robot.received == [REQUEST, REQUEST]


def test_a_request_is_sent_again_only_once_and_then_the_refusal_is_reported():
    robot = Robot(refusing=9)
    (error,) = sent_to(robot, request())
    assert 'C210' in error
    assert robot.received == [REQUEST, REQUEST]


def test_a_request_that_is_no_longer_wanted_is_not_sent_again():
    robot = Robot()
    assert sent_to(robot, request(is_wanted=lambda: False)) == []
    assert robot.received == [REQUEST, b'']


def test_a_refusal_of_what_another_client_sent_is_reported():
    class RobotOfOthers(Robot):
        async def serve(self, reader, writer):
            self.received.append(b'')
            await asyncio.sleep(1.5)
            writer.write(READ_ONLY)
            await reader.read()
            writer.close()

    robot = RobotOfOthers()

    async def scene(client):
        assert client.send(REQUEST, lambda: True)
        await asyncio.sleep(2.0)

    (error,) = sent_to(robot, scene)
    assert 'C210' in error
    assert len(robot.received) == 1


def test_what_comes_while_it_connects_again_is_sent_then():
    robot = Robot(refusing=0)

    async def scene(client):
        client.reconnect()
        assert client.send(REQUEST, lambda: True)

    assert sent_to(robot, scene) == []
    assert robot.received == [b'', REQUEST]


def test_a_robot_that_hangs_up_at_each_attempt_is_logged_once():
    class BusyRobot(Robot):
        async def serve(self, reader, writer):
            self.received.append(b'')
            writer.close()

    robot = BusyRobot()
    (error,) = sent_to(robot, lambda _: asyncio.sleep(30.0))
    assert 'closed' in error
    assert len(robot.received) > 10
