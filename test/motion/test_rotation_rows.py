# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Turns as rotation vectors: their angular rates are exact, for small and for large turns."""

import numpy as np
import pytest

from ur_cartesian_driver.motion.geometry.polynomials import evaluate, MotionRows
from ur_cartesian_driver.motion.geometry.pose_rows import conjugate_rows, multiply_rows
from ur_cartesian_driver.motion.geometry.rotation_rows import (
    angular_rates,
    exp_rows,
    log_rows,
    rotation_rates,
)

N = 60
TIMES = np.random.default_rng(1).uniform(0.2, 1.0, N)


def turns(size):
    return np.random.default_rng(2).normal(size=(N, 6, 3)) * size


@pytest.mark.parametrize('size', [0.0, 1e-6, 0.05, 0.7, 1.5])
def test_angular_rates_are_the_derivatives_of_the_orientation(size):
    coefficients, h = turns(size), 1e-5
    w, e = angular_rates(evaluate(coefficients, TIMES))
    before, after = (evaluate(coefficients, TIMES + k * h) for k in (-1, 1))
    moved = log_rows(multiply_rows(exp_rows(after.x), conjugate_rows(exp_rows(before.x))))
    np.testing.assert_allclose(moved / (2.0 * h), w, atol=2e-7 * (1.0 + size) ** 3)
    np.testing.assert_allclose(
        (angular_rates(after)[0] - angular_rates(before)[0]) / (2.0 * h), e, atol=1e-5 * size
    )


@pytest.mark.parametrize('angle', [0.0, 1e-9, 1e-3, 1.0, 3.1, np.pi - 1e-9])
def test_the_vector_of_a_rotation_vector_s_quaternion_is_itself(angle):
    axes = np.random.default_rng(4).normal(size=(N, 3))
    vectors = angle * axes / np.linalg.norm(axes, axis=1)[:, None]
    np.testing.assert_allclose(log_rows(exp_rows(vectors)), vectors, atol=1e-9)
    np.testing.assert_allclose(log_rows(-exp_rows(vectors)), vectors, atol=1e-9)


@pytest.mark.parametrize('angle', [0.0, 1e-7, 0.5, 3.1, 4.5])
def test_a_turn_has_the_angular_rates_that_it_was_made_for(angle):
    random = np.random.default_rng(5)
    axes = random.normal(size=(N, 3))
    r = angle * axes / np.linalg.norm(axes, axis=1)[:, None]
    w, e = random.normal(size=(2, N, 3))
    turn = rotation_rates(r, w, e)
    assert isinstance(turn, MotionRows)
    np.testing.assert_array_equal(turn.x, r)
    np.testing.assert_allclose(angular_rates(turn)[0], w, atol=1e-12)
    np.testing.assert_allclose(angular_rates(turn)[1], e, atol=1e-11)
