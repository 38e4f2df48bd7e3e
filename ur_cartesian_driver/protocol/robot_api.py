# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The Robot API of PolyScope X, which replaces the dashboard of other robots: HTTP with JSON.

Commands keep the names that they have on the dashboard, so a service call works on every robot;
:data:`API_COMMANDS` has the requests for each name. The robot describes its own version of the API
at ``/docs`` and ``/openapi.json`` below :data:`BASE_PATH`, on port 80.

A request that changes the robot is answered after the change. The status is 403 unless the robot
is in remote control, 409 if its present state does not allow the change, 504 if the change takes
too long. An error has the fields ``message`` and ``details``; the answer to an invalid request
has ``detail``.

Paths, bodies and first versions come from Universal Robots' client library 2.14
(``dashboard_client_implementation_x.cpp``); the statuses come from this library and other clients.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
import json
from typing import Any

from ur_cartesian_driver.motion.errors import LocalProtocolError, RemoteProtocolError
from ur_cartesian_driver.protocol.dashboard import DashboardReply, DashboardRequest

BASE_PATH = '/universal-robots/robot-api'
#: The first software with a Robot API; older PolyScope X has neither this API nor a dashboard.
FIRST_VERSION = (10, 11)
#: Beginning of a refusal if the robot is in local control.
FORBIDDEN = 'HTTP 403'
#: Beginning of a refusal if the robot's state does not allow the request.
CONFLICT = 'HTTP 409'

_STATE, _PROGRAM = '/robotstate/v1/state', '/program/v1/state'
_POPUP, _INFORMATION = '/popup/v1', '/system/v1/information'


@dataclass(frozen=True, slots=True, kw_only=True)
class ApiCommand:
    """
    The request of one command.

    :param body: the JSON of the request; ``{}`` stands for the argument. Empty = without a body.
    :param value: the field of the answer that holds the value; empty = without a value.
    :param words: maps some values to the words of the dashboard.
    :param since: the first software that has the request.
    """

    method: str
    path: str
    body: Mapping[str, str] = field(default_factory=dict)
    value: str = ''
    words: Mapping[str, str] = field(default_factory=dict)
    since: tuple[int, int] = FIRST_VERSION


def _action(path: str, action: str) -> ApiCommand:
    return ApiCommand(method='PUT', path=path, body={'action': action})


def _query(
    path: str, value: str, since: tuple[int, int], words: Mapping[str, str] | None = None
) -> ApiCommand:
    return ApiCommand(method='GET', path=path, value=value, since=since, words=words or {})


#: The requests of the dashboard's commands, the newest of each first.
API_COMMANDS: Mapping[str, tuple[ApiCommand, ...]] = {
    'power on': (_action(_STATE, 'POWER_ON'),),
    'power off': (_action(_STATE, 'POWER_OFF'),),
    'brake release': (_action(_STATE, 'BRAKE_RELEASE'),),
    'unlock protective stop': (_action(_STATE, 'UNLOCK_PROTECTIVE_STOP'),),
    'restart safety': (_action(_STATE, 'RESTART_SAFETY'),),
    'load': (
        ApiCommand(method='PUT', path='/program/v1/loaded', body={'name': '{}'}, since=(10, 12)),
        ApiCommand(method='PUT', path='/program/v1/load', body={'programName': '{}'}),
    ),
    'play': (_action(_PROGRAM, 'play'),),
    'pause': (_action(_PROGRAM, 'pause'),),
    'stop': (_action(_PROGRAM, 'stop'),),
    'programState': (_query(_PROGRAM, 'state', FIRST_VERSION),),
    'running': (
        _query(
            _PROGRAM,
            'state',
            FIRST_VERSION,
            {'PLAYING': 'true', 'PAUSED': 'false', 'STOPPED': 'false'},
        ),
    ),
    'robotmode': (_query('/robotstate/v1/robotmode', 'mode', (10, 12)),),
    'safetymode': (_query('/robotstate/v1/safetymode', 'mode', (10, 12)),),
    'get loaded program': (_query('/program/v1/loaded', 'name', (10, 12)),),
    'get operational mode': (_query('/system/v1/operationalmode', 'mode', (10, 12)),),
    'is in remote control': (
        _query(
            '/system/v1/controlmode',
            'mode',
            (10, 12),
            {'REMOTE': 'true', 'LOCAL': 'false'},
        ),
    ),
    'PolyscopeVersion': (_query('/versions/v1', 'marketingVersion', (10, 14)),),
    'get robot model': (_query(_INFORMATION, 'robotType', (10, 14)),),
    'get serial number': (_query(_INFORMATION, 'serialNumber', (10, 14)),),
    'popup': (
        ApiCommand(
            method='POST',
            path=_POPUP,
            body={'title': 'Message', 'message': '{}'},
            since=(10, 14),
        ),
    ),
    'close popup': (ApiCommand(method='DELETE', path=_POPUP, since=(10, 14)),),
    'close safety popup': (ApiCommand(method='DELETE', path=f'{_POPUP}/safety', since=(10, 14)),),
    'addToLog': (
        ApiCommand(method='POST', path='/system/v1/log', body={'message': '{}'}, since=(10, 14)),
    ),
    # There is one kind of report: the type, the argument on the dashboard, is not sent.
    'generate flight report': (
        ApiCommand(method='POST', path='/supportfiles/v1', since=(10, 14)),
    ),
    'shutdown': (ApiCommand(method='PUT', path='/system/v1/shutdown', since=(10, 14)),),
}
#: The requests for programs as files; ``{}`` in a path stands for the name of a program.
LIST_PROGRAMS = ApiCommand(method='GET', path='/programs/v1/', since=(10, 12))
UPLOAD_PROGRAM = ApiCommand(method='POST', path='/programs/v1/', since=(10, 12))
UPDATE_PROGRAM = ApiCommand(method='PUT', path='/programs/v1/', since=(10, 12))
DOWNLOAD_PROGRAM = ApiCommand(method='GET', path='/programs/v1/{}', since=(10, 12))
#: The request for ``play`` if the program is paused: the dashboard has one command for both cases.
RESUME = _action(_PROGRAM, 'resume')


def find_command(name: str, version: tuple[int, int]) -> ApiCommand:
    """
    Return the request for a command in a software version.

    :raises LocalProtocolError: the version has no such request.
    """
    for command in API_COMMANDS.get(name, ()):
        if version >= command.since:
            return command
    raise LocalProtocolError(
        f'The Robot API of PolyScope X {version[0]}.{version[1]} has no {name!r}.'
    )


def encode_body(command: ApiCommand, argument: str) -> bytes:
    """Return the body of a request; empty = without a body."""
    if not command.body:
        return b''
    return json.dumps(
        {name: text.replace('{}', argument) for name, text in command.body.items()}
    ).encode()


def parse_answer(
    request: DashboardRequest, command: ApiCommand, status: int, body: bytes
) -> DashboardReply:
    """
    Return an answer in the form of a dashboard reply.

    :raises RemoteProtocolError: the request succeeded, but the answer lacks the requested value.
    """
    if not 200 <= status < 300:
        return DashboardReply(request=request, text=refusal_text(status, body), value=None)
    fields = _fields(body)
    value = ''
    if command.value:
        found = fields.get(command.value)
        if not isinstance(found, str):
            raise RemoteProtocolError(
                f'The Robot API answers {request.name!r} without the field {command.value!r}: '
                f'{body!r:.200}.'
            )
        value = command.words.get(found, found)
    return DashboardReply(request=request, text=_text(fields.get('message')) or 'OK', value=value)


def refusal_text(status: int, body: bytes) -> str:
    """Return the words of a refusal on one line."""
    fields = _fields(body)
    said = ': '.join(
        text for key in ('message', 'details', 'detail') if (text := _text(fields.get(key)))
    )
    return f'HTTP {status} {said}'.rstrip()


def parse_program_names(body: bytes) -> list[str]:
    """
    Return the names in a list of programs.

    :raises RemoteProtocolError: the answer is not such a list.
    """
    programs = _fields(body).get('programs')
    names = [
        program.get('name') if isinstance(program, dict) else None
        for program in (programs if isinstance(programs, list) else [None])
    ]
    texts = [name for name in names if isinstance(name, str)]
    if len(texts) < len(names):
        raise RemoteProtocolError(
            f'The Robot API answers without the names of its programs: {body!r:.200}.'
        )
    return texts


def parse_program_name(body: bytes) -> str:
    """Return the name that the robot gave to a program; empty if the answer lacks it."""
    return _text(_fields(body).get('programName'))


def _fields(body: bytes) -> Mapping[str, Any]:
    """Return the JSON object in an answer; empty without one (as in a proxy's error page)."""
    try:
        fields = json.loads(body)
    except (ValueError, RecursionError):
        return {}
    return fields if isinstance(fields, dict) else {}


def _text(value: object) -> str:
    """Return a field of an answer as one line: a text as it is, other values as JSON."""
    if value is None:
        return ''
    text = value if isinstance(value, str) else json.dumps(value)
    return ' '.join(text.split())[:300].rstrip('.')
