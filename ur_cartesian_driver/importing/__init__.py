# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Goals from files of others: CSV, G-code, DXF, messages of ROS, recordings, URScript.

Each format has a module that collects points; `imported_goal` makes a goal of them, the same for
all. What the goal has not is said, with the lines of the file: nothing is dropped in silence.
"""

from __future__ import annotations

from collections.abc import Mapping
import os
from pathlib import Path
from typing import Any

from ur_cartesian_driver.goal_files.garbage import uncollected
from ur_cartesian_driver.importing import recording_file
from ur_cartesian_driver.importing.dxf import dxf_file
from ur_cartesian_driver.importing.gcode import gcode_file
from ur_cartesian_driver.importing.import_format import ImportFormat, Term, Treatment
from ur_cartesian_driver.importing.import_options import (
    CodeOutput,
    ImportOptions,
    parse_code_output,
    parse_length,
    ToolOrientation,
)
from ur_cartesian_driver.importing.imported_goal import goal_of_path, ImportedGoal
from ur_cartesian_driver.importing.imported_path import BrokenFile, ImportNote, PathCollector
from ur_cartesian_driver.importing.messages import ros_messages_file
from ur_cartesian_driver.importing.script import urscript_file
from ur_cartesian_driver.importing.tables import csv_file

__all__ = [
    'FORMATS',
    'BrokenFile',
    'CodeOutput',
    'ImportFormat',
    'ImportNote',
    'ImportOptions',
    'ImportedGoal',
    'Term',
    'ToolOrientation',
    'Treatment',
    'import_file',
    'import_message',
    'parse_code_output',
    'parse_length',
]

#: The formats by their names.
FORMATS: Mapping[str, ImportFormat] = {
    module.FORMAT.name: module.FORMAT
    for module in (
        csv_file,
        gcode_file,
        dxf_file,
        ros_messages_file,
        urscript_file,
        recording_file,
    )
}
_BY_SUFFIX = {suffix: form for form in FORMATS.values() for suffix in form.suffixes}


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
    found = FORMATS.get(form) if form else _BY_SUFFIX.get(path.suffix.lower())
    if found is None:
        raise BrokenFile(
            0,
            f'{form or path.suffix!r} is no {"" if form else "suffix of a "}known format; '
            f'give one of {", ".join(FORMATS)}',
        )
    into = PathCollector()
    found.collect(path, options, into)
    return goal_of_path(into.path(), options, into.remarks)


def import_message(message: Any, options: ImportOptions | None = None) -> ImportedGoal:
    """
    Read a nav_msgs/Path, a trajectory_msgs/JointTrajectory, or another message with a path.

    The lines of remarks are the numbers of the points from 1.

    :raises BrokenFile: it has no path, or a value is none of its field.
    """
    into, options = PathCollector(), options or ImportOptions()
    ros_messages_file.collect_message(message, options, into)
    return goal_of_path(into.path(), options, into.remarks)
