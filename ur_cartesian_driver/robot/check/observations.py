# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Observations of a robot that neither move it nor change its settings.

Some leave a trace: RTDE inputs are requested and released without a write, and secondary programs
write one or two lines to the robot's log.
"""

from __future__ import annotations

from collections.abc import AsyncIterator

from ur_cartesian_driver.motion.errors import DriverError
from ur_cartesian_driver.protocol.robot_api import FIRST_VERSION
from ur_cartesian_driver.protocol.rtde.rtde_packages import ControllerVersion
from ur_cartesian_driver.robot.check.finding import (
    Finding,
    note,
    ok,
    problem,
    RobotAddress,
)
from ur_cartesian_driver.robot.check.primary_observations import observe_primary
from ur_cartesian_driver.robot.check.rtde_observations import (
    EXTRA_OUTPUTS,
    observe_inputs,
    observe_rtde,
)
from ur_cartesian_driver.robot.check.rtde_recorder import RtdeRecorder
from ur_cartesian_driver.robot.rtde.state_decoding import STATE_FIELDS
from ur_cartesian_driver.robot.services.dashboard_connection import (
    DashboardConnection,
    POLYSCOPE_X,
    unavailable_reason,
)
from ur_cartesian_driver.robot.services.robot_api_connection import RobotApiConnection
from ur_cartesian_driver.robot.transport import dial, TcpConnection

#: Ports of the interfaces that this driver does not use.
OTHER_PORTS = {'secondary': 30002, 'real-time': 30003, 'interpreter': 30020}


async def observe(address: RobotAddress, seconds: float) -> AsyncIterator[Finding]:
    """
    Yield the findings about a robot.

    :param seconds: duration of the recording of the RTDE stream [s].
    """
    recorder = RtdeRecorder(
        [*STATE_FIELDS, *(n for n in EXTRA_OUTPUTS if n not in STATE_FIELDS)],
        address.host,
        address.rtde_port,
    )
    version: ControllerVersion | None = None
    try:
        version = await recorder.open()
    except OSError as error:
        yield problem(
            'rtde', f'{error}; switch RTDE on (Settings, Security, Services), check the address'
        )
    else:
        for finding in await observe_rtde(recorder, version, seconds):
            yield finding
        async for finding in observe_inputs(address):
            yield finding
    recorder.close()
    async for finding in observe_primary(address, version, recorder.newest):
        yield finding
    if version is not None:
        yield await _observe_remote_control(address, version)
    yield await _observe_other_ports(address)


async def _observe_remote_control(address: RobotAddress, version: ControllerVersion) -> Finding:
    """Ask the dashboard or Robot API for the state of remote control, if it can tell."""
    check = 'remote_control'
    number = (version.major, version.minor)
    if version.major >= POLYSCOPE_X and number < FIRST_VERSION:
        return note(check, f'PolyScope X {version} has neither dashboard nor Robot API.')
    client = (
        RobotApiConnection(address.host, address.robot_api_port, version)
        if version.major >= POLYSCOPE_X
        else DashboardConnection(address.host, address.dashboard_port)
    )
    name = 'Robot API' if version.major >= POLYSCOPE_X else 'dashboard'
    missing = unavailable_reason('is in remote control', version)
    try:
        reply = await client.request('programState' if missing else 'is in remote control')
    except (OSError, DriverError) as error:
        return note(check, f'{str(error).rstrip(".")}: services below ~/dashboard/ will not work.')
    if missing:
        return ok(check, f'The {name} answers; it does not tell about remote control.')
    answer = reply.value if reply.ok else reply.text
    return ok(check, f'The {name} answers; remote control: {answer}.', remote_control=answer)


async def _observe_other_ports(address: RobotAddress) -> Finding:
    is_open = {}
    for name, port in OTHER_PORTS.items():
        connection = TcpConnection(lambda _: None, lambda _: None)
        try:
            await dial(connection, address.host, port)
            is_open[name] = True
        except OSError:
            is_open[name] = False
        finally:
            connection.close()
    found = ', '.join(name for name, there in is_open.items() if there) or 'none'
    return ok('other_ports', f'Open interfaces that this driver does not use: {found}.', **is_open)
