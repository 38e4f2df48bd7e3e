# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The samples along the path of a goal, and the times that joint speed limits require there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats, Indices, Int32s
from ur_cartesian_driver.motion.geometry.pose_rows import length_rows
from ur_cartesian_driver.motion.geometry.vectors import Joints
from ur_cartesian_driver.planning.geometry.samples import group_begins, last_greatest
from ur_cartesian_driver.planning.preflight.joint_path_solver import JointPath

# Samples whose parameters differ by less than this do not define a speed.
_MIN_STEP = 1e-12
# Rows per block, so that intermediate arrays stay in the CPU cache.
_BLOCK = 8192


@dataclass(frozen=True, slots=True, kw_only=True)
class JointSpeedBounds:
    """The times of whole segments as bounded by the joint speed limits; columns (n,)."""

    #: Time of the segment at the rate that the sample with the fastest joints allows [s].
    times: Floats
    #: Joint that is nearest to its speed limit at the sample with the fastest joints.
    joints: Indices
    #: Fraction of the segment at the sample with the fastest joints.
    fractions: Floats
    #: Time of the segment at the rate that the sample with the slowest joints allows [s].
    shortest_times: Floats
    #: Time of the segment if some joint is at its speed limit everywhere [s].
    times_at_limits: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class BlendSamples:
    """The samples in all blends of a goal; columns (n,)."""

    #: Waypoint that the blend rounds.
    index: Int32s
    #: Parameter ``s`` of the blend half-way between the previous sample and this one.
    s: Floats
    #: Half of the difference in ``s`` between these two samples.
    half_step: Floats
    #: Time per unit of ``s`` at the joint speed limits [s].
    joint_time: Floats
    #: Joint that needs ``joint_time``.
    joint: Indices
    #: Distance that the tool moves per unit of ``s`` [m].
    tool_distance: Floats


class PathSamples(NamedTuple):
    """Samples that the arm can follow, in order of time; columns (n,)."""

    segment: Int32s
    fraction: Floats
    #: Joint positions (n, 6) [rad].
    q: Floats
    #: Positions of the tool (n, 3) [m].
    positions: Floats
    #: Distances from singularities (n, 3); inf where singularities do not matter.
    measures: Floats
    #: Index of the waypoint at the end of the curve; in a blend, of the waypoint that is rounded.
    waypoint: Int32s
    is_blend: Flags
    #: The parameter on the curve.
    t: Floats
    #: Change of the parameter from the previous sample.
    step: Floats

    @classmethod
    def of(cls, path: JointPath, measures: Floats) -> PathSamples:
        """
        Return the samples of a joint path.

        :param measures: (n, 3) distances from singularities, inf where these do not matter.
        """
        pieces, piece, t = path.pieces, path.piece, path.t
        is_first = np.diff(piece, prepend=-1) != 0
        before = np.where(is_first, pieces.begin[piece], np.append(0.0, t[:-1]))
        return cls(
            path.segments,
            path.fractions,
            path.q,
            path.poses[:, :3].copy(),  # a view would keep the orientations
            measures,
            pieces.index[piece],
            pieces.is_blend[piece],
            t,
            t - before,
        )


def speed_bounds(
    arm: Arm, of: PathSamples, q_start: Joints
) -> tuple[JointSpeedBounds, BlendSamples]:
    """
    Return the speed bounds of whole segments, and the samples in blends.

    :param q_start: the configuration before the first sample [rad].
    """
    joint, joint_time = _slowest_joints(arm, of.q, q_start)
    moves, step = of.step > _MIN_STEP, np.maximum(of.step, _MIN_STEP)
    rate = np.where(moves, joint_time / step, 0.0)
    local_time = np.where(moves, rate, np.inf)
    on_blend = np.flatnonzero(of.is_blend)
    before = np.maximum(on_blend - 1, 0)
    distance = length_rows(of.positions[on_blend] - of.positions[before])
    blend_samples = BlendSamples(
        index=of.waypoint[on_blend],
        s=(of.t - 0.5 * of.step)[on_blend],
        half_step=0.5 * of.step[on_blend],
        joint_time=rate[on_blend],
        joint=joint[on_blend],
        tool_distance=distance / step[on_blend],
    )
    # A sample in a blend adds half its time to each of the two segments. It does not bound their
    # rates, because the joints may reverse in a blend.
    joint_time[on_blend] *= 0.5
    local_time[on_blend], rate[on_blend] = np.inf, 0.0
    rows = np.concatenate([np.arange(len(rate)), on_blend])
    segment = np.concatenate([of.waypoint, of.waypoint[on_blend] + 1])
    order = np.argsort(segment, kind='stable')  # two sorted runs
    rows, segment = rows[order], segment[order]
    last = rows[at := last_greatest(rate[rows], segment)]
    shortest = np.minimum.reduceat(local_time[rows], group_begins(segment))
    bounds = JointSpeedBounds(
        times=rate[last],
        joints=joint[last],
        fractions=of.fraction[last],
        shortest_times=np.minimum(shortest, rate[last]),
        times_at_limits=np.bincount(segment, joint_time[rows])[segment[at]],
    )
    return bounds, blend_samples


def _slowest_joints(arm: Arm, q: Floats, q_start: Joints) -> tuple[Indices, Floats]:
    """Return the joint (n,) that needs most time since the sample before, and that time [s]."""
    joint, time = np.empty(len(q), dtype=np.intp), np.empty(len(q))
    before = np.array([q_start])
    for begin in range(0, len(q), _BLOCK):
        rows = slice(begin, begin + _BLOCK)
        times = np.abs(np.diff(q[rows], axis=0, prepend=before)) / arm.model.max_joint_speed
        joint[rows] = np.argmax(times, axis=1)
        time[rows] = np.take_along_axis(times, joint[rows, None], axis=1)[:, 0]
        before = q[rows][-1:]
    return joint, time
