# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Path parameter over time: trapezoids, timed moves, ramps and S-curves.

A profile is a chain of phases of constant jerk (zero except in the S-curve). The path parameter is
in the unit of the path: metres, radians of the joint with the longest travel, or none (blends).
All profiles end at rest, except :func:`ramp` and :func:`two_ramps`.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import sqrt

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Floats

_BISECTIONS = 80
#: A timed move without speed and acceleration accelerates for this fraction of its time, and
#: brakes for the same fraction.
TIMED_RAMP = 1.0 / 3.0


@dataclass(frozen=True, slots=True)
class _Phase:
    """A phase of constant jerk, with time, position, speed and acceleration at its beginning."""

    time: float
    position: float
    speed: float
    acceleration: float
    jerk: float

    def position_after(self, t: float) -> float:
        return self.position + t * (
            self.speed + t * (self.acceleration / 2.0 + t * self.jerk / 6.0)
        )

    def speed_after(self, t: float) -> float:
        return self.speed + t * (self.acceleration + t * self.jerk / 2.0)


@dataclass(frozen=True, slots=True)
class MotionProfile:
    """
    Progress ``s(t)`` from 0 at time 0 to ``length`` at ``duration`` [s], never backwards.

    :param phases: ordered by time; the first phase begins at 0.
    """

    length: float
    duration: float
    phases: tuple[_Phase, ...]

    def at(self, time: float) -> float:
        """Return the progress at a time: 0 before time 0, ``length`` from ``duration`` on."""
        if time >= self.duration:
            return self.length
        phase = self._phase_at(max(time, 0.0))
        return min(max(phase.position_after(max(time, 0.0) - phase.time), 0.0), self.length)

    def rows(self, times: Floats) -> Floats:
        """Return :meth:`at` for many times (n,)."""
        phases = np.array(
            [(p.time, p.position, p.speed, p.acceleration, p.jerk) for p in self.phases]
        )
        found = np.searchsorted(phases[:, 0], times, side='right') - 1
        begin, position, speed, acceleration, jerk = phases[np.maximum(found, 0)].T
        t = np.maximum(times, 0.0) - begin
        progress = position + t * (speed + t * (acceleration / 2.0 + t * jerk / 6.0))
        rows: Floats = np.where(
            times >= self.duration, self.length, np.clip(progress, 0.0, self.length)
        )
        return rows

    def speed(self, time: float) -> float:
        """Return ds/dt, never negative, at a time that is first limited to [0, duration]."""
        time = min(max(time, 0.0), self.duration)
        phase = self._phase_at(time)
        return max(phase.speed_after(time - phase.time), 0.0)

    def time_at(self, progress: float) -> float:
        """Return the first time at which a progress is reached, by bisection of ``s(t)``."""
        if progress <= 0.0:
            return 0.0
        if progress >= self.length:
            return self.duration
        low, high = 0.0, self.duration
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            if middle in (low, high):
                break
            if self.at(middle) < progress:
                low = middle
            else:
                high = middle
        return high

    def _phase_at(self, time: float) -> _Phase:
        found = self.phases[0]
        for phase in self.phases[1:]:
            if phase.time > time:
                break
            found = phase
        return found


def _chain(
    length: float, speed: float, phases: Iterable[tuple[float, float, float]]
) -> MotionProfile:
    """Join phases (duration, initial acceleration, jerk); ``speed`` is the speed at the start."""
    time = position = 0.0
    chain: list[_Phase] = []
    for duration, acceleration, jerk in phases:
        phase = _Phase(time, position, speed, acceleration, jerk)
        chain.append(phase)
        time += duration
        position = phase.position_after(duration)
        speed = phase.speed_after(duration)
    return MotionProfile(length, time, tuple(chain))


def trapezoid(
    length: float,
    acceleration: float,
    speed: float,
    start_speed: float = 0.0,
    braking: float | None = None,
) -> MotionProfile:
    """
    Return the profile that accelerates, cruises and brakes to rest.

    From rest and with b = a, the duration is d/v + v/a if d > v^2/a; otherwise the profile is a
    triangle of duration 2 sqrt(d/a). From a start speed v0, the peak speed is v, or if the length
    is too short for it, u from (u^2 - v0^2)/2a + u^2/2b = d. If v0 is above v, the profile first
    brakes to v. If v0 is too high to stop within the length, it brakes harder than b.

    :param braking: deceleration b; None = the acceleration a.
    """
    b = braking or acceleration
    if length <= 0.0:
        return MotionProfile(0.0, 0.0, (_Phase(0.0, 0.0, 0.0, 0.0, 0.0),))
    if start_speed * start_speed >= 2.0 * b * length:
        return _chain(
            length,
            start_speed,
            [(2.0 * length / start_speed, -start_speed * start_speed / (2.0 * length), 0.0)],
        )
    reachable = sqrt(
        (2.0 * length + start_speed**2 / acceleration) / (1.0 / acceleration + 1.0 / b)
    )
    rate = acceleration if start_speed <= speed else -b
    peak = min(speed, reachable)
    up, down = (peak - start_speed) / rate, peak / b
    cruise = (length - 0.5 * (start_speed + peak) * up - 0.5 * peak * down) / peak
    return _chain(
        length, start_speed, [(up, rate, 0.0), (max(cruise, 0.0), 0.0, 0.0), (down, -b, 0.0)]
    )


def timed_ramp(length: float, acceleration: float, speed: float) -> float:
    """
    Return the fraction of a trapezoid's time that each of its two ramps takes.

    From rest to rest T = d/v + v/a, so the fraction is v / (a T) = 1 / (1 + d a/v^2); it is 1/2 in
    a triangle. Without an acceleration or a speed it is TIMED_RAMP.
    """
    if min(acceleration, speed) <= 0.0:
        return TIMED_RAMP
    return 1.0 / (1.0 + max(1.0, length * acceleration / (speed * speed)))


def timed(
    length: float, duration: float, start_speed: float = 0.0, part: float = TIMED_RAMP
) -> MotionProfile:
    """
    Return the profile that is at rest after exactly ``duration`` [s].

    From rest, this is the trapezoid for the speed and acceleration of the call, but stretched
    evenly in time to the duration, as in five recordings of a UR3 (software 3.5).

    The first ramp takes x seconds and the last one y, so the cruising speed c follows from
    d = v0 x/2 + c (T - x/2 - y/2). y is ``part`` times T; x is the same, or d/v0 if that is less.

    :param part: fraction of the time that each ramp takes, see :func:`timed_ramp`. With a third,
        and from rest, c = 1.5 d/T and the acceleration is 4.5 d/T^2.
    """
    if length <= 0.0:
        return MotionProfile(0.0, duration, (_Phase(0.0, 0.0, 0.0, 0.0, 0.0),))
    x, y = _timed_ramps(length, duration, start_speed, part)
    c = (length - 0.5 * start_speed * x) / (duration - 0.5 * (x + y))
    return _chain(
        length,
        start_speed,
        [(x, (c - start_speed) / x, 0.0), (duration - x - y, 0.0, 0.0), (y, -c / y, 0.0)],
    )


def _timed_ramps(
    length: float, duration: float, start_speed: float, part: float
) -> tuple[float, float]:
    ramp_time = part * duration
    if start_speed <= 0.0:
        return ramp_time, ramp_time
    return min(ramp_time, length / start_speed), ramp_time


def ramp(length: float, start_speed: float, end_speed: float) -> MotionProfile:
    """Return the profile with a constant acceleration over the length: T = 2 d / (v0 + v1)."""
    duration = 2.0 * length / (start_speed + end_speed)
    return _chain(length, start_speed, [(duration, (end_speed - start_speed) / duration, 0.0)])


def two_ramps(start_speed: float, end_speed: float, ratio: float) -> MotionProfile:
    """
    Return the profile over the length 1 with a ramp (see :func:`ramp`) for each half.

    A single ramp would have the speed sqrt((v0^2 + v1^2) / 2) half-way; here the speed there is
    ``ratio`` times as high.
    """
    middle = ratio * sqrt(0.5 * (start_speed**2 + end_speed**2))
    halves = [
        (duration := 1.0 / (a + b), (b - a) / duration, 0.0)
        for a, b in ((start_speed, middle), (middle, end_speed))
    ]
    return _chain(1.0, start_speed, halves)


def s_curve(
    length: float, acceleration: float, speed: float, jerk: float, start_speed: float = 0.0
) -> MotionProfile:
    """
    Return the profile that accelerates, cruises and brakes to rest with limited jerk.

    A change of speed by w takes T = w/a + a/j if w >= a^2/j, else 2 sqrt(w/j), and covers the
    mean speed times T. The highest cruising speed for which the length suffices is found by
    bisection. If the start speed is too high to stop within the length in this way, the profile is
    a :func:`trapezoid`, whose jerk is not limited.
    """
    if length <= 0.0:
        return trapezoid(length, acceleration, speed)

    def distance(cruise: float) -> float:
        return _s_curve_distance(start_speed, cruise, acceleration, jerk) + _s_curve_distance(
            cruise, 0.0, acceleration, jerk
        )

    if start_speed > 0.0 and distance(min(start_speed, speed)) > length:
        return trapezoid(length, acceleration, speed, start_speed)
    peak = speed
    if distance(speed) > length:
        low, high = min(start_speed, speed), speed
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if distance(middle) <= length else (low, middle)
        peak = low
    cruise = max(length - distance(peak), 0.0) / peak
    return _chain(
        length,
        start_speed,
        [
            *_s_curve_ramp(start_speed, peak, acceleration, jerk),
            (cruise, 0.0, 0.0),
            *_s_curve_ramp(peak, 0.0, acceleration, jerk),
        ],
    )


def _s_curve_times(change: float, acceleration: float, jerk: float) -> tuple[float, float]:
    """Return the times [s] for which the acceleration rises (or falls) and is constant."""
    if change >= acceleration * acceleration / jerk:
        rise = acceleration / jerk
        return rise, change / acceleration - rise
    return sqrt(change / jerk), 0.0


def _s_curve_distance(start: float, end: float, acceleration: float, jerk: float) -> float:
    rise, hold = _s_curve_times(abs(end - start), acceleration, jerk)
    return 0.5 * (start + end) * (2.0 * rise + hold)


def _s_curve_ramp(
    start: float, end: float, acceleration: float, jerk: float
) -> list[tuple[float, float, float]]:
    rise, hold = _s_curve_times(abs(end - start), acceleration, jerk)
    j = jerk if end >= start else -jerk
    return [(rise, 0.0, j), (hold, j * rise, 0.0), (rise, j * rise, -j)]
