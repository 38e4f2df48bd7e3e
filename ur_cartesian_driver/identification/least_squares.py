# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Nonlinear least squares with intervals that allow for correlated residuals.

Packets of a robot come every few milliseconds, and what disturbs one disturbs the next. Intervals
that count each packet as a measurement of its own would be far too narrow. So the residuals of a
first fit are described as an autoregressive process of second order, both sides are filtered until
white, and fitted again: generalised least squares (Cochrane and Orcutt, 1949).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats

#: Assumed noise floor of recorded targets [rad or m]: a fifth of the smallest residual seen.
TARGET_FLOOR = 1e-8
#: What a model returns for parameters that it cannot have; finite, so that it can be filtered.
NOWHERE = 1e6
_ORDER = 2
#: Largest share of the noise that a fit is taken to have removed.
_MAX_TAKEN = 0.1
_ITERATIONS, _MIN_GAIN, _MAX_DAMPING = 60, 1e-4, 1e12
#: Quantiles of Student's t for 95 % with 1, 2, 3 degrees of freedom; of the normal distribution.
_FEW, _NORMAL = (12.7062, 4.3027, 3.1824), 1.959964


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """
    A number with its standard error.

    :param freedom: degrees of freedom behind the standard error.
    """

    value: float
    error: float
    freedom: float

    @property
    def half_width(self) -> float:
        """Half of the interval that contains the true value in 95 of 100 cases."""
        return student(self.freedom) * self.error


@dataclass(frozen=True, slots=True, kw_only=True)
class Fit:
    """
    A fitted model.

    :param parameters: (k,) of the model.
    :param covariance: (k, k) of the parameters.
    :param residuals: (n,) measured less modelled, not filtered.
    """

    parameters: Floats
    covariance: Floats
    residuals: Floats
    freedom: float

    def measured(self, parameter: int) -> Measured:
        """Return a parameter with its standard error."""
        return self.combination({parameter: 1.0})

    def combination(self, weights: dict[int, float]) -> Measured:
        """Return a linear combination of parameters with its standard error."""
        return Measured(
            value=float(self._row(weights) @ self.parameters),
            error=sqrt(max(self.common(weights, weights), 0.0)),
            freedom=self.freedom,
        )

    def common(self, one: dict[int, float], other: dict[int, float]) -> float:
        """Return the covariance of two linear combinations of parameters."""
        return float(self._row(one) @ self.covariance @ self._row(other))

    def _row(self, weights: dict[int, float]) -> Floats:
        row = np.zeros(len(self.parameters))
        row[list(weights)] = list(weights.values())
        return row

    @property
    def rms(self) -> float:
        """Root mean square of the residuals."""
        return float(np.sqrt(np.mean(self.residuals**2)))


def fit(
    model: Callable[[Floats], Floats],
    measured: Floats,
    start: Sequence[float],
    follows: Flags,
    *,
    derivatives: Callable[[Floats], Floats] | None = None,
    floor: float = TARGET_FLOOR,
) -> Fit | None:
    """
    Fit a model to measured values.

    :param model: returns the values (n,) for parameters (k,).
    :param derivatives: returns those of the model (n, k); None = by finite differences.
    :param start: parameters to begin with (k,).
    :param follows: mask (n,) of values that come one cycle after the one before.
    :param floor: least standard deviation that the values may be given.
    :returns: None if the values do not determine the parameters.
    """
    if len(measured) < 2 * len(start) + 4 * _ORDER:
        return None
    problem = _Problem(model, measured, follows, derivatives or _differences(model))
    phi = np.zeros(_ORDER)
    found = np.array(start, dtype=np.float64)
    for _ in range(3):
        solved = problem.solve(found, phi)
        if solved is None:
            return None
        found, white, jacobian = solved
        residuals = measured - model(found)
        freedom = len(white) - len(found) - _ORDER
        variance = max(float(white @ white) / freedom, floor**2)
        try:
            inverse = np.linalg.inv(jacobian.T @ jacobian)
        except np.linalg.LinAlgError:
            return None
        covariance: Floats = np.asarray(variance * inverse, dtype=np.float64)
        if not (np.isfinite(covariance).all() and (np.diag(covariance) > 0.0).all()):
            return None
        if variance <= floor**2:
            break  # What is left is rounding, with no process to describe.
        phi = _autoregression(residuals, follows, len(found))
    return Fit(parameters=found, covariance=covariance, residuals=residuals, freedom=freedom)


@dataclass(frozen=True, slots=True)
class _Problem:
    model: Callable[[Floats], Floats]
    measured: Floats
    follows: Flags
    derivatives: Callable[[Floats], Floats]

    def solve(self, start: Floats, phi: Floats) -> tuple[Floats, Floats, Floats] | None:
        """Return parameters, filtered residuals and their derivatives (Levenberg, Marquardt)."""
        found, damping = start, 1e-3
        white = self._white(found, phi)
        cost, jacobian = float(white @ white), self._jacobian(found, phi)
        for _ in range(_ITERATIONS):
            normal, gradient = jacobian.T @ jacobian, jacobian.T @ white
            scale = np.diag(normal)
            if not np.isfinite(normal).all() or (scale <= 0.0).any():
                return None
            try:
                step = np.linalg.solve(normal + damping * np.diag(scale), gradient)
            except np.linalg.LinAlgError:
                return None
            tried = self._white(found + step, phi)
            new_cost = float(tried @ tried)
            if not new_cost < cost:
                damping *= 8.0
                if damping > _MAX_DAMPING:
                    break
                continue
            is_small = cost - new_cost <= _MIN_GAIN * cost / len(tried)
            found, white, cost, damping = found + step, tried, new_cost, 0.2 * damping
            jacobian = self._jacobian(found, phi)
            if is_small:
                break
        return found, white, jacobian

    def _white(self, parameters: Floats, phi: Floats) -> Floats:
        return _whitened(self.measured - self.model(parameters), self.follows, phi)

    def _jacobian(self, parameters: Floats, phi: Floats) -> Floats:
        return _whitened(self.derivatives(parameters), self.follows, phi)


def _differences(model: Callable[[Floats], Floats]) -> Callable[[Floats], Floats]:
    """Return the derivatives of a model by central differences."""

    def derivatives(parameters: Floats) -> Floats:
        columns = []
        for i, value in enumerate(parameters):
            step = np.zeros(len(parameters))
            step[i] = 1e-6 * max(abs(value), 1e-3)
            change = model(parameters + step) - model(parameters - step)
            columns.append(change / (2.0 * step[i]))
        return np.stack(columns, axis=1)

    return derivatives


def _whitened(values: Floats, follows: Flags, phi: Floats) -> Floats:
    """Filter by 1 - phi_1 B - phi_2 B^2, where two values precede without a gap."""
    if not phi.any():
        return values
    whole = follows[1:-1] & follows[2:]
    filtered: Floats = (values[2:] - phi[0] * values[1:-1] - phi[1] * values[:-2])[whole]
    return filtered


def _autoregression(residuals: Floats, follows: Flags, fitted: int) -> Floats:
    """
    Return the coefficients (2,) of Yule and Walker; zeros if too few values are in a row.

    A fit takes its own smooth share out of the noise: with each parameter, as much of every
    autocovariance as the noise has at frequency 0, by the number of values. That is given back.

    :param fitted: number of parameters.
    """
    whole = follows[1:-1] & follows[2:]
    if whole.sum() < 20:
        return np.zeros(_ORDER)
    now, before, first = (part[whole] for part in (residuals[2:], residuals[1:-1], residuals[:-2]))
    powers = np.array(
        [
            float(now @ now + before @ before + first @ first) / 3.0,
            0.5 * float(now @ before + before @ first),
            float(now @ first),
        ]
    )
    phi = _yule_walker(powers)
    at_rest = float(powers[0] - phi @ powers[1:]) / (1.0 - float(phi.sum())) ** 2
    taken = min(fitted * at_rest / len(now), _MAX_TAKEN * float(powers[0]))
    return _yule_walker(powers + taken)


def _yule_walker(powers: Floats) -> Floats:
    """Return the coefficients (2,) of a process with autocovariances (3,)."""
    r1, r2 = (powers[1:] / powers[0]).tolist()
    r1 = min(max(r1, -0.98), 0.98)
    second = min(max((r2 - r1 * r1) / (1.0 - r1 * r1), -0.98), 0.98)
    return np.array([r1 * (1.0 - second), second])


def student(freedom: float) -> float:
    """Return the 97.5 % quantile of Student's t (Abramowitz and Stegun, 26.7.5)."""
    if freedom < 4.0:
        return _FEW[max(int(freedom), 1) - 1]
    z = _NORMAL
    terms = (
        (z**3 + z) / 4.0,
        (5.0 * z**5 + 16.0 * z**3 + 3.0 * z) / 96.0,
        (3.0 * z**7 + 19.0 * z**5 + 17.0 * z**3 - 15.0 * z) / 384.0,
    )
    return z + sum(term / freedom**i for i, term in enumerate(terms, 1))


def correlated_mean(parts: Sequence[Measured], common: Floats) -> Measured:
    """
    Return the best mean of measurements of one number whose errors are correlated.

    :param common: (n - 1,) covariance of each measurement with the next one.
    """
    covariance = np.diag([part.error**2 for part in parts])
    covariance = covariance + np.diag(common, 1) + np.diag(common, -1)
    weights = np.linalg.solve(covariance, np.ones(len(parts)))
    values = np.array([part.value for part in parts])
    return Measured(
        value=float(weights @ values / weights.sum()),
        error=float(weights.sum() ** -0.5),
        freedom=sum(part.freedom for part in parts),
    )


def combined(parts: Sequence[Measured]) -> Measured:
    """
    Return the weighted mean of measurements of one number.

    Where they scatter more than their errors explain, the error grows by that factor (Birge ratio,
    as in the tables of the Particle Data Group), and its degrees of freedom are those of the
    scatter.
    """
    values, errors = (
        np.array(column) for column in zip(*((p.value, p.error) for p in parts), strict=True)
    )
    weights = 1.0 / errors**2
    mean, error = float(weights @ values / weights.sum()), float(weights.sum() ** -0.5)
    freedom = sum(part.freedom for part in parts)
    others = len(parts) - 1
    ratio = sqrt(float(weights @ (values - mean) ** 2) / others) if others else 0.0
    if ratio > 1.0:
        error *= ratio
        # Scatter of this size is chance in a tenth of the cases; beyond, it is a fact.
        if ratio > 1.0 + 1.3 / sqrt(others):
            freedom = float(others)
    return Measured(value=mean, error=error, freedom=freedom)
