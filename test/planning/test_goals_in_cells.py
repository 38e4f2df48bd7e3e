# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Goals in random cells: what is accepted keeps its clearance on the simulated robot.

The judge interpolates the joints of all cycles and measures by brute force over triangles.
"""

from collections import Counter

import numpy as np
import pytest
from random_cases import cases, random_of
from random_cells import CellJudge
from robot_in_memory import RobotInMemory
from traced_cells import cell_beside, KINDS, random_goal, short_of, STEP, TraceJudge

from ur_cartesian_driver.kinematics.link_shapes import mesh_tolerance, MODELS_WITH_MESHES
from ur_cartesian_driver.kinematics.robot_models import MODELS
from ur_cartesian_driver.motion.cell.cell import LINK_NAMES
from ur_cartesian_driver.motion.errors import CollisionPredicted, GoalRefused
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.sim.calibration import random_calibration

pytest.importorskip('pinocchio')

HOME = np.array((0.3, -1.4, 1.5, -1.2, -1.3, 0.4))
TOOL = Pose((0.01, 0.02, 0.1))
#: The models, and whether they are calibrated. Of two of them there are no meshes.
ARMS = {'ur5': False, 'ur5e': True, 'ur3e': False, 'ur10e': True, 'ur20': False}


@pytest.fixture(scope='module')
def robots():
    """Robots in memory, with the cycle of CB3, because the tests pay each."""
    return {
        name: RobotInMemory(
            name,
            frequency=125.0,
            geometry=random_calibration(MODELS[name], 1) if is_calibrated else None,
        )
        for name, is_calibrated in ARMS.items()
    }


class Drawn:
    """A goal that can be planned in an empty cell, its start, and a cell beside it."""

    def __init__(self, robots, kind, number):
        rng = np.random.default_rng(random_of('goal in a cell', kind, number).getrandbits(32))
        name = str(rng.choice(list(ARMS)))
        self.robot, self.kind = robots[name], kind
        self.arm = self.robot.controller.arm
        while True:
            self.q = tuple((HOME + rng.normal(0.0, 0.3, 6)).tolist())
            self.state = self.robot.place(self.q, TOOL)
            self.goal = random_goal(rng, kind, self.state.actual_tcp_pose)
            try:
                self.free = plan(self.goal, self.state, self.arm, PlanningOptions())
            except GoalRefused:
                continue
            break
        self.cell = cell_beside(rng, self.arm, TOOL, self.q, self.goal)

    def plan(self):
        return plan(self.goal, self.state, self.arm, PlanningOptions(cell=self.cell))

    def tolerance(self, names):
        """Return by how much links may be larger for the planner than for the judge [m]."""
        if not {*names} & {*LINK_NAMES}:
            return STEP
        name = self.arm.model.name
        # Without meshes: polygons around rims, and those in them.
        return STEP + (mesh_tolerance(name) if name in MODELS_WITH_MESHES else 0.003)

    def trace(self, made):
        """Return the judge of the cycles in which the robot moves."""
        self.robot.place(self.q, TOOL)
        ran = self.robot.run(list(made.instructions))
        assert ran.failure == ''
        q = np.vstack([self.q, ran.joints])
        return TraceJudge(self.arm, TOOL, self.cell, q)

    def shortfall_at(self, error):
        """Return by how much the bodies of a refusal are too close at its place [m]."""
        clearance = max(
            self.cell.clearance_of(body) for body in self.cell.bodies if body.name in error.bodies
        )
        judge = CellJudge(self.arm, TOOL, self.cell)
        a, b = error.bodies
        distance = judge.distances(a, b, judge.frames(error.q))[0]
        return short_of(clearance, distance), clearance - distance, clearance


@pytest.mark.random
@pytest.mark.timeout(3600)
@pytest.mark.parametrize('kind', KINDS)
def test_goals_keep_their_clearance_on_the_robot(robots, kind):
    """And what is refused would come too close, at the place that is named."""
    counts, worst = Counter(), 0.0
    for number in range(cases(125)):
        drawn = Drawn(robots, kind, number)
        try:
            made = drawn.plan()
        except CollisionPredicted as error:
            counts['refused'] += 1
            short, at_place, clearance = drawn.shortfall_at(error)
            if short <= 0.0:  # it may be between two rows
                trace = drawn.trace(drawn.free)
                away = np.abs(trace.q - np.array(error.q)).max(axis=1)
                short = trace.shortfall(*error.bodies, clearance) if away.min() < 0.05 else short
            if short <= 0.0:
                counts['refused falsely'] += at_place < -drawn.tolerance(error.bodies)
                counts['refused by tolerance'] += at_place >= -drawn.tolerance(error.bodies)
                print(kind, number, drawn.arm.model.name, f'{1e3 * at_place:.3f} mm', error)
            continue
        except GoalRefused as refusal:
            print(kind, number, refusal)
            counts['refused otherwise'] += 1
            continue
        counts['accepted'] += 1
        short, pair = drawn.trace(made).nearest()
        worst = max(worst, short)
        assert short <= STEP, (number, pair)
    print(kind, dict(counts), f'worst {1e3 * worst:.4f} mm')
    assert counts['accepted'] > 0.1 * cases(125)
    assert counts['refused'] > 0.1 * cases(125)
    assert counts['refused falsely'] <= max(1, 0.01 * cases(125))
