# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Rates of tool and joints are derivatives of the forward kinematics and invert each other."""

import numpy as np
import pytest

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.differential_kinematics import (
    joint_rates,
    largest_joint_rates,
    tool_rates,
)
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.geometry.pose import Pose, quaternion_from_rotation_vector

TOOL = Pose((0.05, -0.1, 0.2), quaternion_from_rotation_vector((0.3, -0.2, 0.5)))
RANDOM = np.random.default_rng(11)
#: q(t) = a + b t + c t^2 / 2, away from singularities.
A = np.array([0.3, -1.2, 1.5, -1.0, -1.4, 0.2]) + RANDOM.uniform(-0.2, 0.2, (25, 6))
B, C = RANDOM.uniform(-1.0, 1.0, (2, 25, 6))


@pytest.fixture(params=['ur3e', 'ur10', 'ur20', 'calibrated'])
def arm(request, calibrated_arm):
    if request.param == 'calibrated':
        return calibrated_arm('ur5e')
    return Arm(robot_model(request.param))


def tool_at(arm, t):
    """The TCP and its rotation matrix, by poses and not by frames."""
    poses = [arm.forward(q) @ TOOL for q in A + B * t + 0.5 * C * t * t]
    return (
        np.array([pose.position for pose in poses]),
        np.array([pose.matrix()[:3, :3] for pose in poses]),
    )


def test_the_twist_is_the_derivative_of_the_pose(arm):
    h = 1e-5
    twist, _ = tool_rates(arm, TOOL, A, B, C)
    (x0, R0), (x1, R1) = tool_at(arm, -h), tool_at(arm, h)
    np.testing.assert_allclose((x1 - x0) / (2.0 * h), twist[:, :3], atol=1e-8)
    spin = (R1 - R0) / (2.0 * h) @ tool_at(arm, 0.0)[1].transpose(0, 2, 1)  # [w]x
    np.testing.assert_allclose(spin[:, [2, 0, 1], [1, 2, 0]], twist[:, 3:], atol=1e-8)


def test_the_acceleration_is_the_derivative_of_the_twist(arm):
    h = 1e-5
    _, acceleration = tool_rates(arm, TOOL, A, B, C)
    before, after = (
        tool_rates(arm, TOOL, A + B * t + 0.5 * C * t * t, B + C * t, C)[0] for t in (-h, h)
    )
    np.testing.assert_allclose((after - before) / (2.0 * h), acceleration, atol=1e-7)


def test_joint_rates_invert_tool_rates(arm):
    qd, qdd = joint_rates(arm, TOOL, A, *tool_rates(arm, TOOL, A, B, C))
    np.testing.assert_allclose(qd, B, atol=1e-8)
    np.testing.assert_allclose(qdd, C, atol=1e-8)


def test_no_motion_of_the_tool_exceeds_the_largest_joint_rates(arm):
    speed, turn_rate, acceleration, turn_acceleration = 0.3, 0.5, 2.0, 3.0
    qd_bound, qdd_bound = largest_joint_rates(
        arm, TOOL, A, (speed, turn_rate), (acceleration, turn_acceleration)
    )
    reached = np.zeros(6)
    for _ in range(200):
        way = RANDOM.normal(size=(4, len(A), 3))
        way /= np.linalg.norm(way, axis=2)[:, :, None]
        twist = np.concatenate([speed * way[0], turn_rate * way[1]], axis=1)
        change = np.concatenate([acceleration * way[2], turn_acceleration * way[3]], axis=1)
        qd, qdd = joint_rates(arm, TOOL, A, twist, change)
        assert (np.abs(qd) <= qd_bound * (1.0 + 1e-9)).all()
        assert (np.abs(qdd) <= qdd_bound * (1.0 + 1e-9)).all()
        reached = np.maximum(reached, (np.abs(qd) / qd_bound).max(axis=0))
    assert (reached > 0.8).all()  # the bounds are close


def test_an_arm_at_rest_in_a_singularity_has_rates_of_zero(arm):
    q = np.zeros((1, 6))
    qd, qdd = joint_rates(arm, TOOL, q, np.zeros((1, 6)), np.zeros((1, 6)))
    assert not qd.any()
    assert not qdd.any()
