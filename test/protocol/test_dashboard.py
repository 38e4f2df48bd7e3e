# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The dashboard, both ends."""

from contextlib import suppress

from hypothesis import given
from hypothesis import strategies as st
import pytest

from ur_cartesian_driver.motion.errors import LocalProtocolError, RemoteProtocolError
from ur_cartesian_driver.protocol.dashboard import (
    BANNER,
    COMMAND_SPECS,
    DashboardClientCodec,
    DashboardGreeting,
    DashboardRequest,
    DashboardServerCodec,
    encode_line,
    not_understood,
    parse_reply,
    success,
)

#: Command, text, answer of a robot, its telling part (None: refused).
ANSWERS = [
    ('load', 'a.urp', 'Loading program: /programs/a.urp', '/programs/a.urp'),
    ('load', 'a.urp', 'File not found: /programs/a.urp', None),
    ('play', '', 'Starting program', ''),
    ('play', '', 'Failed to execute: play', None),
    ('stop', '', 'Stopped', ''),
    ('power on', '', 'Powering on', ''),
    ('brake release', '', 'Brake releasing', ''),
    ('unlock protective stop', '', 'Protective stop releasing', ''),
    ('unlock protective stop', '', 'Cannot unlock until 5 s after the stop', None),
    ('running', '', 'Program running: true', 'true'),
    ('running', '', 'Program running: perhaps', None),
    ('robotmode', '', 'Robotmode: POWER_OFF', 'POWER_OFF'),
    ('safetystatus', '', 'Safetystatus: PROTECTIVE_STOP', 'PROTECTIVE_STOP'),
    ('programState', '', 'STOPPED <unnamed>', 'STOPPED <unnamed>'),
    ('programState', '', 'PLAYING', 'PLAYING'),
    ('programState', '', 'could not understand', None),
    ('PolyscopeVersion', '', 'URSoftware 5.23.0.0 (Jan 01 2026)', '5.23.0.0 (Jan 01 2026)'),
    ('is in remote control', '', 'true', 'true'),
    ('get operational mode', '', 'AUTOMATIC', 'AUTOMATIC'),
    ('get robot model', '', 'UR5', 'UR5'),
    ('get serial number', '', '20195500001', '20195500001'),
    ('version', '', '5.6.0.0', '5.6.0.0'),
    ('set operational mode', 'manual', "Operational mode 'manual' is set", "'manual' is set"),
    ('popup', 'Hello', 'showing popup', ''),
]


@pytest.mark.parametrize(('name', 'argument', 'answer', 'value'), ANSWERS)
def test_success_is_recognized_by_the_form_of_the_reply(name, argument, answer, value):
    client = DashboardClientCodec()
    assert client.feed(encode_line(BANNER)) == [DashboardGreeting(text=BANNER)]
    line = client.send(name, argument)
    assert line == (f'{name} {argument}' if argument else name).encode() + b'\n'
    (reply,) = client.feed(encode_line(answer))
    assert (reply.ok, reply.value, reply.text) == (value is not None, value, answer)
    assert reply.request == DashboardRequest(name=name, argument=argument)


TEXTS = {
    'load': 'x.urp',
    'popup': 'Hi',
    'addToLog': 'Hi',
    'setUserRole': 'operator',
    'load installation': 'default.installation',
    'set operational mode': 'automatic',
    'generate flight report': 'system',
    'generate support file': '/tmp',
}
VALUES = {
    'robotmode': 'IDLE',
    'safetymode': 'NORMAL',
    'safetystatus': 'NORMAL',
    'get loaded program': '/programs/a.urp',
    'PolyscopeVersion': '5.21.0.0 (Jan 01 2026)',
    'clear operational mode': 'Selectable again',
    'running': 'true',
    'isProgramSaved': 'true a.urp',
    'programState': 'PAUSED a.urp',
    'version': '5.6.0.0',
    'getUserRole': 'NONE',
    'get operational mode': 'MANUAL',
    'is in remote control': 'false',
    'get serial number': '20195500001',
    'get robot model': 'UR5',
}


@pytest.mark.parametrize('name', COMMAND_SPECS)
def test_the_two_ends_understand_each_other(name):
    client, server = DashboardClientCodec(), DashboardServerCodec()
    client.feed(encode_line(BANNER))
    (request,) = server.feed(client.send(name, TEXTS.get(name, '')))
    assert request == DashboardRequest(name=name, argument=TEXTS.get(name, ''))
    (reply,) = client.feed(success(request, VALUES.get(name)))
    assert reply.ok


def test_the_longer_of_two_matching_commands_is_parsed():
    assert DashboardServerCodec().feed(b'load installation a\nload installations\n') == [
        DashboardRequest(name='load installation', argument='a'),
        DashboardRequest(name='load', argument='installations'),
    ]


def test_software_that_lacks_a_command_does_not_parse_it():
    assert DashboardServerCodec((5, 3)).feed(b'safetystatus\n') == ['safetystatus']


@pytest.mark.parametrize('line', ['brake_release', 'play it', 'load', '', 'Playing'])
def test_a_line_that_is_not_a_command_is_returned_and_answered(line):
    assert DashboardServerCodec().feed(line.encode() + b'\r\n') == [line]
    answer = not_understood(line).decode().rstrip('\n')
    assert not parse_reply(DashboardRequest(name='play'), answer).ok


@pytest.mark.parametrize(
    ('name', 'line', 'value'),
    [
        # In the words of CB robots, and of a pendant in Chinese.
        ('isProgramSaved', 'True', 'True'),
        ('isProgramSaved', 'False a.urp', 'False a.urp'),
        ('programState', 'STOPPED <\u672a\u547d\u540d>', 'STOPPED <\u672a\u547d\u540d>'),
        (
            'PolyscopeVersion',
            'URSoftware 5.21.3.1 (\u4e09\u6708 14 2025)',
            '5.21.3.1 (\u4e09\u6708 14 2025)',
        ),
    ],
)
def test_other_words_of_robots_are_understood(name, line, value):
    client = DashboardClientCodec()
    client.feed(encode_line(BANNER))
    client.send(name)
    (reply,) = client.feed(encode_line(line))
    assert reply.value == value


@pytest.mark.parametrize(
    ('name', 'argument'),
    [('fly', ''), ('load', ''), ('play', 'now'), ('popup', 'two\nplay'), ('addToLog', 'a\rb')],
)
def test_an_invalid_command_cannot_be_sent(name, argument):
    with pytest.raises(LocalProtocolError):
        DashboardClientCodec().send(name, argument)


@pytest.mark.parametrize(
    ('name', 'version', 'available'),
    [
        ('safetystatus', (3, 15), False),
        ('safetystatus', (5, 3), False),
        ('safetystatus', (5, 4), True),
        ('setUserRole', (3, 15), True),
        ('setUserRole', (5, 9), False),
        ('restart safety', (5, 0), False),
        ('restart safety', (3, 7), True),
        ('play', (5, 0), True),
    ],
)
def test_commands_have_a_first_version(name, version, available):
    assert COMMAND_SPECS[name].is_available(version) is available


def test_replies_match_commands_in_order_also_in_pieces():
    client = DashboardClientCodec()
    client.send('robotmode')
    client.send('play')
    stream = encode_line(BANNER) + b'Robotmode: IDLE\r\n' + b'Starting program\n'
    events = [e for i in range(len(stream)) for e in client.feed(stream[i : i + 1])]
    assert [event.text for event in events] == [BANNER, 'Robotmode: IDLE', 'Starting program']
    assert [event.ok for event in events[1:]] == [True, True]
    assert client.feed(b'') == []


def test_a_reply_without_a_command_is_an_error():
    client = DashboardClientCodec()
    client.feed(encode_line(BANNER))
    with pytest.raises(RemoteProtocolError, match='no command waits for a reply'):
        client.feed(b'Stopped\n')


def test_an_end_instead_of_a_reply_is_an_error():
    client = DashboardClientCodec()
    client.send('play')
    with pytest.raises(RemoteProtocolError, match='play'):
        client.feed(b'')


def test_the_number_of_waiting_commands_is_bounded():
    client = DashboardClientCodec()
    for _ in range(64):
        client.send('play')
    with pytest.raises(LocalProtocolError, match='wait for a reply'):
        client.send('play')


@given(st.lists(st.binary(min_size=1, max_size=30)))
def test_random_bytes_raise_nothing_but_a_remote_error(chunks):
    client, server = DashboardClientCodec(), DashboardServerCodec()
    client.send('programState')
    for end in (client, server):
        with suppress(RemoteProtocolError):
            for chunk in chunks:
                end.feed(chunk)
