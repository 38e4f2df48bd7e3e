# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Finds the columns of a table that make a path, and their units; remarks name all others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NoReturn

from ur_cartesian_driver.importing.import_format import Treatment
from ur_cartesian_driver.importing.import_options import ImportOptions, ToolOrientation
from ur_cartesian_driver.importing.imported_path import BrokenFile, ImportNotes
from ur_cartesian_driver.importing.tables.column_names import (
    body_of,
    COLUMNS,
    FIXED_UNITS,
    is_orientation,
    KINDS,
    letters,
    NO_QUANTITY,
    OTHERS_REASON,
    POSITION,
    QUANTITIES,
    read_title,
    ROLES,
    ROTATION_VECTOR,
    TERMS,
    Title,
)
from ur_cartesian_driver.importing.tables.column_units import plain_unit, Quantity, UNITS
from ur_cartesian_driver.importing.text_file import quoted

_POSITION, _ORIENTATION, _NORMAL = 'position', 'orientation', 'normal'
#: Kinds of values that an orientation option replaces, with the reason for the remark.
_REPLACED: Mapping[ToolOrientation, Mapping[str, str]] = {
    ToolOrientation.FILE: {},
    ToolOrientation.NORMALS: {_ORIENTATION: 'the tool is to point against the normals'},
    ToolOrientation.DOWN: dict.fromkeys((_ORIENTATION, _NORMAL), 'the tool is to point down'),
}
_REMEDY = (
    'name them qx, qy, qz, qw, or rx, ry, rz [rad], or roll, pitch, yaw [deg], or give the option '
    'orientation'
)
#: Default units of columns for which the file gives none. A length may take its unit from the
#: option; a speed must have one in the file.
_DEFAULT_UNITS = {Quantity.TIME: 's', Quantity.PURE: '-'}


@dataclass(frozen=True, slots=True)
class Column:
    """A column of numbers."""

    index: int
    #: One of the roles in :data:`~ur_cartesian_driver.importing.tables.column_names.ROLES`.
    role: str
    #: The factor from the unit of the column to SI.
    factor: float
    title: str
    #: Whether the header gives the unit, or the program that writes such columns determines it.
    has_unit: bool


def is_header(titles: Sequence[str]) -> bool:
    """Return whether titles name a position."""
    names = {read_title(title).name for title in titles}
    return any(_POSITION in _KINDS[term] and names.issuperset(COLUMNS[term]) for term in _KINDS)


def find_columns(
    texts: Sequence[str],
    units: Sequence[str],
    line: int,
    options: ImportOptions,
    remarks: ImportNotes,
) -> list[Column]:
    """
    Return the columns from which the path is made, and add remarks on the others.

    :param texts: the titles in the header.
    :param units: the units in a second line of the header; empty = there is no such line.
    :param line: the line of the header.
    :raises BrokenFile: a column is missing, occurs twice, or has no certain unit or meaning.
    """
    titles = [read_title(text) for text in texts]
    names = [title.name for title in titles]
    taken: list[Column] = []
    reasons = dict(_REPLACED[options.orientation])
    if options.speed is not None:
        reasons['speed'] = 'a speed is given'
    for term, kinds in _KINDS.items():
        columns = COLUMNS[term]
        if kinds[0] in reasons or not set(columns) <= set(names):
            continue
        for column in columns:
            if names.count(column) > 1:
                same = [title for title in titles if title.name == column]
                raise BrokenFile(line, f'{_listed(same)} have the same name; rename one')
        group = [titles[names.index(column)] for column in columns]
        reasons |= {kind: f'the {kind} comes from {_names(group)}' for kind in kinds}
        topic = TERMS[term].topic
        for title, role in zip(group, ROLES[topic], strict=True):
            index = titles.index(title)
            unit = title.unit or (units[index].strip(' []()') if units else '')
            fixed = FIXED_UNITS.get(topic, {}).get(role, '')
            taken.append(_column(title.text, index, role, unit or fixed, line, options))
    if _POSITION not in reasons:
        _refuse_header(titles, line)
    _check_torques(taken, titles, line)
    _check_w(titles, is_oriented=_ORIENTATION in reasons or _NORMAL in reasons, line=line)
    _check_bodies([titles[column.index] for column in taken if _is_of_pose(column)], line)
    if unitless := [titles[c.index] for c in taken if _is_turn(c) and not c.has_unit]:
        remarks.add(line, _listed(unitless), 'no unit: read as a rotation vector [rad]')
    indices = {column.index for column in taken}
    _say_others(
        [title for i, title in enumerate(titles) if i not in indices], reasons, line, remarks
    )
    unnamed = [str(i + 1) for i, title in enumerate(titles) if not title.text]
    if unnamed:
        remarks.add(line, f'column {", ".join(unnamed)} without a name', NO_QUANTITY)
    return taken


#: The kinds of values in each group of columns, by the name of the group's term.
_KINDS = {
    name: [KINDS[role] for role in ROLES[term.topic] if role in KINDS]
    for name, term in TERMS.items()
    if term.treatment is Treatment.HONOURED
}


def _check_torques(taken: Sequence[Column], titles: Sequence[Title], line: int) -> None:
    """Refuse positions tx, ty and tz beside forces fx, fy and fz: they can be torques."""
    group = [titles[column.index] for column in taken if column.role in ROLES[POSITION]]
    names = {letters(title.text.partition('[')[0].partition('(')[0]) for title in titles}
    if names.issuperset(('fx', 'fy', 'fz')) and group[0].name == 'tx':
        raise BrokenFile(
            line, f'{_listed(group)} can be torques beside the forces; name them x, y, z'
        )


def _check_w(titles: Sequence[Title], *, is_oriented: bool, line: int) -> None:
    """Refuse columns x, y, z and w that are, or can be, a quaternion."""
    names = {title.name for title in titles}
    # With p and r, w is an angle.
    if not names.issuperset('xyzw') or names.issuperset('pr'):
        return
    positions = [
        term for term, kinds in _KINDS.items() if _POSITION in kinds and names >= {*COLUMNS[term]}
    ]
    if len(positions) > 1 or not is_oriented:
        found = [title for title in titles if title.name in [*'xyzw']]
        raise BrokenFile(
            line,
            f'{_listed(found)} can be a quaternion; name them qx, qy, qz, qw if they are one, '
            'else rename w',
        )


def _check_bodies(titles: Sequence[Title], line: int) -> None:
    """Refuse a pose whose position and orientation belong to two bodies."""
    bodies = {body: title for title in titles if (body := body_of(title))}
    if len(bodies) > 1:
        raise BrokenFile(
            line,
            f'{_listed([*bodies.values()])} are of different bodies; take the columns of one of '
            'them out, or give the option orientation',
        )


def _is_of_pose(column: Column) -> bool:
    return QUANTITIES[column.role] in (Quantity.LENGTH, Quantity.ANGLE, Quantity.PURE)


def _is_turn(column: Column) -> bool:
    return column.role in ROLES[ROTATION_VECTOR]


def _listed(titles: Sequence[Title]) -> str:
    return f'column{"s" * (len(titles) > 1)} {_names(titles)}'


def _names(titles: Sequence[Title]) -> str:
    """Return titles with commas between them; numbered ones (RTDE has over 100) become ranges."""
    runs: list[list[str]] = []
    for title in titles:
        stem = title.text.rstrip('0123456789')
        number = title.text[len(stem) :]
        if number and runs and runs[-1][-1] == f'{stem}{int(number) - 1}':
            runs[-1].append(title.text)
        else:
            runs.append([title.text])
    return ', '.join(
        f'{run[0]!r} to {run[-1]!r}' if len(run) > 2 else ', '.join(map(repr, run)) for run in runs
    )


def _refuse_header(titles: Sequence[Title], line: int) -> NoReturn:
    """Refuse a header without a position."""
    missing = _missing({title.name for title in titles}, _POSITION)
    header = quoted(', '.join(title.text for title in titles), 120)
    raise BrokenFile(line, f'the column {missing!r} is missing; the header is {header}')


def _missing(names: set[str], kind: str) -> str:
    """Return the first missing column of the group with the most columns in the table."""
    groups = [COLUMNS[term] for term, kinds in _KINDS.items() if kinds[0] == kind]
    best = max(groups, key=lambda columns: len(names.intersection(columns)))
    return next(column for column in best if column not in names)


def _say_others(
    rest: list[Title], reasons: Mapping[str, str], line: int, remarks: ImportNotes
) -> None:
    """
    Add remarks on the columns that are left out.

    :raises BrokenFile: a left-out column could be an orientation, and no other column is one.
    """
    oriented = reasons.get(_ORIENTATION) or reasons.get(_NORMAL)
    for name, columns in COLUMNS.items():
        group = [title for title in rest if title.name in columns]
        if not group or not {title.name for title in group}.issuperset(columns):
            continue
        term = TERMS[name]
        reason = reasons[_KINDS[name][0]] if name in _KINDS else term.reason
        if term.treatment is Treatment.REFUSED:
            if not oriented:
                raise BrokenFile(
                    line, f'{_listed(group)} could be an orientation, but {reason}; {_REMEDY}'
                )
            reason = oriented
        remarks.add(line, _listed(group), reason)
        rest = [title for title in rest if title not in group]
    if suspects := [title for title in rest if is_orientation(title)]:
        if not oriented:
            _refuse_orientation(suspects, line)
        remarks.add(line, _listed(suspects), oriented)
    if others := [title for title in rest if title.text and title not in suspects]:
        remarks.add(line, _listed(others), OTHERS_REASON)


def _refuse_orientation(titles: Sequence[Title], line: int) -> NoReturn:
    """Refuse columns that are, or seem by their names to be, part of an orientation or normal."""
    names = {title.name for title in titles}
    kind = next((k for k in (_ORIENTATION, _NORMAL) if _parts(k) & names), '')
    why = f'the column {_missing(names, kind)!r} is missing' if kind else 'the name is not known'
    raise BrokenFile(line, f'no orientation can be made of {_listed(titles)}: {why}; {_REMEDY}')


def _parts(kind: str) -> set[str]:
    """Return the columns of all groups that have only values of a kind."""
    return {
        column for term, kinds in _KINDS.items() if kinds == [kind] for column in COLUMNS[term]
    }


def _column(
    text: str, index: int, role: str, unit: str, line: int, options: ImportOptions
) -> Column:
    """
    Return a column with its factor.

    :raises BrokenFile: the unit is missing, or does not suit the quantity.
    """
    quantity = QUANTITIES[role]
    units, given = UNITS[quantity], plain_unit(unit)
    if given == '-' and quantity is not Quantity.PURE:
        given = ''
    default = _DEFAULT_UNITS.get(quantity, '')
    if quantity is Quantity.LENGTH:
        default = options.unit
    elif role in ROLES[ROTATION_VECTOR]:
        default = 'rad'
        if given == 'deg':
            raise BrokenFile(
                line,
                f'{text!r} can be a part of a rotation vector or an angle; write [rad] for a '
                'rotation vector, or name the turns about x, y and z roll, pitch and yaw',
            )
    if not (given or default):
        option = ', or give the option unit' if quantity is Quantity.LENGTH else ''
        raise BrokenFile(
            line, f'the column {text!r} has no unit; write {text} [{quantity.value}]{option}'
        )
    if (given or default) not in units:
        raise BrokenFile(line, f'the unit {unit!r} of {text!r} is none of {", ".join(units)}')
    return Column(index, role, units[given or default], text, bool(given))
