# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Read the nodes of a YAML file, so that each error names the file and the line.

Values are read from nodes, without YAML's own conversion: a version stays as it is written, a
repeated field is noticed, and ``1e-3`` is a number.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import NoReturn, TYPE_CHECKING

from ur_cartesian_driver.motion.errors import shortened

if TYPE_CHECKING:
    import yaml  # at run time, with the first file: a simulator without one needs only numpy

#: Longest file [characters]; a longer one is probably a recording that was given by mistake.
_MAX_LENGTH = 1_000_000


class NodeReader:
    """
    Reads one file.

    :param name: the name of the file, for error texts.
    :param what: the kind of the file, such as ``twin``.
    :param error: the error that is raised; its text is one sentence.
    """

    def __init__(self, name: str, what: str, error: type[ValueError]) -> None:
        """Take the names of file and content."""
        self.name, self._what, self._error = name, what, error

    def root(self, text: str) -> yaml.Node:
        """Return the node of a whole text."""
        if len(text) > _MAX_LENGTH:
            raise self._error(f'{self.name} is no {self._what}: it is longer than 1 MB.')
        import yaml

        try:
            root = yaml.compose(text, Loader=yaml.SafeLoader)
        except yaml.YAMLError as error:
            mark = getattr(error, 'problem_mark', None)
            line = f', line {mark.line + 1}' if mark else ''
            what = getattr(error, 'problem', None) or 'it has a character that YAML does not allow'
            raise self._error(f'{self.name}{line}: this is not YAML: {what}.') from None
        except (ValueError, OverflowError):  # from \UFFFFFFFF, or a version with many digits
            raise self._error(f'{self.name}: this is not YAML: a number is too large.') from None
        except RecursionError:
            raise self._error(
                f'{self.name} is no {self._what}: it is nested too deeply.'
            ) from None
        if root is None:
            raise self._error(f'{self.name} is empty, so it is no {self._what}.')
        return root

    def entries(
        self, node: yaml.Node, where: str, known: Sequence[str] = (), kind: str = ''
    ) -> dict[str, yaml.Node]:
        """
        Return the values of a mapping by name; each name occurs once.

        :param where: the owner of the fields, for error texts.
        :param known: the allowed names; empty = any.
        :param kind: the kind of thing that the names stand for; '' = a field.
        """
        if kind_of(node) != 'mapping':
            self.refuse(node, f'{where} must have fields, NAME: VALUE')
        found: dict[str, yaml.Node] = {}
        for key, value in self._pairs(node, where):
            if key.value in found:
                self.refuse(key, f'{shortened(key.value)} is given twice; remove one of them')
            if known and key.value not in known:
                near = get_close_matches(key.value, known, n=1)
                hint = f'{near[0]} is probably meant' if near else f'known are {", ".join(known)}'
                kind = kind or f'field of {where}'
                self.refuse(key, f'{shortened(key.value)} is no {kind}; {hint}')
            found[key.value] = value
        return found

    def _pairs(self, node: yaml.Node, where: str) -> Iterator[tuple[yaml.Node, yaml.Node]]:
        for key, value in node.value:
            if kind_of(key) != 'scalar':
                self.refuse(key, f'a field of {where} has no name')
            yield key, value

    def items(self, node: yaml.Node, fault: str, length: int | None = None) -> list[yaml.Node]:
        """Return the nodes of a list; refuse another node, or another length, by ``fault``."""
        if kind_of(node) != 'sequence' or length not in (None, len(node.value)):
            self.refuse(node, fault)
        return list(node.value)

    def number(self, node: yaml.Node, what: str) -> float:
        """Return a number; it may be infinite or NaN."""
        text = self.text(node, what)
        try:
            return float(text)
        except ValueError:
            self.refuse(node, f'the {what} is {text[:60]}, which is no number')

    def text(self, node: yaml.Node, what: str) -> str:
        """Return a text on one line."""
        if kind_of(node) != 'scalar':
            self.refuse(node, f'{what} must be one value')
        return ' '.join(str(node.value).split())

    def refuse(self, node: yaml.Node, fault: str) -> NoReturn:
        """Raise the error with a clause on the fault of a node."""
        line = node.start_mark.line + 1
        raise self._error(f'{self.name}, line {line}: {printable(fault)}.')


def text_of_file(path: Path, what: str, error: type[ValueError]) -> str:
    """
    Return the text of a file, cut off if it is too long.

    :param what: the kind of the file, for the error text.
    :param error: the error that is raised if the text is not UTF-8.
    :raises OSError: the file cannot be read.
    """
    with path.open(encoding='utf-8') as file:
        try:
            return file.read(_MAX_LENGTH + 1)
        except UnicodeDecodeError:
            raise error(f'{path} is no text in UTF-8, so it is no {what}.') from None


def printable(text: str) -> str:
    """Return a text on one line, so that an error can quote the contents of a file."""
    return ''.join(each if each.isprintable() else '\ufffd' for each in text)


def kind_of(node: yaml.Node) -> str:
    """Return whether a node is a scalar, a sequence or a mapping."""
    return str(getattr(node, 'id', ''))
