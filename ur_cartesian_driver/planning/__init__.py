# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Check a goal and plan it: primitives, times, joint configurations, report.

:func:`check` makes the checks that need no robot; :func:`plan` makes these and all others;
:func:`plan_joint_goal` does the same for a joint goal. Each of them refuses a goal by raising a
:class:`~ur_cartesian_driver.motion.errors.GoalRefused`. A goal that passes becomes a
:class:`~ur_cartesian_driver.motion.plan.plan.Plan`. Nothing here moves a robot.
"""

from typing import TYPE_CHECKING

from ur_cartesian_driver.lazy_names import lazy_names

if TYPE_CHECKING:
    from ur_cartesian_driver.planning.options import PlanningOptions
    from ur_cartesian_driver.planning.planner import plan
    from ur_cartesian_driver.planning.request.validate import check
    from ur_cartesian_driver.planning.spline.joint_goal_planner import plan_joint_goal

__all__ = ['PlanningOptions', 'check', 'plan', 'plan_joint_goal']

# Loaded on first use: code that only composes a path or sends a goal needs no planner.
__getattr__ = lazy_names(
    __name__,
    {
        'ur_cartesian_driver.planning.options': 'PlanningOptions',
        'ur_cartesian_driver.planning.planner': 'plan',
        'ur_cartesian_driver.planning.request.validate': 'check',
        'ur_cartesian_driver.planning.spline.joint_goal_planner': 'plan_joint_goal',
    },
)
