# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A goal in the simulated controller: the place of the tool and the outputs, by cycle."""

from dataclasses import replace

import numpy as np

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.planning.append.append_planner import plan_append, plan_first_part
from ur_cartesian_driver.planning.append.appendable_goal import AppendedPoints

ARM, STEP = Arm(robot_model('ur5e')), 0.002
HOME, TOOL = (0.3, -1.4, 1.5, -1.6, -1.5, 0.2), Pose((0.0, 0.02, 0.12))
OPTIONS = PlanningOptions(max_tool_speed=1.0)
#: A zigzag that does not come near itself [m].
ZIGZAG = ((0.0, 0.03), (0.05, 0.05), (0.07, 0.0), (0.12, 0.02), (0.13, 0.07))


def instructions_of(goal, state, sizes=()):
    """
    Return the records of a goal, as the robot program gets them.

    :param sizes: as for :class:`TracedRun`. Pulses to the last point are as in an open goal.
    """
    if not sizes:
        return list(plan(goal, state, ARM, OPTIONS).instructions)
    count, end = len(goal.waypoints), sizes[0]
    trains = tuple(
        replace(train, last_waypoint=end - 1) if train.last_waypoint == count - 1 else train
        for train in goal.pulses
    )
    whole = replace(goal, pulses=trains, keep_open=True)
    part = plan_first_part(
        plan(replace(whole, **_points(goal, 0, end)), state, ARM, OPTIONS), ARM, OPTIONS
    )
    records = list(part.plan.instructions)
    for size in sizes[1:]:
        points = AppendedPoints(**_points(goal, end, end + size), last=end + size == count)
        part = plan_append(part.next_goal, points, ARM, OPTIONS, from_rest=False)
        records[part.records_before :] = part.plan.instructions
        end += size
    return records


def _points(goal, begin, end):
    """Return the fields of a goal that belong to its points from ``begin`` to ``end``."""
    return {
        'waypoints': goal.waypoints[begin:end],
        'segments': goal.segments[begin:end],
        'io_commands': tuple(c for c in goal.io_commands if begin <= c.waypoint < end),
    }


class TracedRun:
    """
    One run: the way of the tool [m] by cycle, and the edges of the standard digital outputs.

    :param goal: a goal, or a function that makes a goal from the start pose.
    :param slider: the speed slider by cycle.
    :param act: called after each cycle, with the controller and the number of the cycle.
    :param sizes: the numbers of points that are sent together; all but the first are appended;
        empty = all points are sent at once.
    """

    def __init__(
        self,
        robot,
        goal,
        slider=lambda cycle: 1.0,
        act=lambda controller, cycle: None,
        sizes=(),
    ):
        #: The goal that was run, and the position of the tool by cycle (n, 3) [m].
        self.goal, self.positions, outputs = self._trace(robot, goal, slider, act, sizes)
        changes = np.diff(np.array(outputs, dtype=int), axis=0)
        #: The edges: pin, whether the output rises, cycle.
        self.edges = [
            (int(pin), bool(changes[k, pin] > 0), int(k) + 1) for k, pin in np.argwhere(changes)
        ]
        self.ways = np.append(
            0.0, np.cumsum(np.linalg.norm(np.diff(self.positions, axis=0), axis=1))
        )

    def _trace(self, robot, goal, slider, act, sizes):
        state = robot.place(HOME, TOOL)
        goal = goal(state.actual_tcp_pose) if callable(goal) else goal
        instructions = instructions_of(goal, state, sizes)
        bits = robot.controller.io.digital_out.standard
        bits[:] = [False] * 8
        positions, outputs = [robot.controller.motion.T_base_tcp.position], [list(bits)]

        def watch(controller):
            positions.append(controller.motion.T_base_tcp.position)
            outputs.append(list(bits))
            controller.set_slider(slider(len(positions)))
            act(controller, len(positions))

        robot.controller.set_slider(slider(0))
        run = robot.run(instructions, on_cycle=watch)
        assert not run.failure, run.failure
        return goal, np.array(positions), outputs

    def way_of(self, point):
        """Return the way at which the tool is nearest to a point of the goal."""
        target = np.array(self.goal.waypoints[point].pose.position)
        a, step = self.positions[:-1], np.diff(self.positions, axis=0)
        square = np.maximum((step**2).sum(axis=1), 1e-300)
        u = np.clip(((target - a) * step).sum(axis=1) / square, 0.0, 1.0)
        k = int(np.argmin(np.linalg.norm(a + u[:, None] * step - target, axis=1)))
        return self.ways[k] + u[k] * np.sqrt(square[k])
