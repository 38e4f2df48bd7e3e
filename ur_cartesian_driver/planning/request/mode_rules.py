# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Limits of execution modes: a rule for each field that not every mode can honour."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from ur_cartesian_driver.motion.errors import NotAvailable
from ur_cartesian_driver.motion.goal.execution_modes import EXECUTION_MODES, ModeTraits
from ur_cartesian_driver.motion.goal.goal_columns import GoalTable
from ur_cartesian_driver.planning.request.goal_fields import resolve_execution_mode


@dataclass(frozen=True, slots=True)
class ModeRule:
    """A field that not every execution mode can honour."""

    field: str
    #: Whether a mode with given traits can honour the field.
    is_able: Callable[[ModeTraits], bool]
    #: Why a mode cannot honour the field: a clause with ``{mode}`` and the field's ``{value}``.
    problem: str
    #: A second remedy, appended to the advice to choose a mode that can honour the field.
    remedy: str = ''


#: Rules for fields of the goal as a whole; rules for events at points are in ``point_events``.
GOAL_RULES = {
    rule.field: rule
    for rule in (
        ModeRule(
            'replace_horizon',
            lambda traits: traits.is_spline,
            'is {value:g} s, but motions of the robot, which {mode} sends, cannot be planned from '
            'the middle of a motion',
        ),
        ModeRule(
            'on_path_tolerance',
            lambda traits: traits.streams_setpoints,
            'is STALL, but the robot runs a {mode} goal by itself and does not wait on its path',
            ', or on_path_tolerance to ABORT',
        ),
        ModeRule(
            'path_offset',
            lambda traits: traits.takes_offsets,
            'is set, but in a {mode} goal the robot program leads the joints along their spline, '
            'and would bring an offset back at once',
        ),
        ModeRule(
            'feed_override',
            lambda traits: traits.is_spline,
            'is set, but the speed of a {mode} goal is changed by the speed slider alone, which '
            'belongs to people and would stay lowered if the driver died',
            ', with times or a corner_deviation',
        ),
        ModeRule(
            'allow_travel',
            lambda traits: not traits.is_spline,
            'is set, but a travel is made of motions of the robot, and the goal is executed as '
            '{mode}',
            ', or lead there by a goal of its own, such as that of Path.travel_to()',
        ),
    )
}


def check_mode(goal: GoalTable, rule: ModeRule | None) -> None:
    """
    Refuse a field that the execution mode of a goal cannot honour.

    :param rule: the rule for the field; None = all modes can honour it.
    :raises NotAvailable: the mode cannot honour the field; the text names the modes that can.
    """
    if rule is None or not (value := getattr(goal, rule.field)):
        return
    mode = resolve_execution_mode(goal)
    if not rule.is_able(mode.traits):
        able = [each.name for each, traits in EXECUTION_MODES.items() if rule.is_able(traits)]
        raise NotAvailable(
            rule.field,
            rule.problem.format(mode=mode.name, value=value),
            f'set execution to {" or ".join(able)}{rule.remedy}',
        )
