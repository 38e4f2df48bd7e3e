# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The base class of all groups of script functions, and the mark of functions without an effect.

The package :mod:`~ur_cartesian_driver.sim.builtins` says how to add a function.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from ur_cartesian_driver.sim.controller import Controller

F = TypeVar('F', bound=Callable[..., Any])

_WITHOUT_EFFECT: set[Callable[..., Any]] = set()


def without_effect(function: F) -> F:
    """Mark a script function whose effect is not simulated: it only checks its arguments."""
    _WITHOUT_EFFECT.add(function)
    return function


def has_effect(function: Callable[..., Any]) -> bool:
    """Return whether a script function is not marked with :func:`without_effect`."""
    return getattr(function, '__func__', function) not in _WITHOUT_EFFECT


class BuiltinGroup:
    """Base of a group: the public methods of a subclass are the functions of one subject."""

    def __init__(self, controller: Controller) -> None:
        """Give the functions access to the state of this controller."""
        self._controller = controller

    def functions(self) -> dict[str, Any]:
        """Return the script functions of the group, by name."""
        return {
            name: getattr(self, name)
            for name in dir(self)
            if not name.startswith('_') and name != 'functions'
        }
