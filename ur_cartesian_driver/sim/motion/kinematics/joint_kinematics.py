# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Inverse kinematics of the simulated arm, with the limits of its joints and singularities."""

from __future__ import annotations

from math import cos, inf, sin, sqrt

import numpy as np

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.inverse import nearest
from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats
from ur_cartesian_driver.motion.geometry.pose import (
    conjugate,
    multiply,
    Pose,
    rotation_vector_from_quaternion,
)
from ur_cartesian_driver.motion.geometry.vectors import (
    scale,
    scale6,
    subtract,
    subtract6,
    Vector6,
    ZERO6,
)
from ur_cartesian_driver.sim.motion.motion_values import MotionFault
from ur_cartesian_driver.sim.motion.paths.move_paths import MovePath
from ur_cartesian_driver.sim.motion.paths.path_motion import ProfileParameters

# The following numbers are assumed, because the robot's are not published.
#: Full joint acceleration of optimove, which also bounds servoj and path offsets [rad/s^2].
MAX_JOINT_ACCELERATION = 40.0
#: Joint jerk of optimove [rad/s^3].
MAX_JOINT_JERK = 400.0
#: The highest limit of the tool speed in the safety settings [m/s].
MAX_TOOL_SPEED = 5.0
#: Deceleration of a joint before the end of its range [rad/s^2].
LIMIT_DECELERATION = 10.0
#: Joint travel per tool travel [rad/m, rad/rad] above which the arm is considered to be at a
#: singularity.
SINGULAR_RATE = 1000.0

#: The speed of an arm at rest.
STILL = ZERO6
#: Joint changes below this are treated as rounding [rad].
NO_CHANGE = 1e-9
# A joint this close to its limit [rad] is reported as the cause of an impossible step.
_AT_LIMIT = 0.02
_SAMPLES = 8


class JointKinematics:
    """
    The inverse kinematics of one arm, and the limits of its joints in one cycle.

    :param cycle: duration of a cycle [s].
    """

    def __init__(self, arm: Arm, cycle: float) -> None:
        """Take the limits of the arm's model."""
        self._arm, self._cycle = arm, cycle
        self._speeds, self._limits = arm.model.max_joint_speed, arm.model.position_limits
        nominal = arm.model.geometry
        self._lengths = nominal.a[1], nominal.a[2], nominal.d[4]

    def joints(self, T_base_flange: Pose, q_near: Vector6) -> Vector6 | None:
        """Return the solution within the limits nearest to ``q_near``; None = no solution."""
        return nearest(self._arm, T_base_flange, q_near)

    def changes_branch(self, q: Vector6, q_next: Vector6) -> bool:
        """Return whether shoulder, elbow or wrist 2 change to their other solution."""
        return any(
            a * b < 0.0
            for a, b in zip(self._branch_signs(q), self._branch_signs(q_next), strict=True)
        )

    def _branch_signs(self, q: Vector6) -> tuple[float, float, float]:
        """
        Return three numbers whose signs identify the branch.

        The first is the horizontal coordinate [m] of the wrist centre from the shoulder, in the
        plane of the arm; it is computed for the nominal arm, because a calibrated arm has the same
        sign. The others are the sines of elbow and wrist 2.
        """
        upper_arm, forearm, wrist = self._lengths
        angle = q[1] + q[2]
        return (
            upper_arm * cos(q[1]) + forearm * cos(angle) + wrist * sin(angle + q[3]),
            sin(q[2]),
            sin(q[4]),
        )

    def overspeed_factor(self, q: Vector6, q_before: Vector6) -> float:
        """
        Return the step to ``q`` as a multiple of the longest possible step; inf = impossible.

        A joint must not exceed its speed limit or the speed from which it can brake before the end
        of its range: v^2 = 2 a x.
        """
        worst = 0.0
        for new, old, max_speed, (low, high) in zip(
            q, q_before, self._speeds, self._limits, strict=True
        ):
            travel = abs(new - old)
            if travel < NO_CHANGE:
                continue
            margin = high - old if new > old else old - low
            allowed = max_speed * self._cycle
            if 2.0 * LIMIT_DECELERATION * margin < max_speed * max_speed:
                if margin <= NO_CHANGE:
                    return inf
                allowed = min(
                    allowed, margin, sqrt(2.0 * LIMIT_DECELERATION * margin) * self._cycle
                )
            worst = max(worst, travel / allowed)
        return worst

    def kept_rows(self, q: Floats, on_branch: bool) -> Flags:
        """
        Return a mask (n,) of the steps between rows that the arm can make in one cycle.

        The limits of the joints are the same as in :meth:`overspeed_factor`.

        :param q: joint positions (n + 1, 6) [rad]; the first row is the arm's present position.
        :param on_branch: whether a step must also stay on the IK branch.
        """
        travel, q_before = np.abs(np.diff(q, axis=0)), q[:-1]
        low, high = np.array(self._limits).T
        margin = np.where(q[1:] > q_before, high - q_before, q_before - low)
        brakes = np.sqrt(2.0 * LIMIT_DECELERATION * np.maximum(margin, 0.0))
        speed = np.minimum(np.array(self._speeds), brakes)
        allowed = np.minimum(speed * self._cycle, margin)
        kept: Flags = ((travel < NO_CHANGE) | (travel <= allowed)).all(axis=1)
        if on_branch:
            signs = self._branch_sign_rows(q)
            kept &= (signs[1:] * signs[:-1] >= 0.0).all(axis=1)
        return kept

    def _branch_sign_rows(self, q: Floats) -> Floats:
        """Return :meth:`_branch_signs` for rows of joint positions (n, 3)."""
        upper_arm, forearm, wrist = self._lengths
        angle = q[:, 1] + q[:, 2]
        shoulder = (
            upper_arm * np.cos(q[:, 1]) + forearm * np.cos(angle) + wrist * np.sin(angle + q[:, 3])
        )
        return np.stack((shoulder, np.sin(q[:, 2]), np.sin(q[:, 4])), axis=1)

    def motion_fault(self, q: Vector6, q_next: Vector6 | None) -> MotionFault:
        """Return the fault of an impossible step from ``q`` to ``q_next`` (None = no solution)."""
        for i, (position, (low, high)) in enumerate(zip(q, self._limits, strict=True)):
            if position - low < _AT_LIMIT or high - position < _AT_LIMIT:
                return MotionFault(
                    code=191,
                    argument=1,
                    text=(
                        f'Joint position limit: joint {i} stands at {position:.4f} rad and would '
                        f'leave [{low:.4f}, {high:.4f}].'
                    ),
                )
        if q_next is None:
            return MotionFault(
                code=154,
                argument=0,
                text=(
                    'Position in singularity: the path goes on where there is no inverse '
                    'kinematics solution.'
                ),
            )
        joint = max(range(6), key=lambda i: abs(q[i] - q_next[i]))
        return MotionFault(
            code=204,
            argument=7,
            text=(
                'Robot approaching singularity: acceleration threshold failed, joint '
                f'{joint} would have to turn at once.'
            ),
        )

    def fastest_parameters(
        self, move_path: MovePath, q: Vector6, T_tcp_flange: Pose, a: float, v: float
    ) -> ProfileParameters:
        """
        Return profile parameters along a path that use fractions of the joint limits.

        The joint travel per path length is computed at a few samples of the path, from ``q`` on.

        :param a: fraction of :data:`MAX_JOINT_ACCELERATION`; the jerk limit is used in full.
        :param v: fraction of the speed limits of the joints.
        """
        step = move_path.length / _SAMPLES or 1.0
        speed = acceleration = inf
        for i in range(1, _SAMPLES + 1):
            setpoint = move_path.at(move_path.length * i / _SAMPLES)
            after = (
                self.joints(setpoint @ T_tcp_flange, q) if isinstance(setpoint, Pose) else setpoint
            )
            if after is None:
                break
            for x, y, limit in zip(q, after, self._speeds, strict=True):
                rate = max(abs(y - x), NO_CHANGE) / step
                speed = min(speed, limit / rate)
                acceleration = min(acceleration, MAX_JOINT_ACCELERATION / rate)
            q = after
        if speed == inf:
            speed = acceleration = 1.0  # no sample can be reached: the move will fail
        jerk = acceleration * MAX_JOINT_JERK / MAX_JOINT_ACCELERATION
        return ProfileParameters(acceleration=a * acceleration, speed=v * speed, jerk=jerk)


def is_singular(q_before: Vector6, q: Vector6, before: Pose, pose: Pose) -> bool:
    """Return whether the joints turn farther than ``SINGULAR_RATE`` times the tool's travel."""
    travel = before.distance_to(pose) + before.angle_to(pose)
    return max_joint_difference(q, q_before) > SINGULAR_RATE * travel


def max_joint_difference(a: Vector6, b: Vector6) -> float:
    """Return the largest absolute difference between values of the same joint."""
    return max(map(abs, subtract6(a, b)))


def difference_rate(after: Vector6, before: Vector6, rate: float) -> Vector6:
    """Return the difference times ``rate`` [1/s]."""
    return scale6(subtract6(after, before), rate)


def twist_between(before: Pose, after: Pose, rate: float) -> Vector6:
    """Return the mean twist from one pose to the next, in base axes; ``rate`` = 1 / time."""
    rotation = rotation_vector_from_quaternion(
        multiply(after.quaternion, conjugate(before.quaternion))
    )
    return (*scale(subtract(after.position, before.position), rate), *scale(rotation, rate))
