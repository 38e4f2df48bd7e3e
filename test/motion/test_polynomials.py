# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Polynomials have what was asked at their ends, and consistent derivatives."""

import numpy as np
import pytest

from ur_cartesian_driver.motion.geometry.polynomials import (
    cubic_rows,
    evaluate,
    MotionRows,
    quintic_rows,
)


def random_rates(seed):
    return MotionRows(*np.random.default_rng(seed).normal(size=(3, 20, 4)))


DURATIONS = np.random.default_rng(3).uniform(0.01, 3.0, 20)


@pytest.mark.parametrize(('between', 'kept'), [(cubic_rows, 2), (quintic_rows, 3)])
def test_both_ends_are_what_was_asked(between, kept):
    start, end = random_rates(1), random_rates(2)
    coefficients = between(DURATIONS, start, end)
    for asked, times in ((start, np.zeros(20)), (end, DURATIONS)):
        for got, wanted in list(zip(evaluate(coefficients, times), asked, strict=True))[:kept]:
            # Divided by T^2: rounding counts more in shorter pieces.
            assert (np.abs(got - wanted) * DURATIONS[:, None] ** 2).max() < 1e-10


def test_velocity_and_acceleration_are_the_derivatives():
    coefficients = np.random.default_rng(5).normal(size=(20, 6, 4))
    t, h = np.random.default_rng(6).uniform(0.1, 1.0, 20), 1e-6
    at, before, after = (evaluate(coefficients, t + k * h) for k in (0, -1, 1))
    np.testing.assert_allclose((after.x - before.x) / (2.0 * h), at.v, rtol=1e-6, atol=1e-7)
    np.testing.assert_allclose((after.v - before.v) / (2.0 * h), at.a, rtol=1e-6, atol=1e-6)
