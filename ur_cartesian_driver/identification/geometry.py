# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The geometry of a single move: joint move, line, turn on the spot, or something else."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from ur_cartesian_driver.identification.arm_samples import ArmSamples
from ur_cartesian_driver.identification.segmentation import noise_of, Piece
from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.geometry.pose_rows import conjugate_rows, multiply_rows
from ur_cartesian_driver.motion.geometry.rotation_rows import log_rows

#: How far places may be off a straight line: of joints [rad], of the tool [m, rad]; and for each
#: unit of the line's length. Recorded joint moves keep within 1e-7.
_JOINT_OFF, _TOOL_OFF, _OFF_PER_LENGTH = 2e-6, 5e-6, 2e-6
#: A shorter travel or turn of the tool is none [m, rad].
_NO_TRAVEL = 1e-4


class Kind(Enum):
    """The shape of a move."""

    JOINT = 'joint move'
    LINE = 'line'
    #: A single wrist that turns the tool on the spot is a joint move and a line at once.
    EITHER = 'turn of one joint'
    #: Known by its calls only.
    SERVO = 'motion of servoj'
    OTHER = 'another shape'


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Travel:
    """
    Progress along the path of a move.

    :param joint: (n,) travel of the leading joint [rad]; None if joints do not move straight.
    :param line: (n,) travel of the tool [m]; None if it does not move straight, or not at all.
    :param turn: (n,) angle of the tool about a fixed axis [rad]; None if there is none.
    """

    kind: Kind
    joint: Floats | None = None
    line: Floats | None = None
    turn: Floats | None = None


def travel_of(samples: ArmSamples, piece: Piece) -> Travel:
    """Return the kind of a move and the progress in each row of it."""
    rows = slice(piece.begin, piece.end)
    joint = _along(samples.target_q[rows], _JOINT_OFF)
    if joint is not None:
        joint = joint[0] * np.abs(joint[1]).max()
    line = turn = None
    is_straight = False
    if samples.target_pose is not None:
        is_straight, line, turn = _tool_travel(samples.target_pose[rows])
    if joint is not None:
        kind = Kind.EITHER if is_straight and turn is not None else Kind.JOINT
        return Travel(kind=kind, joint=joint, turn=turn if kind is Kind.EITHER else None)
    if is_straight:
        return Travel(kind=Kind.LINE, line=line, turn=turn)
    return Travel(kind=Kind.OTHER)


def _tool_travel(poses: Floats) -> tuple[bool, Floats | None, Floats | None]:
    """Return whether the tool moves as in a line, its travel and its angle."""
    first = conjugate_rows(poses[:1, 3:])
    turns = log_rows(multiply_rows(np.repeat(first, len(poses), axis=0), poses[:, 3:]))
    found: list[Floats | None] = []
    for values in (poses[:, :3], turns):
        if np.ptp(values, axis=0).max() < _NO_TRAVEL:
            found.append(None)
            continue
        along = _along(values, _TOOL_OFF)
        if along is None:
            return False, None, None
        found.append(along[0])
    return any(travel is not None for travel in found), found[0], found[1]


def _along(values: Floats, tolerance: float) -> tuple[Floats, Floats] | None:
    """Return the travel (n,) along the straight line of rows (n, k), and its direction (k,)."""
    centred = values - values.mean(axis=0)
    direction = np.linalg.svd(centred, full_matrices=False)[2][0]
    if direction @ (values[-1] - values[0]) < 0.0:
        direction = -direction
    travel: Floats = centred @ direction
    off = np.abs(centred - travel[:, None] * direction).max()
    allowed = tolerance + _OFF_PER_LENGTH * np.ptp(travel) + 6.0 * noise_of(values)
    return (travel, direction) if off <= allowed else None
