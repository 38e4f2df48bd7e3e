# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Goals as YAML: the form of ``ros2 action send_goal``, of config/examples and of the commands."""

from __future__ import annotations

from collections.abc import Mapping
import os
from pathlib import Path
from typing import Any

import yaml

from ur_cartesian_driver.goal_files.garbage import uncollected
from ur_cartesian_driver.goal_files.goal_schema import FieldError, Message, with_defaults

#: No goal is nested this deeply. At a thousand times this depth a loader crashes, raises an
#: exception or refuses the text, depending on which loader it is.
_MAX_DEPTH = 100
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
    text = source if isinstance(source, str) else Path(source).read_text(encoding='utf-8')
    name = '' if isinstance(source, str) else f'{os.fspath(source)}: '
    try:
        _check_depth(text)
        values = yaml.load(text, Loader=_Loader)  # both loaders are safe
        return with_defaults({} if values is None else values)
    except yaml.YAMLError as error:
        raise GoalFileError(f'{name}this is not YAML: {" ".join(str(error).split())}.') from None
    except FieldError as error:
        raise GoalFileError(f'{name}{error}') from None
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


def _check_depth(text: str) -> None:
    """
    Refuse a text that is nested more deeply than any goal.

    :raises FieldError: the text is nested too deeply.
    """
    depth = 0
    for event in yaml.parse(text, Loader=_Loader):
        depth += isinstance(event, yaml.CollectionStartEvent)
        depth -= isinstance(event, yaml.CollectionEndEvent)
        if depth > _MAX_DEPTH:
            line = event.start_mark.line + 1 if event.start_mark else 0
            raise FieldError(
                f'line {line}: this is nested more than {_MAX_DEPTH} times, too deeply for a goal.'
            )


class _Dumper(getattr(yaml, 'CSafeDumper', yaml.SafeDumper)):  # type: ignore[misc]  # chosen at run time
    """Writes equal parts in full, not as aliases; ten times as fast if PyYAML has libyaml."""

    def ignore_aliases(self, data: object) -> bool:
        return True
