# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A goal in the simulated controller: where the tool is, and what its outputs are, by cycle."""

import numpy as np

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.planning import plan, PlanningOptions

ARM, STEP = Arm(robot_model('ur5e')), 0.002
HOME = (0.3, -1.4, 1.5, -1.6, -1.5, 0.2)
OPTIONS = PlanningOptions(max_tool_speed=1.0)
#: A zigzag that does not come near itself [m].
ZIGZAG = ((0.0, 0.03), (0.05, 0.05), (0.07, 0.0), (0.12, 0.02), (0.13, 0.07))


class TracedRun:
    """
    One run: the way of the tool [m] by cycle, and the edges of the standard digital outputs.

    :param goal: a goal, or a function that makes one from the pose at the start.
    :param slider: the speed slider by cycle.
    :param act: called after each cycle, with the controller and the number of the cycle.
    """

    def __init__(self, robot, goal, slider=lambda cycle: 1.0, act=lambda controller, cycle: None):
        state = robot.place(HOME, Pose((0.0, 0.02, 0.12)))
        self.goal = goal(state.actual_tcp_pose) if callable(goal) else goal
        self.plan = plan(self.goal, state, ARM, OPTIONS)
        outputs = robot.controller.io.digital_out.standard
        outputs[:] = [False] * 8
        before = list(outputs)
        #: Pin, whether the output rises, cycle.
        self.edges = []
        positions = [robot.controller.motion.T_base_tcp.position]

        def watch(controller):
            positions.append(controller.motion.T_base_tcp.position)
            for pin, (a, b) in enumerate(zip(before, outputs, strict=True)):
                if a != b:
                    self.edges.append((pin, b, len(positions) - 1))
            before[:] = outputs
            controller.set_slider(slider(len(positions)))
            act(controller, len(positions))

        robot.controller.set_slider(slider(0))
        run = robot.run(list(self.plan.instructions), on_cycle=watch)
        assert not run.failure, run.failure
        self.positions = np.array(positions)
        self.ways = np.append(
            0.0, np.cumsum(np.linalg.norm(np.diff(self.positions, axis=0), axis=1))
        )

    def way_of(self, point):
        """Return the way to where the tool is nearest to a point of the goal."""
        target = np.array(self.goal.waypoints[point].pose.position)
        a, step = self.positions[:-1], np.diff(self.positions, axis=0)
        square = np.maximum((step**2).sum(axis=1), 1e-300)
        u = np.clip(((target - a) * step).sum(axis=1) / square, 0.0, 1.0)
        k = int(np.argmin(np.linalg.norm(a + u[:, None] * step - target, axis=1)))
        return self.ways[k] + u[k] * np.sqrt(square[k])
