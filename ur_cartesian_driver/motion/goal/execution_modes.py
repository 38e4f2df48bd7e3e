# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The registry of execution modes: their numbers, and the traits by which other code handles them.

A new mode needs a member of :class:`ExecutionMode` (its number is a constant ``EXECUTION_...`` of
the action), a row of traits in :data:`EXECUTION_MODES`, a row in ``PLANNERS`` of
``planning/planner.py``, a row in ``FEEDERS`` of ``driver/loop/goal_machine_factory.py``, and a
module for each new planner or feeder (which sends the motion to the robot). The tables of planners
and feeders are not here, because they belong to higher layers; a test compares the keys of all
three tables. ``planning/request/goal_fields.py`` chooses a mode for AUTO.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum


class ExecutionMode(IntEnum):
    """Execution mode of a goal, numbered as in the action's field ``execution``."""

    AUTO = 0
    PRIMITIVES = 1
    SPLINE = 2
    SERVO = 3

    @property
    def traits(self) -> ModeTraits:
        """
        The capabilities of the execution mode.

        :raises KeyError: the mode is AUTO, which planning resolves to another mode.
        """
        return EXECUTION_MODES[self]


@dataclass(frozen=True, slots=True, kw_only=True)
class ModeTraits:
    """The capabilities of an execution mode."""

    #: Whether a joint spline connects the points; if not, the robot's own motion commands do.
    is_spline: bool
    #: Whether the driver streams set-points; if not, it sends points to the robot program.
    streams_setpoints: bool
    #: Whether offsets can displace the path while the arm moves (``path_offset``).
    takes_offsets: bool


#: The traits of all modes but AUTO.
EXECUTION_MODES: Mapping[ExecutionMode, ModeTraits] = {
    ExecutionMode.PRIMITIVES: ModeTraits(
        is_spline=False,
        streams_setpoints=False,
        takes_offsets=True,
    ),
    ExecutionMode.SPLINE: ModeTraits(
        is_spline=True,
        streams_setpoints=False,
        takes_offsets=False,
    ),
    ExecutionMode.SERVO: ModeTraits(
        is_spline=True,
        streams_setpoints=True,
        takes_offsets=True,
    ),
}
