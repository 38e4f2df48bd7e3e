# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Speed profiles: accelerate, cruise, brake."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, sqrt

import numpy as np
from numpy.typing import NDArray

#: A move with a time stretches the trapezoid of the speed and acceleration beside it (recorded on
#: a UR3). We send 1.5 d/T and 4.5 d/T^2: a third of the time each for accelerating, cruising and
#: braking, which is also what robots would do that ignore the two.
RAMP_SHARE = 1.0 / 3.0


@dataclass(frozen=True, slots=True)
class SpeedProfile:
    """
    One motion of a length [m, rad, ...] that enters, cruises and leaves at given speeds.

    Both ramps have the same acceleration. Nothing may be faster than the cruise.
    """

    length: float
    enter: float
    cruise: float
    leave: float
    acceleration: float

    @property
    def duration(self) -> float:
        """Return the time it takes [s]."""
        if self.length <= 0.0:
            return 0.0
        ramp_in, ramp_out = self._ramp_distance(self.enter), self._ramp_distance(self.leave)
        return (self.length - ramp_in - ramp_out) / self.cruise + (
            2.0 * self.cruise - self.enter - self.leave
        ) / self.acceleration

    def time_at(self, distance: float) -> float:
        """Return the time at which a distance is done [s]."""
        if distance <= 0.0 or self.length <= 0.0:
            return 0.0
        if distance >= self.length:
            return self.duration
        ramp_in, ramp_out = self._ramp_distance(self.enter), self._ramp_distance(self.leave)
        if distance < ramp_in:
            return self._ramp_time(self.enter, distance)
        if distance > self.length - ramp_out:
            return self.duration - self._ramp_time(self.leave, self.length - distance)
        return (self.cruise - self.enter) / self.acceleration + (distance - ramp_in) / self.cruise

    def knots(self) -> tuple[float, ...]:
        """Return the fractions of the length in (0, 1) at which to sample the time."""
        if self.length <= 0.0:
            return ()
        a, b = (
            self._ramp_distance(self.enter) / self.length,
            self._ramp_distance(self.leave) / self.length,
        )
        # The halves of the ramps keep the chords between the knots close to the parabola.
        return tuple(f for f in (0.25 * a, a, 1.0 - b, 1.0 - 0.25 * b) if 0.0 < f < 1.0)

    def _ramp_distance(self, speed: float) -> float:
        """Return the distance between a speed and the cruise: (v^2 - u^2) / 2a."""
        return (self.cruise + speed) * (self.cruise - speed) / (2.0 * self.acceleration)

    def _ramp_time(self, speed: float, distance: float) -> float:
        """Return the time for the first part of a ramp from a speed: s = u t + a t^2 / 2."""
        a = self.acceleration
        return (sqrt(speed * speed + 2.0 * a * distance) - speed) / a


def times_at(
    profiles: Sequence[SpeedProfile], which: NDArray[np.intp], distance: NDArray[np.float64]
) -> NDArray[np.float64]:
    """
    Return :meth:`SpeedProfile.time_at` of many distances (n,).

    :param which: (n,) the number of the profile of each.
    """
    length, enter, cruise, leave, a = np.array(
        [(p.length, p.enter, p.cruise, p.leave, p.acceleration) for p in profiles]
    ).T[:, which]
    distance, cruise = np.clip(distance, 0.0, length), np.maximum(cruise, 1e-300)
    ramp_in, ramp_out = ((cruise + v) * (cruise - v) / (2.0 * a) for v in (enter, leave))
    left = length - distance
    speeding = (np.sqrt(enter * enter + 2.0 * a * np.minimum(distance, ramp_in)) - enter) / a
    even = np.clip(distance - ramp_in, 0.0, length - ramp_in - ramp_out) / cruise
    # The time of braking so far: all of it less the rest.
    to_come = (np.sqrt(leave * leave + 2.0 * a * np.minimum(left, ramp_out)) - leave) / a
    braking = np.where(left < ramp_out, (cruise - leave) / a - to_come, 0.0)
    times: NDArray[np.float64] = speeding + even + braking
    return times


def trapezoid(
    length: float,
    velocity: float,
    acceleration: float,
    enter: float = 0.0,
    stop_distance: float = 0.0,
) -> SpeedProfile:
    """
    Return the fastest profile within a speed and an acceleration.

    From rest to rest T = d/v + v/a if d > v^2/a, else the triangle T = 2 sqrt(d/a).

    :param enter: the speed at the start, as far as it does not exceed the velocity.
    :param stop_distance: how far behind the end it would come to rest; inf = it keeps its speed. A
        robot that does not know yet what follows its blend brakes for the waypoint.
    """
    leave = min(velocity, sqrt(2.0 * acceleration * stop_distance))
    enter = min(velocity, enter)
    peak = sqrt(acceleration * length + 0.5 * (enter * enter + leave * leave))
    return SpeedProfile(length, enter, max(enter, leave, min(velocity, peak)), leave, acceleration)


def profile_for_time(
    length: float,
    duration: float,
    stands_before: bool,
    stands_after: bool,
    share: float = RAMP_SHARE,
) -> SpeedProfile:
    """
    Return the profile of a motion that is sent with a time.

    :param share: of the time in each ramp, from rest to rest.
    """
    cruise = length / duration / (1.0 - 0.5 * share * (stands_before + stands_after))
    acceleration = max(cruise, 1e-12) / (share * duration)
    return SpeedProfile(
        length,
        0.0 if stands_before else cruise,
        cruise,
        0.0 if stands_after else cruise,
        acceleration,
    )


def peak_speed_and_acceleration(length: float, duration: float) -> tuple[float, float]:
    """
    Return the peak speed and acceleration of a motion that is sent with a time.

    They are those from rest to rest, 1.5 d/T and 4.5 d/T^2: the robot plans to stop at the
    waypoint, also where a blend then takes over.
    """
    speed = length / duration / (1.0 - RAMP_SHARE)
    return speed, speed / (RAMP_SHARE * duration)


def min_duration(
    length: float, speed: float, acceleration: float, peak: float = 1.0 / (1.0 - RAMP_SHARE)
) -> float:
    """
    Return the shortest time that keeps both peaks (above) within their bounds.

    :param peak: speed over mean speed; 2 where it might be a triangle, whose acceleration is less.
    """
    return max(
        peak * length / speed,
        sqrt(length / acceleration / (RAMP_SHARE * (1.0 - RAMP_SHARE))),
    )


def shortest_duration(length: float, speed: float, acceleration: float, ramps: int) -> float:
    """
    Return the shortest time of a motion that is sent with a speed, within both bounds [s].

    :param ramps: from and to rest, 0 to 2.
    """
    peak = min(speed, sqrt(2.0 * acceleration * length / ramps)) if ramps else speed
    return length / peak + 0.5 * ramps * peak / acceleration


def required_acceleration(length: float, duration: float, speed: float, ramps: int) -> float:
    """
    Return the least acceleration that does a length in a duration without exceeding a speed.

    It is the inverse of :func:`shortest_duration`: a = n v / 2 (T - d/v), with the triangle's peak
    2 d/T where that is less; inf if the speed alone is too low.
    """
    if ramps == 0:
        return 0.0
    peak = min(speed, 2.0 * length / duration)
    time_in_ramps = duration - length / peak
    return 0.5 * ramps * peak / time_in_ramps if time_in_ramps > 0.0 else inf


def cruise_speed_for(
    length: float, duration: float, acceleration: float, ramps: int
) -> float | None:
    """
    Return the cruise speed that takes exactly a duration, None if the acceleration is too low.

    Each of the ramps (0 to 2) costs the distance v^2 / 2a, so v T = d + n v^2 / 2a; the smaller
    root counts.
    """
    root = duration * duration - 2.0 * ramps * length / acceleration
    if root < 0.0:
        return None
    return 2.0 * length / (duration + sqrt(root))
