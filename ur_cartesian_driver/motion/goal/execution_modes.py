# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The registry of execution modes: how a goal can be executed, and what each mode can do.

A new mode is a member of :class:`ExecutionMode` (the action names its number, ``EXECUTION_...``),
its row in :data:`EXECUTION_MODES`, and one module with its planner or feeder;
everything else asks the row. Planners and feeders belong to higher layers, so the table names them
and they are looked up when they are needed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum


class ExecutionMode(IntEnum):
    """How to execute a goal; the numbers of the action's ``execution``."""

    AUTO = 0
    PRIMITIVES = 1
    SPLINE = 2
    SERVO = 3

    @property
    def traits(self) -> ModeTraits:
        """
        What the mode can do.

        :raises KeyError: for AUTO, which planning resolves to another mode.
        """
        return EXECUTION_MODES[self]


@dataclass(frozen=True, slots=True, kw_only=True)
class ModeTraits:
    """One row of the registry."""

    #: ``module:function`` that plans a checked goal; see ``planning.planner.PlanGoal``.
    planner: str
    #: ``module:function`` that makes the feeder of a motion; see
    #: ``driver.loop.goal_machine_factory.MakeFeeder``.
    feeder: str
    #: Whether a spline of joint positions joins the points; if not, motions of the robot do.
    is_spline: bool
    #: Whether the driver streams set-points; if not, the robot program gets points.
    streams_setpoints: bool
    #: Whether ``io_commands`` are carried out.
    switches_outputs: bool
    #: Whether the path can give way to offsets that come while the arm moves (``path_offset``).
    takes_offsets: bool


#: All modes but AUTO.
EXECUTION_MODES: Mapping[ExecutionMode, ModeTraits] = {
    ExecutionMode.PRIMITIVES: ModeTraits(
        planner='ur_cartesian_driver.planning.planner:plan_moves',
        feeder='ur_cartesian_driver.driver.loop.goal_machine_factory:point_feeder',
        is_spline=False,
        streams_setpoints=False,
        switches_outputs=True,
        takes_offsets=True,
    ),
    ExecutionMode.SPLINE: ModeTraits(
        planner='ur_cartesian_driver.planning.planner:plan_spline_goal',
        feeder='ur_cartesian_driver.driver.loop.goal_machine_factory:point_feeder',
        is_spline=True,
        streams_setpoints=False,
        switches_outputs=True,
        takes_offsets=False,
    ),
    ExecutionMode.SERVO: ModeTraits(
        planner='ur_cartesian_driver.planning.planner:plan_spline_goal',
        feeder='ur_cartesian_driver.driver.loop.goal_machine_factory:servo_feeder',
        is_spline=True,
        streams_setpoints=True,
        switches_outputs=False,
        takes_offsets=True,
    ),
}
