# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Motions without a path: servoj, speedj, speedl and the two stops.

Each law can look ahead without going there (``preview``), because the generator may have to
shorten the step. Stops run in real time, whatever the speed scaling is, so that they always end;
the others run in scaled time.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot
from typing import Any, TypeAlias

from ur_cartesian_driver.motion.pose import (
    multiply,
    Pose,
    quaternion_from_rotation_vector,
    Vector3,
    Vector6,
)
from ur_cartesian_driver.sim.motion.move_paths import Setpoint

_JointState: TypeAlias = tuple[Vector6, Vector6, float]
_ToolState: TypeAlias = tuple[Pose, Vector6, float]
_MIN_SPEED = 1e-12
_ROUNDING = 1e-9
_STILL: Vector6 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@dataclass(slots=True)
class JointSpeedMotion:
    """
    speedj: the leading axis changes its speed at ``acceleration``, all reach theirs together.

    :param duration: [s] after which the call returns; None = when the speed is reached.
    """

    q: Vector6
    qd: Vector6
    target: Vector6
    acceleration: float
    duration: float | None
    elapsed: float = 0.0
    real_time = False

    def preview(self, h: float) -> tuple[Setpoint, _JointState]:
        """Return the place and state after ``h`` seconds; the mean speed carries."""
        change = _minus(self.target, self.qd)
        max_joint_difference = max(map(abs, change))
        full = (
            h
            if max_joint_difference <= _MIN_SPEED
            else min(h, max_joint_difference / self.acceleration)
        )
        part = (
            1.0
            if max_joint_difference <= self.acceleration * h
            else self.acceleration * h / max_joint_difference
        )
        qd = self.target if part >= 1.0 else _add(self.qd, change, part)
        # The change takes ``full`` seconds at the mean of both speeds, the rest is even.
        q = _add(_add(_add(self.q, self.qd, 0.5 * full), qd, 0.5 * full), qd, h - full)
        return q, (q, qd, self.elapsed + h)

    def accept(self, state: Any) -> None:
        """Go to a state that ``preview`` returned."""
        self.q, self.qd, self.elapsed = state

    @property
    def is_over(self) -> bool:
        """Whether the call may return."""
        if self.duration is None:  # at the speed already: hold it for a cycle, as any call does
            return self.elapsed > 0.0 and self.qd == self.target
        return self.elapsed >= self.duration - _ROUNDING


@dataclass(slots=True)
class ServoMotion:
    """
    servoj: qdd = gain (q_target - (q + lookahead qd)), limited.

    The law is not published. This one is what the manual's words say: ``gain`` is a proportional
    term, ``lookahead`` projects the present position along the present speed. It follows a ramp
    with a lag of exactly ``lookahead``; natural frequency sqrt(gain), damping
    lookahead sqrt(gain) / 2.
    """

    q: Vector6
    qd: Vector6
    target: Vector6
    duration: float
    lookahead: float
    gain: float
    max_acceleration: float
    elapsed: float = 0.0
    real_time = False

    def preview(self, h: float) -> tuple[Setpoint, _JointState]:
        """Return the place and state after ``h`` seconds (semi-implicit Euler)."""
        bound = self.max_acceleration
        qd = _six(
            [
                v + h * min(max(self.gain * (wanted - (q + self.lookahead * v)), -bound), bound)
                for q, v, wanted in zip(self.q, self.qd, self.target, strict=True)
            ]
        )
        q = _add(self.q, qd, h)
        return q, (q, qd, self.elapsed + h)

    def accept(self, state: Any) -> None:
        """Go to a state that ``preview`` returned."""
        self.q, self.qd, self.elapsed = state

    @property
    def is_over(self) -> bool:
        """Whether the call may return."""
        return self.elapsed >= self.duration - _ROUNDING


@dataclass(slots=True)
class JointStopMotion:
    """stopj: the leading axis brakes at ``acceleration`` [rad/s^2], all stand at the same time."""

    q: Vector6
    qd: Vector6
    acceleration: float
    real_time = True

    def preview(self, h: float) -> tuple[Setpoint, _JointState]:
        """Return the place and state after ``h`` seconds."""
        time = max(map(abs, self.qd)) / self.acceleration
        if time <= h:
            q = _add(self.q, self.qd, 0.5 * time)
            return q, (q, _STILL, 0.0)
        part = 1.0 - h / time
        q = _add(self.q, self.qd, 0.5 * h * (1.0 + part))
        return q, (q, _add(_STILL, self.qd, part), 0.0)

    def accept(self, state: Any) -> None:
        """Go to a state that ``preview`` returned."""
        self.q, self.qd, _ = state

    @property
    def is_over(self) -> bool:
        """Whether the arm stands."""
        return self.qd == _STILL


@dataclass(slots=True)
class ToolSpeedMotion:
    """
    speedl: the tool's speed changes at ``acceleration``, its rotation at ``acceleration_rot``.

    :param twist: now and ``target``, base axes [m/s, rad/s].
    """

    pose: Pose
    twist: Vector6
    target: Vector6
    acceleration: float
    acceleration_rot: float
    duration: float | None
    elapsed: float = 0.0
    real_time = False

    def preview(self, h: float) -> tuple[Setpoint, _ToolState]:
        """Return the place and state after ``h`` seconds."""
        twist = _approach_twist(
            self.twist, self.target, self.acceleration * h, self.acceleration_rot * h
        )
        pose = _integrated_pose(self.pose, self.twist, twist, h)
        return pose, (pose, twist, self.elapsed + h)

    def accept(self, state: Any) -> None:
        """Go to a state that ``preview`` returned."""
        self.pose, self.twist, self.elapsed = state

    @property
    def is_over(self) -> bool:
        """Whether the call may return."""
        if self.duration is None:  # at the speed already: hold it for a cycle, as any call does
            return self.elapsed > 0.0 and self.twist == self.target
        return self.elapsed >= self.duration - _ROUNDING


@dataclass(slots=True)
class ToolStopMotion:
    """stopl: the tool brakes along its tangent, its rotation at ``acceleration_rot``."""

    pose: Pose
    twist: Vector6
    acceleration: float
    acceleration_rot: float
    real_time = True

    def preview(self, h: float) -> tuple[Setpoint, _ToolState]:
        """Return the place and state after ``h`` seconds."""
        twist = _approach_twist(
            self.twist, _STILL, self.acceleration * h, self.acceleration_rot * h
        )
        pose = _integrated_pose(self.pose, self.twist, twist, h)
        return pose, (pose, twist, 0.0)

    def accept(self, state: Any) -> None:
        """Go to a state that ``preview`` returned."""
        self.pose, self.twist, _ = state

    @property
    def is_over(self) -> bool:
        """Whether the arm stands."""
        return self.twist == _STILL


def _approach_twist(twist: Vector6, target: Vector6, step: float, step_rot: float) -> Vector6:
    linear = _approach(twist[:3], target[:3], step)
    angular = _approach(twist[3:], target[3:], step_rot)
    return (*linear, *angular)


def _approach(now: Vector3, target: Vector3, step: float) -> Vector3:
    """Return the vector a step nearer to the target, or the target."""
    x, y, z = (b - a for a, b in zip(now, target, strict=True))
    size = hypot(x, y, z)
    if size <= step:
        return target
    f = step / size
    return (now[0] + f * x, now[1] + f * y, now[2] + f * z)


def _integrated_pose(pose: Pose, before: Vector6, after: Vector6, h: float) -> Pose:
    """Move a pose for ``h`` seconds at the mean of two twists."""
    half = 0.5 * h
    vx, vy, vz, wx, wy, wz = (half * (a + b) for a, b in zip(before, after, strict=True))
    x, y, z = pose.position
    turn = quaternion_from_rotation_vector((wx, wy, wz))
    return Pose((x + vx, y + vy, z + vz), multiply(turn, pose.quaternion))


def _add(a: Vector6, b: Vector6, f: float) -> Vector6:
    return (
        a[0] + f * b[0],
        a[1] + f * b[1],
        a[2] + f * b[2],
        a[3] + f * b[3],
        a[4] + f * b[4],
        a[5] + f * b[5],
    )


def _minus(a: Vector6, b: Vector6) -> Vector6:
    return _add(a, b, -1.0)


def _six(values: list[float]) -> Vector6:
    a, b, c, d, e, f = values
    return (a, b, c, d, e, f)
