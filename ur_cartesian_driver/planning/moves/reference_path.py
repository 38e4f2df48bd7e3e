# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Sample the planned tool path, with the expected time of each sample."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain
from math import ceil
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ur_cartesian_driver.motion.plan import ReferencePath
from ur_cartesian_driver.motion.pose import Pose
from ur_cartesian_driver.motion.pose_rows import Floats, keep_hemisphere
from ur_cartesian_driver.planning.geometry.blend import Blend, curve_rows
from ur_cartesian_driver.planning.geometry.curves import JointLineCurve, SegmentCurve
from ur_cartesian_driver.planning.geometry.speed_profile import SpeedProfile, times_at
from ur_cartesian_driver.planning.moves.segment_data import SegmentGeometry, SegmentTiming

#: Minimum number of pieces of a joint move, so that its times are accurate.
_MIN_JOINT_SAMPLES = 8


def reference_path(
    start: Pose, geometries: Sequence[SegmentGeometry], timings: Sequence[SegmentTiming]
) -> ReferencePath:
    """
    Return the path that the robot is expected to follow, blends included.

    Lines are sampled at their ends and where their acceleration changes, other curves so that
    their chords stay close (see :mod:`~ur_cartesian_driver.planning.geometry.curves`); no two rows
    differ by more than 10 degrees.
    """
    sections = list(_sections(geometries, timings))
    count = [len(section.at) for section in sections]
    of = np.repeat(np.arange(len(sections)), count)
    at = np.fromiter(chain.from_iterable(section.at for section in sections), dtype=np.float64)
    is_blend = np.array([isinstance(section.curve, Blend) for section in sections])
    points = np.array([section.point for section in sections])[of] + (is_blend[of] & (at > 0.5))
    blend_tolerance = np.array(
        [
            section.curve.blend_tolerance if isinstance(section.curve, Blend) else (0.0, 0.0)
            for section in sections
        ]
    )[of]
    poses = np.concatenate(
        [[start.row()], curve_rows([section.curve for section in sections], of, at)]
    )
    keep_hemisphere(poses)
    return ReferencePath(
        poses=poses,
        point=np.concatenate([[geometries[0].index], points]).astype(np.int32),
        time=np.maximum.accumulate(np.concatenate([[0.0], _times(sections, of, at)])),
        blend_tolerance=np.concatenate([[(0.0, 0.0)], blend_tolerance]),
    )


class _PathSection(NamedTuple):
    """The rows of one curve or of one blend."""

    curve: SegmentCurve | Blend
    point: int
    #: Parameters of the rows, and of its begin.
    at: list[float]
    begin: float
    #: When it begins [s], its speed profile, and the length in it of one unit of ``at``.
    now: float
    profile: SpeedProfile
    rate: float
    #: Time of one unit of the profile's time [s].
    second: float = 1.0


#: In blends ``s`` increases evenly.
_UNIFORM = SpeedProfile(1.0, 1.0, 1.0, 1.0, 1.0)


def _sections(
    geometries: Sequence[SegmentGeometry], timings: Sequence[SegmentTiming]
) -> Iterator[_PathSection]:
    now = 0.0
    for geometry, timing in zip(geometries, timings, strict=True):
        profile, span = timing.profile, geometry.u_leave - geometry.u_join
        yield _PathSection(
            geometry.curve,
            geometry.index,
            _row_parameters(geometry, timing),
            geometry.u_join,
            now,
            profile,
            profile.length / span if span > 0.0 else 0.0,
        )
        now += profile.duration
        if geometry.blend_after is not None:
            n = geometry.blend_after.samples
            yield _PathSection(
                geometry.blend_after,
                geometry.index,
                [k / n for k in range(1, n + 1)],
                0.0,
                now,
                _UNIFORM,
                1.0,
                timing.blend_time,
            )
            now += timing.blend_time


def _times(sections: Sequence[_PathSection], of: NDArray[np.intp], at: Floats) -> Floats:
    """Return when each row is expected (n,) [s]."""
    now, begin, rate, second = np.array([(x.now, x.begin, x.rate, x.second) for x in sections])[
        of
    ].T
    times: Floats = now + second * times_at([x.profile for x in sections], of, rate * (at - begin))
    return times


def _row_parameters(geometry: SegmentGeometry, timing: SegmentTiming) -> list[float]:
    """Return the ``u`` of the rows of a segment without its start, which the row before is."""
    begin, end = geometry.u_join, geometry.u_leave
    span = max(end - begin, 0.0)
    if isinstance(
        geometry.curve, JointLineCurve
    ):  # evenly: preview finds the joint positions by counting
        n = max(_MIN_JOINT_SAMPLES, ceil(geometry.curve.samples * span))
        return [*(begin + span * k / n for k in range(1, n)), end]
    n = max(1, ceil(geometry.curve.samples * span))
    parameters = {begin + span * k / n for k in range(1, n)}
    parameters.update(begin + span * f for f in timing.profile.knots())
    return [*sorted(parameters), end]
