# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The law of one blend: its curve, where it begins and ends, and its speed half-way through.

The curve is ``C - p (1 - u)^2 d + q u^2 e`` with the corner C, the directions d and e, and the
lengths p and q that it takes of both lines: a parabola. The rate of u changes evenly over time
from u = 0 to 1/2, and from there to 1. The curve is fitted first, whatever the times are; then
both together, with the lines beside, so that their errors count.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import cos, degrees, hypot, sin, sqrt

import numpy as np

from ur_cartesian_driver.identification.blends.blend_corners import BlendCorner
from ur_cartesian_driver.identification.least_squares import (
    correlated_mean,
    Fit,
    fit,
    Measured,
    NOWHERE,
)
from ur_cartesian_driver.identification.profile import MISFIT
from ur_cartesian_driver.identification.segmentation import noise_of
from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats

#: A curve that is so many times as far off the parabola as the lines are uneven is another one;
#: least unevenness [m or rad].
_ROUGH, _EVEN = 3.0, 1e-7
#: How far an arc is off the nearest parabola, root mean square, by the length that it takes of a
#: line and by the cube of a small corner.
_ARC = 2e-3
#: Errors, and share of the radius, by which a blend may end elsewhere than as far as it begins.
_ERRORS, _SHARE = 5.0, 1e-3
#: Degree of the tool's place along a joint line. It is fitted in a range from the corner, in
#: lengths that the blend takes: from clear of the blend, to a reach behind, or to less.
_DEGREE, _CLEAR, _REACH, _LESS = 5, 1.03, 8.0, 2.0
#: Offset and slope of both lines; lengths taken of them; begin of the blend, and rates of u.
_OFFSET_1, _SLOPE_1, _OFFSET_2, _SLOPE_2, _TAIL, _HEAD, _BEGIN, _ENTRY, _MIDDLE, _EXIT = range(10)


class OtherLaw(str):
    """The reason why a blend contradicts a law, and does not only leave it open."""

    __slots__ = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class FoundBlend:
    """
    What one blend shows.

    :param off: how far its rows are off the parabola, root mean square [m or rad].
    :param is_parabola: whether that is no more than the lines are uneven; else nothing is fitted.
    :param begin: share of the radius at which it begins and ends; or why there is none.
    :param speed_ratio: rate half-way by that of an even change; or why there is none.
    """

    angle: float
    of_lines: bool
    off: float
    is_parabola: bool
    begin: Measured | str
    speed_ratio: Measured | str


def find_blend(corner: BlendCorner) -> FoundBlend | str:
    """Return the law of a blend, or why it cannot be evaluated."""
    blend = _Blend(corner)
    start, off = blend.parabola()
    bound = _ROUGH * max(corner.unevenness, _EVEN)
    found = FoundBlend(
        angle=corner.angle,
        of_lines=corner.of_lines,
        off=off,
        is_parabola=off < bound,
        begin='it follows no parabola',
        speed_ratio='it follows no parabola',
    )
    if not found.is_parabola:
        return found
    if _ARC * min(start[_TAIL:]) * corner.angle**3 < bound:
        return (
            f'a blend of {1e3 * corner.radius:.3g} mm at a corner of {degrees(corner.angle):.2g} '
            'degrees does not tell a parabola from an arc'
        )
    curve = blend.curve(start)
    if curve is None:
        return 'its packets do not determine its curve'
    whole = blend.over_time(curve)
    lines = len(corner.plane[corner.before]) + len(corner.plane[corner.after])
    ratio: Measured | str = 'its packets do not determine its speed'
    if whole is not None:
        odd = whole.residuals[lines:]
        rms = float(np.sqrt(np.mean(odd**2)))
        if rms > MISFIT and rms > _ROUGH * noise_of(odd):
            ratio = OtherLaw('its rate follows no law that is known')
            whole = None
        else:
            ratio = _speed_ratio(whole)
    return replace(found, begin=blend.begin(whole or curve), speed_ratio=ratio)


def _speed_ratio(whole: Fit) -> Measured:
    entry, middle, leave = (float(x) for x in whole.parameters[_ENTRY:])
    square = entry**2 + leave**2
    ratio = middle / sqrt(0.5 * square)
    # The derivatives of its logarithm.
    relative = whole.combination(
        {_ENTRY: -entry / square, _MIDDLE: 1.0 / middle, _EXIT: -leave / square}
    )
    return replace(relative, value=ratio, error=ratio * relative.error)


class _Blend:
    """The fits of one blend."""

    def __init__(self, corner: BlendCorner) -> None:
        self._corner = corner
        c, s = cos(corner.angle), sin(corner.angle)
        #: From the frame of the first line to that of the second one: x along it.
        self._turn = np.array([[c, s], [-s, c]])
        self._one = corner.plane[corner.before]
        self._two = corner.plane[corner.after] @ self._turn.T
        self._inside = corner.plane[corner.blend]
        self._t = corner.time[corner.blend] - corner.time[corner.blend.start]

    def parabola(self) -> tuple[list[float], float]:
        """Return the parameters of the nearest parabola, and how far the rows are off it."""
        along = self._inside @ _inverse(np.zeros(4), self._turn)[0].T
        # On a parabola the roots of both, by those of the lengths, are 1 together.
        roots = np.sqrt(np.maximum(along * [-1.0, 1.0], 0.0))
        scales = np.linalg.lstsq(roots, np.ones(len(roots)), rcond=None)[0]
        rough = np.maximum(np.abs(scales), 1e-3) ** -2.0
        lines, nowhere = np.zeros(4), np.zeros(len(roots))
        follows = _alone(self._corner.follows[self._corner.blend])

        def model(lengths: Floats) -> Floats:
            if lengths.min() <= 0.0:
                return np.full(len(roots), NOWHERE)
            return -self._distances(np.concatenate([lines, lengths]))

        found = fit(model, nowhere, rough.tolist(), follows)
        beside = self._corner.beside[self._corner.blend]
        offs = [
            (float(np.sqrt(np.mean(model(lengths) ** 2 + beside**2))), lengths.tolist())
            for lengths in (rough, *(() if found is None else (found.parameters,)))
        ]
        off, nearest = min(offs)
        return [*lines.tolist(), *nearest], off

    def curve(self, start: list[float]) -> Fit | None:
        """Fit both lines and the parabola, whatever the times are."""
        return self._fit(
            lambda parameters: -self._distances(parameters), np.zeros(len(self._inside)), start
        )

    def over_time(self, curve: Fit) -> Fit | None:
        """Fit lines, parabola and rate together."""
        u = self._progress(curve.parameters)
        t, third = self._t, max(len(u) // 3, 4)
        slopes = [
            float(np.polyfit(t[rows], u[rows], 1)[0])
            for rows in (slice(third), slice(third, -third), slice(-third, None))
        ]
        if min(slopes) <= 0.0:
            return None
        start = [float(t[0] - u[0] / slopes[0]), *slopes]
        follows = _alone(self._corner.follows[self._corner.blend])
        rate = fit(self._parameter, u, start, follows)
        if rate is None:
            return None
        start = [*curve.parameters, *rate.parameters]
        return self._fit(self._places, self._inside.T.ravel(), start)

    def _fit(
        self, model: Callable[[Floats], Floats], measured: Floats, start: list[float]
    ) -> Fit | None:
        """Fit a model of the rows of the blend together with the lines."""
        one, two = self._one, self._two

        def whole(parameters: Floats) -> Floats:
            if min(parameters[_TAIL:_BEGIN]) <= 0.0 or min(parameters[_ENTRY:], default=1.0) <= 0:
                return np.full(len(one) + len(two) + len(measured), NOWHERE)
            lines = (
                parameters[_OFFSET_1] + parameters[_SLOPE_1] * one[:, 0],
                parameters[_OFFSET_2] + parameters[_SLOPE_2] * two[:, 0],
            )
            return np.concatenate([*lines, model(parameters)])

        corner = self._corner
        follows = [_alone(corner.follows[rows]) for rows in (corner.before, corner.after)]
        inside = _alone(corner.follows[corner.blend])
        follows += [inside] * (len(measured) // len(inside))
        values = np.concatenate([one[:, 1], two[:, 1], measured])
        return fit(whole, values, start, np.concatenate(follows))

    def _taken(self, parameters: Floats) -> tuple[Floats, Floats, Floats]:
        """Return -(1 - u)^2 and u^2 (n,), as far as rows show them, and the skew frame (2, 2)."""
        frame, origin = _inverse(parameters, self._turn)
        along = (self._inside - origin) @ frame.T
        return along[:, 0] / parameters[_TAIL], along[:, 1] / parameters[_HEAD], frame

    def _progress(self, parameters: Floats) -> Floats:
        """Return the parameter u (n,) of the rows of the blend."""
        a, b, _ = self._taken(parameters)
        u: Floats = 0.5 * (1.0 + a + b)
        return u

    def _distances(self, parameters: Floats) -> Floats:
        """Return signed distances (n,) of the rows from the parabola, to first order."""
        a, b, frame = self._taken(parameters)
        # On the parabola a + b = 2u - 1 and b - a = (1 + (2u - 1)^2) / 2.
        value = b - a - 0.5 * (1.0 + (a + b) ** 2)
        slopes = np.stack([-1.0 - a - b, 1.0 - a - b], axis=1) / parameters[[_TAIL, _HEAD]]
        distances: Floats = value / np.linalg.norm(slopes @ frame, axis=1)
        return distances

    def _parameter(self, law: Floats) -> Floats:
        """Return u (n,) of the rows of the blend by its begin, and its rates at 0, 1/2 and 1."""
        begin, entry, middle, leave = law
        if min(entry, middle, leave) <= 0.0:
            return np.full(len(self._t), NOWHERE)
        first, second = 1.0 / (entry + middle), 1.0 / (middle + leave)
        t = self._t - begin
        late = np.maximum(t - first, 0.0)
        t = np.minimum(t, first)
        u: Floats = 0.5 * (middle - entry) / first * t * t + entry * t
        u += middle * late + 0.5 * (leave - middle) / second * late * late
        return u

    def _places(self, parameters: Floats) -> Floats:
        """Return x, then y (2n,) of the rows of the blend by the whole law."""
        u = self._parameter(parameters[_BEGIN:])
        frame, origin = _inverse(parameters, self._turn)
        taken = [-parameters[_TAIL] * (1.0 - u) ** 2, parameters[_HEAD] * u * u]
        places: Floats = origin + np.stack(taken, axis=1) @ np.linalg.inv(frame).T
        return places.T.ravel()

    def begin(self, found: Fit) -> Measured | str:
        """Return the share of the radius at which the blend begins and ends."""
        corner = self._corner
        reaches = [self._reach(found, _TAIL), self._reach(found, _HEAD)]
        if any(reach is None for reach in reaches):
            return 'the place of its corner does not follow from the tool beside it'
        parts = [reach for reach in reaches if reach is not None]
        scale = [
            part.value / float(found.parameters[i])
            for part, i in zip(parts, (_TAIL, _HEAD), strict=True)
        ]
        common = scale[0] * scale[1] * found.common({_TAIL: 1.0}, {_HEAD: 1.0})
        apart = abs(parts[0].value - parts[1].value)
        error = sqrt(max(parts[0].error ** 2 + parts[1].error ** 2 - 2.0 * common, 0.0))
        if apart > _ERRORS * error + _SHARE * corner.radius:
            return OtherLaw(
                f'it begins {1e3 * parts[0].value:.3g} mm before its corner, and ends '
                f'{1e3 * parts[1].value:.3g} mm behind it'
            )
        mean = correlated_mean(parts, np.array([common]))
        return Measured(
            value=mean.value / corner.radius,
            error=mean.error / corner.radius,
            freedom=found.freedom,
        )

    def _reach(self, found: Fit, which: int) -> Measured | None:
        """
        Return the distance of the tool from the corner where the blend begins or ends [m].

        The tool never is in the corner of joint moves; its place there follows from its places on
        the line, which are a smooth function of the joints.
        """
        length = found.measured(which)
        corner = self._corner
        if corner.of_lines:
            return length
        if which == _TAIL:
            rows, frame = slice(corner.before.start, corner.blend.start), -np.eye(2)
        else:
            rows, frame = slice(corner.blend.stop, corner.after.stop), self._turn
        x = (corner.plane[rows] @ frame.T)[:, 0] / length.value
        near = (x > _CLEAR) & (x < _REACH)
        if near.sum() < 4 * _DEGREE or x[near].max() < _LESS:
            return None
        tool, follows = corner.tool[rows][near], _alone(corner.follows[rows][near])
        whole = _distance(x[near], tool, follows, _DEGREE)
        coarse = _distance(x[near], tool, follows, _DEGREE - 1)
        if whole is None or coarse is None:
            return None
        own = hypot(whole.error, 0.5 * (whole.value - coarse.value))
        error = hypot(own, whole.value / length.value * length.error)
        return Measured(value=whole.value, error=error, freedom=whole.freedom)


def _distance(x: Floats, tool: Floats, follows: Flags, degree: int) -> Measured | None:
    """
    Return the distance of the tool between 0 and 1 [m], from its places (n, 3) at x (n,) > 1.

    They are fitted by polynomials in the direction from one to the other.
    """
    low, high = float(x.min()), float(x.max())

    def basis(at: Floats) -> Floats:
        mapped = (2.0 * at - low - high) / (high - low)
        return np.asarray(np.polynomial.chebyshev.chebvander(mapped, degree), np.float64)

    rows, ends = basis(x), basis(np.array([0.0, 1.0]))
    between = ends[1] - ends[0]
    coefficients = np.linalg.lstsq(rows, tool, rcond=None)[0]
    direction = between @ coefficients
    direction = direction / np.linalg.norm(direction)
    found = fit(
        lambda parameters: rows @ parameters,
        tool @ direction,
        (coefficients @ direction).tolist(),
        follows,
        derivatives=lambda _: rows,
    )
    return None if found is None else found.combination(dict(enumerate(between.tolist())))


def _alone(follows: Flags) -> Flags:
    """Return a mask of rows that follow, as the first ones of a series of their own."""
    own = follows.copy()
    own[0] = False
    return own


def _inverse(parameters: Floats, turn: Floats) -> tuple[Floats, Floats]:
    """
    Return what takes plane coordinates to those along both lines (2, 2), and the corner (2,).

    :param parameters: offsets and slopes of the lines, each in its own frame.
    :param turn: from the frame of the first line to that of the second one.
    """
    offset_1, slope_1, offset_2, slope_2 = parameters[:4]
    d = np.array([1.0, slope_1]) / hypot(1.0, slope_1)
    e = turn.T @ np.array([1.0, slope_2]) / hypot(1.0, slope_2)
    frame: Floats = np.linalg.inv(np.stack([d, e], axis=1))
    # A place on each line; the corner is on both.
    p, q = np.array([0.0, offset_1]), turn.T @ np.array([0.0, offset_2])
    origin: Floats = p + d * float((frame @ (q - p))[0])
    return frame, origin
