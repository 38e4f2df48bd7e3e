# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The timing of a chain of moves as the controller executes them, with a row for each move.

The controller looks one move ahead, and plans each move to come to rest at its waypoint. Where the
blend begins, the controller starts the next move and cuts the path of the current one. Along the
blend, a parameter ``s`` runs from 0 to 1, and its rate changes linearly over time. After the
blend, the next move continues at the speed with which the blend ends. So a move depends on the
previous one only through the handover (:class:`Handover`), and most moves hand over the same state
whatever they received. All rows are computed at once; then the rows that received a changed
handover are computed again, until no handover changes.

As on the robot, the larger of a move's length in metres and turn in radians *leads* the move; in a
joint move, the joint that turns farthest leads. Lengths, speeds and accelerations are measured in
the unit of the leading quantity.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Floats, Indices
from ur_cartesian_driver.motion.plan.plan import BlendEntry

#: A move that has a time, but leaves the blend before it late, runs at most at this multiple of
#: its mean speed.
_MAX_CATCH_UP = 2.0
#: Relative change below which a handover counts as unchanged.
_SAME = 1e-10
#: A move whose duration deviates by at most this [s] counts as in time.
_IN_TIME = 1e-7
#: Greatest number of rounds of :meth:`MoveChain.meet`; in each, the speeds of all moves that miss
#: their wanted times are fitted.
_MAX_FITS = 60
#: Greatest number of steps of the secant method that fits a speed.
_FIT_STEPS = 14
#: A fit ends when the relative errors of all times are below this.
_SAME_TIME = 1e-13
#: No move is slowed below this fraction of the mean speed that its wanted time requires.
_MIN_RATE = 0.2
_TINY = 1e-300


class _Columns:
    """A table with a row for each move, stored as columns (n,) of floats."""

    __slots__: ClassVar[tuple[str, ...]] = ()

    @classmethod
    def of(cls, rows: Any) -> Self:
        """Return the table with the given rows (n, number of columns)."""
        return cls(*np.array(rows, dtype=np.float64).reshape(-1, len(cls.__slots__)).T.copy())

    def take(self, rows: Indices) -> Self:
        """Return a table of the rows that ``rows`` (a numpy index) selects."""
        return type(self)(*[getattr(self, name)[rows] for name in self.__slots__])

    def put(self, rows: Indices, other: Self) -> None:
        """Replace the rows that ``rows`` selects by the rows of ``other``, in the same order."""
        for name in self.__slots__:
            getattr(self, name)[rows] = getattr(other, name)


@dataclass(slots=True)
class Moves(_Columns):
    """The parameters of moves; lengths are in m or rad, the unit of the leading quantity."""

    #: Length from waypoint to waypoint.
    length: Floats
    #: Greatest speed.
    speed: Floats
    #: Greatest acceleration.
    acceleration: Floats
    #: Time that the robot is given for the move [s]; 0 = it is given speed and acceleration.
    time: Floats
    #: For a move with a time: the fraction of this time for which the move speeds up, and also the
    #: fraction for which it brakes.
    ramp_part: Floats
    #: Length within which the move brakes from its greatest speed; inf = it brakes with its
    #: acceleration.
    stops_within: Floats
    #: Length of the move within the blend before it; 0 = no blend, the move begins at rest.
    head: Floats
    #: Length of the move within the blend after it; 0 = no blend, the move ends at rest.
    tail: Floats
    #: Length per unit of the parameter ``s`` at the end of the blend before the move.
    exit_rate: Floats
    #: Length per unit of the parameter ``s`` at the beginning of the blend after the move.
    entry_rate: Floats
    #: Time that the controller loses before the move [s].
    idle: Floats
    #: Rate of ``s`` half-way through the blend before the move, divided by the rate there if it
    #: changed linearly over time on the whole blend; 1 = it does.
    bend: Floats

    @property
    def accelerations(self) -> Floats:
        """Accelerations; for a move with a time, the one that it needs from rest to rest."""
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

    #: Rate of the blend's parameter ``s`` [1/s]; 0 = no blend.
    rate: Floats
    #: Time until the first of the two moves would come to rest at its waypoint [s].
    remaining: Floats
    #: Acceleration of the first move, in units of ``s`` [1/s^2].
    acceleration: Floats
    #: Length of the first move in units of ``s`` if the move has a time, else 0.
    length: Floats


@dataclass(slots=True)
class MoveTimes(_Columns):
    """
    The execution of moves by the controller.

    Each move has a profile from the end of the blend before it to rest at its waypoint: the speed
    changes to the cruising speed, and later to 0. The blend after the move cuts off the end of the
    profile.
    """

    #: Rate of ``s`` at the beginning of the blend before the move [1/s]; 0 = no blend.
    begin_rate: Floats
    #: Rate of ``s`` at the end of the same blend [1/s]; 0 = no blend.
    end_rate: Floats
    #: Length of the profile.
    length: Floats
    #: Speed at the beginning of the profile.
    enter: Floats
    #: Cruising speed.
    cruise: Floats
    #: Acceleration with which the speed changes to the cruising speed.
    acceleration: Floats
    #: Deceleration to rest.
    braking: Floats
    #: Length that the blend after the move cuts off.
    tail: Floats
    #: Time from the beginning of the profile to this cut [s].
    between: Floats
    #: Speed at the cut.
    leave: Floats
    #: Time lost before the move [s].
    idle: Floats
    #: Rate half-way through the blend before the move, see :attr:`Moves.bend`.
    bend: Floats

    @property
    def blend_time(self) -> Floats:
        """Time in the blend before each move [s]."""
        return ramp_time(self.begin_rate, self.end_rate, 1.0, self.bend)

    @property
    def blend_half(self) -> Floats:
        """Time in the first half of the blend before each move, up to its waypoint [s]."""
        return ramp_time(self.begin_rate, self.end_rate, 0.5, self.bend)

    @property
    def durations(self) -> Floats:
        """Times from point to point [s]; a blended point is passed in the middle of its blend."""
        half = self.blend_half
        durations: Floats = self.blend_time - half + self.between + np.append(half[1:], 0.0)
        return self.idle + durations

    @property
    def begins(self) -> Floats:
        """Time at which each move leaves the blend before it, or begins from rest [s]."""
        before = self.blend_time + self.idle
        return np.cumsum(before + self.between) - self.between

    def time_at(self, distance: Floats) -> Floats:
        """Return the time [s] from the beginning of each profile to a distance on it."""
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
        # Time spent braking: the whole braking time less the braking time still to come.
        to_come = np.sqrt(2.0 * np.minimum(left, ramp_out) / self.braking)
        time += np.maximum(cruise / self.braking - to_come, 0.0)
        return time

    def speed_at(self, distance: Floats) -> Floats:
        """Return the speed at a distance on each profile."""
        rate = np.copysign(self.acceleration, self.cruise - self.enter)
        changed = np.sqrt(np.maximum(self.enter**2 + 2.0 * rate * distance, 0.0))
        bound = np.minimum(changed, self.cruise)
        speed = np.where(rate > 0.0, bound, np.maximum(changed, self.cruise))
        left = np.maximum(self.length - distance, 0.0)
        brakes = left < _ramp_distance(0.0, self.cruise, self.braking)
        return np.where(brakes, np.sqrt(2.0 * self.braking * left), speed)

    @property
    def knots(self) -> Floats:
        """Distances (n, 4) on the profiles at which their times are sampled."""
        a = _ramp_distance(self.enter, self.cruise, self.acceleration)
        b = _ramp_distance(0.0, self.cruise, self.braking)
        # A knot on each ramp keeps the chords between the knots close to the ramp's parabola.
        return np.stack((0.25 * a, a, self.length - b, self.length - 0.25 * b), axis=1)


def ramp_time(begin: Floats, end: Floats, s: Floats | float, bend: Floats) -> Floats:
    """
    Return the times (n,) [s] to reach ``s`` in blends with the rates ``begin`` and ``end`` [1/s].

    The rates change linearly over time, on the whole blend or on each half of it: see
    :attr:`Moves.bend`.
    """
    even = _even_ramp_time(begin, end, s)
    if (bend == 1.0).all():
        return even
    middle = _middle_rate(begin, end, bend)
    first = _even_ramp_time(begin, middle, np.minimum(2.0 * s, 1.0))
    second = _even_ramp_time(middle, end, np.maximum(2.0 * s - 1.0, 0.0))
    return np.where(bend == 1.0, even, 0.5 * (first + second))


def ramp_rate(begin: Floats, end: Floats, s: Floats, bend: Floats) -> Floats:
    """Return the rates (n,) [1/s] at ``s`` in blends, see :func:`ramp_time`."""
    even = _even_ramp_rate(begin, end, s)
    if (bend == 1.0).all():
        return even
    middle = _middle_rate(begin, end, bend)
    first = _even_ramp_rate(begin, middle, np.minimum(2.0 * s, 1.0))
    second = _even_ramp_rate(middle, end, np.maximum(2.0 * s - 1.0, 0.0))
    return np.where(bend == 1.0, even, np.where(s < 0.5, first, second))


def _middle_rate(begin: Floats, end: Floats, bend: Floats) -> Floats:
    rate: Floats = bend * np.sqrt(0.5 * (begin**2 + end**2))
    return rate


def _even_ramp_rate(begin: Floats, end: Floats, s: Floats) -> Floats:
    rate: Floats = np.sqrt(np.maximum(begin**2 + (end**2 - begin**2) * s, 0.0))
    return rate


def _even_ramp_time(begin: Floats, end: Floats, s: Floats | float) -> Floats:
    there = np.sqrt(np.maximum(begin**2 + (end**2 - begin**2) * s, 0.0))
    time: Floats = np.where(end > 0.0, 2.0 * s / np.maximum(begin + there, _TINY), 0.0)
    return time


def _ramp_distance(speed: Floats | float, cruise: Floats, acceleration: Floats) -> Floats:
    distance: Floats = np.abs(cruise + speed) * np.abs(cruise - speed) / (2.0 * acceleration)
    return distance


class MoveChain:
    """
    A sequence of moves, and the times of its execution.

    :param first: state at the beginning of the first blend, if the first move has already begun.
    """

    def __init__(self, moves: Moves, first: BlendEntry | None = None) -> None:
        """Compute the times of all moves."""
        n = len(moves.length)
        self.moves, self._first = moves, first
        self._handed = Handover.of(np.zeros((n, 4)))
        self.times = MoveTimes.of(np.zeros((n, len(MoveTimes.__slots__))))
        if first is not None:
            self._handed.put(np.array([1]), Handover.of([first[:-1]]))
        self.follow(np.arange(n))

    @property
    def blend_entries(self) -> Floats:
        """The :class:`BlendEntry` (n, 5) of the blend after each move; zeros = no blend."""
        handed = (getattr(self._handed, name) for name in Handover.__slots__)
        before = np.stack((*handed, self.times.blend_half), axis=1)
        return np.concatenate((before[1:], np.zeros((1, 5))))

    def follow(self, rows: Indices) -> None:
        """Recompute rows whose moves have changed, and the later rows that the changes affect."""
        while len(rows):
            moves = self.moves.take(rows)
            times = _carry_out(moves, self._handed.take(rows))
            self.times.put(rows, times)
            rows = rows[(moves.tail > 0.0) & ((rows > 0) | (self._first is None))]
            if not len(rows):
                return
            new = _hand_over(self.moves.take(rows), self.times.take(rows))
            old = self._handed.take(rows + 1)
            changed = np.zeros(len(rows), dtype=np.bool_)
            for name in Handover.__slots__:
                a, b = getattr(new, name), getattr(old, name)
                changed |= np.abs(a - b) > _SAME * np.abs(a)
            rows = rows[changed] + 1
            self._handed.put(rows, new.take(np.flatnonzero(changed)))

    def durations_with(self, rows: Indices, moves: Moves) -> Floats:
        """
        Return the durations [s] that the moves of some rows have with other parameters.

        Each is computed as if only this move had changed.

        :param moves: the other parameters, for each of ``rows``.
        """
        times = _carry_out(moves, self._handed.take(rows))
        after = np.minimum(rows + 1, len(self.moves.length) - 1)
        handed = _hand_over(moves, times)
        begin, end = _blend_rates(self.moves.take(after), handed)
        bend = self.moves.bend[after]
        half = np.where(moves.tail > 0.0, ramp_time(begin, end, 0.5, bend), 0.0)
        return times.idle + (times.blend_time - times.blend_half + times.between + half)

    def meet(
        self,
        wanted: Floats,
        rate: Floats,
        max_rate: Floats,
        at_rate: Callable[[Indices, Floats], Moves],
    ) -> Floats:
        """
        Change the speeds so that the moves take the wanted times, as far as possible.

        :param wanted: times from point to point (n,) [s]; NaN = the move stays as it is.
        :param rate: rates of the moves (n,) [1/s]: speed over length, or 1 / the time that the
            robot is given. They are changed in place, up to ``max_rate``.
        :param at_rate: returns the parameters of the moves of given rows, at given rates.
        :returns: the times that the moves take (n,) [s].
        """
        asked = np.isfinite(wanted)
        asked[0] &= self._first is None
        lowest = np.minimum(_MIN_RATE / np.maximum(wanted, _TINY), max_rate)
        for _ in range(_MAX_FITS):
            spent = self.times.durations
            off = spent - wanted
            # If a move is early and cannot be slower, the next move takes longer instead.
            early = np.where((rate <= lowest) & (off < -_IN_TIME), -off, 0.0)
            if self._first is not None:
                early[0] = -off[0]
            off[1:] -= early[:-1]
            slow, fast = (off > _IN_TIME) & (rate < max_rate), (off < -_IN_TIME) & (rate > lowest)
            rows = np.flatnonzero(asked & (slow | fast))
            if not len(rows):
                return spent
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
        return self.times.durations


def _carry_out(moves: Moves, handed: Handover) -> MoveTimes:
    begin, end = _blend_rates(moves, handed)
    enter = end * moves.exit_rate
    rest, braking = moves.length - moves.head, moves.braking
    # Moves with a speed: the greatest speed from which the move can still brake.
    a = moves.acceleration
    peak = np.minimum(
        moves.speed, np.sqrt((2.0 * rest + enter**2 / a) / (1.0 / a + 1.0 / braking))
    )
    # Moves with a time: blend and profile together take that time plus the remaining time of the
    # previous move.
    timed, time = moves.time > 0.0, moves.time + handed.remaining
    left = np.maximum(
        time - ramp_time(begin, end, 1.0, moves.bend),
        time * rest / (moves.length + moves.head) / _MAX_CATCH_UP,
    )
    # Durations of the ramp to rest, and of the ramp to the cruising speed.
    last = np.where(timed, moves.ramp_part * left, 1.0)
    first = np.minimum(last, rest / np.maximum(enter, _TINY))
    even = (rest - 0.5 * enter * first) / np.where(timed, left - 0.5 * (first + last), 1.0)
    cruise = np.where(timed, even, peak)
    change = np.maximum(np.abs(cruise - enter), 1e-12 * cruise)
    acceleration = np.where(timed, change / first, a)
    braking = np.where(timed, cruise / last, braking)
    times = MoveTimes(
        begin,
        end,
        rest,
        enter,
        cruise,
        acceleration,
        braking,
        moves.tail,
        rest,
        rest,
        moves.idle,
        moves.bend,
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
    Return the rates of ``s`` [1/s] at which blends begin and end.

    The rate changes towards the cruising speed of the move after the blend, within three bounds:
    neither move may exceed its acceleration in the blend (a rate causes an acceleration of its
    square times the length per unit of ``s``), and the remainder of the move after the blend must
    be long enough to brake. The acceleration of a move with a time is the one that it needs from
    rest to rest. If the move before the blend has a time, its bound is at least the next move's
    acceleration, scaled by the ratio of the two lengths.
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
    Return the rates at which moves take the wanted times; if no rate does, the nearer bound.

    A duration is nearly a power of the rate, so the secant method is applied to logarithms.
    """
    low, high, x = np.log([lowest, highest, np.clip(rate, lowest, highest)])
    took = durations(np.tile(rows, 3), np.concatenate([lowest, highest, np.exp(x)]))
    f_low, f_high, f = np.log(took.reshape(3, -1) / wanted)
    unreachable, side = f_high >= 0.0, np.zeros(len(rate))
    for _ in range(_FIT_STEPS):
        slow = f > 0.0
        low, f_low_new = np.where(slow, x, low), np.where(slow, f, f_low)
        high, f_high_new = np.where(slow, high, x), np.where(slow, f_high, f)
        # Illinois method: the value at a bound that is kept a second time is halved.
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
