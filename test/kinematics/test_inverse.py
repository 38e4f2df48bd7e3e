# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The inverse kinematics finds every solution, and the one that was meant."""

from dataclasses import replace
from functools import partial
from itertools import pairwise, product
from math import acos, cos, dist, pi, remainder, sin, tau
import re

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.inverse import (
    explain_unreachable,
    format_distinct,
    nearest,
    nearest_to_posture,
    solutions,
)
from ur_cartesian_driver.kinematics.inverse_rows import branch_measures
from ur_cartesian_driver.kinematics.robot_models import MODELS
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import vector6

UR5E = Arm(MODELS['ur5e'])


def is_well_defined(q: tuple[float, ...]) -> bool:
    """
    Tell whether the pose of these joints says where the wrist is.

    Where a stretched elbow meets a wrist that is less than a microradian from singular, but not
    singular, the rounding of the pose decides whether and where there is a solution.
    """
    return abs(sin(q[2])) > 1e-6 or not 2e-10 < abs(sin(q[4])) < 1e-6


JOINTS = st.tuples(*[st.floats(-pi, pi)] * 6).filter(is_well_defined)
JOINTS_OF_ALL_TURNS = st.tuples(*[st.floats(-tau, tau)] * 6).filter(is_well_defined)
TOOL_DOWN = (1.0, 0.0, 0.0, 0.0)
# A UR5e in an everyday posture.
READY = (0.3, -1.6, 1.9, -1.8, -1.5, 0.4)


def random_joints(n, seed=0):
    return [tuple(row) for row in np.random.default_rng(seed).uniform(-pi, pi, (n, 6)).tolist()]


def above_the_shoulder(arm):
    """Joint positions that put the wrist centre on the inner cylinder."""
    _, a2, a3, *_ = arm.geometry.a
    theta2 = -1.2
    theta23 = acos(-a2 * cos(theta2) / a3)
    return (0.4, theta2, theta23 - theta2, pi - theta23, 0.6, 0.2)


def miss(a, b):
    """Return the largest difference of two joint vectors, modulo full turns."""
    return max(abs(remainder(x - y, tau)) for x, y in zip(a, b, strict=True))


def assert_reached(arm, q, T_base_flange, within=1e-9):
    reached = arm.forward(q)
    assert reached.distance_to(T_base_flange) < within, q
    assert reached.angle_to(T_base_flange) < within, q


def assert_all_solve(arm, found, T_base_flange):
    assert found
    for q in found:
        assert_reached(arm, q, T_base_flange)
        assert all(-pi < angle <= pi for angle in q)


# --- Every solution ----------------------------------------------------------------------------


@pytest.mark.parametrize('name', MODELS)
def test_all_solutions_lead_to_the_pose_and_the_source_is_one_of_them(name):
    arm = Arm(MODELS[name])
    for q in random_joints(40):
        T_base_flange = arm.forward(q)
        found = solutions(arm, T_base_flange)
        assert_all_solve(arm, found, T_base_flange)
        assert min(miss(q, other) for other in found) < 1e-9
        assert len(found) in (2, 4, 6, 8)


@pytest.mark.parametrize('name', MODELS)
def test_solutions_of_a_calibrated_arm_are_exact_and_the_source_is_one(name, calibrated_arm):
    arm = calibrated_arm(name)
    for q in random_joints(3):
        T_base_flange = arm.forward(q)
        found = solutions(arm, T_base_flange, seed=q)
        assert_all_solve(arm, found, T_base_flange)
        assert min(miss(q, other) for other in found) < 1e-5


def test_every_solution_finds_all_the_others():
    for q in random_joints(20):
        found = solutions(UR5E, UR5E.forward(q))
        for other in found:
            again = solutions(UR5E, UR5E.forward(other))
            assert len(again) == len(found)
            for one in found:
                assert min(miss(one, candidate) for candidate in again) < 1e-6


def test_the_solutions_are_different():
    for q in random_joints(20):
        found = solutions(UR5E, UR5E.forward(q))
        for i, one in enumerate(found):
            assert all(miss(one, other) > 1e-6 for other in found[:i])


def test_an_everyday_pose_has_eight_solutions_also_when_calibrated(calibrated_arm):
    for arm in UR5E, calibrated_arm('ur5e'):
        assert len(solutions(arm, arm.forward(READY))) == 8


@pytest.mark.parametrize('name', MODELS)
def test_where_solutions_meet_the_source_is_found(name, singular_postures):
    nominal = Arm(MODELS[name])
    branch_measures = [*singular_postures.values(), above_the_shoulder(nominal)]
    for q in branch_measures:
        T_base_flange = nominal.forward(q)
        found = solutions(nominal, T_base_flange, seed=q)
        assert_all_solve(nominal, found, T_base_flange)
        assert min(miss(q, other) for other in found) < 1e-5


@pytest.mark.parametrize('name', ['ur3e', 'ur5', 'ur20'])
def test_where_solutions_meet_a_calibrated_arm_finds_the_seed(
    name, singular_postures, calibrated_arm
):
    arm = calibrated_arm(name)
    for q in singular_postures.values():
        T_base_flange = arm.forward(q)
        found = solutions(arm, T_base_flange, seed=q)
        assert_all_solve(arm, found, T_base_flange)
        assert min(miss(q, other) for other in found) < 1e-4


def test_upright_home_has_solutions_without_a_seed(singular_postures, calibrated_arm):
    home = singular_postures['upright, the home position']
    for arm in UR5E, calibrated_arm('ur5e'):
        assert_all_solve(arm, solutions(arm, arm.forward(home)), arm.forward(home))


def test_with_a_straight_wrist_wrist_3_is_that_of_the_seed(singular_postures):
    T_base_flange = UR5E.forward(singular_postures['wrist straight'])
    seed = (0.0, 0.0, 0.0, 0.0, 0.0, -2.5)
    straight = [q for q in solutions(UR5E, T_base_flange, seed) if abs(q[4]) < 1e-9]
    assert len(straight) == 2
    assert all(q[5] == pytest.approx(-2.5) for q in straight)


def test_a_pose_off_by_rounding_beyond_the_stretched_arm_is_reached():
    q = (0.3, -1.0, 0.0, -0.5, 0.4, 0.7)
    x, y, z = UR5E.forward(q).position
    outward = 1.0 + 1e-10
    pose = Pose((x * outward, y * outward, z), UR5E.forward(q).quaternion)
    assert_all_solve(UR5E, solutions(UR5E, pose), pose)


@settings(max_examples=100)
@given(q=JOINTS)
def test_what_goes_forward_comes_back(q):
    T_base_flange = UR5E.forward(q)
    assert_all_solve(UR5E, solutions(UR5E, T_base_flange, seed=q), T_base_flange)


@settings(max_examples=100)
@given(
    x=st.floats(-1.2, 1.2),
    y=st.floats(-1.2, 1.2),
    z=st.floats(-1.2, 1.2),
    rotation=st.tuples(*[st.floats(-pi, pi)] * 3),
)
def test_a_pose_either_has_solutions_or_a_reason_why_not(x, y, z, rotation):
    pose = Pose.from_rotation_vector((x, y, z, *rotation))
    found = solutions(UR5E, pose)
    for q in found:
        assert_reached(UR5E, q, pose, within=1e-8)
    assert bool(found) != bool(explain_unreachable(UR5E, pose))


# --- The nearest -------------------------------------------------------------------------------


def all_turns(q):
    return product(
        *[[angle + k * tau for k in (-1, 0, 1) if abs(angle + k * tau) <= tau] for angle in q]
    )


def test_the_nearest_is_the_nearest_of_every_branch_and_every_turn():
    rng = np.random.default_rng(2)
    T_base_flange = UR5E.forward(READY)
    everything = [q for found in solutions(UR5E, T_base_flange) for q in all_turns(found)]
    for q_near in rng.uniform(-tau, tau, (5, 6)).tolist():
        expected = min(everything, key=partial(dist, q_near))
        assert dist(nearest(UR5E, T_base_flange, q_near), expected) < 1e-9


@settings(max_examples=50)
@given(q=JOINTS_OF_ALL_TURNS)
def test_the_nearest_to_a_solution_is_that_solution_in_the_same_turn(q):
    found = nearest(UR5E, UR5E.forward(q), q)
    assert found is not None
    # Near a singularity rounding of the pose moves the solution; a micrometre is far from a turn.
    assert dist(found, q) < 1e-3


def test_the_nearest_of_a_calibrated_arm_is_the_source_in_its_turn(calibrated_arm):
    arm = calibrated_arm('ur16e')
    for q in random_joints(10, seed=4):
        q = tuple(angle - tau if angle > 0 else angle for angle in q)
        q_near = tuple(angle + 0.003 for angle in q)
        found = nearest(arm, arm.forward(q), q_near)
        assert_reached(arm, found, arm.forward(q))
        assert dist(found, q_near) <= dist(q, q_near) + 1e-6


def test_the_nearest_of_a_calibrated_arm_is_the_nearest_of_its_solutions(calibrated_arm):
    arm = calibrated_arm('ur10e')
    T_base_flange = arm.forward(READY)
    everything = [q for found in solutions(arm, T_base_flange) for q in all_turns(found)]
    for q_near in random_joints(5, seed=6):
        expected = min(everything, key=partial(dist, q_near))
        assert dist(nearest(arm, T_base_flange, q_near), expected) < 1e-6


def test_following_a_path_of_a_calibrated_arm_stays_on_one_branch(calibrated_arm):
    arm = calibrated_arm('ur5e')
    start = arm.forward(READY)
    end = Pose(
        (start.position[0] + 0.1, start.position[1] - 0.2, start.position[2]), start.quaternion
    )
    path = [READY]
    for i in range(1, 21):
        path.append(nearest(arm, start.interpolate(end, i / 20), path[-1]))
        assert_reached(arm, path[-1], start.interpolate(end, i / 20))
    assert max(dist(a, b) for a, b in pairwise(path)) < 0.05


def test_an_endless_wrist_turns_to_where_it_is_near():
    arm = Arm(MODELS['ur3e'])
    q_near = (*READY[:5], READY[5] + 10 * tau)
    assert dist(nearest(arm, arm.forward(READY), q_near), q_near) < 1e-9


def test_a_limited_wrist_never_turns_beyond_its_limits():
    q_near = (*READY[:5], READY[5] + 10 * tau)
    found = nearest(UR5E, UR5E.forward(READY), q_near)
    assert -tau <= found[5] <= tau
    assert found[5] + tau > tau  # there is no turn nearer to q_near
    assert_reached(UR5E, found, UR5E.forward(READY))


def limited(arm, joint, low, high):
    limits = list(arm.model.position_limits)
    limits[joint] = (low, high)
    return Arm(replace(arm.model, position_limits=tuple(limits)))


def test_solutions_outside_the_limits_are_passed_over():
    arm = limited(UR5E, 2, -2.5, 0.0)
    found = nearest(arm, arm.forward(READY), READY)
    assert -2.5 <= found[2] <= 0.0
    assert_reached(arm, found, arm.forward(READY))


def test_a_position_on_its_limit_is_within_it():
    q = (*READY[:5], tau)
    found = nearest(UR5E, UR5E.forward(q), q)
    assert dist(found, q) < 1e-9
    assert found[5] <= tau


def test_out_of_reach_there_is_no_nearest(calibrated_arm):
    far = Pose((2.0, 0.0, 0.3), TOOL_DOWN)
    for arm in UR5E, calibrated_arm('ur5e'):
        assert nearest(arm, far, READY) is None
        assert nearest_to_posture(arm, far, {2: 1.0}, READY) is None
        assert solutions(arm, far) == []


# --- Next to a singularity of a calibrated arm -------------------------------------------------


def next_to(singularity, arm, n):
    """Joint positions close to one singularity and away from the two others."""
    rows = np.random.default_rng(17).uniform(-pi, pi, (40 * n, 6))
    if singularity == 'elbow':
        rows[:, 2] *= 0.03
    if singularity == 'wrist':
        rows[:, 4] *= 0.01
    measures = branch_measures(arm, rows)
    size = {
        'shoulder': np.abs(measures.shoulder) / 0.1,
        'elbow': np.abs(measures.elbow) / 0.3,
        'wrist': np.abs(measures.wrist) / 0.3,
    }
    away = np.all([size[name] > 1.0 for name in size if name != singularity], axis=0)
    return [tuple(row) for row in rows[away & (size[singularity] < 0.33)][:n].tolist()]


@pytest.mark.slow
@pytest.mark.parametrize('singularity', ['shoulder', 'elbow', 'wrist'])
@pytest.mark.parametrize('name', ['ur3', 'ur5e', 'ur20'])
def test_twins_are_found_without_a_seed(name, singularity, calibrated_arm):
    arm = calibrated_arm(name, 3)
    rows = next_to(singularity, arm, 40)
    assert len(rows) > 20
    missed = 0
    for q in rows:
        T_base_flange = arm.forward(q)
        found = solutions(arm, T_base_flange)
        assert_all_solve(arm, found, T_base_flange)
        missed += min(miss(q, other) for other in found) > 1e-4
    # Where the wrist is straight to the arm's misfit the iteration does not always get there.
    assert missed <= (singularity == 'wrist')


@pytest.mark.slow
@pytest.mark.parametrize('singularity', ['shoulder', 'elbow', 'wrist'])
def test_of_twins_the_nearest_is_the_nearer(singularity, calibrated_arm):
    arm = calibrated_arm('ur10', 3)
    for q in next_to(singularity, arm, 20):
        T_base_flange = arm.forward(q)
        found = solutions(arm, T_base_flange, seed=q)
        for solution in found:
            q_near = vector6(angle + 0.02 for angle in solution)
            least = min(
                dist(q_near, turned)
                for other in found
                for turned in [
                    tuple(
                        near + remainder(angle - near, tau)
                        for angle, near in zip(other, q_near, strict=True)
                    )
                ]
            )
            assert dist(nearest(arm, T_base_flange, q_near), q_near) < least + 1e-6


# --- Partial postures --------------------------------------------------------------------------


@pytest.mark.parametrize('is_calibrated', [False, True])
@pytest.mark.parametrize(('named', 'sign'), [({2: 1.5}, 1), ({2: -1.5}, -1), ({4: 1.0}, 1)])
def test_a_named_joint_decides_the_branch(named, sign, is_calibrated, calibrated_arm):
    arm = calibrated_arm('ur5e') if is_calibrated else UR5E
    found = nearest_to_posture(arm, arm.forward(READY), named, READY)
    assert_reached(arm, found, arm.forward(READY))
    for joint in named:
        assert found[joint] * sign > 0


@pytest.mark.parametrize('is_calibrated', [False, True])
def test_of_equally_near_solutions_the_one_near_to_before_is_taken(is_calibrated, calibrated_arm):
    # Four solutions have this shoulder pan (in a calibrated arm within milliradians).
    arm = calibrated_arm('ur5e') if is_calibrated else UR5E
    T_base_flange = arm.forward(READY)
    for before in solutions(arm, T_base_flange):
        found = nearest_to_posture(arm, T_base_flange, {0: before[0]}, before)
        assert dist(found, before) < 1e-6


def test_no_named_joint_means_the_nearest_to_before():
    T_base_flange = UR5E.forward(READY)
    for before in random_joints(5):
        assert nearest_to_posture(UR5E, T_base_flange, {}, before) == nearest(
            UR5E, T_base_flange, before
        )


def test_turns_count_in_the_named_joints():
    wrist_3 = READY[5] - tau
    found = nearest_to_posture(UR5E, UR5E.forward(READY), {5: wrist_3, 2: READY[2]}, READY)
    assert found[5] == pytest.approx(wrist_3)
    assert dist(found[:5], READY[:5]) < 1e-9


def test_of_two_turns_equally_near_the_one_near_to_before_is_taken():
    q = (*READY[:5], pi)
    for before in (*READY[:5], 3.0), (*READY[:5], -3.0):
        named = {**dict(enumerate(READY)), 5: 0.0}
        found = nearest_to_posture(UR5E, UR5E.forward(q), named, before)
        assert found[5] == pytest.approx(pi if before[5] > 0 else -pi)


# --- Reasons -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ('position', 'reason'),
    [
        (
            (2.0, 0.0, 0.3),
            r'wrist 1 would be 1\.\d{4} m from the shoulder, and upper arm and '
            r'forearm together reach 0\.8172 m',
        ),
        (
            (0.05, 0.02, 0.9),
            r'the wrist would be 0\.0539 m from the axis of the base, and it '
            r'cannot come nearer than 0\.1333 m',
        ),
    ],
)
def test_the_reason_names_the_distance_and_the_bound(position, reason):
    clause = explain_unreachable(UR5E, Pose(position, TOOL_DOWN))
    assert re.search(reason, clause), clause


@pytest.mark.parametrize(
    ('value', 'bound', 'texts'),
    [
        (0.9, 0.8172, ('0.9000', '0.8172')),
        (0.817203, 0.8172, ('0.817203', '0.817200')),
        (0.8172, 0.8172, ('0.817200000', '0.817200000')),
        (1e300, 0.8172, ('1e+300', '0.8172')),
    ],
)
def test_a_value_beyond_its_bound_reads_as_another_number(value, bound, texts):
    assert format_distinct(value, bound) == texts


def test_a_reachable_pose_has_no_reason(calibrated_arm):
    for arm in UR5E, calibrated_arm('ur5e'):
        assert explain_unreachable(arm, arm.forward(READY)) == ''


def test_the_reason_names_the_joint_and_its_limits():
    arm = limited(UR5E, 0, 1.0, 1.2)
    clause = explain_unreachable(arm, arm.forward(READY))
    assert clause == (
        'shoulder_pan_joint would be at 0.3000 rad, outside its range of 1.0000 to 1.2000 rad'
    )


def test_a_folded_arm_is_named_as_the_reason():
    # The only arm whose links differ by more than twice d5, so that no flip of the wrist helps.
    arm = Arm(MODELS['ur8long'])
    clause = explain_unreachable(arm, Pose((0.0, -0.1824, 0.35)))
    assert clause == (
        'wrist 1 would be 0.1366 m from the shoulder, and the folded arm comes no '
        'nearer than 0.1840 m'
    )


# --- Sweeps ------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize('name', MODELS)
def test_a_thousand_poses_come_back(name):
    arm = Arm(MODELS[name])
    for q in random_joints(1000, seed=9):
        found = solutions(arm, arm.forward(q))
        assert_all_solve(arm, found, arm.forward(q))
        assert min(miss(q, other) for other in found) < 1e-8


@pytest.mark.slow
@pytest.mark.parametrize('name', MODELS)
def test_many_poses_of_many_calibrated_arms_come_back(name, calibrated_arm):
    missed = 0
    for seed in range(3):
        arm = calibrated_arm(name, seed)
        for q in random_joints(60, seed=seed):
            T_base_flange = arm.forward(q)
            found = solutions(arm, T_base_flange)
            assert_all_solve(arm, found, T_base_flange)
            missed += min(miss(q, other) for other in found) > 1e-4
            near = nearest(arm, T_base_flange, q)
            assert dist(near, q) < 1e-4
    # Without a seed a branch may be missed next to two singularities; see solutions().
    assert missed <= 1


@pytest.mark.parametrize('name', MODELS)
def test_a_wrist_on_the_axis_of_the_base_is_out_of_reach(name, calibrated_arm):
    tool_down = Pose((0.0, 0.0, 0.4), (1.0, 0.0, 0.0, 0.0))
    for arm in (Arm(MODELS[name]), *(calibrated_arm(name, seed) for seed in range(4))):
        assert solutions(arm, tool_down) == []
        assert nearest(arm, tool_down, (0.0,) * 6) is None
        assert 'the centre of the wrist would be' in explain_unreachable(arm, tool_down)


@pytest.mark.parametrize('position', [(1e160, 0.0, 0.4), (0.3, float('nan'), 0.3)])
def test_numbers_that_no_arm_can_have_are_out_of_reach(position, calibrated_arm):
    for arm in (UR5E, calibrated_arm('ur5e')):
        far = Pose(position, (1.0, 0.0, 0.0, 0.0))
        assert solutions(arm, far) == []
        assert nearest(arm, far, (0.0,) * 6) is None
        assert explain_unreachable(arm, far) == 'it is more than 1000 m away'
