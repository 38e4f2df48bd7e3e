# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Sample the planned tool path, with the expected time of each sample."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats, Indices
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.pose_rows import keep_hemisphere
from ur_cartesian_driver.motion.plan.plan import ReferencePath
from ur_cartesian_driver.planning.geometry.blended_path import BlendedPath
from ur_cartesian_driver.planning.geometry.samples import counted
from ur_cartesian_driver.planning.moves.move_chain import MoveTimes, ramp_time

#: Minimum number of pieces of a joint move, so that its times are accurate.
_MIN_JOINT_SAMPLES = 8
#: Number of rows that are computed at once, so that intermediate arrays stay in the CPU cache.
_BLOCK = 8192


def reference_path(start: Pose, begin: int, path: BlendedPath, times: MoveTimes) -> ReferencePath:
    """
    Return the path that the robot is expected to follow, blends included.

    Lines are sampled at their ends, where the acceleration changes, and once on each ramp of the
    speed. Other curves are sampled so that chords between the samples stay close to the curve (see
    :mod:`~ur_cartesian_driver.planning.geometry.curves`). Successive rows differ by at most
    10 degrees.

    :param begin: index of the waypoint at the end of the first segment.
    """
    number, at = _places(path, times)
    row, is_blend = number // 2, number % 2 == 1
    time = _times(path, times, row + is_blend, is_blend, at)
    time[0] = 0.0
    points = begin + row + (is_blend & (at > 0.5))
    blend_tolerance = np.zeros((len(at), 2))
    blend_tolerance[is_blend] = path.blend_tolerance[row[is_blend]]
    poses = path.rows(number, at)
    poses[0] = start.row()
    keep_hemisphere(poses)
    # The first half of a blend belongs to the segment before it, the second to the one after it.
    behind = np.append(path.u_join[1:], 0.0)[row]
    rounded = np.where(
        at > 0.5, (2.0 * at - 1.0) * behind, 1.0 - (1.0 - 2.0 * at) * (1.0 - path.u_leave[row])
    )
    return ReferencePath(
        poses=poses,
        point=points.astype(np.int32),
        time=np.maximum.accumulate(time),
        blend_tolerance=blend_tolerance,
        fraction=np.where(is_blend, rounded, at),
    )


def _places(path: BlendedPath, times: MoveTimes) -> tuple[Indices, Floats]:
    """
    Return curve number and curve parameter, each (n,), of all rows; the first row is the start.

    Segment k has the curve number 2 k, and the blend after it 2 k + 1.
    """
    curves, rows = path.curves, np.arange(len(path.u_join))
    begin, span = path.u_join, np.maximum(path.u_leave - path.u_join, 0.0)
    n = np.maximum(1, np.ceil(curves.chord_counts() * span)).astype(np.intp)
    # Joint moves are sampled evenly, because the preview finds joint positions by counting rows.
    n = np.where(curves.is_joint_line, np.maximum(n, _MIN_JOINT_SAMPLES), n)
    row, k = counted(n - 1)
    between = begin[row] + span[row] * k / n[row]
    knots = np.sort(times.knots / np.maximum(times.length - times.tail, 1e-300)[:, None], axis=1)
    inside = (knots > 0.0) & (knots < 1.0) & ~curves.is_joint_line[:, None]
    inside[:, 1:] &= knots[:, 1:] > knots[:, :-1]
    own = np.repeat(rows, inside.sum(axis=1))
    at_knots = (begin[:, None] + span[:, None] * knots)[inside]
    # The arm stands still before these segments. So each gets a row of its own at its beginning,
    # which is later than the row at the end of the segment before.
    late = np.flatnonzero((times.idle > 0.0) & ~curves.is_joint_line)
    own, at_knots = np.append(own, late), np.append(at_knots, begin[late])
    if len(row):
        own, at_knots = np.concatenate([row, own]), np.concatenate([between, at_knots])
        order = np.lexsort((at_knots, own))
        own, at_knots = own[order], at_knots[order]
    blends = np.flatnonzero(path.has_blend_after)
    # An even number of pieces puts one sample in the middle of the blend.
    n = path.blend_samples[blends] + path.blend_samples[blends] % 2
    blend, k = counted(n)
    number = np.concatenate([[0], 2 * own, 2 * rows, 2 * blends[blend] + 1])
    at = np.concatenate([[0.0], at_knots, path.u_leave, k / n[blend]])
    order = np.argsort(number, kind='stable')  # three sorted runs, and the start
    return number[order], at[order]


def _times(
    path: BlendedPath,
    times: MoveTimes,
    number: Indices,
    on_blend: Flags,
    at: Floats,
) -> Floats:
    """
    Return the expected time of each row (n,) [s].

    :param number: segment of each row (n,); for rows in a blend, the segment after the blend.
    """
    found, span = times.begins[number], np.maximum(path.u_leave - path.u_join, 1e-300)
    for rows in _blocks(~on_blend):
        own = number[rows]
        part = (at[rows] - path.u_join[own]) / span[own]
        found[rows] += times.take(own).time_at(part * (times.length - times.tail)[own])
    for rows in _blocks(on_blend):
        blend = times.take(number[rows])
        passed = ramp_time(blend.begin_rate, blend.end_rate, at[rows], blend.bend)
        found[rows] += passed - blend.blend_time
    return found


def _blocks(chosen: Flags) -> Iterator[Indices]:
    """Yield the chosen rows, some of them at a time."""
    rows = np.flatnonzero(chosen)
    for begin in range(0, len(rows), _BLOCK):
        yield rows[begin : begin + _BLOCK]
