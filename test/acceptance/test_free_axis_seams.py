# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Seams with a free rotation: only the axis of the reported poses is judged."""

from dataclasses import replace
from math import cos, pi, sin

from example_goals import example_goal
from goal_geometry import Kinematics
import numpy as np
import pytest
from robot_cell import run_cell

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.errors import CollisionPredicted, JointLimitExceeded
from ur_cartesian_driver.motion.geometry.pose import IDENTITY
from ur_cartesian_driver.motion.goal.goal import FreeAxis
from ur_cartesian_driver.planning import plan, PlanningOptions

pytestmark = [pytest.mark.acceptance, pytest.mark.slow]

ARM = Arm(robot_model('ur5e'))
CENTRE, RADIUS, HEIGHT, LEAN = np.array((-0.5, -0.1)), 0.05, 0.3, pi / 6.0


def carried_out(name, refusal):
    """
    Return an example, and the flange (n, 4, 4) by the joints that the robot reports along it.

    As given, without the free axis, it is refused.
    """
    joints, goals = [], []

    async def scenario(cell):
        state = cell.memory.read()
        goal = example_goal(name, state)
        given = tuple(replace(each, free_axis=FreeAxis.NONE) for each in goal.segments)
        with pytest.raises(refusal):
            plan(replace(goal, segments=given), state, ARM, PlanningOptions())
        motion = cell.owner.start(plan(goal, state, ARM, PlanningOptions()))

        def has_ended():
            joints.append(cell.memory.read().actual_q)
            return motion.outcome is not None

        await cell.until(has_ended, bound=60.0)
        assert motion.outcome.succeeded, motion.outcome.text
        goals.append(goal)

    run_cell(scenario)
    kinematics = Kinematics(ARM.geometry, ARM.model.position_limits, IDENTITY)
    return goals[0], kinematics.tool(np.array(joints))


def on_the_seam(goal, flange):
    """Return the rows between the joint moves that begin and end a goal."""
    begin, end = (
        np.flatnonzero(
            np.linalg.norm(flange[:, :3, 3] - goal.waypoints[k].pose.position, axis=1) < 1e-4
        )
        for k in (0, -2)
    )
    return flange[begin[0] : end[-1] + 1]


def degrees_between(a, b):
    return np.degrees(np.arccos(np.clip((a * b).sum(axis=1), -1.0, 1.0)))


def test_once_around_a_pipe():
    goal, flange = carried_out('round_pipe', JointLimitExceeded)
    seam = on_the_seam(goal, flange)
    beside = seam[:, :2, 3] - CENTRE
    angle = np.unwrap(np.arctan2(beside[:, 1], beside[:, 0]))
    assert angle[-1] - angle[0] == pytest.approx(2.0 * pi, abs=1e-3)
    # Chords of 15 degrees, with blends.
    assert np.linalg.norm(beside, axis=1) == pytest.approx(0.9957 * RADIUS, rel=0.0045)
    assert seam[:, 2, 3] == pytest.approx(HEIGHT, abs=2e-4)
    against = np.stack(
        [np.cos(angle) * cos(LEAN), np.sin(angle) * cos(LEAN), np.full(len(angle), sin(LEAN))],
        axis=1,
    )
    assert degrees_between(seam[:, :3, 2], -against).max() < 1.0
    along = np.stack([-np.sin(angle), np.cos(angle), 0.0 * angle], axis=1)
    turned = degrees_between(seam[:, :3, 0], along)
    assert np.ptp(turned) > 90.0  # as given it would be 0 all the way


def test_under_the_elbow():
    goal, flange = carried_out('under_elbow', CollisionPredicted)
    seam = on_the_seam(goal, flange)
    assert seam[-1, :3, 3] == pytest.approx(goal.waypoints[-2].pose.position, abs=1e-4)
    assert seam[:, [0, 2], 3] == pytest.approx(np.tile((-0.25, 0.12), (len(seam), 1)), abs=2e-4)
    down = np.tile((0.0, 0.0, -1.0), (len(seam), 1))
    assert degrees_between(seam[:, :3, 1], down).max() < 0.1
    given = np.array(goal.waypoints[0].pose.matrix())[:3, 0]
    assert degrees_between(seam[:, :3, 0], np.tile(given, (len(seam), 1))).min() > 20.0
