# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Goals whose frame moves: the arm holds a part, and leads it along a tool that is fixed in the cell.

The path of every goal is the pose of a tool in the frame of the goal. Usually the frame is fixed
in the base, and the flange carries the tool. With a :class:`MovingFrame` it is the other way
round: the flange carries the frame, and the tool is fixed in the base. The path, its speed,
corners and tolerances are still relative to the frame. Only the conversions from a pose on the
path to a pose of the flange, and back, differ; any other carrier of a frame (a turntable, a rail)
would need the same two conversions.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from ur_cartesian_driver.motion.geometry.pose import conjugate, Pose, Quaternion, rotate
from ur_cartesian_driver.motion.geometry.vectors import cross, scale, subtract, Vector3, Vector6
from ur_cartesian_driver.motion.state.rigid_body import acceleration_at, twist_at
from ur_cartesian_driver.motion.state.rtde_state import RobotState


@dataclass(frozen=True, slots=True, kw_only=True)
class MovingFrame:
    """The frame of a goal on a part that the flange holds, and a tool that is fixed in base."""

    T_flange_frame: Pose
    T_base_tool: Pose

    def frame(self, T_base_flange: Pose) -> Pose:
        """Return the pose of the frame in base."""
        return T_base_flange @ self.T_flange_frame

    def tool(self, T_base_flange: Pose) -> Pose:
        """Return the pose of the tool in the frame."""
        return self.frame(T_base_flange).inverse() @ self.T_base_tool

    def frame_under(self, T_frame_tool: Pose) -> Pose:
        """Return the pose of the frame in base from the pose of the tool in the frame."""
        return self.T_base_tool @ T_frame_tool.inverse()

    def flange(self, T_frame_tool: Pose) -> Pose:
        """Return the pose of the flange in base from the pose of the tool in the frame."""
        return self.frame_under(T_frame_tool) @ self.T_flange_frame.inverse()

    def flange_shift(self, T_base_flange: Pose, shift: Vector3) -> Vector3:
        """Return the shift of the flange in base [m] for a shift of the tool in the frame [m]."""
        return scale(rotate(self.frame(T_base_flange).quaternion, shift), -1.0)

    def seen(self, state: RobotState) -> RobotState:
        """
        Return the state with the tool's poses and rates in the frame, not the TCP's in base.

        Joints and ``T_flange_tcp`` stay as they are, and the wrench stays in base.
        """
        T_flange_tcp = state.T_flange_tcp
        actual, actual_twist, actual_acceleration = self._motion(
            state.actual_tcp_pose,
            T_flange_tcp,
            state.actual_tcp_twist,
            state.actual_tcp_acceleration,
        )
        target, target_twist, target_acceleration = self._motion(
            state.target_tcp_pose,
            T_flange_tcp,
            state.target_tcp_twist,
            state.target_tcp_acceleration,
        )
        return replace(
            state,
            actual_tcp_pose=actual,
            actual_tcp_twist=actual_twist,
            actual_tcp_acceleration=actual_acceleration,
            target_tcp_pose=target,
            target_tcp_twist=target_twist,
            target_tcp_acceleration=target_acceleration,
        )

    def _motion(
        self, T_base_tcp: Pose, T_flange_tcp: Pose, twist: Vector6, acceleration: Vector6 | None
    ) -> tuple[Pose, Vector6, Vector6 | None]:
        """Return pose, twist and acceleration of the tool in the frame, from the TCP's in base."""
        T_base_frame = self.frame(T_base_tcp @ T_flange_tcp.inverse())
        offset = subtract(self.T_base_tool.position, T_base_tcp.position)
        # Seen from the frame, the tool moves opposite to the frame's own motion at the tool.
        there = twist_at(twist, offset)
        turned = conjugate(T_base_frame.quaternion)
        relative = None
        if acceleration is not None:
            a = acceleration_at(acceleration, twist, offset)
            relative = _reversed(turned, _as_seen(a, there))
        return T_base_frame.inverse() @ self.T_base_tool, _reversed(turned, there), relative


def _as_seen(acceleration: Vector6, twist: Vector6) -> Vector6:
    """
    Return a - 2 w x v: the negative acceleration of a fixed point, as seen from a moving body.

    At the point, the body has the velocity v and the acceleration a, and it turns at w. Seen from
    the body, the point moves with -v; 2 w x v is the Coriolis term.
    """
    a, v, w = acceleration[:3], twist[:3], twist[3:]
    return (*subtract(a, scale(cross(w, v), 2.0)), *acceleration[3:])


def _reversed(q_frame_base: Quaternion, rates: Vector6) -> Vector6:
    """Return the opposite of linear and angular rates, in the axes of the frame."""
    linear, angular = (scale(rotate(q_frame_base, part), -1.0) for part in (rates[:3], rates[3:]))
    return (*linear, *angular)
