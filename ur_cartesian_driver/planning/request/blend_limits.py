# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The bounds on blend radii (both blends of a segment must fit into it), and the accuracy of blends.

Negative radii are refused by :mod:`~.field_rules`, radii in splines by :mod:`~.spline_rules`.
"""

from __future__ import annotations

import numpy as np

from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.goal.goal_columns import GoalTable, rows_where
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.goal_fields import is_spline, is_timed, segment_field

#: The fields of MotionLaws that together determine path and time of the robot's blends.
BLEND_LAWS = ('blend_begin', 'blend_shape', 'blend_speed_ratio')
# Clean recordings show a law more exactly than an arm follows it: its interval does not contain
# what the law leaves out.
_MIN_UNCERTAINTY = 0.03


def check_blends(goal: GoalTable, options: PlanningOptions) -> None:
    """Refuse blends that overlap between two points of the goal."""
    if is_spline(goal):
        return
    radii = goal.segments.blend_radii
    if is_timed(goal) and goal.waypoints.times[0] == 0.0 and len(radii):
        radii = np.append(0.0, radii[1:])  # the arm starts at the first point, without a blend
    if not radii.any():
        return
    after = np.append(radii[1:-1], 0.0)  # the last point is never blended
    lengths = np.linalg.norm(np.diff(goal.waypoints.poses[:, :3], axis=0), axis=1)
    for k in rows_where(radii[:-1] + after > lengths):
        check_blends_fit(k + 1, float(lengths[k]), float(radii[k]), float(after[k]))


def check_blends_fit(index: int, length: float, before: float, after: float) -> None:
    """
    Refuse blends that overlap within a segment, because the controller would skip a point (C171).

    :param index: the number of the second point; 0 = the segment begins where the arm is.
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


def blends_are_measured(options: PlanningOptions) -> bool:
    """Return whether plans follow a twin in which all :data:`BLEND_LAWS` were measured."""
    twin = options.used_twin
    if twin is None or options.laws.blend_shape == 'unknown':
        return False
    return all(name in twin.estimates for name in BLEND_LAWS)


def blend_law(options: PlanningOptions) -> str:
    """Return a phrase for the origin of the laws of blends, to follow "as"."""
    if blends_are_measured(options):
        return measured_on(options)
    return 'assumed for motion version 1'


def measured_on(options: PlanningOptions) -> str:
    """Return a phrase for the arm and the date on which the laws of the twin were measured."""
    twin = options.used_twin
    assert twin is not None
    return f'measured on {"another" if options.twin_problem else "this"} arm, {twin.date}'


def blend_time_uncertainty(options: PlanningOptions) -> float:
    """
    Return the relative uncertainty of the time in blends that follow measured laws.

    The time is proportional to ``blend_begin``, and inversely proportional to
    ``blend_speed_ratio``, so their relative uncertainties add up.
    """
    twin, laws = options.used_twin, options.laws
    assert twin is not None
    return (
        twin.half_width('blend_begin') / laws.blend_begin
        + twin.half_width('blend_speed_ratio') / laws.blend_speed_ratio
    )


def blend_uncertainty(options: PlanningOptions) -> float:
    """
    Return the possible deviation of the robot's blends from the planned ones.

    It is a fraction of the deviation that is assumed if the laws were not measured: half the
    height of the parabola. If they were, only the uncertainty of ``blend_begin`` remains, to which
    this height is proportional, but not less than :data:`_MIN_UNCERTAINTY`.
    """
    if not blends_are_measured(options) or (twin := options.used_twin) is None:
        return 1.0
    interval = 2.0 * twin.half_width('blend_begin') / options.laws.blend_begin
    return min(max(interval, _MIN_UNCERTAINTY), 1.0)
