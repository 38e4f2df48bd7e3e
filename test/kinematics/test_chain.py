# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The forward kinematics agrees with others, and with itself in all its forms."""

from dataclasses import replace
from math import pi
import sys

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from ur_cartesian_driver.kinematics.chain import Arm, pinocchio_model
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES, MODELS
from ur_cartesian_driver.motion.geometry.pose import Pose, pose_from_row

UR5E = MODELS['ur5e']
JOINTS = st.tuples(*[st.floats(-2 * pi, 2 * pi)] * 6)


def random_joints(n, seed=0):
    return np.random.default_rng(seed).uniform(-2 * pi, 2 * pi, (n, 6))


@pytest.mark.parametrize('name', MODELS)
def test_poses_are_those_of_the_reference(name, golden_poses):
    arm = Arm(MODELS[name])
    for case in golden_poses[name]['cases']:
        pose = arm.forward(case['q'])
        reference = Pose(tuple(case['position']), tuple(case['quaternion_xyzw']))
        assert pose.distance_to(reference) < 1e-9, case['q']
        assert pose.angle_to(reference) < 1e-9, case['q']


@pytest.mark.parametrize('name', MODELS)
def test_nominal_poses_are_the_product_of_the_link_matrices(name, matrix_product):
    arm = Arm(MODELS[name])
    for q in random_joints(10):
        np.testing.assert_allclose(
            arm.forward(q).matrix(), matrix_product(arm.geometry, q), atol=1e-14
        )


@pytest.mark.parametrize('name', MODELS)
def test_calibrated_poses_are_the_turns_about_the_measured_axes(name, calibrated_arm_with_lines):
    arm, lines = calibrated_arm_with_lines(name, 0)
    assert max(map(abs, arm.geometry.d)) > 1.0  # d2, d3, d4 are large and cancel
    for q in random_joints(5):
        np.testing.assert_allclose(arm.forward(q).matrix(), lines.forward(q), atol=1e-10)


@pytest.mark.parametrize('is_calibrated', [False, True])
def test_pinocchio_finds_the_same_poses_and_the_same_jacobian(is_calibrated, calibrated_arm):
    pinocchio = pytest.importorskip('pinocchio')
    arm = calibrated_arm('ur10e') if is_calibrated else Arm(MODELS['ur10e'])
    model = pinocchio_model(arm)
    data, tool0 = model.createData(), model.getFrameId('tool0')
    assert list(model.names)[1:] == list(JOINT_NAMES)
    for q in random_joints(5):
        jacobian = pinocchio.computeFrameJacobian(
            model, data, q, tool0, pinocchio.LOCAL_WORLD_ALIGNED
        )
        pinocchio.framesForwardKinematics(model, data, q)
        np.testing.assert_allclose(
            arm.forward(q).matrix(), data.oMf[tool0].homogeneous, atol=1e-11
        )
        np.testing.assert_allclose(arm.jacobian(q), jacobian, atol=1e-11)


def test_the_limits_go_into_the_pinocchio_model():
    pytest.importorskip('pinocchio')
    model = pinocchio_model(Arm(MODELS['ur3e']))
    assert model.upperPositionLimit.tolist() == [2 * pi] * 5 + [np.inf]
    assert model.velocityLimit.tolist() == list(MODELS['ur3e'].max_joint_speed)
    assert model.effortLimit.tolist() == list(MODELS['ur3e'].max_joint_torque)


def test_without_pinocchio_the_error_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, 'pinocchio', None)
    with pytest.raises(ImportError, match=r'extra .collision.'):
        pinocchio_model(Arm(UR5E))


def test_rows_are_the_single_poses(calibrated_arm):
    for arm in Arm(UR5E), calibrated_arm('ur5e'):
        q = random_joints(50)
        rows = arm.forward_rows(q)
        assert rows.shape == (50, 7)
        for row, joints in zip(rows, q, strict=True):
            np.testing.assert_allclose(row, arm.forward(joints).row(), atol=1e-13)


def test_no_rows_give_no_rows():
    assert Arm(UR5E).forward_rows(np.empty((0, 6))).shape == (0, 7)


def test_frames_end_in_the_flange(calibrated_arm):
    arm = calibrated_arm('ur5e')
    for q in random_joints(5):
        frames, matrix = arm.frames(q), arm.forward(q).matrix()
        np.testing.assert_allclose(frames.position, matrix[:3, 3], atol=1e-11)
        np.testing.assert_allclose(
            np.column_stack([frames.x, frames.y, frames.z]), matrix[:3, :3], atol=1e-13
        )


@pytest.mark.parametrize(
    'T_flange_tcp', [Pose(), Pose.from_rotation_vector((0.05, -0.1, 0.2, 0.3, 0.2, -0.4))]
)
def test_the_jacobian_is_the_derivative_of_the_tcp(T_flange_tcp, calibrated_arm):
    step = 1e-5
    for arm in Arm(UR5E), calibrated_arm('ur5e'):
        for q in random_joints(3):
            jacobian = arm.jacobian(q, T_flange_tcp)
            assert jacobian.shape == (6, 6)
            for joint in range(6):
                change = np.eye(6)[joint] * step
                before, after = (arm.forward(q + c) @ T_flange_tcp for c in (-change, change))
                turn = (
                    Pose(quaternion=after.quaternion)
                    @ Pose(quaternion=before.quaternion).inverse()
                )
                twist = np.concatenate(
                    [np.subtract(after.position, before.position), turn.rotation_vector()[3:]]
                )
                np.testing.assert_allclose(jacobian[:, joint], twist / (2 * step), atol=2e-8)


@settings(max_examples=50)
@given(q=JOINTS)
def test_forward_gives_unit_quaternions_with_w_not_negative(q):
    quaternion = Arm(UR5E).forward(q).quaternion
    assert abs(sum(v * v for v in quaternion) - 1.0) < 1e-14
    assert quaternion[3] >= 0.0


@settings(max_examples=50)
@given(q=JOINTS, joint=st.integers(0, 5))
def test_a_full_turn_of_a_joint_changes_nothing(q, joint):
    arm = Arm(UR5E)
    turned = [angle + 2 * pi * (i == joint) for i, angle in enumerate(q)]
    assert arm.forward(q).distance_to(arm.forward(turned)) < 1e-14
    assert arm.forward(q).angle_to(arm.forward(turned)) < 1e-14


def test_five_joints_are_not_an_arm():
    with pytest.raises(ValueError, match='shorter'):
        Arm(UR5E).forward((0.0,) * 5)


def test_a_table_with_pi_rounded_as_controllers_report_it_is_the_nominal_one():
    reported = replace(
        UR5E.geometry, alpha=(1.570796327, 0.0, 0.0, 1.570796327, -1.570796327, 0.0)
    )
    assert not Arm(UR5E, reported).calibrated
    assert Arm(UR5E, reported).geometry is UR5E.geometry


def test_a_table_that_differs_is_a_calibration():
    geometry = replace(UR5E.geometry, a=(1e-5, *UR5E.geometry.a[1:]))
    arm = Arm(UR5E, geometry)
    assert arm.calibrated
    assert arm.geometry is geometry
    assert repr(arm) == '<Arm ur5e, calibrated>'
    assert pose_from_row(arm.forward_rows(np.zeros((1, 6)))[0]).distance_to(
        Arm(UR5E).forward((0.0,) * 6)
    ) == pytest.approx(1e-5)


def test_two_arms_are_as_far_apart_as_their_flanges():
    nominal = Arm(UR5E)
    assert nominal.max_flange_distance(nominal) == 0.0
    longer = replace(UR5E.geometry, d=(UR5E.geometry.d[0] + 0.02, *UR5E.geometry.d[1:]))
    assert Arm(UR5E, longer).max_flange_distance(nominal) == pytest.approx(0.02)


def test_parallel_axes_far_away_move_no_flange():
    # Axes 2 and 3 are parallel: d2 and d3 shift the same thing, and may cancel.
    d = UR5E.geometry.d
    shifted = replace(UR5E.geometry, d=(d[0], d[1] + 300.0, d[2] - 300.0, *d[3:]))
    assert Arm(UR5E, shifted).max_flange_distance(Arm(UR5E)) < 1e-9
