# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
A format of files: its reader, and the treatment of each term that it knows.

Reader and documentation use the same table of terms, so the reader keeps the promises of the page.
Nothing is read as something else, and nothing is dropped in silence.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from types import MappingProxyType
from typing import TypeVar

from ur_cartesian_driver.importing.import_options import ImportOptions
from ur_cartesian_driver.importing.imported_path import PathCollector


class Treatment(Enum):
    """The treatment of a term by the reader of its format."""

    #: It has its effect on the goal.
    HONOURED = 'honoured'
    #: It has none; a remark says so with its lines.
    LEFT_OUT = 'left out, and said'
    #: The file is refused, with the line.
    REFUSED = 'refused'


@dataclass(frozen=True, slots=True)
class Term:
    """A word, code, entity, column or statement that the documents of a format name."""

    #: As the format writes it.
    name: str
    #: The row of the documentation that it stands in.
    topic: str
    treatment: Treatment
    #: Why it is left out, or what to do instead: the words of the remark or the refusal.
    reason: str = ''


@dataclass(frozen=True, slots=True, kw_only=True)
class ImportFormat:
    """A format, as :func:`~ur_cartesian_driver.importing.import_file` uses it."""

    #: Reads a file; raises BrokenFile, ImportError where a package is missing, or OSError.
    collect: Callable[[Path, ImportOptions, PathCollector], None]
    #: The terms that the reader knows, and a sentence on all others: for the documentation.
    terms: Mapping[str, Term] = field(default_factory=dict)
    others: str = ''


_T = TypeVar('_T', bound=Term)


def term_table(*rows: Iterable[_T]) -> Mapping[str, _T]:
    """
    Return terms by their names.

    :raises ValueError: a name stands twice.
    """
    table: dict[str, _T] = {}
    for row in rows:
        for term in row:
            if table.setdefault(term.name, term) is not term:
                raise ValueError(f'the term {term.name!r} stands twice')
    return MappingProxyType(table)


def honoured(topic: str, *names: str) -> tuple[Term, ...]:
    """Return terms that have their effect."""
    return tuple(Term(name, topic, Treatment.HONOURED) for name in names)


def left_out(topic: str, reason: str, *names: str) -> tuple[Term, ...]:
    """Return terms that are left out and said."""
    return tuple(Term(name, topic, Treatment.LEFT_OUT, reason) for name in names)


def refused(topic: str, reason: str, *names: str) -> tuple[Term, ...]:
    """Return terms that refuse the file."""
    return tuple(Term(name, topic, Treatment.REFUSED, reason) for name in names)
