# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Inverse kinematics of a sampled path, or of any batch of poses.

The preflight of a goal has tens of thousands of poses; one by one they would take seconds. Here
numpy solves them together. Nearly all rows need no search, because they stay on the branch of the
previous row. A row is certain to stay if its step is shorter than half the distance to the other
branches. The few rows that are not certain (near singularities, at joint limits, after a jump) go
to :mod:`~.inverse`, so that both modules return the same solutions.

Poses are rows (n, 7), x y z [m] and the unit quaternion x y z w; joints are rows (n, 6) [rad].
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce
from math import tau

import numpy as np

from ur_cartesian_driver.kinematics.chain import Arm, jacobian_at, pose_error
from ur_cartesian_driver.kinematics.closed_form_rows import (
    branch_rows,
    BRANCHES,
    BranchMeasures,
    ideal_branch_measures,
    TargetPoses,
)
from ur_cartesian_driver.kinematics.ideal_arm import ideal_arm_of
from ur_cartesian_driver.kinematics.inverse import MIN_DAMPING, nearest
from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats
from ur_cartesian_driver.motion.geometry.pose import pose_from_row
from ur_cartesian_driver.motion.geometry.vectors import Joints, vector6

# Rows per block: more would leave the CPU cache. With fewer rows, calling numpy would cost more
# than its arithmetic, above all for a calibrated arm, which first solves one row in _STRIDE.
_BLOCK = 8192
# The same for Newton's method, which needs a hundred numbers for each row.
_NEWTON_BLOCK = 4096
# Block size after a row that needed a search; it then grows again.
_MIN_BLOCK = 16

# Newton's method ends when the squared error (metres and radians) is below this.
_EXACT = 1e-21
# It also ends, without computing the error, after a step in which all joints together turn by less
# than this [rad]: the error is then at most half the square of the turn, times the distance of the
# flange from a joint, or 3e-11.
_LAST_STEP = 5e-6
# The same for rows that need not be exact, because their shifts are interpolated.
_NEAR_STEP = 1e-4
# Largest turn of a joint in one Newton step [rad].
_MAX_JOINT_STEP = 0.5
# Number of Newton steps from a solution of the ideal arm: two suffice except near singularities.
_STEPS = 3
# First, Newton's method finds the shift from ideal to real solution in one row of this many. Then
# all rows are solved, starting from their ideal solutions plus the interpolated shifts.
_STRIDE = 8
# A real solution farther than this [rad] from the ideal solution may be on another branch.
_MAX_CALIBRATION_SHIFT = 0.05
# Two branches of the real arm may be closer to each other than on its ideal arm, by this much
# [rad]. So if ideal branches are this close, it is uncertain which real branch is the nearest.
_AMBIGUOUS_SEPARATION = 4.0 * _MAX_CALIBRATION_SHIFT
_LIMIT_ROUNDING = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class PathSolution:
    """The joint positions of an arm that follows a path."""

    #: (n, 6) [rad], NaN where no solution lies within the limits.
    q: Floats
    #: (n,) whether there is a solution.
    found: Flags
    #: (n,) largest joint change from the last solved row (or from the start) [rad]. If the branch
    #: or the turn jumps, the change stays large even if the path is sampled more finely.
    step: Floats


def branch_measures(arm: Arm, q: Floats) -> BranchMeasures:
    """Return branch and singularity measures of joint rows (n, 6) [rad]."""
    return ideal_branch_measures(ideal_arm_of(arm), q)


# --- Along a path ----------------------------------------------------------------------------


def solve_path(
    arm: Arm, poses: Floats, q_start: Joints, *, skip_gaps: bool = True
) -> PathSolution:
    """
    Return joint positions along a path, each row the nearest to the previous one.

    The result equals :func:`~.inverse.nearest` from row to row: the nearest of all branches
    and full turns within the limits. Rows without solution are skipped.

    :param poses: (n, 7).
    :param q_start: the configuration before the first row [rad].
    :param skip_gaps: False ends the search at the first row without solution; for a calibrated
        arm each such row takes some milliseconds.
    """
    q = np.full((len(poses), 6), np.nan)
    before, row, block, single_count = q_start, 0, _BLOCK, 1
    while row < len(poses):
        solved = _solve_certain(arm, poses[row : row + block], before)
        if len(solved):
            q[row : row + len(solved)] = solved
            row, before, single_count = row + len(solved), _joints(solved[-1]), 1
        if len(solved) == block:
            block = min(2 * block, _BLOCK)
            continue
        for index in range(row, min(row + single_count, len(poses))):
            solution = nearest(arm, pose_from_row(poses[index]), before)
            if solution is not None:
                q[index] = before = solution
            elif not skip_gaps:
                return _path_solution(q, q_start)
        # In a long uncertain stretch, more and more rows are solved singly between two blocks.
        row, block, single_count = (
            row + single_count,
            _MIN_BLOCK,
            min(2 * single_count, _MIN_BLOCK),
        )
    return _path_solution(q, q_start)


def _path_solution(q: Floats, q_start: Joints) -> PathSolution:
    found = ~np.isnan(q[:, 0])
    step = np.full(len(q), np.nan)
    step[found] = _max_joint_change(np.diff(q[found], axis=0, prepend=np.array([q_start])))
    return PathSolution(q=q, found=found, step=step)


def _solve_certain(arm: Arm, poses: Floats, before: Joints) -> Floats:
    """Return the joints of the leading rows that certainly stay on the branch of ``before``."""
    start = np.array([before])
    signs = BRANCHES[int(branch_measures(arm, start).branch[0])]
    q, max_step = _on_branch(arm, TargetPoses.of(poses), signs)
    unwrapped = np.concatenate([start, q])
    unwrapped = unwrapped - tau * np.cumsum(
        np.rint(np.diff(unwrapped, axis=0, prepend=start) / tau), axis=0
    )
    q, certain = _within_limits(arm, unwrapped[1:], unwrapped[:-1], max_step)
    return q if certain.all() else q[: int(np.argmin(certain))]


def nearest_rows(arm: Arm, poses: Floats, q_near: Floats) -> Floats:
    """
    Return for each pose the solution nearest to its row of ``q_near``.

    The result equals :func:`~.inverse.nearest` for each row.

    :param poses: (n, 7).
    :param q_near: (n, 6) [rad].
    :returns: (n, 6) [rad], NaN where no solution lies within the limits.
    """
    found = np.full((len(poses), 6), np.nan)
    certain = np.zeros(len(poses), dtype=np.bool_)
    numbers = branch_measures(arm, q_near).branch
    for number in np.flatnonzero(np.bincount(numbers)).tolist():
        rows = np.flatnonzero(numbers == number)
        q, max_step = _on_branch(arm, TargetPoses.of(poses[rows]), BRANCHES[number])
        q = q - tau * np.rint((q - q_near[rows]) / tau)
        found[rows], certain[rows] = _within_limits(arm, q, q_near[rows], max_step)
    for row in np.flatnonzero(~certain):
        solution = nearest(arm, pose_from_row(poses[row]), _joints(q_near[row]))
        found[row] = np.nan if solution is None else solution
    return found


def _on_branch(
    arm: Arm, targets: TargetPoses, signs: tuple[int, int, int]
) -> tuple[Floats, Floats]:
    """Return joints on a branch (n, 6), and half its distance to others (n,), < 0 if unknown."""
    branch = branch_rows(ideal_arm_of(arm), targets, signs)
    q, max_step = branch.q.T, 0.5 * branch.separation
    sound = branch.exists
    if arm.calibrated:
        refined, exact = refine(arm, targets, q)
        sound = sound & exact & (_max_joint_change(refined - q) < _MAX_CALIBRATION_SHIFT)
        q, max_step = refined, max_step - 0.5 * _AMBIGUOUS_SEPARATION
    return q, np.where(sound, max_step, -1.0)


def _within_limits(arm: Arm, q: Floats, q_near: Floats, max_step: Floats) -> tuple[Floats, Flags]:
    """Return q clipped to the limits, and whether each row is certainly nearest to ``q_near``."""
    # Triangle inequality: if two branches are a distance apart, and one of them is within half
    # this distance of the previous configuration, it is the nearer one.
    change = q - q_near
    certain = np.einsum('ij,ij->i', change, change) < np.copysign(max_step * max_step, max_step)
    low, high = np.array(arm.model.position_limits).T
    inside = (q >= low - _LIMIT_ROUNDING) & (q <= high + _LIMIT_ROUNDING)
    clipped: Floats = np.clip(q, low, high)
    return clipped, certain & inside.all(axis=1)


def _max_joint_change(changes: Floats) -> Floats:
    largest: Floats = reduce(np.maximum, np.abs(changes).T)  # many times faster than max(axis=1)
    return largest


def _joints(row: Floats) -> Joints:
    return vector6(row.tolist())


# --- The calibrated arm ----------------------------------------------------------------------


def refine(arm: Arm, targets: TargetPoses, q: Floats) -> tuple[Floats, Flags]:
    """
    Return the joint positions (n, 6) that Newton's method finds, and whether each row is exact.

    A row is exact if its error is below 3e-11 [m, rad].

    :param q: (n, 6) the starts [rad], within some hundredths of the solutions; consecutive rows
        should be near each other, as on a path.
    """
    every = np.arange(0, len(q), _STRIDE)
    if len(every) < 2:
        return _refine(arm, targets, q)
    # Along a path the shifts change slowly: with interpolated ones, one step is enough.
    refined, near = _refine(arm, targets.rows(every), q[every], _NEAR_STEP)
    shift = np.where(near[:, None], refined - q[every], 0.0)
    place = np.minimum(np.arange(len(q)) / _STRIDE, len(every) - 1.0)
    before = np.minimum(place.astype(np.intp), len(every) - 2)
    part = (place - before)[:, None]
    starts = q + (1.0 - part) * shift[before] + part * shift[before + 1]
    blocks = [slice(row, row + _NEWTON_BLOCK) for row in range(0, len(q), _NEWTON_BLOCK)]
    found = [_refine(arm, targets.rows(block), starts[block]) for block in blocks]
    return np.concatenate([q for q, _ in found]), np.concatenate([exact for _, exact in found])


def _refine(
    arm: Arm, targets: TargetPoses, q: Floats, last_step: float = _LAST_STEP
) -> tuple[Floats, Flags]:
    """Return joints (n, 6), and whether each is solved: by its error, or by a small last step."""
    q = q.copy()
    exact = np.zeros(len(q), dtype=np.bool_)
    active = np.arange(len(q))
    for step in range(_STEPS + 1):
        frames = arm.frames_rows(q[active])
        error, facing = pose_error(frames, targets.position, targets.rotation)
        errors = np.array(error)
        squares = np.einsum('in,in->n', errors, errors)
        # The orientation error is a sine, also zero at half a turn, where ``facing`` is -1.
        faces = facing > 1.0
        exact[active] = faces & (squares < _EXACT)
        if step == _STEPS or exact.all():
            break
        columns = jacobian_at(frames, frames.position).T  # by joint, contiguous
        change = _newton(columns, errors, squares)
        change[exact[active]] = 0.0
        q[active] += change
        # The remaining error to first order: in a singularity, a small step may not reduce it.
        left = errors - np.einsum('ikn,ni->kn', columns, change)
        is_solved = np.einsum('in,in->n', left, left) < 0.01 * _EXACT
        exact[active] |= faces & is_solved & (np.abs(change).sum(axis=1) < last_step)
        rest = np.flatnonzero(~exact[active])
        if not len(rest):
            break
        active, targets = active[rest], targets.rows(rest)
    return q, exact


def _newton(columns: Floats, errors: Floats, squares: Floats) -> Floats:
    """
    Return damped Newton steps (n, 6) [rad]: (J'J + damping I)^-1 J' error.

    The damping is the squared error, but at least ``MIN_DAMPING``. A step is scaled down if a
    joint would turn by more than ``_MAX_JOINT_STEP``.
    """
    normal = np.einsum('ikn,jkn->ijn', columns, columns)
    normal[range(6), range(6)] += np.maximum(squares, MIN_DAMPING)
    gradient = np.einsum('ikn,kn->in', columns, errors)
    change: Floats = np.linalg.solve(normal.T, gradient.T[:, :, None])[:, :, 0].astype(np.float64)
    change *= np.minimum(1.0, _MAX_JOINT_STEP / np.maximum(_max_joint_change(change), 1e-300))[
        :, None
    ]
    return change
