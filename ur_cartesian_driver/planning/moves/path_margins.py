# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Path samples of a goal; per segment the joint speed bound and the tightest margin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.motion.pose_rows import Floats
from ur_cartesian_driver.motion.primitive import Joints
from ur_cartesian_driver.planning.geometry.blend import Blend
from ur_cartesian_driver.planning.geometry.samples import CurvePiece, Ints, PathSamples
from ur_cartesian_driver.planning.moves.segment_data import JointSpeedBound
from ur_cartesian_driver.planning.preflight.joint_path_solver import JointPath
from ur_cartesian_driver.planning.preflight.tightest_margins import (
    margins_by_segment,
    TightestMargin,
)

# Samples whose parameters differ by less say nothing about a speed.
_MIN_STEP = 1e-12


@dataclass(frozen=True, slots=True)
class SolvedPieces:
    """The samples on consecutive pieces that the arm can follow."""

    joint_path: JointPath
    #: (n, 3) distances from singularities, inf where they do not count.
    measures: Floats
    #: The configuration before the first sample [rad].
    q_start: Joints


class PathMargins:
    """Collects the samples of a goal in order of time."""

    def __init__(self, arm: Arm) -> None:
        """Begin without samples."""
        self._arm = arm
        self._solved: list[SolvedPieces] = []

    def add(self, solved: SolvedPieces) -> None:
        """Add the next pieces."""
        self._solved.append(solved)

    def samples(self) -> PathSamples:
        """Return all samples."""
        return PathSamples(
            segment=np.concatenate([solved.joint_path.segments for solved in self._solved]),
            fraction=np.concatenate([solved.joint_path.fractions for solved in self._solved]),
            q=np.concatenate([solved.joint_path.q for solved in self._solved]),
            poses=np.concatenate([solved.joint_path.poses for solved in self._solved]),
        )

    def tightest_margin(self) -> dict[int, TightestMargin]:
        """Return the tightest margin by segment."""
        samples = self.samples()
        measures = np.concatenate([solved.measures for solved in self._solved])
        return margins_by_segment(
            self._arm, samples.q, measures, samples.segment, samples.fraction
        )

    def joint_speed_bounds(self) -> dict[int, JointSpeedBound]:
        """Return the time that the joints need for the whole segment, by segment."""
        limits = np.array(self._arm.model.max_joint_speed)
        parts = [_speed_samples(solved, limits) for solved in self._solved]
        segment, time, joint, fraction, joint_time, local_time = (
            np.concatenate(column) for column in zip(*parts, strict=True)
        )
        order = np.lexsort((time, segment))
        bounds = np.flatnonzero(np.diff(segment[order], append=segment[order[-1]] + 1))
        last = order[bounds]
        shortest_time = np.minimum.reduceat(
            local_time[order], np.concatenate([[0], bounds[:-1] + 1])
        )
        columns = (
            time[last],
            joint[last],
            fraction[last],
            np.minimum(shortest_time, time[last]),
            np.bincount(segment, joint_time)[segment[last]],
        )
        return {
            index: JointSpeedBound(*row)
            for index, *row in zip(
                segment[last].tolist(), *(column.tolist() for column in columns), strict=True
            )
        }


class _SpeedSamples(NamedTuple):
    """What samples say about their segments, each (n,); a sample in a blend counts for two."""

    segment: Ints
    #: Time of the whole segment at the rate there [s], and the joint that takes longest.
    time: Floats
    joint: NDArray[np.intp]
    fraction: Floats
    #: Time since the sample before [s]; half of it where the sample counts for two segments.
    joint_time: Floats
    #: The same as ``time``, but inf in blends, where joints may reverse.
    local_time: Floats


def _speed_samples(solved: SolvedPieces, limits: Floats) -> _SpeedSamples:
    """Return how fast a segment may be at each sample."""
    joint_path, pieces = solved.joint_path, solved.joint_path.pieces
    begin = np.array([piece.begin for piece in pieces])[joint_path.piece]
    before = np.concatenate([[0.0], joint_path.t[:-1]])
    is_first = np.diff(joint_path.piece, prepend=-1) != 0
    step = joint_path.t - np.where(is_first, begin, before)
    change = np.abs(np.diff(joint_path.q, axis=0, prepend=np.array([solved.q_start])))
    joint_times = change / limits
    joint = np.argmax(joint_times, axis=1)
    joint_time = np.take_along_axis(joint_times, joint[:, None], axis=1)[:, 0]
    rate = np.where(step > _MIN_STEP, joint_time / np.maximum(step, _MIN_STEP), 0.0)
    local_time = np.where(step > _MIN_STEP, rate, np.inf)
    index = np.array([p.index for p in pieces], dtype=np.int32)[joint_path.piece]
    leaving, joining = (rate[joint_path.piece] for rate in _blend_rates(pieces))
    on_blend = np.flatnonzero(joining > 0.0)
    joint_time[on_blend] *= 0.5
    local_time[on_blend] = np.inf
    return _SpeedSamples(
        np.concatenate([index, index[on_blend] + 1]),
        np.concatenate([rate / leaving, rate[on_blend] / joining[on_blend]]),
        *(
            np.concatenate([column, column[on_blend]])
            for column in (joint, joint_path.fractions, joint_time, local_time)
        ),
    )


def _blend_rates(pieces: Sequence[CurvePiece]) -> tuple[Floats, Floats]:
    """
    Return du/ds of each piece, for the curve that it leaves and the one that it joins.

    The rate of a blend's ``s`` lies between those of its two segments, see the timing of blends:
    so a bound on a segment there holds at that end of the blend.
    """
    leaving, joining = np.ones(len(pieces)), np.zeros(len(pieces))
    for k, piece in enumerate(pieces):
        blend = piece.curve
        if isinstance(blend, Blend):
            if blend.fillet:
                leaving[k] = blend.length / blend.first.length
                joining[k] = blend.length / blend.second.length
            else:
                leaving[k], joining[k] = 2.0 * (1.0 - blend.leave), 2.0 * blend.join
    return leaving, joining
