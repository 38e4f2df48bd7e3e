# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Derivatives of the joints along a rounded path, if a joint may come near one of its limits.

Away from singularities, the tool's limits keep the joints far below their limits of speed and
acceleration. A few configurations along the path usually prove this: there, the inverse of the
Jacobian turns bounds on the rates of the tool into bounds on the joint rates. If they do not prove
it, the joints are solved at all places of the path.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from ur_cartesian_driver.kinematics.inverse_rows import solve_path
from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.geometry.vectors import Joints, vector6
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.preflight.tcp_kinematics import TcpKinematics
from ur_cartesian_driver.planning.spline.spline_limits import may_near_limits

#: Distance between the few configurations along the path, in s [m].
_STEP = 0.004
#: Greatest speed and turn rate, then accelerations, of the tool along a path.
Peaks: TypeAlias = tuple[tuple[float, float], tuple[float, float]]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JointDerivatives:
    """Derivatives of k joints with respect to s, the place on the path, at m places."""

    #: (m, k) the first derivative; k = 0 if no joint comes near a limit, or if the arm cannot
    #: follow the whole path, which a later check of the plan refuses.
    q1: Floats
    #: (m, k) the second derivative.
    q2: Floats
    #: Joint positions at the last place [rad]; None = the arm cannot follow the path.
    end: Joints | None
    #: (m,) travel of the TCP in base per unit of s; None = the same as the tool's, or k = 0.
    carrier: Floats | None = None


def joint_derivatives(
    kinematics: TcpKinematics,
    q_start: Joints,
    s: Floats,
    poses: Floats,
    derivatives: tuple[Floats, Floats],
    peaks: Peaks,
    options: PlanningOptions,
) -> JointDerivatives:
    """
    Return the derivatives of the joints with respect to s along a path.

    :param q_start: the configuration before the first place [rad].
    :param s: (m,) the places, increasing.
    :param poses: (m, 7) the poses of the tool there.
    :param derivatives: (m, 6) first and second derivatives of the tool with respect to s.
    :param peaks: the greatest rates of the tool along the path, for
        :func:`~ur_cartesian_driver.planning.spline.spline_limits.may_near_limits`.
    """
    arm = kinematics.arm
    few = np.unique(np.append(np.searchsorted(s, np.arange(s[0], s[-1], _STEP)), len(s) - 1))
    none = np.empty((len(s), 0))
    for rows in (few, slice(None)):
        flange = kinematics.flange_rows(poses[rows])
        path = solve_path(arm, flange, q_start, skip_gaps=False)
        if not path.found.all():
            return JointDerivatives(q1=none, q2=none, end=None)
        end = vector6(path.q[-1].tolist())
        if rows is few and not may_near_limits(kinematics, path.q, *peaks, options):
            return JointDerivatives(q1=none, q2=none, end=end)
    q1, q2 = kinematics.joint_rates(path.q, *derivatives)
    return JointDerivatives(q1=q1, q2=q2, end=end, carrier=kinematics.carrier_speeds(path.q, q1))
