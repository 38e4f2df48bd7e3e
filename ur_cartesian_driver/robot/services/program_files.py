# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The programs of a robot with PolyScope X: list, upload, update, download.

A call contains a program as text, the content of a `.urpx` file, and never a path, so that callers
of the service gain no access to the files of this computer.
"""

from __future__ import annotations

from collections.abc import Mapping

from ur_cartesian_driver.protocol.robot_api import (
    DOWNLOAD_PROGRAM,
    LIST_PROGRAMS,
    parse_program_name,
    parse_program_names,
    refusal_text,
    UPDATE_PROGRAM,
    UPLOAD_PROGRAM,
)
from ur_cartesian_driver.robot.link import RobotLink
from ur_cartesian_driver.robot.services.robot_api_connection import (
    PROGRAM_SUFFIX,
    RobotApiConnection,
)
from ur_cartesian_driver.robot.services.service_calls import (
    DownloadProgramCall,
    failed,
    ListProgramsCall,
    ServiceAnswer,
    succeeded,
    UploadProgramCall,
)

_LIST = 'Ask for the list of its programs.'
_LOG = 'Look at the log of the robot.'
#: Remedies for the refusal of any call, by HTTP status.
REMEDIES: Mapping[int, str] = {
    403: 'It is in local control: switch it to remote control on the pendant.',
    409: 'The program is loaded: load another one first.',
    422: 'Is this the content of a .urpx file?',
}


class ProgramFiles:
    """Carries out the calls, from one event loop."""

    def __init__(self, host: str, port: int, link: RobotLink) -> None:
        """Prepare; every call opens its own connection to the Robot API."""
        self._host, self._port, self._link = host, port, link

    async def carry_out(
        self, call: ListProgramsCall | UploadProgramCall | DownloadProgramCall
    ) -> ServiceAnswer:
        """
        Return the answer to a call.

        :raises OSError: the Robot API does not answer.
        :raises ProtocolError: the answer is invalid.
        """
        version = self._link.version
        if version is None:
            return failed(self._link.status.message)
        if (version.major, version.minor) < LIST_PROGRAMS.since:
            since = '.'.join(map(str, LIST_PROGRAMS.since))
            return failed(
                f'This needs the Robot API of PolyScope X {since} or newer, but the robot runs '
                f'{version}; use the pendant.'
            )
        api = RobotApiConnection(self._host, self._port, version)
        match call:
            case ListProgramsCall():
                status, body = await api.get(LIST_PROGRAMS)
            case UploadProgramCall():
                status, body = await api.send_program(
                    UPDATE_PROGRAM if call.replaces else UPLOAD_PROGRAM, call.program
                )
            case DownloadProgramCall():
                name = call.program_name.removesuffix(PROGRAM_SUFFIX)
                status, body = await api.get(DOWNLOAD_PROGRAM, name)
        if not 200 <= status < 300:
            said = refusal_text(status, body)
            return failed(f'The robot refused: {said.rstrip(".")}. {_remedy(call, status)}')
        match call:
            case ListProgramsCall():
                return succeeded('\n'.join(parse_program_names(body)))
            case UploadProgramCall():
                return succeeded(parse_program_name(body))
            case DownloadProgramCall():
                try:
                    return succeeded(body.decode())
                except UnicodeDecodeError:
                    return failed('The program that the robot sent is damaged: it is not text.')


def _remedy(call: ListProgramsCall | UploadProgramCall | DownloadProgramCall, status: int) -> str:
    match call, status:
        case UploadProgramCall(replaces=False), 400:
            return 'If the robot already has a program of this name, replace it.'
        case ((UploadProgramCall(replaces=True) | DownloadProgramCall()), 404):
            return _LIST
    return REMEDIES.get(status, _LOG)
