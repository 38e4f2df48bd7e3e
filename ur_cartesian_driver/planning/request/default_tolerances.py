# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Replace zero tolerances of a goal by parameters of the driver."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import TypeVar

from ur_cartesian_driver.motion.geometry.vectors import vector3, vector6
from ur_cartesian_driver.motion.goal.goal import Goal, Tolerance
from ur_cartesian_driver.planning.options import PlanningOptions

G = TypeVar('G', bound=Goal)

#: The quantities in the names of the parameters ``path_tolerance_...``, ``goal_tolerance_...``.
_QUANTITIES = (
    'position',
    'orientation',
    'linear_velocity',
    'angular_velocity',
    'linear_acceleration',
    'angular_acceleration',
)


def named_tolerances(goal: Goal) -> tuple[tuple[str, Tolerance], tuple[str, Tolerance]]:
    """Return the path and goal tolerances of a goal, each with its name."""
    return ('path_tolerance', goal.path_tolerance), ('goal_tolerance', goal.goal_tolerance)


def apply_default_tolerances(goal: G, options: PlanningOptions) -> G:
    """Return the goal with parameters in place of zero tolerances; what stays 0 is not limited."""
    path, end = (
        _with_defaults(tolerance, name, options) for name, tolerance in named_tolerances(goal)
    )
    if path is goal.path_tolerance and end is goal.goal_tolerance:
        return goal
    return replace(goal, path_tolerance=path, goal_tolerance=end)


def _with_defaults(tolerance: Tolerance, name: str, options: PlanningOptions) -> Tolerance:
    """Return a tolerance whose zeros are replaced by the parameters ``<name>_position`` etc."""
    defaults = [float(getattr(options, f'{name}_{quantity}')) for quantity in _QUANTITIES]
    if not any(defaults):
        return tolerance

    def filled(values: Iterable[float], first: int) -> list[float]:
        """Return values with defaults for zeros; each quantity, from ``first`` on, has three."""
        return [value or defaults[first + k // 3] for k, value in enumerate(values)]

    return Tolerance(
        position=vector3(filled(tolerance.position, 0)),
        orientation=vector3(filled(tolerance.orientation, 1)),
        twist=vector6(filled(tolerance.twist, 2)),
        acceleration=vector6(filled(tolerance.acceleration, 4)),
    )
