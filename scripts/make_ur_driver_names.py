# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Write the tables of doc/coming_from/ur_driver.md from the tables that the node is built from.

A test compares page and tables; after a change of a name or a parameter, run::

    python scripts/make_ur_driver_names.py
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from ur_cartesian_driver.ros.parameters.parameter_table import declarations_of
from ur_cartesian_driver.ros.ur_driver_names.name_table import NAMES
from ur_cartesian_driver.ros.ur_driver_names.names_settings import NamesSettings
from ur_cartesian_driver.ros.ur_driver_names.offered_name import Absent

PAGE = Path(__file__).resolve().parents[1] / 'doc' / 'coming_from' / 'ur_driver.md'


def names() -> Iterator[str]:
    """Yield the lines of the table of names; absent names come last."""
    yield '| name | type | served by |'
    yield '| --- | --- | --- |'
    for row in sorted(NAMES, key=lambda row: isinstance(row, Absent)):
        kind = f'{row.kind} ' if row.kind != 'service' else ''
        package, _, name = row.type.split('/')
        by = f'**absent**: {row.reason}' if isinstance(row, Absent) else row.served_by
        note = f' (`release: {row.release}`)' if row.release else ''
        yield f'| {kind}`{row.name}`{note} | {package}/{name} | {by} |'


def parameters() -> Iterator[str]:
    """Yield the lines of the table of parameters."""
    yield '| parameter | default | |'
    yield '| --- | --- | --- |'
    for each in declarations_of(NamesSettings):
        default = str(each.default).lower() if isinstance(each.default, bool) else each.default
        values = f' {each.values[0].upper()}{each.values[1:]}.' if each.values else ''
        yield f'| `{each.name}` | {default} | {each.description}{values} |'


def page(text: str) -> str:
    """Return the text of the page with the present tables."""
    for mark, lines in (('names', names()), ('parameters', parameters())):
        begin, end = f'<!-- {mark} -->', f'<!-- end of {mark} -->'
        before, _, rest = text.partition(begin)
        text = '\n'.join([before + begin, '', *lines, '', end + rest.partition(end)[2]])
    return text


if __name__ == '__main__':
    PAGE.write_text(page(PAGE.read_text('utf-8')), 'utf-8')
