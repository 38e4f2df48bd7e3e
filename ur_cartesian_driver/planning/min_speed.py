# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Check that the tool is nowhere slower than its goal demands (``min_speed_fraction``)."""

from __future__ import annotations

from collections.abc import Sequence

from ur_cartesian_driver.motion.errors import InvalidGoal, JointLimitExceeded
from ur_cartesian_driver.motion.goal.goal import Goal
from ur_cartesian_driver.motion.plan.slow_stretch import (
    name_points,
    SlowCause,
    SLOWER_BY,
    SlowStretch,
)

_FIELD = 'min_speed_fraction'
#: A speed that is too low by less than this fraction counts as a rounding error.
_ROUNDING = 1e-6


def slower_by(goal: Goal) -> float:
    """
    Return how far below the requested speed, as a fraction of it, a slow stretch begins.

    It is small enough that every speed below ``min_speed_fraction`` makes a slow stretch.
    """
    return min(SLOWER_BY, 1.0 - goal.min_speed_fraction + _ROUNDING)


def check_min_speed(goal: Goal, stretches: Sequence[SlowStretch]) -> None:
    """
    Refuse a goal whose tool is slower than demanded.

    :param stretches: the slow stretches of the plan, found with :func:`slower_by`.
    :raises JointLimitExceeded: the tool is too slow because of joint limits.
    :raises InvalidGoal: the tool is too slow for another reason.
    """
    counted = [each for each in stretches if each.counts]
    worst = min(counted, key=lambda each: each.lowest / each.asked, default=None)
    least = goal.min_speed_fraction - _ROUNDING
    if worst is None or worst.lowest >= least * worst.asked:
        return
    problem = (
        f'is {goal.min_speed_fraction:g}, but at {worst.place} the tool is planned at '
        f'{worst.lowest:.3g} of {worst.asked:.3g} m/s, because {worst.reason}'
    )
    if worst.cause is SlowCause.JOINT_LIMIT:
        raise JointLimitExceeded(f'{_FIELD} {problem}; {worst.cause.value}.')
    raise InvalidGoal(_FIELD, problem, worst.cause.value)


def unknown_speed_remark(goal: Goal, blends: Sequence[int], free: Sequence[int]) -> list[str]:
    """
    Return the remark on motions whose tool speed is unknown and so not checked; [] if none.

    :param blends: the points in whose blends the robot chooses the speed.
    :param free: the points at the ends of joint and OPTIMIZED motions.
    """
    parts = [
        f'in the blends at {name_points(blends)}, where the robot chooses its speed'
        * bool(blends),
        f'on the joint or OPTIMIZED motions to {name_points(free)}' * bool(free),
    ]
    if not any(parts):
        return []
    return [
        f'{_FIELD} = {goal.min_speed_fraction:g}: not known {", nor ".join(filter(None, parts))}'
    ]
