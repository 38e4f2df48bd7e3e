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

from ur_cartesian_driver.driver import Driver
from ur_cartesian_driver.motion.errors import DriverError, LocalProtocolError
from ur_cartesian_driver.motion.goal.goal import OutputKind
from ur_cartesian_driver.motion.state.io_signals import AnalogDomain
from ur_cartesian_driver.robot.services.service_calls import (
    DashboardCall,
    DashboardLineCall,
    DownloadProgramCall,
    HandBackCall,
    ListProgramsCall,
    RecoverCall,
    RunScriptCall,
    SCRIPT_TIMEOUT,
    SendProgramCall,
    ServiceAnswer,
    ServiceCall,
    SetGravityCall,
    SetOutputCall,
    SetPayloadCall,
    SetSpeedSliderCall,
    SetTcpCall,
    SettingCall,
    UploadProgramCall,
    ZeroFtSensorCall,
)
from ur_cartesian_driver.ros.message_fields import pose_from_message
from ur_cartesian_driver.ros.services.deferred_service import completed_answer, DeferredService
from ur_cartesian_driver.srv import (
    DownloadProgram,
    GenerateFlightReport,
    GenerateSupportFile,
    Load,
    Popup,
    RawRequest,
    Recover,
    RunScript,
    SetIO,
    SetOperationalMode,
    SetSpeedSliderFraction,
    SetTCP,
    SetUserRole,
    UploadProgram,
)
from ur_cartesian_driver.srv import (
    SetGravity as SetGravityService,
)
from ur_cartesian_driver.srv import (
    SetPayload as SetPayloadService,
)

#: The driver call of each service without request fields; the response is a sentence or a value.
TRIGGER_SERVICES: Mapping[str, ServiceCall] = {
    'resend_robot_program': SendProgramCall(),
    'hand_back_control': HandBackCall(),
    'zero_ftsensor': ZeroFtSensorCall(),
    'dashboard/get_programs': ListProgramsCall(),
    **{
        f'dashboard/{name}': DashboardCall(command=command)
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
    return SetTcpCall(T_flange_tcp=pose_from_message(request.tcp))


def _payload(request: Any) -> ServiceCall:
    cog = request.center_of_gravity
    return SetPayloadCall(
        mass=request.mass,
        cog=(cog.x, cog.y, cog.z),
        inertia=tuple(request.inertia),
        transition_time=request.transition_time,
    )


def _gravity(request: Any) -> ServiceCall:
    gravity = request.gravity
    return SetGravityCall(gravity=(gravity.x, gravity.y, gravity.z))


def _output(request: Any) -> ServiceCall:
    try:
        kind, domain = OutputKind(request.output), AnalogDomain(request.analog_domain)
    except ValueError as error:
        raise LocalProtocolError(f'output or analog_domain: {error}.') from None
    return SetOutputCall(kind=kind, pin=request.pin, value=request.value, domain=domain)


#: For each service with request fields: the type of the service, and the function that converts a
#: request to a driver call.
REQUEST_SERVICES: Mapping[str, tuple[Any, Callable[[Any], ServiceCall]]] = {
    'recover': (
        Recover,
        lambda request: RecoverCall(unlock_protective_stop=request.unlock_protective_stop),
    ),
    'run_script': (
        RunScript,
        lambda request: RunScriptCall(
            script=request.script, timeout=request.timeout or SCRIPT_TIMEOUT
        ),
    ),
    'set_tcp': (SetTCP, _tcp),
    'set_payload': (SetPayloadService, _payload),
    'set_gravity': (SetGravityService, _gravity),
    'set_io': (SetIO, _output),
    'set_speed_slider': (
        SetSpeedSliderFraction,
        lambda request: SetSpeedSliderCall(fraction=request.speed_slider_fraction),
    ),
    'dashboard/load_program': (
        Load,
        lambda request: DashboardCall(command='load', argument=request.filename),
    ),
    'dashboard/load_installation': (
        Load,
        lambda request: DashboardCall(command='load installation', argument=request.filename),
    ),
    'dashboard/popup': (
        Popup,
        lambda request: DashboardCall(command='popup', argument=request.message),
    ),
    'dashboard/set_operational_mode': (
        SetOperationalMode,
        lambda request: DashboardCall(
            command='set operational mode', argument=request.operational_mode
        ),
    ),
    'dashboard/set_user_role': (
        SetUserRole,
        lambda request: DashboardCall(command='setUserRole', argument=request.user_role),
    ),
    'dashboard/generate_flight_report': (
        GenerateFlightReport,
        lambda request: DashboardCall(
            command='generate flight report', argument=request.report_type
        ),
    ),
    'dashboard/generate_support_file': (
        GenerateSupportFile,
        lambda request: DashboardCall(command='generate support file', argument=request.dir_path),
    ),
    'dashboard/upload_program': (
        UploadProgram,
        lambda request: UploadProgramCall(program=request.program),
    ),
    'dashboard/update_program': (
        UploadProgram,
        lambda request: UploadProgramCall(program=request.program, replaces=True),
    ),
    'dashboard/download_program': (
        DownloadProgram,
        lambda request: DownloadProgramCall(program_name=request.program_name),
    ),
    'dashboard/raw_request': (RawRequest, lambda request: DashboardLineCall(line=request.query)),
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
        # A goal that is being planned depends on the settings that it found.
        if isinstance(call, SettingCall) and not self._is_idle():
            return completed_answer(
                'A goal, live session or freedrive is using the present value; end it, then try '
                'again.'
            )
        return self._driver.call(call)
