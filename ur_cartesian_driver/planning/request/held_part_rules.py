# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Rules about goals whose frame is on a part that the arm holds."""

from __future__ import annotations

from ur_cartesian_driver.motion.errors import NotAvailable
from ur_cartesian_driver.motion.goal.goal_columns import GoalTable
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.mode_rules import check_mode, GOAL_RULES


def check_held_part(goal: GoalTable, options: PlanningOptions) -> None:
    """
    Refuse what a held part does not allow.

    :raises NotAvailable: the goal presses, or asks for moves of the controller.
    """
    if goal.moving_frame is None:
        return
    if goal.presses:
        raise NotAvailable(
            'presses',
            'is not empty, but the path is on a part that the arm holds, which only splines '
            'follow exactly, and these follow joint positions, which do not give way',
            'let the fixed tool give way, or hold the tool and fix the part',
        )
    check_mode(goal, GOAL_RULES['moving_frame'])
