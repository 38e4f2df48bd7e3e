# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The truth table: each axis of each quantity violates its own limit, and no other."""

from dataclasses import replace
from math import nan, pi
from typing import Any

import pytest

from ur_cartesian_driver.execution.monitoring.joint_tolerance_check import JointToleranceCheck
from ur_cartesian_driver.execution.monitoring.tolerance_check import QUANTITIES, ToleranceCheck
from ur_cartesian_driver.motion.geometry.pose import (
    IDENTITY,
    multiply,
    Pose,
    quaternion_from_rotation_vector,
    rotate,
)
from ur_cartesian_driver.motion.geometry.vectors import subtract, vector3, ZERO6
from ur_cartesian_driver.motion.goal.goal import Tolerance
from ur_cartesian_driver.motion.goal.joint_goal import JointErrorBounds, JointTolerances
from ur_cartesian_driver.motion.state.rtde_state import RobotState

DOWN = quaternion_from_rotation_vector((pi, 0.0, 0.0))
WANTED = Pose((0.4, -0.2, 0.3), DOWN)
TWIST = (0.1, -0.2, 0.05, 0.3, 0.2, -0.4)
RATE = (1.0, -2.0, 0.5, 3.0, 2.0, -4.0)
ON_TIME = RobotState(
    timestamp=0.0,
    actual_q=ZERO6,
    actual_tcp_pose=WANTED,
    target_tcp_pose=WANTED,
    actual_tcp_twist=TWIST,
    target_tcp_twist=TWIST,
    actual_tcp_acceleration=RATE,
    target_tcp_acceleration=RATE,
)
#: A frame in which all axes of base mean something else.
TURNED = Pose((1.0, 2.0, 3.0), quaternion_from_rotation_vector((0.3, -1.1, 0.7)))
#: Field of the tolerance, and where its three axes begin there.
FIELDS = {
    'position': ('position', 0),
    'orientation': ('orientation', 0),
    'linear velocity': ('twist', 0),
    'angular velocity': ('twist', 3),
    'linear acceleration': ('acceleration', 0),
    'angular acceleration': ('acceleration', 3),
}
AXES = [(name, axis) for name in FIELDS for axis in range(3)]


def limit(name, values, others=-1.0):
    """Return a tolerance of one quantity, with `others` for all others."""
    limits: dict[str, Any] = {
        'position': [others] * 3,
        'orientation': [others] * 3,
        'twist': [others] * 6,
        'acceleration': [others] * 6,
    }
    field, first = FIELDS[name]
    limits[field][first : first + 3] = values
    return Tolerance(**{key: tuple(value) for key, value in limits.items()})


def disturbed(name, axis, error, frame=IDENTITY):
    """Return a packet in which desired - actual is `error` on an axis of the goal's frame."""
    errors = [0.0] * 3
    errors[axis] = error
    if name == 'orientation':  # in the tool: q_desired = q_actual * error
        actual = multiply(DOWN, quaternion_from_rotation_vector([-e for e in errors]))
        return replace(ON_TIME, actual_tcp_pose=Pose(WANTED.position, actual))
    v = rotate(frame.quaternion, vector3(errors))
    if name == 'position':
        return replace(ON_TIME, actual_tcp_pose=Pose(subtract(WANTED.position, v), DOWN))
    field, first = FIELDS[name]
    values = list(getattr(ON_TIME, f'actual_tcp_{field}'))
    for k in range(3):
        values[first + k] -= v[k]
    change: dict[str, Any] = {f'actual_tcp_{field}': tuple(values)}
    return replace(ON_TIME, **change)


def test_the_table_has_all_quantities():
    assert [quantity.name for quantity in QUANTITIES] == list(FIELDS)


@pytest.mark.parametrize('frame', [IDENTITY, TURNED], ids=['base', 'turned'])
@pytest.mark.parametrize('sign', [1.0, -1.0])
@pytest.mark.parametrize(('name', 'axis'), AXES)
def test_each_axis_is_checked_alone_and_named(name, axis, sign, frame):
    packet = disturbed(name, axis, sign * 0.0021, frame)
    unit = next(quantity.unit for quantity in QUANTITIES if quantity.name == name)
    for other, other_axis in AXES:
        limits = [-1.0] * 3
        limits[other_axis] = 0.002
        clause = ToleranceCheck(limit(other, limits), frame).violation(WANTED, packet)
        if (other, other_axis) == (name, axis):
            assert clause == (
                f'{name} {"xyz"[axis]} is off by 0.002100 {unit}, the tolerance is 0.002000 {unit}'
            )
        else:
            assert clause is None
    all_axes = Tolerance(
        position=(0.002,) * 3,
        orientation=(0.002,) * 3,
        twist=(0.002,) * 6,
        acceleration=(0.002,) * 6,
    )
    clause = ToleranceCheck(all_axes, frame).violation(WANTED, packet)
    assert clause.startswith(f'{name} {"xyz"[axis]} is off')


@pytest.mark.parametrize(('name', 'axis'), AXES)
@pytest.mark.parametrize('bound', [0.0, -1.0, -1e-9, 0.0022])
def test_zero_negative_and_larger_limits_let_it_pass(name, axis, bound):
    limits = [0.001] * 3  # so that the quantity is watched
    limits[axis] = bound
    assert (
        ToleranceCheck(limit(name, limits, 0.0), IDENTITY).violation(
            WANTED, disturbed(name, axis, 0.0021)
        )
        is None
    )


def test_a_tolerance_without_a_limit_checks_nothing():
    assert not ToleranceCheck(Tolerance(), IDENTITY)
    assert not ToleranceCheck(Tolerance(twist=(-1.0,) * 6), IDENTITY)
    assert ToleranceCheck(Tolerance(twist=(0.0,) * 5 + (1.0,)), IDENTITY)


def test_of_several_axes_the_worst_is_named():
    packet = replace(ON_TIME, actual_tcp_pose=Pose((0.403, -0.21, 0.3), DOWN))
    both = Tolerance(position=(0.002, 0.002, 0.002))
    assert 'position y' in ToleranceCheck(both, IDENTITY).violation(WANTED, packet)


def test_nan_is_outside():
    watched = ToleranceCheck(limit('linear acceleration', [1.0, -1.0, -1.0]), IDENTITY)
    silent = replace(ON_TIME, actual_tcp_acceleration=None)
    assert 'linear acceleration x is off by nan' in watched.violation(WANTED, silent)
    broken = replace(ON_TIME, actual_tcp_pose=Pose((nan, 0.0, 0.0), DOWN))
    assert 'is off by nan m' in ToleranceCheck(limit('position', [1.0] * 3), IDENTITY).violation(
        WANTED, broken
    )


def test_opposite_signs_of_a_quaternion_are_no_error():
    x, y, z, w = DOWN
    flipped = Pose(WANTED.position, (-x, -y, -z, -w))
    watched = ToleranceCheck(limit('orientation', [1e-6] * 3), IDENTITY)
    assert watched.violation(flipped, ON_TIME) is None


def test_the_first_joint_whose_error_is_unknown_is_named():
    check = JointToleranceCheck(
        JointTolerances(path=JointErrorBounds(position=(0.1,) * 6, velocity=(0.1,) * 6), end=ZERO6)
    )
    state = replace(ON_TIME, actual_q=(0.2, 0.0, nan, 0.0, nan, 0.5), actual_qd=(1.0,) * 6)
    assert check.path_violation(state) == (
        'position of elbow_joint is off by nan rad, the tolerance is 0.100000 rad'
    )
