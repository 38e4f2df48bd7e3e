# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The services of the dashboard client.

If the driver has a service of the same name, this service is called; it answers when the robot
reports the effect. All other commands are sent to the dashboard as lines of text.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import Future
from typing import Any

from std_srvs.srv import Trigger

from ur_cartesian_driver.motion.errors import LocalProtocolError
from ur_cartesian_driver.motion.state.rtde_state import RobotMode, SafetyMode
from ur_cartesian_driver.protocol.dashboard import (
    COMMAND_SPECS,
    DashboardRequest,
    parse_reply,
)
from ur_cartesian_driver.protocol.rtde.rtde_packages import ControllerVersion
from ur_cartesian_driver.robot.services.dashboard_connection import REPORT_TIMEOUTS
from ur_cartesian_driver.robot.services.service_calls import ServiceAnswer
from ur_cartesian_driver.ros.message_fields import Message
from ur_cartesian_driver.ros.services.deferred_service import completed_answer
from ur_cartesian_driver.ros.ur_driver_names.driver_node import ANSWER_TIMEOUT, DriverNode
from ur_cartesian_driver.ros.ur_driver_names.offered_name import (
    Call,
    Service,
    UrName,
)
from ur_cartesian_driver.srv import (
    GenerateFlightReport,
    GenerateSupportFile,
    Load,
    Popup,
    RawRequest,
    SetOperationalMode,
    SetUserRole,
)

DASHBOARD = 'dashboard_client'
_NO_FIELDS = 'std_srvs/srv/Trigger'

#: Writes the value of an answer into the fields of a response.
Fill = Callable[[Message, str], None]
#: Returns the argument of a command from a request.
Argument = Callable[[Message], str]


def _split(value: str) -> tuple[str, str]:
    """Return the first word and the rest; both may be empty."""
    first, _, rest = value.partition(' ')
    return first, rest


def _robot_mode(response: Message, value: str) -> None:
    response.robot_mode.mode = int(_member(RobotMode, value))


def _safety_mode(response: Message, value: str) -> None:
    response.safety_mode.mode = int(_member(SafetyMode, value))


def _safety_status(response: Message, value: str) -> None:
    constant = getattr(type(response.safety_status), value, None)
    if constant is None:
        raise ValueError(value)
    response.safety_status.status = constant


def _member(modes: Any, word: str) -> Any:
    if word not in modes.__members__:
        raise ValueError(word)
    return modes[word]


def _loaded(response: Message, value: str) -> None:
    response.program_name = value


def _state(response: Message, value: str) -> None:
    response.state.state, response.program_name = _split(value)


def _running(response: Message, value: str) -> None:
    response.program_running = value == 'true'


def _saved(response: Message, value: str) -> None:
    saved, response.program_name = _split(value)
    response.program_saved = saved.lower() == 'true'


def _remote_control(response: Message, value: str) -> None:
    response.remote_control = value == 'true'


def _version(response: Message, value: str) -> None:
    fill_version(response.version, value)


def fill_version(message: Message, text: str) -> None:
    """
    Write the version in a text into the fields of a message.

    :raises ValueError: the text has no version.
    """
    version = ControllerVersion.parse(text)
    message.major, message.minor = version.major, version.minor
    message.bugfix, message.build = version.bugfix, version.build


def _model(response: Message, value: str) -> None:
    response.robot_model = value


def _serial_number(response: Message, value: str) -> None:
    response.serial_number = int(value)


def _operational_mode(response: Message, value: str) -> None:
    response.operational_mode.mode = value


def _user_role(response: Message, value: str) -> None:
    response.user_role.role = value


def _report_id(response: Message, value: str) -> None:
    response.report_id = value


def _file_name(response: Message, value: str) -> None:
    response.generated_file_name = value


#: Services without fields in the request, which the driver has too.
_COMMANDS = (
    'power_on',
    'power_off',
    'brake_release',
    'unlock_protective_stop',
    'restart_safety',
    'play',
    'pause',
    'stop',
    'close_popup',
    'close_safety_popup',
)
#: Queries that the driver serves, too: type, dashboard command, function that fills the response.
_QUERIES: dict[str, tuple[str, str, Fill]] = {
    'get_loaded_program': ('GetLoadedProgram', 'get loaded program', _loaded),
    'program_state': ('GetProgramState', 'programState', _state),
    'program_running': ('IsProgramRunning', 'running', _running),
    'program_saved': ('IsProgramSaved', 'isProgramSaved', _saved),
    'get_safety_status': ('GetSafetyStatus', 'safetystatus', _safety_status),
    'get_operational_mode': ('GetOperationalMode', 'get operational mode', _operational_mode),
    'get_user_role': ('GetUserRole', 'getUserRole', _user_role),
    'get_robot_mode': ('GetRobotMode', 'robotmode', _robot_mode),
    'get_safety_mode': ('GetSafetyMode', 'safetymode', _safety_mode),
    'is_in_remote_control': ('IsInRemoteControl', 'is in remote control', _remote_control),
    'get_polyscope_version': ('GetPolyScopeVersion', 'PolyscopeVersion', _version),
    'get_robot_model': ('GetRobotModel', 'get robot model', _model),
    'get_serial_number': ('GetSerialNumber', 'get serial number', _serial_number),
}
#: Commands without a service of the driver: type, command, function that gets the argument.
_LINES: dict[str, tuple[str, str, Argument]] = {
    'quit': (_NO_FIELDS, 'quit', lambda request: ''),
    'shutdown': (_NO_FIELDS, 'shutdown', lambda request: ''),
    'add_to_log': ('AddToLog', 'addToLog', lambda request: request.message),
}


def _type(name: str) -> str:
    return name if '/' in name else f'ur_dashboard_msgs/srv/{name}'


def _words(command: str) -> Callable[[str], str]:
    """Return the function that turns the value in a reply into the whole reply."""
    reply = COMMAND_SPECS[command].reply
    return lambda value: reply.replace('{}', value) if '{}' in reply else value


def _row(
    name: str,
    command: str = '',
    *,
    kind: str = '',
    source_type: Any = Trigger,
    **fields: Any,
) -> UrName:
    """
    Return the row of a service that the driver has too.

    :param command: dashboard command whose reply becomes the response text; empty = use the
        driver's text.
    :param kind: the type, without its package; empty = same name as the driver's type.
    :param fields: further fields of :class:`Service`, such as call, timeout and fill.
    """
    same_kind = _NO_FIELDS if source_type is Trigger else source_type.__name__
    return Service(
        name=f'{DASHBOARD}/{name}',
        type=_type(kind or same_kind),
        source=f'dashboard/{name}',
        source_type=source_type,
        words=_words(command) if command else str,
        **fields,
    )


def _inner_text(field: str, part: str) -> Call:
    """Return a call that flattens a nested text: request.field.part becomes our request.field."""

    def call(row: Service, driver: DriverNode, request: Message) -> Future[ServiceAnswer]:
        text = getattr(getattr(request, field), part)
        return driver.call(row.source_type, row.source, row.source_type.Request(**{field: text}))

    return call


def _line(name: str, kind: str, command: str, argument: Argument) -> UrName:
    def call(row: Service, driver: DriverNode, request: Message) -> Future[ServiceAnswer]:
        try:
            sent = DashboardRequest(name=command, argument=argument(request))
        except LocalProtocolError as error:
            return completed_answer(str(error))
        query = RawRequest.Request(query=sent.encode().decode().rstrip('\n'))
        return _judged(driver.call(row.source_type, row.source, query), sent)

    return Service(
        name=f'{DASHBOARD}/{name}',
        type=_type(kind),
        source='dashboard/raw_request',
        source_type=RawRequest,
        call=call,
    )


def _judged(answer: Future[ServiceAnswer], sent: DashboardRequest) -> Future[ServiceAnswer]:
    """Return the future of an answer that is a success only if the reply says so."""
    result: Future[ServiceAnswer] = Future()

    def judge(done: Future[ServiceAnswer]) -> None:
        ok, text = done.result().ok, done.result().text
        result.set_result(ServiceAnswer(ok=ok and parse_reply(sent, text).ok, text=text))

    answer.add_done_callback(judge)
    return result


def _services() -> Iterable[UrName]:
    yield from map(_row, _COMMANDS)
    yield _row('clear_operational_mode', 'clear operational mode')
    yield _row('load_program', 'load', source_type=Load)
    yield _row('load_installation', 'load installation', source_type=Load)
    yield _row('popup', 'popup', source_type=Popup)
    yield _row(
        'set_operational_mode',
        'set operational mode',
        source_type=SetOperationalMode,
        call=_inner_text('operational_mode', 'mode'),
    )
    yield _row(
        'set_user_role',
        'setUserRole',
        source_type=SetUserRole,
        call=_inner_text('user_role', 'role'),
    )
    yield _row(
        'generate_flight_report',
        'generate flight report',
        source_type=GenerateFlightReport,
        timeout=ANSWER_TIMEOUT + REPORT_TIMEOUTS['generate flight report'],
        fill=_report_id,
    )
    yield _row(
        'generate_support_file',
        'generate support file',
        source_type=GenerateSupportFile,
        timeout=ANSWER_TIMEOUT + REPORT_TIMEOUTS['generate support file'],
        fill=_file_name,
    )
    yield _row('raw_request', source_type=RawRequest)
    yield Service(
        name=f'{DASHBOARD}/connect',
        type=_NO_FIELDS,
        # The driver connects for each request, so this one shows that the robot answers.
        source='dashboard/program_running',
        source_type=Trigger,
        words=lambda value: 'The robot answers.',
    )
    for name, (kind, command, fill) in _QUERIES.items():
        yield _row(name, command, kind=kind, fill=fill)
    for name, (kind, command, argument) in _LINES.items():
        yield _line(name, kind, command, argument)


DASHBOARD_SERVICES = tuple(_services())
