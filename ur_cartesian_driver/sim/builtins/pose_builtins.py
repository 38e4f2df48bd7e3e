# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Arithmetic on poses: programs see rotation vectors, the computation uses quaternions."""

from __future__ import annotations

from math import asin, atan2, cos, dist, sin

from ur_cartesian_driver.motion.geometry.pose import (
    conjugate,
    multiply,
    Pose,
    Quaternion,
    quaternion_from_rotation_vector,
    rotation_from_quaternion,
    rotation_vector_from_quaternion,
)
from ur_cartesian_driver.motion.geometry.vectors import add, subtract
from ur_cartesian_driver.sim.builtins.arguments import (
    is_pose,
    number,
    pose,
    script_pose,
    six,
    three,
)
from ur_cartesian_driver.sim.builtins.builtin_group import BuiltinGroup
from ur_cartesian_driver.urscript import core_builtins
from ur_cartesian_driver.urscript.script_values import ScriptPose, Value

_invert_matrix = core_builtins()['inv']


class PoseBuiltins(BuiltinGroup):
    """Functions that depend only on their arguments."""

    def pose_trans(self, p_from: Value, p_from_to: Value) -> ScriptPose:
        """Return the product T1 T2 of two poses as transformations."""
        return script_pose(pose(p_from, 'p_from') @ pose(p_from_to, 'p_from_to'))

    def pose_inv(self, p_from: Value) -> ScriptPose:
        """Return the inverse of a pose."""
        return script_pose(pose(p_from, 'p_from').inverse())

    def inv(self, m: Value) -> Value:
        """Return the inverse of a pose or of a matrix."""
        return self.pose_inv(m) if is_pose(m) else _invert_matrix(m)

    def pose_add(self, p_1: Value, p_2: Value) -> ScriptPose:
        """Return the pose with the sum of the positions and the rotation R1 R2."""
        a, b = pose(p_1, 'p_1'), pose(p_2, 'p_2')
        rotation = multiply(a.quaternion, b.quaternion)
        return script_pose(Pose(add(a.position, b.position), rotation))

    def pose_sub(self, p_to: Value, p_from: Value) -> ScriptPose:
        """Return the pose with the difference of the positions and the rotation R_to R_from^-1."""
        to, start = pose(p_to, 'p_to'), pose(p_from, 'p_from')
        rotation = multiply(to.quaternion, conjugate(start.quaternion))
        return script_pose(Pose(subtract(to.position, start.position), rotation))

    def pose_dist(self, p_from: Value, p_to: Value) -> float:
        """Return the norm of the six numbers of `pose_sub`."""
        return dist(self.pose_sub(p_to, p_from), (0.0,) * 6)

    def point_dist(self, p_from: Value, p_to: Value) -> float:
        """Return the distance between the positions of two poses [m]."""
        return pose(p_from, 'p_from').distance_to(pose(p_to, 'p_to'))

    def interpolate_pose(self, p_from: Value, p_to: Value, alpha: Value) -> ScriptPose:
        """Return the pose at the fraction `alpha` between two poses; outside 0..1, extrapolate."""
        start, to = pose(p_from, 'p_from'), pose(p_to, 'p_to')
        return script_pose(start.interpolate(to, number(alpha, 'alpha')))

    def rotvec2rpy(self, rotation_vector: Value) -> list[float]:
        """Return roll, pitch and yaw [rad] of R = Rz(yaw) Ry(pitch) Rx(roll)."""
        vector = three(rotation_vector, 'rotation_vector')
        r = rotation_from_quaternion(quaternion_from_rotation_vector(vector))
        if abs(r[6]) > 1.0 - 1e-12:  # gimbal lock: roll and yaw share an axis; choose roll = 0
            return [0.0, -asin(max(-1.0, min(1.0, r[6]))), atan2(-r[1], r[4])]
        return [atan2(r[7], r[8]), -asin(r[6]), atan2(r[3], r[0])]

    def rpy2rotvec(self, rpy_vector: Value) -> list[float]:
        """Return the rotation vector [rad] of R = Rz(yaw) Ry(pitch) Rx(roll)."""
        roll, pitch, yaw = three(rpy_vector, 'rpy_vector')
        rotation = multiply(_about(2, yaw), multiply(_about(1, pitch), _about(0, roll)))
        return list(rotation_vector_from_quaternion(rotation))

    def wrench_trans(self, T_from_to: Value, w_from: Value) -> list[float]:
        """Convert a wrench from one frame to the axes and the origin of another."""
        to_from = pose(T_from_to, 'T_from_to').inverse()
        fx, fy, fz, tx, ty, tz = six(w_from, 'w_from')
        turn = Pose((0.0, 0.0, 0.0), to_from.quaternion)
        x, y, z = to_from.position
        fx, fy, fz = turn.apply((fx, fy, fz))
        tx, ty, tz = turn.apply((tx, ty, tz))
        return [fx, fy, fz, tx + y * fz - z * fy, ty + z * fx - x * fz, tz + x * fy - y * fx]


def _about(axis: int, angle: float) -> Quaternion:
    """Return the rotation by an angle [rad] about axis 0 (x), 1 (y) or 2 (z)."""
    q = [0.0, 0.0, 0.0, cos(0.5 * angle)]
    q[axis] = sin(0.5 * angle)
    return q[0], q[1], q[2], q[3]
