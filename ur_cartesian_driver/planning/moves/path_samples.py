# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The samples along the path of a goal, and how fast the joints are there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats, Indices, Int32s
from ur_cartesian_driver.motion.geometry.vectors import Joints
from ur_cartesian_driver.planning.geometry.samples import group_begins, last_greatest
from ur_cartesian_driver.planning.preflight.joint_path_solver import JointPath

# Samples whose parameters differ by less say nothing about a speed.
_MIN_STEP = 1e-12


@dataclass(frozen=True, slots=True, kw_only=True)
class JointSpeedBounds:
    """The times of whole segments at the speed limits of the joints; columns (n,)."""

    #: At the rate of the sample where the joints are fastest [s]; the leading joint there, and the
    #: fraction of the segment.
    times: Floats
    joints: Indices
    fractions: Floats
    #: At the rate of the sample where they are slowest; with some joint at its limit everywhere.
    shortest_times: Floats
    times_at_limits: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class BlendSamples:
    """The samples in all blends of a goal; columns (n,)."""

    #: The waypoint that the blend rounds, and the parameter half-way to the sample before.
    index: Int32s
    s: Floats
    #: For a unit of ``s`` there: time at the joint speed limits [s], with the joint that takes
    #: longest, and distance of the tool [m].
    joint_time: Floats
    joint: Indices
    tool_distance: Floats


class PathSamples(NamedTuple):
    """Samples that the arm can follow, in order of time; columns (n,)."""

    segment: Int32s
    fraction: Floats
    #: (n, 6) [rad], (n, 7), and (n, 3) distances from singularities, inf where they do not count.
    q: Floats
    poses: Floats
    measures: Floats
    #: Index of the waypoint at the end of the curve; of a blend the one that it rounds.
    waypoint: Int32s
    is_blend: Flags
    #: The parameter on the curve, and its change from the sample before.
    t: Floats
    step: Floats

    @classmethod
    def of(cls, path: JointPath, measures: Floats) -> PathSamples:
        """
        Return the samples of a joint path.

        :param measures: (n, 3) distances from singularities, inf where they do not count.
        """
        pieces, piece, t = path.pieces, path.piece, path.t
        is_first = np.diff(piece, prepend=-1) != 0
        before = np.where(is_first, pieces.begin[piece], np.append(0.0, t[:-1]))
        return cls(
            path.segments,
            path.fractions,
            path.q,
            path.poses,
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
    Return what bounds the speeds of whole segments, and those in blends.

    :param q_start: the configuration before the first sample [rad].
    """
    joint_times = np.diff(of.q, axis=0, prepend=np.array([q_start]))
    np.abs(joint_times, out=joint_times)  # in place: long goals have many samples
    joint_times /= arm.model.max_joint_speed
    joint = np.argmax(joint_times, axis=1)
    joint_time = np.take_along_axis(joint_times, joint[:, None], axis=1)[:, 0]
    moves, step = of.step > _MIN_STEP, np.maximum(of.step, _MIN_STEP)
    rate = np.where(moves, joint_time / step, 0.0)
    local_time = np.where(moves, rate, np.inf)
    distance = np.linalg.norm(np.diff(of.poses[:, :3], axis=0), axis=1)
    on_blend = np.flatnonzero(of.is_blend)
    blend_samples = BlendSamples(
        index=of.waypoint[on_blend],
        s=(of.t - 0.5 * of.step)[on_blend],
        joint_time=rate[on_blend],
        joint=joint[on_blend],
        tool_distance=(np.append(0.0, distance) / step)[on_blend],
    )
    # A sample in a blend counts for both segments. Joints may reverse there.
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
