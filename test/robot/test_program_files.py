# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Programs as files: what a robot with PolyScope X is sent, and what its answers mean.

Requests are judged by the standard library, and answers are those of the manufacturer's client
library and of a documentation of the Robot API by others.
"""

import asyncio
from collections.abc import Mapping
from email import message_from_bytes
import json
from types import SimpleNamespace
from typing import Any, cast

from documented_robot import documented_robot
import pytest

from ur_cartesian_driver.motion.errors import LocalProtocolError, RemoteProtocolError
from ur_cartesian_driver.protocol.rtde.rtde_packages import ControllerVersion
from ur_cartesian_driver.robot.services import robot_api_connection
from ur_cartesian_driver.robot.services.program_files import ProgramFiles
from ur_cartesian_driver.robot.services.service_calls import (
    DownloadProgramCall,
    ListProgramsCall,
    MAX_PROGRAM_LENGTH,
    UploadProgramCall,
)

PROGRAMS = '/programs/v1/'
PROGRAM = json.dumps({'program': {'programInformation': {'name': 'weld ä'}}}, ensure_ascii=False)


def carry_out(call, status=200, answer: Mapping[str, Any] | bytes = b'', version=(10, 12)):
    """Return the answer to a call, and the robot that got its requests."""
    link = SimpleNamespace(version=ControllerVersion(major=version[0], minor=version[1], bugfix=0))
    with documented_robot((status, answer)) as robot:
        files = ProgramFiles('127.0.0.1', robot.server_address[1], cast(Any, link))
        return asyncio.run(asyncio.wait_for(files.carry_out(call), 10.0)), robot


def test_programs_are_listed_by_their_names():
    programs = [
        {'name': 'weld', 'description': None, 'createdDate': 1, 'programState': 'FINAL'},
        {'name': 'Default program'},
    ]
    answer, robot = carry_out(ListProgramsCall(), answer={'programs': programs})
    assert (answer.ok, answer.text) == (True, 'weld\nDefault program')
    assert robot.requests == [('GET', PROGRAMS, None)]


@pytest.mark.parametrize('answer', [b'', b'[]', b'{"programs": null}', b'{"programs": [{}]}'])
def test_a_list_without_names_is_an_error(answer):
    with pytest.raises(RemoteProtocolError, match='without the names of its programs'):
        carry_out(ListProgramsCall(), answer=answer)


@pytest.mark.parametrize(('replaces', 'method'), [(False, 'POST'), (True, 'PUT')])
def test_a_program_is_sent_as_the_file_of_a_form(replaces, method):
    answer, robot = carry_out(
        UploadProgramCall(program=PROGRAM, replaces=replaces), answer={'programName': 'weld ä'}
    )
    assert (answer.ok, answer.text) == (True, 'weld ä')
    assert robot.requests == [(method, PROGRAMS, None)]
    [(headers, body)] = robot.contents
    form = message_from_bytes(f'Content-Type: {headers["Content-Type"]}\r\n\r\n'.encode() + body)
    [part] = cast(Any, form.get_payload())
    assert part.get_param('name', header='content-disposition') == 'file'
    assert part.get_filename().endswith('.urpx')
    assert part.get_payload(decode=True).decode() == PROGRAM


@pytest.mark.parametrize('name', ['weld it/ä', 'weld it/ä.urpx'])
def test_a_program_is_downloaded_unchanged(name):
    answer, robot = carry_out(DownloadProgramCall(program_name=name), answer=PROGRAM.encode())
    assert (answer.ok, answer.text) == (True, PROGRAM)
    assert robot.requests == [('GET', PROGRAMS + 'weld%20it%2F%C3%A4', None)]


@pytest.mark.parametrize(
    ('call', 'status', 'remedy'),
    [
        (UploadProgramCall(program=PROGRAM), 400, 'has a program of this name, replace it'),
        (UploadProgramCall(program=PROGRAM, replaces=True), 400, 'log of the robot'),
        (UploadProgramCall(program=PROGRAM), 403, 'switch it to remote control'),
        (UploadProgramCall(program=PROGRAM), 422, 'the content of a .urpx file'),
        (UploadProgramCall(program=PROGRAM, replaces=True), 404, 'Ask for the list'),
        (UploadProgramCall(program=PROGRAM, replaces=True), 409, 'load another one first'),
        (DownloadProgramCall(program_name='weld'), 404, 'Ask for the list'),
        (ListProgramsCall(), 404, 'log of the robot'),
        (ListProgramsCall(), 500, 'log of the robot'),
    ],
)
def test_a_refusal_has_the_words_of_the_robot_and_a_remedy(call, status, remedy):
    answer, _ = carry_out(call, status, {'message': 'No.', 'details': 'Because.'})
    assert not answer.ok
    assert answer.text.startswith(f'The robot refused: HTTP {status} No: Because. ')
    assert remedy in answer.text


@pytest.mark.parametrize('version', [(3, 15), (5, 21), (10, 11)])
def test_other_software_is_not_asked(version):
    answer, robot = carry_out(ListProgramsCall(), version=version)
    assert not answer.ok
    assert (
        f'PolyScope X 10.12 or newer, but the robot runs {version[0]}.{version[1]}' in answer.text
    )
    assert not robot.requests


def test_a_downloaded_program_that_is_no_text_is_refused():
    answer, _ = carry_out(DownloadProgramCall(program_name='weld'), answer=b'{"a": "\xff"}')
    assert (answer.ok, 'damaged' in answer.text) == (False, True)


def test_a_program_that_is_too_long_is_refused_in_both_directions(monkeypatch):
    with pytest.raises(LocalProtocolError, match='upload it on the pendant'):
        UploadProgramCall(program='x' * (MAX_PROGRAM_LENGTH + 1))
    monkeypatch.setattr(robot_api_connection, 'MAX_ANSWER_SIZE', 100)
    with pytest.raises(OSError, match='longer than 100 bytes'):
        carry_out(DownloadProgramCall(program_name='weld'), answer=b'x' * 101)


def test_a_call_without_a_program_is_refused():
    with pytest.raises(LocalProtocolError, match=r'content of a \.urpx file'):
        UploadProgramCall(program=' ')
    with pytest.raises(LocalProtocolError, match='ask for the list of programs'):
        DownloadProgramCall(program_name='')
