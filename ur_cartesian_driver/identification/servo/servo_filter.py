# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The filter through which ``servoj`` leads an arm behind its set-points.

The set-point u runs evenly to the target of each call within its t, and the arm follows by
``acceleration = gain (u - q - lookahead speed)``. The law is linear, so the motion is a sum: for
each change of the set-point's speed, that change times the response to a set-point that moves at
1 rad/s. A recorded controller steps the law, the new speed before the new place, once in 2 ms, by
which gain and lookahead seem a percent different; so steps and the exact law are fitted.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import hypot, inf, log

import numpy as np

from ur_cartesian_driver.identification.least_squares import Fit, fit, Measured, NOWHERE
from ur_cartesian_driver.identification.profile import Misfit
from ur_cartesian_driver.identification.recorded_calls import SetPoints
from ur_cartesian_driver.identification.segmentation import noise_of
from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats

#: Root mean square above which residuals show another law [rad]: five times what a recorded arm
#: leaves. Residuals of so many times the noise show one, too, above that.
_MISFIT, _ROUGH = 3e-7, 1.5
#: Times between two steps of the law [s]: none, and the cycles of the series of robots.
_STEPS = (0.0, 0.002, 0.008)
#: Twice the logarithm of a likelihood ratio from which one of two laws is ruled out.
_CLEAR = 10.0
#: Factors from which the fit begins, and those beyond which it does not go.
_FACTORS, _NO_FACTOR = np.geomspace(0.14, 7.0, 9), 50.0
#: Factor on the gain from which the law is a lag of first order.
_NO_SECOND_POLE = 1e6
#: Rows this close to the end of the calls are not used [s].
_MARGIN = 0.05
#: Changes of the set-point's speed that are none [rad/s].
_NO_CHANGE = 1e-9
#: Poles of a law that are closer to each other are taken for so far apart.
_APART = 1e-6
_PLACE, _ONSET, _GAIN, _LOOKAHEAD = range(4)


@dataclass(frozen=True, slots=True, kw_only=True)
class ServoFilter:
    """
    The filter of one joint in one motion of servoj.

    :param gain_factor: on the gain of the calls; ``lookahead_factor``: on their lookahead time.
    :param step: time between two steps of the law [s]; 0 = it is exact.
    :param rms: root mean square of the residuals [rad].
    """

    gain_factor: Measured
    lookahead_factor: Measured
    step: float
    rms: float

    @property
    def law(self) -> str:
        """The law, for people."""
        return f'a law in steps of {1e3 * self.step:g} ms' if self.step else 'a law without steps'


def find_filter(
    time: Floats, q: Floats, follows: Flags, points: SetPoints, joint: int, begin: float
) -> ServoFilter | Misfit | None:
    """
    Find the filter of a joint that moves by calls of servoj.

    :param time: (n,) the controller's clock [s], from before the motion.
    :param q: (n,) target of the joint [rad]; it rests in the first packets.
    :param follows: mask (n,) of rows that come one cycle after the row before.
    :param joint: its index, 0 to 5.
    :param begin: time of the first call, within some cycles [s].
    :returns: None if there is too little data; a gain without bounds if a lag of first order
        explains as much.
    """
    path = _SetPointPath(points, joint)
    used = time < begin + sum(points.times) - _MARGIN
    t, q, follows = time[used] - begin, q[used], follows[used]
    found: dict[float, Fit] = {}
    for step in _STEPS:
        if step > 1.1 * float(np.median(np.diff(time))):
            continue
        model = _model(t, path, points, step)
        if (fitted := fit(model, q, _start(model, t, q), follows)) is not None:
            found[step] = fitted
    if not found:
        return None
    step = min(found, key=lambda each: found[each].rms)
    best = found[step]
    equal = [each for each in found.values() if _is_as_good(each, best)]
    if best.rms > _MISFIT and best.rms > _ROUGH * noise_of(best.residuals):
        return Misfit(rms=best.rms)
    start = np.delete(best.parameters, _GAIN).tolist()
    lag = fit(_lag_model(t, path, points), q, start, follows)
    if lag is not None and _is_as_good(lag, best):
        return ServoFilter(
            gain_factor=Measured(value=inf, error=inf, freedom=lag.freedom),
            lookahead_factor=lag.measured(_GAIN),  # there is none before it
            step=0.0,
            rms=lag.rms,
        )
    return ServoFilter(
        gain_factor=_doubted(best, equal, _GAIN),
        lookahead_factor=_doubted(best, equal, _LOOKAHEAD),
        step=step,
        rms=best.rms,
    )


def _is_as_good(found: Fit, best: Fit) -> bool:
    """Return whether a fit is about as likely as another one to the same rows."""
    ratio = max(found.rms, 1e-12) / max(best.rms, 1e-12)
    return 2.0 * len(best.residuals) * log(ratio) <= _CLEAR


def _doubted(best: Fit, equal: list[Fit], parameter: int) -> Measured:
    """Return a parameter of the best fit; others that are as good widen its interval."""
    found = best.measured(parameter)
    doubt = max(abs(each.measured(parameter).value - found.value) for each in equal)
    return replace(found, error=hypot(found.error, 0.5 * doubt))


class _SetPointPath:
    """Where the set-point of a joint is, by the time since the first call."""

    def __init__(self, points: SetPoints, joint: int) -> None:
        self._targets: Floats = np.array(points.targets)[:, joint]
        self._times: Floats = np.array(points.times)

    def changes(self, place: float) -> list[tuple[float, float]]:
        """Return times [s] and changes of the speed [rad/s] of a set-point that begins there."""
        steps = np.diff(self._targets, prepend=place)
        found, before = [], 0.0
        corners, speeds = np.cumsum(self._times).tolist(), (steps / self._times).tolist()
        for at, speed in zip([0.0, *corners], [*speeds, 0.0], strict=True):
            if abs(speed - before) > _NO_CHANGE:
                found.append((at, speed - before))
                before = speed
        return found


def _model(
    t: Floats, path: _SetPointPath, points: SetPoints, step: float
) -> Callable[[Floats], Floats]:
    def model(parameters: Floats) -> Floats:
        place, onset, gain, lookahead = parameters.tolist()
        is_lag = gain == _NO_SECOND_POLE
        if not all(1.0 / _NO_FACTOR < each < _NO_FACTOR for each in (is_lag or gain, lookahead)):
            return np.full(len(t), NOWHERE)
        law = _Response.of(points.gain * gain, points.lookahead_time * lookahead, step)
        if law is None:
            return np.full(len(t), NOWHERE)
        q = np.full(len(t), place)
        for at, change in path.changes(place):
            since = t - onset - at
            later = since > 0.0
            q[later] += change * law.travel(since[later])
        return q

    return model


def _lag_model(t: Floats, path: _SetPointPath, points: SetPoints) -> Callable[[Floats], Floats]:
    """Return the model of a lag of first order, to which the law comes with a large gain."""
    model = _model(t, path, points, 0.0)
    return lambda parameters: model(np.insert(parameters, _GAIN, _NO_SECOND_POLE))


def _start(model: Callable[[Floats], Floats], t: Floats, q: Floats) -> list[float]:
    """Return parameters to begin with: the best factors of a grid, each with its best onset."""
    tried = []
    for gain in _FACTORS.tolist():
        for lookahead in _FACTORS.tolist():
            start = [float(q[0]), 0.0, gain, lookahead]
            modelled = model(np.array(start))
            speed, left = np.gradient(modelled, t), q - modelled
            start[_ONSET] = -float(speed @ left) / max(float(speed @ speed), 1e-12)
            tried.append((float(np.abs(left + start[_ONSET] * speed).sum()), start))
    return min(tried)[1]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Response:
    """
    The motion behind a set-point that moves at 1 rad/s from time 0 on.

    :param step: time between two steps of the law [s]; 0 = it is exact.
    :param poles: of the law, two different ones [1/s].
    """

    lookahead: float
    step: float
    poles: tuple[complex, complex]

    @classmethod
    def of(cls, gain: float, lookahead: float, step: float) -> _Response | None:
        """Return the response of a law; None if its steps make it unstable."""
        damping = gain * lookahead
        if step == 0.0:
            poles = np.roots([1.0, damping, gain]).astype(complex)
        else:
            product = 1.0 - step * damping
            factors = np.roots([1.0, step * step * gain - product - 1.0, product]).astype(complex)
            if not ((np.abs(factors) < 1.0) & (np.abs(factors) > 1e-6)).all():
                return None
            poles = np.log(factors) / step
        first, second = poles.tolist()
        if abs(first - second) < _APART * abs(first):
            first, second = first * (1.0 + _APART), second * (1.0 - _APART)
        return cls(lookahead=lookahead, step=step, poles=(first, second))

    def travel(self, t: Floats) -> Floats:
        """Return how far the arm has come (n,) [rad] at times (n,) above 0 [s]."""
        first, second = self.poles
        if self.step == 0.0:
            lag, since = self.lookahead, t
            # At time 0 the arm is at 0, at rest.
            share = (-1.0 - second * lag) / (first - second)
            other = lag - share
        else:
            lag = self.lookahead - self.step
            count = np.floor(t / self.step)
            # The first step in which the set-point moves sees it so late; before, the arm rested.
            late = t - count * self.step
            since = (count + 1.0) * self.step
            now, before = self.lookahead - late, self.lookahead - late + self.step
            back, other_back = np.exp(-first * self.step), np.exp(-second * self.step)
            share = (before - now * other_back) / (back - other_back)
            other = now - share
        fading = share * np.exp(first * since) + other * np.exp(second * since)
        travel: Floats = t - lag + fading.real
        return travel
