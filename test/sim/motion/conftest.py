# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A generator on a UR5e, and a recording of its motion cycle by cycle."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import pi

import numpy as np
import pytest

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.twin.laws import MotionLaws
from ur_cartesian_driver.sim.calibration import random_calibration
from ur_cartesian_driver.sim.motion import MotionGenerator

HOME = (0.0, -pi / 2, pi / 2, -pi / 2, -pi / 2, 0.0)


@dataclass
class Recorder:
    """Steps a generator and keeps a sample of each cycle, the one before the first included."""

    generator: MotionGenerator
    poses: list = field(default_factory=list)
    joints: list = field(default_factory=list)
    twists: list = field(default_factory=list)

    def __post_init__(self):
        self.keep()

    def keep(self):
        self.poses.append(self.generator.T_base_tcp)
        self.joints.append(self.generator.q)
        self.twists.append(self.generator.tcp_twist)

    def step(self, scale=1.0, times=1):
        for _ in range(times):
            self.generator.step(scale)
            self.keep()

    def run(self, move, scale=lambda i: 1.0, limit=20000):
        """Step until the call returns or fails; return the number of cycles."""
        count = 0
        while not move.returned and self.generator.fault is None:
            assert count < limit, 'the call does not return'
            self.step(scale(count))
            count += 1
        return count

    def rest(self, limit=20000):
        """Step until nothing moves."""
        while self.generator.moving:
            assert limit > 0, 'the arm does not come to rest'
            self.step()
            limit -= 1

    @property
    def q(self):
        return np.array(self.joints)

    @property
    def positions(self):
        return np.array([pose.position for pose in self.poses])

    def speeds(self):
        return np.diff(self.q, axis=0) / self.generator.cycle

    def tool_speeds(self):
        return np.diff(self.positions, axis=0) / self.generator.cycle


#: The ratio of the manual.
LAWS = MotionLaws(turn_ratio=1.0)


@pytest.fixture(scope='session')
def arm():
    return Arm(robot_model('ur5e'))


@pytest.fixture(scope='session')
def recorder(arm):
    """A maker of recorders, usable from hypothesis tests too."""
    calibrated_arm = Arm(arm.model, random_calibration(arm.model, 1))

    def make(q=HOME, cycle=0.002, calibrated=False, laws=LAWS):
        return Recorder(MotionGenerator(calibrated_arm if calibrated else arm, cycle, q, laws))

    return make


@pytest.fixture(scope='session')
def shifted():
    """A maker of poses moved by x, y, z [m] and turned by a rotation vector in the tool."""

    def shift(pose, x=0.0, y=0.0, z=0.0, turn=(0.0, 0.0, 0.0)):
        px, py, pz = pose.position
        return Pose((px + x, py + y, pz + z), pose.quaternion) @ Pose.from_rotation_vector(
            (0.0, 0.0, 0.0, *turn)
        )

    return shift
