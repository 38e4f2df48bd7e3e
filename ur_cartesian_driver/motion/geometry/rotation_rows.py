# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Rotation vectors with their exact angular rates, in rows.

An orientation near R0 is exp(r) R0 with the rotation vector r (n, 3) [rad] in base axes. While
r changes, the angular velocity is w = J r', where J is the left Jacobian of the rotation group,

    J = I + b [r]x + c [r]x^2,    b = (1 - cos |r|) / |r|^2,    c = (|r| - sin |r|) / |r|^3

(J. Sola, J. Deray, D. Atchuthan, A micro Lie theory for state estimation in robotics, 2018). With
J, a twist that is requested at a point is met exactly. b and c are computed as power series in
|r|^2, which need no special case at r = 0.
"""

from __future__ import annotations

from math import factorial

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.geometry.polynomials import MotionRows
from ur_cartesian_driver.motion.geometry.pose_rows import cross_rows, length_rows

# Number of terms of the series: exact up to rounding for rotations of up to two full turns.
_TERMS = 26
_B_SERIES = np.array([(-1.0) ** k / factorial(2 * k + 2) for k in range(_TERMS)])
_C_SERIES = np.array([(-1.0) ** k / factorial(2 * k + 3) for k in range(_TERMS)])
# The largest |r|^2 for which 1, 2, ... terms are exact.
_EXACT = np.array([(1e-20 * factorial(2 * k + 2)) ** (1.0 / k) for k in range(1, _TERMS)])
_MIN_LENGTH = 1e-150


def exp_rows(r: Floats) -> Floats:
    """Return the unit quaternions (n, 4) of rotation vectors (n, 3) [rad]."""
    half = 0.5 * length_rows(r)[:, None]
    return np.concatenate([0.5 * np.sinc(half / np.pi) * r, np.cos(half)], axis=1)


def log_rows(quaternions: Floats) -> Floats:
    """Return the rotation vectors (n, 3) of unit quaternions (n, 4), with angles in [0, pi]."""
    upper = np.where(quaternions[:, 3:] < 0.0, -1.0, 1.0) * quaternions
    length = length_rows(upper[:, :3])
    scale = np.where(
        length < 1e-9, 2.0, 2.0 * np.arctan2(length, upper[:, 3]) / np.maximum(length, _MIN_LENGTH)
    )
    vectors: Floats = scale[:, None] * upper[:, :3]
    return vectors


def angular_rates(turn: MotionRows) -> tuple[Floats, Floats]:
    """Return angular velocities [rad/s] and accelerations [rad/s^2] in base axes, (n, 3) each."""
    r, v, a = turn
    b, b_s, c, c_s = _series(r)
    s = 2.0 * np.einsum('ij,ij->i', r, v)[:, None]  # the derivative of |r|^2
    rv, ra = cross_rows(r, v), cross_rows(r, a)
    rrv = cross_rows(r, rv)
    w = v + b * rv + c * rrv
    e = a + b * ra + c * (cross_rows(r, ra) + cross_rows(v, rv)) + s * (b_s * rv + c_s * rrv)
    return w, e


def rotation_rates(r: Floats, w: Floats, e: Floats) -> MotionRows:
    """Return r (|r| < 2 pi) and its derivatives, such that :func:`angular_rates` gives w, e."""
    b, _, c, _ = _series(r)
    K = _cross_matrices(r)
    J = np.eye(3) + b[:, :, None] * K + c[:, :, None] * (K @ K)
    inverse = np.linalg.inv(J)
    v: Floats = (inverse @ w[:, :, None])[:, :, 0]
    _, bias = angular_rates(MotionRows(r, v, np.zeros_like(v)))
    return MotionRows(r, v, (inverse @ (e - bias)[:, :, None])[:, :, 0])


def _series(r: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Return b, db / d|r|^2, c and dc / d|r|^2, each (n, 1)."""
    s = np.einsum('ij,ij->i', r, r)[:, None]
    b, b_s, c, c_s = np.zeros((4, *s.shape))
    # Only as many terms as the largest turn needs.
    terms = min(int(np.searchsorted(_EXACT, s.max(initial=0.0))) + 2, _TERMS)
    for k in range(terms - 1, -1, -1):
        b_s, b = b_s * s + b, b * s + _B_SERIES[k]
        c_s, c = c_s * s + c, c * s + _C_SERIES[k]
    return b, b_s, c, c_s


def _cross_matrices(r: Floats) -> Floats:
    """Return the matrices [r]x (n, 3, 3)."""
    x, y, z = r.T
    zero = np.zeros_like(x)
    return np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]).transpose(2, 0, 1)
