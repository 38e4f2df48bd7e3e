# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Inverse kinematics of one pose: every solution, or the one nearest to a configuration.

An ideal arm has a closed form, a calibrated arm has none. For the latter, each solution of its
ideal arm is the start of a Newton iteration on the real one.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from math import ceil, copysign, dist, hypot, inf, pi, remainder, sin, tau

import numpy as np

from ur_cartesian_driver.kinematics.chain import Arm, ChainFrames, jacobian_at, pose_error
from ur_cartesian_driver.kinematics.closed_form import (
    closed_form,
    wrap,
    wrist_centre,
    wrist_solutions,
)
from ur_cartesian_driver.kinematics.ideal_arm import ideal_arm_of, IdealArm
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES, PositionLimits, RobotModel
from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.geometry.pose import Pose, rotation_from_quaternion
from ur_cartesian_driver.motion.geometry.vectors import Joints, vector6

# Rounding by which a position may exceed its limit [rad].
_LIMIT_ROUNDING = 1e-9

# Multiples of its misfit (an RMS value) by which the ideal arm may be wrong. The second factor is
# tried if the first finds no solution, which happens where two singularities meet.
MISFIT_FACTORS = (3.0, 30.0)

# Newton's method ends when the squared error (metres and radians) is below this.
_EXACT = 1e-24
# Maximum number of Newton steps.
_MAX_STEPS = 40
# Number of Newton steps that may fail to halve the squared error.
_MAX_FAILURES = 12
# Largest turn of a joint in one Newton step [rad].
_MAX_JOINT_STEP = 0.5
#: Minimum damping: keeps the normal equations of a singular arm solvable and does not slow down
#: the convergence of other arms.
MIN_DAMPING = 1e-14
# Another solution may be close if the smallest singular value of the Jacobian is below this.
_NEARLY_SINGULAR = 0.05
# The twin of a straight wrist, half a turn away, is searched if the sine of theta5 is below this.
_NEARLY_STRAIGHT = 0.1
# Largest distance from a solution to its twin (see _twins) at which the twin is searched [rad].
_MAX_TWIN_DISTANCE = 0.6
# Step of the numerical derivative of the Jacobian [rad].
_DIFFERENCE = 1e-4
# Two refined solutions closer than this [rad] are the same.
_SAME = 1e-5
# A seed whose pose is this near [m, rad] to the goal pose is also used as a start.
_NEAR_POSE = 0.1
# If a solution is this near to the seed [rad], the search ends.
_CLOSE_TO_SEED = 0.02
# If a start is farther from the seed than the best solution so far, by more than this [rad], it is
# skipped: refinement moves a start by a few hundredths, unless the arm is near a singularity.
_PRUNING_MARGIN = 0.5

# Solutions this close in the named joints [rad] are equally near: branches that agree in a joint
# of the ideal arm differ by a few milliradians in that joint of a calibrated one.
_EQUALLY_NEAR = 0.01
#: A distance beyond the reach of any arm [m].
_MAX_DISTANCE = 1e3


def solutions(arm: Arm, T_base_flange: Pose, seed: Joints | None = None) -> list[Joints]:
    """
    Return every joint solution [rad], each angle within (-pi, pi], ignoring joint limits.

    For a calibrated arm, solutions may be missing within some degrees of two singularities at
    once, and rarely within half a degree of a straight wrist, because the ideal arm is a poor
    start there. The solution next to the seed is never missing. There may be more than eight
    solutions.

    :param seed: configuration that gives the position of wrist 3 if the axes of wrist 1 and 3 are
        parallel (default 0). For a calibrated arm, a seed near the pose is also used as a start
        of the search.
    """
    wrist_3 = 0.0 if seed is None else seed[5]
    if _is_far(T_base_flange):
        return []
    if not arm.calibrated:
        return closed_form(ideal_arm_of(arm), T_base_flange, wrist_3)
    more = [seed] if seed is not None and _is_near(arm.forward(seed), T_base_flange) else []
    for misfit_factor in MISFIT_FACTORS:
        starts = closed_form(ideal_arm_of(arm), T_base_flange, wrist_3, misfit_factor)
        found = _refined(arm, T_base_flange, starts + more)
        if found:
            return found
    return []


def _is_far(T_base_flange: Pose) -> bool:
    """Return whether a position is NaN or out of any arm's reach, so far that squares overflow."""
    return not all(abs(value) < _MAX_DISTANCE for value in T_base_flange.position)


def nearest(arm: Arm, T_base_flange: Pose, q_near: Joints) -> Joints | None:
    """
    Return the solution within the limits nearest to ``q_near`` [rad]; None if there is none.

    All branches and full turns are searched; the distance is Euclidean in joint space.
    """
    if _is_far(T_base_flange):
        return None
    best = None
    for misfit_factor in MISFIT_FACTORS if arm.calibrated else (0.0,):
        starts = closed_form(ideal_arm_of(arm), T_base_flange, q_near[5], misfit_factor)
        best = _nearest_of(arm, T_base_flange, starts, q_near)
        if best is not None:
            break
    is_close = best is not None and dist(best, q_near) < _CLOSE_TO_SEED
    if arm.calibrated and not is_close:
        # Near a singularity the starts may have missed the solution that is next to q_near.
        more = [] if best is None else _twins(arm, best)
        if _is_near(arm.forward(q_near), T_base_flange):
            more.append(q_near)
        best = _closest(
            [best, *(_solve_from(arm, T_base_flange, start, q_near) for start in more)], q_near
        )
    return best


def nearest_to_posture(
    arm: Arm, T_base_flange: Pose, named: Mapping[int, float], q_before: Joints
) -> Joints | None:
    """
    Return the solution nearest to a partial posture; None if none is within the limits.

    Of the solutions within the limits, those nearest in the named joints (within 0.01 rad) are
    chosen, and of these the one nearest to ``q_before``. Both distances include full turns.

    :param named: preferred positions [rad] by joint index.
    :param q_before: the previous configuration [rad].
    """
    wanted = vector6(named.get(i, position) for i, position in enumerate(q_before))
    candidates = [
        q
        for solution in solutions(arm, T_base_flange, wanted)
        if (q := _nearest_turns(solution, wanted, arm.model.position_limits, q_before)) is not None
    ]
    misses = [hypot(*(q[i] - named[i] for i in named)) for q in candidates]
    bound = min(misses, default=0.0) + _EQUALLY_NEAR
    return _closest(
        [q for q, miss in zip(candidates, misses, strict=True) if miss <= bound], q_before
    )


def explain_unreachable(arm: Arm, T_base_flange: Pose) -> str:
    """
    Return the reason why no solution lies within the limits, as a clause; empty if one does.

    For a calibrated arm, the clause has the lengths of its ideal arm.
    """
    if _is_far(T_base_flange):
        return f'it is more than {_MAX_DISTANCE:g} m away'
    found = solutions(arm, T_base_flange)
    if found:
        return _explain_outside_limits(found, arm.model)
    ideal = ideal_arm_of(arm)
    px, py, _ = wrist_centre(ideal, T_base_flange)
    if hypot(px, py) < ideal.d4:
        value, bound = format_distinct(hypot(px, py), ideal.d4)
        return (
            f'the centre of the wrist would be {value} m from the axis of the base, and it '
            f'cannot come nearer than {bound} m'
        )
    return _explain_no_elbow(ideal, T_base_flange)


# --- The calibrated arm ----------------------------------------------------------------------


def _refined(arm: Arm, T_base_flange: Pose, starts: list[Joints]) -> list[Joints]:
    """Return the distinct solutions found from the starts, and from the twins of solutions."""
    found: list[Joints] = []
    pending = deque(starts)
    while pending:
        q = _refine(arm, T_base_flange, pending.popleft())
        if q is not None and not any(_same(q, other) for other in found):
            found.append(q)
            pending.extend(_twins(arm, q))
    return found


def _twins(arm: Arm, q: Joints) -> list[Joints]:
    """
    Return starts for the twins: the solutions that meet this one in a nearby singularity.

    Let sigma be the Jacobian's smallest singular value and u, v its vectors. A joint step of
    length t along v hardly moves the flange: the error along u is sigma t + curvature t^2 / 2,
    which is zero again at the twin. The twin of a straight wrist is half a turn away.
    """
    jacobian = arm.jacobian(q)
    u, sigma, v = np.linalg.svd(jacobian)
    if sigma[-1] > _NEARLY_SINGULAR:
        return []
    twins = []
    change = arm.jacobian(_step_along(q, v[-1], _DIFFERENCE)) - jacobian
    curvature = float(u[:, -1] @ change @ v[-1]) / _DIFFERENCE
    if 2.0 * sigma[-1] < _MAX_TWIN_DISTANCE * abs(curvature):
        twins.append(_step_along(q, v[-1], -2.0 * float(sigma[-1]) / curvature))
    o5 = ideal_arm_of(arm).offsets[4]
    if abs(sin(q[4] + o5)) < _NEARLY_STRAIGHT:
        twins.append((q[0], q[1], q[2], q[3] + pi, -q[4] - 2.0 * o5, q[5] + pi))
    return twins


def _step_along(q: Joints, direction: Floats, distance: float) -> Joints:
    return vector6(a + distance * float(b) for a, b in zip(q, direction, strict=True))


def _nearest_of(
    arm: Arm, T_base_flange: Pose, starts: list[Joints], q_near: Joints
) -> Joints | None:
    """Return the nearest solution from the starts; only starts that can lead to it are refined."""
    # Ignoring joint limits gives a lower bound of the distance.
    ranked = sorted((_distance_by_turns(q, q_near), q) for q in starts)
    allowance = _PRUNING_MARGIN if arm.calibrated else 0.0
    best, min_distance = None, inf
    for distance, start in ranked:
        if distance > min_distance + allowance:
            break
        q = _solve_from(arm, T_base_flange, start, q_near)
        if q is not None and dist(q, q_near) < min_distance:
            best, min_distance = q, dist(q, q_near)
    return best


def _solve_from(arm: Arm, T_base_flange: Pose, start: Joints, q_near: Joints) -> Joints | None:
    """Return the solution found from a start, at the turns nearest to ``q_near``, or None."""
    q = _refine(arm, T_base_flange, start) if arm.calibrated else start
    return None if q is None else _nearest_turns(q, q_near, arm.model.position_limits)


def _refine(arm: Arm, T_base_flange: Pose, start: Joints) -> Joints | None:
    """
    Return the solution that Newton's method finds from a start; None if it finds none.

    The squared error damps the step (Levenberg-Marquardt). This keeps the step finite at a
    singularity and costs no accuracy elsewhere.
    """
    rotation = rotation_from_quaternion(T_base_flange.quaternion)
    q, failures, previous = start, 0, inf
    for _ in range(_MAX_STEPS):
        frames = arm.frames(q)
        error, _ = pose_error(frames, T_base_flange.position, rotation)
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
    # The orientation error is a sine, which is also zero at half a turn.
    if not _is_near(arm.forward(q), T_base_flange):
        return None
    return vector6(wrap(angle) for angle in q)


def _step(q: Joints, frames: ChainFrames, error: list[float], square: float) -> Joints:
    """
    Return the joints after one damped Newton step: q + (J'J + damping I)^-1 J' error.

    The damping is ``square``, the squared error, but at least ``MIN_DAMPING``. The step is scaled
    down if a joint would turn by more than ``_MAX_JOINT_STEP``.
    """
    jacobian = jacobian_at(frames, frames.position)
    normal = jacobian.T @ jacobian
    normal.flat[::7] += max(square, MIN_DAMPING)
    step: list[float] = np.linalg.solve(normal, jacobian.T @ np.array(error)).tolist()
    scale = min(1.0, _MAX_JOINT_STEP / max(max(step), -min(step), 1e-300))
    return vector6(angle + scale * change for angle, change in zip(q, step, strict=True))


def _is_near(T_base_a: Pose, T_base_b: Pose) -> bool:
    return T_base_a.distance_to(T_base_b) < _NEAR_POSE and T_base_a.angle_to(T_base_b) < _NEAR_POSE


# --- Angles, turns and distances -------------------------------------------------------------


def _same(a: Joints, b: Joints) -> bool:
    return all(abs(remainder(x - y, tau)) < _SAME for x, y in zip(a, b, strict=True))


def _distance_by_turns(a: Joints, b: Joints) -> float:
    """Return the Euclidean distance modulo full turns [rad]."""
    (a1, a2, a3, a4, a5, a6), (b1, b2, b3, b4, b5, b6) = a, b
    return hypot(
        remainder(a1 - b1, tau),
        remainder(a2 - b2, tau),
        remainder(a3 - b3, tau),
        remainder(a4 - b4, tau),
        remainder(a5 - b5, tau),
        remainder(a6 - b6, tau),
    )


def _closest(candidates: Sequence[Joints | None], q_near: Joints) -> Joints | None:
    possible = [q for q in candidates if q is not None]
    return min(possible, key=lambda q: dist(q, q_near), default=None)


def _nearest_turns(
    q: Joints, wanted: Joints, limits: PositionLimits, q_before: Joints | None = None
) -> Joints | None:
    """
    Return q with each joint turned as near to ``wanted`` as its limits allow; None if one cannot.

    :param q_before: of two equally near turns, the one nearer to this configuration is taken.
    """
    turned = []
    for joint, (angle, target, (low, high)) in enumerate(zip(q, wanted, limits, strict=True)):
        best = _nearest_turn(angle, target, low, high)
        if best is None:
            return None
        if q_before is not None and abs(abs(best - target) - pi) < _EQUALLY_NEAR:
            other = best - copysign(tau, best - target)
            before = q_before[joint]
            if low <= other <= high and abs(other - before) < abs(best - before):
                best = other
        turned.append(best)
    return vector6(iter(turned))


def _nearest_turn(angle: float, target: float, low: float, high: float) -> float | None:
    """Return the angle moved by full turns as near to the target as the limits allow, or None."""
    turned = angle + tau * round((target - angle) / tau)
    if low <= turned <= high:
        return turned
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


def format_distinct(value: float, bound: float) -> tuple[str, str]:
    """Return both numbers with the fewest digits (at least four) that distinguish them."""
    if abs(value) >= 1e4:
        return f'{value:.4g}', f'{bound:.4f}'
    digits = next((n for n in range(4, 9) if round(value, n) != round(bound, n)), 9)
    return f'{value:.{digits}f}', f'{bound:.{digits}f}'


def _explain_no_elbow(ideal: IdealArm, T_base_flange: Pose) -> str:
    distances = [hypot(wrist.outward, wrist.up) for wrist in wrist_solutions(ideal, T_base_flange)]
    if not distances:  # calibrated arm, wrist centre within the misfit of the cylinder
        return f'the centre of the wrist cannot come nearer than {ideal.d4:.4f} m to the base axis'
    longest, shortest = abs(ideal.a2 + ideal.a3), abs(ideal.a2 - ideal.a3)
    nearest_to_reach = min(distances, key=lambda r: max(r - longest, shortest - r))
    if nearest_to_reach < 0.5 * (longest + shortest):
        value, bound = format_distinct(nearest_to_reach, shortest)
        return (
            f'wrist 1 would be {value} m from the shoulder, and the folded arm comes no '
            f'nearer than {bound} m'
        )
    value, bound = format_distinct(nearest_to_reach, longest)
    return (
        f'wrist 1 would be {value} m from the shoulder, and upper arm and forearm together '
        f'reach {bound} m'
    )


def _explain_outside_limits(found: list[Joints], model: RobotModel) -> str:
    """Return a clause on the joint outside its limits in the best solution; '' if none is."""
    worst = [max(_outside(q, model.position_limits)) for q in found]
    excess, joint, angle = min(worst)
    if excess <= 0.0:
        return ''
    low, high = model.position_limits[joint]
    value, _ = format_distinct(angle, low if angle < low else high)
    return (
        f'{JOINT_NAMES[joint]} would be at {value} rad, outside its range of '
        f'{model.range_text(joint)}'
    )


def _outside(q: Joints, limits: PositionLimits) -> Iterator[tuple[float, int, float]]:
    """Yield for each joint, at its best turn: excess over the limits [rad], index, angle [rad]."""
    for joint, (angle, (low, high)) in enumerate(zip(q, limits, strict=True)):
        if _nearest_turn(angle, 0.0, low, high) is not None:
            yield 0.0, joint, angle
        else:
            middle = 0.5 * (low + high)
            turned = angle + tau * round((middle - angle) / tau)
            yield max(low - turned, turned - high), joint, turned
