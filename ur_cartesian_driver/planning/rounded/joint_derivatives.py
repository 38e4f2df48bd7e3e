# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Derivatives of the joints along a rounded path, where a joint may come near one of its limits.

Away from singularities, the tool's limits keep the joints far below theirs. A few configurations
along the path show this: the inverse of the Jacobian bounds the joint rates by those of the tool.
If these few do not show it, the joints are found at all places.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ur_cartesian_driver.kinematics.differential_kinematics import joint_rates, largest_joint_rates
from ur_cartesian_driver.kinematics.inverse_rows import solve_path
from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.geometry.pose_rows import compose_rows
from ur_cartesian_driver.motion.geometry.vectors import Joints, vector6
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.preflight.tcp_kinematics import TcpKinematics

#: Distance of the few configurations, in s [m].
_STEP = 0.004
#: A joint is near a limit if the bound of its rate exceeds this part of the limit: the inverse of
#: the Jacobian differs a little from place to place.
_NEAR = 0.5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JointDerivatives:
    """Derivatives by s of k joints at m places."""

    #: (m, k) the first derivative; k = 0 if no joint comes near a limit, or if the arm cannot
    #: follow the whole path: a later check of the plan refuses it.
    q1: Floats
    #: (m, k) the second derivative.
    q2: Floats
    #: Joint positions at the last place [rad]; None = the arm cannot follow the path.
    end: Joints | None


@dataclass(frozen=True, slots=True, kw_only=True)
class ToolPeaks:
    """The greatest speed, turn rate and accelerations of the tool along a path."""

    speed: float
    turn_rate: float
    acceleration: float
    turn_acceleration: float


def joint_derivatives(
    kinematics: TcpKinematics,
    q_start: Joints,
    s: Floats,
    poses: Floats,
    derivatives: tuple[Floats, Floats],
    peaks: ToolPeaks,
    options: PlanningOptions,
) -> JointDerivatives:
    """
    Return the joints along a path.

    :param s: (m,) the places.
    :param poses: (m, 7) the poses of the tool there.
    :param derivatives: (m, 6) first and second derivatives of the tool by s.
    """
    arm = kinematics.arm
    few = np.unique(np.append(np.searchsorted(s, np.arange(s[0], s[-1], _STEP)), len(s) - 1))
    none = np.empty((len(s), 0))
    for rows in (few, slice(None)):
        flange = compose_rows(poses[rows], kinematics.T_tcp_flange)
        path = solve_path(arm, flange, q_start, skip_gaps=False)
        if not path.found.all():
            return JointDerivatives(q1=none, q2=none, end=None)
        end = vector6(path.q[-1].tolist())
        if rows is few and not _near_limits(kinematics, path.q, peaks, options):
            return JointDerivatives(q1=none, q2=none, end=end)
    q1, q2 = joint_rates(arm, kinematics.T_flange_tcp, path.q, *derivatives)
    return JointDerivatives(q1=q1, q2=q2, end=end)


def _near_limits(
    kinematics: TcpKinematics, q: Floats, peaks: ToolPeaks, options: PlanningOptions
) -> bool:
    """Return whether a joint may come near a limit in one of the configurations (n, 6)."""
    qd, qdd = largest_joint_rates(
        kinematics.arm,
        kinematics.T_flange_tcp,
        q,
        (peaks.speed, peaks.turn_rate),
        (peaks.acceleration, peaks.turn_acceleration),
    )
    speeds = qd / kinematics.arm.model.max_joint_speed
    return max(float(speeds.max()), float(qdd.max()) / options.max_joint_acceleration) > _NEAR
