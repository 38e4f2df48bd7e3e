# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Sample the planned tool path, with the expected time of each sample."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from math import ceil

import numpy as np
from numpy.typing import NDArray

from ur_cartesian_driver.motion.plan import ReferencePath
from ur_cartesian_driver.motion.pose import Pose
from ur_cartesian_driver.motion.pose_rows import Floats, keep_hemisphere
from ur_cartesian_driver.planning.geometry.blended_path import BlendedPath
from ur_cartesian_driver.planning.geometry.curves import JointLineCurve
from ur_cartesian_driver.planning.moves.move_chain import MoveTimes, ramp_time
from ur_cartesian_driver.planning.moves.segment_data import SegmentGeometry

#: Minimum number of pieces of a joint move, so that its times are accurate.
_MIN_JOINT_SAMPLES = 8


def reference_path(
    start: Pose, path: BlendedPath, geometries: Sequence[SegmentGeometry], times: MoveTimes
) -> ReferencePath:
    """
    Return the path that the robot is expected to follow, blends included.

    Lines are sampled at their ends and where their acceleration changes, other curves so that
    their chords stay close (see :mod:`~ur_cartesian_driver.planning.geometry.curves`); no two rows
    differ by more than 10 degrees.
    """
    numbers: list[int] = []
    parameters: list[list[float]] = []
    knots = (times.knots / np.maximum(times.length - times.tail, 1e-300)[:, None]).tolist()
    for k, (geometry, own_knots) in enumerate(zip(geometries, knots, strict=True)):
        numbers.append(2 * k)
        parameters.append(_row_parameters(geometry, own_knots))
        if (blend := geometry.blend_after) is not None:
            numbers.append(2 * k + 1)
            n = blend.samples + blend.samples % 2  # one of them at the point
            parameters.append([k / n for k in range(1, n + 1)])
    number = np.repeat(numbers, [len(at) for at in parameters])
    at = np.fromiter(chain.from_iterable(parameters), dtype=np.float64)
    row, is_blend = number // 2, number % 2 == 1
    points = geometries[0].index + row + (is_blend & (at > 0.5))
    blend_tolerance = np.where(is_blend[:, None], path.blend_tolerance[row], 0.0)
    poses = np.concatenate([[start.row()], path.rows(number, at)])
    keep_hemisphere(poses)
    time = _times(path, times, row + is_blend, is_blend, at)
    return ReferencePath(
        poses=poses,
        point=np.concatenate([[geometries[0].index], points]).astype(np.int32),
        time=np.maximum.accumulate(np.concatenate([[0.0], time])),
        blend_tolerance=np.concatenate([[(0.0, 0.0)], blend_tolerance]),
    )


def _times(
    path: BlendedPath,
    times: MoveTimes,
    number: NDArray[np.intp],
    on_blend: NDArray[np.bool_],
    at: Floats,
) -> Floats:
    """
    Return when each row is expected (n,) [s].

    :param number: (n,) that of its segment; rows in a blend have that of the one behind it.
    """
    u_join, span = path.u_join, np.maximum(path.u_leave - path.u_join, 1e-300)
    begins = times.begins
    found = begins[number]
    rows = np.flatnonzero(~on_blend)
    own = number[rows]
    distance = (at[rows] - u_join[own]) / span[own] * (times.length - times.tail)[own]
    found[rows] += times.take(own).time_at(distance)
    rows = np.flatnonzero(on_blend)
    own = number[rows]
    begin, end = times.begin_rate[own], times.end_rate[own]
    found[rows] += ramp_time(begin, end, at[rows]) - ramp_time(begin, end, 1.0)
    return found


def _row_parameters(geometry: SegmentGeometry, knots: Sequence[float]) -> list[float]:
    """
    Return the ``u`` of the rows of a segment without its start, which the row before is.

    :param knots: fractions between the blends at which to sample the time.
    """
    begin, end = geometry.u_join, geometry.u_leave
    span = max(end - begin, 0.0)
    if isinstance(
        geometry.curve, JointLineCurve
    ):  # evenly: preview finds the joint positions by counting
        n = max(_MIN_JOINT_SAMPLES, ceil(geometry.curve.samples * span))
        return [*(begin + span * k / n for k in range(1, n)), end]
    n = max(1, ceil(geometry.curve.samples * span))
    parameters = {begin + span * k / n for k in range(1, n)}
    parameters.update(begin + span * f for f in knots if 0.0 < f < 1.0)
    return [*sorted(parameters), end]
