# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The kinematics of an arm that leads a held part along a tool that is fixed in the cell.

The path is given as poses of the tool in a frame on the part. The position p of the tool is fixed
in base. The point of the part that is at p has the velocity v and the acceleration a, and the part
turns at the rate w, all in the axes of the part. So the tool moves in the part with the velocity
-v and the turn rate -w. Because the part turns and its point at p changes, the acceleration of the
tool in the part is -(a - 2 w x v).
"""

from __future__ import annotations

from math import hypot

import numpy as np

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.differential_kinematics import (
    joint_rates,
    largest_joint_rates,
    StandingPoint,
    tool_rates,
)
from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.pose_rows import (
    compose_rows,
    conjugate_rows,
    cross_rows,
    inverse_rows,
    length_rows,
    rotate_rows,
    transform_rows,
)
from ur_cartesian_driver.motion.goal.moving_frame import MovingFrame
from ur_cartesian_driver.planning.geometry.curves import tcp_rows
from ur_cartesian_driver.planning.preflight.tcp_kinematics import TcpKinematics


class HeldPartKinematics(TcpKinematics):
    """
    The kinematics of a path in a frame on a part that the flange carries.

    :param T_flange_tcp: the active TCP, whose speed in base is limited, too.
    :param frame: the frame on the part, in the flange frame, and the pose of the tool in base.
    """

    frame_moves = True

    def __init__(self, arm: Arm, T_flange_tcp: Pose, frame: MovingFrame) -> None:
        """Prepare the transforms."""
        super().__init__(arm, T_flange_tcp)
        self._frame = frame
        self._T_frame_flange = frame.T_flange_frame.inverse()
        self._T_tool_base = frame.T_base_tool.inverse()
        self._point = StandingPoint(frame.T_base_tool.position)

    def flange(self, T_frame_tool: Pose) -> Pose:
        """Return the flange pose for a pose of the tool in the frame."""
        return self._frame.flange(T_frame_tool)

    def flange_rows(self, poses: Floats) -> Floats:
        """Return the flange poses (n, 7) for poses of the tool in the frame (n, 7)."""
        T_base_frame = transform_rows(self._frame.T_base_tool, inverse_rows(poses))
        return compose_rows(T_base_frame, self._T_frame_flange)

    def tcp(self, T_frame_tool: Pose) -> Pose:
        """Return the pose of the TCP in base for a pose of the tool in the frame."""
        return self.flange(T_frame_tool) @ self.T_flange_tcp

    def tcp_poses(self, poses: Floats) -> Floats:
        """Return the poses of the TCP in base (n, 7) for poses of the tool in the frame (n, 7)."""
        return compose_rows(self.flange_rows(poses), self.T_flange_tcp)

    @property
    def of_tcp(self) -> TcpKinematics:
        """The kinematics of the TCP in base, whose poses the robot receives."""
        return TcpKinematics(self.arm, self.T_flange_tcp)

    def pose_rows(self, q: Floats) -> Floats:
        """Return the poses of the tool in the frame (n, 7) at joint positions (n, 6) [rad]."""
        T_base_frame = tcp_rows(self.arm, self._frame.T_flange_frame, q)
        return inverse_rows(transform_rows(self._T_tool_base, T_base_frame))

    def tool_rates(self, q: Floats, qd: Floats, qdd: Floats) -> tuple[Floats, Floats]:
        """
        Return twist and acceleration (n, 6) of the tool in the frame on the part.

        The arguments are joint positions, velocities and accelerations, (n, 6) each.
        """
        twist, acceleration = tool_rates(self.arm, self._point, q, qd, qdd)
        acceleration[:, :3] -= _twice_turned(twist)
        to_frame = conjugate_rows(self._orientations(q))
        return -_turned(to_frame, twist), -_turned(to_frame, acceleration)

    def joint_rates(self, q: Floats, twist: Floats, acceleration: Floats) -> tuple[Floats, Floats]:
        """Return joint velocities and accelerations (n, 6); the inverse of :meth:`tool_rates`."""
        to_base = self._orientations(q)
        there, acceleration = -_turned(to_base, twist), -_turned(to_base, acceleration)
        acceleration[:, :3] += _twice_turned(there)
        return joint_rates(self.arm, self._point, q, there, acceleration)

    def largest_joint_rates(
        self, q: Floats, rates: tuple[float, float], accelerations: tuple[float, float]
    ) -> tuple[Floats, Floats]:
        """
        Return bounds of the joint velocities and accelerations (n, 6).

        :param rates: bounds on the linear and angular velocity of the tool in the frame on the
            part [m/s], [rad/s].
        :param accelerations: bounds on its accelerations [m/s^2], [rad/s^2].
        """
        linear, angular = accelerations
        changed = linear + 2.0 * rates[0] * rates[1], angular
        return largest_joint_rates(self.arm, self._point, q, rates, changed)

    def carrier_speeds(self, q: Floats, qd: Floats) -> Floats | None:
        """Return the speeds of the TCP in base (n,) [m/s]."""
        twist, _ = tool_rates(self.arm, self.T_flange_tcp, q, qd, np.zeros_like(qd))
        return length_rows(twist[:, :3])

    @property
    def reach(self) -> float:
        """Upper bound of the distance between the tool and the frame on the part [m]."""
        lever = hypot(*self._frame.T_flange_frame.position)
        return self.arm.model.max_reach + hypot(*self._frame.T_base_tool.position) + lever

    def _orientations(self, q: Floats) -> Floats:
        """Return the orientations of the frame in base (n, 4)."""
        orientations: Floats = tcp_rows(self.arm, self._frame.T_flange_frame, q)[:, 3:]
        return orientations


def kinematics_of(frame: MovingFrame | None, arm: Arm, T_flange_tcp: Pose) -> TcpKinematics:
    """Return the kinematics of a path in ``frame``; None = the path is given in base."""
    if frame is None:
        return TcpKinematics(arm, T_flange_tcp)
    return HeldPartKinematics(arm, T_flange_tcp, frame)


def _turned(orientations: Floats, rates: Floats) -> Floats:
    """Return linear and angular rates (n, 6) turned by orientations (n, 4)."""
    return np.concatenate(
        [rotate_rows(orientations, rates[:, :3]), rotate_rows(orientations, rates[:, 3:])], axis=1
    )


def _twice_turned(twist: Floats) -> Floats:
    """Return 2 w x v (n, 3) of twists (n, 6)."""
    return 2.0 * cross_rows(twist[:, 3:], twist[:, :3])
