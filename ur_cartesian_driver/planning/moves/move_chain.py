# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The timing of a chain of moves, as the controller carries it out; a row for each move.

The controller knows one move ahead. It plans each move to rest at its waypoint. The call of the
next one comes where the blend begins: there the path is cut, the rate of the blend changes evenly,
and the rest of the next move begins with the speed at the end of the blend. So a move depends on
the one before only by its handover (:class:`Handover`), and most moves forget it. All rows are
computed at once, then the rows with a changed handover again, until none has changed.

Lengths are measured as the robot does: in metres, or radians where the turn or a joint leads.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Floats, Indices
from ur_cartesian_driver.motion.plan.plan import BlendEntry

#: To be in time, the part behind a blend is driven at most this much faster than the mean.
_MAX_CATCH_UP = 2.0
#: A handover that changes by less is the same (relative).
_SAME = 1e-10
#: A point is in time within this [s]; so often neighbours are fitted to each other at most.
_IN_TIME = 1e-7
_MAX_FITS = 60
#: Steps of a fit, which takes one more from where times differ by less than this (relative).
_FIT_STEPS = 14
_SAME_TIME = 1e-13
#: The part of the mean speed below which no move is slowed.
_MIN_RATE = 0.2
_TINY = 1e-300


class _Columns:
    """Columns (n,) of floats."""

    __slots__: ClassVar[tuple[str, ...]] = ()

    @classmethod
    def of(cls, rows: Any) -> Self:
        """Return the columns of rows (n, m)."""
        return cls(*np.array(rows, dtype=np.float64).reshape(-1, len(cls.__slots__)).T.copy())

    def take(self, rows: Indices) -> Self:
        """Return some rows."""
        return type(self)(*[getattr(self, name)[rows] for name in self.__slots__])

    def put(self, rows: Indices, other: Self) -> None:
        """Replace some rows."""
        for name in self.__slots__:
            getattr(self, name)[rows] = getattr(other, name)


@dataclass(slots=True)
class Moves(_Columns):
    """Per-move parameters on the wire; lengths in m or rad, whichever leads."""

    #: From waypoint to waypoint.
    length: Floats
    speed: Floats
    acceleration: Floats
    #: On the wire [s]; 0 = speed and acceleration count, else they give ``ramp_part`` only: the
    #: part of its time in which it speeds up, and that in which it brakes.
    time: Floats
    ramp_part: Floats
    #: It brakes from full speed within this length; inf = with its acceleration.
    stops_within: Floats
    #: Length in the blend before it and in the one after it, 0 = it rests there.
    head: Floats
    tail: Floats
    #: Length for a unit of ``s``, where the blend before it ends and where the one after begins.
    exit_rate: Floats
    entry_rate: Floats

    @property
    def accelerations(self) -> Floats:
        """Accelerations; of a move with a time those from rest to rest."""
        p = self.ramp_part
        by_time = self.length / np.maximum(p * (1.0 - p) * self.time**2, _TINY)
        return np.where(self.time > 0.0, by_time, self.acceleration)

    @property
    def braking(self) -> Floats:
        """Decelerations of moves without a time."""
        return np.maximum(self.acceleration, 0.5 * self.speed**2 / self.stops_within)


@dataclass(slots=True)
class Handover(_Columns):
    """The state that a move hands over to the next one where the blend between them begins."""

    #: Rate of ``s`` there [1/s], 0 = no blend.
    rate: Floats
    #: Time that the move before still has until it would rest at its waypoint [s].
    remaining: Floats
    #: Its acceleration and, if it has a time, its length; in units of ``s``.
    acceleration: Floats
    length: Floats


@dataclass(slots=True)
class MoveTimes(_Columns):
    """
    The execution of moves by the controller.

    Each has a profile from the blend before it to rest at its waypoint, of which the blend after
    it takes the end away: it changes to the cruise, and brakes from there to rest.
    """

    #: The rate of ``s`` at the begin and at the end of the blend before it, 0 = none [1/s].
    begin_rate: Floats
    end_rate: Floats
    #: The profile.
    length: Floats
    enter: Floats
    cruise: Floats
    acceleration: Floats
    braking: Floats
    #: The part that the blend after it takes away; time until there [s], and speed there.
    tail: Floats
    between: Floats
    leave: Floats

    @property
    def blend_time(self) -> Floats:
        """Time in the blend before it [s]."""
        return ramp_time(self.begin_rate, self.end_rate, 1.0)

    @property
    def blend_half(self) -> Floats:
        """Time in the first half of the blend before it, up to the point [s]."""
        return ramp_time(self.begin_rate, self.end_rate, 0.5)

    @property
    def durations(self) -> Floats:
        """Times from point to point [s]; a blended point is passed in the middle of its blend."""
        half = self.blend_half
        durations: Floats = self.blend_time - half + self.between + np.append(half[1:], 0.0)
        return durations

    @property
    def begins(self) -> Floats:
        """When the part between the blends begins [s]."""
        blend = self.blend_time
        return np.cumsum(blend + self.between) - self.between

    def time_at(self, distance: Floats) -> Floats:
        """Return when a distance on the profile is done, from its begin [s]."""
        enter, cruise = self.enter, np.maximum(self.cruise, _TINY)
        ramp_in = _ramp_distance(enter, cruise, self.acceleration)
        ramp_out = _ramp_distance(0.0, cruise, self.braking)
        left = np.clip(self.length - distance, 0.0, self.length)
        even = np.maximum(self.length - ramp_in - ramp_out, 0.0)
        x = np.clip(distance, 0.0, ramp_in)
        rate = np.copysign(self.acceleration, cruise - enter)
        speed = np.sqrt(np.maximum(enter * enter + 2.0 * rate * x, 0.0))
        time = 2.0 * x / np.maximum(enter + speed, _TINY)
        time += np.clip(distance - ramp_in, 0.0, even) / cruise
        # The time of braking so far: all of it less the rest.
        to_come = np.sqrt(2.0 * np.minimum(left, ramp_out) / self.braking)
        time += np.maximum(cruise / self.braking - to_come, 0.0)
        return time

    def speed_at(self, distance: Floats) -> Floats:
        """Return the speed at a distance on the profile."""
        rate = np.copysign(self.acceleration, self.cruise - self.enter)
        changed = np.sqrt(np.maximum(self.enter**2 + 2.0 * rate * distance, 0.0))
        bound = np.minimum(changed, self.cruise)
        speed = np.where(rate > 0.0, bound, np.maximum(changed, self.cruise))
        left = np.maximum(self.length - distance, 0.0)
        brakes = left < _ramp_distance(0.0, self.cruise, self.braking)
        return np.where(brakes, np.sqrt(2.0 * self.braking * left), speed)

    @property
    def knots(self) -> Floats:
        """Distances (n, 4) on the profile at which to sample its time."""
        a = _ramp_distance(self.enter, self.cruise, self.acceleration)
        b = _ramp_distance(0.0, self.cruise, self.braking)
        # The quarters of the ramps keep the chords between the knots close to the parabola.
        return np.stack((0.25 * a, a, self.length - b, self.length - 0.25 * b), axis=1)


def ramp_time(begin: Floats, end: Floats, s: Floats | float) -> Floats:
    """Return when ``s`` (n,) is reached in blends whose rates change evenly over time [s]."""
    there = np.sqrt(np.maximum(begin**2 + (end**2 - begin**2) * s, 0.0))
    time: Floats = np.where(end > 0.0, 2.0 * s / np.maximum(begin + there, _TINY), 0.0)
    return time


def _ramp_distance(speed: Floats | float, cruise: Floats, acceleration: Floats) -> Floats:
    distance: Floats = np.abs(cruise + speed) * np.abs(cruise - speed) / (2.0 * acceleration)
    return distance


class MoveChain:
    """
    Moves one after the other, and how they are carried out.

    :param first: where the first blend begins, if the first move is under way already.
    """

    def __init__(self, moves: Moves, first: BlendEntry | None = None) -> None:
        """Follow the moves."""
        n = len(moves.length)
        self.moves, self._first = moves, first
        self._handed = Handover.of(np.zeros((n, 4)))
        self.times = MoveTimes.of(np.zeros((n, len(MoveTimes.__slots__))))
        if first is not None:
            self._handed.put(np.array([1]), Handover.of([first[:-1]]))
        self.follow(np.arange(n))

    @property
    def blend_entries(self) -> Floats:
        """The :class:`BlendEntry` of the blend after each move (n, 5), zeros without one."""
        handed = (getattr(self._handed, name) for name in Handover.__slots__)
        before = np.stack((*handed, self.times.blend_half), axis=1)
        return np.concatenate((before[1:], np.zeros((1, 5))))

    def follow(self, rows: Indices) -> None:
        """Compute rows whose moves have changed, and those behind them that it concerns."""
        while len(rows):
            moves = self.moves.take(rows)
            times = _carry_out(moves, self._handed.take(rows))
            self.times.put(rows, times)
            rows = rows[(moves.tail > 0.0) & ((rows > 0) | (self._first is None))]
            new = _hand_over(self.moves.take(rows), self.times.take(rows))
            old = self._handed.take(rows + 1)
            changed = np.zeros(len(rows), dtype=np.bool_)
            for name in Handover.__slots__:
                a, b = getattr(new, name), getattr(old, name)
                changed |= np.abs(a - b) > _SAME * np.abs(a)
            rows = rows[changed] + 1
            self._handed.put(rows, new.take(np.flatnonzero(changed)))

    def durations_with(self, rows: Indices, moves: Moves) -> Floats:
        """Return the durations of some moves with other speeds, all others as they are [s]."""
        times = _carry_out(moves, self._handed.take(rows))
        after = np.minimum(rows + 1, len(self.moves.length) - 1)
        handed = _hand_over(moves, times)
        begin, end = _blend_rates(self.moves.take(after), handed)
        half = np.where(moves.tail > 0.0, ramp_time(begin, end, 0.5), 0.0)
        return times.blend_time - times.blend_half + times.between + half

    def meet(
        self,
        wanted: Floats,
        rate: Floats,
        max_rate: Floats,
        at_rate: Callable[[Indices, Floats], Moves],
    ) -> None:
        """
        Change speeds so that the moves take given times, as far as they can.

        :param wanted: times from point to point (n,) [s]; NaN = they stay as they are.
        :param rate: (n,) on which their speeds depend; none is faster than ``max_rate``.
        :param at_rate: returns some moves at rates.
        """
        asked = np.isfinite(wanted)
        asked[0] &= self._first is None
        lowest = np.minimum(_MIN_RATE / np.maximum(wanted, _TINY), max_rate)
        for _ in range(_MAX_FITS):
            spent = self.times.durations
            off = spent - wanted
            # Where a move cannot be slower and is early, the next one makes up for it.
            early = np.where((rate <= lowest) & (off < -_IN_TIME), -off, 0.0)
            if self._first is not None:
                early[0] = -off[0]
            off[1:] -= early[:-1]
            slow, fast = (off > _IN_TIME) & (rate < max_rate), (off < -_IN_TIME) & (rate > lowest)
            rows = np.flatnonzero(asked & (slow | fast))
            if not len(rows):
                return
            rate[rows] = _fit(
                lambda rows, x: self.durations_with(rows, at_rate(rows, x)),
                rows,
                spent[rows] - off[rows],
                rate[rows],
                lowest[rows],
                max_rate[rows],
            )
            self.moves.put(rows, at_rate(rows, rate[rows]))
            self.follow(rows)


def _carry_out(moves: Moves, handed: Handover) -> MoveTimes:
    begin, end = _blend_rates(moves, handed)
    enter = end * moves.exit_rate
    rest, braking = moves.length - moves.head, moves.braking
    # By speed: as fast as it gets, and in time to brake.
    a = moves.acceleration
    peak = np.minimum(
        moves.speed, np.sqrt((2.0 * rest + enter**2 / a) / (1.0 / a + 1.0 / braking))
    )
    # By time: the sum of times is kept.
    timed, time = moves.time > 0.0, moves.time + handed.remaining
    left = np.maximum(
        time - ramp_time(begin, end, 1.0),
        time * rest / (moves.length + moves.head) / _MAX_CATCH_UP,
    )
    last = np.where(timed, moves.ramp_part * left, 1.0)
    first = np.minimum(last, rest / np.maximum(enter, _TINY))
    even = (rest - 0.5 * enter * first) / np.where(timed, left - 0.5 * (first + last), 1.0)
    cruise = np.where(timed, even, peak)
    change = np.maximum(np.abs(cruise - enter), 1e-12 * cruise)
    acceleration = np.where(timed, change / first, a)
    braking = np.where(timed, cruise / last, braking)
    times = MoveTimes(
        begin, end, rest, enter, cruise, acceleration, braking, moves.tail, rest, rest
    )
    times.between = times.time_at(rest - moves.tail)
    times.leave = times.speed_at(rest - moves.tail)
    return times


def _hand_over(moves: Moves, times: MoveTimes) -> Handover:
    blended = moves.tail > 0.0
    rate = np.where(blended, moves.entry_rate, 1.0)
    timed = np.where(moves.time > 0.0, moves.length, 0.0)
    strongest = np.maximum(moves.accelerations, np.where(moves.time > 0.0, 0.0, moves.braking))
    return Handover(
        *(
            np.where(blended, column, 0.0)
            for column in (
                np.maximum(times.leave / rate, 1e-9),
                times.time_at(times.length) - times.between,
                strongest / rate,
                timed / rate,
            )
        )
    )


def _blend_rates(moves: Moves, handed: Handover) -> tuple[Floats, Floats]:
    """
    Return the rates at which blends begin and end.

    A rate changes to the next cruising speed, within three bounds: neither part gets faster than
    it accelerates (r'' = 2 r s'^2), and the rest of the move must suffice to brake. A move with a
    time accelerates as from rest to rest, or as the next one does in proportion to their lengths.
    """
    blended, timed = handed.rate > 0.0, moves.time > 0.0
    time = np.maximum(moves.time + handed.remaining, _TINY)
    even = (moves.length + moves.head) / (time * (1.0 - 0.5 * moves.ramp_part))
    stoppable = np.sqrt(2.0 * moves.braking * (moves.length - moves.head))
    cruise = np.where(timed, even, np.minimum(moves.speed, stoppable))
    accelerations, exit_rate = moves.accelerations, np.where(blended, moves.exit_rate, 1.0)
    before = np.maximum(handed.acceleration, handed.length * accelerations / moves.length)
    allowed = np.sqrt(np.minimum(before, accelerations / exit_rate))
    end = np.minimum(cruise / exit_rate, np.maximum(handed.rate, allowed))
    return handed.rate, np.where(blended, end, 0.0)


def _fit(
    durations: Callable[[Indices, Floats], Floats],
    rows: Indices,
    wanted: Floats,
    rate: Floats,
    lowest: Floats,
    highest: Floats,
) -> Floats:
    """
    Return the rates at which moves take given times, or the bounds.

    Times are nearly powers of the rate: the secant between two rates with the time in between.
    """
    low, high, x = np.log([lowest, highest, np.clip(rate, lowest, highest)])
    took = durations(np.tile(rows, 3), np.concatenate([lowest, highest, np.exp(x)]))
    f_low, f_high, f = np.log(took.reshape(3, -1) / wanted)
    unreachable, side = f_high >= 0.0, np.zeros(len(rate))
    for _ in range(_FIT_STEPS):
        slow = f > 0.0
        low, f_low_new = np.where(slow, x, low), np.where(slow, f, f_low)
        high, f_high_new = np.where(slow, high, x), np.where(slow, f_high, f)
        # The end that stays a second time counts half, so that it moves too.
        f_high = np.where(slow & (side > 0.0), 0.5 * f_high_new, f_high_new)
        f_low = np.where(~slow & (side < 0.0), 0.5 * f_low_new, f_low_new)
        side = np.where(slow, 1.0, -1.0)
        between = np.maximum(f_low - f_high, _TINY)
        x = np.where(
            f_high >= 0.0, high, np.where(f_low <= 0.0, low, low + (high - low) * f_low / between)
        )
        if (np.abs(f) < _SAME_TIME).all():
            break
        f = np.log(durations(rows, np.exp(x)) / wanted)
    return np.where(unreachable, highest, np.clip(np.exp(x), lowest, highest))
