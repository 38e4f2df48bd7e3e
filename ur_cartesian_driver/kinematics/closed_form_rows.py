# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Closed-form inverse kinematics of many poses, for one branch at a time.

The formulas come from :mod:`~.closed_form`, which finds all solutions of one pose. Here the
three choices (shoulder, elbow, wrist) are given as signs, and all poses are solved for these. The
quantities with these signs are zero where the arm is singular, so :class:`BranchMeasures` both
identify the branch of a configuration and measure its distances from the singularities.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import tau

import numpy as np

from ur_cartesian_driver.kinematics.closed_form import (
    FLANGE_ROUNDING,
    MERGED_ROOTS,
    WRIST_SINGULAR,
)
from ur_cartesian_driver.kinematics.ideal_arm import IdealArm
from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats, Int64s
from ur_cartesian_driver.motion.geometry.pose import rotation_from_quaternion

#: The signs of shoulder, elbow and wrist of the eight branches, in the order of their numbers.
BRANCHES = tuple(
    (shoulder, elbow, wrist) for shoulder in (1, -1) for elbow in (1, -1) for wrist in (1, -1)
)


@dataclass(frozen=True, slots=True, kw_only=True)
class BranchMeasures:
    """
    Three signed measures per row: their signs identify the branch, a zero is a singularity.

    For a calibrated arm, its ideal arm is measured, so the measures are exact to its misfit.
    """

    #: Distance of the wrist centre from the plane of axes 1 and 2 [m], positive on the side of
    #: (cos theta1, sin theta1, 0). The centre cannot enter the cylinder of radius d4 about axis 1:
    #: its distance from axis 1 is hypot(d4, shoulder).
    shoulder: Floats
    #: sin theta3: 0 where the arm is stretched or folded.
    elbow: Floats
    #: sin theta5: 0 where axes 4 and 6 are parallel.
    wrist: Floats

    @property
    def branch(self) -> Int64s:
        """Branch number, 0 to 7, an index of :data:`BRANCHES`."""
        return (4 * (self.shoulder < 0) + 2 * (self.elbow < 0) + (self.wrist < 0)).astype(np.int64)


@dataclass(frozen=True, slots=True)
class TargetPoses:
    """Poses as columns: positions, and rotation matrices row by row, each an array (n,)."""

    position: tuple[Floats, Floats, Floats]
    rotation: tuple[Floats, ...]

    @classmethod
    def of(cls, poses: Floats) -> TargetPoses:
        """Convert rows (n, 7): x y z [m], unit quaternion x y z w."""
        px, py, pz, x, y, z, w = np.ascontiguousarray(poses.T, dtype=np.float64)
        return cls((px, py, pz), rotation_from_quaternion((x, y, z, w)))

    def rows(self, index: Int64s | slice) -> TargetPoses:
        """Return the poses at these indices."""
        px, py, pz = (p[index] for p in self.position)
        return TargetPoses((px, py, pz), tuple(r[index] for r in self.rotation))


@dataclass(frozen=True, slots=True)
class BranchSolution:
    """The solutions of many poses in one branch."""

    #: (6, n) joint positions [rad], not wrapped; undefined where ``exists`` is false.
    q: Floats
    #: (n,) whether the pose has a solution in this branch; where two branches meet, both have one.
    exists: Flags
    #: (n,) lower bound of the joint distance to the solutions in other branches, modulo full turns
    #: [rad].
    separation: Floats


def ideal_branch_measures(ideal: IdealArm, q: Floats) -> BranchMeasures:
    """Return the measures of joint positions (n, 6) [rad]."""
    theta = q.T + np.array(ideal.offsets)[:, None]
    theta23 = theta[1] + theta[2]
    return BranchMeasures(
        shoulder=(
            ideal.a2 * np.cos(theta[1])
            + ideal.a3 * np.cos(theta23)
            + ideal.d5 * np.sin(theta23 + theta[3])
        ),
        elbow=np.sin(theta[2]),
        wrist=np.sin(theta[4]),
    )


def branch_rows(
    ideal: IdealArm, targets: TargetPoses, signs: tuple[int, int, int]
) -> BranchSolution:
    """
    Solve all poses for one branch; wrist 3 is 0 where axes 4 and 6 are parallel.

    :param signs: signs of shoulder, elbow and wrist.
    """
    shoulder, elbow, wrist = signs
    pan = _pan(ideal, targets, shoulder)
    theta5, theta6, theta234, outward, up = _flip(ideal, targets, pan, wrist)
    theta2, theta3, exists = _lift(ideal, outward, up, elbow)
    theta = np.stack([pan.theta1, theta2, theta3, theta234 - theta2 - theta3, theta5, theta6])
    elbow_separation = 2.0 * np.abs(theta3)
    return BranchSolution(
        theta - np.array(ideal.offsets)[:, None],
        pan.exists & exists,
        # With the same shoulder, the other wrist has theta6 + pi, so that branch is never nearest.
        np.minimum(np.minimum(elbow_separation, tau - elbow_separation), pan.separation),
    )


@dataclass(frozen=True, slots=True)
class _Pan:
    theta1: Floats
    sin: Floats
    cos: Floats
    outward: Floats
    up: Floats
    exists: Flags
    separation: Floats


def _pan(ideal: IdealArm, targets: TargetPoses, sign: int) -> _Pan:
    r = targets.rotation
    px, py, pz = (p - ideal.d6 * z for p, z in zip(targets.position, r[2::3], strict=True))
    d4 = ideal.d4
    root, exists = _root(px * px + py * py - d4 * d4)
    outward = sign * root
    s1, c1 = d4 * px + outward * py, outward * px - d4 * py
    length = np.maximum(np.sqrt(s1 * s1 + c1 * c1), 1e-300)  # 0 on axis 1, which is out of reach
    return _Pan(
        np.arctan2(s1, c1),
        s1 / length,
        c1 / length,
        outward,
        pz - ideal.d1,
        exists,
        2.0 * np.arctan2(root, abs(d4)),
    )


def _flip(
    ideal: IdealArm, targets: TargetPoses, pan: _Pan, sign: int
) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """Return theta5, theta6, theta234, and outward and up of wrist 1."""
    r11, r12, r13, r21, r22, r23, r31, r32, _ = targets.rotation
    s1, c1 = pan.sin, pan.cos
    along_x, along_y, c5 = s1 * r11 - c1 * r21, s1 * r12 - c1 * r22, s1 * r13 - c1 * r23
    s5 = np.sqrt(along_x * along_x + along_y * along_y)
    straight = s5 < WRIST_SINGULAR
    theta6_straight = ideal.offsets[5]
    safe = np.where(straight, 1.0, s5)
    s6 = np.where(straight, np.sin(theta6_straight), -sign * along_y / safe)
    c6 = np.where(straight, np.cos(theta6_straight), sign * along_x / safe)
    s234 = -(c1 * (s6 * r11 + c6 * r12) + s1 * (s6 * r21 + c6 * r22))
    c234 = s6 * r31 + c6 * r32
    theta6 = np.where(straight, theta6_straight, np.arctan2(s6, c6))
    return (
        np.arctan2(sign * s5, c5),
        theta6,
        np.arctan2(s234, c234),
        pan.outward - ideal.d5 * s234,
        pan.up + ideal.d5 * c234,
    )


def _lift(ideal: IdealArm, outward: Floats, up: Floats, sign: int) -> tuple[Floats, Floats, Flags]:
    """Return theta2, theta3, and whether wrist 1 is in reach."""
    a2, a3 = ideal.a2, ideal.a3
    square = outward * outward + up * up
    folded, not_too_near = _root(square - (a2 - a3) ** 2)
    stretched, not_too_far = _root((a2 + a3) ** 2 - square)
    f2, s2 = folded * folded, stretched * stretched
    c3 = (f2 - s2) / (f2 + s2)
    s3 = 2.0 * sign * folded * stretched / (f2 + s2)
    along, across = a2 + a3 * c3, a3 * s3
    return (
        np.arctan2(up * along - outward * across, outward * along + up * across),
        2.0 * np.arctan2(sign * stretched, folded),
        not_too_near & not_too_far,
    )


def _root(square: Floats) -> tuple[Floats, Flags]:
    """Return the non-negative square root, and whether it exists."""
    return np.sqrt(np.where(square < MERGED_ROOTS, 0.0, square)), square >= -FLANGE_ROUNDING
