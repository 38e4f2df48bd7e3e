# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The profile of a single move: a trapezoid of speed, with or without the ramp of a program's start.

Travel over time, from rest to rest: ``s(t) = w(p(t - t0))`` with the trapezoid ``w`` of
acceleration a, speed v and length L, and the path time ``p`` of a start within T: ``t^2 / 2T`` up
to T, then ``t - T/2``. Recorded controllers change the rate of the path once a cycle c instead, by
c/T: ``t (t + c) / 2T``, then ``t - (T - c)/2``. Both are fitted.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import exp, hypot, log, sqrt

import numpy as np

from ur_cartesian_driver.identification.least_squares import Fit, fit, Measured, NOWHERE
from ur_cartesian_driver.identification.segmentation import noise_of
from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats

#: Root mean square above which the residuals show another law [rad, m]; at most 0.5 urad and
#: 0.5 um are left of recorded moves, for which the law holds.
MISFIT = 2e-6
#: Residuals that are as many times larger than the noise show another law, too, above MISFIT.
_ROUGH = 3.0
#: Shorter start ramps count as none [s].
SHORTEST_START = 0.01
#: Starts from which the fit begins [s].
_STARTS = (0.06, 0.15, 0.35)
#: Twice the logarithm of a likelihood ratio from which one of two laws is ruled out.
_CLEAR = 10.0
#: From this share of its triangular peak speed on, a move counts as a triangle.
_TRIANGLE = 0.98
#: Bound on the logarithms of speed and acceleration.
_NO_BOUND = 20.0
_OFFSET, _LENGTH, _ONSET, _ACCELERATION, _SPEED = range(5)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Profile:
    """
    A trapezoid that was found.

    :param speed: None where the move never cruises.
    :param start: time within which it sets out [s]; None where it does so at once.
    :param step: time from change to change of the rate in the start [s]; 0 = it changes evenly.
    :param begin: time at which it sets out, by the controller's clock [s].
    :param end: time at which it arrives [s].
    :param begin_and_end: covariance of both [s^2].
    :param speed_squared_by_acceleration: v^2/a, which stays the same in a stretched move.
    """

    length: float
    acceleration: Measured
    speed: Measured | None
    start: Measured | None
    step: float
    begin: Measured
    end: Measured
    begin_and_end: float
    speed_squared_by_acceleration: Measured | None
    fit: Fit


@dataclass(frozen=True, slots=True, kw_only=True)
class Misfit:
    """A move that no known profile fits; rms of its residuals [rad or m]."""

    rms: float


def path_time(t: Floats, start: float, step: float) -> Floats:
    """
    Return the time of a path (n,) at times since its beginning [s].

    :param start: time within which its rate rises to 1 [s].
    :param step: time after which the rate changes by one step [s]; 0 = evenly.
    """
    t = np.maximum(t, 0.0)
    if start <= 0.0:
        return t
    after = t - 0.5 * (start - step)
    slow: Floats = np.where(t < start, 0.5 * t * (t + step) / start, after)
    return slow


def trapezoid_travel(t: Floats, length: float, acceleration: float, speed: float) -> Floats:
    """Return the travel (n,) of a trapezoid at times (n,) since its beginning [s]."""
    a, v = acceleration, min(speed, sqrt(length * acceleration))
    whole = length / v + v / a
    up, left = np.clip(t, 0.0, whole), np.clip(whole - t, 0.0, whole)
    travel: Floats = np.where(
        up < v / a,
        0.5 * a * up * up,
        np.where(left < v / a, length - 0.5 * a * left * left, v * (up - 0.5 * v / a)),
    )
    return travel


def find_profile(
    time: Floats, travel: Floats, follows: Flags, *, may_start: bool
) -> Profile | Misfit | None:
    """
    Find the trapezoid of a move.

    :param time: (n,) the controller's clock [s].
    :param travel: (n,) travel along the path [rad or m].
    :param follows: mask (n,) of rows that come one cycle after the row before.
    :param may_start: whether the ramp of a program's start is looked for, too.
    :returns: None if there is too little data, a misfit if the law is another one.
    """
    origin, t = time[0], time - time[0]
    guess = _Guess.of(t, travel)
    best = None if guess is None else _Found.without_start(t, travel, follows, guess)
    if best is None:
        return None
    if may_start:
        best = _with_start(best, t, travel, follows)
    rms, noise = best.fit.rms, noise_of(best.fit.residuals)
    if rms > MISFIT and rms > _ROUGH * noise:
        return Misfit(rms=rms)
    return best.profile(origin)


def _with_start(best: _Found, t: Floats, travel: Floats, rows: Flags) -> _Found:
    """Return the best fit with a start, if there is one."""
    starts = [best.with_start(t, travel, rows, start, 0.0) for start in _STARTS]
    found = [each for each in starts if each is not None]
    even = min(found, key=lambda each: each.fit.rms, default=best)
    if not even.has_start or even.start.value - even.start.half_width < SHORTEST_START:
        return best
    cycle = float(np.median(np.diff(t)))
    stepwise = best.with_start(t, travel, rows, even.start.value, cycle)
    if stepwise is None:
        return even
    gain = 2.0 * len(t) * log(max(even.fit.rms, 1e-12) / max(stepwise.fit.rms, 1e-12))
    if abs(gain) > _CLEAR:
        return stepwise if gain > 0.0 else even
    return replace(even, doubt=abs(stepwise.start.value - even.start.value))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Guess:
    """A first guess of a trapezoid."""

    offset: float
    length: float
    begin: float
    duration: float
    speed: float

    @classmethod
    def of(cls, t: Floats, travel: Floats) -> _Guess | None:
        low, high = float(travel[:3].mean()), float(travel[-3:].mean())
        length = high - low
        if length <= 0.0 or len(t) < 24:
            return None
        inside = np.flatnonzero((travel > low + 1e-3 * length) & (travel < high - 1e-3 * length))
        if len(inside) < 12:
            return None
        width = max(3, len(inside) // 40)
        speeds = (travel[width:] - travel[:-width]) / (t[width:] - t[:-width])
        return cls(
            offset=low,
            length=length,
            begin=float(t[inside[0]]),
            duration=float(t[inside[-1]] - t[inside[0]]),
            speed=float(speeds.max()),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Found:
    """
    A fit of a trapezoid.

    Parameters are offset, length, onset, logarithm of the acceleration, that of the speed if it
    cruises, and the time of the start if it has one.

    :param step: time from change to change of the rate in the start [s]; 0 = even.
    :param doubt: change of the start [s] by another step that fits as well.
    """

    fit: Fit
    cruises: bool
    has_start: bool
    step: float = 0.0
    doubt: float = 0.0

    @classmethod
    def without_start(cls, t: Floats, travel: Floats, rows: Flags, guess: _Guess) -> _Found | None:
        """Fit a trapezoid or, if it would hardly cruise, a triangle."""
        duration = max(guess.duration, 1.02 * guess.length / guess.speed)
        ramp = min(max(duration - guess.length / guess.speed, 0.02 * duration), 0.5 * duration)
        first = [guess.offset, guess.length, guess.begin, log(guess.speed / ramp)]
        for cruises in (True, False):
            start = [*first, *([log(guess.speed)] if cruises else [])]
            found = fit(_model(t, cruises, False), travel, start, rows)
            if found is None:
                continue
            length, a = found.parameters[_LENGTH], exp(found.parameters[_ACCELERATION])
            if cruises and exp(found.parameters[_SPEED]) > _TRIANGLE * sqrt(length * a):
                continue
            return cls(fit=found, cruises=cruises, has_start=False)
        return None

    def with_start(
        self, t: Floats, travel: Floats, rows: Flags, start: float, step: float
    ) -> _Found | None:
        """Fit again with the ramp of a start, from a first guess of it [s]."""
        first = [*self.fit.parameters, start]
        first[_ONSET] -= 0.5 * start
        found = fit(_model(t, self.cruises, True, step), travel, first, rows)
        if found is None:
            return None
        return _Found(fit=found, cruises=self.cruises, has_start=True, step=step)

    @property
    def start(self) -> Measured:
        found = self.fit.measured(len(self.fit.parameters) - 1)
        return replace(found, error=hypot(found.error, 0.5 * self.doubt))

    def profile(self, origin: float) -> Profile:
        parameters = self.fit.parameters
        length, ln_a = float(parameters[_LENGTH]), float(parameters[_ACCELERATION])
        a = exp(ln_a)
        v = exp(float(parameters[_SPEED])) if self.cruises else sqrt(length * a)
        last = len(parameters) - 1
        # The derivatives of the end: L/v + v/a, or 2 sqrt(L/a), and half of the start.
        weights = {_ONSET: 1.0, _LENGTH: 1.0 / v, _ACCELERATION: -v / a}
        if self.cruises:
            weights[_SPEED] = v / a - length / v
        weights |= {last: 0.5} if self.has_start else {}
        begin = self.fit.measured(_ONSET)
        lost = 0.5 * (self.start.value - self.step) if self.has_start else 0.0
        whole = length / v + v / a + lost
        error = self.fit.combination(weights).error
        acceleration, freedom = self.fit.measured(_ACCELERATION), self.fit.freedom
        squared = speed = None
        if self.cruises:
            speed = _scaled(self.fit.measured(_SPEED), v)
            squared = _scaled(self.fit.combination({_SPEED: 2.0, _ACCELERATION: -1.0}), v * v / a)
        return Profile(
            length=length,
            acceleration=_scaled(acceleration, a),
            speed=speed,
            start=self.start if self.has_start else None,
            step=self.step,
            begin=_moved(begin, origin),
            end=Measured(value=origin + begin.value + whole, error=error, freedom=freedom),
            begin_and_end=self.fit.common({_ONSET: 1.0}, weights),
            speed_squared_by_acceleration=squared,
            fit=self.fit,
        )


def _scaled(logarithm: Measured, value: float) -> Measured:
    return Measured(value=value, error=value * logarithm.error, freedom=logarithm.freedom)


def _moved(measured: Measured, by: float) -> Measured:
    return Measured(value=measured.value + by, error=measured.error, freedom=measured.freedom)


def _model(
    t: Floats, cruises: bool, has_start: bool, step: float = 0.0
) -> Callable[[Floats], Floats]:
    def model(parameters: Floats) -> Floats:
        offset, length, onset, ln_a = parameters[:4]
        ln_v = parameters[_SPEED] if cruises else _NO_BOUND
        start = parameters[-1] if has_start else 0.0
        if length <= 0.0 or start < 0.0 or max(abs(ln_a), abs(ln_v)) > _NO_BOUND:
            return np.full(len(t), NOWHERE)
        path = path_time(t - onset, start, step)
        travel: Floats = offset + trapezoid_travel(path, length, exp(ln_a), exp(ln_v))
        return travel

    return model
