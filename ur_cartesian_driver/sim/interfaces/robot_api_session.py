# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
One HTTP client of the Robot API of PolyScope X, and the effect of each request.

The driver has a table of the same requests. If the simulator used that table, tests could not find
mistakes in it. doc/simulation.md states the sources and the assumptions.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from http import HTTPStatus
from http.client import HTTPException, parse_headers
from io import BytesIO
import json
from typing import Any
from urllib.parse import unquote

from ur_cartesian_driver.motion.errors import RemoteProtocolError
from ur_cartesian_driver.motion.state.rtde_state import RobotMode, RuntimeState, SafetyMode
from ur_cartesian_driver.sim.controller import Controller
from ur_cartesian_driver.sim.interfaces.dashboard_session import RUNTIME_WORDS
from ur_cartesian_driver.sim.interfaces.robot_api_fields import (
    Body,
    Fields,
    read_body,
    Refused,
    text_field,
    Waiting,
)
from ur_cartesian_driver.sim.interfaces.robot_api_programs import (
    download_program,
    list_programs,
    load_program,
    loaded_program,
    update_program,
    upload_program,
)
from ur_cartesian_driver.sim.interfaces.tcp_server import ClientSession, HangUp
from ur_cartesian_driver.sim.state.controller_state import Popup
from ur_cartesian_driver.sim.state.power_and_safety import SafetyEvent

BASE_PATH = '/universal-robots/robot-api'
#: The first software version that has the Robot API.
FIRST_VERSION = (10, 11)
#: Largest head of a request [bytes]; largest request, which may contain a program.
_MAX_HEAD_SIZE, _MAX_REQUEST_SIZE = 65536, 1 << 22
#: Time after which an unfinished action is answered with 504 [s].
_ACTION_TIMEOUT = 10.0

#: Safety modes with another name in the API, which has only five safety modes.
_SAFETY_MODES = {
    SafetyMode.ROBOT_EMERGENCY_STOP: 'EMERGENCY_STOP',
    SafetyMode.SYSTEM_EMERGENCY_STOP: 'EMERGENCY_STOP',
    SafetyMode.VIOLATION: 'FAULT',
}
_FORBIDDEN = {
    'message': 'Forbidden',
    'details': 'Not authorized to perform this operation under the current robot control mode.',
}


Handler = Callable[[Controller, Body], 'Fields | Waiting']
#: Action -> function that begins it, and function that returns whether the action is done.
Actions = Mapping[str, tuple[Callable[[Controller], object], Callable[[Controller], bool]]]


def _refuse_if(refusal: str) -> None:
    if refusal:
        raise Refused(HTTPStatus.CONFLICT, 'Conflict', details=refusal)


def _power_on(controller: Controller) -> None:
    is_powered = controller.power.mode is not RobotMode.POWER_OFF
    _refuse_if('The arm is powered already' if is_powered else controller.power_on())


def _restart_safety(controller: Controller) -> None:
    _refuse_if(controller.safety_event(SafetyEvent.RESTART))
    controller.power_off()


_STATE_ACTIONS: Actions = {
    'POWER_ON': (_power_on, lambda c: c.power.mode >= RobotMode.IDLE),
    'POWER_OFF': (Controller.power_off, lambda c: c.power.mode is RobotMode.POWER_OFF),
    'BRAKE_RELEASE': (
        lambda c: _refuse_if(c.release_brakes()),
        lambda c: c.power.mode is RobotMode.RUNNING,
    ),
    # No unlock delay: the tests of the manufacturer's client library unlock at once.
    'UNLOCK_PROTECTIVE_STOP': (
        lambda c: _refuse_if(c.safety_event(SafetyEvent.UNLOCK_BY_LINE)),
        lambda c: c.safety.mode is not SafetyMode.PROTECTIVE_STOP,
    ),
    'RESTART_SAFETY': (_restart_safety, lambda c: c.safety.mode is SafetyMode.NORMAL),
}


def _play(controller: Controller, state: RuntimeState) -> None:
    programs = controller.programs
    other = f'The program is {RUNTIME_WORDS[programs.state]}'
    _refuse_if(programs.play() if programs.state is state else other)


def _has_started(controller: Controller) -> bool:
    """
    Return whether the program has started; a short program may have ended since then.

    :raises Refused: the program will not start.
    """
    programs = controller.programs
    if programs.starting:
        return False
    if programs.start_failure:
        raise Refused(
            HTTPStatus.INTERNAL_SERVER_ERROR,
            'Error',
            details=f'The program did not start: {programs.start_failure}',
        )
    return True


_PROGRAM_ACTIONS: Actions = {
    'play': (lambda c: _play(c, RuntimeState.STOPPED), _has_started),
    'resume': (
        lambda c: _play(c, RuntimeState.PAUSED),
        lambda c: c.programs.state is RuntimeState.PLAYING,
    ),
    'pause': (
        lambda c: _refuse_if(c.programs.pause()),
        lambda c: c.programs.state is RuntimeState.PAUSED,
    ),
    'stop': (
        lambda c: c.programs.stop(),
        lambda c: c.programs.state is RuntimeState.STOPPED,
    ),
}


def _act(actions: Actions, controller: Controller, body: Body) -> Waiting:
    action = text_field(body, 'action')
    if action not in actions:
        raise ValueError(f'action is {action!r}')
    act, is_done = actions[action]
    act(controller)
    return Waiting(is_done, f'{action} carried out')


def _program_state(controller: Controller, _: Body) -> Fields:
    return {'state': RUNTIME_WORDS[controller.programs.state]}


def _safety_mode(controller: Controller, _: Body) -> Fields:
    mode = controller.safety.mode
    return {'mode': _SAFETY_MODES.get(mode, mode.name)}


def _information(controller: Controller, _: Body) -> Fields:
    config = controller.config
    model = config.model.upper().removesuffix('E')
    return {'robotType': model, 'serialNumber': config.serial_number}


def _versions(controller: Controller, _: Body) -> Fields:
    version = '.'.join(map(str, controller.config.version[:3]))
    return {'marketingVersion': version, 'baselineVersion': version}


def _open_popup(controller: Controller, body: Body) -> Fields:
    controller.show_popup(Popup(text=text_field(body, 'message')))
    return {'message': 'Popup opened successfully'}


def _close_popup(controller: Controller, _: Body) -> Fields:
    if not controller.popups:
        raise Refused(HTTPStatus.NOT_FOUND, 'No popup is open', closed=False)
    controller.close_popups()
    return {'message': 'Popup closed', 'closed': True}


def _close_safety_popup(controller: Controller, _: Body) -> Fields:
    raise Refused(HTTPStatus.NOT_FOUND, 'No safety popup is open', closed=False)


def _log(controller: Controller, body: Body) -> Fields:
    controller.messages.note(text_field(body, 'message'))
    return {'message': 'Log entry added'}


def _operational_mode(controller: Controller, _: Body) -> Fields:
    mode = controller.pendant.operational_mode
    return {'mode': 'AUTOMATIC' if mode == 'NONE' else mode}


def _shut_down(controller: Controller, _: Body) -> Fields:
    """Switch off only the arm: without a controller, nothing could be tested afterwards."""
    controller.power_off()
    return {'message': None}


def _write_flight_report(controller: Controller, _: Body) -> Fields:
    """Only answer; no file is written."""
    return {'message': 'Flight report generated successfully.', 'details': None}


def _openapi(controller: Controller, _: Body) -> Fields:
    """Return the version of the API, from which clients conclude which requests exist."""
    version = controller.config.version[:2]
    number = '5.0.107' if version >= (10, 14) else '3.1.4' if version >= (10, 12) else '3.0.0'
    return {'openapi': '3.1.0', 'info': {'title': 'Robot API', 'version': number}}


#: Method and path below BASE_PATH -> first software version with this request, and its handler.
_ROUTES: Mapping[tuple[str, str], tuple[tuple[int, int], Handler]] = {
    ('GET', '/openapi.json'): (FIRST_VERSION, _openapi),
    ('PUT', '/robotstate/v1/state'): (FIRST_VERSION, partial(_act, _STATE_ACTIONS)),
    ('GET', '/robotstate/v1/robotmode'): (
        (10, 12),
        lambda controller, _: {'mode': controller.power.mode.name},
    ),
    ('GET', '/robotstate/v1/safetymode'): ((10, 12), _safety_mode),
    ('PUT', '/program/v1/state'): (FIRST_VERSION, partial(_act, _PROGRAM_ACTIONS)),
    ('GET', '/program/v1/state'): (FIRST_VERSION, _program_state),
    ('PUT', '/program/v1/load'): (FIRST_VERSION, load_program('programName')),
    ('PUT', '/program/v1/loaded'): ((10, 12), load_program('name')),
    ('GET', '/program/v1/loaded'): ((10, 12), loaded_program),
    ('GET', '/programs/v1'): ((10, 12), list_programs),
    ('POST', '/programs/v1'): ((10, 12), upload_program),
    ('PUT', '/programs/v1'): ((10, 12), update_program),
    ('GET', '/programs/v1/{name}'): ((10, 12), download_program),
    ('GET', '/system/v1/controlmode'): (
        (10, 12),
        lambda controller, _: {'mode': 'REMOTE' if controller.remote_control else 'LOCAL'},
    ),
    ('GET', '/system/v1/operationalmode'): ((10, 12), _operational_mode),
    ('GET', '/system/v1/information'): ((10, 14), _information),
    ('POST', '/system/v1/log'): ((10, 14), _log),
    ('PUT', '/system/v1/shutdown'): ((10, 14), _shut_down),
    ('POST', '/supportfiles/v1'): ((10, 14), _write_flight_report),
    ('GET', '/versions/v1'): ((10, 14), _versions),
    ('POST', '/popup/v1'): ((10, 14), _open_popup),
    ('DELETE', '/popup/v1'): ((10, 14), _close_popup),
    ('DELETE', '/popup/v1/safety'): ((10, 14), _close_safety_popup),
}


class RobotApiSession(ClientSession):
    """Answers one request after the other; an action is answered when it is done."""

    def __init__(self, controller: Controller) -> None:
        """Wait for requests."""
        self._controller = controller
        self._buffer = bytearray()
        #: Size of a request whose head has arrived but not its body [bytes]; 0 = unknown. Until
        #: the body has arrived, the buffer is not copied and parsed again.
        self._request_size = 0
        self._waiting: Waiting | None = None
        self._waits_until = 0.0
        self._last_request = False

    def feed(self, data: bytes) -> bytes:
        """Take a part of a request; return the answers that are available at once."""
        self._buffer += data
        if len(self._buffer) > _MAX_REQUEST_SIZE:
            raise RemoteProtocolError(f'a request is longer than {_MAX_REQUEST_SIZE} bytes')
        return self.answers()

    def answers(self) -> bytes:
        """
        Return the answers that are due; called in each cycle.

        :raises HangUp: the client's last request is answered; the exception carries the answers.
        """
        answers = b''
        while True:
            if self._waiting is None:
                if (request := self._next_request()) is None:
                    return answers
                answers += self._answer(*request)
            if self._waiting is not None:
                if not (answer := self._due_answer(self._waiting)):
                    return answers
                answers += answer
                self._waiting = None
            if self._last_request:
                raise HangUp(answers)

    def _due_answer(self, waiting: Waiting) -> bytes:
        """Return the answer to an action; empty while the action is neither done nor timed out."""
        try:
            if waiting.is_done(self._controller):
                return _response(HTTPStatus.OK, {'message': waiting.message})
        except Refused as refused:
            return _response(refused.status, refused.fields)
        if self._controller.time >= self._waits_until:
            return _response(HTTPStatus.GATEWAY_TIMEOUT, {'message': 'Gateway Timeout'})
        return b''

    def _next_request(self) -> tuple[str, str, bytes, str] | None:
        """Return method, path, body and content type of the next request; None = incomplete."""
        if len(self._buffer) < self._request_size:
            return None
        head, end, rest = bytes(self._buffer).partition(b'\r\n\r\n')
        if not end:
            if len(head) > _MAX_HEAD_SIZE:
                raise RemoteProtocolError(f'the head is longer than {_MAX_HEAD_SIZE} bytes')
            return None
        line, _, lines = head.partition(b'\r\n')
        try:
            method, path, version = line.decode('ascii').split(' ')
            headers = parse_headers(BytesIO(lines + end))
            size = int(headers.get('Content-Length', '0'))
        except (ValueError, HTTPException) as error:
            raise RemoteProtocolError(f'{line!r:.100} does not begin an HTTP request') from error
        if 'Transfer-Encoding' in headers or size < 0:
            raise RemoteProtocolError('a request whose length is not given')
        self._request_size = len(head) + len(end) + size
        if len(rest) < size:
            return None
        del self._buffer[: self._request_size]
        self._request_size = 0
        self._last_request = (
            version == 'HTTP/1.0' or headers.get('Connection', '').lower() == 'close'
        )
        return method, path, rest[:size], headers.get('Content-Type', '')

    def _answer(self, method: str, path: str, body: bytes, content_type: str) -> bytes:
        """Carry out a request and return the answer; empty if the answer comes later."""
        route, name = path.removeprefix(BASE_PATH), ''
        if route.startswith('/programs/v1/'):
            # Clients request the list with and without the slash.
            name = unquote(route.removeprefix('/programs/v1/'))
            route = '/programs/v1/{name}' if name else '/programs/v1'
        version = self._controller.config.version[:2]
        methods = {m for (m, p), (since, _) in _ROUTES.items() if p == route and version >= since}
        if not path.startswith(BASE_PATH) or not methods:
            return self._not_found(path)
        if method not in methods:
            return _response(HTTPStatus.METHOD_NOT_ALLOWED, {'detail': 'Method Not Allowed'})
        if method != 'GET' and not self._controller.remote_control:
            return _response(HTTPStatus.FORBIDDEN, _FORBIDDEN)
        try:
            fields = {'name': name} if name else read_body(body, content_type)
            answer = _ROUTES[method, route][1](self._controller, fields)
        except (ValueError, RecursionError) as error:
            return _response(HTTPStatus.UNPROCESSABLE_ENTITY, {'detail': [{'msg': str(error)}]})
        except Refused as refused:
            return _response(refused.status, refused.fields)
        if isinstance(answer, Waiting):
            self._waiting = answer
            self._waits_until = self._controller.time + _ACTION_TIMEOUT
            return b''
        accepted = route == '/system/v1/shutdown'
        return _response(HTTPStatus.ACCEPTED if accepted else HTTPStatus.OK, answer)

    def _not_found(self, path: str) -> bytes:
        """Return the answer to an unknown path; redirect a known path with a trailing slash."""
        known = {f'{BASE_PATH}{route}/' for _, route in _ROUTES}
        if path in known:
            return _response(HTTPStatus.TEMPORARY_REDIRECT, {}, location=path.rstrip('/'))
        return _response(HTTPStatus.NOT_FOUND, {'detail': 'Not Found'})


def _response(status: HTTPStatus, fields: Mapping[str, Any], location: str = '') -> bytes:
    body = json.dumps(fields).encode()
    head = [
        f'HTTP/1.1 {status.value} {status.phrase}',
        'Content-Type: application/json',
        f'Content-Length: {len(body)}',
        *([f'Location: {location}'] if location else []),
    ]
    return '\r\n'.join([*head, '', '']).encode() + body
