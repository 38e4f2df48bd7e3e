# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Goals as YAML: the form of ``ros2 action send_goal``, of config/examples and of the commands."""

from __future__ import annotations

from collections.abc import Mapping
import os
from pathlib import Path
import re
from typing import Any

import yaml

from ur_cartesian_driver.goal_files.garbage import uncollected
from ur_cartesian_driver.goal_files.goal_schema import FieldError, Message, with_defaults

#: A text that is nested more deeply is refused. No goal is nested this deeply, and some loaders
#: crash at a thousand times this depth.
_MAX_DEPTH = 100
#: Matches numbers that YAML 1.1 reads otherwise than people do: 010 is 8, and 1:30 is 90.
_ODD_NUMBER = re.compile(r'[-+]?(?:0[0-7_]+|[0-9][0-9_]*(?::[0-5]?[0-9])+(?:\.[0-9_]*)?)')
_Loader = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)  # the C loader is ten times as fast


class GoalFileError(ValueError):
    """A text is not a goal; the message names the key or the line at fault, if there is one."""


@uncollected()
def read_goal_file(source: str | os.PathLike[str]) -> Message:
    """
    Return the goal that a YAML text describes, as an object with the fields of the action's goal.

    :param source: a path object for a file, or the text itself.
    :raises GoalFileError: the text is not YAML, or a key or value does not fit the action.
    :raises OSError: the file cannot be read.
    """
    name = '' if isinstance(source, str) else f'{os.fspath(source)}: '
    try:
        text = source if isinstance(source, str) else Path(source).read_text(encoding='utf-8')
        check_yaml(text)
        values = yaml.load(text, Loader=_Loader)  # both loaders are safe
        return with_defaults({} if values is None else values)
    except yaml.YAMLError as error:
        raise GoalFileError(f'{name}this is not YAML: {" ".join(str(error).split())}.') from None
    except FieldError as error:
        raise GoalFileError(f'{name}{error}') from None
    except UnicodeDecodeError:
        raise GoalFileError(f'{name}this is not UTF-8; save it as UTF-8.') from None
    except ValueError as error:  # from Python, for example for an impossible date
        raise GoalFileError(
            f'{name}a value cannot be read: {str(error).rstrip(".")}; correct it, or put it in '
            'quotes.'
        ) from None


@uncollected()
def goal_text(fields: Mapping[str, Any]) -> str:
    """Return the fields of a goal as YAML; numbers keep every bit."""
    text: str = yaml.dump(
        dict(fields), Dumper=_Dumper, default_flow_style=None, sort_keys=False, width=99
    )
    return text


def check_yaml(text: str) -> None:
    """
    Refuse a text that a loader of YAML 1.1 cannot read, or reads otherwise than intended.

    :raises FieldError: the text is nested more deeply than any goal, a key occurs twice in its
        mapping, or a number is octal (``010``) or sexagesimal (``1:30``).
    :raises yaml.YAMLError: the text is not YAML.
    """
    # For each open collection: the keys of a mapping so far, or None for a sequence; and whether
    # the next node of a mapping is a key.
    keys: list[set[str] | None] = []
    is_key: list[bool] = []
    for event in yaml.parse(text, Loader=_Loader):
        if isinstance(event, yaml.CollectionEndEvent):
            keys.pop()
            is_key.pop()
        elif isinstance(event, yaml.NodeEvent):
            known = keys[-1] if keys and is_key[-1] else None
            if keys:
                is_key[-1] = not is_key[-1]
            if isinstance(event, yaml.ScalarEvent):
                _check_scalar(event, known)
            elif isinstance(event, yaml.CollectionStartEvent):
                keys.append(set() if isinstance(event, yaml.MappingStartEvent) else None)
                is_key.append(True)
                if len(keys) > _MAX_DEPTH:
                    what = f'this is nested more than {_MAX_DEPTH} times, too deeply for a goal.'
                    raise _fault(event, what)


def _check_scalar(event: yaml.ScalarEvent, known: set[str] | None) -> None:
    """
    Refuse a number in an odd notation, and a key that is known already; add a new key.

    :param known: the keys of the mapping so far; None = the scalar is not a key.
    """
    if event.implicit[0] and _ODD_NUMBER.fullmatch(event.value):
        raise _fault(event, f'{event.value} is octal or sexagesimal in YAML; write it decimal.')
    if known is not None:
        if event.value in known:
            raise _fault(event, f'{event.value} occurs twice; remove one of them.')
        known.add(event.value)


def _fault(event: yaml.Event, text: str) -> FieldError:
    return FieldError(f'line {event.start_mark.line + 1 if event.start_mark else 0}: {text}')


class _Dumper(getattr(yaml, 'CSafeDumper', yaml.SafeDumper)):  # type: ignore[misc]  # chosen at run time
    """Writes equal parts in full, not as aliases; ten times as fast if PyYAML has libyaml."""

    def ignore_aliases(self, data: object) -> bool:
        return True
