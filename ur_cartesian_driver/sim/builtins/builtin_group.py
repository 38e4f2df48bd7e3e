# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The base class of all groups of script functions."""

from __future__ import annotations

from typing import Any

from ur_cartesian_driver.sim.controller import Controller


class BuiltinGroup:
    """The functions of one subject: a subclass has them as public methods, see the package."""

    def __init__(self, controller: Controller) -> None:
        """Give the functions access to the state of this controller."""
        self._controller = controller

    def functions(self) -> dict[str, Any]:
        """Return the functions by name."""
        return {
            name: getattr(self, name)
            for name in dir(self)
            if not name.startswith('_') and name != 'functions'
        }
