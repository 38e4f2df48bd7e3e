# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Names of a package that are imported when they are used.

Importing a module runs the ``__init__`` of each package around it. If an ``__init__`` imported
everything that its package offers, a command would wait for a simulator that it does not use, and
the robot process would wait for a planner.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any


def lazy_names(package: str, modules: Mapping[str, str]) -> Callable[[str], Any]:
    """
    Return a function that serves as the ``__getattr__`` of a package.

    :param modules: for each module, the names that it defines and the package offers, separated by
        spaces.
    """
    homes = {name: module for module, names in modules.items() for name in names.split()}

    def __getattr__(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f'module {package!r} has no attribute {name!r}')
        return getattr(import_module(homes[name]), name)

    return __getattr__
