# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
A table with named columns: CSV of scanners, spreadsheets and our own scripts.

The first line that is not empty and does not begin with # names the columns, with their units:
``x [mm]``, ``x(mm)`` or ``x_mm``. Columns are separated by commas, semicolons or tabs; with
semicolons and tabs numbers may have a decimal comma. Recordings of RTDE, as ur_rtde and the client
of Universal Robots write them, have the names of RTDE's fields, the latter spaces between them.
"""

from __future__ import annotations

from collections.abc import Callable
import csv
from dataclasses import dataclass
from math import isfinite, radians, sqrt
from pathlib import Path
import re

from ur_cartesian_driver.importing.import_format import ImportFormat, term_table
from ur_cartesian_driver.importing.import_options import ImportOptions, LENGTH_UNITS
from ur_cartesian_driver.importing.imported_path import BrokenFile, PathCollector
from ur_cartesian_driver.importing.text_file import file_lines, file_text
from ur_cartesian_driver.motion.pose import Quaternion, quaternion_from_rotation_vector
from ur_cartesian_driver.path.orientations import roll_pitch_yaw

_HEADER = re.compile(
    r'\s*([a-z][a-z0-9 ]*?)\s*(?:[\[(]\s*([^\])]*?)\s*[\])]|_([a-z/]+))?\s*', re.I
)

#: Names of columns: what they are called here, and in which units they can be.
_LENGTH, _ANGLE, _TIME, _SPEED, _PURE = 'length', 'angle', 'time', 'speed', 'number'
_ANGLES = {'rad': 1.0, 'deg': radians(1.0), '°': radians(1.0)}
_TIMES = {'s': 1.0, 'ms': 1e-3, 'us': 1e-6, 'ns': 1e-9}
_SPEEDS = {
    f'{unit}/{name}': factor / time
    for unit, factor in LENGTH_UNITS.items()
    for name, time in (('s', 1.0), ('min', 60.0))
}
_UNITS = {_LENGTH: LENGTH_UNITS, _ANGLE: _ANGLES, _TIME: _TIMES, _SPEED: _SPEEDS}
#: The unit of a column that does not say it; a length and a speed have to.
_DEFAULT = {_ANGLE: 'rad', _TIME: 's', _PURE: ''}
_QUANTITIES = {
    **dict.fromkeys(('x', 'y', 'z'), _LENGTH),
    **dict.fromkeys(('qx', 'qy', 'qz', 'qw', 'nx', 'ny', 'nz'), _PURE),
    **dict.fromkeys(('rx', 'ry', 'rz', 'roll', 'pitch', 'yaw'), _ANGLE),
    't': _TIME,
    'speed': _SPEED,
    'blend': _LENGTH,
}
_SYNONYMS = {
    'time': 't',
    'timestamp': 't',
    'v': 'speed',
    'velocity': 'speed',
    'feed': 'speed',
    'radius': 'blend',
    'normal x': 'nx',
    'normal y': 'ny',
    'normal z': 'nz',
    'quat x': 'qx',
    'quat y': 'qy',
    'quat z': 'qz',
    'quat w': 'qw',
}
#: The first of these that is there whole is the pose: names of our exports and of RTDE, where each
#: column has one number of it.
_RECORDED_POSES = (
    {f'actual_pose_{name}': name for name in ('x [m]', 'y [m]', 'z [m]', 'qx', 'qy', 'qz', 'qw')},
    *(
        {
            f'{pose}_{i}': name
            for i, name in enumerate(
                ('x [m]', 'y [m]', 'z [m]', 'rx [rad]', 'ry [rad]', 'rz [rad]')
            )
        }
        for pose in ('actual_TCP_pose', 'target_TCP_pose')
    ),
)
#: A fraction that RTDE reports, and no speed in the unit 'scaling'.
_SPEED_SCALING = 'speed scaling'
_QUATERNION, _NORMAL = ('qx', 'qy', 'qz', 'qw'), ('nx', 'ny', 'nz')
_ROTATION_VECTOR, _ANGLES_OF_ROLL = ('rx', 'ry', 'rz'), ('roll', 'pitch', 'yaw')
_GROUPS = (('x', 'y', 'z'), _QUATERNION, _NORMAL, _ROTATION_VECTOR, _ANGLES_OF_ROLL)


@dataclass(frozen=True, slots=True)
class _Column:
    index: int
    name: str
    factor: float
    title: str


def collect_csv(file: Path, options: ImportOptions, into: PathCollector) -> None:
    """
    Read a table.

    :raises BrokenFile: a line is none of a table.
    """
    lines = file_lines(file_text(file))
    first = next(
        (i for i, line in enumerate(lines) if line.strip() and not line.lstrip().startswith('#')),
        None,
    )
    if first is None:
        raise BrokenFile(0, 'the file is empty; the first line has to name the columns')
    delimiter = max(';\t,', key=lines[first].count)
    if delimiter not in lines[first]:
        delimiter = ' '
    titles = _plain_titles(next(csv.reader([lines[first]], delimiter=delimiter)))
    columns = _columns(titles, first + 1, options, into)
    decimal_comma = delimiter != ','
    make = _orientation({column.name for column in columns})
    for i in range(first + 1, len(lines)):
        line = lines[i]
        if not line.strip() or line.lstrip().startswith('#'):
            continue
        cells = (
            line.split(delimiter)
            if '"' not in line
            else next(csv.reader([line], delimiter=delimiter))
        )
        if len(cells) != len(titles):
            raise BrokenFile(
                i + 1, f'it has {len(cells)} columns, but the header has {len(titles)}'
            )
        values: dict[str, float] = {}
        for column in columns:
            cell = cells[column.index]
            try:
                value = float(cell.replace(',', '.') if decimal_comma else cell)
            except ValueError:
                raise BrokenFile(
                    i + 1, f'{cell.strip()!r:.40} is no number ({column.title})'
                ) from None
            if not isfinite(value):
                raise BrokenFile(i + 1, f'{cell.strip()} is no finite number ({column.title})')
            values[column.name] = value * column.factor
        try:
            quaternion = make(values)
        except ValueError as error:
            raise BrokenFile(i + 1, str(error)) from None
        into.add(
            i + 1,
            (values['x'], values['y'], values['z']),
            quaternion=quaternion,
            normal=tuple(values[name] for name in _NORMAL) if 'nx' in values else None,
            speed=values.get('speed'),
            blend=values.get('blend'),
            time=values.get('t'),
        )


def _plain_titles(titles: list[str]) -> list[str]:
    """Return titles with the pose of a recording named as other poses are."""
    for names in _RECORDED_POSES:
        if names.keys() <= set(titles):
            return [names.get(title, title) for title in titles]
    return titles


def _columns(
    titles: list[str], line: int, options: ImportOptions, into: PathCollector
) -> list[_Column]:
    found: dict[str, _Column] = {}
    others = []
    for index, title in enumerate(titles):
        match = _HEADER.fullmatch(title)
        plain = title.strip().lower().replace('_', ' ')
        name = '' if match is None else match[1].lower()
        name = _SYNONYMS.get(plain, _SYNONYMS.get(name, name))
        if match is None or name not in _QUANTITIES or plain == _SPEED_SCALING:
            others.append(repr(title.strip()))
            continue
        if name in found:
            raise BrokenFile(line, f'the columns {found[name].title!r} and {title!r} are the same')
        unit = '' if plain in _SYNONYMS else (match[2] or match[3] or '').strip().lower()
        found[name] = _Column(
            index, name, _factor(name, unit, title, line, options), title.strip()
        )
    if others:
        what = f'column{"s" * (len(others) > 1)} {", ".join(others)}'
        into.remarks.add(line, what, 'a path has no such quantity')
    for group in _GROUPS:
        missing = [name for name in group if name not in found]
        if missing and (group[0] == 'x' or len(missing) < len(group)):
            raise BrokenFile(
                line,
                f'the column {missing[0]!r} is missing; the header is {", ".join(titles)!r:.120}',
            )
    return list(found.values())


def _factor(name: str, unit: str, title: str, line: int, options: ImportOptions) -> float:
    kind = _QUANTITIES[name]
    if kind == _PURE:
        return 1.0
    units = _UNITS[kind]
    if not unit:
        default = _DEFAULT.get(kind, options.unit if kind == _LENGTH else f'{options.unit}/s')
        if default not in units:
            example = 'mm' if kind == _LENGTH else 'mm/s'
            raise BrokenFile(
                line,
                f'the column {title.strip()!r} has no unit; write {title.strip()} [{example}], or '
                'give the option unit',
            )
        unit = default
    if unit not in units:
        raise BrokenFile(
            line, f'the unit {unit!r} of {title.strip()!r} is none of {", ".join(units)}'
        )
    return units[unit]


def _orientation(names: set[str]) -> Callable[[dict[str, float]], Quaternion | None]:
    """Return what makes the orientation of a row."""
    if 'qx' in names:
        return _quaternion
    if 'rx' in names:
        return lambda row: quaternion_from_rotation_vector([row[n] for n in _ROTATION_VECTOR])
    if 'roll' in names:
        return lambda row: roll_pitch_yaw(row['roll'], row['pitch'], row['yaw'])
    return lambda row: None


def _quaternion(row: dict[str, float]) -> Quaternion:
    x, y, z, w = (row[name] for name in _QUATERNION)
    length = sqrt(x * x + y * y + z * z + w * w)
    if not abs(length - 1.0) < 0.01:
        raise ValueError(f'the quaternion has the length {length:.4g}, but must have 1')
    return (x / length, y / length, z / length, w / length)


FORMAT = ImportFormat(
    name='csv',
    suffixes=('.csv', '.tsv', '.txt'),
    terms=term_table(),
    others='Every other column is left out, and said.',
    collect=collect_csv,
)
