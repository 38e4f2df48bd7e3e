# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""An arm that follows targets stops before bodies of its cell, and its speed allows for it."""

from math import hypot

import numpy as np
import pytest

from ur_cartesian_driver.execution.live.online_trajectory import (
    LiveLimits,
    OnlineTrajectoryGenerator,
)
from ur_cartesian_driver.execution.live.workspace_guard import LiveWorkspace
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.cell.cell import Cell, CellBody, LINK_NAMES, PlacedShape
from ur_cartesian_driver.motion.cell.shapes import Box, Cylinder, HalfSpace, Shape, Sphere
from ur_cartesian_driver.motion.geometry.pose import Pose

ARM = Arm(robot_model('ur5e'))
HOME = (0.0, -1.57, 1.57, -1.57, -1.57, 0.0)
TCP = Pose((0.0, 0.0, 0.1))
START = (ARM.forward(HOME) @ TCP).position
DT = 0.008
RADIUS, CLEARANCE, ACCELERATION = 0.03, 0.008, 1.0
#: A ball about the TCP: its distances are easy to compute.
BALL = CellBody(
    name='ball', shapes=(PlacedShape(Sphere(RADIUS)),), frame='tool0', T_frame_body=TCP
)
#: The arm itself may touch the body.
ONLY_THE_BALL = frozenset(frozenset({'thing', link}) for link in LINK_NAMES)


def body(shape: Shape, x=0.0, y=0.0, z=0.0):
    px, py, pz = START
    return CellBody(
        name='thing', shapes=(PlacedShape(shape),), T_frame_body=Pose((px + x, py + y, pz + z))
    )


def distance(shape, centre, point):
    """Return the distance of a point from a body, axes along base [m]."""
    away = np.subtract(point, centre)
    match shape:
        case Box(size):
            return float(np.linalg.norm(np.maximum(np.abs(away) - 0.5 * np.array(size), 0.0)))
        case Sphere(radius):
            return float(np.linalg.norm(away)) - radius
        case Cylinder(radius, length):
            outside = max(hypot(*away[:2]) - radius, 0.0), max(abs(away[2]) - 0.5 * length, 0.0)
            return hypot(*outside)
    return float(away[2])


CASES = {
    'box': (body(Box((0.3, 0.1, 0.3)), y=0.25), (0.0, 0.4, 0.0)),
    'sphere': (body(Sphere(0.1), y=0.3, z=0.05), (0.0, 0.3, 0.05)),
    'cylinder': (body(Cylinder(0.05, 0.3), y=0.25, x=0.02), (0.0, 0.4, 0.0)),
    'plane': (body(HalfSpace(), z=-0.2), (0.0, 0.0, -0.4)),
}


@pytest.mark.slow
@pytest.mark.parametrize('what', CASES)
def test_the_speed_allows_to_stop_before_the_body_and_the_arm_may_leave(what):
    thing, way = CASES[what]
    cell = Cell(bodies=(BALL, thing), clearance=CLEARANCE, may_touch=ONLY_THE_BALL)
    workspace = LiveWorkspace(cell=cell)
    limits = LiveLimits(linear_acceleration=ACCELERATION, workspace=workspace)
    generator = OnlineTrajectoryGenerator(ARM, TCP, HOME, limits)
    orientation = generator.T_base_tcp.quaternion
    generator.set_target(Pose(tuple(np.add(START, way)), orientation))
    left, speeds = [], []
    for _ in range(300):
        generator.step(DT)
        point = generator.T_base_tcp.position
        shape, centre = thing.shapes[0].shape, thing.T_frame_body.position
        left.append(distance(shape, centre, point) - RADIUS - CLEARANCE)
        speeds.append(float(np.linalg.norm(generator.linear)))
    assert generator.at_rest
    assert 'ball and thing would come within' in generator.blocked
    assert min(left) > -1e-5
    assert left[-1] < 0.01, 'near to the body, not anywhere'
    for room, speed in zip(left, speeds, strict=True):
        assert speed**2 / (2.0 * ACCELERATION) < room + 1e-5
    generator.set_target(Pose(START, orientation))
    for _ in range(400):
        generator.step(DT)
    assert generator.arrived


def test_bodies_far_away_slow_nothing():
    thing = CellBody(
        name='far',
        shapes=(PlacedShape(Box((0.1, 0.1, 0.1))),),
        T_frame_body=Pose((0.0, -1.5, 0.5)),
    )
    positions = []
    for cell in (Cell(), Cell(bodies=(thing,))):
        limits = LiveLimits(workspace=LiveWorkspace(cell=cell))
        generator = OnlineTrajectoryGenerator(ARM, TCP, HOME, limits)
        generator.set_target(
            Pose(tuple(np.add(START, (0.0, 0.1, 0.0))), generator.T_base_tcp.quaternion)
        )
        positions.append([generator.step(DT) for _ in range(100)])
    assert positions[0] == positions[1]
