# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Selects the IK branch that the arm reaches from its present joints without a jump.

After a long step near a singularity, the solution on the other branch can be the nearest one, but
an arm that passes the singularity swings round and stays on its branch. A step that changes the
branch is therefore solved in shorter steps.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import ceil, log2

from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import Vector6
from ur_cartesian_driver.sim.motion.kinematics.joint_kinematics import (
    JointKinematics,
    max_joint_difference,
)
from ur_cartesian_driver.sim.motion.paths.move_paths import JointMovePath, MovePath, Setpoint

# The line from the present pose to the end of a path is solved in at least this many steps.
_WALK_STEPS = 8
# If even a step of this fraction of the line fails, the joints would have to jump.
_MIN_WALK_STEP = 1e-4
# Steps are shortened until no step turns a joint by more than this angle [rad].
_MAX_JOINT_STEP = 0.3
# A step that changes the branch is halved until it is about this long [m, rad].
_FINE = 1e-5


@dataclass(frozen=True, slots=True)
class IkBranchTracker:
    """Finds the joints that an arm reaches from its present joints ``q`` without a jump."""

    kinematics: JointKinematics
    q: Vector6
    T_base_tcp: Pose
    T_tcp_flange: Pose

    def joints(self, setpoint: Setpoint) -> Vector6 | None:
        """Return the joints at a set-point, nearest to the present joints; None = no solution."""
        return self._nearest(setpoint, self.q)

    def after(
        self, setpoint: Setpoint, h: float, step: Callable[[float], Setpoint]
    ) -> Vector6 | None:
        """
        Return the joints at the set-point after a step of ``h`` seconds; None = no solution.

        :param step: returns the set-point after a shorter step [s].
        """
        q = self.joints(setpoint)
        if (
            q is None
            or not isinstance(setpoint, Pose)
            or not self.kinematics.changes_branch(self.q, q)
        ):
            return q
        travel = self.T_base_tcp.distance_to(setpoint) + self.T_base_tcp.angle_to(setpoint)
        return self._joints_after_steps(step, self.q, 0.0, h, ceil(log2(max(travel / _FINE, 1.0))))

    def joints_at_end_of(self, move_path: MovePath) -> Vector6 | None:
        """
        Return the joints at the end of a path; None = the joints would have to jump.

        A tool path is replaced by the straight line from the present pose to its end.
        """
        if isinstance(move_path, JointMovePath):
            return move_path.end
        here, there = self.T_base_tcp, move_path.pose(move_path.length)
        q, done, step = self.q, 0.0, 1.0 / _WALK_STEPS
        while done < 1.0:
            after = self._nearest(here.interpolate(there, min(done + step, 1.0)), q)
            if after is not None and max_joint_difference(after, q) <= _MAX_JOINT_STEP:
                q, done, step = after, done + step, min(2.0 * step, 1.0 / _WALK_STEPS)
            elif step < _MIN_WALK_STEP:
                return None
            else:
                step *= 0.5
        return q

    def _joints_after_steps(
        self,
        step: Callable[[float], Setpoint],
        q: Vector6,
        begin: float,
        end: float,
        halvings: int,
    ) -> Vector6 | None:
        """
        Return the joints at the end of a step, which is halved while it changes the branch.

        :param step: returns the set-point at a time from now [s].
        :param q: the joints at ``begin``; ``begin`` and ``end`` are times from now [s].
        :param halvings: the largest number of times that the step is halved.
        """
        setpoint = step(end)
        after = self._nearest(setpoint, q)
        if (
            halvings <= 0
            or after is None
            or not isinstance(setpoint, Pose)
            or not self.kinematics.changes_branch(q, after)
        ):
            return after
        middle = 0.5 * (begin + end)
        half = self._joints_after_steps(step, q, begin, middle, halvings - 1)
        if half is None:
            return None
        return self._joints_after_steps(step, half, middle, end, halvings - 1)

    def _nearest(self, setpoint: Setpoint, q: Vector6) -> Vector6 | None:
        if not isinstance(setpoint, Pose):
            return setpoint
        return self.kinematics.joints(setpoint @ self.T_tcp_flange, q)
