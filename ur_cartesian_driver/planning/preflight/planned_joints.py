# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The joints along the reference path of a plan.

A plan keeps only poses along its path, so the joints are solved again. Along lines and arcs the
arm stays on its branch of solutions, so each solution is the one nearest to the solution before. A
joint move may pass through singularities, where branches meet, so its solutions are the ones
nearest to the straight line between the joints at both ends.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.inverse_rows import nearest_rows, solve_path
from ur_cartesian_driver.motion.geometry.arrays import Floats, Indices
from ur_cartesian_driver.motion.geometry.pose import pose_from_row
from ur_cartesian_driver.motion.geometry.vectors import Joints, vector6
from ur_cartesian_driver.motion.plan.move_rows import MoveRows, MOVES
from ur_cartesian_driver.motion.plan.plan import Plan, ReferencePath
from ur_cartesian_driver.motion.plan.primitive import MoveJ, OptimoveJ, Primitive
from ur_cartesian_driver.planning.preflight.joint_path_solver import describe_location
from ur_cartesian_driver.planning.preflight.tcp_kinematics import TcpKinematics

# Times that differ by less than this [s] are the same.
_INSTANT = 1e-9
_JOINT_MOVES = MoveJ, OptimoveJ


@dataclass(frozen=True, slots=True)
class JointMove:
    """A joint move on the reference path; from row to row, the joints turn by the same amount."""

    #: The joint positions at both ends [rad].
    q_start: Joints
    q_end: Joints
    #: The rows of the reference path at both ends.
    first: int
    last: int

    def at(self, places: Floats) -> Floats:
        """Return the joints (n, 6) [rad] at places (n,), which are row numbers with fractions."""
        start = np.array(self.q_start)
        u = np.clip((places - self.first) / max(1, self.last - self.first), 0.0, 1.0)
        joints: Floats = start + u[:, None] * (np.array(self.q_end) - start)
        return joints


def joint_moves(plan: Plan) -> tuple[JointMove, ...]:
    """Return the joint moves of a plan in order."""
    reference, planned = plan.reference, plan.rows
    numbers = _joint_move_rows(planned.primitives)
    waypoints = planned.waypoints[numbers]
    first, last = (np.searchsorted(reference.point, waypoints + k) for k in (0, 1))
    # A travel has several motions to the same point, so the times tell which rows are whose.
    shared = np.isin(waypoints, planned.waypoints[1:][np.diff(planned.waypoints) == 0])
    if shared.any():
        ends = np.cumsum(planned.durations)[numbers]
        begin, stop = (
            np.searchsorted(reference.time, time + _INSTANT)
            for time in (ends - planned.durations[numbers], ends)
        )
        first = np.where(shared, np.maximum(first, begin), first)
        last = np.where(shared, np.minimum(last, stop), last)
    joints = np.vstack([plan.start, planned.joints])
    return tuple(
        JointMove(vector6(joints[k].tolist()), vector6(joints[k + 1].tolist()), begin, end)
        for k, begin, end in zip(
            numbers.tolist(), np.maximum(first - 1, 0).tolist(), (last - 1).tolist(), strict=True
        )
    )


def _joint_move_rows(primitives: Sequence[Primitive]) -> Indices:
    """Return the indices of joint moves, without making objects of all the other moves."""
    columns = primitives if isinstance(primitives, MoveRows) else None
    objects = range(len(primitives)) if columns is None else columns.others
    found = {k for k in objects if isinstance(primitives[k], _JOINT_MOVES)}
    if columns is not None:
        kinds = [MOVES.index(kind) for kind in _JOINT_MOVES]
        of_kind = np.flatnonzero(np.isin(columns.kinds, kinds)).tolist()
        found.update(k for k in of_kind if k not in objects)
    return np.array(sorted(found), dtype=np.intp)


def row_places(reference: ReferencePath, time: Floats) -> Floats:
    """
    Return the place (n,) at each time on a path: the row number plus the fraction to the next row.

    If several rows have this time, the last of them is used.

    :param time: (n,) [s].
    """
    row = np.clip(
        np.searchsorted(reference.time, time, side='right') - 1, 0, max(len(reference.time) - 2, 0)
    )
    span = reference.time[np.minimum(row + 1, len(reference.time) - 1)] - reference.time[row]
    fraction = np.clip((time - reference.time[row]) / np.where(span > 0.0, span, 1.0), 0.0, 1.0)
    fraction[time >= reference.time[-1]] = 1.0
    places: Floats = row + fraction
    return places


def joints_along(
    arm: Arm, flange_poses: Floats, places: Floats, moves: Sequence[JointMove], start: Joints
) -> Floats:
    """
    Return the joints (n, 6) [rad] for consecutive flange poses; NaN if there is no solution.

    :param flange_poses: (n, 7).
    :param places: (n,) the places of these poses on the reference path, see :func:`row_places`.
    :param moves: the joint moves of the path.
    :param start: the joints before the first pose [rad].
    """
    joints = np.empty((len(places), 6))
    done, q = 0, start
    for move in (*moves, None):
        first = end = len(places)
        if move is not None:
            first, end = np.searchsorted(places, [move.first, move.last], side='right').tolist()
        if first > done:
            solved = solve_path(arm, flange_poses[done:first], q)
            joints[done:first] = np.where(solved.found[:, None], solved.q, np.nan)
            q = _last_known(joints[done:first], q)
        if move is not None and end > first:
            near = move.at(places[first:end])
            joints[first:end] = nearest_rows(arm, flange_poses[first:end], near)
            q = _last_known(joints[first:end], q)
        done = max(done, end)
    return joints


def _last_known(joints: Floats, otherwise: Joints) -> Joints:
    known = np.flatnonzero(~np.isnan(joints[:, 0]))
    return vector6(joints[known[-1]].tolist()) if len(known) else otherwise


def solved_joints(
    kinematics: TcpKinematics,
    reference: ReferencePath,
    path: ReferencePath,
    moves: Sequence[JointMove],
    start: Joints,
) -> Floats:
    """
    Return the joints (n, 6) [rad] along a part of the reference path.

    :param path: the part; its samples may be others than those of ``reference``.
    :param moves: the joint moves of the reference path.
    :param start: the joints before the first sample [rad].
    :raises GoalRefused: a pose has no solution.
    """
    flange, places = kinematics.flange_rows(path.poses), row_places(reference, path.time)
    joints = joints_along(kinematics.arm, flange, places, moves, start)
    is_missing = np.isnan(joints[:, 0])
    if is_missing.any():
        row = int(np.argmax(is_missing))
        where = describe_location(int(path.point[row]), float(path.fraction[row]))
        raise kinematics.no_solution_error(pose_from_row(path.poses[row].tolist()), where)
    return joints
