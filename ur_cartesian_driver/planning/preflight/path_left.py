# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Check the remainder of a planned path in a changed cell.

Plans are checked when they are made. If the cell changes before or during the motion, only the
distances from the bodies of the cell are checked again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf
from typing import Self

import numpy as np

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import Joints, vector6
from ur_cartesian_driver.motion.goal.goal import PartChange
from ur_cartesian_driver.motion.goal.moving_frame import MovingFrame
from ur_cartesian_driver.motion.plan.joint_spline import JointSpline
from ur_cartesian_driver.motion.plan.offset_band import OffsetBand
from ur_cartesian_driver.motion.plan.plan import Plan, ReferencePath
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.preflight.clearance import clearances, JointSamples
from ur_cartesian_driver.planning.preflight.held_part_kinematics import kinematics_of
from ur_cartesian_driver.planning.preflight.offset_band_check import (
    dense_path,
    OffsetBandCheck,
)
from ur_cartesian_driver.planning.preflight.planned_joints import (
    joint_moves,
    JointMove,
    solved_joints,
)
from ur_cartesian_driver.planning.request.controlled_frame import tool_tips


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PathLeft:
    """A planned path, and the time from which another path takes its place."""

    reference: ReferencePath
    #: The joints over time of a goal in SPLINE or SERVO; None = they are solved from the path.
    spline: JointSpline | None
    #: The joint moves of the path, if there is no spline.
    joint_moves: tuple[JointMove, ...] = ()
    #: The TCP whose poses the path has.
    T_flange_tcp: Pose
    #: The tool tips to check, the active TCP first.
    tool_tips: tuple[Pose, ...]
    #: The band in which offsets may move the tool; None = offsets are not allowed.
    band: OffsetBand | None = None
    #: The moving frame of the path; None = the frame is fixed in base.
    moving_frame: MovingFrame | None = None
    #: Time since the start of the goal from which another path takes its place [s].
    until: float = inf

    @classmethod
    def of(cls, plan: Plan, spline: JointSpline | None = None) -> Self:
        """Return the whole path of a plan; ``spline``: see :func:`spline_of`."""
        return cls(
            reference=plan.reference,
            spline=spline,
            joint_moves=() if spline else joint_moves(plan),
            T_flange_tcp=plan.T_flange_tcp or plan.T_flange_active,
            tool_tips=tool_tips(plan.goal, plan.T_flange_active),
            band=plan.offset_band,
            moving_frame=plan.goal.moving_frame,
        )

    @property
    def end(self) -> float:
        """The time since the start of the goal at which the path ends [s]."""
        return min(float(self.reference.time[-1]), self.until)

    def check(
        self,
        arm: Arm,
        options: PlanningOptions,
        q: Joints,
        part_changes: Sequence[PartChange],
        time: float = 0.0,
    ) -> Joints:
        """
        Check the clearance of the path from a time on.

        :param options: with the cell as it is at this time.
        :param q: the joint positions at this time [rad].
        :param part_changes: the bodies that the tool takes or puts down after this time.
        :param time: since the start of the goal [s].
        :returns: the joint positions at the end of the path [rad]; ``q`` if the path has ended.
        :raises GoalRefused: the arm would come too close to a body, or cannot reach a pose.
        """
        path = self.reference.since(time)
        if len(path.time) < 2 or self.end <= time:
            return q
        path = dense_path(path)
        ahead = (path.time >= time) & (path.time <= self.until)
        if not ahead.any():
            return q
        path = ReferencePath(
            poses=path.poses[ahead],
            point=path.point[ahead],
            time=path.time[ahead],
            fraction=path.fraction[ahead],
        )
        kinematics = kinematics_of(self.moving_frame, arm, self.T_flange_tcp)
        if self.spline is not None:
            joints = self.spline.rows(path.time)[0]
        else:
            joints = solved_joints(kinematics, self.reference, path, self.joint_moves, q)
        # Self-collisions and planes were checked when the path was planned.
        only_cell = replace(options, self_collision='off', workspace_planes=())
        samples = JointSamples(path.point, path.fraction, joints)
        for _ in clearances(
            arm, self.tool_tips, only_cell, samples, q, part_changes, closest=False
        ):
            pass
        if self.band is not None:
            OffsetBandCheck(
                kinematics=kinematics,
                options=only_cell,
                band=self.band,
                reference=path,
                q=joints,
                qd=np.zeros_like(joints),
                tool_tips=self.tool_tips,
                part_changes=part_changes,
            ).check_clearance()
        return vector6(joints[-1].tolist())


def spline_of(plan: Plan) -> JointSpline | None:
    """Return a plan's joints over time if it is executed as a spline, else None."""
    return plan.joint_spline if plan.execution.traits.is_spline else None


def joints_at(plan: Plan, waypoint: int) -> Joints:
    """
    Return the joint positions after the motion to a waypoint [rad].

    The arm must stop there: with a blend, it does not pass through these positions.
    """
    rows = plan.rows
    row = int(np.searchsorted(rows.waypoints, waypoint, side='right')) - 1
    return plan.start if row < 0 else vector6(rows.joints[row].tolist())
