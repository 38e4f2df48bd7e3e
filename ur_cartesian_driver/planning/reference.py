# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The planned tool path as samples with the time at which each is expected."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain
from math import ceil
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ur_cartesian_driver.motion.plan import ReferencePath
from ur_cartesian_driver.motion.pose import Pose
from ur_cartesian_driver.planning.corner import Corner, corner_rows, path_rows
from ur_cartesian_driver.planning.leg import Leg, Timing
from ur_cartesian_driver.planning.path import JointLine, Path
from ur_cartesian_driver.planning.pose_rows import Floats
from ur_cartesian_driver.planning.profile import Profile, times_at

#: The fewest pieces of a joint move, for the sake of its times.
_LEAST_OF_JOINTS = 8


def reference_path(start: Pose, legs: Sequence[Leg], timings: Sequence[Timing]) -> ReferencePath:
    """
    Return the path that the robot is expected to take, blends included.

    Lines have their ends and the places where they change speed, curves as many samples as keep
    the chords near (see :mod:`~.path`), and nothing turns by more than 10 degrees from row to row.
    """
    sections = list(_sections(legs, timings))
    count = [len(section.at) for section in sections]
    of = np.repeat(np.arange(len(sections)), count)
    at = np.fromiter(chain.from_iterable(section.at for section in sections), dtype=np.float64)
    is_corner = np.array([isinstance(section.curve, Corner) for section in sections])
    points = np.array([section.point for section in sections])[of] + (is_corner[of] & (at > 0.5))
    room = np.array(
        [
            section.curve.room if isinstance(section.curve, Corner) else (0.0, 0.0)
            for section in sections
        ]
    )[of]
    poses = np.concatenate([[start.row()], _poses(sections, is_corner, of, at)])
    keep_hemisphere(poses)
    return ReferencePath(
        poses=poses,
        point=np.concatenate([[legs[0].index], points]).astype(np.int32),
        time=np.maximum.accumulate(np.concatenate([[0.0], _times(sections, of, at)])),
        room=np.concatenate([[(0.0, 0.0)], room]),
    )


class _Section(NamedTuple):
    """The rows of one path or of one corner."""

    curve: Path | Corner
    point: int
    #: Where on it, and where it begins.
    at: list[float]
    begin: float
    #: When it begins [s], how its length passes, and what of that one unit of ``at`` is.
    now: float
    profile: Profile
    rate: float
    #: How long the profile's second lasts [s].
    second: float = 1.0


#: In corners ``s`` passes evenly.
_EVENLY = Profile(1.0, 1.0, 1.0, 1.0, 1.0)


def _sections(legs: Sequence[Leg], timings: Sequence[Timing]) -> Iterator[_Section]:
    now = 0.0
    for leg, timing in zip(legs, timings, strict=True):
        profile, span = timing.profile, leg.u_after - leg.u_before
        yield _Section(
            leg.path,
            leg.index,
            _places(leg, timing),
            leg.u_before,
            now,
            profile,
            profile.length / span if span > 0.0 else 0.0,
        )
        now += profile.duration
        if leg.after is not None:
            n = leg.after.samples
            yield _Section(
                leg.after,
                leg.index,
                [k / n for k in range(1, n + 1)],
                0.0,
                now,
                _EVENLY,
                1.0,
                timing.corner,
            )
            now += timing.corner


def _times(sections: Sequence[_Section], of: NDArray[np.intp], at: Floats) -> Floats:
    """Return when each row is expected (n,) [s]."""
    now, begin, rate, second = np.array([(x.now, x.begin, x.rate, x.second) for x in sections])[
        of
    ].T
    times: Floats = now + second * times_at([x.profile for x in sections], of, rate * (at - begin))
    return times


def _poses(
    sections: Sequence[_Section], is_corner: NDArray[np.bool_], of: NDArray[np.intp], at: Floats
) -> Floats:
    """Return the poses (n, 7) of all rows."""
    number = np.where(is_corner, np.cumsum(is_corner), np.cumsum(~is_corner)) - 1
    rounds = is_corner[of]
    paths = [section.curve for section in sections if not isinstance(section.curve, Corner)]
    corners = [section.curve for section in sections if isinstance(section.curve, Corner)]
    poses = np.empty((len(at), 7))
    poses[~rounds] = path_rows(paths, number[of[~rounds]], at[~rounds])
    if corners:
        poses[rounds] = corner_rows(corners, number[of[rounds]], at[rounds])
    return poses


def _places(leg: Leg, timing: Timing) -> list[float]:
    """Return the ``u`` of the rows of a leg, the first one left out (it is there already)."""
    begin, end = leg.u_before, leg.u_after
    span = max(end - begin, 0.0)
    if isinstance(leg.path, JointLine):  # evenly: preview finds the joint positions by counting
        n = max(_LEAST_OF_JOINTS, ceil(leg.path.samples * span))
        return [*(begin + span * k / n for k in range(1, n)), end]
    n = max(1, ceil(leg.path.samples * span))
    places = {begin + span * k / n for k in range(1, n)}
    places.update(begin + span * f for f in timing.profile.knots())
    return [*sorted(places), end]


def keep_hemisphere(poses: Floats) -> None:
    """Turn signs of quaternions (q and -q are one orientation) so that rows do not jump."""
    dots = np.einsum('ij,ij->i', poses[1:, 3:], poses[:-1, 3:])
    signs = np.cumprod(np.where(dots < 0.0, -1.0, 1.0))
    poses[1:, 3:] *= signs[:, np.newaxis]
