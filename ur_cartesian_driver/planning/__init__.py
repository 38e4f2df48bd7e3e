# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
From what was asked to what is done: check a goal, choose primitives, times and configurations.

:func:`check` finds everything that needs no robot, :func:`plan` the rest; both refuse by raising a
:class:`~ur_cartesian_driver.motion.errors.GoalRefused`. What passes is a
:class:`~ur_cartesian_driver.motion.plan.Plan`. Nothing here moves anything.
"""

from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.planner import plan
from ur_cartesian_driver.planning.request.validate import check

__all__ = ['PlanningOptions', 'check', 'plan']
