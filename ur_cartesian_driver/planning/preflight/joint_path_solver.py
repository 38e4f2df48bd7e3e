# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Solve the joint path along sampled curves, or find why the arm cannot follow them.

The samples of a goal are solved in large blocks. Between two samples the arm can move farther than
their solutions suggest: near a singularity, joints swing round within a millimetre, and the
closest solution after such a step may belong to another branch. So samples are added, down to 2 um
apart, if a joint turns far from one sample to the next, the branch changes, or there is no
solution. If a joint still jumps between two samples so close, the arm cannot follow the path.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import pi
from typing import TypeAlias

import numpy as np

from ur_cartesian_driver.kinematics.inverse_rows import branch_measures, solve_path
from ur_cartesian_driver.motion.errors import GoalRefused
from ur_cartesian_driver.motion.geometry.arrays import Floats, Indices, Int32s
from ur_cartesian_driver.motion.geometry.pose import Pose, pose_rows
from ur_cartesian_driver.motion.geometry.vectors import Joints, vector6
from ur_cartesian_driver.planning.geometry.blended_path import BlendedPath
from ur_cartesian_driver.planning.geometry.samples import (
    CurvePieces,
    joined_columns,
    sample_parameters,
)
from ur_cartesian_driver.planning.preflight.tcp_kinematics import max_joint_change, TcpKinematics
from ur_cartesian_driver.planning.request.goal_fields import point_field

#: Samples are added until no joint turns farther than this from one sample to the next [rad].
_MAX_STEP = 0.1
#: No samples are added between two that are this close in position [m] or orientation [rad]. If a
#: joint still turns farther than _MAX_JUMP [rad] between them, it jumps.
_MIN_LENGTH = 2e-6
_MIN_ANGLE = 2e-5
_MAX_JUMP = 0.5
#: Configurations that differ by less than this [rad] are the same.
_SAME = 1e-6
#: Number of samples in the first block after a refinement changed the solutions, and in the
#: longest block, because a longer one would only need more memory.
_FIRST_BLOCK, _LONGEST_BLOCK = 64, 8192
#: Number of samples on the rest of a piece, to find how far a joint would leave its range.
_SAMPLES_BEYOND = 16
#: After a block that is solved to its end, the next block is this many times as long.
_GROWTH = 8


@dataclass(frozen=True, slots=True)
class JointPath:
    """The samples that the arm reaches on consecutive pieces, with their joint positions."""

    pieces: CurvePieces
    #: (n,) index of each sample's piece, not decreasing.
    piece: Indices
    #: (n,) curve parameter on this piece.
    t: Floats
    #: (n, 7) poses of the tool in the frame of the path.
    poses: Floats
    #: (n, 6) joint positions [rad].
    q: Floats
    #: The refusal of the first place that the arm does not reach; None = it reaches all samples.
    refusal: GoalRefused | None = None
    #: The segment in which this place is; -1 = no refusal.
    refused_segment: int = -1
    #: (n,) segment of each sample.
    segments: Int32s = field(init=False)
    #: (n,) fraction of this segment before the sample.
    fractions: Floats = field(init=False)

    def __post_init__(self) -> None:
        """Find segment and fraction of each sample."""
        segments, fractions = self.pieces.locate(self.piece, self.t)
        object.__setattr__(self, 'segments', segments)
        object.__setattr__(self, 'fractions', fractions)


#: Samples with their joints: piece, parameter, pose and joint positions.
_Samples: TypeAlias = tuple[Indices, Floats, Floats, Floats]
_NO_SAMPLES: _Samples = (
    np.empty(0, dtype=np.intp),
    np.empty(0),
    np.empty((0, 7)),
    np.empty((0, 6)),
)


@dataclass(frozen=True, slots=True)
class _Refinement:
    """Samples on one piece, from one given sample (excluded) to the next (included)."""

    t: list[float]
    poses: list[Pose]
    q: list[Joints]
    #: The first curve parameter that the arm does not reach; None = it reaches the next sample.
    stop: float | None = None
    #: The solution at ``stop``, to which the arm would have to jump; None = it has no solution.
    jump: Joints | None = None

    def samples(self, piece: int) -> _Samples:
        """Return the samples, labelled with the index of their piece."""
        return (
            np.full(len(self.t), piece),
            np.array(self.t),
            pose_rows(self.poses),
            np.array(self.q),
        )


def sample_joint_move(
    kinematics: TcpKinematics, pieces: CurvePieces, path: BlendedPath
) -> JointPath:
    """Return the samples on a single piece, which is a joint move."""
    piece, t = sample_parameters(pieces)
    q = path.joint_rows(int(pieces.number[0]), t)
    return JointPath(pieces, piece, t, kinematics.pose_rows(q), q)


def solve_joint_path(kinematics: TcpKinematics, pieces: CurvePieces, q_start: Joints) -> JointPath:
    """
    Return the samples on consecutive Cartesian pieces with their joint positions.

    :param q_start: the configuration at the start of the first piece [rad].
    """
    pieces_of, at = sample_parameters(pieces)
    found: list[_Samples] = []

    def joint_path(refusal: GoalRefused | None = None, segment: int = -1) -> JointPath:
        piece, t, poses, q = joined_columns(found or [_NO_SAMPLES])
        return JointPath(pieces, piece, t, poses, q, refusal, segment)

    q = q_start
    row, block = 0, _LONGEST_BLOCK
    while row < len(at):
        begin = row
        piece, t = pieces_of[begin : begin + block], at[begin : begin + block]
        poses = pieces.rows(piece, t)
        solved, bad = _solve_block(kinematics, poses, q)
        for index in (*bad, len(solved)):
            stop = begin + index
            if stop > row:
                rows = slice(row - begin, index)
                found.append((piece[rows], t[rows], poses[rows], solved[rows]))
                q, row = vector6(solved[index - 1].tolist()), stop
            if index == len(solved):
                block = min(_GROWTH * block, _LONGEST_BLOCK)
                break
            refinement = _refine(kinematics, pieces, pieces_of, at, row, q)
            k = int(pieces_of[row])
            if refinement.q:
                found.append(refinement.samples(k))
                q = refinement.q[-1]
            if refinement.stop is not None:
                return joint_path(*_refusal_at(kinematics, pieces, k, refinement, q))
            row += 1
            if not np.abs(solved[index] - q).max() < _SAME:  # NaN if there was no solution
                block = _FIRST_BLOCK
                break
    return joint_path()


def _solve_block(kinematics: TcpKinematics, poses: Floats, q: Joints) -> tuple[Floats, list[int]]:
    """
    Return the joints (n, 6) of samples, and the rows before which to add samples.

    The result ends with the first sample that has no solution.

    :param q: the configuration before the first sample [rad].
    """
    path = solve_path(kinematics.arm, kinematics.flange_rows(poses), q, skip_gaps=False)
    branch = branch_measures(kinematics.arm, np.concatenate([[q], path.q])).branch
    bad = (path.step > _MAX_STEP) | (np.diff(branch) != 0) | ~path.found
    lost = np.flatnonzero(~path.found)
    if len(lost):
        stop = int(lost[0]) + 1
        return path.q[:stop], np.flatnonzero(bad[:stop]).tolist()
    return path.q, np.flatnonzero(bad).tolist()


def _refine(
    kinematics: TcpKinematics,
    pieces: CurvePieces,
    piece: Indices,
    at: Floats,
    row: int,
    q: Joints,
) -> _Refinement:
    """
    Return samples from ``row - 1`` (excluded) to ``row``, as dense as the joints require.

    The first row of a piece has no sample before it on the piece, so its samples begin with the
    piece.

    :param piece: (n,) index of each sample's piece; ``at``: (n,) curve parameter on this piece.
    :param q: the configuration before the first of them [rad].
    """
    k = int(piece[row])
    length, turn = pieces.extent(k)
    is_first = row == 0 or piece[row - 1] != k
    t = float(pieces.begin[k]) if is_first else float(at[row - 1])
    min_step = min(1.0, _MIN_LENGTH / max(length, 1e-300), _MIN_ANGLE / max(turn, 1e-300))
    found = _Refinement([], [], [])
    ends = [float(at[row])]
    while ends:
        end = ends[-1]
        pose = pieces.pose(k, end)
        q_next = kinematics.solution(pose, q)
        if end - t > min_step and (q_next is None or _may_leave_line(kinematics, q, q_next)):
            ends.append(0.5 * (t + end))
            continue
        if q_next is None or max_joint_change(q, q_next) > _MAX_JUMP:
            return _Refinement(found.t, found.poses, found.q, end, q_next)
        t, q = end, q_next
        found.t.append(t)
        found.poses.append(pose)
        found.q.append(q)
        ends.pop()
    return found


def _refusal_at(
    kinematics: TcpKinematics, pieces: CurvePieces, k: int, refinement: _Refinement, q: Joints
) -> tuple[GoalRefused, int]:
    """
    Return the refusal of a path beyond ``q``, and the segment in which it becomes impossible.

    :param refinement: its ``stop`` is the first place that the arm does not reach.
    :param q: the last configuration before this place [rad].
    """
    stop = refinement.stop
    assert stop is not None
    index, fraction = pieces.locate_one(k, stop)
    pose = pieces.pose(k, stop)
    where = describe_location(index, fraction)
    if refinement.jump is not None:
        poses_beyond = (
            pieces.pose(k, t)
            for t in np.linspace(stop, float(pieces.end[k]), _SAMPLES_BEYOND).tolist()
        )
        return kinematics.discontinuity_error(pose, q, refinement.jump, where, poses_beyond), index
    refusal = kinematics.no_solution_error(pose, where)
    if not pieces.is_blend[k] and fraction < 1.0:
        # Where the path becomes unreachable, it is only just out of reach. How far the waypoint is
        # out of reach is more helpful in the refusal.
        end = pieces.pose(k, 1.0)
        at_end = kinematics.no_solution_error(end, where, 'at the point ')
        if type(at_end) is type(refusal) and kinematics.solution(end, q) is None:
            refusal = at_end
    return refusal, index


def describe_location(index: int, fraction: float) -> str:
    """Return a phrase for the place at a fraction of the segment to a point."""
    field_name = point_field(index, 'pose')
    return (
        field_name
        if fraction >= 1.0
        else f'{field_name}, at {100.0 * fraction:.1f} % of its segment,'
    )


def _may_leave_line(kinematics: TcpKinematics, q: Joints, q_next: Joints) -> bool:
    """
    Return whether the arm may move otherwise than straight from one configuration to the next.

    Near a singularity, the solution closest after a long step may be on another branch, although
    the arm would swing round and stay on its branch in small steps.
    """
    if max_joint_change(q, q_next) > _MAX_STEP:
        return True
    before, after = branch_measures(kinematics.arm, np.array([q, q_next])).branch
    return bool(before != after)


def max_path_length(kinematics: TcpKinematics) -> float:
    """Return an upper bound [m] on the length of lines and arcs that the arm can follow."""
    # In a ball of radius r a circle is no longer than 2 pi r; 0.1 m is a margin for the reach.
    return 2.0 * pi * (kinematics.reach + 0.1)
