# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The services of ``io_and_status_controller``, and the software version."""

from __future__ import annotations

from concurrent.futures import Future
from typing import Any

from std_srvs.srv import Trigger

from ur_cartesian_driver.motion.goal.known_frames import BASE, BASE_LINK
from ur_cartesian_driver.motion.state.io_signals import AnalogDomain
from ur_cartesian_driver.robot.services.service_calls import ServiceAnswer
from ur_cartesian_driver.ros.message_fields import Message, seconds, vector_message
from ur_cartesian_driver.ros.services.deferred_service import completed_answer
from ur_cartesian_driver.ros.ur_driver_names.dashboard_services import fill_version
from ur_cartesian_driver.ros.ur_driver_names.driver_node import DriverNode
from ur_cartesian_driver.ros.ur_driver_names.offered_name import (
    Call,
    same_request,
    Service,
    UrName,
)
from ur_cartesian_driver.ros.ur_driver_names.state_topics import IO
from ur_cartesian_driver.srv import (
    RunScript,
    SetGravity,
    SetIO,
    SetPayload,
    SetSpeedSliderFraction,
)

#: The smallest fraction that the UR driver lets the speed slider have.
MIN_SLIDER = 0.01
#: First pin of each group of digital outputs, the last group first.
_DIGITAL = (
    (16, SetIO.Request.TOOL_DIGITAL),
    (8, SetIO.Request.CONFIGURABLE_DIGITAL),
    (0, SetIO.Request.STANDARD_DIGITAL),
)
#: The largest pin for each function of SetIO.
_LAST_PIN = {'FUN_SET_DIGITAL_OUT': 17, 'FUN_SET_ANALOG_OUT': 1}
_TOOL_VOLTAGES = (0, 12, 24)


def _set_io(row: Service, driver: DriverNode, request: Message) -> Future[ServiceAnswer]:
    """Set an output; an analog one keeps its domain."""
    if request.fun == request.FUN_SET_TOOL_VOLTAGE:
        return _set_tool_voltage(driver, request.state)
    last_pin = {getattr(request, name): pin for name, pin in _LAST_PIN.items()}.get(request.fun)
    if last_pin is None:
        return completed_answer(
            f'fun is {request.fun}, but the driver sets digital outputs (1), analog outputs (3) '
            'and the voltage of the tool (4).'
        )
    if not 0 <= request.pin <= last_pin:
        return completed_answer(
            f'pin is {request.pin}, but these outputs have the pins 0 to {last_pin}.'
        )
    if request.fun == request.FUN_SET_ANALOG_OUT:
        if driver.io_states is None:
            return completed_answer(
                'The driver has not reported the domain of the output yet; try again when it is '
                'connected to the robot, or use set_analog_output.'
            )
        domain = driver.io_states.analog_output_domains[request.pin]
        return _analog(row, driver, request.pin, int(domain), request.state)
    first, group = next(group for group in _DIGITAL if request.pin >= group[0])
    ours = SetIO.Request(output=group, pin=request.pin - first, value=float(request.state != 0.0))
    return driver.call(row.source_type, row.source, ours)


def _set_analog_output(
    row: Service, driver: DriverNode, request: Message
) -> Future[ServiceAnswer]:
    data = request.data
    if data.domain not in tuple(AnalogDomain):
        return completed_answer(
            f'data.domain is {data.domain}, but must be 0 (CURRENT) or 1 (VOLTAGE).'
        )
    return _analog(row, driver, data.pin, data.domain, data.state)


def _analog(
    row: Service, driver: DriverNode, pin: int, domain: int, state: float
) -> Future[ServiceAnswer]:
    """Set an analog output to a fraction of its range: of 4 to 20 mA, or of 0 to 10 V."""
    ours = SetIO.Request(
        output=SetIO.Request.STANDARD_ANALOG, pin=pin, value=state, analog_domain=domain
    )
    return driver.call(row.source_type, row.source, ours)


def _set_tool_voltage(driver: DriverNode, voltage: float) -> Future[ServiceAnswer]:
    """Set the voltage of the tool by a script: the driver has no service for it."""
    if voltage not in _TOOL_VOLTAGES:
        return completed_answer(f'state is {voltage:g} V, but must be 0, 12 or 24 V.')
    script = f'sec tool_voltage():\n  set_tool_voltage({voltage:.0f})\nend\n'
    return driver.call(RunScript, 'run_script', RunScript.Request(script=script))


def _set_payload(row: Service, driver: DriverNode, request: Message) -> Future[ServiceAnswer]:
    """Set the payload, requested by either of the service's two definitions."""
    if hasattr(request, 'mass'):
        return same_request(row, driver, request)
    load = request.payload
    com, time = load.com, request.transition_time
    ours = SetPayload.Request(
        mass=load.m,
        center_of_gravity=vector_message((com.x, com.y, com.z)),
        # A number or a duration, depending on the release.
        transition_time=seconds(time) if hasattr(time, 'sec') else time,
    )
    moments = [load.ixx, load.iyy, load.izz, load.ixy, load.ixz, load.iyz]
    if any(moments):
        ours.inertia = moments
    return driver.call(row.source_type, row.source, ours)


def _set_gravity(row: Service, driver: DriverNode, request: Message) -> Future[ServiceAnswer]:
    """Set the gravity, which points down in the request and up in the driver's request."""
    frame, down = request.gravity.header.frame_id, request.gravity.vector
    if frame.endswith(BASE_LINK):
        up = (down.x, down.y, -down.z)  # base is base_link turned by half a turn about z
    elif frame.endswith(BASE):
        up = (-down.x, -down.y, -down.z)
    else:
        return completed_answer(
            f'gravity.header.frame_id is {frame!r}, but must be {BASE} or {BASE_LINK} of the arm.'
        )
    ours = SetGravity.Request(gravity=vector_message(up))
    return driver.call(row.source_type, row.source, ours)


def _set_speed_slider(row: Service, driver: DriverNode, request: Message) -> Future[ServiceAnswer]:
    fraction = request.speed_slider_fraction
    if not MIN_SLIDER <= fraction <= 1.0:
        return completed_answer(
            f'speed_slider_fraction is {fraction:g}, but must be {MIN_SLIDER:g} to 1.'
        )
    return same_request(row, driver, request)


def _version(row: Service, driver: DriverNode, request: Message) -> Future[ServiceAnswer]:
    text = '' if driver.status is None else driver.status.polyscope_version
    if not text:
        return completed_answer('The robot has not reported its software yet.')
    return completed_answer(text, ok=True)


def _row(
    name: str,
    source_type: Any,
    call: Call = same_request,
    *,
    kind: str = '',
    source: str = '',
    controller: str = IO,
) -> UrName:
    """
    Return the row of a service.

    :param kind: the name of its type; empty = the name of the driver's type.
    :param source: the driver's service; empty = it has the same name.
    """
    package = 'std_srvs' if source_type is Trigger else 'ur_msgs'
    return Service(
        name=f'{controller}/{name}',
        type=f'{package}/srv/{kind or source_type.__name__}',
        source=source or name,
        source_type=source_type,
        call=call,
    )


IO_SERVICES = (
    _row('resend_robot_program', Trigger),
    _row('hand_back_control', Trigger),
    _row('zero_ftsensor', Trigger),
    _row('set_io', SetIO, _set_io),
    _row('set_analog_output', SetIO, _set_analog_output, kind='SetAnalogOutput', source='set_io'),
    _row('set_payload', SetPayload, _set_payload),
    _row('set_gravity', SetGravity, _set_gravity),
    # The UR driver's newest release serves gravity from a separate controller.
    _row('set_gravity', SetGravity, _set_gravity, controller='gravity_update_controller'),
    _row('set_speed_slider', SetSpeedSliderFraction, _set_speed_slider),
    _row(
        'set_speed_slider_fraction',
        SetSpeedSliderFraction,
        _set_speed_slider,
        source='set_speed_slider',
    ),
    Service(
        name='ur_configuration_controller/get_robot_software_version',
        type='ur_msgs/srv/GetRobotSoftwareVersion',
        source='status',
        source_type=None,
        call=_version,
        fill=fill_version,
    ),
)
