# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The quick checks of a search agree with the checks of the planner."""

from collections import Counter
from itertools import pairwise
from math import pi
import re

import numpy as np

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import MODELS
from ur_cartesian_driver.motion.cell.cell import Cell, CellBody, PlacedShape
from ur_cartesian_driver.motion.cell.shapes import Box, Cylinder, HalfSpace, Sphere
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.planning import PlanningOptions
from ur_cartesian_driver.planning.preflight.clearance import Clearance
from ur_cartesian_driver.planning.preflight.tcp_kinematics import TcpKinematics
from ur_cartesian_driver.planning.travel.arm_space import ArmSpace

TCP = Pose((0.0, 0.0, 0.12))
ARM = Arm(MODELS['ur5e'])
DEGREE = pi / 180
DRAW = np.random.default_rng(3)


def random_body(k):
    shape = (Box((0.2, 0.1, 0.15)), Cylinder(0.05, 0.3), Sphere(0.08))[k % 3]
    q = DRAW.normal(size=4)
    place = DRAW.uniform((-0.8, -0.8, 0.0), 0.8)
    pose = Pose(tuple(place), tuple(q / np.linalg.norm(q)))
    return CellBody(name=f'body {k}', shapes=(PlacedShape(shape),), T_frame_body=pose)


FLOOR = CellBody(
    name='floor',
    shapes=(PlacedShape(HalfSpace()),),
    T_frame_body=Pose((0.0, 0.0, -0.3)),
    clearance=0.0,
)
PART = CellBody(
    name='part',
    frame='tool0',
    shapes=(PlacedShape(Box((0.05, 0.05, 0.2))),),
    T_frame_body=Pose((0.0, 0.0, 0.25)),
)
CELL = Cell(bodies=(*(random_body(k) for k in range(8)), FLOOR, PART))
OPTIONS = PlanningOptions(cell=CELL, workspace_planes=('wall 0 0.8 0 0 -1 0',), tool_radius=0.02)
SPACE = ArmSpace(TcpKinematics(ARM, TCP), OPTIONS)
CLEARANCE = Clearance(ARM, TCP, OPTIONS)


def test_a_motion_is_free_if_the_planner_would_accept_it():
    seen = Counter()
    q = DRAW.uniform(-pi, pi, (300, 6))
    for a, b in pairwise(q[SPACE.free(q)]):
        b = a + 0.15 * (b - a)
        count = int(np.ceil(np.abs(b - a).max() / DEGREE))
        rows = a + np.linspace(0.0, 1.0, count + 1)[1:, None] * (b - a)
        start = tuple(a.tolist())
        whole, quick = CLEARANCE.check(rows, start), CLEARANCE.check(rows, start, closest=False)
        assert quick.in_cell is None
        assert (quick.violation is None) == (whole.violation is None)
        free = SPACE.seems_free(a, b) and SPACE.is_free(a, b)
        assert free == (whole.violation is None)
        seen[free] += 1
    assert min(seen.values()) > 10


def test_what_the_arm_touches_is_named_with_the_words_of_a_refusal():
    seen = Counter()
    for q in DRAW.uniform(-pi, pi, (300, 6)):
        found = SPACE.touching(tuple(q.tolist()))
        assert (found is None) == SPACE.free(q[None])[0]
        if found is None or not found.bodies:
            continue
        text = found.text
        assert text.startswith(f'{found.bodies[0]} and {found.bodies[1]} ')
        words = re.search(r'(touch|overlap by \d|come within \d)', text)
        assert words, text
        assert '-0' not in text
        bound = 'less than the' if words[1].startswith('come') else 'with a'
        assert f', {bound} clearance of ' in text
        seen[words[1].split()[0]] += 1
    assert seen['overlap'] > 5
    assert seen['come'] > 0
