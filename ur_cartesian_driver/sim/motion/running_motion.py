# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The running motion of the arm, and its replacement by another motion or a stop."""

from __future__ import annotations

from ur_cartesian_driver.motion.geometry.vectors import scale6, Vector6
from ur_cartesian_driver.sim.motion.arm_target import ArmTarget
from ur_cartesian_driver.sim.motion.cycle_stepper import Motion
from ur_cartesian_driver.sim.motion.kinematics.joint_kinematics import STILL
from ur_cartesian_driver.sim.motion.motion_values import Move
from ur_cartesian_driver.sim.motion.servo_motions import (
    JointSpeedMotion,
    JointStopMotion,
    ServoLikeMotion,
    ServoMotion,
    SetpointMotion,
    ToolSpeedMotion,
    ToolStopMotion,
)

#: Deceleration [rad/s^2] if a path move is called during a servo-like motion: a path can begin
#: only at rest or in a blend.
UNATTENDED_DECELERATION = 15.0


class RunningMotion:
    """
    The running motion and its call; also computes the speeds from which the next motion begins.

    :param target: the target of the arm.
    :param set_point_deceleration: deceleration if no further servoj set-point comes [rad/s^2].
    """

    def __init__(self, target: ArmTarget, set_point_deceleration: float) -> None:
        """Begin at rest."""
        self._target, self._set_point_deceleration = target, set_point_deceleration
        self.motion: Motion | None = None
        self.move: Move | None = None
        #: The speed scaling of the last cycle: ``scale`` was requested, ``rate`` was achieved.
        self.scale = self.rate = 1.0

    @property
    def moving(self) -> bool:
        """Whether the target moved in the last cycle or is about to move."""
        return self.motion is not None or self._target.qd != STILL

    @property
    def setpoints_are_late(self) -> bool:
        """Whether a stream of set-points has not been continued in time."""
        return isinstance(self.motion, SetpointMotion) and self.motion.is_over

    def replace(self, motion: ServoLikeMotion) -> Move:
        """Run a servo-like motion from now on, and return its call."""
        self.abort()
        self._target.activate_tcp()
        if not isinstance(self.motion, SetpointMotion):
            # The new motion begins at a nominal speed which, times this rate, is the present
            # speed.
            self.rate = self.scale
        self.motion, self.move = motion, Move()
        if isinstance(motion, SetpointMotion) and motion.duration is not None:
            self.move.returned = motion.is_over
        return self.move

    def abort(self) -> None:
        """Make the running call return."""
        if self.move is not None:
            self.move.returned = True

    def hold(self) -> None:
        """Stay in place for this cycle; the requested speed scaling is reported as achieved."""
        self._target.hold()
        self.rate = self.scale

    def brake_unattended(self) -> None:
        """Brake, because no further set-point has come in time."""
        motion = self.motion
        if isinstance(motion, ToolSpeedMotion):
            self.motion = self.tool_stop(motion.acceleration, motion.acceleration_rot)
        elif isinstance(motion, JointSpeedMotion):
            self.motion = self.joint_stop(motion.acceleration)
        else:
            self.motion = self.joint_stop(self._set_point_deceleration)

    def joint_stop(self, a: float) -> JointStopMotion:
        """Return the motion that stops the joints from their present speed, in unscaled time."""
        return JointStopMotion(self._target.q, self._joint_speed(), a)

    def tool_stop(self, a: float, a_rot: float) -> ToolStopMotion:
        """Return the motion that stops the tool along its tangent, in unscaled time."""
        return ToolStopMotion(self._target.T_base_tcp, self._twist(), a, a_rot)

    def nominal_joint_speed(self) -> Vector6:
        """Return the present joint speed divided by the speed scaling."""
        if isinstance(self.motion, JointSpeedMotion | ServoMotion):
            return self.motion.qd
        return self._unscaled(self._joint_speed())

    def nominal_twist(self) -> Vector6:
        """Return the present twist of the TCP divided by the speed scaling."""
        if isinstance(self.motion, ToolSpeedMotion):
            return self.motion.twist
        return self._unscaled(self._twist())

    def _joint_speed(self) -> Vector6:
        """Return the joint speed after the last cycle; on a path, the mean speed in that cycle."""
        motion = self.motion
        if motion is None or isinstance(motion, JointStopMotion):
            return STILL if motion is None else motion.qd
        if isinstance(motion, JointSpeedMotion | ServoMotion):
            return scale6(motion.qd, self.rate)
        return self._target.qd

    def _twist(self) -> Vector6:
        """Return the TCP twist after the last cycle; on a path, the mean twist in that cycle."""
        motion = self.motion
        if motion is None or isinstance(motion, ToolStopMotion):
            return STILL if motion is None else motion.twist
        if isinstance(motion, ToolSpeedMotion):
            return scale6(motion.twist, self.rate)
        return self._target.tcp_twist

    def _unscaled(self, speed: Vector6) -> Vector6:
        if self.motion is None or self.scale <= 0.0:
            return STILL
        return scale6(speed, 1.0 / self.scale)
