# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The robot confirms the verdict of the pre-flight check on a goal.

Random goals at the limits of each arm: accepted ones have to arrive as planned; those refused for
reach, range or branch are sent anyway and have to fail. Both sides share the kinematics, so the
paths are also compared with an independent one.

``PRE_FLIGHT_GOALS`` is the number of goals of each model. From 1000 on, goals that take minutes
run too.
"""

from collections import Counter
from itertools import pairwise
from math import inf
import os

from forward_model import dh_forward, pose_matrix
import numpy as np
from planner_verdict import compare, is_borderline, MAX_RUN_DURATION
import pytest
from random_goals import random_case
from robot_in_memory import RobotInMemory

from ur_cartesian_driver.kinematics.robot_models import MODELS
from ur_cartesian_driver.motion.goal.goal import SegmentType

pytestmark = [pytest.mark.acceptance, pytest.mark.slow]

GOALS = int(os.environ.get('PRE_FLIGHT_GOALS', '40'))
MAX_DURATION = inf if GOALS >= 1000 else MAX_RUN_DURATION
#: What part of the goals has to be of a kind, so that not only easy ones are drawn, and may be.
MIN_SHARES = {'passes': 0.3, 'reach': 0.04, 'limit': 0.015, 'branch': 0.06}
MAX_SHARES = {'other': 0.01, 'long': 0.15, 'border': 0.05}
#: Of the executed paths, compared with the other kinematics; 14 models make 210.
POSES_OF_A_MODEL = 15
#: What rounding on the wire may add up to [m] + [rad].
WIRE = 1e-5


@pytest.fixture(scope='module')
def robot_of():
    """The robots in memory by model; CB3's cycles for all of them, because the test pays each."""
    robots = {}
    return lambda model: robots.setdefault(model, RobotInMemory(model, frequency=125.0))


@pytest.mark.exhaustive
@pytest.mark.timeout(3600)
@pytest.mark.parametrize('model', MODELS)
def test_accepted_goals_arrive_and_refused_ones_fail(model, robot_of, record_property):
    robot, counts, wrong = robot_of(model), Counter(), []
    for number in range(GOALS):
        case = random_case(robot.controller.arm, number)
        verdict = compare(robot, case, max_duration=MAX_DURATION)
        counts[verdict.planner] += 1
        if verdict.agreed:
            continue
        if is_borderline(robot, case):
            counts['border'] += 1
        else:
            wrong.append(
                f'{model} {number} ({case.family}): the planner says '
                f'{verdict.refusal or "yes"!r}, the robot {verdict.failure or "yes"!r}'
            )
    line = f'{GOALS} goals: ' + ', '.join(
        f'{counts[kind]} {kind}' for kind in (*MIN_SHARES, *MAX_SHARES)
    )
    print(f'{model}: {line}')
    record_property('pre_flight', line)
    assert not wrong, '\n'.join([line, *wrong])
    assert all(counts[kind] >= int(part * GOALS) for kind, part in MIN_SHARES.items()), line
    assert all(counts[kind] <= part * GOALS for kind, part in MAX_SHARES.items()), line


@pytest.mark.parametrize('model', MODELS)
def test_paths_agree_with_an_independent_kinematics(model, robot_of):
    """Straight lines are straight and lead where the goal says, by the textbook's matrices."""
    robot, rng, checked, number = robot_of(model), np.random.default_rng(4), 0, 0
    geometry = MODELS[model].geometry
    while checked < POSES_OF_A_MODEL:
        case, number = random_case(robot.controller.arm, number), number + 1
        if not all(is_straight(segment) for segment in case.goal.segments):
            continue
        verdict = compare(robot, case, max_duration=MAX_RUN_DURATION)
        if verdict.planner != 'passes' or verdict.failure:
            continue
        tool, run = pose_matrix(case.T_flange_tcp), verdict.run
        corners = [
            dh_forward(geometry, case.q) @ tool,
            *(pose_matrix(waypoint.pose) for waypoint in case.goal.waypoints),
        ]
        assert distances(dh_forward(geometry, run.q) @ tool, corners[-1]) < WIRE
        for row in rng.integers(len(run.joints), size=3):
            T_base_tcp = dh_forward(geometry, run.joints[row]) @ tool
            assert distances(T_base_tcp, pose_matrix(run.poses[row])) < 1e-9
            assert min(beside(T_base_tcp, a, b) for a, b in pairwise(corners)) < WIRE
            checked += 1


def is_straight(segment):
    return segment.blend_radius == 0.0 and segment.type in (
        SegmentType.LINEAR,
        SegmentType.PROCESS,
        SegmentType.OPTIMIZED_LINEAR,
    )


def distances(a, b):
    """Return the distance of two poses [m] + [rad]: |A - B| = 2 sqrt(2) sin(angle / 2)."""
    chord = np.linalg.norm(a[:3, :3] - b[:3, :3]) / (2.0 * np.sqrt(2.0))
    return np.linalg.norm(a[:3, 3] - b[:3, 3]) + 2.0 * np.arcsin(min(1.0, chord))


def beside(pose, start, end):
    """Return how much longer the path from start to end is via the pose [m] + [rad]."""
    return distances(start, pose) + distances(pose, end) - distances(start, end)
