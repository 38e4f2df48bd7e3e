# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The planned tool path as samples with the time at which each is expected."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from ur_cartesian_driver.motion.plan import ReferencePath
from ur_cartesian_driver.motion.pose import Pose
from ur_cartesian_driver.planning.corner import Corner
from ur_cartesian_driver.planning.path import JointLine
from ur_cartesian_driver.planning.timing import Leg, Timing

_Row: TypeAlias = tuple[float, ...]

#: The fewest pieces of a joint move, for the sake of its times.
_LEAST_OF_JOINTS = 8


def reference_path(start: Pose, legs: Sequence[Leg], timings: Sequence[Timing]) -> ReferencePath:
    """
    Return the path that the robot is expected to take, blends included.

    Lines have their ends and the places where they change speed, curves as many samples as keep
    the chords near (see :mod:`~.path`), and nothing turns by more than 10 degrees from row to row.
    """
    rows: list[_Row] = [start.row()]
    points: list[int] = [legs[0].index]
    times: list[float] = [0.0]
    room: list[tuple[float, float]] = [(0.0, 0.0)]
    now = 0.0
    for k, (leg, timing) in enumerate(zip(legs, timings, strict=True)):
        u = _places(leg, timing)
        rows.extend(_poses(leg, u))
        points.extend([leg.index] * len(u))
        span, way = leg.u_after - leg.u_before, timing.profile.length
        times.extend(now + timing.profile.time_at(way * (x - leg.u_before) / span)
                     if span > 0.0 else now for x in u)
        now += timing.profile.duration
        room.extend([(0.0, 0.0)] * len(u))
        if leg.after is not None:
            now = _append_corner(leg.after, (leg.index, legs[k + 1].index), now, timing.corner,
                                 rows, points, times)
            room.extend([leg.after.room] * leg.after.samples)
    poses = np.array(rows)
    _keep_hemisphere(poses)
    return ReferencePath(poses=poses, point=np.array(points, dtype=np.int32),
                         time=np.maximum.accumulate(np.array(times)), room=np.array(room))


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


def _poses(leg: Leg, places: list[float]) -> list[_Row]:
    path = leg.path
    if isinstance(path, JointLine):
        return [tuple(row) for row in path.rows(np.array(places)).tolist()]
    rows: list[_Row] = [path.pose(u).row() for u in places[:-1]]
    last = path.end if places[-1] == 1.0 else path.pose(places[-1])
    return [*rows, last.row()]


def _append_corner(corner: Corner, indices: tuple[int, int], now: float, lasts: float,
                   rows: list[_Row], points: list[int], times: list[float]) -> float:
    """Append the rows of a corner; return the time at its end."""
    n = corner.samples
    for k in range(1, n + 1):
        s = k / n
        rows.append(corner.pose(s).row())
        points.append(indices[s > 0.5])
        times.append(now + s * lasts)
    return now + lasts


def _keep_hemisphere(poses: NDArray[np.float64]) -> None:
    """Turn signs of quaternions (q and -q are one orientation) so that rows do not jump."""
    dots = np.einsum('ij,ij->i', poses[1:, 3:], poses[:-1, 3:])
    signs = np.cumprod(np.where(dots < 0.0, -1.0, 1.0))
    poses[1:, 3:] *= signs[:, np.newaxis]
