# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The functions of a secondary program, which runs beside the primary one and takes no time."""

from __future__ import annotations

from collections.abc import Mapping
import functools
import inspect
from typing import Any

from ur_cartesian_driver.urscript.script_errors import RuntimeException

#: The functions that a program can call, by name.
Builtins = Mapping[str, Any]


def refuse_timed_functions(builtins: Builtins) -> Builtins:
    """Return the functions of a secondary program: what takes time raises."""
    return {
        name: _refusing_function(name, function)
        if inspect.isgeneratorfunction(function)
        else function
        for name, function in builtins.items()
    }


def _refusing_function(name: str, function: Any) -> Any:
    @functools.wraps(function)
    def refuse(*arguments: Any, **named: Any) -> None:
        raise RuntimeException(f'{name} takes time, which a secondary program does not have.')

    # The signature stays that of the function; what counts as a generator must not.
    refuse.__signature__ = inspect.signature(  # type: ignore[attr-defined]  # all have it
        function
    )
    del refuse.__wrapped__
    return refuse
