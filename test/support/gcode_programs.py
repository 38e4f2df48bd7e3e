# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Import a text as G-code, and look at the goal."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ur_cartesian_driver.importing import (
    BrokenFile,
    import_file,
    ImportedGoal,
    ImportOptions,
    parse_code_output,
)
from ur_cartesian_driver.importing.gcode.codes import CODES
from ur_cartesian_driver.motion.geometry.arrays import Floats

#: Words that a left-out code needs beside it.
WORDS = {
    'G4': 'P2 X3',
    'G64 Q': '0.2 P0.1',
    'G5 P': '10000',
    'G5.1 Q': '1',
    'G8 P': '1',
    'G103': 'P1',
    'G187': 'P2',
    'A': '90',
    'B': '90',
    'C': '90',
    'U': '5 V5',
    'V': '5',
    'E': '1.5',
    'G10 L2': 'P2 X5 R3',
    'G10 L0': '',
    'G10 L1': 'P1 Z5 R2',
    'G10 L10': 'P1 Z5',
    'G10 L11': 'P1 Z5',
    'G10': 'S1',
    'G28': 'X3 Y4',
    'G30': 'Z3',
    'G53': 'G0 Z3',
    'G28.1': 'X3',
    'G43': 'H1',
    'G44': 'H1',
    'G43.1': 'Z3',
    'G43.2': 'H2',
    'G50 S': '2000',
    'G92 S': '2000',
    'G96': 'S200 D3000',
    'M19': 'R90',
    'M62': 'P1',
    'M66': 'P0 L3 Q5',
    'M67': 'E0 Q1.5',
    'T': '1',
    'D': '1',
    'H': '1',
    'M6': '',
    'M61': 'Q2',
    'M50': 'P1',
    '/': 'X7',
    '$': '32=1',
    '(MSG,': ' hello)',
    '(DEBUG,': ' #5)',
    '(PRINT,': ' x)',
    '(LOG,': ' x)',
    'G29': 'P1 X7 Y8',
    'G29.1': 'Z-0.02',
    'M73 P': '0 R10',
    'M73 L': '3',
    'M73 Q': '0 S10',
    'M73 R': '3',
}
#: Lines for rows that are no codes.
EXAMPLES = {
    'other M-codes': 'M88',
    'other names with _': 'QUAD_GANTRY_LEVEL',
    'EXCLUDE_': 'EXCLUDE_OBJECT_DEFINE NAME=x POLYGON=[[1,2],[3,4]]',
    'SET_': 'SET_VELOCITY_LIMIT ACCEL=3000',
    'TIMELAPSE_': 'TIMELAPSE_TAKE_FRAME',
    'TURN_OFF_': 'TURN_OFF_HEATERS',
    'G15 H': 'G15 H2',
    'o-word': 'o100 sub',
    'IF': 'IF [#1 LT 5] GOTO 10',
    'WHILE': 'WHILE [#1 LT 5] DO1',
    'GOTO': 'GOTO 10',
    '#': '#1=5',
    '[': 'X[5]',
    '=': 'X=5',
    '$H': '$H',
    '$J': '$J=G91 X5',
    'M98 P"': 'M98 P"/macros/a.g"',
    'W': 'W5',
    ',R': 'G1 X5 ,R2',
    ',C': 'G1 X5 ,C2.5',
    '< >': '<PART-A>',
    'T S L': 'T1 S1 L0 D0',
    'P S': 'P0 S1',
    'G80 W': 'G80 X5 Y6 W30 H40',
    'G80 H': 'G80 H40 X5 Y6',
}


def line_of(name: str) -> str:
    """Return a line with a term of the table that is left out."""
    row = CODES[name]
    if row.text:
        return f'{name} G1 X5 "and more'
    if name in EXAMPLES:
        return EXAMPLES[name]
    words = WORDS.get(name, 'X7 Y8 Z9 S3' if row.alone else '')
    return f'{name}{words}' if ' ' in name else f'{name} {words}'


def imported(folder: Path, text: str, *outputs: str, **options: Any) -> ImportedGoal:
    """
    Import a program.

    :param outputs: values of the option --output-of.
    """
    file = folder / 'part.nc'
    file.write_text(text, encoding='utf-8', newline='')
    codes = dict(map(parse_code_output, outputs))
    return import_file(file, ImportOptions(outputs=codes, **options))


def positions(found: ImportedGoal) -> Floats:
    """Return the points (n, 3) [mm]."""
    return 1e3 * np.array(found.goal.waypoints.poses)[:, :3]


def remarks(found: ImportedGoal) -> list[str]:
    """Return the remarks, without those about orientation and blends."""
    ours = [remark.text() for remark in found.remarks]
    return [text for text in ours if not text.startswith(('no orientations', 'the arm stops'))]


def switched(found: ImportedGoal) -> list[tuple[int, int, float]]:
    """Return waypoint, pin and value of each output command."""
    return [(c.waypoint, c.pin, round(c.value, 4)) for c in found.goal.io_commands]


def refusal(folder: Path, text: str, *outputs: str, **options: Any) -> str:
    """Return the sentence that refuses a program."""
    with pytest.raises(BrokenFile) as caught:
        imported(folder, text, *outputs, **options)
    return str(caught.value)
