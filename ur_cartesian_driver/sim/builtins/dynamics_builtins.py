# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Functions for programs that control the arm by torques: Jacobians, inertia, centrifugal torques.

The links of the simulated arm have no mass, so the mass matrix and the torques come from the
payload alone, a point mass.
"""

from __future__ import annotations

from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import scale, Vector6, vector6, ZERO6
from ur_cartesian_driver.sim.builtins.arguments import pose, six
from ur_cartesian_driver.sim.builtins.builtin_group import BuiltinGroup
from ur_cartesian_driver.sim.motion.kinematics.point_motion import (
    flange_point,
    moments_for,
    point_motion,
)
from ur_cartesian_driver.urscript.script_values import Matrix, Value

#: The time derivative of the Jacobian is computed from Jacobians this much [s] before and after.
DIFFERENCE = 1e-4
UNIT_ACCELERATIONS = tuple(vector6(1.0 if i == j else 0.0 for i in range(6)) for j in range(6))


class DynamicsBuiltins(BuiltinGroup):
    """Functions of joint positions and speeds; by default, of the present target motion."""

    def _q(self, q: Value) -> Vector6:
        return self._controller.motion.q if q is None else six(q, 'q')

    def _qd(self, qd: Value) -> Vector6:
        return self._controller.motion.qd if qd is None else six(qd, 'qd')

    def _tcp(self, tcp: Value) -> Pose:
        return self._controller.motion.T_flange_tcp if tcp == 'active_tcp' else pose(tcp, 'tcp')

    def get_jacobian(self, q: Value = None, tcp: Value = 'active_tcp') -> Matrix:
        """Return the matrix that maps joint speeds to the TCP twist, in base axes [m/s, rad/s]."""
        return Matrix(self._controller.arm.jacobian(self._q(q), self._tcp(tcp)).tolist())

    def get_jacobian_time_derivative(
        self, q: Value = None, qd: Value = None, tcp: Value = 'active_tcp'
    ) -> Matrix:
        """Return the time derivative of the Jacobian at the joint speeds `qd`."""
        arm, tool, joints = self._controller.arm, self._tcp(tcp), self._q(q)
        ahead, behind = (
            arm.jacobian([a + step * b for a, b in zip(joints, self._qd(qd), strict=True)], tool)
            for step in (DIFFERENCE, -DIFFERENCE)
        )
        return Matrix(((ahead - behind) / (2.0 * DIFFERENCE)).tolist())

    def get_mass_matrix(self, q: Value = None, include_rotor_inertia: Value = False) -> Matrix:
        """Return the matrix [kg m^2] that maps joint accelerations to joint moments."""
        joints = self._q(q)
        columns = [self._payload_moments(joints, ZERO6, qdd) for qdd in UNIT_ACCELERATIONS]
        return Matrix([list(row) for row in zip(*columns, strict=True)])

    def get_coriolis_and_centrifugal_torques(
        self, q: Value = None, qd: Value = None
    ) -> list[float]:
        """Return the joint moments [Nm] for motion at constant joint speeds, without gravity."""
        return list(self._payload_moments(self._q(q), self._qd(qd), ZERO6))

    def _payload_moments(self, q: Vector6, qd: Vector6, qdd: Vector6) -> Vector6:
        payload = self._controller.payload
        frames = self._controller.arm.frames(q)
        centre = flange_point(frames, payload.cog)
        acceleration = point_motion(frames, qd, qdd, centre).acceleration
        return moments_for(frames, centre, scale(acceleration, payload.mass))
