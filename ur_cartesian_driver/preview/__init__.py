# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Look at a plan before the arm moves: sampled over time, as a table, or as a page to open."""

from ur_cartesian_driver.preview.arm_plan import ArmPlan
from ur_cartesian_driver.preview.live_page import live_page
from ur_cartesian_driver.preview.motion_page import cell_page, motion_page, refusal_page
from ur_cartesian_driver.preview.plan_samples import postures, Preview, sample, table

__all__ = [
    'ArmPlan',
    'Preview',
    'cell_page',
    'live_page',
    'motion_page',
    'postures',
    'refusal_page',
    'sample',
    'table',
]
