# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The tool points of a SPLINE or SERVO goal, with NaN replaced by chosen values.

The tool stops at a point whose twist is 0. In place of a NaN velocity, the driver chooses the
velocity of the parabola through the point and its neighbours. In place of a NaN acceleration, it
chooses the mean of the two accelerations that the cubics before and after the point have there.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.pose_rows import (
    conjugate_rows,
    multiply_rows,
    normalized_rows,
)
from ur_cartesian_driver.motion.geometry.rotation_rows import log_rows, rotation_rates
from ur_cartesian_driver.motion.goal.goal_columns import GoalTable
from ur_cartesian_driver.planning.geometry.tool_spline import ToolPoints
from ur_cartesian_driver.planning.request.ignored_fields import add_remark

# If two consecutive points are closer than this [m], the linear part of chosen twists is 0 at
# both; if they are turned by less than this [rad], the angular part.
_MIN_DISTANCE = 1e-9


def tool_points(goal: GoalTable, start: ToolPoints) -> ToolPoints:
    """
    Return the start, followed by the points of a checked goal, in the frame of the path.

    NaN is replaced by chosen values.

    :param goal: the goal, whose waypoints come after the start.
    :param start: the tool in the frame of the path at the start, one row.
    """
    given, start = goal.waypoints, _in_frame(start, goal.T_base_frame.inverse())
    if goal.replace_horizon and not given.accelerations.any():
        # The rest of this path can be replaced from any place on, so the accelerations must not
        # jump at points: the driver chooses them.
        given = replace(given, accelerations=np.full_like(given.accelerations, np.nan))
    poses = np.concatenate([start.poses, given.poses])
    poses[:, 3:] = normalized_rows(poses[:, 3:])
    points = ToolPoints(
        times=np.concatenate([start.times, given.times]),
        poses=poses,
        twists=np.concatenate([start.twists, given.twists]),
        accelerations=np.concatenate([start.accelerations, given.accelerations]),
        quintic=bool(np.any(given.accelerations)),
    )
    return _in_frame(_without_nan(points, ends_moving=goal.keep_open), goal.T_base_frame)


def point_remarks(goal: GoalTable, first: int) -> list[str]:
    """Return the remarks on twists and accelerations; the first point has the number ``first``."""
    points = goal.waypoints
    inner = points if goal.keep_open else points[:-1]
    lines: list[str] = []
    add = partial(add_remark, lines, first)
    add(
        ~inner.twists.any(axis=1),
        'the arm stops there, because the twist is 0 (NaN lets the driver choose)',
    )
    for field, rates in (('twist', inner.twists), ('acceleration', inner.accelerations)):
        add(
            np.isnan(rates).any(axis=1),
            f'{field} is NaN, so the driver chooses it to fit the neighbouring points',
        )
    add(points.jerks.any(axis=1), 'jerk is ignored: no robot motion takes it')
    add(
        goal.segments.accelerations > 0.0,
        'the acceleration of the segment is ignored: its time sets the speed',
    )
    return lines


def _in_frame(points: ToolPoints, T_new_old: Pose) -> ToolPoints:
    """Return the same points expressed in another frame, which is at rest."""
    R = T_new_old.matrix()[:3, :3]
    twists, accelerations = (
        np.concatenate([rates[:, :3] @ R.T, rates[:, 3:] @ R.T], axis=1)
        for rates in (points.twists, points.accelerations)
    )
    positions = points.poses[:, :3] @ R.T + T_new_old.position
    orientations = normalized_rows(
        multiply_rows(np.array([T_new_old.quaternion]), points.poses[:, 3:])
    )
    poses = np.concatenate([positions, orientations], axis=1)
    return replace(points, twists=twists, accelerations=accelerations, poses=poses)


def _without_nan(points: ToolPoints, *, ends_moving: bool) -> ToolPoints:
    """Return the points with chosen values in place of NaN."""
    twists, accelerations = points.twists, points.accelerations
    if np.isnan(twists).any():
        twists = np.where(np.isnan(twists), _chosen_twists(points, ends_moving), twists)
    if np.isnan(accelerations).any():
        accelerations = np.where(
            np.isnan(accelerations), _chosen_accelerations(points, twists), accelerations
        )
    return replace(points, twists=twists, accelerations=accelerations)


def _chosen_twists(points: ToolPoints, ends_moving: bool) -> Floats:
    """
    Return the velocities of parabolas through each point and its neighbours.

    They are 0 at the start. At the end they are 0 or, with ``ends_moving``, the mean velocity
    since the point before. Angular velocities are computed from the rotation vectors from the
    point to its neighbours, because the derivative of such a vector at the point is the angular
    velocity.
    """
    h = np.diff(points.times)[:, None]
    displacement = np.concatenate(
        [
            np.diff(points.poses[:, :3], axis=0),
            _relative_rotations(points.poses[1:, 3:], points.poses[:-1, 3:]),
        ],
        axis=1,
    )
    mean = displacement / h
    twists = np.zeros_like(points.twists)
    twists[1:-1] = (h[1:] * mean[:-1] + h[:-1] * mean[1:]) / (h[1:] + h[:-1])
    if ends_moving:
        twists[-1] = mean[-1]
    for part in (slice(0, 3), slice(3, 6)):
        is_still = np.linalg.norm(displacement[:, part], axis=1) < _MIN_DISTANCE
        beside = np.concatenate([[False], is_still]) | np.concatenate([is_still, [False]])
        twists[beside, part] = 0.0
    return twists


def _chosen_accelerations(points: ToolPoints, twists: Floats) -> Floats:
    """Return the mean accelerations of the cubics before and after each point; 0 at both ends."""
    h = np.diff(points.times)[:, None]
    inner = slice(1, -1)
    poses, zero = points.poses, np.zeros((len(points.times) - 2, 3))
    # Relative to the inner point: positions, and rotation vectors from the point's orientation.
    there = []
    for around in (slice(None, -2), slice(2, None)):
        turn = rotation_rates(
            _relative_rotations(poses[around, 3:], poses[inner, 3:]), twists[around, 3:], zero
        )
        there.append(
            (
                np.concatenate([poses[around, :3] - poses[inner, :3], turn.x], axis=1),
                np.concatenate([twists[around, :3], turn.v], axis=1),
            )
        )
    (x_before, v_before), (x_after, v_after) = there
    v, before, after = twists[inner], h[:-1], h[1:]
    accelerations = np.zeros_like(points.accelerations)
    accelerations[inner] = 0.5 * (
        6.0 * x_before / before**2
        + (2.0 * v_before + 4.0 * v) / before
        + 6.0 * x_after / after**2
        - (4.0 * v + 2.0 * v_after) / after
    )
    return accelerations


def _relative_rotations(after: Floats, before: Floats) -> Floats:
    return log_rows(multiply_rows(after, conjugate_rows(before)))
