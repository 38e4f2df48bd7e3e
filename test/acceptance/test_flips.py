# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Wrist flip, elbow flip and shoulder crossing: impossible on a straight line, possible in joints.

Each line passes a nearly singular configuration and ends in a posture beyond the flip. The planner
has to name the flip and its position; when it is sent anyway, the line does not bring the arm into
that posture.
"""

from dataclasses import replace
from math import hypot, pi
import re

import numpy as np
from planner_verdict import OPTIONS, unchecked_primitive
import pytest
from random_goals import Case
from robot_in_memory import RobotInMemory

from ur_cartesian_driver.kinematics.inverse import nearest, solutions
from ur_cartesian_driver.kinematics.inverse_rows import branch_measures
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.motion.errors import InvalidPosture, NearSingularity
from ur_cartesian_driver.motion.geometry.pose import (
    IDENTITY,
    multiply,
    Pose,
    quaternion_from_rotation_vector,
)
from ur_cartesian_driver.motion.goal.goal import Goal, Posture, Segment, SegmentType, Waypoint
from ur_cartesian_driver.motion.plan.primitive import MoveJ
from ur_cartesian_driver.planning import plan, PlanningOptions

pytestmark = [pytest.mark.acceptance, pytest.mark.slow]

#: The defaults, except for bounds that are not about the shape of the path.
MARGINS = PlanningOptions(max_approach_distance=0.0, max_tool_speed=0.0, self_collision='off')


def past_a_straight_wrist(arm):
    """Two milliradians beside it in the middle of the line."""
    middle = arm.forward((0.4, -1.3, 1.7, -0.5, 0.0, 0.3))
    tilt = multiply(quaternion_from_rotation_vector((0.001, 0.002, 0.001)), middle.quaternion)
    # Across the plane of the arm, so that wrist 2 has to turn.
    return line(arm, Pose(middle.position, tilt), (-np.sin(0.4), np.cos(0.4), 0.0), 0.1)


def outwards(arm):
    """To a nearly stretched arm: the other elbow is near, but beyond the stretch."""
    q = (0.4, -0.6, 0.9, -0.8, -1.2, 0.3)
    end = arm.forward((0.4, -0.35, 0.3, -0.45, -1.2, 0.3))
    return q, end


def past_the_column(arm):
    """The centre of the wrist 0.2 mm beside the column over the base."""
    d4, d6 = arm.geometry.d[3], arm.geometry.d[5]
    wrist = Pose(
        (hypot(d4, 0.008), 0.0, arm.geometry.d[0] + 0.6 * arm.model.max_reach),
        arm.forward((0.5, -1.2, 1.6, -2.0, -1.2, 0.3)).quaternion,
    )
    return line(arm, wrist @ Pose((0.0, 0.0, d6)), (0.0, 1.0, 0.0), 0.15)


def line(arm, middle, direction, half):
    """Return the joints of an arm at the beginning of a line, and the end of the line."""
    half_line = half * arm.model.max_reach * np.array(direction)
    ends = [
        Pose(tuple((np.array(middle.position) + side * half_line).tolist()), middle.quaternion)
        for side in (-1.0, 1.0)
    ]
    q = nearest(arm, ends[0], (0.5, -1.2, 1.6, -2.0, -1.2, 0.3))
    return q, ends[1]


FLIPS = {'wrist': past_a_straight_wrist, 'elbow': outwards, 'shoulder': past_the_column}


@pytest.fixture(scope='module')
def robot_of():
    robots = {}
    return lambda model: robots.setdefault(model, RobotInMemory(model, frequency=125.0))


@pytest.mark.parametrize('flip', FLIPS)
@pytest.mark.parametrize('model', ['ur3e', 'ur5', 'ur10e', 'ur16e', 'ur20'])
def test_a_flip_is_named_fails_as_a_line_and_passes_as_a_joint_move(robot_of, model, flip):
    robot = robot_of(model)
    arm = robot.controller.arm
    q, end = FLIPS[flip](arm)
    behind = other_side(arm, end, came_to(arm, q, end), flip)
    goal = Goal(
        waypoints=(Waypoint(pose=end, posture=Posture(names=JOINT_NAMES, values=behind)),),
        segments=(Segment(type=SegmentType.LINEAR, velocity=0.3, acceleration=2.0),),
    )

    state = robot.place(q, IDENTITY)
    with pytest.raises((NearSingularity, InvalidPosture)) as refusal:
        plan(goal, state, arm, MARGINS)
    assert flip in str(refusal.value)
    assert 'points[0]' in str(refusal.value)
    if flip != 'elbow':  # it never comes to the stretch
        share = re.search(r'at ([\d.]+) % of its segment', str(refusal.value))
        assert float(share[1]) == pytest.approx(50.0, abs=10.0)
    with pytest.raises(InvalidPosture, match=flip):
        plan(goal, state, arm, OPTIONS)

    case = Case(family=flip, q=q, T_flange_tcp=IDENTITY, goal=goal)
    run = robot.run([unchecked_primitive(case, 0, q, arm)])
    assert run.failure or np.abs(np.subtract(run.q, behind)).max() > 0.01

    state = robot.place(q, IDENTITY)
    made = plan(goal, state, arm, replace(MARGINS, on_posture_change='movej'))
    assert isinstance(made.segments[0].primitive, MoveJ)
    run = robot.run([made.segments[0].primitive])
    assert not run.failure
    assert run.q == pytest.approx(behind, abs=1e-3)


def came_to(arm, q, end):
    """Return the configuration at the end of a line, solved in steps of 0.1 mm."""
    start = arm.forward(q)
    for share in np.linspace(0.0, 1.0, int(start.distance_to(end) / 1e-4) + 2)[1:]:
        q = nearest(arm, start.interpolate(end, float(share)), q)
    return q


def other_side(arm, pose, q, flip):
    """Return the solution of a pose that differs from q in one of its three choices."""
    signs = signs_of(arm, q)
    k = ('shoulder', 'elbow', 'wrist').index(flip)
    signs[k] *= -1
    found = [other for other in solutions(arm, pose, q) if signs_of(arm, other) == signs]
    return tuple(
        a + 2.0 * pi * round((b - a) / (2.0 * pi)) for a, b in zip(found[0], q, strict=True)
    )


def signs_of(arm, q):
    measures = branch_measures(arm, np.array([q]))
    return [int(np.sign(m[0])) for m in (measures.shoulder, measures.elbow, measures.wrist)]
