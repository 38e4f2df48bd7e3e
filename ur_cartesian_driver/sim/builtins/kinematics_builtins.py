# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Script functions that convert between joint positions and poses, and set the TCP."""

from __future__ import annotations

from ur_cartesian_driver.kinematics.inverse import nearest
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, Pose
from ur_cartesian_driver.motion.geometry.vectors import Vector6
from ur_cartesian_driver.sim.builtins.arguments import is_pose, pose, script_pose, six
from ur_cartesian_driver.sim.builtins.builtin_group import BuiltinGroup
from ur_cartesian_driver.sim.controller import Controller
from ur_cartesian_driver.urscript.script_errors import RuntimeException
from ur_cartesian_driver.urscript.script_values import ScriptPose, Value


def solve(
    controller: Controller, T_base_tcp: Pose, T_flange_tcp: Pose, near: Vector6
) -> Vector6 | None:
    """Return the joint positions nearest to ``near`` for a TCP pose; None = no solution."""
    return nearest(controller.arm, T_base_tcp @ T_flange_tcp.inverse(), near)


def joints_of(controller: Controller, value: Value, function: str) -> Vector6:
    """
    Return joint positions unchanged; convert a pose to its solution nearest to the present joints.

    :param function: name of the script function, for the error.
    :raises RuntimeException: the pose cannot be reached.
    """
    if not is_pose(value):
        return six(value, 'q')
    motion = controller.motion
    found = solve(controller, pose(value, 'pose'), motion.T_flange_tcp, motion.q)
    return _reached(found, function)


def _reached(q: Vector6 | None, function: str) -> Vector6:
    """Return the solution, or raise the robot's error if the pose has no solution."""
    if q is None:
        raise RuntimeException(
            'The robot cannot reach the requested pose. Script function '
            f'{function} is unable to find an inverse kinematics solution.'
        )
    return q


def pose_of(controller: Controller, value: Value, name: str) -> Pose:
    """Return a pose unchanged; convert joint positions to the TCP pose."""
    if is_pose(value):
        return pose(value, name)
    return controller.arm.forward(six(value, name)) @ controller.motion.T_flange_tcp


class KinematicsBuiltins(BuiltinGroup):
    """Forward and inverse kinematics."""

    def _tcp(self, tcp: Value) -> Pose:
        return self._controller.motion.T_flange_tcp if tcp == 'active_tcp' else pose(tcp, 'tcp')

    def _solve(self, x: Value, qnear: Value, tcp: Value) -> Vector6 | None:
        near = list(self._controller.motion.q) if qnear is None else qnear
        return solve(self._controller, pose(x, 'x'), self._tcp(tcp), six(near, 'qnear'))

    def get_inverse_kin(
        self,
        x: Value,
        qnear: Value = None,
        maxPositionError: Value = 1e-10,
        maxOrientationError: Value = 1e-10,
        tcp: Value = 'active_tcp',
    ) -> list[float]:
        """Return the joint solution nearest to `qnear` (by default, to the present joints)."""
        return list(_reached(self._solve(x, qnear, tcp), 'get_inverse_kin'))

    def get_inverse_kin_has_solution(
        self,
        pose: Value,
        qnear: Value = None,
        maxPositionError: Value = 1e-10,
        maxOrientationError: Value = 1e-10,
        tcp: Value = 'active_tcp',
    ) -> bool:
        """Return whether a pose can be reached."""
        return self._solve(pose, qnear, tcp) is not None

    def get_forward_kin(
        self, q: Value = 'current_joint_positions', tcp: Value = 'active_tcp'
    ) -> ScriptPose:
        """Return the pose of the TCP at joint positions (by default, at the present ones)."""
        joints = self._controller.motion.q if q == 'current_joint_positions' else six(q, 'q')
        return script_pose(self._controller.arm.forward(joints) @ self._tcp(tcp))

    def is_within_safety_limits(self, position: Value, qNear: Value = None) -> bool:
        """Return whether a pose can be reached; for joint positions, whether they are in range."""
        if is_pose(position):
            return self._solve(position, qNear, 'active_tcp') is not None
        limits = self._controller.arm.model.position_limits
        return all(
            low <= angle <= high
            for angle, (low, high) in zip(six(position, 'position'), limits, strict=True)
        )

    def get_actual_tcp_pose(self) -> ScriptPose:
        """Return the actual pose of the TCP."""
        return script_pose(self._controller.actual.T_base_tcp)

    def tool_pose(self) -> ScriptPose:
        """Return the actual pose of the TCP; programs that PolyScope saves use this name."""
        return self.get_actual_tcp_pose()

    def get_target_tcp_pose(self) -> ScriptPose:
        """Return the target pose of the TCP."""
        return script_pose(self._controller.target.T_base_tcp)

    def get_target_waypoint(self) -> ScriptPose:
        """Return the waypoint of the running move; if none runs, the target pose of the TCP."""
        motion, waypoint = self._controller.motion, self._controller.waypoint
        return script_pose(
            waypoint if waypoint is not None and motion.moving else motion.T_base_tcp
        )

    def get_actual_tool_flange_pose(self) -> ScriptPose:
        """Return the pose of the flange at the actual joint positions."""
        return script_pose(self._controller.arm.forward(self._controller.actual.q))

    def get_tcp_offset(self) -> ScriptPose:
        """Return the active TCP in the flange frame."""
        return script_pose(self._controller.motion.T_flange_tcp)

    def set_tcp(self, pose: Value, tcp_name: Value = '') -> None:
        """Set the active TCP."""
        offset = six(pose, 'pose')
        self._controller.motion.T_flange_tcp = (
            Pose.from_rotation_vector(offset) if any(offset) else IDENTITY
        )
