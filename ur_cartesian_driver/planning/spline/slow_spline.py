# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Find the stretches on which a spline is slower than requested.

The requested speed at each end of a segment is the lower of two speeds: the mean speed that the
goal's times give the segment, and the speed of the twist of the point there. Within the segment,
the requested speed is interpolated. The planned speeds are computed from the joint polynomials.
"""

from __future__ import annotations

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Floats, Int64s
from ur_cartesian_driver.motion.geometry.pose_rows import length_rows
from ur_cartesian_driver.motion.plan.slow_stretch import (
    SlowCause,
    SLOWER_BY,
    SlowStretch,
    SpeedLimit,
)
from ur_cartesian_driver.planning.preflight.tcp_kinematics import TcpKinematics
from ur_cartesian_driver.planning.spline.joint_polynomials import JointPolynomials
from ur_cartesian_driver.planning.spline.spline_path import SplinePath

#: A segment shorter than this [m] does not move the tool.
_MIN_LENGTH = 1e-6
#: A tool slower than this [m/s] rests.
_REST = 1e-9
#: The path reverses on a slow stretch if the dot product of its unit directions at the two ends
#: of the stretch is below this.
_REVERSAL = -0.5
#: Speeds are compared at this many places from each sample of the path to the next.
_PER_SAMPLE = 4


def slow_spline_stretches(
    kinematics: TcpKinematics,
    path: SplinePath,
    polynomials: JointPolynomials,
    twists: Floats,
    stretch: float,
    limit: SpeedLimit | None,
    slower_by: float = SLOWER_BY,
) -> tuple[SlowStretch, ...]:
    """
    Return the slow stretches of a spline from rest to rest.

    :param twists: (n, 6) the twists of the goal's points; NaN and 0 request no speed.
    :param stretch: the factor by which the times of the goal were stretched because of ``limit``.
    :param limit: the limit that would be exceeded otherwise; None = times were not stretched.
    :param slower_by: a speed is too low if it is more than this fraction below the requested one.
    """
    piece, u, times = _places(path)
    joints = polynomials.spline.rows(times)
    tool, _ = kinematics.tool_rates(*joints)
    velocities = tool[:, :3]
    speeds = length_rows(velocities)
    asked = _asked_speeds(path, piece, u, twists, stretch)
    wanted = (1.0 - slower_by) * asked
    edges = np.flatnonzero(np.diff(speeds < wanted, prepend=False, append=False))
    found = []
    for first, stop in edges.reshape(-1, 2).tolist():
        # The stretch may begin anywhere between the first slow place and the place before it.
        begin, end = max(first - 1, 0), min(stop, len(speeds) - 1)
        slowest = first + int(np.argmin(speeds[first:stop] / asked[first:stop]))
        is_ramp = (first == 0 or stop == len(speeds)) and piece[first] == piece[stop - 1]
        point, rests = path.first + int(piece[slowest]), bool(speeds[slowest] < _REST)
        reason = f'times and twists at both ends of the segment to point {point} leave it so'
        cause = SlowCause.TIMES
        if limit and stretch * speeds[slowest] >= wanted[slowest]:
            cause, reason = limit.cause, f'of {limit.text}'
        elif is_ramp:
            cause = SlowCause.RAMP
            reason = 'the arm starts from rest' if first == 0 else 'the arm comes to rest'
        elif velocities[begin] @ velocities[end] < _REVERSAL * speeds[begin] * speeds[end]:
            cause, reason = SlowCause.REVERSAL, f'the path reverses near point {point}'
        elif rests:
            cause, reason = SlowCause.STOP, f'the twist of point {point} is 0'
        at_end = bool(u[begin] == 1.0 and begin < end)
        found.append(
            SlowStretch(
                first=path.first + int(piece[begin]) + at_end,
                first_fraction=0.0 if at_end else float(u[begin]),
                last=path.first + int(piece[end]),
                last_fraction=float(u[end]),
                asked=float(asked[slowest]),
                lowest=0.0 if rests else float(speeds[slowest]),
                cause=cause,
                reason=reason,
                point=point,
            )
        )
    return tuple(found)


def _places(path: SplinePath) -> tuple[Int64s, Floats, Floats]:
    """Return for each place (n,) its piece, the fraction of the piece's time, and its time [s]."""
    rows = np.arange(_PER_SAMPLE * (len(path.u) - 1) + 1) / _PER_SAMPLE
    times = np.interp(rows, np.arange(len(path.u)), path.times)
    piece = path.piece[np.ceil(rows).astype(np.intp)]
    begin, end = path.spline.times[piece], path.spline.times[piece + 1]
    return piece, np.clip((times - begin) / (end - begin), 0.0, 1.0), times


def _asked_speeds(
    path: SplinePath, piece: Int64s, u: Floats, twists: Floats, stretch: float
) -> Floats:
    """Return the requested speeds [m/s] at places; 0 on segments that do not move the tool."""
    n = len(twists)
    ends = np.searchsorted(path.piece, np.arange(n), side='right') - 1
    lengths = np.diff(path.length[ends], prepend=0.0)
    mean = np.where(lengths > _MIN_LENGTH, stretch * lengths / np.diff(path.spline.times), 0.0)
    with np.errstate(over='ignore'):  # the length of a huge twist may be infinite
        given = length_rows(twists[:, :3])
    given = np.where(np.isfinite(given) & (given > 0.0), given, np.inf)
    before, after = np.append(np.inf, given[:-1]), given
    at_begin, at_end = np.minimum(mean, before)[piece], np.minimum(mean, after)[piece]
    asked: Floats = at_begin + u * (at_end - at_begin)
    return asked
