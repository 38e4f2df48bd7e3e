# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The fastest time law along a path from rest to rest.

With y = ds/dt squared and u = d2s/dt2, a speed limit bounds y, and each acceleration limit bounds
u between two functions of y: for a joint |q' u + q'' y| <= a, for the tool |x' u + x'' y| <= a.
The largest speeds from which the arm can still slow down in time are found backwards from the end;
then the arm accelerates forwards as fast as these speeds and the limits allow (Pham and Pham, A
new approach to time-optimal path parameterization based on reachability analysis, 2018).

This law jumps from one acceleration to another. :class:`TimeLaw` is its moving average over a
window of time, which bounds the jerk along the path. An average never exceeds the greatest value
in its window. So the averaged law keeps the speed limits if each limit is first lowered to the
least limit that the window reaches (:func:`lowered_over`).
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass
from functools import cached_property
from math import inf
from typing import NamedTuple

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats, Indices
from ur_cartesian_driver.motion.geometry.pose_rows import length_rows

# Number of halvings in a bisection.
_HALVINGS = 30
_TINY = 1e-12
_JUST_BELOW = 1.0 - 1e-9
# Times that are out of reach by less than this are in reach, because of rounding errors [s].
_NO_TIME = 1e-9
# Number of steps of Newton's method that find the time at a place; no step is made where ds/dt is
# less than _NO_SPEED [m/s].
_NEWTON_STEPS = 4
_NO_SPEED = 1e-9
# Between two places that are passed within this time, no further time is sampled, because the
# averaging window is longer [s].
_APART = 0.004


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LawLimits:
    """The limits at m places of a path."""

    #: (m,) greatest ds/dt.
    speed: Floats
    #: (m, k) q' of k joints in |q' u + q'' y| <= a.
    first: Floats
    #: (m, k) q'' of these joints.
    second: Floats
    #: (m, k) a of these joints.
    bound: Floats
    #: For each vector of the tool: x' (m, 3), x'' (m, 3) and a (m,) in |x' u + x'' y| <= a.
    vectors: tuple[tuple[Floats, Floats, Floats], ...]


class _Bounds:
    """Bounds of u for a given y: +-c - d y by joints, +-sqrt(r^2 - (n y)^2) - m y by vectors."""

    def __init__(self, limits: LawLimits) -> None:
        self.c: list[Floats] = []
        self.d: list[Floats] = []
        self.r: list[Floats] = []
        self.m: list[Floats] = []
        self.n: list[Floats] = []
        for first, second, bound in limits.vectors:
            square = np.maximum(np.einsum('ij,ij->i', first, first), _TINY**2)
            along = np.einsum('ij,ij->i', first, second) / square
            length = np.sqrt(square)
            self.r.append(bound / length)
            self.m.append(along)
            self.n.append(length_rows(second - along[:, None] * first) / length)
        for k in np.flatnonzero(self._joints_that_matter(limits)):
            first, second = limits.first[:, k], limits.second[:, k]
            size = np.maximum(np.abs(first), _TINY)
            self.c.append(limits.bound[:, k] / size)
            self.d.append(np.sign(first) * second / size)

    def _joints_that_matter(self, limits: LawLimits) -> Flags:
        """Return whether each joint (k,) might reach its limit within the vectors' limits."""
        y = (limits.speed**2)[:, None]
        largest = np.minimum.reduce(
            [np.full(len(y), inf)]
            + [r + np.abs(m) * y[:, 0] for r, m in zip(self.r, self.m, strict=True)]
        )
        reached = np.abs(limits.first) * largest[:, None] + np.abs(limits.second) * y
        matter: Flags = ~(reached <= limits.bound).all(axis=0)
        return matter

    def take(self, rows: Indices | slice) -> _Bounds:
        """Return the bounds at some places."""
        found = object.__new__(_Bounds)
        for name in 'cdrmn':
            setattr(found, name, [column[rows] for column in getattr(self, name)])
        return found

    def scaled(self, factor: Floats) -> _Bounds:
        """Return the bounds with the limits of acceleration multiplied by factors (m,)."""
        found = copy(self)
        found.c, found.r = ([column * factor for column in each] for each in (self.c, self.r))
        return found

    def range(self, y: Floats) -> tuple[Floats, Floats]:
        """Return least and largest u (m,) at each place; NaN or least > largest = none allowed."""
        high, low = np.full(len(y), inf), np.full(len(y), -inf)
        for c, d in zip(self.c, self.d, strict=True):
            middle = d * y
            high, low = np.minimum(high, c - middle), np.maximum(low, -c - middle)
        for r, m, n in zip(self.r, self.m, self.n, strict=True):
            across, middle = n * y, m * y
            root = np.sqrt(np.where(across <= r, r * r - across * across, np.nan))
            high, low = np.minimum(high, root - middle), np.maximum(low, -root - middle)
        return low, high

    def largest_before(self, step: Floats, after: Floats) -> Floats:
        """
        Return the largest y (m,) from which a step leads to at most ``after``.

        :param step: (m,) twice the distance to the next place; ``after``: (m,) the y there.
        """
        largest = np.full(len(after), inf)
        with np.errstate(divide='ignore', invalid='ignore'):
            for c, d in zip(self.c, self.d, strict=True):
                rate = 1.0 - step * d
                reached = (after + step * c) / rate
                largest = np.minimum(largest, np.where(rate > 0.0, reached, inf))
            for r, m, n in zip(self.r, self.m, self.n, strict=True):
                # (1 - step m) y - step sqrt(r^2 - n^2 y^2) <= after; where step m >= 1, any y fits
                a, b = 1.0 - step * m, step * n
                square = a * a + b * b
                root = np.sqrt(square * (step * r) ** 2 - (b * after) ** 2)
                largest = np.fmin(largest, np.where(a > 0.0, (a * after + root) / square, inf))
        return largest


class FastestLaw:
    """
    The fastest law along a path, for limits that may be tightened.

    :param s: the places (m,), increasing.
    :param limits: the limits before tightening; joints that cannot reach theirs are left out.
    """

    def __init__(self, s: Floats, limits: LawLimits) -> None:
        """Prepare the bounds."""
        self._step, self._bounds = 2.0 * np.diff(s), _Bounds(limits)

    def squares(self, speed: Floats, factor: Floats) -> Floats:
        """
        Return the square of the greatest possible ds/dt at places (m,); it is 0 at both ends.

        :param speed: (m,) greatest ds/dt, not above the speed of the limits.
        :param factor: (m,) factor on the limits of acceleration.
        """
        bounds, step = self._bounds.scaled(factor), self._step
        y = _possible(bounds, speed**2)
        y[0] = y[-1] = 0.0
        y = _lowered(y, lambda row, after: bounds.take(row).largest_before(step[row], after))
        back, step_back = bounds.take(slice(None, None, -1)), step[::-1]
        # Backwards, a step begins in the row that is later on the path.
        after_step = back.take(slice(1, None))
        return _lowered(
            y[::-1],
            lambda row, before: before + step_back[row] * after_step.take(row).range(before)[1],
        )[::-1]


def _possible(bounds: _Bounds, y: Floats) -> Floats:
    """Return the largest y (m,), at most the given y, at which some u is allowed."""
    for r, n in zip(bounds.r, bounds.n, strict=True):
        y = np.minimum(y, _JUST_BELOW * r / np.maximum(n, _TINY))
    low, high = bounds.range(y)
    rows = np.flatnonzero(~(low <= high))
    if not len(rows):
        return y
    few = bounds.take(rows)
    least, largest = np.zeros(len(rows)), y[rows]
    for _ in range(_HALVINGS):
        middle = 0.5 * (least + largest)
        low, high = few.range(middle)
        fits = low <= high
        least, largest = np.where(fits, middle, least), np.where(fits, largest, middle)
    found = y.copy()
    found[rows] = least
    return found


def _lowered(y: Floats, reachable: Callable[[Indices | slice, Floats], Floats]) -> Floats:
    """
    Return the given y (m,), lowered until the step from each row to the next is possible.

    All ramps are followed at the same time, each from its lower end, one row at a time.

    :param reachable: takes rows (r,) and the y (r,) in the rows after them; returns the largest y
        in these rows for which the step between the two is possible.
    """
    y = y.copy()
    falls = np.maximum(reachable(slice(0, len(y) - 1), y[1:]), 0.0) < y[:-1] - _TINY
    while falls.any():
        rows = np.flatnonzero(falls & ~np.append(falls[1:], False))
        changed = np.zeros(len(y), dtype=np.bool_)
        while len(rows):
            lower = np.maximum(reachable(rows, y[rows + 1]), 0.0)
            lowered = lower < y[rows] - _TINY
            rows = rows[lowered]
            y[rows] = lower[lowered]
            changed[rows] = True
            rows = rows[rows > 0] - 1
        # Steps to and from the other rows have not changed.
        again = np.flatnonzero(falls | changed[:-1] | changed[1:])
        falls[again] = np.maximum(reachable(again, y[again + 1]), 0.0) < y[again] - _TINY
    return y


class PathTimes(NamedTuple):
    """The place s on the path, v = ds/dt and a = d2s/dt2, at m times."""

    s: Floats
    v: Floats
    a: Floats


class TimeLaw:
    """
    The moving average of a law whose acceleration is constant between places. Immutable.

    :param s: the places (m,), increasing.
    :param y: the square of ds/dt at the places (m,), 0 at both ends only.
    :param window: period over which the law is averaged [s].
    """

    def __init__(self, s: Floats, y: Floats, window: float) -> None:
        """Integrate the law over time."""
        v, ds = np.sqrt(y), np.diff(s)
        dt = 2.0 * ds / np.maximum(v[1:] + v[:-1], _TINY)
        self.window = window
        #: (m,) time at which the law passes each place, before it is averaged [s].
        self.times = np.concatenate([[0.0], np.cumsum(dt)])
        self.duration = float(self.times[-1]) + window
        self._s, self._v = s, v
        self._a = np.append(np.diff(v) / dt, 0.0)
        travel = dt * (s[:-1] + dt * (v[:-1] / 2.0 + dt * self._a[:-1] / 6.0))
        self._integral = np.concatenate([[0.0], np.cumsum(travel)])

    def _at(self, t: Floats) -> tuple[Floats, Floats, Floats]:
        """Return, without averaging, the integral of s over time, s, and ds/dt at any times."""
        inside = np.clip(t, 0.0, self.times[-1])
        row = np.clip(np.searchsorted(self.times, inside, side='right') - 1, 0, len(self._s) - 2)
        h = inside - self.times[row]
        s, v, a = self._s[row], self._v[row], self._a[row]
        integral = self._integral[row] + h * (s + h * (v / 2.0 + h * a / 6.0))
        beyond = t - inside
        place = s + h * (v + h * a / 2.0)
        return integral + beyond * place, place, np.where(beyond == 0.0, v + h * a, 0.0)

    def at(self, t: Floats) -> PathTimes:
        """Return the averaged law at times (m,) from 0 to the duration [s]."""
        before, after = self._at(t - self.window), self._at(t)
        s, v, a = ((b - a) / self.window for a, b in zip(before, after, strict=True))
        return PathTimes(np.clip(s, self._s[0], self._s[-1]), v, a)

    def accelerations(self, t: Floats) -> Floats:
        """Return d2s/dt2 of the averaged law at times (m,) from 0 to the duration [s]."""
        before, after = (np.interp(each, self.times, self._v) for each in (t - self.window, t))
        found: Floats = (after - before) / self.window
        return found

    def sampled_times(self, at: Flags | None = None) -> Floats:
        """
        Return times (k,) near which the averaged law passes places [s].

        If it takes longer than :data:`_APART` from one place to the next, a time in between is
        added.

        :param at: (m,) flags of the places; their neighbours are included. None = all places.
        """
        passed = self.times + 0.5 * self.window
        between, apart = 0.5 * (passed[1:] + passed[:-1]), np.diff(passed) > _APART
        if at is not None:
            near = at[1:] | at[:-1]
            passed = passed[np.append(near, False) | np.append(False, near)]
            apart &= near
        return np.sort(np.concatenate([passed, between[apart]]))

    @cached_property
    def table(self) -> tuple[Floats, PathTimes]:
        """:meth:`sampled_times` with both ends of the motion (k,) [s], and the law at them."""
        times = np.concatenate([[0.0], self.sampled_times(), [self.duration]])
        return times, self.at(times)

    def times_of(self, s: Floats) -> Floats:
        """Return the times (k,) [s] at which the averaged law passes places s (k,)."""
        low = np.interp(s, self._s, self.times)
        high = low + self.window
        times, known = self.table
        t = np.clip(np.interp(s, known.s, times), low, high)
        for _ in range(_NEWTON_STEPS):
            place, v, _ = self.at(t)
            step = np.where(v > _NO_SPEED, (s - place) / np.maximum(v, _NO_SPEED), 0.0)
            t = np.clip(t + step, low, high)
        found: Floats = t
        return found


def lowered_over(values: Floats, times: Floats, reach: float) -> Floats:
    """
    Return, for each time (m,), the least value from ``reach`` [s] before to ``reach`` after it.

    :param values: (m,) the value at each time.
    :param times: (m,) not decreasing [s].
    """
    reach += _NO_TIME
    low = np.searchsorted(times, times - reach, side='left')
    high = np.searchsorted(times, times + reach, side='right')
    # Two ranges of 2^k values cover each range, so its least value is the lesser one of theirs.
    result = np.empty_like(values)
    level = np.floor(np.log2(high - low)).astype(np.intp)
    table, size = values, 1
    for k in range(int(level.max()) + 1):
        rows = np.flatnonzero(level == k)
        result[rows] = np.minimum(table[low[rows]], table[high[rows] - size])
        table = np.minimum(table[: max(len(table) - size, 0)], table[size:])
        size *= 2
    return result
