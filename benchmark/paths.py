# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Goals with any number of points, all around the home position of a UR5e."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import Vector6
from ur_cartesian_driver.motion.goal.goal import Goal, Segment, Waypoint
from ur_cartesian_driver.motion.goal.goal_columns import goal_table, GoalTable
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.sim.simulator_config import HOME

MODEL = 'ur5e'
#: Distance between two points [m]; number of points of a block along x, and along y.
STEP = 0.005
ALONG = 41


def meander(points: int) -> Iterator[Pose]:
    """
    Yield poses that are 5 mm apart: back and forth in x, row by row in y, layer by layer in z.

    100,000 of them fill a block of 0.2 m x 0.2 m x 0.3 m around the home position.
    """
    home = Arm(robot_model(MODEL)).forward(HOME)
    x, y, z = home.position
    for i in range(points):
        rest, column = divmod(i, ALONG)
        layer, row = divmod(rest, ALONG)
        column = column if rest % 2 == 0 else ALONG - 1 - column
        row = row if layer % 2 == 0 else ALONG - 1 - row
        yield Pose(
            (
                x + STEP * (column - ALONG // 2),
                y + STEP * (row - ALONG // 2),
                z - 0.15 + STEP * layer,
            ),
            home.quaternion,
        )


def goal(points: int, blend_radius: float = 0.0) -> GoalTable:
    """Return a goal through the meander that stops at its end; the speeds are the driver's own."""
    segments = [Segment(blend_radius=blend_radius)] * (points - 1) + [Segment()]
    return goal_table(
        Goal(
            waypoints=tuple(Waypoint(pose=pose) for pose in meander(points)),
            segments=tuple(segments) if blend_radius > 0.0 else (),
        )
    )


def at_home(arm: Arm) -> RobotState:
    """Return the state of an arm in its home position."""
    pose = arm.forward(HOME)
    return RobotState(
        timestamp=0.0, actual_q=HOME, target_q=HOME, actual_tcp_pose=pose, target_tcp_pose=pose
    )


def calibrated_arm() -> Arm:
    """Return an arm whose DH parameters are off by about a millimetre and a milliradian."""
    model = robot_model(MODEL)
    draw = np.random.default_rng(1)

    def off(column: Vector6, by: float) -> Vector6:
        a, b, c, d, e, f = (value + float(draw.normal(0.0, by)) for value in column)
        return (a, b, c, d, e, f)

    nominal = model.geometry
    return Arm(
        model,
        replace(
            nominal,
            a=off(nominal.a, 1e-3),
            d=off(nominal.d, 1e-3),
            alpha=off(nominal.alpha, 1e-3),
            theta=off(nominal.theta, 1e-3),
        ),
    )
