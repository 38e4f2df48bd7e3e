# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Inverse kinematics in small steps, for use in a control cycle.

When the previous solution is known and the next one is near, there is no need to search all
branches or to iterate long: each step of Newton's method doubles the number of exact digits, for
nominal and calibrated arms alike. The branch never changes, because a solution far from the
previous one is rejected.
"""

from __future__ import annotations

from math import asin, cos, sin

import numpy as np

from ur_cartesian_driver.kinematics.chain import Arm, ChainFrames, jacobian_at, pose_error
from ur_cartesian_driver.kinematics.ideal_arm import ideal_arm_of
from ur_cartesian_driver.motion.geometry.pose import Pose, rotation_from_quaternion
from ur_cartesian_driver.motion.geometry.vectors import add6, Joints, Vector3, vector6

#: A squared error (metres and radians) below this leaves an error of 1e-10 after the next step,
#: unless the arm is nearly singular.
_ONE_STEP_LEFT = 1e-12
_MAX_STEPS = 8
#: If a joint moves farther than this [rad], Newton's method converges to another branch.
_MAX_JOINT_CHANGE = 0.5
#: Damping that keeps the normal equations of an exactly singular arm solvable.
_DAMPING = 1e-14


def track_pose(arm: Arm, T_base_flange: Pose, q_before: Joints) -> Joints | None:
    """
    Return the joint positions of a pose [rad], starting from the joints of a nearby pose.

    :param q_before: joint positions of a pose at most centimetres away [rad].
    :returns: None if the iteration does not converge or a joint would turn too far: the pose is
        out of reach, or the arm is near a singularity.
    """
    rotation = rotation_from_quaternion(T_base_flange.quaternion)
    q = q_before
    for _ in range(_MAX_STEPS):
        frames = arm.frames(q)
        error, facing = pose_error(frames, T_base_flange.position, rotation)
        square = sum([e * e for e in error])
        if facing <= 0.0:
            return None
        q = _newton_step(q, frames, error)
        if max([abs(a - b) for a, b in zip(q, q_before, strict=True)]) > _MAX_JOINT_CHANGE:
            return None
        if square < _ONE_STEP_LEFT:
            return q
    return None


def singularity_distances(arm: Arm, q: Joints) -> Vector3:
    """
    Return the distances of wrist [rad], elbow [rad] and shoulder [m] from their singularities.

    For wrist and elbow, this is the angle of wrist 2 or of the elbow joint from the nearest
    multiple of pi; for the shoulder, it is the distance of the wrist centre from the plane of axes
    1 and 2. None is negative.
    """
    ideal = ideal_arm_of(arm)
    _, t2, t3, t4, t5, _ = (a + b for a, b in zip(q, ideal.offsets, strict=True))
    shoulder = ideal.a2 * cos(t2) + ideal.a3 * cos(t2 + t3) + ideal.d5 * sin(t2 + t3 + t4)
    return (asin(min(1.0, abs(sin(t5)))), asin(min(1.0, abs(sin(t3)))), abs(shoulder))


def _newton_step(q: Joints, frames: ChainFrames, error: list[float]) -> Joints:
    """Return the joints after one Newton step: q + (J'J + _DAMPING I)^-1 J' error."""
    jacobian = jacobian_at(frames, frames.position)
    normal = jacobian.T @ jacobian
    normal.flat[::7] += _DAMPING
    change = np.linalg.solve(normal, jacobian.T @ np.array(error))
    return add6(q, vector6(change.tolist()))
