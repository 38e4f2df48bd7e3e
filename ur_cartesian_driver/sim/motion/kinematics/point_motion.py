# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The motion of points of the arm, from joint speeds and accelerations.

The controller reports the motion of some points (elbow, accelerometer, payload). It is computed
from the joints, so that it agrees with their reported motion. All vectors are in base axes, in
[m], [rad] and [s].
"""

from __future__ import annotations

from dataclasses import dataclass

from ur_cartesian_driver.kinematics.chain import ChainFrames
from ur_cartesian_driver.motion.geometry.vectors import (
    add,
    cross,
    dot,
    scale,
    subtract,
    Vector3,
    Vector6,
    vector6,
    ZERO3,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class PointMotion:
    """The motion of a point on a link, and the rotation of that link."""

    velocity: Vector3
    acceleration: Vector3
    angular_velocity: Vector3
    angular_acceleration: Vector3


def point_motion(
    frames: ChainFrames, qd: Vector6, qdd: Vector6, point: Vector3, joints: int = 6
) -> PointMotion:
    """
    Return the motion of a point on the link after the first ``joints`` joints.

    It is computed from link to link, as in the outward half of the Newton-Euler recursion (Craig,
    Introduction to Robotics, section 6.5).

    :param point: the position of the point [m].
    :param joints: number of joints between the base and the link.
    """
    omega = alpha = velocity = acceleration = ZERO3
    here = frames.origins[0]
    for i in range(joints):
        axis, origin = frames.axes[i], frames.origins[i]
        velocity, acceleration = _shifted_motion(
            velocity, acceleration, omega, alpha, subtract(origin, here)
        )
        turning = scale(axis, qd[i])
        alpha = add(add(alpha, scale(axis, qdd[i])), cross(omega, turning))
        omega = add(omega, turning)
        here = origin
    velocity, acceleration = _shifted_motion(
        velocity, acceleration, omega, alpha, subtract(point, here)
    )
    return PointMotion(
        velocity=velocity,
        acceleration=acceleration,
        angular_velocity=omega,
        angular_acceleration=alpha,
    )


def moments_for(frames: ChainFrames, point: Vector3, force: Vector3) -> Vector6:
    """
    Return the joint moments [Nm] that produce a force [N] at a point of the last link.

    By the principle of virtual work, joint moments times joint speeds equal force times velocity.
    """
    return vector6(
        dot(axis, cross(subtract(point, origin), force))
        for origin, axis in zip(frames.origins, frames.axes, strict=True)
    )


def flange_point(frames: ChainFrames, offset: Vector3) -> Vector3:
    """Return the base coordinates [m] of a point given in flange coordinates [m]."""
    x, y, z = offset
    in_plane = add(add(frames.position, scale(frames.x, x)), scale(frames.y, y))
    return add(in_plane, scale(frames.z, z))


def _shifted_motion(
    velocity: Vector3, acceleration: Vector3, omega: Vector3, alpha: Vector3, lever_arm: Vector3
) -> tuple[Vector3, Vector3]:
    """Return velocity and acceleration of the point that is ``lever_arm`` away on the link."""
    round_ = cross(omega, lever_arm)
    return (
        add(velocity, round_),
        add(add(acceleration, cross(alpha, lever_arm)), cross(omega, round_)),
    )
