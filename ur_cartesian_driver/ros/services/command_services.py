# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The services of the node: each one a call of the driver, answered when the driver answers.

A service callback of rclpy returns its response, so one that waits holds the executor. Here it
returns a promise at once, and the response is sent when that is kept, by the thread that keeps
it. Nothing waits, whatever the executor, and however many services are under way.

Names, types and what they do: ``doc/ros_interface.md``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import Future
import contextlib
from typing import Any

from rclpy.action.server import RCLError
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.exceptions import InvalidHandle
from rclpy.node import Node
from std_srvs.srv import Trigger

from ur_cartesian_driver.driver import Driver
from ur_cartesian_driver.motion.errors import DriverError, LocalProtocolError
from ur_cartesian_driver.motion.goal import OutputKind
from ur_cartesian_driver.motion.pose import Pose
from ur_cartesian_driver.motion.signals import AnalogDomain
from ur_cartesian_driver.robot.services.service_calls import (
    DashboardCall,
    DashboardLineCall,
    RecoverCall,
    SendProgramCall,
    ServiceAnswer,
    ServiceCall,
    SetOutputCall,
    SetPayloadCall,
    SetSpeedSliderCall,
    SetTcpCall,
    ZeroFtSensorCall,
)
from ur_cartesian_driver.srv import (
    Load,
    Popup,
    RawRequest,
    SetIO,
    SetSpeedSliderFraction,
    SetTCP,
)
from ur_cartesian_driver.srv import (
    SetPayload as SetPayloadService,
)

#: Services that take and tell nothing but success and a sentence, or the value asked for.
TRIGGER_SERVICES: Mapping[str, ServiceCall] = {
    'recover': RecoverCall(),
    'resend_robot_program': SendProgramCall(),
    'zero_ftsensor': ZeroFtSensorCall(),
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
    p, q = request.tcp.position, request.tcp.orientation
    return SetTcpCall(T_flange_tcp=Pose((p.x, p.y, p.z), (q.x, q.y, q.z, q.w)))


def _payload(request: Any) -> ServiceCall:
    cog = request.center_of_gravity
    return SetPayloadCall(mass=request.mass, cog=(cog.x, cog.y, cog.z))


def _output(request: Any) -> ServiceCall:
    try:
        kind, domain = OutputKind(request.output), AnalogDomain(request.analog_domain)
    except ValueError as error:
        raise LocalProtocolError(f'output or analog_domain: {error}.') from None
    return SetOutputCall(kind=kind, pin=request.pin, value=request.value, domain=domain)


#: Services with a request of their own, and how it becomes a call.
REQUEST_SERVICES: Mapping[str, tuple[Any, Callable[[Any], ServiceCall]]] = {
    'set_tcp': (SetTCP, _tcp),
    'set_payload': (SetPayloadService, _payload),
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
    'dashboard/raw_request': (RawRequest, lambda request: DashboardLineCall(line=request.query)),
}


class CommandServices:
    """All services of a driver; they go with the node."""

    def __init__(self, node: Node, driver: Driver, is_idle: Callable[[], bool]) -> None:
        """
        Begin to serve.

        :param is_idle: tells whether no goal is being planned, waited for or carried out.
        """
        group = MutuallyExclusiveCallbackGroup()
        kinds = {
            name: (Trigger, lambda _, call=call: call) for name, call in TRIGGER_SERVICES.items()
        }
        self._services = [
            DeferredService(node, kind, f'~/{name}', _CallHandler(driver, is_idle, call_of), group)
            for name, (kind, call_of) in {**kinds, **REQUEST_SERVICES}.items()
        ]


class _CallHandler:
    """Turns a request into a call of the driver."""

    def __init__(
        self, driver: Driver, is_idle: Callable[[], bool], call_of: Callable[[Any], ServiceCall]
    ) -> None:
        self._driver, self._is_idle, self._call_of = driver, is_idle, call_of

    def __call__(self, request: Any) -> Future[ServiceAnswer]:
        """Make the call, or refuse it; it is answered in any case."""
        try:
            call = self._call_of(request)
        except DriverError as error:
            return completed_answer(str(error))
        # A goal that is only planned so far counts on what it found.
        if isinstance(call, SetTcpCall | SetPayloadCall) and not self._is_idle():
            return completed_answer(
                'A goal is being planned or carried out, and this would change what it '
                'counts on; wait for its end or cancel it, then try again.'
            )
        return self._driver.call(call)


class DeferredService:
    """A service whose responses are sent when they are there, from whatever thread."""

    def __init__(
        self,
        node: Node,
        kind: Any,
        name: str,
        handle: Callable[[Any], Future[ServiceAnswer]],
        group: MutuallyExclusiveCallbackGroup,
    ) -> None:
        self._kind, self._handle = kind, handle
        service: Any = node.create_service(kind, name, self._begin, callback_group=group)
        self._send_now = service.send_response
        # The executor hands what the callback returned, and whom it is for, to this method.
        service.send_response = self._send_when_done

    def _begin(self, request: Any, _: Any) -> Any:
        return self._handle(request)

    def _send_when_done(self, future: Future[ServiceAnswer], header: Any) -> None:
        future.add_done_callback(
            lambda completed_answer: self._send(completed_answer.result(), header)
        )

    def _send(self, answer: ServiceAnswer, header: Any) -> None:
        response = self._response(answer)
        # The node, or all of ROS, may have ended meanwhile.
        with contextlib.suppress(InvalidHandle, RCLError):
            self._send_now(response, header)

    def _response(self, answer: Any) -> Any:
        """Return the response of what was promised."""
        return self._kind.Response(success=answer.ok, message=answer.text)


def completed_answer(text: str, *, ok: bool = False) -> Future[ServiceAnswer]:
    """Return a promise that is kept already: mostly by a refusal."""
    future: Future[ServiceAnswer] = Future()
    future.set_result(ServiceAnswer(ok=ok, text=text))
    return future
