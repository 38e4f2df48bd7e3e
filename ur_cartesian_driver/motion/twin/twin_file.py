# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Read and write ``twin.yaml``: the measured laws of one arm, one law a paragraph.

::

    twin: 1
    arm: {model: ur5e, serial_number: '20235501234', software: 5.21.0, motion_version: 1}
    date: 2026-11-27
    files:
    - moves.csv

    # Time within which the first path of a program gets up to speed [s]; recorded on arms: 0.16.
    start_time:
      value: 0.158
      unit: s
      interval: [0.154, 0.162]
      evidence: 12 starts of programs
      left_over: 0.4 ms

    # Share of its radius at which a blend begins and ends; assumed: 1.
    blend_begin:
      not_identified: no blends in the files; record some moves with r

A law that is left out has its assumed value. Every error names the line.
"""

from __future__ import annotations

from collections.abc import Callable
from datetime import date
from pathlib import Path
from textwrap import indent
from typing import Any, TYPE_CHECKING

from ur_cartesian_driver.motion.twin.laws import Law, LAWS
from ur_cartesian_driver.motion.twin.twin import (
    ArmIdentity,
    checked_day,
    checked_software,
    Estimate,
    Twin,
)
from ur_cartesian_driver.motion.yaml_nodes import NodeReader, text_of_file

if TYPE_CHECKING:
    import yaml  # imported lazily: a simulator without a file needs only numpy

#: The version of the format, which is the field ``twin`` of a file.
FORMAT = 1

_HEAD = ('twin', 'arm', 'date', 'files')
_ARM = ('model', 'serial_number', 'software', 'motion_version')
_ESTIMATE = ('value', 'unit', 'interval', 'evidence', 'left_over')


class TwinFileError(ValueError):
    """A file is no twin; the text names the file, the line and the fault."""


def read_twin(path: str | Path) -> Twin:
    """
    Return the twin in a file.

    :raises OSError: the file cannot be read.
    :raises TwinFileError: the file is no twin.
    """
    return twin_from_text(text_of_file(Path(path), 'twin', TwinFileError), str(path))


def twin_from_text(text: str, name: str) -> Twin:
    """
    Return the twin in the text of a file.

    :param name: the name of the file, for error texts.
    :raises TwinFileError: the text is no twin.
    """
    return _Reader(name).twin(text)


def twin_text(twin: Twin) -> str:
    """Return the text of ``twin.yaml``, from which :func:`twin_from_text` reads the same twin."""
    arm = {key: getattr(twin.arm, key) for key in _ARM if getattr(twin.arm, key)}
    day = date.fromisoformat(twin.date)
    head = {'twin': FORMAT, 'arm': arm, 'date': day, 'files': list(twin.files)}
    paragraphs = [
        f'# The laws of motion of one arm, as measured on {twin.date}. Laws that are left out are '
        f'assumed.\n{_dumped(head)}'
    ]
    for name, law in LAWS.items():
        if name in twin.estimates:
            entry = _entry(law, twin.estimates[name])
        elif name in twin.not_identified:
            entry = {'not_identified': twin.not_identified[name]}
        else:
            continue
        fields = ''.join(_dumped({key: value}) for key, value in entry.items())
        paragraphs.append(f'{_comment(law)}\n{name}:\n{indent(fields, "  ")}')
    return '\n'.join(paragraphs)


def _comment(law: Law) -> str:
    unit = f' [{law.unit}]' if law.unit else ''
    assumed = (
        '' if law.assumed is None else f': {law.assumed if law.choices else f"{law.assumed:.6g}"}'
    )
    return f'# {law.text[0].upper()}{law.text[1:]}{unit}; {law.grade}{assumed}.'


def _entry(law: Law, estimate: Estimate) -> dict[str, Any]:
    entry: dict[str, Any] = {'value': estimate.value}
    if law.unit:
        entry['unit'] = law.unit
    if estimate.interval is not None:
        entry['interval'] = list(estimate.interval)
    for key in ('evidence', 'left_over'):
        if getattr(estimate, key):
            entry[key] = getattr(estimate, key)
    return entry


def _dumped(content: dict[str, Any]) -> str:
    """Return fields as YAML, with nested lists and mappings in brackets on one line."""
    import yaml

    is_nested = any(isinstance(value, list | dict) for value in content.values())
    text: str = yaml.safe_dump(
        content,
        sort_keys=False,
        default_flow_style=None if is_nested else False,
        allow_unicode=True,
        width=95,
    )
    return text


class _Reader(NodeReader):
    """Reads one file; ``name`` is its name in error texts."""

    def __init__(self, name: str) -> None:
        super().__init__(name, 'twin', TwinFileError)

    def twin(self, text: str) -> Twin:
        """Return the twin, see :func:`twin_from_text`."""
        root = self.root(text)
        entries = self.entries(root, 'the file', (*_HEAD, *LAWS), 'law of motion')
        version = entries.get('twin')
        if version is None:
            self.refuse(
                root, f'this is no twin: it has no field twin; it begins with twin: {FORMAT}'
            )
        if (number := self.text(version, 'twin')) != str(FORMAT):
            self.refuse(version, f'twin is {number}, a format that is not known; use {FORMAT}')
        for key in ('arm', 'date'):
            if key not in entries:
                self.refuse(root, f'{key} is missing, so the file may be cut off')
        estimates, not_identified = {}, {}
        for name, law in LAWS.items():
            if name not in entries:
                continue
            found = self._law(law, entries[name])
            if isinstance(found, Estimate):
                estimates[name] = found
            else:
                not_identified[name] = found
        return Twin(
            arm=self._arm(entries['arm']),
            date=self._date(entries['date']),
            files=self._files(entries.get('files')),
            estimates=estimates,
            not_identified=not_identified,
        )

    def _law(self, law: Law, node: yaml.Node) -> Estimate | str:
        """Return the estimate of a law, or the text of its field ``not_identified``."""
        entries = self.entries(node, law.name, (*_ESTIMATE, 'not_identified'))
        if 'not_identified' in entries:
            if len(entries) > 1:
                self.refuse(node, f'{law.name} is not identified, so it can have no other field')
            return self.text(entries['not_identified'], f'not_identified of {law.name}')
        if 'value' not in entries:
            self.refuse(node, f'{law.name} has no value')
        unit = self.text(entries['unit'], f'unit of {law.name}') if 'unit' in entries else ''
        if unit != law.unit:
            wanted = f'give it in {law.unit}' if law.unit else 'it has none; remove it'
            said = f'has the unit {unit}' if unit else 'has no unit'
            self.refuse(entries.get('unit', node), f'{law.name} {said}; {wanted}')
        value = self._value(law, entries['value'])
        interval = entries.get('interval')
        try:
            return Estimate(
                value=value,
                interval=None if interval is None else self._interval(law, interval),
                evidence=self._optional_text(entries, 'evidence', law),
                left_over=self._optional_text(entries, 'left_over', law),
            )
        except TwinFileError:
            raise
        except ValueError as error:
            self.refuse(interval or node, f'{law.name} {error}')

    def _value(self, law: Law, node: yaml.Node) -> float | str:
        value: float | str
        if law.choices:
            value = self.text(node, f'value of {law.name}')
        else:
            value = self.number(node, f'value of {law.name}')
        if problem := law.problem(value):
            self.refuse(node, f'{law.name} is {value}; it {problem}')
        return value

    def _interval(self, law: Law, node: yaml.Node) -> tuple[float, float]:
        fault = f'the interval of {law.name} must be two numbers, [LOW, HIGH]'
        items = self.items(node, fault, length=2)
        low, high = (self.number(item, f'interval of {law.name}') for item in items)
        return low, high

    def _optional_text(self, entries: dict[str, yaml.Node], key: str, law: Law) -> str:
        return self.text(entries[key], f'{key} of {law.name}') if key in entries else ''

    def _arm(self, node: yaml.Node) -> ArmIdentity:
        entries = self.entries(node, 'arm', _ARM)
        if 'model' not in entries:
            self.refuse(node, 'arm has no model, such as ur5e')
        texts = {key: self.text(entries[key], f'{key} of arm') for key in entries}
        if texts.get('software'):
            self._checked(checked_software, entries['software'], texts['software'])
        version = texts.pop('motion_version', '0')
        if version not in ('0', '1', '2'):
            self.refuse(
                entries['motion_version'],
                f'motion_version of arm is {version}; use 1 or 2, or 0 for unknown',
            )
        return ArmIdentity(**texts, motion_version=int(version))

    def _date(self, node: yaml.Node) -> str:
        return self._checked(checked_day, node, self.text(node, 'date'))

    def _files(self, node: yaml.Node | None) -> tuple[str, ...]:
        if node is None:
            return ()
        items = self.items(node, 'files must be a list of names')
        return tuple(self.text(item, 'a name in files') for item in items)

    def _checked(self, check: Callable[[str], str], node: yaml.Node, text: str) -> str:
        try:
            return check(text)
        except ValueError as error:
            self.refuse(node, str(error))
