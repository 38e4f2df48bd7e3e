# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A goal by set-points in a cell in virtual time, and RTDE's reports of its motion."""

from dataclasses import replace

import numpy as np

from ur_cartesian_driver.driver.ipc.channel import ArmSetup
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import Goal, Waypoint
from ur_cartesian_driver.planning import plan, PlanningOptions

ARM = Arm(robot_model('ur5e'))
SETUP = ArmSetup.of(ARM)


class RecordedGoal:
    """A started goal, and all reported states until its end."""

    def __init__(self, cell, goal):
        self.cell, self.states = cell, []
        state = cell.memory.read()
        self.start = np.array(state.actual_tcp_pose.position)
        self.motion = cell.owner.start(plan(goal, state, ARM, PlanningOptions()), arm=SETUP)

    @classmethod
    def along_y(cls, cell, length, duration, **fields):
        """Start a straight line of a length [m] that takes a time [s]."""
        pose = cell.memory.read().actual_tcp_pose
        x, y, z = pose.position
        there = replace(pose, position=(x, y + length, z))
        goal = Goal(
            waypoints=(Waypoint(pose=there, time=duration),), execution=ExecutionMode.SERVO
        )
        return cls(cell, replace(goal, **fields))

    async def end(self):
        """Return the outcome."""
        return await self.cell.record(self.motion, self.states)

    @property
    def target(self):
        """The controller's target relative to the start (n, 3) [m]."""
        return np.array([state.target_tcp_pose.position for state in self.states]) - self.start

    @property
    def times(self):
        """The times of the reported states (n,) [s]."""
        return np.array([state.timestamp for state in self.states])
