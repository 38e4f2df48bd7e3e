# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The nodes of External Control in a controller without a network, whose host is the test."""

import errno
import logging

import pytest

from ur_cartesian_driver.motion.state.rtde_state import RuntimeState
from ur_cartesian_driver.sim.interfaces.dashboard_session import DashboardSession
from ur_cartesian_driver.sim.interfaces.robot_api_session import BASE_PATH, RobotApiSession
from ur_cartesian_driver.sim.pendant_programs.program_tree import (
    ExternalControlNode,
    ProgramTree,
    ScriptText,
)

NODE = ExternalControlNode()
TEXT = """lines before the header are dropped
# HEADER_BEGIN
def greet(who):
  textmsg("hello ", who)
end
# HEADER_END
# NODE_CONTROL_LOOP_BEGINS
greet("you")
# NODE_CONTROL_LOOP_ENDS

"""
REFUSED = OSError(errno.ECONNREFUSED, 'x')
CB3 = {'model': 'ur5', 'polyscope': '3.15'}
E_SERIES = {'polyscope': '5.21'}
X = {'polyscope': '10.12'}


class Host:
    """The host that answers, now or when the test wants it."""

    def __init__(self, bench, answer=None):
        self.answer, self.waiting = answer, []
        bench.controller.external_control.request = self.request

    def request(self, then):
        if self.answer is None:
            self.waiting.append(then)
        else:
            then(self.answer)


@pytest.fixture
def make(bench):
    def make(answer=None, nodes=(NODE,), *, loops=False, **settings):
        tree = ProgramTree(nodes, loops=loops)
        robot = type(bench)(programs={'a.urp': tree}, program='a.urp', **settings)
        return robot, Host(robot, answer)

    return make


def ask(bench, *commands):
    session = DashboardSession(bench.controller)
    session.open()
    answers = []
    for command in commands:
        answer = session.feed(f'{command}\n'.encode())
        while not answer:
            bench.step()
            answer = session.feed(b'')
        answers.append(answer.decode().strip())
    return answers


@pytest.mark.parametrize('robot', [CB3, E_SERIES, X])
def test_the_program_has_text_before_and_behind_its_nodes(make, robot):
    nodes = (ScriptText('textmsg("before")'), NODE, ScriptText('textmsg("behind")'), NODE)
    bench, _ = make(TEXT, nodes, **robot)
    assert bench.programs.play() == ''
    bench.until(lambda: bench.programs.state is RuntimeState.STOPPED)
    assert bench.log == ['before', 'hello you', 'behind', 'hello you']


@pytest.mark.parametrize('robot', [CB3, E_SERIES])
def test_a_program_that_begins_again_takes_the_text_of_its_start(make, robot):
    bench, host = make(TEXT, (NODE, ScriptText('sync()')), loops=True, **robot)
    bench.programs.play()
    host.answer = REFUSED
    bench.until(lambda: bench.log.count('hello you') == 3)


def test_a_text_without_a_header_is_taken_as_it_is(make):
    bench, _ = make('textmsg("plain")\n')
    bench.programs.play()
    bench.until(lambda: bench.log == ['plain'])


@pytest.mark.parametrize(
    ('failure', 'reason'),
    [
        (REFUSED, 'Connection refused'),
        (TimeoutError(), 'connect timed out'),
        (OSError(errno.EHOSTUNREACH, 'x'), 'No route to host'),
        (OSError(-2, 'Name or service not known'), '10.0.0.1'),
    ],
)
def test_the_window_of_the_urcap_says_why(make, caplog, failure, reason):
    nodes = (NODE, ScriptText('textmsg("behind")'))
    bench, _ = make(failure, nodes, external_control_host='10.0.0.1', external_control_port=7)
    with caplog.at_level(logging.WARNING):
        bench.programs.play()
    bench.wait(0.1)
    (popup,) = bench.controller.popups
    assert popup.text == (
        f'The connection to the remote PC at 10.0.0.1:7 could not be established. Reason: {reason}'
    )
    assert (popup.title, popup.error) == ('Receive program failed', True)
    assert popup.text in caplog.text
    assert bench.log == [f'External Control: {popup.text}']
    # The program runs and waits for a person, and goes on behind the node.
    assert bench.programs.state is RuntimeState.PLAYING
    assert ask(bench, 'close popup') == ['closing popup']
    bench.until(lambda: bench.programs.state is RuntimeState.STOPPED)
    assert bench.log[-1] == 'behind'


@pytest.mark.parametrize(
    ('answer', 'reason'),
    [
        (REFUSED, '[Errno 111] Connection refused'),
        (TimeoutError(), 'timed out'),
        (TimeoutError('Connection timeout'), 'Connection timeout'),
        (OSError(-2, 'Name or service not known'), '[Errno -2] Name or service not known'),
        ('\n', 'Did not receive any script lines'),
    ],
)
def test_the_node_of_the_urcapx_does_nothing(make, answer, reason):
    bench, _ = make(answer, (NODE, ScriptText('textmsg("behind")')), **X)
    bench.programs.play()
    bench.until(lambda: 'behind' in bench.log)
    sentence = f'External Control: Connectivity problem with 127.0.0.1:50002: {reason}'
    assert bench.log == [sentence, 'behind']
    assert not bench.controller.popups


@pytest.mark.parametrize('text', ['', 'this is no URScript\n'])
def test_a_text_that_is_no_urscript_does_not_start(make, text):
    bench, _ = make(text, polyscope='5.21')
    assert ask(bench, 'play') == ['Starting program']
    bench.wait(0.1)
    assert bench.programs.state is RuntimeState.STOPPED
    assert 'syntax_error' in bench.log[-1]


def test_clients_of_the_dashboard_see_what_they_see_on_a_robot(bench):
    host = Host(bench)
    assert ask(bench, 'load /ursim/programs/external_control.urp', 'play', 'programState') == [
        'Loading program: /ursim/programs/external_control.urp',
        'Starting program',
        'STOPPED external_control.urp',
    ]
    host.waiting[0]('while True:\nsync()\nend\n')
    bench.step()
    assert ask(bench, 'programState', 'get loaded program', 'running', 'stop', 'play') == [
        'PLAYING external_control.urp',
        'Loaded program: /programs/external_control.urp',
        'Program running: true',
        'Stopped',
        'Starting program',
    ]
    assert len(host.waiting) == 2  # fetched anew


def test_the_robot_api_answers_when_the_program_has_started(make):
    bench, host = make(**X)
    session = RobotApiSession(bench.controller)
    body = b'{"action": "play"}'
    request = f'PUT {BASE_PATH}/program/v1/state HTTP/1.1\r\nContent-Length: {len(body)}\r\n\r\n'
    assert session.feed(request.encode() + body) == b''
    bench.wait(1.0)
    assert session.answers() == b''
    host.waiting[0](REFUSED)
    bench.step(2)  # by then the empty program has ended
    assert session.answers().startswith(b'HTTP/1.1 200 ')


def test_a_second_play_does_not_fetch_twice(make):
    bench, host = make()
    assert ask(bench, 'play', 'play') == ['Starting program'] * 2
    assert len(host.waiting) == 1


@pytest.mark.parametrize('end', ['stop', 'load external_control.urp', 'another program'])
def test_a_start_that_waits_is_given_up(make, end):
    bench, host = make()
    bench.programs.play()
    if end == 'another program':
        bench.start('while True:\nsync()\nend')
    else:
        ask(bench, end)
    host.waiting[0](TEXT)
    bench.wait(0.1)
    assert 'hello you' not in bench.log
    assert bench.programs.running == (end == 'another program')


def test_an_arm_that_is_stopped_meanwhile_does_not_start(make):
    bench, host = make()
    bench.programs.play()
    bench.controller.power_off()
    host.waiting[0](TEXT)
    bench.programs.play()
    assert bench.log == []
    assert ask(bench, 'play') == ['Failed to execute: play']


def test_without_a_network_the_window_says_so(bench):
    ask(bench, 'load external_control.urp', 'play')
    assert 'Network is unreachable' in bench.log[-1]


def test_resuming_does_not_fetch(make):
    bench, host = make('while True:\nsync()\nend\n')
    bench.programs.play()
    bench.wait(0.1)
    host.answer = None
    ask(bench, 'pause')
    bench.wait(0.1)
    ask(bench, 'play')
    bench.wait(0.1)
    assert bench.programs.state is RuntimeState.PLAYING
    assert not host.waiting
