# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Fit an ideal arm, whose inverse kinematics has a closed form, to a calibrated one.

The closed form needs axes that are exactly parallel or perpendicular, which a calibrated arm does
not have. The ideal lengths cannot be read from the calibrated DH table: the axes of shoulder lift,
elbow and wrist 1 are so nearly parallel that their common normals may lie metres away. Then d2, d3
and d4 are large and cancel, and theta 2 to 4 mean little on their own. So the ideal arm is fitted
to the flange poses of the real one: six lengths and six joint offsets, by least squares.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import sqrt

import numpy as np

from ur_cartesian_driver.kinematics.chain import Arm, ChainFrames
from ur_cartesian_driver.kinematics.robot_models import dh_table
from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.geometry.pose import (
    conjugate,
    multiply,
    Pose,
    rotation_vector_from_quaternion,
)
from ur_cartesian_driver.motion.geometry.vectors import Vector6, vector6

_SAMPLES = 24
_ITERATIONS = 5


@dataclass(frozen=True, slots=True)
class IdealArm:
    """Lengths [m] of an ideal arm, and its joint positions minus the real arm's [rad]."""

    d1: float
    a2: float
    a3: float
    d4: float
    d5: float
    d6: float
    offsets: Vector6
    #: RMS distance between real and ideal flange [m]; 0 for a nominal arm.
    misfit: float


@lru_cache(maxsize=64)
def ideal_arm_of(arm: Arm) -> IdealArm:
    """Return the ideal arm that fits an arm best; a nominal arm is its own ideal arm."""
    lengths = _nominal_lengths(arm)
    offsets = np.zeros(6)
    misfit = 0.0
    if arm.calibrated:
        lengths, offsets, misfit = _fit(arm, lengths)
    return IdealArm(*vector6(lengths.tolist()), vector6(offsets.tolist()), misfit)


def _nominal_lengths(arm: Arm) -> Floats:
    a, d = arm.model.geometry.a, arm.model.geometry.d
    return np.array([d[0], a[1], a[2], d[3], d[4], d[5]])


def _fit(arm: Arm, lengths: Floats) -> tuple[Floats, Floats, float]:
    """Return lengths, offsets and misfit, fitted by Gauss-Newton; the problem is nearly linear."""
    samples = np.random.default_rng(1).uniform(-np.pi, np.pi, (_SAMPLES, 6))
    targets = [arm.forward(q) for q in samples]
    offsets = np.zeros(6)
    misfit = 0.0
    for _ in range(_ITERATIONS):
        ideal = Arm(arm.model, dh_table(*vector6(lengths.tolist())))
        frames = [ideal.frames(q + offsets) for q in samples]
        rows = np.concatenate([_derivatives(f) for f in frames])
        errors = np.concatenate(
            [
                _twist(ideal.forward(q + offsets), target)
                for q, target in zip(samples, targets, strict=True)
            ]
        )
        step = np.linalg.lstsq(rows, errors, rcond=None)[0]
        left = (errors - rows @ step).reshape(_SAMPLES, 6)[:, :3]
        misfit = sqrt(float(np.sum(left**2)) / _SAMPLES)
        lengths, offsets = lengths + step[:6], offsets + step[6:]
    return lengths, offsets, misfit


def _derivatives(frames: ChainFrames) -> Floats:
    """
    Return the derivatives (6, 12) of the flange pose by d1 a2 a3 d4 d5 d6 and the joint positions.

    A length d moves the flange along its joint's axis. A length a moves the flange along its link,
    the line from the origin of its joint to the next joint's origin.
    """
    origins, axes = np.array(frames.origins), np.array(frames.axes)
    point = np.array(frames.position)
    derivatives = np.zeros((6, 12))
    for column, joint in ((0, 0), (3, 3), (4, 4), (5, 5)):
        derivatives[:3, column] = axes[joint]
    for column, joint in ((1, 1), (2, 2)):
        link = origins[joint + 1] - origins[joint]
        derivatives[:3, column] = -link / np.linalg.norm(link)  # a2 and a3 are negative
    derivatives[:3, 6:] = np.cross(axes, point - origins).T
    derivatives[3:, 6:] = axes.T
    return derivatives


def _twist(T_base_from: Pose, T_base_to: Pose) -> Floats:
    """Return translation and rotation vector between two poses, both in base."""
    turn = rotation_vector_from_quaternion(
        multiply(T_base_to.quaternion, conjugate(T_base_from.quaternion))
    )
    return np.concatenate([np.subtract(T_base_to.position, T_base_from.position), turn])
