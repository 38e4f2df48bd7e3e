# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Arms with a plausible calibration, and a forward kinematics that owes nothing to the package.

A factory measures where the axes of a real arm are: lines in space, a little off the nominal ones.
The DH table follows from the lines by their common normals. Where two axes are nearly parallel the
normal lies anywhere, often hundreds of metres away; so come the large d2, d3, d4 that cancel, as
real robots report them.
"""

from __future__ import annotations

from dataclasses import dataclass
import json
from math import atan2, cos, pi, sin
from pathlib import Path

from forward_model import dh_forward, dh_matrix
import numpy as np
import pytest

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import DhTable, MODELS
from ur_cartesian_driver.motion.geometry.vectors import vector6

GOLDEN = Path(__file__).parent / 'golden'


@dataclass
class AxisLines:
    """An arm at q = 0 as its axes: points (6, 3), directions (6, 3), and the flange (4, 4)."""

    points: np.ndarray
    directions: np.ndarray
    flange: np.ndarray

    def forward(self, q):
        """The product of the turns about the lines, as matrices."""
        T = np.eye(4)
        for point, direction, angle in zip(self.points, self.directions, q, strict=True):
            turn = np.eye(4)
            turn[:3, :3] = turn_about(direction, angle)
            turn[:3, 3] = point - turn[:3, :3] @ point
            T = T @ turn
        return T @ self.flange


def turn_about(axis, angle):
    """The rotation matrix about a unit vector (Rodrigues)."""
    x, y, z = axis
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + sin(angle) * K + (1 - cos(angle)) * K @ K


def nominal_lines(geometry):
    T = np.eye(4)
    points, directions = [], []
    for i in range(6):
        points.append(T[:3, 3])
        directions.append(T[:3, 2])
        T = T @ dh_matrix(geometry.theta[i], geometry.d[i], geometry.a[i], geometry.alpha[i])
    return AxisLines(np.array(points), np.array(directions), T)


def perturbed_lines(geometry, rng, turn, shift):
    """The nominal axes, all but the first turned [rad] and shifted [m] a little."""
    lines = nominal_lines(geometry)
    for i in range(1, 6):
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        lines.directions[i] = turn_about(axis, rng.normal(0, turn)) @ lines.directions[i]
        lines.points[i] += rng.normal(0, shift, 3)
    # A DH table ends on the last axis: put the flange there, z along it.
    z = lines.directions[5]
    x = lines.flange[:3, 0] - z * (z @ lines.flange[:3, 0])
    x /= np.linalg.norm(x)
    along = z @ (lines.flange[:3, 3] - lines.points[5])
    lines.flange[:3, :3] = np.column_stack([x, np.cross(z, x), z])
    lines.flange[:3, 3] = lines.points[5] + along * z
    return lines


def table_of(lines):
    """The DH table of axis lines: each x axis is the common normal of two neighbours."""
    rows = []
    origin, x, z = np.zeros(3), np.array([1.0, 0, 0]), lines.directions[0]
    for i in range(1, 6):
        next_z = lines.directions[i]
        normal = np.cross(z, next_z)
        normal /= np.linalg.norm(normal)
        d, a, _ = np.linalg.solve(np.column_stack([z, normal, -next_z]), lines.points[i] - origin)
        rows.append((angle_about(z, x, normal), d, a, angle_about(normal, z, next_z)))
        origin, x, z = origin + d * z + a * normal, normal, next_z
    flange_x, flange = lines.flange[:3, 0], lines.flange[:3, 3]
    rows.append((angle_about(z, x, flange_x), z @ (flange - origin), 0.0, 0.0))
    theta, d, a, alpha = (vector6(float(v) for v in column) for column in zip(*rows, strict=True))
    return DhTable(theta=theta, d=d, a=a, alpha=alpha)


def angle_about(axis, start, end):
    return atan2(axis @ np.cross(start, end), start @ end)


def calibrated(name, seed, turn=1e-3, shift=3e-4):
    """A calibrated arm of the model, and its axes."""
    lines = perturbed_lines(
        MODELS[name].geometry, np.random.default_rng([seed, *name.encode()]), turn, shift
    )
    return Arm(MODELS[name], table_of(lines)), lines


@pytest.fixture
def calibrated_arm():
    """Make a calibrated arm: calibrated_arm('ur5e', seed)."""
    return lambda name, seed=0: calibrated(name, seed)[0]


@pytest.fixture
def calibrated_arm_with_lines():
    return calibrated


@pytest.fixture
def matrix_product():
    """The independent forward kinematics of a DH table: matrix_product(geometry, q)."""
    return dh_forward


@pytest.fixture(scope='session')
def golden_poses():
    return json.loads((GOLDEN / 'kinematics.json').read_text())['models']


@pytest.fixture(scope='session')
def golden_robots():
    return json.loads((GOLDEN / 'robots.json').read_text())['robots']


@pytest.fixture(scope='session')
def singular_postures():
    """Joint positions at which solutions meet."""
    return {
        'all zero': (0.0,) * 6,
        'upright, the home position': (0.0, -pi / 2, 0.0, -pi / 2, 0.0, 0.0),
        'wrist straight': (0.3, -1.0, 1.2, -0.5, 0.0, 0.7),
        'wrist folded': (0.3, -1.0, 1.2, -0.5, pi, 0.7),
        'stretched': (0.3, -1.0, 0.0, -0.5, 0.4, 0.7),
        'elbow folded': (1.0, -1.0, pi, 1.0, 1.0, 1.0),
    }
