# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Services that each pass one call to the driver and respond with its answer.

Their names, types and effects are in ``doc/ros_interface.md``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import Future
from functools import partial
from typing import Any

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node
from std_srvs.srv import Trigger

from ur_cartesian_driver import srv
from ur_cartesian_driver.driver import Driver
from ur_cartesian_driver.motion.errors import DriverError, LocalProtocolError
from ur_cartesian_driver.motion.goal.goal import OutputKind
from ur_cartesian_driver.motion.state.io_signals import AnalogDomain
from ur_cartesian_driver.robot.services import service_calls as calls
from ur_cartesian_driver.robot.services.service_calls import ServiceAnswer, ServiceCall
from ur_cartesian_driver.ros.message_fields import pose_from_message
from ur_cartesian_driver.ros.services.deferred_service import completed_answer, DeferredService

#: The driver call of each service without request fields; the response is a sentence or a value.
TRIGGER_SERVICES: Mapping[str, ServiceCall] = {
    'resend_robot_program': calls.SendProgramCall(),
    'hand_back_control': calls.HandBackCall(),
    'zero_ftsensor': calls.ZeroFtSensorCall(),
    'dashboard/get_programs': calls.ListProgramsCall(),
    **{
        f'dashboard/{name}': calls.DashboardCall(command=command)
        for name, command in {
            'power_on': 'power on',
            'power_off': 'power off',
            'brake_release': 'brake release',
            'unlock_protective_stop': 'unlock protective stop',
            'restart_safety': 'restart safety',
            'close_popup': 'close popup',
            'close_safety_popup': 'close safety popup',
            'play': 'play',
            'pause': 'pause',
            'stop': 'stop',
            'get_robot_mode': 'robotmode',
            'get_safety_mode': 'safetymode',
            'get_safety_status': 'safetystatus',
            'get_operational_mode': 'get operational mode',
            'clear_operational_mode': 'clear operational mode',
            'get_user_role': 'getUserRole',
            'get_loaded_program': 'get loaded program',
            'program_state': 'programState',
            'program_running': 'running',
            'program_saved': 'isProgramSaved',
            'is_in_remote_control': 'is in remote control',
            'get_serial_number': 'get serial number',
            'get_robot_model': 'get robot model',
            'get_polyscope_version': 'PolyscopeVersion',
        }.items()
    },
}


def _tcp(request: Any) -> ServiceCall:
    return calls.SetTcpCall(T_flange_tcp=pose_from_message(request.tcp))


def _payload(request: Any) -> ServiceCall:
    cog = request.center_of_gravity
    return calls.SetPayloadCall(
        mass=request.mass,
        cog=(cog.x, cog.y, cog.z),
        inertia=tuple(request.inertia),
        transition_time=request.transition_time,
    )


def _gravity(request: Any) -> ServiceCall:
    gravity = request.gravity
    return calls.SetGravityCall(gravity=(gravity.x, gravity.y, gravity.z))


def _output(request: Any) -> ServiceCall:
    try:
        kind, domain = OutputKind(request.output), AnalogDomain(request.analog_domain)
    except ValueError as error:
        raise LocalProtocolError(f'output or analog_domain: {error}.') from None
    return calls.SetOutputCall(kind=kind, pin=request.pin, value=request.value, domain=domain)


def _dashboard(command: str, field: str) -> Callable[[Any], ServiceCall]:
    """Return the conversion of a request with one field, the argument of a dashboard command."""
    return lambda request: calls.DashboardCall(command=command, argument=getattr(request, field))


#: For each service with request fields: the type of the service, and the function that converts a
#: request to a driver call.
REQUEST_SERVICES: Mapping[str, tuple[Any, Callable[[Any], ServiceCall]]] = {
    'recover': (
        srv.Recover,
        lambda request: calls.RecoverCall(unlock_protective_stop=request.unlock_protective_stop),
    ),
    'run_script': (
        srv.RunScript,
        lambda request: calls.RunScriptCall(
            script=request.script, timeout=request.timeout or calls.SCRIPT_TIMEOUT
        ),
    ),
    'set_tcp': (srv.SetTCP, _tcp),
    'set_payload': (srv.SetPayload, _payload),
    'set_gravity': (srv.SetGravity, _gravity),
    'set_io': (srv.SetIO, _output),
    'set_speed_slider': (
        srv.SetSpeedSliderFraction,
        lambda request: calls.SetSpeedSliderCall(fraction=request.speed_slider_fraction),
    ),
    'dashboard/load_program': (srv.Load, _dashboard('load', 'filename')),
    'dashboard/load_installation': (srv.Load, _dashboard('load installation', 'filename')),
    'dashboard/popup': (srv.Popup, _dashboard('popup', 'message')),
    'dashboard/set_operational_mode': (
        srv.SetOperationalMode,
        _dashboard('set operational mode', 'operational_mode'),
    ),
    'dashboard/set_user_role': (srv.SetUserRole, _dashboard('setUserRole', 'user_role')),
    'dashboard/generate_flight_report': (
        srv.GenerateFlightReport,
        _dashboard('generate flight report', 'report_type'),
    ),
    'dashboard/generate_support_file': (
        srv.GenerateSupportFile,
        _dashboard('generate support file', 'dir_path'),
    ),
    'dashboard/upload_program': (
        srv.UploadProgram,
        lambda request: calls.UploadProgramCall(program=request.program),
    ),
    'dashboard/update_program': (
        srv.UploadProgram,
        lambda request: calls.UploadProgramCall(program=request.program, replaces=True),
    ),
    'dashboard/download_program': (
        srv.DownloadProgram,
        lambda request: calls.DownloadProgramCall(program_name=request.program_name),
    ),
    'dashboard/raw_request': (
        srv.RawRequest,
        lambda request: calls.DashboardLineCall(line=request.query),
    ),
}


class CommandServices:
    """All command services; the node destroys them."""

    def __init__(self, node: Node, driver: Driver, is_idle: Callable[[], bool]) -> None:
        """
        Start to serve.

        :param is_idle: returns whether no goal or session depends on the present TCP and payload.
        """
        self._driver, self._is_idle = driver, is_idle
        group = MutuallyExclusiveCallbackGroup()
        for name, call in TRIGGER_SERVICES.items():
            DeferredService(node, Trigger, f'~/{name}', partial(self._call, call), group)
        for name, (kind, call_of) in REQUEST_SERVICES.items():
            DeferredService(node, kind, f'~/{name}', partial(self._convert, call_of), group)

    def _convert(
        self, call_of: Callable[[Any], ServiceCall], request: Any
    ) -> Future[ServiceAnswer]:
        """Convert a request to a driver call and make it, or refuse the request."""
        try:
            return self._call(call_of(request))
        except DriverError as error:
            return completed_answer(str(error))

    def _call(self, call: ServiceCall, _: Any = None) -> Future[ServiceAnswer]:
        # A goal that is being planned depends on the settings at the start of its planning.
        if isinstance(call, calls.SettingCall) and not self._is_idle():
            return completed_answer(
                'A goal, live session or freedrive is using the present value; end it, then try '
                'again.'
            )
        return self._driver.call(call)
