# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Rigid-body poses in plain floats.

A control cycle handles only a few poses, so a single pose consists of Python floats instead of an
array: it is immutable and comparable, and composing two takes about a microsecond. Batches of
poses are arrays of rows ``x y z qx qy qz qw``, see :func:`pose_rows`.

Rotations are unit quaternions ``(x, y, z, w)``, in the order of ROS. The robot's own notation,
rotation vectors ``rx ry rz`` (axis times angle), is converted here.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import acos, atan2, cos, hypot, pi, sin, sqrt
from typing import TypeAlias, TypeVar

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.geometry.vectors import Vector3, Vector6, ZERO3

Quaternion: TypeAlias = tuple[float, float, float, float]
#: One number, or the numbers of a batch.
N = TypeVar('N', float, Floats)

#: Two turns [rad]. A larger rotation or joint position was probably given in degrees.
MAX_ANGLE = 4.0 * pi

# Below this angle [rad], an angle and its sine are taken as equal.
_SMALL_ANGLE = 1e-9
# Below this cosine of the pitch, roll and yaw turn about the same axis.
_GIMBAL_LOCK = 1e-9


@dataclass(frozen=True, slots=True)
class Pose:
    """
    A position [m] and an orientation (unit quaternion x, y, z, w) of one frame in another.

    ``T_base_tool @ T_tool_nozzle`` is the nozzle in the base frame.
    """

    position: Vector3 = ZERO3
    quaternion: Quaternion = (0.0, 0.0, 0.0, 1.0)

    @classmethod
    def from_rotation_vector(cls, values: Sequence[float]) -> Pose:
        """Return the pose that the robot writes as ``x y z rx ry rz`` [m, rad]."""
        x, y, z, rx, ry, rz = values
        return cls((x, y, z), quaternion_from_rotation_vector((rx, ry, rz)))

    def rotation_vector(self) -> Vector6:
        """Return ``x y z rx ry rz`` [m, rad], with the angle within [0, pi]."""
        return (*self.position, *rotation_vector_from_quaternion(self.quaternion))

    def matrix(self) -> Floats:
        """Return the homogeneous matrix (4, 4)."""
        matrix = np.eye(4)
        matrix[:3, :3] = np.array(rotation_from_quaternion(self.quaternion)).reshape(3, 3)
        matrix[:3, 3] = self.position
        return matrix

    def row(self) -> tuple[float, ...]:
        """Return ``x y z qx qy qz qw``, a row of a batch of poses."""
        return (*self.position, *self.quaternion)

    def __matmul__(self, other: Pose) -> Pose:
        """Compose: ``T_a_c = T_a_b @ T_b_c``."""
        return Pose(self.apply(other.position), multiply(self.quaternion, other.quaternion))

    def apply(self, point: Vector3) -> Vector3:
        """Return the coordinates [m] in the parent frame of a point given in this frame."""
        x, y, z = rotate(self.quaternion, point)
        px, py, pz = self.position
        return (x + px, y + py, z + pz)

    def inverse(self) -> Pose:
        """Return ``T_b_a`` of this ``T_a_b``."""
        inverse = conjugate(self.quaternion)
        x, y, z = rotate(inverse, self.position)
        return Pose((-x, -y, -z), inverse)

    def distance_to(self, other: Pose) -> float:
        """Return the distance between the two origins [m]."""
        return distance(self.position, other.position)

    def angle_to(self, other: Pose) -> float:
        """Return the angle between the two orientations [rad], within [0, pi]."""
        return angle_between(self.quaternion, other.quaternion)

    def interpolate(self, other: Pose, fraction: float) -> Pose:
        """Return the pose at a fraction of the straight way and shortest rotation to another."""
        (ax, ay, az), (bx, by, bz) = self.position, other.position
        return Pose(
            (ax + fraction * (bx - ax), ay + fraction * (by - ay), az + fraction * (bz - az)),
            slerp(self.quaternion, other.quaternion, fraction),
        )


#: The identity.
IDENTITY = Pose()


def distance(a: Vector3, b: Vector3) -> float:
    """Return the Euclidean distance [m]."""
    return hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2])


def multiply(a: Quaternion, b: Quaternion) -> Quaternion:
    """Return the rotation ``b`` followed by ``a``, normalised so that products do not drift."""
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return normalize(
        (
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
            aw * bw - ax * bx - ay * by - az * bz,
        )
    )


def normalize(q: Quaternion) -> Quaternion:
    """
    Return the quaternion scaled to length 1.

    :raises ZeroDivisionError: the quaternion is zero.
    """
    x, y, z, w = q
    scale = 1.0 / sqrt(x * x + y * y + z * z + w * w)
    return (x * scale, y * scale, z * scale, w * scale)


def conjugate(q: Quaternion) -> Quaternion:
    """Return the inverse rotation of a unit quaternion."""
    x, y, z, w = q
    return (-x, -y, -z, w)


def rotate(q: Quaternion, v: Vector3) -> Vector3:
    """Return the vector turned by the unit quaternion: v + 2 u x (u x v + w v), u = (x, y, z)."""
    x, y, z, w = q
    vx, vy, vz = v
    tx = 2.0 * (y * vz - z * vy)
    ty = 2.0 * (z * vx - x * vz)
    tz = 2.0 * (x * vy - y * vx)
    return (
        vx + w * tx + y * tz - z * ty,
        vy + w * ty + z * tx - x * tz,
        vz + w * tz + x * ty - y * tx,
    )


def angle_between(a: Quaternion, b: Quaternion) -> float:
    """Return the angle of the rotation between two orientations [rad], within [0, pi]."""
    x, y, z, w = multiply(conjugate(a), b)
    return 2.0 * atan2(hypot(x, y, z), abs(w))


def slerp(a: Quaternion, b: Quaternion, fraction: float) -> Quaternion:
    """Return the orientation at a fraction of the shortest rotation from ``a`` to ``b``."""
    if a == b:
        return a
    dot = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]
    sign = -1.0 if dot < 0.0 else 1.0  # q and -q are the same orientation: take the short way
    angle = acos(min(1.0, abs(dot)))
    if angle < _SMALL_ANGLE:
        wa, wb = 1.0 - fraction, sign * fraction
    else:
        s = sin(angle)
        wa, wb = sin((1.0 - fraction) * angle) / s, sign * sin(fraction * angle) / s
    return normalize(
        (
            wa * a[0] + wb * b[0],
            wa * a[1] + wb * b[1],
            wa * a[2] + wb * b[2],
            wa * a[3] + wb * b[3],
        )
    )


def pose_error(desired: Pose, actual: Pose) -> Pose:
    """
    Return the deviation ``desired`` - ``actual`` of two poses in a common frame.

    The position is a difference along the axes of the common frame. The orientation is the
    rotation from the actual to the desired orientation in the axes of the actual one,
    q_actual^-1 q_desired, with the sign for which w >= 0.
    """
    (ax, ay, az), (dx, dy, dz) = actual.position, desired.position
    x, y, z, w = multiply(conjugate(actual.quaternion), desired.quaternion)
    if w < 0.0:
        x, y, z, w = -x, -y, -z, -w
    return Pose((dx - ax, dy - ay, dz - az), (x, y, z, w))


def quaternion_from_rotation_vector(v: Sequence[float]) -> Quaternion:
    """Return the unit quaternion of a rotation vector [rad]."""
    x, y, z = v
    angle = hypot(x, y, z)
    scale = 0.5 if angle < _SMALL_ANGLE else sin(0.5 * angle) / angle
    return normalize((x * scale, y * scale, z * scale, cos(0.5 * angle)))


def rotation_vector_from_quaternion(q: Quaternion) -> Vector3:
    """Return the rotation vector [rad] of a unit quaternion, its angle within [0, pi]."""
    x, y, z, w = q
    if w < 0.0:
        x, y, z, w = -x, -y, -z, -w
    length = hypot(x, y, z)
    scale = 2.0 if length < _SMALL_ANGLE else 2.0 * atan2(length, w) / length
    return (x * scale, y * scale, z * scale)


def quaternion_from_roll_pitch_yaw(roll: float, pitch: float, yaw: float) -> Quaternion:
    """Return the unit quaternion of angles about the fixed axes x, y, z [rad], as in a URDF."""
    cr, sr = cos(0.5 * roll), sin(0.5 * roll)
    cp, sp = cos(0.5 * pitch), sin(0.5 * pitch)
    cy, sy = cos(0.5 * yaw), sin(0.5 * yaw)
    return normalize(
        (
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
            cr * cp * cy + sr * sp * sy,
        )
    )


def roll_pitch_yaw_from_quaternion(q: Quaternion) -> Vector3:
    """Return the angles about the fixed axes x, y, z [rad], as in a URDF."""
    r11, _, _, r21, r22, r23, r31, r32, r33 = rotation_from_quaternion(q)
    across = hypot(r11, r21)
    pitch = atan2(-r31, across)
    if across < _GIMBAL_LOCK:
        return atan2(-r23, r22), pitch, 0.0
    return atan2(r32, r33), pitch, atan2(r21, r11)


def rotation_from_quaternion(q: tuple[N, N, N, N]) -> tuple[N, ...]:
    """Return the rotation matrix of a unit quaternion (or a batch): nine numbers, row by row."""
    x, y, z, w = q
    return (
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y - z * w),
        2.0 * (x * z + y * w),
        2.0 * (x * y + z * w),
        1.0 - 2.0 * (x * x + z * z),
        2.0 * (y * z - x * w),
        2.0 * (x * z - y * w),
        2.0 * (y * z + x * w),
        1.0 - 2.0 * (x * x + y * y),
    )


def pose_rows(poses: Iterable[Pose]) -> Floats:
    """Return a batch of poses, (n, 7): x y z [m] and the unit quaternion x y z w."""
    return np.array([pose.row() for pose in poses], dtype=np.float64).reshape(-1, 7)


def pose_from_row(row: Sequence[float] | Floats) -> Pose:
    """Return the pose of one row ``x y z qx qy qz qw``."""
    x, y, z, qx, qy, qz, qw = row.tolist() if isinstance(row, np.ndarray) else row
    return Pose((x, y, z), (qx, qy, qz, qw))
