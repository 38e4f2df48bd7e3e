# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The errors of an arm against its targets: lag, friction, ringing and noise.

The measured joint less its target is modelled as the sum of three linear filters: a first-order
lag of the target's speed, an error that follows the direction of motion within a time constant,
and a damped oscillator that the acceleration excites. The filters are convolved on the cycles of
the controller, so missing packets do no harm.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import exp, hypot, log, pi, sqrt
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from ur_cartesian_driver.identification.arm_samples import ArmSamples
from ur_cartesian_driver.identification.least_squares import Fit, fit, Measured, NOWHERE
from ur_cartesian_driver.identification.segmentation import LONGEST_GAP, noise_of, REST_SPEED
from ur_cartesian_driver.motion.geometry.arrays import Floats, Indices

Spectrum: TypeAlias = NDArray[np.complex128]

#: Joints that turn less than this are ignored [rad].
_MIN_TURN = 0.02
#: Cycles of a recording that are used at most, and those of them before the first motion.
_MAX_CYCLES, _REST_BEFORE = 10_000, 100
#: The model fits if the root mean square of the residual is below this [rad], or below so many
#: times the noise.
_MISFIT, _ROUGH = 2e-5, 1.5
#: Least standard deviation that is assumed of a measured position [rad].
_FLOOR = 1e-7
_LAG, _SETTLING, _FREQUENCY, _DECAY, _FRICTION, _STATIC, _ACCELERATION, _ACCELERATION_LATER = (
    range(8)
)
#: Where the fit begins, and the frequencies that it begins from [Hz].
_LAG_START, _SETTLING_START, _DECAY_START, _FREQUENCIES = 7e-4, 0.02, 6.0, (5.0, 8.0, 12.0, 18.0)
#: Longest impulse response [s]; the size of transforms is a multiple of this step.
_LONGEST_KERNEL, _SIZE_STEP = 2.5, 512
#: Greater logarithms of times and frequencies are rejected.
_NO_BOUND = 9.0
#: Parts of a cycle, to place where motions begin and end.
_PARTS = 16
#: Lags for autocovariances of squared third differences.
_LAGS = 6


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmErrors:
    """
    The errors of an arm that were found.

    :param settling: time constant with which the error goes from friction to static error [s].
    :param cycle: time from packet to packet [s].
    :param joints: number of joints that moved.
    :param rms: root mean square of the residual [rad].
    :param noise: standard deviation of the white noise in the residual [rad].
    """

    lag: Measured
    friction: Measured
    static_error: Measured
    acceleration_error: Measured
    ringing_frequency: Measured
    ringing_decay: Measured
    settling: Measured
    cycle: float
    joints: int
    rms: float
    noise: float

    @property
    def fits_model(self) -> bool:
        """Whether the residual is hardly more than noise."""
        return self.rms < max(_MISFIT, _ROUGH * self.noise)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Grid:
    """
    Joints that move, on the cycles of the controller.

    :param qd: (j, m) target speed at each packet [rad/s]; ``qdd``: (j, m) target acceleration
        [rad/s^2]; both from the cycles on either side.
    :param turning: (j, m) mean direction in the cycle before each packet; 0 at rest.
    :param last_direction: (j, m) direction of the motion that ended last, the mean of that cycle;
        0 while moving.
    :param unmoved: (j, m) share of that cycle before the first motion.
    :param rows: (n,) cycle of each packet.
    :param error: (j, n) measured less target [rad].
    """

    cycle: float
    qd: Floats
    qdd: Floats
    turning: Floats
    last_direction: Floats
    unmoved: Floats
    rows: Indices
    error: Floats


def find_arm_errors(samples: ArmSamples) -> ArmErrors | None:
    """
    Find the errors of all joints that move, with one set of parameters for all of them.

    :returns: None if no measured joints were recorded, none move, or there is too little data.
    """
    grid = _grid(samples)
    if grid is None or samples.actual_q is None:
        return None
    found = _best(grid)
    if found is None:
        return None
    noise, static = noise_of(found.residuals), found.measured(_STATIC)
    doubt = _rest_doubt(grid, resolution_of(samples.actual_q), noise)
    return ArmErrors(
        lag=found.measured(_LAG),
        friction=found.measured(_FRICTION),
        static_error=replace(static, error=hypot(static.error, doubt)),
        acceleration_error=found.combination({_ACCELERATION: 1.0, _ACCELERATION_LATER: 1.0}),
        ringing_frequency=_exponential(found, _FREQUENCY),
        ringing_decay=_exponential(found, _DECAY),
        settling=_exponential(found, _SETTLING),
        cycle=grid.cycle,
        joints=len(grid.qd),
        rms=found.rms,
        noise=noise,
    )


def _rest_doubt(grid: _Grid, resolution: float, noise: float) -> float:
    """
    Return the uncertainty of the static error that is due to the encoders' resolution [rad].

    A joint that moves passes all steps r of its encoder. One that rests keeps one quantization
    error throughout; uniform noise of the width w dithers it down to a root mean square of
    r^2/(sqrt(180) w) at most (the Fourier series, each term at its largest).

    :param noise: standard deviation of measured positions, with the resolution [rad].
    """
    width = sqrt(max(12.0 * noise**2 - resolution**2, 0.0))
    left = min(resolution / sqrt(12.0), resolution**2 / max(sqrt(180.0) * width, 1e-12))
    rests = np.abs(grid.last_direction) == 1.0
    edges = np.diff(np.pad(rests.astype(np.int8), ((0, 0), (1, 1))), axis=1)
    lengths = np.nonzero(edges == -1)[1] - np.nonzero(edges == 1)[1]
    return left * float(np.linalg.norm(lengths)) / max(int(lengths.sum()), 1)


def _exponential(found: Fit, parameter: int) -> Measured:
    part = found.measured(parameter)
    value = exp(part.value)
    return Measured(value=value, error=value * part.error, freedom=part.freedom)


def _grid(samples: ArmSamples) -> _Grid | None:
    """Return the moving joints of the longest stretch without a long gap."""
    if samples.actual_q is None:
        return None
    time, cycle = samples.time, samples.cycle
    bounds = np.concatenate([[0], np.flatnonzero(np.diff(time) > LONGEST_GAP) + 1, [len(time)]])
    longest = int(np.argmax(np.diff(bounds)))
    begin, end = int(bounds[longest]), int(bounds[longest + 1])
    steps = np.abs(np.diff(samples.target_q[begin:end], axis=0)).max(axis=1, initial=0.0)
    moving = np.flatnonzero(steps > REST_SPEED * cycle)
    first_motion = int(moving[0]) if len(moving) else 0
    part = slice(begin + max(0, first_motion - _REST_BEFORE), end)
    time = time[part]
    rows = np.round((time - time[0]) / cycle).astype(np.intp)
    kept = rows < _MAX_CYCLES
    time, rows = time[kept], rows[kept]
    target, actual = samples.target_q[part][kept], samples.actual_q[part][kept]
    moves = np.flatnonzero(np.ptp(target, axis=0) > _MIN_TURN)
    if not len(moves):
        return None
    cycles = np.arange(rows[-1] + 1)
    q = np.stack([np.interp(cycles, rows, target[:, joint]) for joint in moves])
    step = np.diff(q, axis=1, prepend=q[:, :1], append=q[:, -1:]) / cycle
    turning, last_direction, unmoved = _directions(step)
    return _Grid(
        cycle=cycle,
        qd=0.5 * (step[:, 1:] + step[:, :-1]),
        qdd=np.diff(step, axis=1) / cycle,
        turning=turning,
        last_direction=last_direction,
        unmoved=unmoved,
        rows=rows,
        error=(actual - target)[:, moves].T,
    )


def _directions(step: Floats) -> tuple[Floats, Floats, Floats]:
    """
    Return the mean directions in motion and at rest (j, m), and the share before the first motion.

    Motions begin and end within cycles. To count them in whole cycles would delay the friction by
    up to a cycle, and make it look larger, above all at 125 Hz.

    :param step: (j, m + 1) mean speed between packets [rad/s].
    """
    ends = _end_speeds(step)
    before, after, mean = ends[:, :-1], ends[:, 1:], step[:, 1:-1]
    # The ramp fills a share of the cycle, beside its faster end; else the slower speed holds.
    change = np.where(after == before, 1.0, after - before)
    rises = np.abs(after) > np.abs(before)
    off = np.where(rises, mean - before, after - mean)
    share = np.clip(2.0 * off / change, 1.0 / _PARTS, 1.0)[:, :, None]
    u = (np.arange(_PARTS) + 0.5) / _PARTS
    passed = np.where(rises[:, :, None], (u - 1.0) / share + 1.0, u / share)
    speed = before[:, :, None] + np.clip(passed, 0.0, 1.0) * change[:, :, None]
    speed = np.where((after == before)[:, :, None], before[:, :, None], speed)
    shape = len(step), -1, _PARTS
    fine = speed.reshape(len(step), -1)
    moving = np.abs(fine) > REST_SPEED
    last = np.maximum.accumulate(np.where(moving, np.arange(fine.shape[1]), -1), axis=1)
    sign = np.sign(np.take_along_axis(fine, np.maximum(last, 0), 1))
    parts = (
        np.where(moving, np.sign(fine), 0.0),
        np.where(moving | (last < 0), 0.0, sign),
        (last < 0).astype(np.float64),
    )
    # The first cycle is repeated before the first packet.
    turning, last_direction, unmoved = (
        np.pad(part.reshape(shape).mean(axis=2), ((0, 0), (1, 0)), 'edge') for part in parts
    )
    return turning, last_direction, unmoved


def _end_speeds(step: Floats) -> Floats:
    """Return the speeds at packets (j, m), extrapolated from the side with the smoother speed."""
    padded = np.pad(step, ((0, 0), (2, 2)), 'edge')
    bend = np.abs(np.diff(padded, 2, axis=1))
    count = step.shape[1] - 1
    left = 1.5 * padded[:, 2 : 2 + count] - 0.5 * padded[:, 1 : 1 + count]
    right = 1.5 * padded[:, 3 : 3 + count] - 0.5 * padded[:, 4 : 4 + count]
    is_left = bend[:, :count] < bend[:, 3 : 3 + count]
    # Where a motion begins or ends, the line overshoots: keep it from 0 to twice the means beside.
    beside = 2.0 * np.stack([step[:, :-1], step[:, 1:], np.zeros_like(left)])
    speeds: Floats = np.clip(
        np.where(is_left, left, right), beside.min(axis=0), beside.max(axis=0)
    )
    return speeds


class _Model:
    """
    The errors of all joints as a function of the parameters.

    Parameters are lag [s], logarithms of settling time [s], frequency [Hz] and decay [1/s], then
    those in which the model is linear: friction, static error, two of bending, and the error of
    each joint before its first motion [rad].
    """

    def __init__(self, grid: _Grid) -> None:
        self._grid = grid
        joints, count = grid.qd.shape
        self._kernel_length = min(count, round(_LONGEST_KERNEL / grid.cycle))
        self._size = -(-(count + self._kernel_length) // _SIZE_STEP) * _SIZE_STEP
        self._speed = self._spectrum(-grid.qd)
        # Filters start from 0, but the joints were unmoved (1) before: its change is filtered, and
        # the 1 is added afterwards.
        self._inputs = [
            self._spectrum(each)
            for each in (-grid.turning, -grid.last_direction, grid.unmoved - 1.0)
        ]
        # Differencing and linear interpolation each attenuate the frequency w by (w cycle)^2 / 12;
        # a sixth of the second difference restores both.
        bends = np.diff(np.pad(grid.qdd, ((0, 0), (1, 1)), 'edge'), 2, axis=1)
        self._acceleration = self._spectrum(bends / 6.0 - grid.qdd)
        self._joints = joints

    def __call__(self, parameters: Floats) -> Floats:
        lag, *logarithms = parameters[:4]
        if not 0.0 <= lag < 0.1 or max(map(abs, logarithms)) > _NO_BOUND:
            return np.full(self._grid.error.size, NOWHERE)
        settling, frequency, decay = logarithms
        whole = self._speed * self._transfer(self._lag_kernel(lag))
        whole = whole + self._friction(parameters) * self._transfer(self._drag_kernel(settling))
        whole = whole + self._bend(parameters) * self._transfer(
            self._ring_kernel(frequency, decay)
        )
        first = np.repeat(parameters[_ACCELERATION_LATER + 1 :], len(self._grid.rows))
        return self._packets(whole) + first

    def columns(self, parameters: Floats) -> Floats:
        """Return the derivatives by the linear parameters (j n, k)."""
        _, settling, frequency, decay = parameters[:4]
        drag = self._transfer(self._drag_kernel(settling))
        ring = self._transfer(self._ring_kernel(frequency, decay))
        friction, static, unmoved = (self._packets(each * drag) for each in self._inputs)
        bends = [self._packets(self._acceleration * ring * each) for each in (1.0, self._later)]
        packets = len(self._grid.rows)
        own = np.zeros((self._joints * packets, self._joints))
        for joint in range(self._joints):
            rows = slice(joint * packets, (joint + 1) * packets)
            own[rows, joint] = 1.0 + unmoved[rows]
        return np.concatenate([np.stack([friction, static, *bends], axis=1), own], axis=1)

    def derivatives(self, parameters: Floats) -> Floats:
        """Return the derivatives by all parameters (j n, k)."""
        lag, settling, frequency, decay = parameters[:4]
        drag, bend = self._friction(parameters), self._bend(parameters)
        shapes = (
            (self._speed, _slope(self._lag_kernel, max(lag, 1e-5), 1e-6)),
            (drag, _slope(self._drag_kernel, settling, 1e-4)),
            (bend, _slope(lambda x: self._ring_kernel(x, decay), frequency, 1e-5)),
            (bend, _slope(lambda x: self._ring_kernel(frequency, x), decay, 1e-5)),
        )
        parts = [self._packets(each * self._transfer(kernel)) for each, kernel in shapes]
        return np.concatenate([np.stack(parts, axis=1), self.columns(parameters)], axis=1)

    # -- filters ---------------------------------------------------------------------------------

    def _lag_kernel(self, lag: float) -> Floats:
        """Return the kernel of a first-order lag, for a speed that changes evenly in a cycle."""
        lag = max(lag, 1e-6)
        left, share = exp(-self._grid.cycle / lag), lag / self._grid.cycle
        now = 1.0 - share * (1.0 - left)
        before = share * (1.0 - left) - left
        rest = left ** np.arange(min(60.0, self._kernel_length)) * (left * now + before)
        kernel: Floats = lag * np.concatenate([[now], rest])
        return kernel

    def _drag_kernel(self, log_settling: float) -> Floats:
        left = exp(-self._grid.cycle / exp(log_settling))
        kernel: Floats = (1.0 - left) * left ** np.arange(float(self._kernel_length))
        return kernel

    def _ring_kernel(self, log_frequency: float, log_decay: float) -> Floats:
        """Return the kernel of an oscillator, for an input that changes evenly in a cycle."""
        omega, decay = 2.0 * pi * exp(log_frequency), exp(log_decay)
        cycle, square = self._grid.cycle, omega**2 + decay**2
        t = cycle * np.arange(self._kernel_length + 1)
        # The response to a unit ramp.
        swing = (omega - decay**2 / omega) * np.sin(omega * t) - 2.0 * decay * np.cos(omega * t)
        rise = t - (2.0 * decay + np.exp(-decay * t) * swing) / square
        kernel: Floats = np.diff(rise, 2, prepend=0.0) / cycle
        return kernel

    @property
    def _later(self) -> Spectrum:
        """The delay by a cycle."""
        turns = np.arange(self._size // 2 + 1) / self._size
        delay: Spectrum = np.exp(-2j * pi * turns)
        return delay

    def _friction(self, parameters: Floats) -> Spectrum:
        friction, static, unmoved = self._inputs
        own = parameters[_ACCELERATION_LATER + 1 :, None]
        moving, resting = parameters[_FRICTION] * friction, parameters[_STATIC] * static
        drag: Spectrum = moving + resting + own * unmoved
        return drag

    def _bend(self, parameters: Floats) -> Spectrum:
        # The delay of the acceleration is an unknown part of a cycle: a mixture of none and one.
        now, later = parameters[_ACCELERATION], parameters[_ACCELERATION_LATER]
        bend: Spectrum = self._acceleration * (now + later * self._later)
        return bend

    def _spectrum(self, values: Floats) -> Spectrum:
        spectrum: Spectrum = np.fft.rfft(values, self._size)
        return spectrum

    def _transfer(self, kernel: Floats) -> Spectrum:
        transfer: Spectrum = np.fft.rfft(kernel, self._size)
        return transfer

    def _packets(self, spectrum: Spectrum) -> Floats:
        """Return values at the packets of all joints in a row (j n,)."""
        values: Floats = np.fft.irfft(spectrum, self._size)[:, self._grid.rows].ravel()
        return values


def _best(grid: _Grid) -> Fit | None:
    """Fit, starting from the frequency of ringing with the smallest residual."""
    model, measured = _Model(grid), grid.error.ravel()
    starts = []
    for frequency in _FREQUENCIES:
        start = np.zeros(8 + len(grid.qd))
        start[:4] = _LAG_START, log(_SETTLING_START), log(frequency), log(_DECAY_START)
        columns = model.columns(start)
        rest = measured - model(start)
        start[4:] = np.linalg.lstsq(columns, rest)[0]
        starts.append((float(np.sum((rest - columns @ start[4:]) ** 2)), start.tolist()))
    return fit(
        model,
        measured,
        min(starts)[1],
        np.tile(np.diff(grid.rows, prepend=-2) == 1, len(grid.qd)),
        derivatives=model.derivatives,
        floor=_FLOOR,
    )


def _slope(kernel: Callable[[float], Floats], at: float, step: float) -> Floats:
    slope: Floats = (kernel(at + step) - kernel(at - step)) / (2.0 * step)
    return slope


# ---- noise -----------------------------------------------------------------------------------


def resolution_of(actual_q: Floats) -> float:
    """Return the step between measured positions [rad]; 0 if no regular step is found."""
    smallest = []
    for column in actual_q.T:
        steps = np.diff(np.unique(column))
        steps = steps[steps > 1e-10]
        if len(steps) < 20:
            continue
        least = float(steps.min())
        multiples = steps / least
        if np.abs(multiples - np.round(multiples)).max() < 0.05 and multiples.max() < 1e4:
            smallest.append(least)
    return min(smallest) if smallest else 0.0


def find_noise(samples: ArmSamples) -> Measured | None:
    """
    Return the noise of measured joints, peak to peak, as if it were evenly distributed [rad].

    Third differences d of the error are almost pure noise, with the variance mean(d^2) / 20. The
    resolution of a joint that moves adds r^2/12 to the w^2/12 of the noise.
    """
    if samples.actual_q is None:
        return None
    resolution = resolution_of(samples.actual_q)
    step = np.diff(samples.time)
    even = np.abs(step - samples.cycle) < 0.2 * samples.cycle
    whole = even[:-2] & even[1:-1] & even[2:]
    error = samples.actual_q - samples.target_q
    travels = np.abs(np.diff(samples.target_q, axis=0))
    squares = [
        (np.diff(error[:, joint], 3)[whole & (travels[1:-1, joint] > 0.5 * resolution)]) ** 2
        / 20.0
        for joint in range(6)
        if np.ptp(samples.target_q[:, joint]) > _MIN_TURN
    ]
    squares = [part for part in squares if len(part) > 100]
    if not squares:
        return None
    count = sum(map(len, squares))
    mean = float(np.concatenate(squares).mean())
    spread = 0.0
    for part in squares:
        off = part - mean
        spread += float(off @ off)
        for lag in range(1, _LAGS + 1):
            spread += 2.0 * (1.0 - lag / (_LAGS + 1.0)) * float(off[lag:] @ off[:-lag])
    error_of_mean = sqrt(max(spread, 0.0)) / count
    square = 12.0 * mean - resolution**2
    if square <= 0.0:
        return None
    wide = sqrt(square)
    return Measured(value=wide, error=6.0 * error_of_mean / wide, freedom=float(count))
