# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
A table with named columns: CSV of scanners, spreadsheets, recorders and our own scripts.

The header names the columns, with their units: ``x [mm]``, ``x(mm)`` or ``x_mm``. If the columns
are not separated by commas, the numbers can have decimal commas.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from operator import itemgetter
from pathlib import Path

import numpy as np

from ur_cartesian_driver.importing.import_format import ImportFormat
from ur_cartesian_driver.importing.import_options import ImportOptions
from ur_cartesian_driver.importing.imported_path import BrokenFile, PathCollector
from ur_cartesian_driver.importing.tables.cell_values import cell_values
from ur_cartesian_driver.importing.tables.column_names import (
    ANGLES,
    NORMAL,
    POSITION,
    QUATERNION,
    ROLES,
    ROTATION_VECTOR,
    TERMS,
)
from ur_cartesian_driver.importing.tables.table_columns import find_columns, is_header
from ur_cartesian_driver.importing.tables.table_text import read_table
from ur_cartesian_driver.importing.text_file import file_lines, file_text
from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.geometry.pose_rows import multiply_rows, normalized_rows
from ur_cartesian_driver.motion.geometry.rotation_rows import exp_rows
from ur_cartesian_driver.motion.goal.goal_columns import rows_where

#: Largest angle [rad]; a larger one is refused, because it is probably in degrees.
_MAX_TURN = 4.0 * np.pi


def collect_csv(file: Path, options: ImportOptions, into: PathCollector) -> None:
    """
    Read a table.

    :raises BrokenFile: the file is no table, or a column or a cell cannot be read.
    """
    table = read_table(file_lines(file_text(file)), is_header, options.unit, into.remarks)
    columns = find_columns(table.titles, table.units, table.line, options, into.remarks)
    cells_of = itemgetter(*(column.index for column in columns))
    lines: list[int] = []
    cells: list[str] = []
    for line, row in table.rows():
        lines.append(line)
        cells += cells_of(row)
    if not lines:
        return
    texts = {column: cells[i :: len(columns)] for i, column in enumerate(columns)}
    values = cell_values(texts, lines, into.remarks)
    _check_signs(values, lines)
    into.add_lines(
        lines,
        np.column_stack([values[role] for role in ROLES[POSITION]]),
        quaternions=_orientations(values, lines),
        normals=_rows(values, ROLES[NORMAL]),
        speeds=values.get('speed'),
        blends=values.get('blend'),
        times=values['t'] - values['t'][0] if 't' in values else None,
    )


def _check_signs(values: Mapping[str, Floats], lines: Sequence[int]) -> None:
    """Refuse a speed that is not above 0, and a blend radius below 0."""
    for name, is_wrong, wanted in (
        ('speed', np.less_equal, 'a number above 0'),
        ('blend', np.less, '0 or more'),
    ):
        numbers = values.get(name, np.ones(1))
        for row in rows_where(is_wrong(numbers, 0.0))[:1]:
            raise BrokenFile(
                lines[row],
                f'the {name} is {numbers[row]:g}; leave the column out, or write {wanted}',
            )


def _rows(values: Mapping[str, Floats], roles: Sequence[str]) -> Floats | None:
    """Return columns side by side, or None if the table lacks one of them."""
    if not values.keys() >= set(roles):
        return None
    return np.column_stack([values[role] for role in roles])


def _orientations(values: Mapping[str, Floats], lines: Sequence[int]) -> Floats | None:
    """
    Return the unit quaternions (n, 4) of a table; None = the table has no orientations.

    :raises BrokenFile: the quaternion of a row is not of length 1, or an angle is too large.
    """
    if (quaternions := _rows(values, ROLES[QUATERNION])) is not None:
        lengths = np.linalg.norm(quaternions, axis=1)
        for row in rows_where(~(np.abs(lengths - 1.0) < 0.01))[:1]:
            raise BrokenFile(
                lines[row], f'the quaternion has the length {lengths[row]:.4g}, but must have 1'
            )
        return normalized_rows(quaternions)
    vectors, angles = (_rows(values, ROLES[topic]) for topic in (ROTATION_VECTOR, ANGLES))
    turns = angles if vectors is None else vectors
    if turns is None:
        return None
    for row in rows_where((np.abs(turns) > _MAX_TURN).any(axis=1))[:1]:
        raise BrokenFile(
            lines[row],
            f'a turn of {np.abs(turns[row]).max():.4g} rad is more than two turns; if it is in '
            'degrees, the header has to say [deg]',
        )
    if vectors is not None:
        quaternions = exp_rows(vectors)
        return quaternions
    roll, pitch, yaw = (exp_rows(turns[:, [i]] * axis) for i, axis in enumerate(np.eye(3)))
    return multiply_rows(yaw, multiply_rows(pitch, roll))


FORMAT = ImportFormat(
    terms=TERMS,
    others='Every other column is left out, and said, unless it could be an orientation.',
    collect=collect_csv,
)
