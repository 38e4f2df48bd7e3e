# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Write the tables of doc/importing.md from the tables that the readers use.

A test compares page and tables; after a change of a table, run::

    python scripts/make_import_tables.py
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
import re

from ur_cartesian_driver.importing import FORMATS, ImportFormat, Term, Treatment

PAGE = Path(__file__).resolve().parents[1] / 'doc' / 'importing.md'
_TABLE = re.compile(r'(<!-- terms of (\w+) -->).*?(<!-- end of terms -->)', re.DOTALL)


def table(form: ImportFormat) -> str:
    """Return the table of a format: a row for each topic, a column for each treatment."""
    topics = dict.fromkeys(term.topic for term in form.terms.values())
    rows = [
        f'| | {" | ".join(each.value for each in Treatment)} |',
        '| --- ' * (len(Treatment) + 1) + '|',
        *(
            f'| {topic} | {" | ".join(_cell(form, topic, each) or "-" for each in Treatment)} |'
            for topic in topics
        ),
    ]
    return '\n'.join([*rows, '', form.others, ''])


def _cell(form: ImportFormat, topic: str, treatment: Treatment) -> str:
    """Return the terms of a cell; terms with the same reason are listed together before it."""
    by_reason: dict[str, list[Term]] = {}
    for term in form.terms.values():
        if term.topic == topic and term.treatment is treatment:
            by_reason.setdefault(term.reason, []).append(term)
    return '; '.join(
        ', '.join(_ranges([term.name for term in terms])) + (f': {reason}' if reason else '')
        for reason, terms in by_reason.items()
    ).replace('|', '\\|')


def _ranges(names: list[str]) -> Iterator[str]:
    """Yield names as code, and three or more that count up, such as M3, M4, M5, as one range."""
    count = len(names)
    first = 0
    while first < count:
        last = first
        while last + 1 < count and names[last + 1] == _next(names[last]):
            last += 1
        if last - first < 2:
            last = first
            yield f'`{names[first]}`'
        else:
            yield f'`{names[first]}` to `{names[last]}`'
        first = last + 1


def _next(name: str) -> str:
    """Return the name with the next number; empty = it has no whole number."""
    match = re.fullmatch(r'([A-Z]|\$INSUNITS )(\d+)', name)
    return f'{match[1]}{int(match[2]) + 1}' if match else ''


def page_with_tables(page: str) -> str:
    """Return the page with a new table between each pair of marks."""
    return _TABLE.sub(lambda found: f'{found[1]}\n\n{table(FORMATS[found[2]])}\n{found[3]}', page)


if __name__ == '__main__':
    PAGE.write_text(page_with_tables(PAGE.read_text(encoding='utf-8')), encoding='utf-8')
