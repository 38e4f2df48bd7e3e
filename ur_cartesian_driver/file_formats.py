# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
File formats by name and suffix: ours, and formats that other packages declare.

Another package declares its formats as entry points, so their names are known without importing
the package. A format is imported only when a file needs it: a broken package affects only users of
its format, who get an error that names the package. Our own formats are in a table, because a
checkout on PYTHONPATH has no metadata and so no entry points.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property
from importlib.metadata import distributions, EntryPoint
import logging
from typing import Generic, TypeVar

_Format = TypeVar('_Format')
_LOG = logging.getLogger(__name__)


class FileFormats(Generic[_Format]):
    """All formats of one group: the formats to read, or the formats to write."""

    def __init__(
        self, group: str, built_in: Mapping[str, str], refusals: tuple[type[Exception], ...]
    ) -> None:
        """
        Take our own formats.

        :param group: the group of the entry points of other packages.
        :param built_in: for each ``module:object``, its names and suffixes, separated by spaces.
        :param refusals: exceptions with which a format refuses a file; all other exceptions are
            faults of the format's package.
        """
        self.built_in = {
            name: EntryPoint(name, value, group)
            for value, names in built_in.items()
            for name in names.split()
        }
        self._group = group
        self._refusals = refusals

    @cached_property
    def _of_others(self) -> Mapping[str, Mapping[str, EntryPoint]]:
        """The formats of other packages: for each name, the declarations by package."""
        found: dict[str, dict[str, EntryPoint]] = {}
        for package in distributions():
            try:
                entries = package.entry_points.select(group=self._group)
            except Exception:  # malformed lines raise exceptions of many types
                _LOG.warning('the entry points of %s are damaged; reinstall it', package.name)
                continue
            for entry in entries:
                # If a package is installed twice (with an overlay), only the first one is used.
                found.setdefault(entry.name.lower(), {}).setdefault(package.name, entry)
        return found

    def __contains__(self, name: str) -> bool:
        """Return whether there is a format of this name or suffix."""
        return name in self.built_in or name in self._of_others

    def names(self) -> list[str]:
        """Return the names of the formats, ours first."""
        return [name for name in self._declared() if not name.startswith('.')]

    def suffixes(self) -> list[str]:
        """Return the suffixes with their dots, ours first."""
        return [name for name in self._declared() if name.startswith('.')]

    def _declared(self) -> list[str]:
        return [*self.built_in, *sorted(self._of_others.keys() - self.built_in.keys())]

    @contextmanager
    def using(self, name: str) -> Iterator[_Format]:
        """
        Yield the format of a name or suffix; blame errors in the block on its package.

        :raises ImportError: the package is broken, or two packages declare this name.
        """
        others = list(self._of_others.get(name, {}).values())
        if name in self.built_in:
            for entry in others:
                _LOG.warning(
                    '%s is not used: %s is built in; it needs another name', _source(entry), name
                )
            yield self.built_in[name].load()
            return
        if len(others) > 1:
            raise ImportError(
                f'{name} is declared by {" and by ".join(map(_source, others))}; uninstall one of '
                'these packages'
            )
        with _blaming(others[0]):
            found = others[0].load()
        with _blaming(others[0], self._refusals):
            yield found

    def __getitem__(self, name: str) -> _Format:
        """Return the format of a name or suffix."""
        with self.using(name) as found:
            return found


@contextmanager
def _blaming(entry: EntryPoint, but: tuple[type[Exception], ...] = ()) -> Iterator[None]:
    """Turn exceptions, except those in ``but``, into an ImportError that names the package."""
    try:
        yield
    except but:
        raise
    except (Exception, SystemExit) as error:
        reason = ' '.join(f'{type(error).__name__}: {error}'.split())
        raise ImportError(
            f'{_source(entry)} failed with {reason}; update or uninstall this package'
        ) from error


def _source(entry: EntryPoint) -> str:
    """Return the declaration of a format, and its package."""
    assert entry.dist is not None  # it was found in a package
    return f"'{entry.name} = {entry.value}' of {entry.dist.name} {entry.dist.version}"
