# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The file of leads: the dead times of valves, by the names that goals use.

::

    - {name: valve_1, output: standard_digital 2, open: 0.0604, close: 0.0352, date: '2026-03-02'}
"""

from __future__ import annotations

from collections.abc import Iterable
import os
from pathlib import Path
from typing import Any

import yaml

from ur_cartesian_driver.goal_files.goal_file import check_yaml
from ur_cartesian_driver.goal_files.goal_schema import FieldError
from ur_cartesian_driver.motion.goal.leads import Lead
from ur_cartesian_driver.motion.goal.output_names import output_text, parse_output

_HEADER = (
    '# Dead times of valves [s]: from switching the output on until the valve is open, and from\n'
    '# switching it off until it is closed. "ur-cartesian valve" measures them and writes this.\n'
)
#: The keys of a lead, in the order of the file; the date may be missing.
_KEYS = ('name', 'output', 'open', 'close', 'date')
_NEEDED = _KEYS[:-1]


class LeadFileError(ValueError):
    """A file of leads cannot be used; the text names file, lead and value."""


def read_leads(path: str | os.PathLike[str]) -> tuple[Lead, ...]:
    """
    Return the leads of a file, at least one.

    :raises LeadFileError: the file cannot be read, or a lead in it is wrong or named twice.
    """
    name = os.fspath(path)
    try:
        text = Path(path).read_text(encoding='utf-8')
        check_yaml(text)
        content = yaml.safe_load(text)
    except OSError as error:
        raise LeadFileError(
            f'The lead_file {name} cannot be read: {error.strerror}; "ur-cartesian valve" writes '
            'one.'
        ) from None
    except FieldError as error:
        raise LeadFileError(f'{name}: {error}') from None
    except UnicodeDecodeError:
        raise LeadFileError(f'{name} is not UTF-8; save it as UTF-8.') from None
    except (yaml.YAMLError, ValueError) as error:  # ValueError: an impossible date
        raise LeadFileError(f'{name} is not YAML: {" ".join(str(error).split())}.') from None
    if not isinstance(content, list) or not content:
        raise LeadFileError(
            f'{name} has no leads; write a list of "- {{name: valve_1, output: standard_digital '
            '2, open: 0.06, close: 0.035}".'
        )
    leads: dict[str, Lead] = {}
    for number, entry in enumerate(content, 1):
        try:
            lead = _lead(entry)
        except ValueError as error:
            raise LeadFileError(f'{name}, lead {number}: {str(error).rstrip(".")}.') from None
        if lead.name in leads:
            raise LeadFileError(
                f'{name}, lead {number}: {lead.name!r} is named twice; name each valve once.'
            )
        leads[lead.name] = lead
    return tuple(leads.values())


def write_lead(path: str | os.PathLike[str], lead: Lead) -> None:
    """
    Add a lead to a file, or replace the one of the same name; create the file if needed.

    :raises LeadFileError: the file exists, but is not a file of leads; it is not changed.
    :raises OSError: the file cannot be written.
    """
    file = Path(path)
    kept = [each for each in read_leads(file) if each.name != lead.name] if file.exists() else []
    new = file.with_name(f'{file.name}.new')  # a full disk must not destroy the old file
    new.write_text(_HEADER + _text((*kept, lead)), encoding='utf-8')
    new.replace(file)


def _text(leads: Iterable[Lead]) -> str:
    rows = [
        {
            'name': lead.name,
            'output': output_text(lead.output, lead.pin),
            'open': round(lead.open, 4),
            'close': round(lead.close, 4),
            'date': lead.date,
        }
        for lead in leads
    ]
    text: str = yaml.safe_dump(rows, default_flow_style=None, sort_keys=False, width=99)
    return text


def _lead(entry: Any) -> Lead:
    """Return the lead of an entry; raise ValueError if the entry is not a lead."""
    if not isinstance(entry, dict):
        raise ValueError(f'{entry!r:.60} is no lead; give {", ".join(_NEEDED)}')
    for key in entry:
        if key not in _KEYS:
            raise ValueError(f'{key} is not a field; a lead has {", ".join(_KEYS)}')
    for key in _NEEDED:
        if key not in entry:
            raise ValueError(f'{key} is missing; a lead has {", ".join(_NEEDED)}')
    output, pin = parse_output(str(entry['output']))
    return Lead(
        name=_name(entry['name']),
        output=output,
        pin=pin,
        open=_seconds('open', entry['open']),
        close=_seconds('close', entry['close']),
        date=str(entry.get('date', '')),
    )


def _name(value: Any) -> str:
    # YAML reads no and yes as booleans, and an empty value as null.
    if isinstance(value, bool) or not isinstance(value, str | int):
        raise ValueError(f'name is {value!r}, which is no text; put it in quotes')
    return str(value)


def _seconds(key: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f'{key} is {value!r:.60}, but must be a number of seconds')
    try:
        return float(value)
    except OverflowError:
        raise ValueError(f'{key} is {value!r:.20}..., which is too large for a time') from None
