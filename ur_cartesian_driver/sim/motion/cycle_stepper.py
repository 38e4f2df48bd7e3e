# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
One cycle of a motion, as far as the arm can follow.

Limits stretch the time and keep the path: the step of a cycle is shortened if a joint would exceed
its speed limit or could not brake before the end of its range, or if the tool would be too fast.
"""

from __future__ import annotations

from math import inf, log
from typing import TypeAlias

from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import Vector6
from ur_cartesian_driver.sim.motion.arm_target import ArmTarget
from ur_cartesian_driver.sim.motion.cycle_batch import CycleBatch, CycleStep
from ur_cartesian_driver.sim.motion.kinematics.joint_kinematics import is_singular
from ur_cartesian_driver.sim.motion.motion_values import MotionFault
from ur_cartesian_driver.sim.motion.paths.move_paths import Setpoint
from ur_cartesian_driver.sim.motion.paths.path_motion import PathMotion
from ur_cartesian_driver.sim.motion.servo_motions import JointStopMotion, ServoLikeMotion

Motion: TypeAlias = PathMotion | ServoLikeMotion

#: A step that exceeds a limit by less than this factor is accepted, because of rounding.
ROUNDING = 1.0 + 1e-6
# A step is shortened this many times before its end is considered out of reach.
_ATTEMPTS = 12
# Near a singularity, half a step turns the joints almost as far as the whole step. A step that is
# too long by a factor is therefore divided by a power of the factor. These are the largest
# exponent, and the largest divisor as a multiple of the factor.
_MAX_POWER, _MAX_OVERCUT = 4.0, 2.0
# A tool motion is stuck if it stays slower than this fraction of the planned speed, ...
_STALLED = 0.01
# ... for longer than this [s], ...
_STALLED_AFTER = 1.0
# ... while no joint is faster than this fraction of its limit, as in passing a singularity.
_TURNING = 0.2
# A joint line whose first step is too long by more than this factor is a jump: the line does not
# begin at the joints at which the tool path before it has ended.
_JUMP_RATIO = 50.0


class CycleStepper:
    """Advances motions by one cycle."""

    def __init__(self, target: ArmTarget) -> None:
        """Begin with an arm that has not stalled."""
        self._target = target
        #: Whether the last set-point was a pose, solved by inverse kinematics.
        self._on_tool_path = False
        self._stalled_for = 0.0
        self._batch = CycleBatch(target)

    def forget_stall(self) -> None:
        """Restart the timer after which a motion is considered stalled."""
        self._stalled_for = 0.0

    def advance(
        self, motion: Motion, duration: float, max_tool_speed: float
    ) -> CycleStep | MotionFault:
        """
        Advance a motion by ``duration`` [s], or by less if the arm cannot follow.

        :param max_tool_speed: bound on the tool speed [m/s]; joint stops can exceed this bound.
        :returns: the step, or a fault if the arm cannot follow.
        """
        if isinstance(motion, PathMotion):
            solved = self._batch.next(motion, duration, max_tool_speed)
            if solved is not None:
                self._on_tool_path, self._stalled_for = self._batch.on_tool_path, 0.0
                return solved
        target = self._target
        setpoint: Setpoint = target.q
        h, before = duration, (duration, 0.0)
        arm = target.ik_branch()
        for _ in range(_ATTEMPTS):
            setpoint, state = motion.preview(h)
            q = arm.after(setpoint, h, lambda time: motion.preview(time)[0])
            if q is None:
                h *= 0.5
                continue
            is_pose = isinstance(setpoint, Pose)
            pose = self._pose(setpoint, q)
            joints = target.kinematics.overspeed_factor(q, target.q)
            tool = target.T_base_tcp.distance_to(pose) / (max_tool_speed * target.cycle)
            factor = max(joints, tool)
            if factor <= ROUNDING or (factor < inf and isinstance(motion, JointStopMotion)):
                if joints < _TURNING and self._stalls(is_pose and h < _STALLED * duration):
                    break
                motion.accept(state)
                self._on_tool_path = is_pose
                return CycleStep(q, pose, h)
            if factor == inf:
                break
            jumps = self._jumps(q, setpoint, joints)
            divisor = 2.0 if jumps else _step_divisor((h, factor), before)
            before, h = (h, factor), h / divisor
        return target.kinematics.motion_fault(target.q, arm.joints(setpoint))

    def _pose(self, setpoint: Setpoint, q: Vector6) -> Pose:
        """Return T_base_tcp at a set-point, at which the joints are ``q``."""
        if isinstance(setpoint, Pose) and self._target.tcp_is_active:
            return setpoint
        return self._target.forward(q)

    def _jumps(self, q: Vector6, setpoint: Setpoint, joints: float) -> bool:
        """Return whether a step jumps: a shorter step would turn the joints just as far."""
        if isinstance(setpoint, Pose):
            return is_singular(self._target.q, q, self._target.T_base_tcp, setpoint)
        return self._on_tool_path and joints > _JUMP_RATIO

    def _stalls(self, slow: bool) -> bool:
        """Return whether a tool motion has been slow for longer than ``_STALLED_AFTER``."""
        self._stalled_for = self._stalled_for + self._target.cycle if slow else 0.0
        return self._stalled_for > _STALLED_AFTER


def _step_divisor(step: tuple[float, float], before: tuple[float, float]) -> float:
    """
    Return the divisor that makes a step short enough, by the secant method in logarithms.

    :param step: the time of the step, and the factor by which the step is too long.
    :param before: the same two values for the step that was tried before.
    """
    (h, ratio), (h_before, ratio_before) = step, before
    if ratio_before <= ratio:
        return ratio
    power = log(h_before / h) / log(ratio_before / ratio)
    return min(float(ratio ** min(max(power, 1.0), _MAX_POWER)), _MAX_OVERCUT * ratio)
