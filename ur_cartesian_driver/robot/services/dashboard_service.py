# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Carries out dashboard calls: checks and sends a command, and waits for the state that confirms it.

On PolyScope X the commands go through the Robot API instead.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from ur_cartesian_driver.motion.errors import DriverError
from ur_cartesian_driver.motion.state.rtde_state import (
    RobotMode,
    RobotState,
    RuntimeState,
    SafetyMode,
)
from ur_cartesian_driver.robot.link import RobotLink
from ur_cartesian_driver.robot.services.dashboard_connection import (
    DashboardConnection,
    explain_refusal,
    POLYSCOPE_X,
    unavailable_reason,
)
from ur_cartesian_driver.robot.services.polling import (
    describe_modes,
    wait_for_state,
)
from ur_cartesian_driver.robot.services.robot_api_connection import RobotApiConnection
from ur_cartesian_driver.robot.services.service_calls import (
    DashboardCall,
    DashboardLineCall,
    failed,
    ServiceAnswer,
    succeeded,
)

#: Longest time until the arm is on, its brakes are released, or its safety system restarted [s].
POWER_TIMEOUT = 30.0
#: Longest time until another command takes effect [s].
EFFECT_TIMEOUT = 5.0


@dataclass(frozen=True, slots=True, kw_only=True)
class DashboardPorts:
    """The robot's ports: of the dashboard, and of the Robot API, its successor on PolyScope X."""

    dashboard: int
    robot_api: int


@dataclass(frozen=True, slots=True)
class ExpectedEffect:
    """The robot state that confirms a command."""

    is_reached: Callable[[RobotState], bool]
    #: Name of this state, for error texts.
    target_mode: str
    timeout: float = EFFECT_TIMEOUT


#: The effects of dashboard commands that take time.
EXPECTED_EFFECTS: Mapping[str, ExpectedEffect] = {
    'power on': ExpectedEffect(
        lambda r: r.robot_mode in (RobotMode.IDLE, RobotMode.RUNNING), 'IDLE', POWER_TIMEOUT
    ),
    'power off': ExpectedEffect(lambda r: r.robot_mode is RobotMode.POWER_OFF, 'POWER_OFF'),
    'brake release': ExpectedEffect(
        lambda r: r.robot_mode is RobotMode.RUNNING, 'RUNNING', POWER_TIMEOUT
    ),
    'unlock protective stop': ExpectedEffect(
        lambda r: r.safety_mode is not SafetyMode.PROTECTIVE_STOP, 'unlocked'
    ),
    'restart safety': ExpectedEffect(
        lambda r: r.safety_mode not in (SafetyMode.VIOLATION, SafetyMode.FAULT),
        'restarted',
        POWER_TIMEOUT,
    ),
    'play': ExpectedEffect(lambda r: r.runtime_state is RuntimeState.PLAYING, 'PLAYING'),
    'pause': ExpectedEffect(lambda r: r.runtime_state is RuntimeState.PAUSED, 'PAUSED'),
    'stop': ExpectedEffect(lambda r: r.runtime_state is RuntimeState.STOPPED, 'STOPPED'),
}


class DashboardService:
    """Calls dashboard or Robot API, from one event loop; several calls may run at a time."""

    def __init__(self, host: str, ports: DashboardPorts, link: RobotLink) -> None:
        """Prepare; every call opens its own connection."""
        self._dashboard = DashboardConnection(host, ports.dashboard)
        self._host, self._ports = host, ports
        self._link = link

    @property
    def _client(self) -> DashboardConnection | RobotApiConnection:
        """The connection that serves this robot; both kinds accept the same requests."""
        version = self._link.version
        if version is None or version.major < POLYSCOPE_X:
            return self._dashboard
        return RobotApiConnection(self._host, self._ports.robot_api, version)

    async def request(self, call: DashboardCall) -> ServiceAnswer:
        """
        Send a command, and wait until the robot has carried it out.

        :raises OSError: the dashboard or Robot API does not answer, or cannot load the program.
        :raises ProtocolError: the request or the answer is invalid.
        """
        version = self._link.version
        if version is not None and (reason := unavailable_reason(call.command, version)):
            return failed(reason)
        reply = await self._client.request(call.command, call.argument)
        if not reply.ok:
            return failed(
                explain_refusal(
                    call.command, reply.text, self._link.robot, await self.remote_control()
                )
            )
        effect = EXPECTED_EFFECTS.get(call.command)
        if effect is not None and not await wait_for_state(
            self._link, effect.is_reached, effect.timeout
        ):
            return failed(
                f'The robot answers {reply.text!r}, but is not {effect.target_mode} after '
                f'{effect.timeout:g} s: {describe_modes(self._link)}'
            )
        return succeeded(reply.value or reply.text)

    async def request_raw(self, call: DashboardLineCall) -> ServiceAnswer:
        """
        Send any line to the dashboard, and return the line that answers it.

        :raises OSError: the dashboard does not answer.
        :raises ProtocolError: the answer is invalid.
        """
        version = self._link.version
        if version is not None and (reason := unavailable_reason('quit', version)):
            return failed(reason)
        return succeeded(await self._dashboard.request_raw(call.line))

    async def remote_control(self) -> bool | None:
        """Return whether clients may control the robot; None = unknown."""
        version = self._link.version
        if version is None or unavailable_reason('is in remote control', version):
            return None
        try:
            reply = await self._client.request('is in remote control')
        except (OSError, DriverError):
            return None
        remote = {'true': True, 'false': False}.get(reply.value or '')
        if remote is not None:
            self._link.note_remote_control(remote)
        return remote
