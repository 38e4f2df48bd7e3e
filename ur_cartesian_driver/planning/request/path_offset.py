# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Rules about path offsets that arrive while the arm moves (``path_offset``)."""

from __future__ import annotations

import numpy as np

from ur_cartesian_driver.motion.errors import InvalidGoal, NotAvailable
from ur_cartesian_driver.motion.goal.goal import DEFAULT_OFFSET_MOTION, PathOffset
from ur_cartesian_driver.motion.goal.goal_columns import GoalTable
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.goal_fields import (
    IS_OPTIMIZED,
    resolve_execution_mode,
    segment_field,
)
from ur_cartesian_driver.planning.request.mode_rules import check_mode, GOAL_RULES


def check_path_offset(goal: GoalTable, options: PlanningOptions) -> None:
    """
    Refuse path offsets with which the goal cannot be executed.

    :raises InvalidGoal: the limits of the offset are all 0.
    :raises NotAvailable: the execution mode or the robot has no path offsets, or another field of
        the goal, such as keep_open, rules them out.
    """
    wanted = goal.path_offset
    if wanted == PathOffset():
        return
    if not wanted:
        raise InvalidGoal(
            'path_offset.limits',
            'are all 0, so that the path does not give way',
            'set one, or leave path_offset empty',
        )
    check_mode(goal, GOAL_RULES['path_offset'])
    if not resolve_execution_mode(goal).traits.streams_setpoints:
        _check_controller_offsets(goal, options)
    if goal.keep_open:
        raise NotAvailable(
            'path_offset',
            'is set, but the end of a goal with keep_open, where an offset has to be gone, is not '
            'known',
            'send all points at once',
        )


def _check_controller_offsets(goal: GoalTable, options: PlanningOptions) -> None:
    """
    Refuse offsets that the controller cannot add to its own motions.

    :raises NotAvailable: the robot's software is not known to have path offsets, the goal also
        presses, or a segment is OPTIMIZED.
    """
    if not options.path_offset_known:
        raise NotAvailable(
            'path_offset',
            "is set, but the robot's software is not known to have path offsets of its own "
            '(PolyScope 5 has them from 5.6 on)',
            'set execution to SERVO',
        )
    if goal.presses:
        raise NotAvailable(
            'path_offset',
            'is set, but the goal presses too, and the controller must not offset its path '
            'while it controls a force',
            'leave presses empty, and path_offset empty in goals that press',
        )
    optimized = np.flatnonzero(IS_OPTIMIZED[goal.motions.types])
    if len(optimized):
        raise NotAvailable(
            'path_offset',
            f'is set, but {segment_field(int(optimized[0]), "type")} is OPTIMIZED: the robot '
            'chooses the speed, so nobody knows when an offset has to begin to fade',
            'use LINEAR or JOINT segments, or set execution to SERVO',
        )


def offset_motion(wanted: PathOffset) -> tuple[float, float, float]:
    """Return an offset's speed [m/s], acceleration [m/s^2], timeout [s]; defaults replace 0."""
    given = (wanted.speed, wanted.acceleration, wanted.timeout)
    speed, acceleration, timeout = (
        value or default for value, default in zip(given, DEFAULT_OFFSET_MOTION, strict=True)
    )
    return speed, acceleration, timeout
