# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A UR5e that stands somewhere with a tool, and goals around it."""

from __future__ import annotations

from math import pi

import pytest

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.geometry.pose import Pose, quaternion_from_rotation_vector
from ur_cartesian_driver.motion.goal.goal import Waypoint
from ur_cartesian_driver.motion.state.rtde_state import RobotState


class Cell:
    """The robot, where it stands, and points given from there."""

    def __init__(self, q=(0.0, -pi / 2, pi / 2, -pi / 2, -pi / 2, 0.0), model='ur5e'):
        self.arm = Arm(robot_model(model))
        self.T_flange_tcp = Pose((0.0, 0.02, 0.1), quaternion_from_rotation_vector((0.1, 0, 0.2)))
        self.state = RobotState(
            timestamp=0.0,
            actual_q=q,
            T_flange_tcp=self.T_flange_tcp,
            actual_tcp_pose=self.arm.forward(q) @ self.T_flange_tcp,
        )

    @property
    def home(self):
        return self.state.actual_tcp_pose

    def tool(self, q):
        """Return the TCP at joint positions."""
        return self.arm.forward(q) @ self.T_flange_tcp

    def pose(self, x=0.0, y=0.0, z=0.0, turn=(0.0, 0.0, 0.0)):
        """Return a pose moved from home along base axes [m], turned about tool axes [rad]."""
        a, b, c = self.home.position
        turned = Pose((0, 0, 0), self.home.quaternion) @ Pose(
            (0, 0, 0), quaternion_from_rotation_vector(turn)
        )
        return Pose((a + x, b + y, c + z), turned.quaternion)

    def point(self, x=0.0, y=0.0, z=0.0, time=0.0, turn=(0.0, 0.0, 0.0), **fields):
        """Return a waypoint at :meth:`pose`."""
        return Waypoint(pose=self.pose(x, y, z, turn), time=time, **fields)


@pytest.fixture(scope='session')
def cell():
    return Cell()


@pytest.fixture(scope='session')
def make_cell():
    return Cell
