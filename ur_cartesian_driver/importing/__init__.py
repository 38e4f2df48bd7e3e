# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Goals from files of others: CSV, G-code, DXF, messages of ROS, recordings, URScript.

Each format has a module that collects points; `imported_goal` makes a goal of them, the same for
all. What the goal has not is said, with the lines of the file: nothing is dropped in silence.
"""

from __future__ import annotations

from collections.abc import Callable
import os
from pathlib import Path
from typing import Any

from ur_cartesian_driver.goal_files.garbage import uncollected
from ur_cartesian_driver.importing.csv_file import collect_csv
from ur_cartesian_driver.importing.dxf_file import collect_dxf
from ur_cartesian_driver.importing.gcode_file import collect_gcode
from ur_cartesian_driver.importing.import_options import (
    CodeOutput,
    ImportOptions,
    parse_code_output,
    parse_length,
    ToolOrientation,
)
from ur_cartesian_driver.importing.imported_goal import goal_of_path, ImportedGoal
from ur_cartesian_driver.importing.imported_path import BrokenFile, ImportNote, PathCollector
from ur_cartesian_driver.importing.recording_file import collect_recording
from ur_cartesian_driver.importing.ros_messages_file import collect_message, collect_yaml
from ur_cartesian_driver.importing.urscript_file import collect_urscript

__all__ = [
    'FORMATS',
    'BrokenFile',
    'CodeOutput',
    'ImportNote',
    'ImportOptions',
    'ImportedGoal',
    'ToolOrientation',
    'import_file',
    'import_message',
    'parse_code_output',
    'parse_length',
]

_TEXTS: dict[str, Callable[[str, ImportOptions, PathCollector], None]] = {
    'csv': collect_csv,
    'gcode': collect_gcode,
    'dxf': collect_dxf,
    'ros': collect_yaml,
    'urscript': collect_urscript,
}
_RECORDING = 'recording'
FORMATS = (*_TEXTS, _RECORDING)
_SUFFIXES = {
    **dict.fromkeys(('.csv', '.tsv', '.txt'), 'csv'),
    **dict.fromkeys(('.gcode', '.nc', '.ngc', '.gco', '.g', '.tap', '.cnc', '.mpf'), 'gcode'),
    '.dxf': 'dxf',
    **dict.fromkeys(('.yaml', '.yml'), 'ros'),
    **dict.fromkeys(('.script', '.urscript'), 'urscript'),
    **dict.fromkeys(('.npz', '.part'), _RECORDING),
}


@uncollected()
def import_file(
    file: str | os.PathLike[str], options: ImportOptions | None = None, form: str = ''
) -> ImportedGoal:
    """
    Read a file.

    :param form: one of :data:`FORMATS`; empty = as the suffix of its name says.
    :raises BrokenFile: it cannot be read; the sentence has the line.
    :raises ImportError: a package for this format is not installed.
    :raises OSError: the file cannot be opened.
    """
    path, options = Path(file), options or ImportOptions()
    form = form or _SUFFIXES.get(path.suffix.lower(), '')
    into = PathCollector()
    if form == _RECORDING:
        collect_recording(path, into)
    elif form in _TEXTS:
        _TEXTS[form](_text(path), options, into)
    else:
        raise BrokenFile(
            0, f'{path.suffix!r} is no suffix of a known format; give one of {", ".join(FORMATS)}'
        )
    return goal_of_path(into.path(), options, into.remarks)


def import_message(message: Any, options: ImportOptions | None = None) -> ImportedGoal:
    """
    Read a nav_msgs/Path, a geometry_msgs/PoseArray or a trajectory_msgs/JointTrajectory.

    The lines of remarks are the numbers of the points from 1.

    :raises BrokenFile: it is none of these, or a value is none of its field.
    """
    into, options = PathCollector(), options or ImportOptions()
    collect_message(message, options, into)
    return goal_of_path(into.path(), options, into.remarks)


def _text(path: Path) -> str:
    """Return the text of a file; old programs write Latin-1."""
    data = path.read_bytes()
    try:
        return data.decode('utf-8-sig')
    except UnicodeDecodeError:
        if b'\0' in data:
            raise BrokenFile(0, 'this is a binary file, and no text') from None
        return data.decode('latin-1')
