# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
From the flange to joint positions: every solution, or the one that is nearest to another.

An ideal arm has a closed form, because the axes 2, 3 and 4 are parallel. Along these axes one
sees shoulder, elbow and wrist 1 as a plane triangle; from above, the wrist centre stays at the
distance d4 from the shoulder. That leaves two shoulders, two wrists and two elbows: up to eight
solutions. All roots are of differences of squares and all angles come from atan2, so that nothing
is lost where two solutions meet (stretched arm, upright arm, wrist centre above the shoulder);
arc cosines would lose half of the digits there.

A calibrated arm has no closed form. Each solution of the ideal arm most like it is the start of a
Newton iteration on the real one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import atan2, ceil, copysign, cos, dist, hypot, inf, pi, remainder, sin, sqrt, tau
from typing import NamedTuple

import numpy as np

from ur_cartesian_driver.kinematics.chain import Arm, Frames, jacobian_at
from ur_cartesian_driver.kinematics.robots import JOINT_NAMES, Limits
from ur_cartesian_driver.kinematics.shape import Shape, shape_of
from ur_cartesian_driver.motion.pose import Pose, rotation_from_quaternion, Vector3
from ur_cartesian_driver.motion.primitive import Joints

# A square this far below zero counts as zero [m^2]: the flange lies a nanometre out of reach, as
# the poses do that a robot rounds when it reports its own stretched arm.
_SLACK = 1e-9
# Two roots this close are one [m^2]: their joint positions differ by about a microradian.
_MERGED = 1e-13
# Sine of wrist 2 below which the axes 4 and 6 are one line and only their sum counts.
_WRIST_SINGULAR = 5e-10
# The same for a start in a calibrated arm, for each metre of misfit: three times the misfit over
# the length of the wrist. Below it theta6 may be anything.
_WRIST_DOUBT = 30.0
# How far a position may lie outside its limit by rounding [rad].
_LIMIT_ROUNDING = 1e-9

# Newton: the sum of the squares of metres and radians that counts as exact; the number of steps,
# of steps that may fail to halve the error, and the longest of a joint [rad].
_EXACT = 1e-24
_MAX_STEPS = 40
_MAX_FAILURES = 12
_LONGEST_STEP = 0.5
# Two refined solutions closer than this are one [rad].
_SAME = 1e-5
# How near to the pose a seed must be to be a start of its own [m, rad].
_TRACKING = 0.1
# With a solution this near [rad] no other one is looked for around the seed.
_CLOSE = 0.02
# A start that is farther by this than the best refined solution cannot win [rad]: refinement
# moves it by the calibration, some hundredths, unless the arm is singular there.
_HOPELESS = 0.5

# Solutions this close in the named joints are equally near [rad]: branches that agree in a joint
# of the ideal arm differ by a few milliradians in it in a calibrated one.
_EQUALLY_NEAR = 0.01


def solutions(arm: Arm, T_base_flange: Pose, seed: Joints | None = None) -> list[Joints]:
    """
    Return every joint solution [rad], each angle within (-pi, pi], whatever the limits are.

    Of a calibrated arm a solution may be missed within about a degree of a singularity, where
    the ideal arm says little about the real one; not the one next to the seed.

    :param seed: where the axes of wrist 1 and wrist 3 are one line, wrist 3 is taken from here
        (else it is 0). For a calibrated arm a seed near the pose is one more start of the search.
    """
    starts = _starts(arm, T_base_flange, seed)
    if not arm.calibrated:
        return starts
    if seed is not None and _is_near(arm.forward(seed), T_base_flange):
        starts.append(seed)
    found: list[Joints] = []
    for start in starts:
        q = _refine(arm, T_base_flange, start)
        if q is not None and not any(_same(q, other) for other in found):
            found.append(q)
    return found


def nearest(arm: Arm, T_base_flange: Pose, q_near: Joints) -> Joints | None:
    """
    Return the solution nearest to ``q_near`` [rad] within the limits, or None.

    Nearest of all branches and of all full turns of each joint, by the sum of squares.
    """
    starts = _starts(arm, T_base_flange, q_near)
    # By the distance without limits, which never is longer than that within them.
    ranked = sorted((_distance_by_turns(q, q_near), q) for q in starts)
    allowance = _HOPELESS if arm.calibrated else 0.0
    best, least = None, inf
    for distance, start in ranked:
        if distance > least + allowance:
            break
        q = _settle(arm, T_base_flange, start, q_near)
        if q is not None and dist(q, q_near) < least:
            best, least = q, dist(q, q_near)
    if arm.calibrated and least > _CLOSE and _is_near(arm.forward(q_near), T_base_flange):
        # Near a singularity the starts may have missed the one that is next to q_near.
        q = _settle(arm, T_base_flange, q_near, q_near)
        best = _closest([best, q], q_near)
    return best


def nearest_in(arm: Arm, T_base_flange: Pose, named: Mapping[int, float], q_before: Joints
               ) -> Joints | None:
    """
    Return the solution that a partial posture asks for, or None.

    Of the solutions within the limits those that are nearest in the named joints (within 0.01
    rad), and of these the one nearest to ``q_before``. Full turns count in both.

    :param named: wanted positions [rad] by the index of the joint.
    :param q_before: the configuration before [rad].
    """
    wanted = _six(named.get(i, position) for i, position in enumerate(q_before))
    candidates = [
        q for solution in solutions(arm, T_base_flange, wanted)
        if (q := _turned(solution, wanted, arm.model.position_limits, q_before)) is not None]
    misses = [sqrt(sum((q[i] - named[i]) ** 2 for i in named)) for q in candidates]
    bound = min(misses, default=0.0) + _EQUALLY_NEAR
    return _closest(
        [q for q, miss in zip(candidates, misses, strict=True) if miss <= bound], q_before)


def why_unreachable(arm: Arm, T_base_flange: Pose) -> str:
    """
    Return a clause that says why no solution lies within the limits; empty if one does.

    Lengths are those of the ideal arm that is most like this one.
    """
    found = solutions(arm, T_base_flange)
    if found:
        return _why_outside_limits(found, arm.model.position_limits)
    shape = shape_of(arm)
    px, py, _ = _wrist_centre(shape, T_base_flange)
    if hypot(px, py) < shape.d4:
        return (f'the centre of the wrist would be {hypot(px, py):.4f} m from the axis of the '
                f'base, and it cannot come nearer than {shape.d4:.4f} m')
    return _why_no_elbow(shape, T_base_flange)


# --- The closed form -------------------------------------------------------------------------

class _Wrist(NamedTuple):
    """A shoulder and a wrist that fit the pose; the elbow is still open."""

    theta1: float
    theta5: float
    theta6: float
    #: theta2 + theta3 + theta4.
    theta234: float
    #: Where wrist 1 is from the shoulder, in the plane of the arm: outward and up [m].
    outward: float
    up: float


def _starts(arm: Arm, T_base_flange: Pose, seed: Joints | None) -> list[Joints]:
    """Return the solutions of the ideal arm; for a calibrated arm also what it just misses."""
    shape = shape_of(arm)
    wrist_3 = 0.0 if seed is None else seed[5] + shape.offsets[5]
    # A calibrated arm may reach where the ideal one does not: there both roots are worth a try.
    # (r + dr)^2 is about r^2 + 2 r dr, and the misfit is a mean: allow three times as much.
    doubt = 6.0 * shape.misfit * abs(shape.a2 + shape.a3)
    o1, o2, o3, o4, o5, o6 = shape.offsets
    starts = []
    for wrist in _wrists(shape, T_base_flange, wrist_3, doubt):
        for theta2, theta3 in _elbows(shape, wrist.outward, wrist.up, doubt):
            starts.append((
                _wrap(wrist.theta1 - o1), _wrap(theta2 - o2), _wrap(theta3 - o3),
                _wrap(wrist.theta234 - theta2 - theta3 - o4),
                _wrap(wrist.theta5 - o5), _wrap(wrist.theta6 - o6)))
    return starts


def _wrist_centre(shape: Shape, T_base_flange: Pose) -> Vector3:
    """Return the point where the axes 5 and 6 meet, from the shoulder [m]."""
    x, y, z, w = T_base_flange.quaternion
    px, py, pz = T_base_flange.position
    d6 = shape.d6
    return (px - d6 * 2.0 * (x * z + y * w), py - d6 * 2.0 * (y * z - x * w),
            pz - shape.d1 - d6 * (1.0 - 2.0 * (x * x + y * y)))


def _wrists(shape: Shape, T_base_flange: Pose, wrist_3: float, doubt: float) -> Iterator[_Wrist]:
    """Solve for all but the elbow: two shoulders, each with two wrists."""
    r11, r12, r13, r21, r22, r23, r31, r32, _ = rotation_from_quaternion(T_base_flange.quaternion)
    px, py, pz = _wrist_centre(shape, T_base_flange)
    d4, d5 = shape.d4, shape.d5
    for outward in _roots(px * px + py * py - d4 * d4, doubt):
        # px s1 - py c1 = d4 and px c1 + py s1 = outward, solved for s1 and c1.
        s1, c1 = d4 * px + outward * py, outward * px - d4 * py
        length = hypot(s1, c1)
        theta1, s1, c1 = atan2(s1, c1), s1 / length, c1 / length
        # The axes of the flange along axis 2, which is (s1, -c1, 0).
        along_x, along_y, c5 = s1 * r11 - c1 * r21, s1 * r12 - c1 * r22, s1 * r13 - c1 * r23
        s5 = hypot(along_x, along_y)
        theta5, theta6 = atan2(s5, c5), atan2(-along_y, along_x)
        if s5 < _WRIST_SINGULAR:
            wrists: tuple[tuple[float, float], ...] = ((theta5, wrist_3),)
        else:
            wrists = ((theta5, theta6), (-theta5, theta6 + pi))
            if s5 < _WRIST_DOUBT * shape.misfit:
                wrists += ((theta5, theta6 + 0.5 * pi), (theta5, theta6 - 0.5 * pi))
        for theta5, theta6 in wrists:
            # The axis y of frame 5 is that of the flange before theta6; axis 5 is opposite to it.
            s6, c6 = sin(theta6), cos(theta6)
            s234 = -(c1 * (s6 * r11 + c6 * r12) + s1 * (s6 * r21 + c6 * r22))
            c234 = s6 * r31 + c6 * r32
            yield _Wrist(theta1, theta5, theta6, atan2(s234, c234),
                         outward - d5 * s234, pz + d5 * c234)


def _elbows(shape: Shape, outward: float, up: float, doubt: float
            ) -> Iterator[tuple[float, float]]:
    """Solve the triangle of upper arm, forearm and the way to wrist 1: theta2, theta3."""
    a2, a3 = shape.a2, shape.a3
    square = outward * outward + up * up
    direction = atan2(up, outward)
    # tan(theta3 / 2) is the root of (what lacks to the stretched, to the folded arm).
    for folded in _roots(square - (a2 - a3) ** 2, doubt)[:1]:
        for stretched in _roots((a2 + a3) ** 2 - square, doubt):
            theta3 = 2.0 * atan2(stretched, folded)
            yield direction - atan2(a3 * sin(theta3), a2 + a3 * cos(theta3)), theta3
            if folded == 0.0:  # pi and -pi are one elbow
                break


def _roots(square: float, doubt: float) -> tuple[float, ...]:
    """Return the square roots, positive one first; both also where their existence is in doubt."""
    if square < -max(doubt, _SLACK):
        return ()
    square = max(square, 0.25 * doubt)
    if square < _MERGED:
        return (0.0,)
    root = sqrt(square)
    return (root, -root)


# --- The calibrated arm ----------------------------------------------------------------------

def _settle(arm: Arm, T_base_flange: Pose, start: Joints, q_near: Joints) -> Joints | None:
    """Return the solution that a start leads to, turned towards q_near within the limits."""
    q = _refine(arm, T_base_flange, start) if arm.calibrated else start
    return None if q is None else _turned(q, q_near, arm.model.position_limits)


def _refine(arm: Arm, T_base_flange: Pose, start: Joints) -> Joints | None:
    """
    Return the joint positions of the pose that Newton's method finds from a start, or None.

    The step is damped by the square of the error (Levenberg-Marquardt), which keeps it finite
    where the arm is singular and costs no accuracy elsewhere.
    """
    target = _columns(T_base_flange)
    q, failures, previous = start, 0, inf
    for _ in range(_MAX_STEPS):
        frames = arm.frames(q)
        error = _error(frames, T_base_flange.position, target)
        square = sum([e * e for e in error])
        if square < _EXACT:
            break
        failures += square > 0.5 * previous
        if failures > _MAX_FAILURES:
            return None
        previous = square
        q = _step(q, frames, error, square)
    else:
        return None
    # The error of the orientation is a sine: it also vanishes for half a turn.
    if not _is_near(arm.forward(q), T_base_flange):
        return None
    return _six(_wrap(angle) for angle in q)


def _columns(T_base_flange: Pose) -> tuple[Vector3, Vector3, Vector3]:
    r11, r12, r13, r21, r22, r23, r31, r32, r33 = rotation_from_quaternion(
        T_base_flange.quaternion)
    return (r11, r21, r31), (r12, r22, r32), (r13, r23, r33)


def _error(frames: Frames, position: Vector3, target: tuple[Vector3, Vector3, Vector3]
           ) -> list[float]:
    """Return what lacks to the target: translation [m], and half the sum of axis x target axis."""
    ex = ey = ez = 0.0
    for (ax, ay, az), (bx, by, bz) in zip(
            (frames.x, frames.y, frames.z), target, strict=True):
        ex += ay * bz - az * by
        ey += az * bx - ax * bz
        ez += ax * by - ay * bx
    (px, py, pz), (x, y, z) = frames.position, position
    return [x - px, y - py, z - pz, 0.5 * ex, 0.5 * ey, 0.5 * ez]


def _step(q: Joints, frames: Frames, error: list[float], square: float) -> Joints:
    """Return q + (J'J + square I)^-1 J' error, the largest change limited."""
    jacobian = jacobian_at(frames, frames.position)
    normal = jacobian.T @ jacobian
    normal.flat[::7] += square
    step: list[float] = np.linalg.solve(normal, jacobian.T @ np.array(error)).tolist()
    scale = min(1.0, _LONGEST_STEP / max(max(step), -min(step)))
    return _six(angle + scale * change for angle, change in zip(q, step, strict=True))


def _is_near(T_base_a: Pose, T_base_b: Pose) -> bool:
    return T_base_a.distance_to(T_base_b) < _TRACKING and T_base_a.angle_to(T_base_b) < _TRACKING


# --- Angles, turns and distances -------------------------------------------------------------

def _six(values: Iterator[float]) -> Joints:
    a, b, c, d, e, f = values
    return (a, b, c, d, e, f)


def _wrap(angle: float) -> float:
    """Return the angle within (-pi, pi]."""
    wrapped = remainder(angle, tau)
    return pi if wrapped <= -pi else wrapped


def _same(a: Joints, b: Joints) -> bool:
    return all(abs(remainder(x - y, tau)) < _SAME for x, y in zip(a, b, strict=True))


def _distance_by_turns(a: Joints, b: Joints) -> float:
    """Return the Euclidean distance when full turns do not count [rad]."""
    return hypot(*[remainder(x - y, tau) for x, y in zip(a, b, strict=True)])


def _closest(candidates: Sequence[Joints | None], q_near: Joints) -> Joints | None:
    possible = [q for q in candidates if q is not None]
    return min(possible, key=lambda q: dist(q, q_near), default=None)


def _turned(q: Joints, wanted: Joints, limits: Limits, q_before: Joints | None = None
            ) -> Joints | None:
    """
    Return q with each joint turned as near to ``wanted`` as its limits allow, or None.

    :param q_before: decides where two turns are equally near.
    """
    turned = []
    for joint, (angle, target, (low, high)) in enumerate(zip(q, wanted, limits, strict=True)):
        best = _turn(angle, target, low, high)
        if best is None:
            return None
        if q_before is not None and abs(abs(best - target) - pi) < _EQUALLY_NEAR:
            other = best - copysign(tau, best - target)
            before = q_before[joint]
            if low <= other <= high and abs(other - before) < abs(best - before):
                best = other
        turned.append(best)
    return _six(iter(turned))


def _turn(angle: float, target: float, low: float, high: float) -> float | None:
    """Return the angle plus the full turns that bring it nearest to the target, or None."""
    turned = angle + tau * round((target - angle) / tau)
    if turned > high + _LIMIT_ROUNDING:
        turned -= tau * ceil((turned - high - _LIMIT_ROUNDING) / tau)
        if turned < low - _LIMIT_ROUNDING:
            return None
    elif turned < low - _LIMIT_ROUNDING:
        turned += tau * ceil((low - _LIMIT_ROUNDING - turned) / tau)
        if turned > high + _LIMIT_ROUNDING:
            return None
    return min(max(turned, low), high)


# --- Reasons ---------------------------------------------------------------------------------

def _why_no_elbow(shape: Shape, T_base_flange: Pose) -> str:
    distances = [hypot(wrist.outward, wrist.up)
                 for wrist in _wrists(shape, T_base_flange, 0.0, 0.0)]
    if not distances:  # a calibrated arm within its misfit of the inner cylinder
        return f'the centre of the wrist cannot come nearer than {shape.d4:.4f} m to the base axis'
    longest, shortest = abs(shape.a2 + shape.a3), abs(shape.a2 - shape.a3)
    nearest_to_reach = min(distances, key=lambda r: max(r - longest, shortest - r))
    if nearest_to_reach < 0.5 * (longest + shortest):
        return (f'wrist 1 would be {nearest_to_reach:.4f} m from the shoulder, and the folded arm '
                f'comes no nearer than {shortest:.4f} m')
    return (f'wrist 1 would be {nearest_to_reach:.4f} m from the shoulder, and upper arm and '
            f'forearm together reach {longest:.4f} m')


def _why_outside_limits(found: list[Joints], limits: Limits) -> str:
    """Name the joint of the solution that misses its limits least, or return nothing."""
    worst = [max(_outside(q, limits)) for q in found]
    excess, joint, angle = min(worst)
    if excess <= 0.0:
        return ''
    low, high = limits[joint]
    return (f'{JOINT_NAMES[joint]} would be at {angle:.4f} rad, and its limits are {low:.4f} to '
            f'{high:.4f} rad')


def _outside(q: Joints, limits: Limits) -> Iterator[tuple[float, int, float]]:
    """Give for each joint how far it is outside its limits at the best turn [rad], and where."""
    for joint, (angle, (low, high)) in enumerate(zip(q, limits, strict=True)):
        if _turn(angle, 0.0, low, high) is not None:
            yield 0.0, joint, angle
        else:
            middle = 0.5 * (low + high)
            turned = angle + tau * round((middle - angle) / tau)
            yield max(low - turned, turned - high), joint, turned
