# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The program files of a robot: from its configuration, and uploaded by clients.

PolyScope X stores a program as JSON (`.urpx`): its tree, its information, and the URScript that
was generated from them. The simulator runs the URScript.
"""

from __future__ import annotations

from collections.abc import Mapping
import json
from pathlib import PurePosixPath
from typing import Any

from ur_cartesian_driver.sim.pendant_programs.program_tree import (
    FetchedScript,
    function_name,
    SavedProgram,
    UnreadableProgram,
)

#: Suffix of the programs of PolyScope X.
URPX_SUFFIX = '.urpx'
_SCRIPT = ('program', 'urscript', 'script')


class StoredPrograms:
    """The programs on the disk of a robot."""

    def __init__(self, programs: Mapping[str, SavedProgram]) -> None:
        """
        Begin with these files.

        :param programs: file name -> program.
        """
        self._programs = dict(programs)
        self._uploaded: dict[str, Mapping[str, Any]] = {}

    def program(self, file: str) -> SavedProgram | None:
        """Return the program of a file; None = there is no such file."""
        return self._programs.get(file)

    def names(self) -> dict[str, str]:
        """Return program name -> file; a name is the file without suffix, as on PolyScope X."""
        return {PurePosixPath(file).stem: file for file in self._programs}

    def urpx(self, name: str) -> Mapping[str, Any]:
        """
        Return the content of a program's `.urpx` file.

        If the program was not uploaded, the content is made up: no tree, nothing at the nodes of
        External Control, and an empty script if the program cannot be read.
        """
        if (content := self._uploaded.get(name)) is not None:
            return content
        program = self._programs[self.names()[name]]
        if isinstance(program, UnreadableProgram):
            script = ''
        else:
            script = program if isinstance(program, str) else program.script(name, FetchedScript())
        return {
            'application': {},
            'program': {
                'programInformation': {
                    'name': name,
                    'description': '',
                    'createdDate': None,
                    'lastSavedDate': None,
                    'lastModifiedDate': None,
                    'programState': 'FINAL',
                },
                'urscript': {'script': script, 'nodeIDList': []},
            },
        }

    def put(self, name: str, content: Mapping[str, Any]) -> None:
        """Add or replace a program; the content has been read by :func:`read_urpx`."""
        self._uploaded[name] = content
        self._programs[self.names().get(name, name + URPX_SUFFIX)] = urpx_script(name, content)


def read_urpx(data: bytes) -> tuple[str, Mapping[str, Any]]:
    """
    Return the name of the program in a `.urpx` file, and the content of the file.

    :raises ValueError: the data are not the content of such a file.
    """
    content = json.loads(data)
    name = _text_in(content, 'program', 'programInformation', 'name')
    if not name or not _text_in(content, *_SCRIPT):
        raise ValueError('the file lacks the name or the script of a program')
    if '/' in name:  # the name becomes the name of a file
        raise ValueError(f'the name of the program, {name!r}, contains a /')
    return name, content


def _text_in(content: object, *keys: str) -> str:
    """Return a text inside objects; empty if it is not there."""
    for key in keys:
        content = content.get(key) if isinstance(content, dict) else None
    return content if isinstance(content, str) else ''


def urpx_script(name: str, content: Mapping[str, Any]) -> str:
    """
    Return a program's URScript as one function.

    If the script is not a function already, the function begins with the application's script.
    """
    script = _text_in(content, *_SCRIPT)
    if script.lstrip().startswith('def '):
        return script
    application = _text_in(content, 'application', 'urscript', 'script')
    return f'def {function_name(name)}():\n{application}\n{script}\nend\n'
