# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Intervals of fits contain the true parameters, also where the noise is correlated."""

import numpy as np
import pytest

from ur_cartesian_driver.identification.least_squares import (
    combined,
    correlated_mean,
    fit,
    Measured,
    student,
)

T = np.linspace(0.0, 1.0, 600)


@pytest.mark.parametrize('correlation', [0.0, 0.4, 0.7])
def test_an_interval_contains_the_true_parameter_in_95_of_100_cases(correlation):
    generator, inside = np.random.default_rng(1), 0
    follows = np.arange(len(T)) > 0
    for _ in range(200):
        noise = generator.standard_normal(len(T))
        for i in range(1, len(noise)):
            noise[i] = correlation * noise[i - 1] + noise[i]
        found = fit(lambda p: p[0] * np.exp(-p[1] * T), np.exp(-2.0 * T) + 1e-3 * noise,
                    [0.8, 1.5], follows)  # fmt: skip
        rate = found.measured(1)
        inside += abs(rate.value - 2.0) < rate.half_width
    assert 182 <= inside <= 198


def test_values_that_say_nothing_of_a_parameter_are_not_fitted():
    follows = np.arange(len(T)) > 0
    assert fit(lambda p: p[0] + 0.0 * p[1] * T, T, [0.0, 0.0], follows) is None
    assert fit(lambda p: p[0] + p[1] * T[:5], T[:5], [0.0, 0.0], follows[:5]) is None


@pytest.mark.parametrize(
    ('freedom', 'quantile'), [(1, 12.706), (3, 3.182), (5, 2.571), (10, 2.228), (1000, 1.962)]
)
def test_quantiles_are_those_of_the_tables(freedom, quantile):
    assert student(freedom) == pytest.approx(quantile, abs=4e-3)


def test_measurements_that_agree_are_averaged_by_their_weights():
    parts = [
        Measured(value=1.0, error=0.1, freedom=50),
        Measured(value=1.1, error=0.2, freedom=50),
    ]
    whole = combined(parts)
    assert whole.value == pytest.approx(1.02)
    assert whole.error == pytest.approx(0.0894, abs=1e-4)


def test_measurements_that_differ_widen_the_interval():
    parts = [Measured(value=x, error=0.01, freedom=50) for x in (1.0, 1.1, 1.2)]
    whole = combined(parts)
    assert whole.value == pytest.approx(1.1)
    assert whole.half_width == pytest.approx(4.303 * 0.1 / 3**0.5, rel=1e-3)


def test_measurements_with_one_error_are_no_better_than_one():
    parts = [Measured(value=x, error=0.1, freedom=50) for x in (1.0, 1.2, 1.1)]
    alone = correlated_mean(parts, np.zeros(2))
    assert alone.value == pytest.approx(1.1)
    assert alone.error == pytest.approx(0.1 / 3**0.5)
    pair = correlated_mean(parts[:2], np.array([0.00999]))
    assert pair.value == pytest.approx(1.1)
    assert pair.error == pytest.approx(0.1, rel=1e-3)
    covariance = np.array([[0.01, 0.004, 0.0], [0.004, 0.01, -0.002], [0.0, -0.002, 0.01]])
    whole = correlated_mean(parts, np.array([0.004, -0.002]))
    inverse = np.linalg.inv(covariance)
    assert whole.error == pytest.approx(inverse.sum() ** -0.5)
    assert whole.value == pytest.approx(inverse.sum(axis=0) @ [1.0, 1.2, 1.1] / inverse.sum())
