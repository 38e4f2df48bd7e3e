# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The ramp by which a controller slows the time of a path down to zero.

At constant speed v the travel goes on by ``v (t - t^2 / 2T)`` within the ramp of T. A controller
that changes the rate once a cycle is ahead of that inside the ramp, by v/8T times the square of a
cycle; so a constant is fitted, too. A stop while the move accelerates or brakes shows both at
once, and is not used.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ur_cartesian_driver.identification.least_squares import fit, Measured
from ur_cartesian_driver.identification.profile import MISFIT, Misfit
from ur_cartesian_driver.identification.segmentation import noise_of
from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats

#: Constant speed in front of the ramp that is needed [s]; most that is used.
_CRUISE, _MAX_CRUISE = 0.05, 0.5
#: Change of the speed within which it is constant.
_STEADY = 2e-3
_SHORTEST = 0.02


@dataclass(frozen=True, slots=True, kw_only=True)
class StopRamp:
    """
    A ramp that was found.

    :param begin: time at which it begins, by the controller's clock [s].
    :param time: from full speed to rest [s].
    :param deceleration: of the travel, if time is not scaled but speed is [rad/s^2 or m/s^2].
    """

    begin: float
    time: Measured
    deceleration: Measured


def find_ramp(time: Floats, travel: Floats, follows: Flags) -> StopRamp | Misfit | None:
    """
    Return the ramp from full speed to rest.

    :param time: (n,) the controller's clock [s], to rest.
    :param travel: (n,) travel along the path [rad or m].
    :param follows: mask (n,) of rows that come one cycle after the row before.
    :returns: None if the speed in front of the ramp is not constant, a misfit if the ramp is
        not even.
    """
    speed = np.diff(travel) / np.diff(time)
    fastest = float(speed.max(initial=0.0))
    if fastest <= 0.0:
        return None
    cycle = float(np.median(np.diff(time)))
    scatter = 4.0 * noise_of(travel) / cycle
    slow = speed < (1.0 - _STEADY) * fastest - scatter
    cruising = np.flatnonzero(~slow)
    last = int(cruising[-1])
    before = np.flatnonzero(slow[:last])
    first = int(before[-1]) + 2 if len(before) else 0
    first = max(first, int(np.searchsorted(time, time[last] - _MAX_CRUISE)))
    rest = np.flatnonzero(speed[last:] > 0.01 * fastest)
    moving = float(time[last + int(rest[-1]) + 1] - time[last])
    if time[last] - time[first] < _CRUISE or moving < _SHORTEST:
        return None
    rows = slice(first, len(time))
    t, origin = time[rows] - time[last], float(travel[first])

    def model(parameters: Floats) -> Floats:
        offset, v, begin, whole, ahead = parameters
        whole = max(abs(whole), cycle)
        inside = np.clip(t - begin, 0.0, whole)
        ramp = np.minimum(t, begin) + inside - 0.5 * inside * inside / whole
        edge = np.minimum(2.0 * np.minimum(inside, whole - inside) / cycle, 1.0)
        travel: Floats = offset + v * ramp + ahead * edge
        return travel

    guess = [origin - fastest * float(t[0]), fastest, 0.0, moving, 0.0]
    follows = follows[rows].copy()
    follows[0] = False
    found = fit(model, travel[rows], guess, follows)
    if found is None:
        return None
    if found.rms > max(MISFIT, 3.0 * noise_of(found.residuals)):
        return Misfit(rms=found.rms)
    _, v, begin, whole, _ = found.parameters.tolist()
    whole = max(abs(whole), cycle)
    error = found.combination({1: 1.0 / whole, 3: -v / whole**2}).error
    return StopRamp(
        begin=float(time[last]) + begin,
        time=found.measured(3),
        deceleration=Measured(value=v / whole, error=error, freedom=found.freedom),
    )
