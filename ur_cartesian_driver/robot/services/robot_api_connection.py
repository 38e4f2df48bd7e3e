# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The Robot API of PolyScope X, called like the dashboard: a request, an answer, no state.

urllib3 handles HTTP, in a thread for each request, so the robot loop never waits for it. As with
the dashboard, each request opens a new connection: on a reused connection, the first request after
a restart of the robot would fail.
"""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from dataclasses import replace
from urllib.parse import quote

import urllib3

from ur_cartesian_driver.protocol.dashboard import DashboardReply, DashboardRequest
from ur_cartesian_driver.protocol.robot_api import (
    ApiCommand,
    BASE_PATH,
    encode_body,
    find_command,
    parse_answer,
    RESUME,
)
from ur_cartesian_driver.protocol.rtde.rtde_packages import ControllerVersion
from ur_cartesian_driver.robot.services.dashboard_connection import REPORT_TIMEOUTS
from ur_cartesian_driver.robot.transport import CONNECT_TIMEOUT, error_reason

#: Longest wait for an answer [s].
ANSWER_TIMEOUT = 10.0
#: The same for commands that the robot answers after a slow effect [s].
SLOW_ANSWER_TIMEOUTS: Mapping[str, float] = {
    **dict.fromkeys(('power on', 'brake release', 'restart safety'), 30.0),
    **REPORT_TIMEOUTS,
}
#: Longest accepted answer [bytes]; programs have some 100 kB.
MAX_ANSWER_SIZE = 1 << 22
#: Largest number of redirects: paths have moved between versions, and old paths redirect to new.
MAX_REDIRECTS = 3
#: Longest wait until the robot reports a program as loaded [s]; the period of the queries [s].
LOAD_TIMEOUT, LOAD_POLL_PERIOD = 5.0, 0.2
#: The first software that reports the loaded program.
NAMES_LOADED_PROGRAM = (10, 12)
#: Suffix of program files; program names in the API do not have it.
PROGRAM_SUFFIX = '.urpx'


class RobotApiConnection:
    """Sends dashboard commands to the Robot API, from one event loop; requests may overlap."""

    def __init__(self, host: str, port: int, version: ControllerVersion) -> None:
        """
        Prepare; every request opens its own connection.

        :param version: software of the robot, which determines the requests.
        """
        self._host, self._port = host, port
        self._version = (version.major, version.minor)

    async def request(self, command: str, argument: str = '') -> DashboardReply:
        """
        Send a command and return the answer.

        :raises OSError: the Robot API does not answer, or the robot accepts a request to load a
            program but does not load it.
        :raises ProtocolError: the answer is invalid, or the API does not have the command.
        """
        api_command = find_command(command, self._version)
        if command == 'load':
            argument = argument.removesuffix(PROGRAM_SUFFIX)
        if command == 'play' and (await self.request('programState')).value == 'PAUSED':
            api_command = RESUME
        request = DashboardRequest(name=command, argument=argument)
        status, body = await asyncio.to_thread(
            self._exchange,
            api_command,
            encode_body(api_command, argument),
            timeout=SLOW_ANSWER_TIMEOUTS.get(command, ANSWER_TIMEOUT),
        )
        reply = parse_answer(request, api_command, status, body)
        if command == 'load' and reply.ok and self._version >= NAMES_LOADED_PROGRAM:
            await self._wait_until_loaded(argument)
        return reply

    async def get(self, command: ApiCommand, name: str = '') -> tuple[int, bytes]:
        """
        Send a request without a body, and return status and body of the answer.

        :param name: the name of a program, for a path that contains one.
        :raises OSError: the Robot API does not answer, or sends more than MAX_ANSWER_SIZE.
        """
        path = command.path.replace('{}', quote(name, safe=''))
        return await asyncio.to_thread(self._exchange, replace(command, path=path))

    async def send_program(self, command: ApiCommand, program: str) -> tuple[int, bytes]:
        """
        Send a program as the file of a form, and return status and body of the answer.

        :raises OSError: the Robot API does not answer.
        """
        form, content_type = urllib3.encode_multipart_formdata(
            {'file': (f'program{PROGRAM_SUFFIX}', program.encode(), 'application/json')}
        )
        return await asyncio.to_thread(self._exchange, command, form, content_type)

    async def _wait_until_loaded(self, program: str) -> None:
        """
        Wait until the robot reports a program as loaded; it accepts the request earlier.

        :raises OSError: the robot does not load the program in time.
        """
        loop = asyncio.get_running_loop()
        end = loop.time() + LOAD_TIMEOUT
        while (await self.request('get loaded program')).value != program:
            if loop.time() >= end:
                raise OSError(
                    f'The robot accepts to load {program!r}, but has not after '
                    f'{LOAD_TIMEOUT:g} s; PolyScope X loads programs only while its screen is '
                    'shown, on a pendant or in a browser'
                )
            await asyncio.sleep(LOAD_POLL_PERIOD)

    def _exchange(
        self,
        command: ApiCommand,
        body: bytes = b'',
        content_type: str = 'application/json',
        timeout: float = ANSWER_TIMEOUT,
    ) -> tuple[int, bytes]:
        """Send a request and return status and body of the answer; called in a thread."""
        try:
            # The pool connects only to the robot: no proxy, and no redirection to another host.
            with urllib3.HTTPConnectionPool(
                self._host,
                self._port,
                timeout=urllib3.Timeout(connect=CONNECT_TIMEOUT, read=timeout),
                retries=urllib3.Retry(total=MAX_REDIRECTS, connect=0, read=0, status=0, other=0),
            ) as robot:
                response = robot.request(
                    command.method,
                    BASE_PATH + command.path,
                    body=body or None,
                    headers={'Accept': 'application/json'}
                    | ({'Content-Type': content_type} if body else {}),
                    preload_content=False,
                )
                try:
                    answer = response.read(MAX_ANSWER_SIZE + 1)
                finally:
                    response.close()
        except urllib3.exceptions.HTTPError as error:
            where = f'{self._host} port {self._port} (Robot API)'
            raise OSError(f'{where}: {_reason(error, timeout)}') from error
        if len(answer) > MAX_ANSWER_SIZE:
            raise OSError(f'The answer of the Robot API is longer than {MAX_ANSWER_SIZE} bytes')
        return response.status, answer


def _reason(error: urllib3.exceptions.HTTPError, timeout: float) -> str:
    """Return the cause of an error, as the rest of a sentence."""
    cause: BaseException | None = error
    if isinstance(error, urllib3.exceptions.MaxRetryError) and error.reason is not None:
        cause = error.reason
    match cause:
        case urllib3.exceptions.NewConnectionError() if isinstance(cause.__cause__, OSError):
            return error_reason(cause.__cause__)
        case urllib3.exceptions.ConnectTimeoutError():
            return f'no answer within {CONNECT_TIMEOUT:g} s'
        case urllib3.exceptions.TimeoutError():
            return f'no answer within {timeout:g} s'
        case urllib3.exceptions.ResponseError():
            return f'it redirects more than {MAX_REDIRECTS} times'
        case urllib3.exceptions.HostChangedError():
            return 'it redirects to another host, or to HTTPS'
        case _:
            return 'it hangs up, or does not speak HTTP'
