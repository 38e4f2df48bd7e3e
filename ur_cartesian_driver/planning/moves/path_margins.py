# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Path samples of a goal; per segment the joint speed bound and the tightest margin."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.motion.pose_rows import Floats
from ur_cartesian_driver.motion.primitive import Joints
from ur_cartesian_driver.planning.geometry.samples import (
    group_begins,
    Ints,
    joined,
    last_greatest,
    PathSamples,
)
from ur_cartesian_driver.planning.preflight.joint_path_solver import JointPath
from ur_cartesian_driver.planning.preflight.tightest_margins import (
    tightest_margins,
    TightestMargins,
)

# Samples whose parameters differ by less say nothing about a speed.
_MIN_STEP = 1e-12


@dataclass(frozen=True, slots=True, kw_only=True)
class JointSpeedBounds:
    """The times of whole segments at the speed limits of the joints; columns (n,)."""

    #: At the rate of the sample where the joints are fastest [s]; the leading joint there, and the
    #: fraction of the segment.
    times: Floats
    joints: NDArray[np.intp]
    fractions: Floats
    #: At the rate of the sample where they are slowest; with some joint at its limit everywhere.
    shortest_times: Floats
    times_at_limits: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class BlendSamples:
    """The samples in all blends of a goal; columns (n,)."""

    #: The waypoint that the blend rounds, and the parameter half-way to the sample before.
    index: Ints
    s: Floats
    #: For a unit of ``s`` there: time at the joint speed limits [s], with the joint that takes
    #: longest, and distance of the tool [m].
    joint_time: Floats
    joint: NDArray[np.intp]
    tool_distance: Floats


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
        #: The samples in blends; set by :meth:`joint_speed_bounds`.
        self.blend_samples: BlendSamples

    def add(self, solved: SolvedPieces) -> None:
        """Add the next pieces."""
        self._solved.append(solved)

    def samples(self) -> PathSamples:
        """Return all samples."""
        paths = [solved.joint_path for solved in self._solved]
        return PathSamples(
            segment=joined([path.segments for path in paths]),
            fraction=joined([path.fractions for path in paths]),
            q=joined([path.q for path in paths]),
            poses=joined([path.poses for path in paths]),
        )

    def tightest_margins(self) -> TightestMargins:
        """Return the tightest margin of each segment."""
        samples = self.samples()
        measures = joined([solved.measures for solved in self._solved])
        return tightest_margins(self._arm, samples.q, measures, samples.segment, samples.fraction)

    def joint_speed_bounds(self) -> JointSpeedBounds:
        """Return the time that the joints need for each whole segment."""
        limits = np.array(self._arm.model.max_joint_speed)
        blends, parts = zip(
            *(_speed_samples(solved, limits) for solved in self._solved), strict=True
        )
        self.blend_samples = BlendSamples(
            **{
                field.name: joined([getattr(found, field.name) for found in blends])
                for field in fields(BlendSamples)
            }
        )
        segment, time, joint, fraction, joint_time, local_time = (
            joined(column) for column in zip(*parts, strict=True)
        )
        order = np.argsort(segment, kind='stable')  # a few sorted runs
        last = order[last_greatest(time[order], segment[order])]
        shortest_time = np.minimum.reduceat(local_time[order], group_begins(segment[order]))
        return JointSpeedBounds(
            times=time[last],
            joints=joint[last],
            fractions=fraction[last],
            shortest_times=np.minimum(shortest_time, time[last]),
            times_at_limits=np.bincount(segment, joint_time)[segment[last]],
        )


class _SpeedSamples(NamedTuple):
    """What samples say about their segments, each (n,); a sample in a blend counts for two."""

    segment: Ints
    #: Time of the whole segment at the rate there [s], 0 in blends; the joint that takes longest.
    time: Floats
    joint: NDArray[np.intp]
    fraction: Floats
    #: Time since the sample before [s]; half of it where the sample counts for two segments.
    joint_time: Floats
    #: The same as ``time``, but inf in blends, where joints may reverse.
    local_time: Floats


def _speed_samples(solved: SolvedPieces, limits: Floats) -> tuple[BlendSamples, _SpeedSamples]:
    """Return the samples in blends, and how fast a segment may be at each sample."""
    joint_path, pieces = solved.joint_path, solved.joint_path.pieces
    begin = pieces.begin[joint_path.piece]
    before = np.concatenate([[0.0], joint_path.t[:-1]])
    is_first = np.diff(joint_path.piece, prepend=-1) != 0
    step = joint_path.t - np.where(is_first, begin, before)
    change = np.abs(np.diff(joint_path.q, axis=0, prepend=np.array([solved.q_start])))
    joint_times = change / limits
    joint = np.argmax(joint_times, axis=1)
    joint_time = np.take_along_axis(joint_times, joint[:, None], axis=1)[:, 0]
    rate = np.where(step > _MIN_STEP, joint_time / np.maximum(step, _MIN_STEP), 0.0)
    local_time = np.where(step > _MIN_STEP, rate, np.inf)
    index = pieces.index[joint_path.piece]
    on_blend = np.flatnonzero(pieces.is_blend[joint_path.piece])
    places = joint_path.poses[:, :3]
    distance = np.linalg.norm(np.diff(places, axis=0, prepend=places[:1]), axis=1)
    blend_samples = BlendSamples(
        index=index[on_blend],
        s=(joint_path.t - 0.5 * step)[on_blend],
        joint_time=rate[on_blend],
        joint=joint[on_blend],
        tool_distance=(distance / np.maximum(step, _MIN_STEP))[on_blend],
    )
    joint_time[on_blend] *= 0.5
    local_time[on_blend], rate[on_blend] = np.inf, 0.0
    return blend_samples, _SpeedSamples(
        np.concatenate([index, index[on_blend] + 1]),
        np.concatenate([rate, rate[on_blend]]),
        *(
            np.concatenate([column, column[on_blend]])
            for column in (joint, joint_path.fractions, joint_time, local_time)
        ),
    )
