# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The programs of a robot over the Robot API: list, upload, update, download, load."""

from __future__ import annotations

from collections.abc import Callable
from http import HTTPStatus
from pathlib import PurePosixPath

from ur_cartesian_driver.sim.controller import Controller
from ur_cartesian_driver.sim.interfaces.robot_api_fields import (
    Body,
    Fields,
    Refused,
    text_field,
    Waiting,
)
from ur_cartesian_driver.sim.pendant_programs.program_tree import UnreadableProgram
from ur_cartesian_driver.sim.programs.stored_programs import read_urpx


def list_programs(controller: Controller, _: Body) -> Fields:
    """Return the information about each program, in the order of their names."""
    files = controller.stored_programs
    return {
        'programs': [
            files.urpx(name)['program']['programInformation'] for name in sorted(files.names())
        ],
        'message': None,
    }


def download_program(controller: Controller, body: Body) -> Fields:
    """
    Return the content of a program's file.

    :raises Refused: there is no such program, or its file cannot be read.
    """
    name = text_field(body, 'name')
    files = controller.stored_programs
    if name not in files.names():
        raise Refused(HTTPStatus.NOT_FOUND, 'Program not found', details=name)
    program = files.program(files.names()[name])
    if isinstance(program, UnreadableProgram):
        raise Refused(HTTPStatus.INTERNAL_SERVER_ERROR, 'Error', details=program.reason)
    return files.urpx(name)


def upload_program(controller: Controller, body: Body) -> Fields:
    """
    Add the program in the file of a form.

    :raises ValueError: the form has no program file.
    :raises Refused: a program has this name already.
    """
    name, content = read_urpx(_file(body))
    if name in controller.stored_programs.names():
        raise Refused(
            HTTPStatus.BAD_REQUEST, 'Program with this name already exists', details=name
        )
    controller.stored_programs.put(name, content)
    return {'programName': name, 'message': 'Program uploaded'}


def update_program(controller: Controller, body: Body) -> Fields:
    """
    Replace a program by the one of the same name in the file of a form.

    :raises ValueError: the form has no program file.
    :raises Refused: there is no such program, or it is loaded.
    """
    name, content = read_urpx(_file(body))
    if name not in controller.stored_programs.names():
        raise Refused(HTTPStatus.NOT_FOUND, 'Program not found', details=name)
    if name == PurePosixPath(controller.programs.loaded).stem:
        raise Refused(HTTPStatus.CONFLICT, 'Program is loaded and active', details=name)
    controller.stored_programs.put(name, content)
    return {'programName': name, 'message': 'Program updated'}


def load_program(field: str) -> Callable[[Controller, Body], Waiting]:
    """Return a request handler; it loads the program whose name is in ``field`` of the request."""

    def load(controller: Controller, body: Body) -> Waiting:
        name = text_field(body, field)
        file = controller.stored_programs.names().get(name, '')
        refusals: list[str] = []
        if file:
            controller.load_program_aside(file, refusals.append)
        else:
            refusals.append(f'No program {name!r}')

        def is_done(_: Controller) -> bool:
            if any(refusals):
                raise Refused(HTTPStatus.INTERNAL_SERVER_ERROR, 'Error', details=refusals[0])
            return bool(refusals)

        return Waiting(is_done, 'Program loaded')

    return load


def loaded_program(controller: Controller, _: Body) -> Fields:
    """Return the name of the loaded program."""
    return {'name': PurePosixPath(controller.programs.loaded).stem or 'Default program'}


def _file(body: Body) -> bytes:
    """
    Return the file of a form.

    :raises ValueError: the form has no file.
    """
    data = body.get('file')
    if not isinstance(data, bytes):
        raise ValueError('file is missing')
    return data
