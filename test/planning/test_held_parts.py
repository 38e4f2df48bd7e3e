# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A part that the tool has taken must not touch anything either."""

from math import pi

import pytest

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.cell.cell import Cell, CellBody, PlacedShape
from ur_cartesian_driver.motion.cell.shapes import Box, Sphere
from ur_cartesian_driver.motion.errors import CollisionPredicted
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.goal import Goal, PartAction, PartChange, Waypoint
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.planning import plan, PlanningOptions

ATTACH = PartChange(waypoint=0, body='part')
RELEASE = PartChange(waypoint=0, body='part', action=PartAction.RELEASE)


def test_a_held_part_must_not_touch_where_the_empty_tool_may():
    """A long part below the flange reaches the shelf under the path."""
    arm, q = Arm(robot_model('ur5e')), (0.0, -pi / 2, pi / 2, -pi / 2, -pi / 2, 0.0)
    home = arm.forward(q)
    state = RobotState(timestamp=0.0, actual_q=q, T_flange_tcp=Pose(), actual_tcp_pose=home)
    x, y, z = home.position

    def pose(dx, dz):
        return Pose((x, y + dx, z + dz), home.quaternion)

    stick = CellBody(
        name='part',
        shapes=(PlacedShape(Box((0.02, 0.02, 0.2))),),
        T_frame_body=Pose((x, y, z - 0.15)),
    )
    shelf = CellBody(
        name='shelf',
        shapes=(PlacedShape(Box((0.3, 0.1, 0.02))),),
        T_frame_body=Pose((x, y + 0.25, z - 0.18)),
    )
    options = PlanningOptions(cell=Cell(bodies=(stick, shelf)))
    waypoints = (Waypoint(pose=pose(0.0, -0.02)), Waypoint(pose=pose(0.25, -0.02)))
    free = Goal(waypoints=waypoints)
    plan(free, state, arm, options)
    with pytest.raises(CollisionPredicted, match='part'):
        plan(Goal(waypoints=waypoints, part_changes=(ATTACH,)), state, arm, options)
    # Put down at once, the part stays behind.
    changes = (ATTACH, RELEASE)
    plan(Goal(waypoints=waypoints, part_changes=changes), state, arm, options)


def test_a_body_on_the_active_tcp_does_not_follow_another_controlled_frame():
    arm, q = Arm(robot_model('ur5e')), (0.0, -pi / 2, pi / 2, -pi / 2, -pi / 2, 0.0)
    tcp, controlled = Pose((0.0, 0.0, 0.1)), Pose((0.0, 0.0, 0.3))
    state = RobotState(
        timestamp=0.0, actual_q=q, T_flange_tcp=tcp, actual_tcp_pose=arm.forward(q) @ tcp
    )
    start = arm.forward(q) @ controlled
    x, y, z = start.position
    tip = CellBody(name='tip', shapes=(PlacedShape(Sphere(0.02)),), frame='tool0_controller')

    def shelf(height):
        """A board whose top is at a height, along the whole path."""
        board = PlacedShape(Box((0.3, 0.6, 0.02)), Pose((x, y, height - 0.01)))
        return CellBody(name='shelf', shapes=(board,))

    goal = Goal(
        waypoints=(Waypoint(pose=Pose((x, y + 0.1, z - 0.02), start.quaternion)),),
        T_flange_controlled=controlled,
    )
    # The tool points down, and ends 0.02 m below its start: the sphere is round the active TCP.
    low = arm.forward(q).position[2] - 0.02 - 0.1 - 0.02
    plan(goal, state, arm, PlanningOptions(cell=Cell(bodies=(tip, shelf(low - 0.006)))))
    with pytest.raises(CollisionPredicted, match='tip and shelf come within'):
        plan(goal, state, arm, PlanningOptions(cell=Cell(bodies=(tip, shelf(low - 0.004)))))
