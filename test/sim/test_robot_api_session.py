# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The simulated Robot API: each request, the software that has it, and when it is answered."""

import http.client
import json
import socket
from typing import Any

import pytest
from robot_ports import FREE, HOST
from urp_text import urpx

from ur_cartesian_driver.motion.errors import RemoteProtocolError
from ur_cartesian_driver.motion.state.rtde_state import RobotMode
from ur_cartesian_driver.sim import SimulatedRobot, SimulatorConfig
from ur_cartesian_driver.sim.controller_assembly import assemble
from ur_cartesian_driver.sim.interfaces.robot_api_session import RobotApiSession
from ur_cartesian_driver.sim.interfaces.tcp_server import HangUp
from ur_cartesian_driver.sim.state.power_and_safety import SafetyEvent

API = '/universal-robots/robot-api'
LOOP = 'def a():\n  while True:\n    sync()\n  end\nend\n'


def request_bytes(method, path, fields=None, head='', version='1.1'):
    body = b'' if fields is None else json.dumps(fields).encode()
    lines = f'{method} {path} HTTP/{version}\r\nHost: robot\r\nContent-Length: {len(body)}\r\n'
    return (lines + head + '\r\n').encode() + body


def parse(data):
    """Let the client of the standard library read an answer."""
    near, far = socket.socketpair()
    with near, far:
        far.sendall(data)
        response = http.client.HTTPResponse(near)
        response.begin()
        return response.status, json.loads(response.read()), response


class ApiUser:
    """A client without sockets; cycles pass while an answer is not there."""

    def __init__(self, **settings):
        config: dict[str, Any] = {
            'polyscope': '10.14',
            'frequency': 125.0,
            'programs': {'a.urpx': LOOP},
        }
        self.controller = assemble(SimulatorConfig(**config | settings)).controller
        self.session = RobotApiSession(self.controller)
        self.cycles = 0

    def ask(self, method, path, fields=None):
        answer = self.session.feed(request_bytes(method, API + path, fields))
        self.cycles = 0
        while not answer:
            self.controller.step()
            self.cycles += 1
            answer = self.session.answers()
        return parse(answer)[:2]

    def act(self, action):
        path = '/robotstate/v1/state' if action.isupper() else '/program/v1/state'
        return self.ask('PUT', path, {'action': action})[0]

    def value(self, path):
        status, fields = self.ask('GET', path)
        assert status == 200
        return fields


def test_power_brakes_program_and_stop_in_one_conversation():
    user = ApiUser(power='off')
    assert user.value('/robotstate/v1/robotmode') == {'mode': 'POWER_OFF'}
    assert user.act('POWER_ON') == 200
    assert user.cycles > 50  # it is answered when the arm has power
    assert user.value('/robotstate/v1/robotmode') == {'mode': 'IDLE'}
    assert user.act('POWER_ON') == 409
    assert user.act('BRAKE_RELEASE') == 200
    assert user.value('/robotstate/v1/robotmode') == {'mode': 'RUNNING'}
    assert user.act('play') == 409  # nothing is loaded
    assert user.ask('PUT', '/program/v1/loaded', {'name': 'b'})[0] == 500
    assert user.ask('PUT', '/program/v1/loaded', {'name': 'a'})[0] == 200
    assert user.value('/program/v1/loaded') == {'name': 'a'}
    for action, state in (
        ('play', 'PLAYING'),
        ('pause', 'PAUSED'),
        ('resume', 'PLAYING'),
        ('stop', 'STOPPED'),
    ):
        assert user.act(action) == 200, action
        assert user.value('/program/v1/state') == {'state': state}
    assert user.act('resume') == 409
    assert user.act('UNLOCK_PROTECTIVE_STOP') == 409
    user.controller.safety_event(SafetyEvent.PROTECTIVE_STOP)
    assert user.value('/robotstate/v1/safetymode') == {'mode': 'PROTECTIVE_STOP'}
    assert user.act('UNLOCK_PROTECTIVE_STOP') == 200
    assert user.value('/robotstate/v1/safetymode') == {'mode': 'NORMAL'}
    assert user.act('POWER_OFF') == 200
    assert user.value('/robotstate/v1/robotmode') == {'mode': 'POWER_OFF'}


def play_external_control(*events):
    """Play a program that is being fetched when the events happen; return status and details."""
    user = ApiUser()
    hosts = []
    user.controller.external_control.request = hosts.append
    assert user.ask('PUT', '/program/v1/loaded', {'name': 'external_control'})[0] == 200
    play = request_bytes('PUT', f'{API}/program/v1/state', {'action': 'play'})
    assert not user.session.feed(play)
    for event in events:
        event(user.controller, hosts[0])
    user.controller.step()
    status, fields, _ = parse(user.session.answers())
    return status, fields.get('details', '')


def answer(text):
    return lambda _, host: host(text)


def test_play_succeeds_when_the_fetched_program_runs():
    assert play_external_control(answer('sleep(1)')) == (200, '')


@pytest.mark.parametrize(
    ('events', 'reason'),
    [
        ([answer('nothing(1)')], 'nothing'),
        ([lambda controller, _: controller.programs.stop()], 'a stop or another program'),
        ([lambda controller, _: controller.programs.submit(LOOP)], 'a stop or another program'),
        ([lambda controller, _: controller.load_program('a.urpx')], 'a stop or another program'),
        (
            [
                lambda controller, _: controller.safety_event(SafetyEvent.PROTECTIVE_STOP),
                answer('sleep(1)'),
            ],
            'the safety mode is PROTECTIVE_STOP',
        ),
    ],
)
def test_play_fails_when_the_program_does_not_start(events, reason):
    status, details = play_external_control(*events)
    assert status == 500
    assert details.startswith('The program did not start: ')
    assert reason in details


def test_a_fault_is_left_without_power():
    user = ApiUser()
    user.controller.safety_event(SafetyEvent.VIOLATION)
    assert user.value('/robotstate/v1/safetymode') == {'mode': 'FAULT'}
    assert user.act('POWER_ON') == 409
    assert user.act('RESTART_SAFETY') == 200
    assert user.value('/robotstate/v1/safetymode') == {'mode': 'NORMAL'}
    assert user.value('/robotstate/v1/robotmode') == {'mode': 'POWER_OFF'}


def test_an_emergency_stop_has_the_name_of_the_api():
    user = ApiUser()
    user.controller.safety_event(SafetyEvent.EMERGENCY_STOP)
    assert user.value('/robotstate/v1/safetymode') == {'mode': 'EMERGENCY_STOP'}


def test_in_local_control_it_only_answers_questions():
    user = ApiUser(power='off', remote_control=False)
    assert user.value('/system/v1/controlmode') == {'mode': 'LOCAL'}
    for method, path, fields in (
        ('PUT', '/robotstate/v1/state', {'action': 'POWER_ON'}),
        ('PUT', '/program/v1/state', {'action': 'stop'}),
        ('POST', '/popup/v1', {'title': 'a', 'message': 'b'}),
    ):
        status, answer = user.ask(method, path, fields)
        assert (status, answer['message']) == (403, 'Forbidden')
    assert user.controller.power.mode is RobotMode.POWER_OFF
    user.controller.remote_control = True
    assert user.act('POWER_ON') == 200
    assert user.value('/system/v1/controlmode') == {'mode': 'REMOTE'}


def test_popups_log_and_identity():
    user = ApiUser(model='ur20')
    assert user.value('/system/v1/information') == {
        'robotType': 'UR20',
        'serialNumber': '20000000000',
    }
    assert user.value('/versions/v1')['marketingVersion'] == '10.14.0'
    assert user.value('/system/v1/operationalmode') == {'mode': 'AUTOMATIC'}
    assert user.ask('DELETE', '/popup/v1') == (
        404,
        {'message': 'No popup is open', 'closed': False},
    )
    assert user.ask('POST', '/popup/v1', {'title': 'a', 'message': 'careful'})[0] == 200
    assert [popup.text for popup in user.controller.popups] == ['careful']
    assert user.ask('DELETE', '/popup/v1')[0] == 200
    assert not user.controller.popups
    assert user.ask('DELETE', '/popup/v1/safety')[0] == 404
    assert user.ask('POST', '/system/v1/log', {'message': 'a line'})[0] == 200


def form(method, content, path=API + '/programs/v1/', field='file'):
    """Return a form with one file, as the manufacturer's client library sends it."""
    body = (
        '--frontier\r\n'
        f'Content-Disposition: form-data; name="{field}"; filename="filename"\r\n'
        'Content-Type: text/plain\r\n\r\n'
        f'{content}\r\n--frontier--\r\n'
    )
    head = f'{method} {path} HTTP/1.1\r\nContent-Length: {len(body)}\r\n'
    return f'{head}Content-Type: multipart/form-data; boundary=frontier\r\n\r\n{body}'.encode()


def send_program(user, method, program):
    return parse(user.session.feed(form(method, json.dumps(program))))[:2]


def test_programs_are_listed_uploaded_updated_downloaded_and_played():
    user = ApiUser()
    assert [each['name'] for each in user.value('/programs/v1/')['programs']] == [
        'a',
        'external_control',
    ]
    assert user.ask('GET', '/programs/v1/weld%20it')[0] == 404
    # The script of a program has labels, and uses functions that the application defines.
    preamble = {'script': 'def twice(x):\n  return 2 * x\nend', 'nodeIDList': []}
    script = '$ 1 "ur-program"\n$ 2 "ur-wait"\ntextmsg("twice ", twice(4))\nsleep(23)'
    program = urpx('weld it', script, urscript=preamble)
    status, answer = send_program(user, 'POST', program)
    assert (status, answer['programName']) == (200, 'weld it')
    assert send_program(user, 'POST', program)[0] == 400  # it exists
    assert [each['name'] for each in user.value('/programs/v1')['programs']] == [
        'a',
        'external_control',
        'weld it',
    ]
    assert user.value('/programs/v1/weld%20it') == program
    assert user.ask('PUT', '/program/v1/loaded', {'name': 'weld it'})[0] == 200
    assert user.act('play') == 200
    user.controller.step()
    assert 'twice 8' in '\n'.join(user.controller.messages.log)
    changed = urpx('weld it', 'textmsg("changed")\nsleep(23)')
    assert send_program(user, 'PUT', changed)[0] == 409  # it is loaded
    assert user.act('stop') == 200
    assert user.ask('PUT', '/program/v1/loaded', {'name': 'a'})[0] == 200
    assert send_program(user, 'PUT', changed)[0] == 200
    assert send_program(user, 'PUT', urpx('other', 'sleep(1)'))[0] == 404
    assert user.ask('PUT', '/program/v1/loaded', {'name': 'weld it'})[0] == 200
    assert user.act('play') == 200
    user.controller.step()
    assert 'changed' in '\n'.join(user.controller.messages.log)


def test_a_program_of_the_configuration_can_be_downloaded_and_uploaded_elsewhere():
    program = ApiUser().value('/programs/v1/a')
    user = ApiUser(programs={})
    assert send_program(user, 'POST', program)[0] == 200
    assert user.ask('PUT', '/program/v1/loaded', {'name': 'a'})[0] == 200
    assert user.act('play') == 200


@pytest.mark.parametrize(
    'content',
    [
        *('', 'no JSON', '[]', '{}', '{"program": null}', '[' * 100_000),
        json.dumps(urpx('', 'sleep(1)')),
        json.dumps(urpx('weld it/a', 'sleep(1)')),
    ],
)
def test_what_is_no_program_is_not_uploaded(content):
    user = ApiUser()
    assert parse(user.session.feed(form('POST', content)))[0] == 422
    assert parse(user.session.feed(form('POST', json.dumps(urpx('b', 'x')), field='f')))[0] == 422


def test_in_local_control_programs_are_only_read():
    user = ApiUser(remote_control=False)
    assert user.value('/programs/v1/a')['program']['programInformation']['name'] == 'a'
    assert send_program(user, 'POST', urpx('b', 'sleep(1)'))[0] == 403


def test_manual_mode_ends_remote_control():
    user = ApiUser()
    user.controller.set_operational_mode('MANUAL')
    assert user.value('/system/v1/operationalmode') == {'mode': 'MANUAL'}
    assert user.value('/system/v1/controlmode') == {'mode': 'LOCAL'}
    assert user.act('POWER_OFF') == 403


def test_a_flight_report_and_a_shutdown_are_answered():
    user = ApiUser()
    status, answer = user.ask('POST', '/supportfiles/v1')
    assert (status, answer['message']) == (200, 'Flight report generated successfully.')
    assert user.ask('PUT', '/system/v1/shutdown') == (202, {'message': None})
    assert user.controller.power.mode is RobotMode.POWER_OFF


@pytest.mark.parametrize(
    ('polyscope', 'method', 'path', 'known'),
    [
        ('10.11', 'PUT', '/robotstate/v1/state', True),
        ('10.11', 'GET', '/robotstate/v1/robotmode', False),
        ('10.12', 'GET', '/robotstate/v1/robotmode', True),
        ('10.11', 'PUT', '/program/v1/loaded', False),
        ('10.12', 'PUT', '/program/v1/loaded', True),
        ('10.11', 'PUT', '/program/v1/load', True),
        ('10.11', 'GET', '/programs/v1', False),
        ('10.11', 'GET', '/programs/v1/a', False),
        ('10.12', 'GET', '/programs/v1/a', True),
        ('10.13', 'GET', '/versions/v1', False),
        ('10.14', 'GET', '/versions/v1', True),
    ],
)
def test_a_request_is_known_from_its_version_on(polyscope, method, path, known):
    status, _ = ApiUser(polyscope=polyscope).ask(method, path, {})
    assert (status == 404) is not known


@pytest.mark.parametrize(
    ('method', 'path', 'fields', 'status'),
    [
        ('GET', API + '/nothing', None, 404),
        ('GET', '/robotstate/v1/robotmode', None, 404),
        ('PATCH', API + '/program/v1/state', {}, 405),
        ('PUT', API + '/program/v1/state', {'action': 'fly'}, 422),
        ('PUT', API + '/program/v1/state', {}, 422),
        ('PUT', API + '/program/v1/state', [], 422),
        ('PUT', API + '/robotstate/v1/state/', {'action': 'POWER_OFF'}, 307),
    ],
)
def test_a_wrong_request_is_refused(method, path, fields, status):
    answer = ApiUser().session.feed(request_bytes(method, path, fields))
    found, _, response = parse(answer)
    assert found == status
    assert (response.headers['Location'] == API + '/robotstate/v1/state') is (status == 307)


def test_an_action_that_takes_too_long_is_answered_too():
    user = ApiUser(power='off', power_on_time=60.0)
    assert user.ask('PUT', '/robotstate/v1/state', {'action': 'POWER_ON'})[0] == 504
    assert user.cycles * user.controller.cycle == pytest.approx(10.0, abs=0.1)


def test_requests_in_pieces_and_in_a_row_are_answered_in_order():
    user = ApiUser()
    data = request_bytes('GET', API + '/robotstate/v1/robotmode') * 2
    answers = b''.join(user.session.feed(data[i : i + 1]) for i in range(len(data)))
    assert answers.count(b'{"mode": "RUNNING"}') == 2


@pytest.mark.parametrize(('head', 'version'), [('Connection: close\r\n', '1.1'), ('', '1.0')])
def test_a_client_that_wants_one_answer_is_hung_up_on(head, version):
    data = request_bytes('GET', API + '/openapi.json', head=head, version=version)
    with pytest.raises(HangUp) as hung_up:
        ApiUser().session.feed(data)
    assert parse(hung_up.value.farewell)[1]['info']['version'] == '5.0.107'


@pytest.mark.parametrize(
    'data',
    [
        b'robotmode\r\n\r\n',
        b'PUT /\r\n\r\n',
        b'PUT / HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\n',
        b'PUT / HTTP/1.1\r\nContent-Length: -1\r\n\r\n',
        b'PUT / HTTP/1.1\r\nContent-Length: many\r\n\r\n',
        b'\xff\xfe / HTTP/1.1\r\n\r\n',
        b'x' * 70000,
    ],
)
def test_what_is_no_request_ends_the_connection(data):
    with pytest.raises(RemoteProtocolError):
        ApiUser().session.feed(data)


@pytest.mark.parametrize(
    ('polyscope', 'has_dashboard', 'has_api'),
    [('5.21', True, False), ('10.8', False, False), ('10.11', False, True)],
)
def test_each_generation_listens_where_it_should(polyscope, has_dashboard, has_api):
    with SimulatedRobot(SimulatorConfig(**FREE, polyscope=polyscope)) as robot:
        assert (robot.ports.dashboard > 0) is has_dashboard
        assert (robot.ports.robot_api > 0) is has_api


def test_over_the_network_an_action_is_answered_when_it_is_done():
    config = SimulatorConfig(**FREE, polyscope='10.12', power='off', rate=10.0, frequency=125.0)
    with SimulatedRobot(config) as robot:
        client = http.client.HTTPConnection(HOST, robot.ports.robot_api, timeout=10.0)
        for action, mode in ('POWER_ON', 'IDLE'), ('BRAKE_RELEASE', 'RUNNING'):
            client.request('PUT', f'{API}/robotstate/v1/state', json.dumps({'action': action}))
            answer = client.getresponse()
            answer.read()
            assert answer.status == 200
            assert robot.state().robot_mode.name == mode
        client.close()
