# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Requests to a robot's dashboard: one line is sent, one comes back, then the connection is closed.

A new connection for each request costs a millisecond, and a late answer cannot be mistaken for
the answer to the next request. Refusals are explained in our own words, because the dashboard
often says only that a command failed.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping

from ur_cartesian_driver.motion.errors import ProtocolError
from ur_cartesian_driver.motion.state.rtde_state import (
    MOVABLE_SAFETY_MODES,
    RobotMode,
    RobotState,
    RuntimeState,
    SafetyMode,
)
from ur_cartesian_driver.protocol.dashboard import (
    COMMAND_SPECS,
    DashboardGreeting,
    DashboardReply,
    encode_line,
    MAX_LINE_LENGTH,
)
from ur_cartesian_driver.protocol.dashboard import DashboardClientCodec as Codec
from ur_cartesian_driver.protocol.framing import LineBuffer
from ur_cartesian_driver.protocol.robot_api import API_COMMANDS, CONFLICT, FORBIDDEN
from ur_cartesian_driver.protocol.rtde.rtde_packages import ControllerVersion
from ur_cartesian_driver.robot.transport import dial, TcpConnection

#: Longest wait for the greeting, and for an answer [s].
ANSWER_TIMEOUT = 5.0
#: Longest waits for answers that come when a report is written [s]; Universal Robots' client
#: library has the same ones.
REPORT_TIMEOUTS: Mapping[str, float] = {
    'generate flight report': 180.0,
    'generate support file': 600.0,
}
#: The first major software version without a dashboard.
POLYSCOPE_X = 10
#: Alternatives to commands that the Robot API lacks; for all other commands it is the pendant.
REPLACEMENTS: Mapping[str, str] = {
    **dict.fromkeys(
        ('power on', 'brake release', 'unlock protective stop'),
        'call recover, or do it on the pendant',
    ),
    'robotmode': 'see the topic robot_mode',
    **dict.fromkeys(('safetymode', 'safetystatus'), 'see the topic safety_mode'),
    **dict.fromkeys(('running', 'programState'), 'see the diagnostics'),
    **dict.fromkeys(('PolyscopeVersion', 'version', 'get robot model'), 'see the topic status'),
}

UNLOCK = 'unlock protective stop'
#: Beginning of the answer to an unlock that comes too early.
TOO_EARLY = 'Cannot unlock protective stop'


class DashboardConnection:
    """Sends requests to the dashboard, from one event loop; several requests may run at a time."""

    def __init__(self, host: str, port: int) -> None:
        """Prepare; every request opens its own connection."""
        self._host, self._port = host, port

    async def request(self, command: str, argument: str = '') -> DashboardReply:
        """
        Send a command and return the answer.

        :raises OSError: the dashboard does not answer.
        :raises ProtocolError: the request or the answer is invalid.
        """
        codec = Codec()
        replies: list[DashboardReply] = []
        await self._exchange(
            codec.send(command, argument),
            lambda data: replies.extend(
                event for event in codec.feed(data) if not isinstance(event, DashboardGreeting)
            ),
            lambda: bool(replies),
            REPORT_TIMEOUTS.get(command, ANSWER_TIMEOUT),
        )
        return replies[0]

    async def request_raw(self, line: str) -> str:
        """
        Send any line and return the line that answers it.

        :raises OSError: the dashboard does not answer.
        :raises ProtocolError: the answer is invalid.
        """
        buffer = LineBuffer(MAX_LINE_LENGTH)
        lines: list[str] = []
        await self._exchange(
            encode_line(line), lambda data: lines.extend(buffer.feed(data)), lambda: len(lines) > 1
        )
        return lines[1]  # the first one is the greeting

    async def _exchange(
        self,
        request: bytes,
        feed: Callable[[bytes], None],
        answered: Callable[[], bool],
        within: float = ANSWER_TIMEOUT,
    ) -> None:
        """
        Send a request, and pass the bytes that come back to ``feed`` until it is answered.

        :param within: longest wait for the answer [s].
        :raises OSError: the dashboard does not answer in time, or hangs up.
        :raises ProtocolError: ``feed`` refuses the bytes.
        """
        ended: asyncio.Future[str] = asyncio.get_running_loop().create_future()
        errors: list[ProtocolError] = []

        def take(data: bytes) -> None:
            try:
                feed(data)
            except ProtocolError as error:
                errors.append(error)
            if (errors or answered()) and not ended.done():
                ended.set_result('')

        def close(reason: str) -> None:
            if not ended.done():
                ended.set_result(reason)

        connection = TcpConnection(take, close)
        where = f'{self._host} port {self._port} (dashboard)'
        try:
            await dial(connection, self._host, self._port)
            connection.send(request)
            async with asyncio.timeout(within):
                reason = await ended
        except TimeoutError:
            raise OSError(f'{where} does not answer within {within:g} s') from None
        finally:
            connection.close()
        if errors:
            raise errors[0]
        if not answered():
            raise OSError(f'{where}: {reason}')


def unavailable_reason(command: str, version: ControllerVersion) -> str:
    """Return the reason why a robot's software lacks a command; empty = it has the command."""
    if version.major >= POLYSCOPE_X:
        return _missing_in_robot_api(command, version)
    spec = COMMAND_SPECS[command]
    if spec.is_available((version.major, version.minor)):
        return ''
    since = spec.cb3 if version.major < 5 else spec.e_series
    if since is None:
        return f'The dashboard of this robot, software {version}, has no command {command!r}.'
    return (
        f'The dashboard command {command!r} needs software {since[0]}.{since[1]} or newer, '
        f'but the robot runs {version}.'
    )


def _missing_in_robot_api(command: str, version: ControllerVersion) -> str:
    """Return the reason why PolyScope X lacks a command; empty = it has the command."""
    since = API_COMMANDS[command][-1].since if command in API_COMMANDS else None
    if since is not None and (version.major, version.minor) >= since:
        return ''
    reason = (
        'no such command'
        if since is None
        else f'this command from software {since[0]}.{since[1]} on, but the robot runs {version}'
    )
    return (
        f'PolyScope X has no dashboard server, and its Robot API has {reason}; '
        f'{REPLACEMENTS.get(command, "do it on the pendant")}.'
    )


def is_too_early(command: str, answer: str) -> bool:
    """Return whether a refused unlock may succeed later; the Robot API only reports a conflict."""
    return TOO_EARLY in answer or (command == UNLOCK and CONFLICT in answer)


def explain_refusal(
    command: str, answer: str, robot: RobotState | None, remote_control: bool | None
) -> str:
    """
    Return an explanation of a refusal.

    :param answer: the words of the dashboard or Robot API.
    :param robot: the robot's newest state; None = there is no RTDE connection.
    :param remote_control: whether clients may control the robot; None = unknown.
    """
    return f'The robot refuses {command!r} and says: {answer.rstrip(".")}. ' + _reason(
        command, answer, robot, remote_control
    )


def _reason(
    command: str, answer: str, robot: RobotState | None, remote_control: bool | None
) -> str:
    if remote_control is False or answer.startswith(FORBIDDEN):
        return 'It is in local control: switch it to remote control on the pendant.'
    if answer.startswith(TOO_EARLY) or (
        command == UNLOCK and robot is not None and robot.safety_mode is SafetyMode.PROTECTIVE_STOP
    ):
        return 'Wait until 5 s have passed since the stop, look for its cause, then try again.'
    if answer.startswith('No program loaded'):
        return 'Load one with load_program, or on the pendant.'
    if 'File not found' in answer:
        return 'The name is relative to the folder of programs on the robot.'
    if robot is None:
        return 'Its state is unknown: there is no RTDE connection.'
    if robot.safety_mode not in MOVABLE_SAFETY_MODES:
        return f'The safety system is in mode {robot.safety_mode.name}: clear that first.'
    if command == 'play' and robot.robot_mode is not RobotMode.RUNNING:
        return f'The arm is in mode {robot.robot_mode.name}: release the brakes first.'
    if command == 'play':
        return 'Is a program loaded (load_program), and no window open on the pendant?'
    if command == 'pause' and robot.runtime_state is not RuntimeState.PLAYING:
        return 'No program is running.'
    if command in ('load', 'load installation') and robot.runtime_state is not (
        RuntimeState.STOPPED
    ):
        return 'A program is running: stop it first.'
    return f'Robot mode {robot.robot_mode.name}, program {robot.runtime_state.name}.'
