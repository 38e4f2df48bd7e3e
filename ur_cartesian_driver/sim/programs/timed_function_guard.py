# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The functions of secondary programs, which have to end within one cycle."""

from __future__ import annotations

from collections.abc import Mapping
import functools
import inspect
from typing import Any

from ur_cartesian_driver.urscript.script_errors import RuntimeException

#: The functions that a program can call, by name.
Builtins = Mapping[str, Any]


#: Functions that act at once and may wait afterwards; a secondary program can call them, but does
#: not wait.
ACT_AT_ONCE = frozenset({'popup', 'protective_stop'})
#: Functions that a secondary program can call if they have nothing to wait for. Published
#: secondary programs open a socket to the robot itself.
_MAY_END_AT_ONCE = frozenset({'socket_open'})


def refuse_timed_functions(builtins: Builtins) -> Builtins:
    """Return the functions of secondary programs: functions that take time raise an error."""
    return {
        name: _without_time(name, function) if inspect.isgeneratorfunction(function) else function
        for name, function in builtins.items()
    }


def _without_time(name: str, function: Any) -> Any:
    @functools.wraps(function)
    def act_or_refuse(*arguments: Any, **named: Any) -> Any:
        if name in ACT_AT_ONCE | _MAY_END_AT_ONCE:
            try:
                next(function(*arguments, **named))
            except StopIteration as end:
                return end.value
        if name not in ACT_AT_ONCE:
            raise RuntimeException(f'{name} takes time, which a secondary program does not have.')
        return None

    # Keep the function's signature, but not its mark as a generator.
    act_or_refuse.__signature__ = inspect.signature(  # type: ignore[attr-defined]  # all have it
        function
    )
    del act_or_refuse.__wrapped__
    return act_or_refuse
