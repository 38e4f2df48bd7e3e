# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Poses obey the laws of rigid motions and agree with the script manual and scipy."""

import json
from math import pi
from pathlib import Path
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st
from matrices import pose_from_matrix, quaternion_from_rotation
import numpy as np
import pytest

from ur_cartesian_driver.motion.geometry.pose import (
    angle_between,
    conjugate,
    IDENTITY,
    multiply,
    normalize,
    Pose,
    pose_from_row,
    pose_rows,
    Quaternion,
    quaternion_from_rotation_vector,
    rotate,
    rotation_from_quaternion,
    rotation_vector_from_quaternion,
    slerp,
)

GOLDEN = json.loads((Path(__file__).parent / 'golden' / 'pose_math.json').read_text())

COORDINATES = st.floats(-3.0, 3.0)
VECTORS = st.tuples(COORDINATES, COORDINATES, COORDINATES)
POSES = st.builds(lambda p, r: Pose.from_rotation_vector((*p, *r)), VECTORS, VECTORS)
FRACTIONS = st.floats(0.0, 1.0)


def cases(function, table='random_cases'):
    return [case for case in GOLDEN[table] if case['function'] == function]


def pose(values):
    return Pose.from_rotation_vector(values)


def assert_same(a, b, within=1e-12):
    assert a.distance_to(b) < within, (a, b)
    assert a.angle_to(b) < within, (a, b)


def sum_of(a, b):
    """URScript's pose_add: positions are added, rotations multiplied."""
    return Pose(
        tuple(x + y for x, y in zip(a.position, b.position, strict=True)),
        multiply(a.quaternion, b.quaternion),
    )


# --- References ----------------------------------------------------------------------------------


def negated(q: Quaternion) -> Quaternion:
    """Return the other quaternion of the same rotation."""
    x, y, z, w = q
    return (-x, -y, -z, -w)


REFERENCES: dict[str, Any] = {
    'pose_trans': lambda a, b: pose(a) @ pose(b),
    'pose_inv': lambda a: pose(a).inverse(),
    'pose_add': lambda a, b: sum_of(pose(a), pose(b)),
    'interpolate_pose': lambda a, b, fraction: pose(a).interpolate(pose(b), fraction),
}


@pytest.mark.parametrize('function', REFERENCES)
def test_computed_references_are_met(function):
    assert cases(function)
    for case in cases(function):
        result = REFERENCES[function](*case['args'])
        assert_same(result, pose(case['expected']), within=1e-8 if 'near_pi' in case else 1e-12)
        if 'near_pi' not in case:  # there the axis may point either way
            assert result.rotation_vector() == pytest.approx(case['expected'], abs=1e-9)


@pytest.mark.parametrize('function', ['pose_trans', 'pose_inv'])
def test_the_examples_of_the_script_manual_are_met(function):
    for case in cases(function, 'manual_cases'):
        # The manual's vectors may be longer than pi.
        expected = pose(case['expected'])
        assert_same(REFERENCES[function](*case['args']), expected, within=2 * case['tolerance'])


# --- The group -----------------------------------------------------------------------------------


@given(a=POSES, b=POSES, c=POSES)
def test_composition_is_associative(a, b, c):
    assert_same((a @ b) @ c, a @ (b @ c))


@given(a=POSES)
def test_the_identity_changes_nothing(a):
    assert_same(a @ IDENTITY, a)
    assert_same(IDENTITY @ a, a)


@given(a=POSES)
def test_a_pose_and_its_inverse_cancel(a):
    assert_same(a @ a.inverse(), IDENTITY)
    assert_same(a.inverse() @ a, IDENTITY)
    assert_same(a.inverse().inverse(), a)


@given(a=POSES, b=POSES)
def test_the_inverse_of_a_product_is_the_product_of_the_inverses_backwards(a, b):
    assert_same((a @ b).inverse(), b.inverse() @ a.inverse())


@given(a=POSES, b=POSES)
def test_composition_is_the_product_of_the_matrices(a, b):
    np.testing.assert_allclose((a @ b).matrix(), a.matrix() @ b.matrix(), atol=1e-13)


@given(a=POSES, point=VECTORS)
def test_a_point_moves_as_with_the_matrix(a, point):
    np.testing.assert_allclose(a.apply(point), (a.matrix() @ [*point, 1.0])[:3], atol=1e-13)


def test_products_of_many_rotations_stay_of_unit_length():
    turn = Pose.from_rotation_vector((0.0, 0.0, 0.0, 0.3, -0.2, 0.1))
    product = IDENTITY
    for _ in range(10_000):
        product = product @ turn
    assert abs(np.linalg.norm(product.quaternion) - 1.0) < 1e-15


@given(a=POSES, b=POSES, c=POSES)
def test_distances_do_not_depend_on_the_frame(a, b, c):
    assert (c @ a).distance_to(c @ b) == pytest.approx(a.distance_to(b), abs=1e-12)
    assert (c @ a).angle_to(c @ b) == pytest.approx(a.angle_to(b), abs=1e-12)


# --- Conversions ---------------------------------------------------------------------------------


@given(a=POSES)
def test_the_matrix_comes_back(a):
    assert_same(pose_from_matrix(a.matrix()), a)
    assert_same(pose_from_matrix(a.matrix().tolist()), a)


@given(a=POSES)
def test_the_rotation_vector_comes_back_and_is_no_longer_than_pi(a):
    values = a.rotation_vector()
    assert np.linalg.norm(values[3:]) <= pi + 1e-12
    assert_same(pose(values), a)


@pytest.mark.parametrize(
    'vector',
    [
        (0.0, 0.0, 0.0),
        (1e-12, 0.0, 0.0),
        (0.0, -1e-9, 1e-9),
        (0.0, 1e-6, 0.0),
        (pi - 1e-9, 0.0, 0.0),
        (0.0, -3.0, 0.0),
        (1.0, -2.0, 0.5),
    ],
)
def test_rotation_vectors_shorter_than_pi_come_back_as_they_are(vector):
    quaternion = quaternion_from_rotation_vector(vector)
    assert rotation_vector_from_quaternion(quaternion) == pytest.approx(vector, abs=1e-15)


@pytest.mark.parametrize('axis', [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, -1.0)])
def test_half_a_turn_survives_the_matrix(axis):
    half_turn = quaternion_from_rotation_vector([pi * v for v in axis])
    back = quaternion_from_rotation(rotation_from_quaternion(half_turn))
    assert angle_between(half_turn, back) < 1e-15


@given(vector=VECTORS)
def test_a_rotation_matrix_is_orthogonal_and_does_not_mirror(vector):
    matrix = np.reshape(rotation_from_quaternion(quaternion_from_rotation_vector(vector)), (3, 3))
    np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(matrix) == pytest.approx(1.0)


@given(vector=VECTORS)
def test_both_quaternions_of_a_rotation_mean_the_same(vector):
    a = quaternion_from_rotation_vector(vector)
    b = negated(a)
    assert angle_between(a, b) < 1e-14
    assert rotation_vector_from_quaternion(a) == rotation_vector_from_quaternion(b)
    assert rotation_from_quaternion(a) == rotation_from_quaternion(b)


def test_a_quarter_turn_about_z_takes_x_to_y():
    quarter = quaternion_from_rotation_vector((0.0, 0.0, pi / 2))
    assert rotate(quarter, (1.0, 0.0, 0.0)) == pytest.approx((0.0, 1.0, 0.0))
    assert rotate(conjugate(quarter), (1.0, 0.0, 0.0)) == pytest.approx((0.0, -1.0, 0.0))


def test_zero_is_no_quaternion():
    with pytest.raises(ZeroDivisionError):
        normalize((0.0, 0.0, 0.0, 0.0))


@settings(max_examples=30)
@given(poses=st.lists(POSES, max_size=5))
def test_rows_come_back_as_poses(poses):
    rows = pose_rows(poses)
    assert rows.shape == (len(poses), 7)
    assert [pose_from_row(row) for row in rows] == poses


# --- Between two poses ---------------------------------------------------------------------------


@given(a=POSES, b=POSES)
def test_interpolation_begins_and_ends_at_its_poses(a, b):
    assert_same(a.interpolate(b, 0.0), a)
    assert_same(a.interpolate(b, 1.0), b)


@given(a=POSES, b=POSES, fraction=FRACTIONS)
def test_interpolation_divides_way_and_angle_in_proportion(a, b, fraction):
    between = a.interpolate(b, fraction)
    assert a.distance_to(between) == pytest.approx(fraction * a.distance_to(b), abs=1e-12)
    # Of a rotation by nearly pi the axis is ill defined, the angle is not.
    assert a.angle_to(between) == pytest.approx(fraction * a.angle_to(b), abs=1e-7)


@given(a=POSES, b=POSES, fraction=FRACTIONS)
def test_interpolation_is_the_same_backwards(a, b, fraction):
    if a.angle_to(b) < pi - 1e-3:  # half a turn has two shortest ways
        assert_same(a.interpolate(b, fraction), b.interpolate(a, 1.0 - fraction), within=1e-9)


def test_slerp_takes_the_short_way():
    a = quaternion_from_rotation_vector((0.0, 0.0, 0.1))
    b = negated(quaternion_from_rotation_vector((0.0, 0.0, 0.3)))
    middle = slerp(a, b, 0.5)
    assert angle_between(middle, quaternion_from_rotation_vector((0.0, 0.0, 0.2))) < 1e-15


def test_slerp_between_equal_orientations_stays_there():
    a = quaternion_from_rotation_vector((0.4, 0.2, 0.3))
    assert angle_between(slerp(a, a, 0.7), a) < 1e-15
