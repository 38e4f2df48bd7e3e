# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The dashboard client's services for program files, which robots with PolyScope X have.

The driver takes and returns programs as text; these services name files. Only files in
``program_directory`` are allowed; otherwise any caller could read and write any file.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from std_srvs.srv import Trigger

from ur_cartesian_driver.robot.services.service_calls import ServiceAnswer
from ur_cartesian_driver.ros.message_fields import class_of, Message
from ur_cartesian_driver.ros.services.deferred_service import DeferredService
from ur_cartesian_driver.ros.ur_driver_names.dashboard_services import DASHBOARD
from ur_cartesian_driver.ros.ur_driver_names.driver_node import DriverNode
from ur_cartesian_driver.ros.ur_driver_names.names_settings import NamesSettings
from ur_cartesian_driver.ros.ur_driver_names.offered_name import Service, UrName
from ur_cartesian_driver.srv import DownloadProgram, UploadProgram


class _Refused(Exception):
    """A file may not be used; the text says why."""


def _file(directory: str, name: str) -> Path:
    """
    Return a file in the directory of programs.

    :param name: relative to the directory, or absolute.
    :raises _Refused: the file is elsewhere, or there is no such directory.
    """
    if not directory:
        raise _Refused(
            'Files are read and written only in program_directory, a parameter of '
            'ur_driver_names, which is empty.'
        )
    root = Path(directory).resolve()
    path = (root / name).resolve()
    if not path.is_relative_to(root):
        raise _Refused(f'The file {name} is not in program_directory ({root}).')
    return path


@dataclass(frozen=True, slots=True, kw_only=True)
class _FileService(UrName):
    """A service that moves a program between the robot and a file."""

    kind: str = 'service'
    #: Starts the driver's call for a request and a directory; returns the future of its answer.
    #:
    #: :raises _Refused: the file may not be used.
    #: :raises OSError: the file cannot be read.
    #: :raises ValueError: the file is not UTF-8, or its name is invalid.
    start: Callable[[DriverNode, str, Message, str], Future[ServiceAnswer]]

    def offer(self, driver: DriverNode, settings: NamesSettings, kind: Any) -> object:
        """Serve files of the directory of programs."""

        def handle(request: Message) -> Future[Message]:
            response: Future[Message] = Future()
            try:
                answer = self.start(driver, self.source, request, settings.program_directory)
            except (_Refused, OSError, ValueError) as error:
                response.set_result(kind.Response(success=False, answer=str(error)))
                return response
            answer.add_done_callback(
                lambda done: response.set_result(_response(kind, request, done.result(), settings))
            )
            return response

        return DeferredService(driver.node, kind, self.name, handle)


def _upload(
    driver: DriverNode, source: str, request: Message, directory: str
) -> Future[ServiceAnswer]:
    text = _file(directory, request.file_path).read_text('utf-8')
    return driver.call(UploadProgram, source, UploadProgram.Request(program=text))


def _download(
    driver: DriverNode, source: str, request: Message, directory: str
) -> Future[ServiceAnswer]:
    _file(directory, request.target_path)  # refused before the robot is asked
    return driver.call(
        DownloadProgram, source, DownloadProgram.Request(program_name=request.program_name)
    )


def _response(
    kind: Any, request: Message, answer: ServiceAnswer, settings: NamesSettings
) -> Message:
    """Return the response; for a download, write the program to its file first."""
    response = kind.Response(success=answer.ok, answer=answer.text)
    if not answer.ok:
        return response
    if hasattr(response, 'program_name'):
        response.program_name = answer.text
        return response
    try:
        path = _file(settings.program_directory, request.target_path)
        path.write_text(answer.text, 'utf-8')
    except (_Refused, OSError, ValueError) as error:
        return kind.Response(success=False, answer=str(error))
    response.answer = f'The program is in {path}.'
    return response


def _list(response: Message, text: str) -> None:
    """Fill in the names of the programs; the driver knows nothing else about them."""
    information = class_of('ur_dashboard_msgs/msg/ProgramInformation')
    response.programs = [information(name=name) for name in text.splitlines()]


PROGRAM_SERVICES: tuple[UrName, ...] = (
    Service(
        name=f'{DASHBOARD}/get_programs',
        type='ur_dashboard_msgs/srv/GetPrograms',
        source='dashboard/get_programs',
        source_type=Trigger,
        fill=_list,
    ),
    *(
        _FileService(
            name=f'{DASHBOARD}/{name}',
            type='ur_dashboard_msgs/srv/UploadProgram',
            source=f'dashboard/{name}',
            start=_upload,
        )
        for name in ('upload_program', 'update_program')
    ),
    _FileService(
        name=f'{DASHBOARD}/download_program',
        type='ur_dashboard_msgs/srv/DownloadProgram',
        source='dashboard/download_program',
        start=_download,
    ),
)
