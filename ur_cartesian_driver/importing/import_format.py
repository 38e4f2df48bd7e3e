# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
A file format: its reader, and the treatment of each term that the reader knows.

The reader and its documentation use the same table of terms, so they cannot contradict each other.
A reader never takes one term for another, and never drops one silently.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import TypeVar

from ur_cartesian_driver.importing.import_options import ImportOptions
from ur_cartesian_driver.importing.imported_path import PathCollector


class Treatment(Enum):
    """The treatment of a term by the reader of its format."""

    #: The term has its effect on the goal.
    HONOURED = 'honoured'
    #: The term has no effect; a remark says so and names its lines.
    LEFT_OUT = 'left out, and said'
    #: The file is refused; the error names the line of the term.
    REFUSED = 'refused'


@dataclass(frozen=True, slots=True)
class Term:
    """A word, code, entity, column or statement that the documentation of a format names."""

    #: The term as the format writes it.
    name: str
    #: The row, in the documentation's table of this format, that lists the term.
    topic: str
    treatment: Treatment
    #: Why the term is left out, or what to do instead: the text of the remark or the error.
    reason: str = ''


@dataclass(frozen=True, slots=True, kw_only=True)
class ImportFormat:
    """A format, as :func:`~ur_cartesian_driver.importing.import_file` uses it."""

    #: Reads a file into the collector; raises BrokenFile, OSError, or ImportError if a package is
    #: missing.
    collect: Callable[[Path, ImportOptions, PathCollector], None]
    #: The terms that the reader knows.
    terms: Mapping[str, Term] = field(default_factory=dict)
    #: A sentence for the documentation: the treatment of all other terms.
    others: str = ''


_T = TypeVar('_T', bound=Term)


def term_table(*rows: Iterable[_T]) -> Mapping[str, _T]:
    """
    Return the terms of all rows by their names.

    :raises ValueError: two terms have the same name.
    """
    table: dict[str, _T] = {}
    for row in rows:
        for term in row:
            if table.setdefault(term.name, term) is not term:
                raise ValueError(f'the term {term.name!r} occurs twice')
    return table


def honoured(topic: str, *names: str) -> tuple[Term, ...]:
    """Return terms that have their effect on the goal."""
    return tuple(Term(name, topic, Treatment.HONOURED) for name in names)


def left_out(topic: str, reason: str, *names: str) -> tuple[Term, ...]:
    """Return terms that are left out, with a remark."""
    return tuple(Term(name, topic, Treatment.LEFT_OUT, reason) for name in names)


def refused(topic: str, reason: str, *names: str) -> tuple[Term, ...]:
    """Return terms for which a file is refused."""
    return tuple(Term(name, topic, Treatment.REFUSED, reason) for name in names)
