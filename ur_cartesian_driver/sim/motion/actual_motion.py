# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The motion that the robot measures.

The simulated arm follows its targets exactly, so actual values equal the targets, unless the arm
is compliant or configured as imperfect, or a fault makes the actual values deviate. A deviation of
the pose changes the joint positions accordingly, but not the twist, as with a faulty measurement.
A deviation of the twist changes the joint speeds, but not the pose. A deviation of the
acceleration also makes twist and joint speeds drift, by its integral, because many clients
differentiate speeds instead of reading the accelerometer.
"""

from __future__ import annotations

from math import dist

import numpy as np

from ur_cartesian_driver.kinematics.inverse import nearest
from ur_cartesian_driver.motion.geometry.pose import (
    multiply,
    Pose,
    quaternion_from_rotation_vector,
)
from ur_cartesian_driver.motion.geometry.vectors import add, add6, scale6, Vector6, vector6, ZERO6
from ur_cartesian_driver.sim.motion import MotionGenerator
from ur_cartesian_driver.sim.motion.contact.contact_motion import ContactMotion
from ur_cartesian_driver.sim.motion.imperfect_arm import ImperfectArm, Imperfections, Motion

# A solution farther than this [rad] from the undisturbed joints is treated as another branch.
_BRANCH_JUMP = 0.5


class ActualMotion:
    """The measured motion of one arm."""

    def __init__(
        self, motion: MotionGenerator, imperfections: Imperfections | None, contact: ContactMotion
    ) -> None:
        """
        Follow the targets of this motion.

        :param imperfections: the imperfections of the arm; None = a perfect arm.
        :param contact: computes how far the tool deviates in contact and in force mode.
        """
        self._motion, self._contact = motion, contact
        self.imperfect_arm = ImperfectArm(motion, imperfections) if imperfections else None
        #: The measured motion before faults and compliance are added.
        self._undisturbed: Motion = self.imperfect_arm or motion
        self._pose_fault: Vector6 | None = None
        self._twist_fault: Vector6 | None = None
        #: Deviation of the measured acceleration of the TCP [m/s^2, rad/s^2].
        self.acceleration_error: Vector6 = ZERO6
        #: The integral of ``acceleration_error`` [m/s, rad/s].
        self._drift: Vector6 = ZERO6
        #: The last solution of inverse kinematics: its inputs (undisturbed joints, deviation, TCP)
        #: and the joints at the deviated pose.
        self._solved: tuple[tuple[Vector6, Vector6, Pose], Vector6] | None = None

    def step(self) -> None:
        """Follow the target for a cycle."""
        if self.imperfect_arm is not None:
            self.imperfect_arm.step()

    def deviate(
        self, pose: Vector6 | None, twist: Vector6 | None, acceleration: Vector6 | None
    ) -> None:
        """Set the deviations by faults in this cycle, in base axes; None = no deviation."""
        self._pose_fault = pose
        self.acceleration_error = acceleration or ZERO6
        if acceleration is None:
            self._drift, self._twist_fault = ZERO6, twist
        else:
            self._drift = add6(self._drift, scale6(acceleration, self._motion.cycle))
            self._twist_fault = self._drift if twist is None else add6(self._drift, twist)

    @property
    def _pose(self) -> Vector6 | None:
        """Deviation of the pose by a fault and compliance, in base axes [m, rad]; None = none."""
        return _sum(self._pose_fault, self._contact.deviation)

    @property
    def _twist(self) -> Vector6 | None:
        """Deviation of the twist by a fault and compliance, in base axes; None = none."""
        return _sum(self._twist_fault, self._contact.twist)

    @property
    def T_base_tcp(self) -> Pose:
        """Pose of the TCP."""
        pose, deviation = self._undisturbed.T_base_tcp, self._pose
        if deviation is None:
            return pose
        x, y, z, rx, ry, rz = deviation
        return Pose(
            add(pose.position, (x, y, z)),
            multiply(quaternion_from_rotation_vector((rx, ry, rz)), pose.quaternion),
        )

    @property
    def q(self) -> Vector6:
        """Joint positions at the deviated pose [rad]."""
        deviation = self._pose
        if deviation is None:
            return self._undisturbed.q
        key = (self._undisturbed.q, deviation, self._motion.T_flange_tcp)
        if self._solved is None or self._solved[0] != key:
            self._solved = (key, self._solve(deviation))
        return self._solved[1]

    @property
    def tcp_twist(self) -> Vector6:
        """Twist of the tool centre point in base axes [m/s, rad/s]."""
        twist, deviation = self._undisturbed.tcp_twist, self._twist
        return twist if deviation is None else add6(twist, deviation)

    @property
    def qd(self) -> Vector6:
        """Joint speeds for the deviated twist [rad/s]."""
        deviation = self._twist
        if deviation is None:
            return self._undisturbed.qd
        return add6(self._undisturbed.qd, self._joint_change(deviation))

    @property
    def qdd(self) -> Vector6:
        """
        Joint accelerations [rad/s^2].

        On an imperfect arm they are the change of the measured speeds in the last cycle, with
        their noise. How a robot computes them is not published.
        """
        arm = self.imperfect_arm
        qdd = self._motion.qdd if arm is None else arm.qdd
        error = self.acceleration_error
        return add6(qdd, self._joint_change(error)) if any(error) else qdd

    def _solve(self, deviation: Vector6) -> Vector6:
        motion = self._motion
        T_base_flange = self.T_base_tcp @ motion.T_flange_tcp.inverse()
        undisturbed = self._undisturbed.q
        q = nearest(motion.arm, T_base_flange, undisturbed)
        if q is None or dist(q, undisturbed) > _BRANCH_JUMP:
            return add6(undisturbed, self._joint_change(deviation))
        return q

    def _joint_change(self, change: Vector6) -> Vector6:
        """Return the joint change for a small TCP change; at a singularity, by least squares."""
        jacobian = self._motion.arm.jacobian(self._undisturbed.q, self._motion.T_flange_tcp)
        return vector6(float(v) for v in np.linalg.pinv(jacobian, rcond=1e-6) @ change)


def _sum(a: Vector6 | None, b: Vector6 | None) -> Vector6 | None:
    if a is None or b is None:
        return b if a is None else a
    return add6(a, b)
