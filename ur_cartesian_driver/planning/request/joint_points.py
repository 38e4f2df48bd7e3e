# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Points that give joint positions in place of a pose: every number of their pose is NaN.

Only the planner knows the calibrated arm and the tool, so it computes these poses, and all later
stages see an ordinary goal. A joint move to such a point is sent as joint positions, not as a
pose: robots often rest near a singularity, where a pose does not determine joint positions
reliably.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.inverse import format_distinct
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.motion.errors import JointLimitExceeded, NotAvailable
from ur_cartesian_driver.motion.geometry.arrays import Flags
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import Joints, vector6
from ur_cartesian_driver.motion.goal.goal import Goal, Posture
from ur_cartesian_driver.motion.goal.goal_columns import GoalTable, rows_where
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.goal_fields import (
    gives_joints,
    IS_JOINT_MOVE,
    point_field,
)
from ur_cartesian_driver.planning.request.validate import check


@dataclass(frozen=True, slots=True, kw_only=True)
class JointPositions(Posture):
    """A posture that names all joints, and from which the pose of its point was computed."""

    def joints(self, tf_prefix: str) -> Joints:
        """Return the joint positions [rad]."""
        named = named_joints(self, tf_prefix)
        return vector6(named[k] for k in range(6))


def named_joints(posture: Posture, tf_prefix: str) -> dict[int, float]:
    """Return the values [rad] of a checked posture by joint number."""
    return {
        JOINT_NAMES.index(name.removeprefix(tf_prefix)): value
        for name, value in zip(posture.names, posture.values, strict=True)
    }


def full_posture(named: dict[int, float]) -> Joints | None:
    """Return the configuration [rad] if a posture names all joints (by number), else None."""
    return vector6(named[k] for k in range(6)) if len(named) == 6 else None


def check_for_arm(goal: Goal, T_flange_tcp: Pose, arm: Arm, options: PlanningOptions) -> GoalTable:
    """
    Return a goal as a table that passed :func:`~.validate.check`, with a pose at each point.

    :param T_flange_tcp: the active TCP; a controlled frame of the goal takes its place.
    :raises GoalRefused: the goal is wrong, a joint position is out of its range, or a pose is
        needed although the calibration is unknown.
    """
    table = check(goal, options)
    by_joints = gives_joints(table)
    if not by_joints.any():
        return table
    _check_calibration(table, by_joints, options)
    T_frame_base = table.T_base_frame.inverse()
    T_flange_point = table.T_flange_controlled or T_flange_tcp
    poses, postures = table.waypoints.poses.copy(), dict(table.waypoints.postures)
    for i in rows_where(by_joints):
        posture = JointPositions(names=postures[i].names, values=postures[i].values)
        q = posture.joints(options.tf_prefix)
        _check_ranges(i, q, arm)
        flange = arm.forward(q)
        held = table.moving_frame
        poses[i] = (held.tool(flange) if held else T_frame_base @ flange @ T_flange_point).row()
        postures[i] = posture
    waypoints = replace(table.waypoints, poses=poses, postures=postures)
    return check(replace(table, waypoints=waypoints), options)


def _check_calibration(goal: GoalTable, by_joints: Flags, options: PlanningOptions) -> None:
    """Refuse points that give joints, but are sent as poses, if the calibration is unknown."""
    is_sent = IS_JOINT_MOVE[goal.motions.types]
    for i in rows_where(by_joints & ~is_sent)[:1]:
        if not options.calibration_known:
            raise NotAvailable(
                point_field(i, 'pose'),
                'is NaN, but where the joint positions of the posture put the tool is not known: '
                'the calibration of this robot is unknown',
                'give the pose, or use a JOINT segment',
            )


def _check_ranges(index: int, q: Joints, arm: Arm) -> None:
    """Refuse joint positions out of their ranges; whole turns are not subtracted."""
    limits = np.array(arm.model.position_limits)
    for k in rows_where((q < limits[:, 0]) | (q > limits[:, 1]))[:1]:
        nearest = limits[k, 0] if q[k] < limits[k, 0] else limits[k, 1]
        value, _ = format_distinct(q[k], float(nearest))
        raise JointLimitExceeded(
            f'{point_field(index, "posture")} has {JOINT_NAMES[k]} at {value} rad, outside its '
            f'range of {arm.model.range_text(k)}; keep within it.'
        )
