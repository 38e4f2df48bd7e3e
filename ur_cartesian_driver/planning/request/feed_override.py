# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Rules about a signal that slows the motion while the arm moves (``feed_override``)."""

from __future__ import annotations

from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.goal.goal import FeedOverride
from ur_cartesian_driver.motion.goal.goal_columns import GoalTable
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.mode_rules import check_mode, GOAL_RULES


def check_feed_override(goal: GoalTable, options: PlanningOptions) -> None:
    """
    Refuse a feed override with which the goal cannot be executed.

    :raises InvalidGoal: the bounds contradict each other, or the lower one is missing.
    :raises NotAvailable: the execution mode has no feed override.
    """
    wanted = goal.feed_override
    if wanted == FeedOverride():
        return
    if not wanted:
        raise InvalidGoal(
            'feed_override.minimum',
            'is 0, so that no signal may slow the goal',
            'set it from 0.01 to 1, or leave feed_override empty',
        )
    if 0.0 < wanted.maximum < wanted.minimum:
        raise InvalidGoal(
            'feed_override.maximum',
            f'is {wanted.maximum:g}, less than feed_override.minimum = {wanted.minimum:g}',
            'raise it, or set it to 0 for the planned speed',
        )
    check_mode(goal, GOAL_RULES['feed_override'])


def feed_remark(wanted: FeedOverride, duration: float) -> str:
    """Return the remark about the longest time that the motion may take, or ''."""
    if not wanted:
        return ''
    return (
        f'feed_override: the signal sets {wanted.minimum:.0%} to {wanted.maximum or 1.0:.0%} of '
        f'the planned speed, so the motion takes up to {duration / wanted.minimum:.1f} s'
    )
