# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Polynomials that join two states of a motion: of tool positions, tool rotations or joints.

Each row is one piece of a motion: coefficients have the shape (n pieces, 6 powers, k quantities),
and the variable is the time since the piece began [s].
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Floats


class MotionRows(NamedTuple):
    """A quantity x with its first and second time derivatives v and a, each (n, k)."""

    x: Floats
    v: Floats
    a: Floats


def cubic_rows(duration: Floats, start: MotionRows, end: MotionRows) -> Floats:
    """
    Return the cubics (n, 6, k) that have x and v of both states at their ends.

    :param duration: (n,) durations of the pieces [s].
    """
    T = duration[:, None]
    d = end.x - start.x
    zero = np.zeros_like(d)
    return np.stack(
        [
            start.x,
            start.v,
            3.0 * d / T**2 - (2.0 * start.v + end.v) / T,
            -2.0 * d / T**3 + (start.v + end.v) / T**2,
            zero,
            zero,
        ],
        axis=1,
    )


def quintic_rows(duration: Floats, start: MotionRows, end: MotionRows) -> Floats:
    """Return the quintics (n, 6, k) that have x, v and a of both states at their ends."""
    T = duration[:, None]
    d, v, w, a, b = end.x - start.x, start.v, end.v, start.a, end.a
    return np.stack(
        [
            start.x,
            v,
            0.5 * a,
            (20.0 * d - (8.0 * w + 12.0 * v) * T - (3.0 * a - b) * T**2) / (2.0 * T**3),
            (-30.0 * d + (14.0 * w + 16.0 * v) * T + (3.0 * a - 2.0 * b) * T**2) / (2.0 * T**4),
            (12.0 * d - 6.0 * (w + v) * T - (a - b) * T**2) / (2.0 * T**5),
        ],
        axis=1,
    )


def values(coefficients: Floats, t: Floats) -> Floats:
    """
    Return the values of polynomials, without derivatives: (m, k) or (c, m, k).

    :param coefficients: (m, 6, k).
    :param t: (m,) or (c, m): one time, or c times, since each piece began [s].
    """
    # Contiguous in memory, because strided access would take as long as several products.
    powers = np.ascontiguousarray(coefficients.swapaxes(0, 1))
    t = np.repeat(t[..., None], powers.shape[2], axis=-1)
    x: Floats = powers[5] * t + powers[4]
    for power in range(3, -1, -1):
        x *= t
        x += powers[power]
    return x


def evaluate(coefficients: Floats, t: Floats) -> MotionRows:
    """
    Return the values and first two derivatives of polynomials, at one time for each row.

    :param coefficients: (m, 6, k).
    :param t: (m,) times since the pieces began [s].
    """
    x = coefficients[:, 5].copy()
    t = np.repeat(t[:, None], x.shape[1], axis=1)  # contiguous, as in values()
    v, a = np.zeros_like(x), np.zeros_like(x)
    for power in range(4, -1, -1):  # Horner, with both derivatives
        a *= t
        a += 2.0 * v
        v *= t
        v += x
        x *= t
        x += coefficients[:, power]
    return MotionRows(x, v, a)
