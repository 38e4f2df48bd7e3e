# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from ur_cartesian_driver.motion.geometry import vectors
from ur_cartesian_driver.motion.geometry.vectors import Vector3, vector3, Vector6, vector6

A3: Vector3 = (1.0, -2.0, 3.5)
B3: Vector3 = (0.25, 4.0, -1.0)
A6: Vector6 = (1.0, -2.0, 3.5, 0.1, -0.2, 7.0)
B6: Vector6 = (0.25, 4.0, -1.0, 3.0, 0.5, -7.0)


def test_sums_and_products_of_three_are_those_of_numpy() -> None:
    a, b = np.array(A3), np.array(B3)
    assert vectors.add(A3, B3) == tuple(a + b)
    assert vectors.subtract(A3, B3) == tuple(a - b)
    assert vectors.scale(A3, 3.0) == tuple(3.0 * a)
    assert vectors.dot(A3, B3) == pytest.approx(a @ b)
    assert vectors.cross(A3, B3) == pytest.approx(tuple(np.cross(a, b)))
    assert vectors.norm(A3) == pytest.approx(np.linalg.norm(a))
    assert vectors.unit(A3) == pytest.approx(tuple(a / np.linalg.norm(a)))


def test_sums_and_products_of_six_are_those_of_numpy() -> None:
    a, b = np.array(A6), np.array(B6)
    assert vectors.add6(A6, B6) == tuple(a + b)
    assert vectors.subtract6(A6, B6) == tuple(a - b)
    assert vectors.scale6(A6, 3.0) == tuple(3.0 * a)
    assert vectors.add_scaled6(A6, B6, 0.5) == tuple(a + 0.5 * b)


def test_a_vector_has_its_number_of_values_and_no_other() -> None:
    assert vector3(iter((1.0, 2.0, 3.0))) == (1.0, 2.0, 3.0)
    assert vector6(np.arange(6.0).tolist()) == (0.0, 1.0, 2.0, 3.0, 4.0, 5.0)
    for vector, wrong in ((vector3, (1.0, 2.0)), (vector6, (*A6, 1.0))):
        with pytest.raises(ValueError):  # noqa: PT011  # Python's words
            vector(wrong)


def test_zero_has_no_direction() -> None:
    with pytest.raises(ZeroDivisionError):
        vectors.unit(vectors.ZERO3)
