# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Transfers of an arm between planes, judged by the test with its own kinematics."""

from dataclasses import replace
from math import pi, sqrt

from forward_model import dh_forward, pose_matrix
import numpy as np
import pytest

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import MODELS
from ur_cartesian_driver.motion.errors import CollisionPredicted, Unreachable
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.planning import PlanningOptions
from ur_cartesian_driver.planning.preflight.tcp_kinematics import TcpKinematics
from ur_cartesian_driver.planning.travel.arm_space import ArmSpace
from ur_cartesian_driver.planning.travel.transfer import find_transfer, TransferSettings

H = pi / 2
HOME = (0.0, -H, H, -H, -H, 0.0)
#: The elbow closed so far that wrist 1 is in the upper arm.
FOLDED = (0.0, -H, 2.95, -1.8, -H, 0.0)
TOOL = Pose((0.0, 0.0, 0.1))
TABLE = 'table 0 0 0 0 0 1'
SETTINGS = TransferSettings(retract=0.03, approach=0.04)


def space(*planes, model='ur5e', tool=TOOL, **options):
    chosen = PlanningOptions(workspace_planes=planes, tool_radius=0.02, **options)
    return ArmSpace(TcpKinematics(Arm(MODELS[model]), tool), chosen)


def down_at(here, x, y, z):
    """The configurations in which the tool points down at a place, the nearest to HOME first."""
    return here.configurations(Pose((x, y, z), (1.0, 0.0, 0.0, 0.0)), HOME)


def rows_of(found):
    return np.concatenate(
        [
            a + np.linspace(0.0, 1.0, 101)[:, None] * (b - a)
            for a, b in zip(found.waypoints[:-1], found.waypoints[1:], strict=True)
        ]
    )


def tool_rows(q, model='ur5e'):
    tool = pose_matrix(TOOL)
    return np.array([(dh_forward(MODELS[model].geometry, row) @ tool)[:3, 3] for row in q])


def test_a_transfer_leaves_and_arrives_along_the_tool():
    here = space(TABLE)
    start, goals = down_at(here, 0.4, -0.3, 0.05)[0], down_at(here, 0.4, 0.3, 0.05)
    found = find_transfer(here, start, goals, SETTINGS, 'The travel')
    ends = tool_rows(found.waypoints[[0, -1]])
    assert np.allclose(ends, [(0.4, -0.3, 0.08), (0.4, 0.3, 0.09)], atol=1e-6)
    assert found.goal in goals
    assert tool_rows(rows_of(found))[:, 2].min() > 0.02


def test_the_goal_can_be_any_of_several_configurations():
    here = space(TABLE)
    goals = down_at(here, 0.4, 0.3, 0.2)
    assert 4 <= len(goals) <= 8
    free = [goal for goal in goals if here.touching(goal) is None]
    assert 2 <= len(free) <= len(goals)
    for goal in free:
        found = find_transfer(here, goal, goals, SETTINGS, 'The travel')
        assert found.goal == goal
        assert found.samples == 0


@pytest.mark.parametrize('model', ['ur3e', 'ur5e', 'ur10e', 'ur20'])
def test_weights_bound_how_far_a_joint_moves_the_tool(model):
    here = space(model=model)
    q = np.random.default_rng(5).uniform(-pi, pi, (50, 6))
    for k in range(6):
        turned = q.copy()
        turned[:, k] += 1e-3
        moves = np.linalg.norm(tool_rows(turned, model) - tool_rows(q, model), axis=1)
        assert moves.max() <= 1.001e-3 * here.weights[k]


def test_configurations_are_turned_near_and_within_limits():
    near = tuple(np.add(HOME, (2 * pi - 0.1, 0.0, 0.0, -3.0, 0.0, 6.2)))
    here = space()
    pose = here.tcp(HOME)
    found = np.array(here.configurations(pose, near))
    assert (np.abs(found) <= 2 * pi).all()
    assert found[0][0] == pytest.approx(2 * pi)
    for q in found:
        assert here.tcp(tuple(q)).distance_to(pose) < 1e-9


def test_a_start_and_a_goal_that_touch_are_said_before_the_search():
    here = space()
    with pytest.raises(CollisionPredicted) as refused:
        find_transfer(here, FOLDED, [HOME], SETTINGS, 'The travel')
    assert str(refused.value).startswith('The travel cannot begin: shoulder and forearm touch')
    assert refused.value.q == FOLDED
    with pytest.raises(CollisionPredicted, match=r'^The travel cannot end: shoulder and forearm'):
        find_transfer(here, HOME, [FOLDED], SETTINGS, 'The travel')


def test_lines_along_the_tool_that_are_not_free_are_refused():
    here = space('wall 0 0.4 0 0 -1 0')
    sideways = Pose((0.45, 0.0, 0.4), (sqrt(0.5), 0.0, 0.0, sqrt(0.5)))
    start = here.configurations(sideways, HOME)[0]
    into_the_wall = TransferSettings(retract=0.3)
    problem = r'^The travel: the retract of 0.3 m is not free: .* plane "wall"; use a shorter re'
    with pytest.raises(CollisionPredicted, match=problem):
        find_transfer(here, start, [HOME], into_the_wall, 'The travel')
    problem = '^The travel: the approach of 0.9 m along the axis z of the tool is out of reach'
    with pytest.raises(Unreachable, match=problem):
        find_transfer(space(), HOME, [start], TransferSettings(approach=0.9), 'The travel')


def test_an_arm_that_touches_something_everywhere_is_told():
    here = space('low 0 0 -2 0 0 -1')
    with pytest.raises(
        CollisionPredicted, match=r'^The travel cannot begin: upper arm is .* plane "low"; stay'
    ):
        find_transfer(here, HOME, [HOME], SETTINGS, 'The travel')


def test_a_way_that_is_not_found_names_the_number_of_samples():
    here = space(TABLE)
    goals = down_at(here, 0.4, 0.3, 0.05)[:1]

    class Walled(ArmSpace):
        def is_free(self, a, b):
            return False

    walled = Walled(here.kinematics, PlanningOptions())
    few = replace(SETTINGS, max_samples=25)
    with pytest.raises(CollisionPredicted, match=r'not found within 25 samples; allow more'):
        find_transfer(walled, HOME, goals, few, 'The travel to point 0')


@pytest.mark.parametrize(
    ('settings', 'problem'),
    [
        ({'retract': -0.1}, 'retract is -0.1 m'),
        ({'approach': float('nan')}, 'approach is nan m'),
        ({'retract': 50.0}, 'from 0 to 1 m'),
        ({'max_samples': -1}, 'max_samples is -1'),
        ({'seed': -1}, 'seed is -1'),
    ],
)
def test_settings_out_of_range_are_refused(settings, problem):
    with pytest.raises(ValueError, match=problem):
        TransferSettings(**settings)
