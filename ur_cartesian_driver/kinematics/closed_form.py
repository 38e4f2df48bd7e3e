# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Closed-form inverse kinematics of an ideal arm.

A closed form exists because axes 2, 3 and 4 are parallel. Seen along these axes, shoulder, elbow
and wrist 1 form a plane triangle; seen from above, the wrist centre is at distance d4 from the
plane through axis 1 that is parallel to the arm. This leaves two choices each for shoulder, wrist
and elbow: up to eight solutions.

All square roots are taken of differences of squares, and all angles come from atan2. This keeps
full precision where two solutions meet (stretched arm, upright arm, wrist centre above the
shoulder); an arc cosine would lose half of the digits there.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import atan2, cos, hypot, pi, remainder, sin, sqrt, tau
from typing import NamedTuple

from ur_cartesian_driver.kinematics.ideal_arm import IdealArm
from ur_cartesian_driver.motion.geometry.pose import Pose, rotation_from_quaternion
from ur_cartesian_driver.motion.geometry.vectors import Joints, Vector3

# A square no farther below zero than this [m^2] is taken for zero: the flange is a nanometre out
# of reach, as happens when a robot rounds the pose of its own stretched arm.
FLANGE_ROUNDING = 1e-9
# A square below this [m^2] has a double root: the two solutions differ by about a microradian.
MERGED_ROOTS = 1e-13
# Sine of wrist 2 below which axes 4 and 6 are parallel: only the sum of their angles matters.
WRIST_SINGULAR = 2e-10
# The pose determines wrist 3 only if s5 * d5 exceeds the misfit by this factor.
_MAX_WRIST_MISFIT = 10.0


class WristSolution(NamedTuple):
    """A shoulder and wrist solution of a pose, without the elbow."""

    theta1: float
    theta5: float
    theta6: float
    #: theta2 + theta3 + theta4.
    theta234: float
    #: Position of wrist 1 relative to the shoulder, outward and up in the plane of the arm [m].
    outward: float
    up: float


def closed_form(
    ideal: IdealArm, T_base_flange: Pose, wrist_3: float = 0.0, misfit_factor: float = 0.0
) -> list[Joints]:
    """
    Return every joint solution [rad], each angle within (-pi, pi].

    :param wrist_3: position of wrist 3 for solutions in which axes 4 and 6 are parallel [rad].
    :param misfit_factor: multiple of its misfit by which the ideal arm may be wrong. The real arm
        may reach poses that the ideal one does not; for these, both roots are returned as guesses.
    """
    o1, o2, o3, o4, o5, o6 = ideal.offsets
    slack = root_slack(ideal, misfit_factor)
    found = []
    for theta1, theta5, theta6, theta234, outward, up in wrist_solutions(
        ideal, T_base_flange, wrist_3 + o6, slack
    ):
        elbows = _elbow_angles(ideal, outward, up, slack)
        if not elbows:
            continue
        q1, q5, q6 = wrap(theta1 - o1), wrap(theta5 - o5), wrap(theta6 - o6)
        for theta2, theta3 in elbows:
            q4 = wrap(theta234 - theta2 - theta3 - o4)
            found.append((q1, wrap(theta2 - o2), wrap(theta3 - o3), q4, q5, q6))
    return found


def root_slack(ideal: IdealArm, misfit_factor: float) -> float:
    """Return the uncertainty of the squares under the roots [m^2]."""
    # (r + dr)^2 - r^2 is about 2 r dr.
    return misfit_factor * 2.0 * ideal.misfit * abs(ideal.a2 + ideal.a3)


def wrist_centre(ideal: IdealArm, T_base_flange: Pose) -> Vector3:
    """Return the point where axes 5 and 6 meet, relative to the shoulder [m]."""
    x, y, z, w = T_base_flange.quaternion
    px, py, pz = T_base_flange.position
    d6 = ideal.d6
    return (
        px - d6 * 2.0 * (x * z + y * w),
        py - d6 * 2.0 * (y * z - x * w),
        pz - ideal.d1 - d6 * (1.0 - 2.0 * (x * x + y * y)),
    )


def wrist_solutions(
    ideal: IdealArm, T_base_flange: Pose, theta6_if_singular: float = 0.0, slack: float = 0.0
) -> Iterator[WristSolution]:
    """Yield the solutions for two shoulders, each with two wrists, without the elbow."""
    r11, r12, r13, r21, r22, r23, r31, r32, _ = rotation_from_quaternion(T_base_flange.quaternion)
    px, py, pz = wrist_centre(ideal, T_base_flange)
    if px == py == 0.0:
        return  # on axis 1, from which the arm is d4 away
    d4, d5 = ideal.d4, ideal.d5
    for outward in _roots(px * px + py * py - d4 * d4, slack):
        # px s1 - py c1 = d4 and px c1 + py s1 = outward, solved for s1 and c1.
        s1, c1 = d4 * px + outward * py, outward * px - d4 * py
        length = hypot(s1, c1)
        theta1, s1, c1 = atan2(s1, c1), s1 / length, c1 / length
        # Components of the flange axes along axis 2, which is (s1, -c1, 0).
        along_x, along_y, c5 = s1 * r11 - c1 * r21, s1 * r12 - c1 * r22, s1 * r13 - c1 * r23
        for theta5, theta6 in _wrist_angles(ideal, along_x, along_y, c5, theta6_if_singular):
            # Turned back by theta6, the flange's y axis is opposite to joint axis 5.
            s6, c6 = sin(theta6), cos(theta6)
            s234 = -(c1 * (s6 * r11 + c6 * r12) + s1 * (s6 * r21 + c6 * r22))
            c234 = s6 * r31 + c6 * r32
            yield WristSolution(
                theta1, theta5, theta6, atan2(s234, c234), outward - d5 * s234, pz + d5 * c234
            )


def _wrist_angles(
    ideal: IdealArm, along_x: float, along_y: float, c5: float, theta6_if_singular: float
) -> list[tuple[float, float]]:
    """Return theta5 and theta6 from the flange axes' components along axis 2."""
    s5 = hypot(along_x, along_y)
    theta5, theta6 = atan2(s5, c5), atan2(-along_y, along_x)
    if s5 < WRIST_SINGULAR:
        return [(theta5, theta6_if_singular)]
    angles = [(theta5, theta6), (-theta5, theta6 + pi)]
    if s5 * ideal.d5 < _MAX_WRIST_MISFIT * ideal.misfit:  # theta6 is undetermined
        angles += [(theta5, theta6 + 0.5 * pi), (theta5, theta6 - 0.5 * pi)]
    return angles


def _elbow_angles(
    ideal: IdealArm, outward: float, up: float, slack: float
) -> list[tuple[float, float]]:
    """Return theta2 and theta3 from the triangle of shoulder, elbow and wrist 1."""
    a2, a3 = ideal.a2, ideal.a3
    square = outward * outward + up * up
    # Law of cosines for half the angle, tan(theta3 / 2)^2 = (1 - cos) / (1 + cos), which is
    # ((a2 + a3)^2 - square) / (square - (a2 - a3)^2).
    folds = _roots(square - (a2 - a3) ** 2, slack)
    if not folds:
        return []
    folded, direction = folds[0], atan2(up, outward)
    elbows = []
    for stretched in _roots((a2 + a3) ** 2 - square, slack):
        theta3 = 2.0 * atan2(stretched, folded)
        theta2 = direction - atan2(a3 * sin(theta3), a2 + a3 * cos(theta3))
        elbows.append((theta2, theta3))
        if folded == 0.0:  # pi and -pi are the same elbow
            break
    return elbows


def _roots(square: float, slack: float) -> tuple[float, ...]:
    """
    Return the roots, positive first; () if the square is below 0.

    A square below 0 by no more than ``slack`` or ``FLANGE_ROUNDING`` is not refused.
    """
    if square < -max(slack, FLANGE_ROUNDING):
        return ()
    square = max(square, 0.25 * slack)
    if square < MERGED_ROOTS:
        return (0.0,)
    root = sqrt(square)
    return (root, -root)


def wrap(angle: float) -> float:
    """Return the angle within (-pi, pi]."""
    wrapped = remainder(angle, tau)
    return pi if wrapped <= -pi else wrapped
