# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Whole motions under watch: disturbances trip in the cycle they come in, normal runs never do.

The simulated controller makes the motion; it shares nothing with the planner. In normal runs the
arm lags behind its target by some cycles, as real ones do.
"""

from collections import deque
from dataclasses import replace
from random import Random

import pytest

from ur_cartesian_driver.execution.goal.goal_commands import Finish, SendControl
from ur_cartesian_driver.execution.goal.goal_transitions import GoalState
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.geometry.pose import (
    multiply,
    Pose,
    quaternion_from_rotation_vector,
)
from ur_cartesian_driver.motion.geometry.vectors import vector3, vector6
from ur_cartesian_driver.motion.goal.goal import Segment, SegmentType, Tolerance
from ur_cartesian_driver.protocol.program.reverse import TrajectoryAction

TYPE = SegmentType
#: Cycles by which the arm lags behind its target.
LAG = 4
#: What an arm with that lag keeps; its speeds and accelerations lag too.
TIGHT = Tolerance(position=(2e-4,) * 3, orientation=(2e-3,) * 3, twist=(0.05,) * 3 + (0.2,) * 3)
NAMES = [
    'position',
    'orientation',
    'linear velocity',
    'angular velocity',
    'linear acceleration',
    'angular acceleration',
]
#: Size of the disturbance, and the limit; along the path a lag explains a part of the first.
SIZES = {'position': (0.02, 0.005), 'orientation': (0.2, 0.05)}


def lagging():
    past = deque(maxlen=LAG + 1)

    def disturb(_, state):
        past.append(state)
        return replace(
            state,
            actual_tcp_pose=past[0].actual_tcp_pose,
            actual_tcp_twist=past[0].actual_tcp_twist,
            actual_qd=past[0].actual_qd,
        )

    return disturb


def slider(seed):
    """Return a slider in the hand of a person: 1 to 100 %, and pauses; the controller ramps it."""
    random, value, goal, until, last = Random(seed), 1.0, 1.0, 0.0, 0.0

    def scale(t):
        nonlocal value, goal, until, last
        while t > until:
            goal = random.choice((0.0, 0.01, random.uniform(0.01, 1.0), 1.0))
            until += random.uniform(0.05, 0.3)
        step = 2.0 * (t - last)
        value, last = min(max(goal, value - step), value + step), t
        return value

    return scale


def sent(answers):
    """Return the numbers of the packets that were answered with CANCEL."""
    return [
        k
        for k, commands in enumerate(answers)
        for command in commands
        if isinstance(command, SendControl) and command.action is TrajectoryAction.CANCEL
    ]


def succeeded(answers):
    return [c.outcome.code for commands in answers for c in commands if isinstance(c, Finish)] == [
        ErrorCode.SUCCESSFUL
    ]


def corners(cell, kinds, radius):
    points = [
        cell.pose(x=0.03),
        cell.pose(x=0.03, y=0.03, turn=(0.1, 0.0, 0.0)),
        cell.pose(y=0.03, z=0.02, turn=(0.1, 0.0, 0.2)),
        cell.pose(),
    ]
    last = len(points) - 1
    return points, [
        Segment(type=kind, blend_radius=0.0 if i == last else radius, velocity=0.2)
        for i, kind in enumerate(kinds)
    ]


@pytest.mark.parametrize('radius', [0.0, 0.01])
@pytest.mark.parametrize(
    'kinds',
    [
        [TYPE.LINEAR] * 4,
        [TYPE.JOINT] * 4,
        [TYPE.PROCESS] * 4,
        [TYPE.LINEAR, TYPE.JOINT, TYPE.JOINT, TYPE.LINEAR],
    ],
    ids=lambda kinds: kinds[1].name,
)
def test_corners_and_blends_violate_nothing(cell, kinds, radius):
    made = cell.plan(*corners(cell, kinds, radius), path_tolerance=TIGHT)
    machine, answers = cell.run(made, disturb=lagging())
    assert sent(answers) == [], machine.outcome.cause


@pytest.mark.slow
@pytest.mark.parametrize('seed', range(12))
def test_sliders_and_pauses_violate_nothing(cell, seed):
    made = cell.plan(
        *corners(cell, [TYPE.LINEAR, TYPE.JOINT, TYPE.PROCESS, TYPE.LINEAR], 0.005),
        path_tolerance=TIGHT,
    )
    machine, answers = cell.run(made, scale=slider(seed), disturb=lagging())
    assert sent(answers) == [], machine.outcome.cause


@pytest.mark.slow
def test_the_slowest_slider_violates_nothing(cell):
    made = cell.plan([cell.pose(x=0.005)], path_tolerance=TIGHT, goal_tolerance=TIGHT)
    _, answers = cell.run(made, scale=lambda t: 0.01)
    assert succeeded(answers)


@pytest.mark.parametrize('sign', [1.0, -1.0])
@pytest.mark.parametrize('axis', range(3))
@pytest.mark.parametrize('name', NAMES)
def test_a_disturbance_violates_its_axis_in_the_same_cycle(cell, name, axis, sign):
    size, bound = SIZES.get(name, (0.5, 0.1))
    limits = [-1.0] * 18
    limits[3 * NAMES.index(name) + axis] = bound
    tolerance = Tolerance(
        position=vector3(limits[:3]),
        orientation=vector3(limits[3:6]),
        twist=vector6(limits[6:12]),
        acceleration=vector6(limits[12:]),
    )
    made = cell.plan([cell.pose(x=0.02, y=0.02)], path_tolerance=tolerance)
    packets = []

    def disturb(t, state):
        packets.append(t)
        return state if t < 0.1 else shifted(state, name, axis, sign * size)

    machine, answers = cell.run(made, disturb=disturb)
    first = next(k for k, t in enumerate(packets[1:]) if t >= 0.1)  # the 0th goes to start()
    assert sent(answers) == [first]
    assert machine.state is not GoalState.MOVING
    assert f'point 0 {name} {"xyz"[axis]} is off by' in machine.outcome.cause


def shifted(state, name, axis, value):
    """Return a packet with an arm that is elsewhere, or faster, on one axis."""
    v = [0.0] * 3
    v[axis] = value
    pose = state.actual_tcp_pose
    if name == 'position':
        where = tuple(p + e for p, e in zip(pose.position, v, strict=True))
        return replace(state, actual_tcp_pose=Pose(where, pose.quaternion))
    if name == 'orientation':
        turned = multiply(pose.quaternion, quaternion_from_rotation_vector(v))
        return replace(state, actual_tcp_pose=Pose(pose.position, turned))
    field = 'actual_tcp_twist' if 'velocity' in name else 'actual_tcp_acceleration'
    values = list(getattr(state, field))
    values[axis + (3 if 'angular' in name else 0)] += value
    return replace(state, **{field: tuple(values)})


def test_an_arm_that_only_lags_is_not_off_its_path(cell):
    made = cell.plan([cell.pose(y=0.05)], path_tolerance=TIGHT, goal_tolerance=TIGHT)
    machine, answers = cell.run(made, disturb=lagging())
    assert sent(answers) == [], machine.outcome.cause


@pytest.mark.parametrize(
    'elsewhere', [{'x': 0.05, 'z': 0.01}, {'y': -0.05}, {'x': 0.05, 'turn': (0.0, 0.3, 0.0)}]
)
def test_another_motion_than_the_planned_one_is_stopped(cell, elsewhere):
    made = cell.plan([cell.pose(x=0.05)])
    machine, answers = cell.run(made, instead=cell.plan([cell.pose(**elsewhere)]))
    assert len(sent(answers)) == 1
    assert 'the controller itself left the plan' in machine.outcome.cause
