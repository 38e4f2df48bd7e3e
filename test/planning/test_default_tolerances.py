# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Zeros become the parameter of their quantity, and nothing else changes."""

from typing import Any

import pytest

from ur_cartesian_driver.motion.goal.goal import Goal, Tolerance
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.default_tolerances import apply_default_tolerances

#: Parameter, field of the tolerance, its axes.
WHERE = [
    ('position', 'position', slice(0, 3)),
    ('orientation', 'orientation', slice(0, 3)),
    ('linear_velocity', 'twist', slice(0, 3)),
    ('angular_velocity', 'twist', slice(3, 6)),
    ('linear_acceleration', 'acceleration', slice(0, 3)),
    ('angular_acceleration', 'acceleration', slice(3, 6)),
]
GOAL = Goal(waypoints=())


@pytest.mark.parametrize('kind', ['path_tolerance', 'goal_tolerance'])
@pytest.mark.parametrize(('quantity', 'field', 'axes'), WHERE)
def test_a_parameter_is_the_limit_of_its_quantity_and_of_no_other(kind, quantity, field, axes):
    option: dict[str, Any] = {f'{kind}_{quantity}': 0.5}
    filled = apply_default_tolerances(GOAL, PlanningOptions(**option))
    for name in ('path_tolerance', 'goal_tolerance'):
        for which in ('position', 'orientation', 'twist', 'acceleration'):
            values = getattr(getattr(filled, name), which)
            expected = [0.0] * len(values)
            if (name, which) == (kind, field):
                expected[axes] = [0.5] * 3
            assert list(values) == expected


def test_what_the_goal_says_stands():
    given = Tolerance(position=(0.1, -1.0, 0.0), twist=(0.0, 2.0, -3.0, 0.0, 0.0, 4.0))
    options = PlanningOptions(
        path_tolerance_position=0.5,
        path_tolerance_linear_velocity=0.6,
        path_tolerance_angular_velocity=0.7,
    )
    filled = apply_default_tolerances(Goal(waypoints=(), path_tolerance=given), options)
    assert filled.path_tolerance == Tolerance(
        position=(0.1, -1.0, 0.5), twist=(0.6, 2.0, -3.0, 0.7, 0.7, 4.0)
    )
    assert filled.goal_tolerance == Tolerance()


def test_without_parameters_the_goal_is_the_same():
    assert apply_default_tolerances(GOAL, PlanningOptions()) is GOAL
