# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The planned tool path as samples with the time at which each is expected."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import ceil

import numpy as np

from ur_cartesian_driver.motion.plan import ReferencePath
from ur_cartesian_driver.motion.pose import Pose
from ur_cartesian_driver.planning.corner import Corner, corner_rows, path_rows
from ur_cartesian_driver.planning.path import JointLine, Path
from ur_cartesian_driver.planning.pose_rows import Floats
from ur_cartesian_driver.planning.timing import Leg, Timing

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
    now = np.repeat(np.array([section.now for section in sections]), count)
    times = now + np.concatenate([section.after for section in sections])
    points = np.concatenate([section.points for section in sections])
    room = np.repeat(np.array([section.room for section in sections]), count, axis=0)
    poses = np.concatenate([[start.row()], _poses(sections)])
    _keep_hemisphere(poses)
    return ReferencePath(
        poses=poses, point=np.concatenate([[legs[0].index], points]).astype(np.int32),
        time=np.maximum.accumulate(np.concatenate([[0.0], times])),
        room=np.concatenate([[(0.0, 0.0)], room]))


@dataclass(frozen=True, slots=True)
class _Section:
    """The rows of one path or of one corner."""

    curve: Path | Corner
    #: Where on it.
    at: list[float]
    #: When it begins, and how long after that each row is [s].
    now: float
    after: list[float]
    points: list[int]
    room: tuple[float, float] = (0.0, 0.0)


def _sections(legs: Sequence[Leg], timings: Sequence[Timing]) -> Iterator[_Section]:
    now = 0.0
    for leg, timing in zip(legs, timings, strict=True):
        u, profile = _places(leg, timing), timing.profile
        span = leg.u_after - leg.u_before
        after = [profile.time_at(profile.length * (x - leg.u_before) / span)
                 if span > 0.0 else 0.0 for x in u]
        yield _Section(leg.path, u, now, after, [leg.index] * len(u))
        now += profile.duration
        if leg.after is not None:
            n = leg.after.samples
            s = [k / n for k in range(1, n + 1)]
            yield _Section(leg.after, s, now, [x * timing.corner for x in s],
                           [leg.index + (x > 0.5) for x in s], leg.after.room)
            now += timing.corner


def _poses(sections: Sequence[_Section]) -> Floats:
    """Return the poses (n, 7) of all rows."""
    count = [len(section.at) for section in sections]
    at = np.concatenate([section.at for section in sections])
    is_corner = np.array([isinstance(section.curve, Corner) for section in sections])
    number = np.where(is_corner, np.cumsum(is_corner), np.cumsum(~is_corner)) - 1
    of, rounds = np.repeat(number, count), np.repeat(is_corner, count)
    paths = [section.curve for section in sections if not isinstance(section.curve, Corner)]
    corners = [section.curve for section in sections if isinstance(section.curve, Corner)]
    poses = np.empty((len(at), 7))
    poses[~rounds] = path_rows(paths, of[~rounds], at[~rounds])
    if corners:
        poses[rounds] = corner_rows(corners, of[rounds], at[rounds])
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


def _keep_hemisphere(poses: Floats) -> None:
    """Turn signs of quaternions (q and -q are one orientation) so that rows do not jump."""
    dots = np.einsum('ij,ij->i', poses[1:, 3:], poses[:-1, 3:])
    signs = np.cumprod(np.where(dots < 0.0, -1.0, 1.0))
    poses[1:, 3:] *= signs[:, np.newaxis]
