# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The target of the arm in a cycle: position, motion and TCP."""

from __future__ import annotations

from math import inf
from typing import NamedTuple

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, Pose
from ur_cartesian_driver.motion.geometry.vectors import Vector6
from ur_cartesian_driver.sim.motion.kinematics.ik_branch import IkBranchTracker
from ur_cartesian_driver.sim.motion.kinematics.joint_kinematics import (
    difference_rate,
    JointKinematics,
    NO_CHANGE,
    STILL,
    twist_between,
)

#: Time of standing still after which an arm is steady [s].
STEADY_AFTER = 0.5


class TargetRates(NamedTuple):
    """Joint speeds [rad/s], joint accelerations [rad/s^2] and TCP twist (base axes)."""

    qd: Vector6
    qdd: Vector6
    twist: Vector6


class ArmTarget:
    """
    The target of the last cycle.

    It consists of ``q`` [rad], ``qd`` [rad/s], ``qdd`` [rad/s^2], ``T_base_tcp`` and ``tcp_twist``
    (base axes [m/s, rad/s]). Speeds are differences of positions over the cycle, so positions and
    speeds always agree.

    :param cycle: duration of a cycle [s].
    :param q: joint positions at the start [rad].
    """

    def __init__(self, arm: Arm, cycle: float, q: Vector6) -> None:
        """Begin at rest at ``q`` with the flange as TCP."""
        self.arm = arm
        self.cycle = cycle
        self.kinematics = JointKinematics(arm, cycle)
        self._T_flange_tcp = self._active_tcp = self.T_tcp_flange = IDENTITY
        self.q: Vector6 = q
        self.qd: Vector6 = STILL
        self._still_for: float = inf
        self.teleport(q)

    @property
    def T_flange_tcp(self) -> Pose:
        """The TCP; a motion that began before the TCP was set keeps the previous one."""
        return self._T_flange_tcp

    @T_flange_tcp.setter
    def T_flange_tcp(self, pose: Pose) -> None:
        self._T_flange_tcp = pose
        self.T_base_tcp = self.forward(self.q)

    def activate_tcp(self) -> None:
        """Use the present ``T_flange_tcp`` for the motion that begins now."""
        self.T_tcp_flange = self._T_flange_tcp.inverse()
        self._active_tcp = self._T_flange_tcp

    @property
    def tcp_is_active(self) -> bool:
        """Whether the running motion uses the present ``T_flange_tcp``."""
        return self._active_tcp is self._T_flange_tcp

    @property
    def steady(self) -> bool:
        """Whether the target has stood still for half a second."""
        return self._still_for >= STEADY_AFTER - 0.5 * self.cycle

    def forward(self, q: Vector6) -> Pose:
        """Return T_base_tcp at joint positions."""
        return self.arm.forward(q) @ self._T_flange_tcp

    def ik_branch(self) -> IkBranchTracker:
        """Return a tracker that starts from the present joints and their IK branch."""
        return IkBranchTracker(self.kinematics, self.q, self.T_base_tcp, self.T_tcp_flange)

    def move_to(self, q: Vector6, pose: Pose, rates: TargetRates | None = None) -> None:
        """
        Move the target to joint positions and to the TCP pose at them, in this cycle.

        :param rates: the speeds and accelerations; None = compute differences over the cycle.
        """
        if rates is None:
            rate = 1.0 / self.cycle
            qd = difference_rate(q, self.q, rate)
            rates = TargetRates(
                qd,
                difference_rate(qd, self.qd, rate),
                twist_between(self.T_base_tcp, pose, rate),
            )
        qd, self.qdd, self.tcp_twist = rates
        self.q, self.qd, self.T_base_tcp = q, qd, pose
        self._still_for = 0.0 if max(map(abs, qd)) > NO_CHANGE else self._still_for + self.cycle

    def hold(self) -> None:
        """Keep the target in place for this cycle."""
        self.qdd = difference_rate(STILL, self.qd, 1.0 / self.cycle)
        self.qd = self.tcp_twist = STILL
        self._still_for += self.cycle

    def copy(self) -> ArmTarget:
        """Return a target with the same position, motion and TCP."""
        other = ArmTarget(self.arm, self.cycle, self.q)
        other.T_flange_tcp = self._T_flange_tcp
        other.activate_tcp()
        other.take_over(self)
        return other

    def take_over(self, other: ArmTarget) -> None:
        """Copy the position and the motion of another target."""
        self.q, self.qd, self.qdd = other.q, other.qd, other.qdd
        self.T_base_tcp, self.tcp_twist = other.T_base_tcp, other.tcp_twist
        self._still_for = other._still_for

    def teleport(self, q: Vector6) -> None:
        """Stand still at joint positions [rad] without having moved there."""
        self.q, self.qd, self.qdd = q, STILL, STILL
        self.tcp_twist = STILL
        self.T_base_tcp = self.forward(q)
        self._still_for = inf
