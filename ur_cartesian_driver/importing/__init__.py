# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Make goals from files of other formats: CSV, G-code, DXF, ROS messages, recordings, URScript.

Each format has a module that collects points; `imported_goal` makes a goal of the points, in the
same way for all formats. Nothing is dropped silently: remarks list everything in the file that the
goal lacks, with its lines. Other packages can add formats: doc/adding_a_format.md.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from ur_cartesian_driver.file_formats import FileFormats
from ur_cartesian_driver.goal_files.garbage import uncollected
from ur_cartesian_driver.importing.import_format import (
    honoured,
    ImportFormat,
    left_out,
    refused,
    Term,
    term_table,
    Treatment,
)
from ur_cartesian_driver.importing.import_options import (
    CodeOutput,
    ImportOptions,
    LENGTH_UNITS,
    parse_code_output,
    parse_length,
    ToolOrientation,
)
from ur_cartesian_driver.importing.imported_goal import goal_of_path, ImportedGoal
from ur_cartesian_driver.importing.imported_path import BrokenFile, ImportNote, PathCollector
from ur_cartesian_driver.importing.text_file import file_lines, file_text

__all__ = [
    'FORMATS',
    'LENGTH_UNITS',
    'BrokenFile',
    'CodeOutput',
    'ImportFormat',
    'ImportNote',
    'ImportOptions',
    'ImportedGoal',
    'PathCollector',
    'Term',
    'ToolOrientation',
    'Treatment',
    'file_lines',
    'file_text',
    'honoured',
    'import_file',
    'import_message',
    'left_out',
    'parse_code_output',
    'parse_length',
    'refused',
    'term_table',
]

#: The formats by name and suffix.
FORMATS: FileFormats[ImportFormat] = FileFormats(
    'ur_cartesian_driver.importers',
    {
        f'{__name__}.{reader}:FORMAT': names
        for reader, names in {
            'tables.csv_file': 'csv .csv .tsv .txt',
            'gcode.gcode_file': 'gcode .gcode .nc .ngc .gco .gc .g .tap .cnc .mpf',
            'dxf.dxf_file': 'dxf .dxf',
            'messages.ros_messages_file': 'ros .yaml .yml',
            'script.urscript_file': 'urscript .script .urscript',
            'recording_file': 'recording .npz .part',
        }.items()
    },
    refusals=(BrokenFile, OSError),
)


@uncollected()
def import_file(
    file: str | os.PathLike[str], options: ImportOptions | None = None, form: str = ''
) -> ImportedGoal:
    """
    Read a file as a goal.

    :param form: one of the names of :data:`FORMATS`; empty = the format of the file's suffix.
    :raises BrokenFile: the file has an error or an unknown format; the message names the line.
    :raises ImportError: a package that the format needs is not installed, or is broken.
    :raises OSError: the file cannot be opened.
    """
    path, options = Path(file), options or ImportOptions()
    name = form or path.suffix.lower()
    if name not in FORMATS:
        if path.is_dir():
            raise BrokenFile(0, 'this is a folder; name a file')
        raise BrokenFile(
            0,
            f'{form or path.suffix!r} is no {"" if form else "suffix of a "}known format; '
            f'give one of {", ".join(FORMATS.names())}',
        )
    into = PathCollector()
    with FORMATS.using(name) as found:
        found.collect(path, options, into)
        return goal_of_path(into.path(), options, into.remarks)


def import_message(message: Any, options: ImportOptions | None = None) -> ImportedGoal:
    """
    Read a nav_msgs/Path, a trajectory_msgs/JointTrajectory, or another message with a path.

    Remarks on a message name numbers of points, from 1, instead of lines.

    :raises BrokenFile: the message has no path, or a value does not suit its field.
    """
    from ur_cartesian_driver.importing.messages.ros_messages_file import collect_message

    into, options = PathCollector(), options or ImportOptions()
    collect_message(message, options, into)
    return goal_of_path(into.path(), options, into.remarks)
