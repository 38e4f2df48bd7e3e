# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""G-code of CAM systems, lasers, plotters and slicers: moves in a plane or in space."""

from __future__ import annotations

from pathlib import Path

from ur_cartesian_driver.importing.gcode.codes import CODES
from ur_cartesian_driver.importing.gcode.machine import GcodeMachine
from ur_cartesian_driver.importing.import_format import ImportFormat
from ur_cartesian_driver.importing.import_options import ImportOptions
from ur_cartesian_driver.importing.imported_path import PathCollector
from ur_cartesian_driver.importing.text_file import file_lines, file_text


def collect_gcode(file: Path, options: ImportOptions, into: PathCollector) -> None:
    """
    Add the points of a program to a path.

    :raises BrokenFile: a line is no G-code, or cannot be executed.
    """
    is_sinumerik = file.suffix.lower() == '.mpf'
    lines = file_lines(file_text(file))
    GcodeMachine(lines, options, into, is_sinumerik=is_sinumerik).run()


FORMAT = ImportFormat(
    terms=CODES,
    others='Every other code and word refuses the file.',
    collect=collect_gcode,
)
