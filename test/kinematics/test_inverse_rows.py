# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Many poses at once have the solutions that they have one by one, and these lead to the poses."""

from dataclasses import replace
from math import acos, cos, hypot, nan, pi, tau

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from ur_cartesian_driver.kinematics.chain import Arm, jacobian_at
from ur_cartesian_driver.kinematics.closed_form import wrist_centre
from ur_cartesian_driver.kinematics.closed_form_rows import branch_rows, BRANCHES, TargetPoses
from ur_cartesian_driver.kinematics.ideal_arm import ideal_arm_of
from ur_cartesian_driver.kinematics.inverse import nearest, solutions
from ur_cartesian_driver.kinematics.inverse_rows import (
    branch_measures,
    nearest_rows,
    refine,
    solve_path,
)
from ur_cartesian_driver.kinematics.robot_models import MODELS
from ur_cartesian_driver.motion.geometry.pose import (
    Pose,
    pose_from_row,
    pose_rows,
    quaternion_from_rotation_vector,
)

UR5E = Arm(MODELS['ur5e'])
READY = (0.3, -1.6, 1.9, -1.8, -1.5, 0.4)


def random_rows(n, seed=0, bound=pi):
    return np.random.default_rng(seed).uniform(-bound, bound, (n, 6))


def walk(n, start, stride, seed=0):
    """Joint positions that wander, through singularities too."""
    return start + np.cumsum(np.random.default_rng(seed).normal(0, stride, (n, 6)), axis=0)


def above_the_shoulder(arm):
    """Joint positions that put the wrist centre on the inner cylinder."""
    _, a2, a3, *_ = arm.geometry.a
    theta2 = -1.2
    theta23 = acos(-a2 * cos(theta2) / a3)
    return (0.4, theta2, theta23 - theta2, pi - theta23, 0.6, 0.2)


def miss(a, b):
    """Return the largest difference of joints in each row, modulo full turns."""
    difference = np.asarray(a) - np.asarray(b)
    return np.abs(difference - tau * np.rint(difference / tau)).max(axis=-1)


def all_branches(arm, poses):
    """Angles (n, 8, 6) of a nominal arm by branch, and which of them there are (n, 8)."""
    targets = TargetPoses.of(poses)
    found = [branch_rows(ideal_arm_of(arm), targets, signs) for signs in BRANCHES]
    q = np.stack([branch.q.T for branch in found], axis=1)
    return q, np.stack([branch.exists for branch in found], axis=1)


def distinct(rows, within=1e-6):
    """The rows without those that are the same as one before: branches that meet."""
    kept = []
    for row in rows:
        if not kept or miss(kept, row).min() > within:
            kept.append(row)
    return np.array(kept)


# --- All branches ------------------------------------------------------------------------------


@pytest.mark.parametrize('name', MODELS)
def test_the_reference_is_among_the_branches_and_all_lead_to_it(
    name, golden_poses, matrix_product
):
    arm, cases = Arm(MODELS[name]), golden_poses[name]['cases']
    poses = np.array([case['position'] + case['quaternion_xyzw'] for case in cases])
    found = all_branches(arm, poses)
    for case, q, exists, pose in zip(cases, *found, poses, strict=True):
        for joints in q[exists]:
            np.testing.assert_allclose(
                matrix_product(arm.geometry, joints), pose_from_row(pose).matrix(), atol=1e-9
            )
        assert len(solutions(arm, pose_from_row(pose))) == len(distinct(q[exists]))
        wrist_3_counts = abs(np.sin(case['q'][4])) > 1e-6
        if wrist_3_counts:
            assert miss(q[exists], case['q']).min() < 1e-6, case['q']


@pytest.mark.parametrize('name', MODELS)
def test_the_branches_are_the_solutions_of_each_pose(name):
    arm = Arm(MODELS[name])
    poses = arm.forward_rows(random_rows(60))
    for q, exists, pose in zip(*all_branches(arm, poses), poses, strict=True):
        single = solutions(arm, pose_from_row(pose))
        assert len(single) == exists.sum()
        for solution in single:
            assert miss(q[exists], solution).min() < 1e-7


@pytest.mark.parametrize('name', MODELS)
def test_singular_and_stretched_poses_have_branches(name, singular_postures):
    arm = Arm(MODELS[name])
    poses = arm.forward_rows(np.array([*singular_postures.values(), above_the_shoulder(arm)]))
    for q, exists, pose in zip(*all_branches(arm, poses), poses, strict=True):
        assert exists.any()
        for joints in q[exists]:
            np.testing.assert_allclose(
                arm.forward(joints).matrix(), pose_from_row(pose).matrix(), atol=1e-9
            )


@pytest.mark.parametrize('name', MODELS)
def test_a_calibrated_arm_comes_back_to_singular_and_stretched_postures(
    name, singular_postures, calibrated_arm
):
    arm = calibrated_arm(name)
    source = np.array([*singular_postures.values(), above_the_shoulder(Arm(MODELS[name]))])
    poses = arm.forward_rows(source)
    for q, pose in zip(nearest_rows(arm, poses, source), poses, strict=True):
        np.testing.assert_allclose(
            arm.forward(q).matrix(), pose_from_row(pose).matrix(), atol=1e-9
        )


def test_the_index_of_a_branch_is_its_number():
    q, exists = all_branches(UR5E, UR5E.forward_rows(walk(20, READY, 0.01)))
    assert exists.all()
    for place in range(8):
        assert (branch_measures(UR5E, q[:, place]).branch == place).all()


def test_poses_out_of_reach_have_no_branch():
    _, exists = all_branches(UR5E, pose_rows([Pose((2.0, 0.0, 0.3)), Pose((0.0, 0.0, 0.5))]))
    assert not exists.any()


def test_with_a_straight_wrist_wrist_3_is_zero(singular_postures):
    poses = pose_rows([UR5E.forward(singular_postures['wrist straight'])])
    q = all_branches(UR5E, poses)[0][0]
    straight = q[np.abs(q[:, 4]) < 1e-9]
    assert len(straight)
    assert straight[:, 5] == pytest.approx(0.0)


# --- Along a path ------------------------------------------------------------------------------


def one_by_one(arm, poses, before):
    rows = []
    for pose in poses:
        solution = nearest(arm, pose_from_row(pose), before)
        rows.append((nan,) * 6 if solution is None else solution)
        before = solution or before
    return np.array(rows)


@pytest.mark.parametrize('is_calibrated', [False, True])
@pytest.mark.parametrize('name', ['ur3', 'ur5e', 'ur8long', 'ur20'])
def test_a_path_is_followed_as_the_nearest_from_row_to_row(name, is_calibrated, calibrated_arm):
    arm = calibrated_arm(name) if is_calibrated else Arm(MODELS[name])
    for seed in range(2):
        start = random_rows(1, seed=seed)[0]
        poses = arm.forward_rows(walk(120, start, 0.03, seed))
        path = solve_path(arm, poses, tuple(start))
        np.testing.assert_allclose(path.q, one_by_one(arm, poses, tuple(start)), atol=1e-6)


def test_poses_without_any_order_are_followed_as_the_nearest_too():
    poses = UR5E.forward_rows(random_rows(100, seed=3))
    path = solve_path(UR5E, poses, READY)
    np.testing.assert_allclose(path.q, one_by_one(UR5E, poses, READY), atol=1e-6)


@pytest.mark.parametrize('is_calibrated', [False, True])
def test_the_nearest_of_many_are_the_nearest_of_each(is_calibrated, calibrated_arm):
    arm = calibrated_arm('ur10e') if is_calibrated else Arm(MODELS['ur10e'])
    rows = random_rows(60, seed=5)
    near = rows + np.random.default_rng(6).uniform(-0.3, 0.3, rows.shape)
    poses = arm.forward_rows(rows)
    poses[::10, 2] += 3.0  # out of reach
    wanted = [
        nearest(arm, pose_from_row(pose), tuple(q)) or (nan,) * 6
        for pose, q in zip(poses, near, strict=True)
    ]
    np.testing.assert_allclose(nearest_rows(arm, poses, near), wanted, atol=1e-6)


@pytest.mark.parametrize('name', MODELS)
def test_a_long_path_comes_back_in_its_turns(name, calibrated_arm_with_lines):
    arm, lines = calibrated_arm_with_lines(name, 2)
    begin = np.array([-4.0, -1.7, 1.2, -2.3, 0.6, -5.0])
    end = np.array([4.0, -1.3, 2.0, 2.0, 2.3, 5.0])
    source = begin + np.linspace(0.0, 1.0, 1500)[:, None] * (end - begin)
    for arm_of_it in arm, Arm(MODELS[name]):
        path = solve_path(arm_of_it, arm_of_it.forward_rows(source), tuple(begin))
        assert np.abs(path.q - source).max() < 1e-8
        assert path.found.all()
        assert path.step.max() < 0.01
    for q in source[::300]:
        np.testing.assert_allclose(arm.forward(q).matrix(), lines.forward(q), atol=1e-9)


def test_at_a_limit_the_arm_jumps_and_the_step_tells():
    source = np.linspace((*READY[:5], 5.5), (*READY[:5], 7.0), 100)
    path = solve_path(UR5E, UR5E.forward_rows(source), tuple(source[0]))
    (row,) = np.flatnonzero(path.step > 1.0)
    assert source[row - 1, 5] <= tau < source[row, 5]
    assert path.step[row] > 2.0
    assert np.abs(path.q).max() <= tau


def test_a_branch_that_the_limits_forbid_is_left():
    arm = Arm(
        replace(
            UR5E.model, position_limits=((-tau, tau),) * 2 + ((-tau, 2.1),) + ((-tau, tau),) * 3
        )
    )
    source = np.linspace(READY, (0.3, -1.6, 2.3, -1.8, -1.5, 0.4), 100)
    path = solve_path(arm, arm.forward_rows(source), READY)
    row = int(np.argmax(path.step))
    assert source[row - 1, 2] <= 2.1 < source[row, 2]
    assert path.found.all()
    assert (
        branch_measures(arm, path.q[[row - 1, row]]).branch[0]
        != branch_measures(arm, path.q[[row - 1, row]]).branch[1]
    )


def test_rows_out_of_reach_are_passed_over(calibrated_arm):
    for arm in UR5E, calibrated_arm('ur5e'):
        poses = arm.forward_rows(walk(60, READY, 0.005))
        poses[20:30, 0] += 3.0
        path = solve_path(arm, poses, READY)
        assert np.flatnonzero(~path.found).tolist() == list(range(20, 30))
        assert np.isnan(path.q[20:30]).all()
        assert np.isnan(path.step[20:30]).all()
        assert path.step[30] < 0.2


def test_rows_are_exact_only_at_their_poses_also_in_singularities(singular_postures):
    for q in (*singular_postures.values(), above_the_shoulder(UR5E)):
        way = np.linalg.svd(UR5E.jacobian(q))[0][:, -1]  # in which no joint moves the flange
        for distance in 0.0, *np.geomspace(1e-12, 1e-4, 17):
            position, turn = np.split(distance * way, 2)
            wanted = Pose(quaternion=quaternion_from_rotation_vector(tuple(turn))).matrix()
            wanted[:3, :3] = wanted[:3, :3] @ UR5E.forward(q).matrix()[:3, :3]
            wanted[:3, 3] = UR5E.forward(q).position + position
            targets = TargetPoses(tuple(wanted[:3, 3:]), tuple(wanted[:3, :3].reshape(9, 1)))
            found, exact = refine(UR5E, targets, np.array([q]))
            miss = np.linalg.norm(UR5E.forward(found[0]).matrix() - wanted)
            assert miss < 6e-11 if exact else distance > 1e-11


def test_a_line_beside_the_axis_of_a_straight_wrist_takes_large_steps():
    # With theta5 from -0.3 to 0.3, and 1e-4 off at the middle, the wrist must turn by half a turn.
    source = np.array([*READY[:4], 0.0, 0.4]) + np.linspace(-0.3, 0.3, 301)[:, None] * np.eye(6)[4]
    poses = UR5E.forward_rows(source)
    tilt = Pose(quaternion=(1e-4, 0.0, 0.0, 1.0)).inverse().quaternion
    poses = pose_rows([pose_from_row(row) @ Pose(quaternion=tilt) for row in poses])
    path = solve_path(UR5E, poses, tuple(source[0]))
    measures = branch_measures(UR5E, path.q)
    assert np.abs(measures.wrist).min() < 3e-3
    assert path.step.max() > 0.5
    assert abs(int(np.argmax(path.step)) - 150) < 5


def test_no_rows_are_followed_to_no_rows(calibrated_arm):
    for arm in UR5E, calibrated_arm('ur5e'):
        assert solve_path(arm, np.empty((0, 7)), READY).q.shape == (0, 6)


# --- Measures ----------------------------------------------------------------------------------


def test_measures_vanish_where_the_arm_is_singular(singular_postures):
    rows = np.array(
        [
            singular_postures['wrist straight'],
            singular_postures['stretched'],
            singular_postures['elbow folded'],
            above_the_shoulder(UR5E),
        ]
    )
    measures = branch_measures(UR5E, rows)
    assert abs(measures.wrist[0]) < 1e-12
    assert np.abs(measures.elbow[[1, 2]]).max() < 1e-12
    assert abs(measures.shoulder[3]) < 1e-12


@pytest.mark.parametrize('name', MODELS)
def test_the_shoulder_measure_is_a_leg_of_the_triangle_with_d4(name):
    arm = Arm(MODELS[name])
    rows = random_rows(20)
    for q, outward in zip(rows, branch_measures(arm, rows).shoulder, strict=True):
        x, y, _ = wrist_centre(ideal_arm_of(arm), arm.forward(q))
        assert hypot(outward, arm.geometry.d[3]) == pytest.approx(hypot(x, y), abs=1e-12)


def test_the_jacobian_loses_rank_where_a_measure_vanishes(singular_postures):
    for q in [*singular_postures.values(), above_the_shoulder(UR5E)]:
        measures = branch_measures(UR5E, np.array([q]))
        least = min(abs(float(m[0])) for m in (measures.shoulder, measures.elbow, measures.wrist))
        assert least < 1e-12
        assert np.linalg.svd(UR5E.jacobian(q))[1][-1] < 1e-12


#: Rounded, because the determinant divides by its pivots: 1 / 1e-313 is infinite.
ANGLES = st.floats(-pi, pi).map(lambda angle: round(angle, 9))


@settings(max_examples=60)
@given(q=st.tuples(*[ANGLES] * 6))
def test_the_product_of_the_measures_is_the_determinant_of_the_jacobian(q):
    measures = branch_measures(UR5E, np.array([q]))
    _, a2, a3, *_ = UR5E.geometry.a
    product = measures.shoulder[0] * measures.elbow[0] * measures.wrist[0] * a2 * a3
    assert np.linalg.det(UR5E.jacobian(q)) == pytest.approx(product, abs=1e-13) or (
        np.linalg.det(UR5E.jacobian(q)) == pytest.approx(-product, abs=1e-13)
    )


# --- The chain in rows -------------------------------------------------------------------------


def test_jacobians_of_rows_are_those_of_each(calibrated_arm):
    for arm in UR5E, calibrated_arm('ur5e'):
        rows = random_rows(20)
        frames = arm.frames_rows(rows)
        jacobians = jacobian_at(frames, frames.position)
        assert jacobians.shape == (20, 6, 6)
        for q, jacobian in zip(rows, jacobians, strict=True):
            np.testing.assert_allclose(jacobian, arm.jacobian(q), atol=1e-12)


# --- Sweeps ------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize('name', MODELS)
def test_ten_thousand_poses_come_back(name):
    arm = Arm(MODELS[name])
    source = random_rows(10_000, seed=11)
    poses = arm.forward_rows(source)
    joints, exists = all_branches(arm, poses)
    row, place = np.nonzero(exists)
    back = arm.forward_rows(joints[row, place])
    assert np.abs(back[:, :3] - poses[row, :3]).max() < 1e-9
    assert (1.0 - np.abs(np.einsum('ij,ij->i', back[:, 3:], poses[row, 3:]))).max() < 1e-12
    off = np.where(exists, miss(joints, source[:, None]), np.inf)
    assert off.min(axis=1).max() < 1e-6
