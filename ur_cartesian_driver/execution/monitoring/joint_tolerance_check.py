# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Check the joints against the tolerances of a joint goal, joint by joint.

An error is desired - actual. On the path the desired value is the controller's target of the same
packet: the slider, a pause or the robot's own limits change target and actual value alike, and
another check ensures that the target itself is on the plan. At the end the desired value is the
last point, at rest.
"""

from __future__ import annotations

from ur_cartesian_driver.execution.monitoring.tolerance_check import excess_clause
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.motion.geometry.vectors import subtract6, Vector6, ZERO6
from ur_cartesian_driver.motion.goal.joint_goal import JointErrorBounds, JointTolerances
from ur_cartesian_driver.motion.state.rtde_state import RobotState


class JointToleranceCheck:
    """Compares packets with the tolerances of a goal; without limits it costs nothing."""

    def __init__(self, tolerances: JointTolerances | None) -> None:
        """Keep the tolerances of a joint goal; None = it has no tolerances."""
        self._tolerances = tolerances or JointTolerances(end=ZERO6)
        #: Whether there is any limit on the path; whether there is any at the end.
        self.has_path = bool(self._tolerances.path)
        self._has_goal = bool(self._tolerances.goal)

    def path_violation(self, state: RobotState) -> str | None:
        """Return a clause that names a joint outside its path tolerance, or None."""
        if not self.has_path:
            return None
        return _violation(self._tolerances.path, state.target_q, state.target_qd, state)

    def goal_violation(self, state: RobotState) -> str | None:
        """Return a clause that names a joint outside its goal tolerance, or None."""
        if not self._has_goal:
            return None
        return _violation(self._tolerances.goal, self._tolerances.end, ZERO6, state)


def _violation(bounds: JointErrorBounds, q: Vector6, qd: Vector6, state: RobotState) -> str | None:
    """Return a clause about the largest ratio of error to limit; None = no ratio is above 1."""
    return excess_clause(
        (quantity, f'of {joint}', unit, error, limit)
        for quantity, unit, limits, errors in (
            ('position', 'rad', bounds.position, subtract6(q, state.actual_q)),
            ('velocity', 'rad/s', bounds.velocity, subtract6(qd, state.actual_qd)),
        )
        for joint, limit, error in zip(JOINT_NAMES, limits, errors, strict=True)
    )
