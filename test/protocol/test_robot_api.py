# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The Robot API's requests for each version, and what its answers mean."""

import json

import pytest

from ur_cartesian_driver.motion.errors import LocalProtocolError, RemoteProtocolError
from ur_cartesian_driver.protocol.dashboard import COMMAND_SPECS, DashboardRequest
from ur_cartesian_driver.protocol.robot_api import (
    API_COMMANDS,
    encode_body,
    find_command,
    FIRST_VERSION,
    parse_answer,
)


def parse(name, status, body, argument=''):
    return parse_answer(
        DashboardRequest(name=name, argument=argument), find_command(name, (10, 14)), status, body
    )


def test_commands_are_those_of_the_dashboard_and_the_newest_request_comes_first():
    assert set(API_COMMANDS) <= set(COMMAND_SPECS)
    for requests in API_COMMANDS.values():
        versions = [request.since for request in requests]
        assert versions == sorted(versions, reverse=True)
        assert versions[-1] >= FIRST_VERSION


@pytest.mark.parametrize(
    ('version', 'path', 'body'),
    [
        ((10, 11), '/program/v1/load', {'programName': 'a "b"'}),
        ((10, 12), '/program/v1/loaded', {'name': 'a "b"'}),
        ((10, 15), '/program/v1/loaded', {'name': 'a "b"'}),
    ],
)
def test_a_request_is_that_of_the_version(version, path, body):
    command = find_command('load', version)
    assert command.path == path
    assert json.loads(encode_body(command, 'a "b"')) == body


@pytest.mark.parametrize(
    ('name', 'version'), [('power on', (10, 10)), ('robotmode', (10, 11)), ('quit', (10, 14))]
)
def test_a_version_without_a_command_is_an_error(name, version):
    with pytest.raises(LocalProtocolError, match=f'{version[0]}.{version[1]} has no {name!r}'):
        find_command(name, version)


def test_a_request_without_fields_has_no_body():
    assert encode_body(find_command('close popup', (10, 14)), '') == b''


@pytest.mark.parametrize(
    ('name', 'body', 'value'),
    [
        ('robotmode', b'{"mode": "IDLE", "message": null}', 'IDLE'),
        ('is in remote control', b'{"mode": "REMOTE"}', 'true'),
        ('is in remote control', b'{"mode": "LOCAL"}', 'false'),
        ('running', b'{"state": "PAUSED"}', 'false'),
        ('power on', b'{"message": "done"}', ''),
        ('power on', b'', ''),
        ('power on', b'[1, 2]', ''),
    ],
)
def test_a_success_has_its_value(name, body, value):
    reply = parse(name, 200, body)
    assert reply.ok
    assert reply.value == value


@pytest.mark.parametrize(
    'body', [b'', b'{}', b'{"mode": 3}', b'<html>', b'\xff\xfe', b'[' * 100_000]
)
def test_a_success_without_the_value_is_an_error(body):
    with pytest.raises(RemoteProtocolError, match="without the field 'mode'"):
        parse('robotmode', 200, body)


@pytest.mark.parametrize(
    ('status', 'body', 'text'),
    [
        (403, b'{"message": "Forbidden", "details": "Not\\nauthorized."}', 'Forbidden: Not auth'),
        (409, b'{"message": "Conflict", "details": ""}', 'HTTP 409 Conflict'),
        (422, b'{"detail": [{"msg": "field required"}]}', 'HTTP 422 [{"msg": "field required"}]'),
        (502, b'<html>Bad gateway</html>', 'HTTP 502'),
        (500, json.dumps({'message': 'x' * 9999}).encode(), 'HTTP 500 xxx'),
    ],
)
def test_a_refusal_has_the_words_of_the_robot_on_one_bounded_line(status, body, text):
    reply = parse('power on', status, body)
    assert not reply.ok
    assert text in reply.text
    assert '\n' not in reply.text
    assert len(reply.text) < 1000
