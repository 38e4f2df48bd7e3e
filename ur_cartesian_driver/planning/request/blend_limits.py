# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The bounds on blend radii: both blends of a segment must fit into the segment.

Negative radii are refused by :mod:`~.field_rules`, radii in splines by :mod:`~.spline_rules`.
"""

from __future__ import annotations

import numpy as np

from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.goal.goal_table import GoalTable, rows_where
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.goal_fields import is_spline, segment_field


def check_blends(goal: GoalTable, options: PlanningOptions) -> None:
    """Refuse blends that overlap between two points of the goal."""
    if is_spline(goal):
        return
    radii = goal.segments.blend_radii
    if not radii.any():
        return
    after = np.append(radii[1:-1], 0.0)  # the last point is never blended
    lengths = np.linalg.norm(np.diff(goal.waypoints.poses[:, :3], axis=0), axis=1)
    for k in rows_where(radii[:-1] + after > lengths):
        check_blends_fit(k + 1, float(lengths[k]), float(radii[k]), float(after[k]))


def check_blends_fit(index: int, length: float, before: float, after: float) -> None:
    """
    Refuse blends that overlap within a segment: the controller would skip a point (its C171).

    :param length: distance between the two points of the segment [m].
    :param before: blend radius at the first point [m].
    :param after: blend radius at the second point [m].
    """
    # Blends that touch must not be refused because of rounding.
    if before + after > length * (1.0 + 1e-9) + 1e-9:
        if index == 0:
            raise InvalidGoal(
                segment_field(0, 'blend_radius'),
                f'is too large: the blend takes {1e3 * after:g} mm, but the arm is '
                f'{1e3 * length:.3f} mm from points[0]',
                'reduce it, or begin farther away',
            )
        raise InvalidGoal(
            segment_field(index if after > 0.0 else index - 1, 'blend_radius'),
            f'is too large: the blends at points[{index - 1}] and points[{index}] take '
            f'{1e3 * before:g} mm and {1e3 * after:g} mm of a segment of {1e3 * length:.3f} mm',
            'reduce one of them',
        )


def check_blend_parameters(index: int, u_join: float, u_leave: float) -> None:
    """
    Refuse blends that overlap on the curve of a segment.

    :param u_join: curve parameter in [0, 1] at which the blend before the segment ends.
    :param u_leave: curve parameter in [0, 1] at which the blend after the segment begins.
    """
    if u_join > u_leave + 1e-9:
        raise InvalidGoal(
            segment_field(index, 'blend_radius'),
            f'is too large: the blends at both ends of the segment to point {index} overlap',
            'reduce one of them',
        )
