# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Forward kinematics and Jacobian of one arm, nominal or calibrated.

Callers need one pose (each control cycle, each step of an iteration) or ten thousand (a sampled
path). The same formulas take floats or arrays, so the two cases cannot differ. They use no
matrices: an operation on floats takes a few hundredths of a microsecond, one on small arrays a
hundred times as long.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, sin
from typing import Any, Generic, TypeAlias

import numpy as np

from ur_cartesian_driver.kinematics.robot_models import DhTable, JOINT_NAMES, RobotModel
from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, N, Pose
from ur_cartesian_driver.motion.geometry.vectors import Vector3

# Controllers report pi/2 as 1.570796327. A table that differs from the nominal one only by such
# rounding (less than a nanometre at the flange) is taken for nominal.
_ROUNDING = 1e-9
# Number of configurations in which two arms are compared.
_COMPARED_SAMPLES = 500


@dataclass(frozen=True, slots=True)
class _Link:
    """The constants of one row of the DH table."""

    theta: float
    d: float
    a: float
    sin_alpha: float
    cos_alpha: float
    sin_half_alpha: float
    cos_half_alpha: float


@dataclass(frozen=True, slots=True)
class ChainFramesOf(Generic[N]):
    """Joint axes and flange frame in base, of one configuration or of a batch."""

    #: Origin of each joint's axis [m].
    origins: tuple[tuple[N, N, N], ...]
    #: Direction of each joint's axis.
    axes: tuple[tuple[N, N, N], ...]
    #: Origin of the flange [m]; the next three fields are the directions of the flange's axes.
    position: tuple[N, N, N]
    x: tuple[N, N, N]
    y: tuple[N, N, N]
    z: tuple[N, N, N]

    def point(self, in_flange: Vector3) -> tuple[N, N, N]:
        """Return the position in base [m] of a point that is given in the flange frame [m]."""
        a, b, c = in_flange
        x, y, z = (
            p + a * x + b * y + c * z
            for p, x, y, z in zip(self.position, self.x, self.y, self.z, strict=True)
        )
        return x, y, z


ChainFrames: TypeAlias = ChainFramesOf[float]


class Arm:
    """
    The kinematics of one arm. Immutable.

    :param model: the robot model.
    :param geometry: calibrated DH table from the robot's kinematics information; None = nominal.
    """

    def __init__(self, model: RobotModel, geometry: DhTable | None = None) -> None:
        """Prepare the links."""
        if geometry is None or geometry.difference(model.geometry) < _ROUNDING:
            geometry = model.geometry
        self.model = model
        self.geometry = geometry
        #: Whether the geometry differs from the nominal one.
        self.calibrated = geometry is not model.geometry
        self._links = _links(geometry)
        self._links_from_flange = self._links[::-1]

    def __repr__(self) -> str:
        """Show the model and whether the arm is calibrated."""
        return f'<Arm {self.model.name}{", calibrated" if self.calibrated else ""}>'

    def forward(self, q: Sequence[float]) -> Pose:
        """Return ``T_base_flange`` at the joint positions [rad]; w of the quaternion >= 0."""
        x = y = z = 0.0
        qx = qy = qz = 0.0
        qw = 1.0
        for link, angle in zip(self._links_from_flange, reversed(q), strict=True):
            half = 0.5 * (angle + link.theta)
            x, y, z, qx, qy, qz, qw = _prepend_link(
                link, sin(half), cos(half), x, y, z, qx, qy, qz, qw
            )
        if qw < 0.0:
            return Pose((x, y, z), (-qx, -qy, -qz, -qw))
        return Pose((x, y, z), (qx, qy, qz, qw))

    def forward_rows(self, q: Floats) -> Floats:
        """
        Return ``T_base_flange`` for rows of joint positions.

        :param q: (n, 6) [rad].
        :returns: (n, 7) x y z [m], unit quaternion x y z w with w >= 0.
        """
        zero = np.zeros(len(q))
        state = (zero, zero, zero, zero, zero, zero, np.ones(len(q)))
        for link, angle in zip(self._links_from_flange, q.T[::-1], strict=True):
            half = 0.5 * (angle + link.theta)
            state = _prepend_link(link, np.sin(half), np.cos(half), *state)
        rows = np.stack(state, axis=1)
        rows[rows[:, 6] < 0.0, 3:] *= -1.0
        return rows

    def max_flange_distance(self, other: Arm) -> float:
        """
        Return the largest distance between the two flanges at equal joint positions [m].

        The distance is taken over a fixed set of random configurations. The tables cannot be
        compared instead: lengths of a calibrated arm may differ by metres that cancel each other.
        """
        q = np.random.default_rng(0).uniform(-np.pi, np.pi, (_COMPARED_SAMPLES, 6))
        distances = self.forward_rows(q)[:, :3] - other.forward_rows(q)[:, :3]
        return float(np.linalg.norm(distances, axis=1).max())

    def jacobian(self, q: Sequence[float], T_flange_tcp: Pose = IDENTITY) -> Floats:
        """
        Return the Jacobian of the TCP in base axes.

        :returns: (6, 6), which maps joint velocities [rad/s] to the linear [m/s] and angular
            [rad/s] velocity of the TCP.
        """
        frames = self.frames(q)
        if T_flange_tcp == IDENTITY:
            return jacobian_at(frames, frames.position)
        return jacobian_at(frames, (self.forward(q) @ T_flange_tcp).position)

    def frames(self, q: Sequence[float]) -> ChainFrames:
        """Return origins [m] and axes of all joints and of the flange."""
        return self._frames(
            [
                (cos(angle + link.theta), sin(angle + link.theta))
                for link, angle in zip(self._links, q, strict=True)
            ],
            0.0,
            1.0,
        )

    def frames_rows(self, q: Floats) -> ChainFramesOf[Floats]:
        """Return the frames for joint positions (n, 6); each value is an array (n,)."""
        angles = np.ascontiguousarray(q.T) + np.array(self.geometry.theta)[:, None]
        return self._frames(
            list(zip(np.cos(angles), np.sin(angles), strict=True)),
            np.zeros(len(q)),
            np.ones(len(q)),
        )

    def _frames(self, turns: list[tuple[N, N]], zero: N, one: N) -> ChainFramesOf[N]:
        """
        Return the frames of the joints and the flange.

        :param turns: cosine and sine of each joint's angle, as floats or as arrays.
        :param zero: 0.0, or an array of zeros; ``one`` likewise.
        """
        px = py = pz = zero
        xx, xy, xz = one, zero, zero
        yx, yy, yz = zero, one, zero
        zx, zy, zz = zero, zero, one
        origins: list[tuple[N, N, N]] = []
        axes: list[tuple[N, N, N]] = []
        for link, (c, s) in zip(self._links, turns, strict=True):
            origins.append((px, py, pz))
            axes.append((zx, zy, zz))
            # Rz: the axes x and y turn about z,
            ux, uy, uz = c * yx - s * xx, c * yy - s * xy, c * yz - s * xz
            xx, xy, xz = c * xx + s * yx, c * xy + s * yy, c * xz + s * yz
            # Tz Tx,
            a, d = link.a, link.d
            px, py, pz = px + d * zx + a * xx, py + d * zy + a * xy, pz + d * zz + a * xz
            # Rx: y and z turn about the new x.
            ca, sa = link.cos_alpha, link.sin_alpha
            yx, yy, yz = ca * ux + sa * zx, ca * uy + sa * zy, ca * uz + sa * zz
            zx, zy, zz = ca * zx - sa * ux, ca * zy - sa * uy, ca * zz - sa * uz
        return ChainFramesOf(
            tuple(origins), tuple(axes), (px, py, pz), (xx, xy, xz), (yx, yy, yz), (zx, zy, zz)
        )


def table_frames(geometry: DhTable) -> list[Pose]:
    """
    Return a frame for each DH row, ``T_base_frame``, with all joints at 0.

    The frame includes the row's theta and d, but not yet its a and alpha: it is on the row's axis.
    """
    T, frames = IDENTITY, []
    for link in _links(geometry):
        half = 0.5 * link.theta
        T = T @ Pose((0.0, 0.0, link.d), (0.0, 0.0, sin(half), cos(half)))
        frames.append(T)
        T = T @ Pose((link.a, 0.0, 0.0), (link.sin_half_alpha, 0.0, 0.0, link.cos_half_alpha))
    return frames


def jacobian_at(frames: ChainFramesOf[N], point: tuple[N, N, N]) -> Floats:
    """
    Return the Jacobian of a point [m] fixed to the last link, in base axes.

    :returns: (6, 6), or (n, 6, 6) for frames of n rows.
    """
    x, y, z = point
    columns = []
    for (px, py, pz), (ax, ay, az) in zip(frames.origins, frames.axes, strict=True):
        rx, ry, rz = x - px, y - py, z - pz
        columns.append((ay * rz - az * ry, az * rx - ax * rz, ax * ry - ay * rx, ax, ay, az))
    return np.array(columns).T


def pose_error(
    frames: ChainFramesOf[N], position: tuple[N, N, N], rotation: tuple[N, ...]
) -> tuple[list[N], N]:
    """
    Return the displacement from the flange to a pose, and 1 + 2 cos(angle of its turn).

    The displacement is a translation [m], and a turn as its axis times the sine of its angle, both
    in base axes. The last value is positive up to 120 degrees; beyond, the sine is misleading.

    :param rotation: rotation matrix of the pose, nine numbers by rows.
    """
    r11, r12, r13, r21, r22, r23, r31, r32, r33 = rotation
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = frames.x, frames.y, frames.z
    (px, py, pz), (x, y, z) = frames.position, position
    # Half the sum of the cross products of each flange axis with the same axis of the target.
    ex = (xy * r31 - xz * r21) + (yy * r32 - yz * r22) + (zy * r33 - zz * r23)
    ey = (xz * r11 - xx * r31) + (yz * r12 - yx * r32) + (zz * r13 - zx * r33)
    ez = (xx * r21 - xy * r11) + (yx * r22 - yy * r12) + (zx * r23 - zy * r13)
    facing = (
        (xx * r11 + xy * r21 + xz * r31)
        + (yx * r12 + yy * r22 + yz * r32)
        + (zx * r13 + zy * r23 + zz * r33)
    )
    return [x - px, y - py, z - pz, 0.5 * ex, 0.5 * ey, 0.5 * ez], facing


def pinocchio_model(arm: Arm) -> Any:
    """
    Return the arm as a ``pinocchio.Model`` with the frame ``tool0`` at the flange.

    The universe frame is ``base``; the joints have the names of :data:`JOINT_NAMES`.

    :raises ImportError: pinocchio is not installed.
    """
    try:
        import pinocchio
    except ImportError as error:
        raise ImportError(
            'Pinocchio is needed for this and is not installed; rosdep brings it on a ROS '
            'installation, the extra `collision` in a virtual environment.',
            name='pinocchio',
        ) from error
    model = pinocchio.Model()
    model.name = arm.model.name
    geometry, limits = arm.geometry, arm.model.position_limits
    torque = arm.model.max_joint_torque or (np.inf,) * 6
    joint, link = 0, pinocchio.SE3.Identity()
    for i, name in enumerate(JOINT_NAMES):
        joint = model.addJoint(
            joint,
            pinocchio.JointModelRZ(),
            link * pinocchio.SE3(pinocchio.utils.rotate('z', geometry.theta[i]), np.zeros(3)),
            name,
            np.array([torque[i]]),
            np.array([arm.model.max_joint_speed[i]]),
            np.array([limits[i][0]]),
            np.array([limits[i][1]]),
        )
        link = pinocchio.SE3(
            pinocchio.utils.rotate('x', geometry.alpha[i]),
            np.array([geometry.a[i], 0.0, geometry.d[i]]),
        )
    model.addFrame(pinocchio.Frame('tool0', joint, 0, link, pinocchio.FrameType.OP_FRAME))
    return model


def _links(geometry: DhTable) -> tuple[_Link, ...]:
    return tuple(
        _Link(theta, d, a, sin(alpha), cos(alpha), sin(0.5 * alpha), cos(0.5 * alpha))
        for theta, d, a, alpha in zip(
            geometry.theta, geometry.d, geometry.a, geometry.alpha, strict=True
        )
    )


_State: TypeAlias = tuple[N, N, N, N, N, N, N]


def _prepend_link(
    link: _Link, s: N, c: N, x: N, y: N, z: N, qx: N, qy: N, qz: N, qw: N
) -> _State[N]:
    """
    Return Rz(theta + q) Tz(d) Tx(a) Rx(alpha) * pose.

    :param s: sine of half the angle theta + q.
    :param c: cosine of half the angle.
    :returns: position x y z, quaternion x y z w.
    """
    # Rx(alpha): rotate the position; multiply (sin, 0, 0, cos) by the pose's quaternion.
    y, z = link.cos_alpha * y - link.sin_alpha * z, link.sin_alpha * y + link.cos_alpha * z
    sa, ca = link.sin_half_alpha, link.cos_half_alpha
    qx, qy, qz, qw = ca * qx + sa * qw, ca * qy - sa * qz, ca * qz + sa * qy, ca * qw - sa * qx
    x, z = x + link.a, z + link.d
    # Rz(theta + q): the same about z; the position needs the full angle.
    sin_theta, cos_theta = 2.0 * s * c, 1.0 - 2.0 * s * s
    return (
        cos_theta * x - sin_theta * y,
        sin_theta * x + cos_theta * y,
        z,
        c * qx - s * qy,
        c * qy + s * qx,
        c * qz + s * qw,
        c * qw - s * qz,
    )
