# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Distance and pose of the tool at each time of a planned path, and the time at each distance.

Lines are sampled only where the acceleration changes, so the tool moves between samples at
constant acceleration, not at constant speed. The speeds at the samples follow one after the other:
the mean of the speeds at both ends of a piece is its length divided by its time. On splines, and
where samples are dense, the mean speeds of the pieces on both sides are the better source, because
an error in one speed does not propagate to the next.
"""

from __future__ import annotations

from math import inf, sqrt

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.geometry.pose import Pose, pose_from_row
from ur_cartesian_driver.motion.geometry.pose_rows import angle_rows, distance_rows
from ur_cartesian_driver.motion.plan.plan import ReferencePath

# Distance that counts for a turn of the tool by 1 rad [m], so that a mere turn has a speed, too.
_ARM_LENGTH = 0.1
# A tool that moves less than this per turn [m/rad] only turns.
_MIN_LENGTH_PER_TURN = 1e-3
# Samples that are not farther apart than this are dense [s].
_DENSE = 0.03
# A piece of the path that is not longer than this [m] is a rest.
_NO_LENGTH = 1e-9


class PathClock:
    """The samples of a path, with the speed at each."""

    def __init__(self, reference: ReferencePath, *, is_spline: bool) -> None:
        """
        Measure the distances between the samples.

        :param is_spline: whether the acceleration changes continuously, not only at samples.
        """
        self._poses, self._times = reference.poses, reference.time
        a, b = self._poses[:-1], self._poses[1:]
        lengths, angles = distance_rows(a, b), angle_rows(a[:, 3:], b[:, 3:])
        #: (m,) distance along the path from the start to each sample [m].
        self._arc_lengths = np.append(0.0, np.cumsum(lengths))
        self._turns = np.append(0.0, np.cumsum(angles))
        self._steps = np.hypot(lengths, _ARM_LENGTH * angles)
        self._speeds = _speeds(self._steps, np.diff(self._times), inf if is_spline else _DENSE)

    def pose(self, time: float) -> Pose:
        """Return the pose of the tool at a time [s]."""
        k, part = self._piece(time)
        return pose_from_row(self._poses[k]).interpolate(pose_from_row(self._poses[k + 1]), part)

    def arc_length(self, time: float) -> float:
        """Return the distance that the tool has moved from the start to a time [m]."""
        return self._between(self._arc_lengths, time)

    def turn(self, time: float) -> float:
        """Return the angle that the tool has turned from the start to a time [rad]."""
        return self._between(self._turns, time)

    @property
    def length(self) -> float:
        """The length of the path [m]."""
        return float(self._arc_lengths[-1])

    def motion_back(self, time: float, span: float, pieces: int) -> tuple[float, Floats, bool]:
        """
        Return the motion of the tool that ends at a time [s].

        :param span: duration of the motion [s].
        :returns: its distance [m]; the speeds (pieces + 1,) [m/s] at equal intervals of time, from
            its end back to its beginning; whether distance and speeds are angular [rad], [rad/s],
            because the tool only turns.
        """
        arc_length = self.arc_length(time) - self.arc_length(time - span)
        turn = self.turn(time) - self.turn(time - span)
        turns = arc_length < _MIN_LENGTH_PER_TURN * turn
        values, length = (self._turns, turn) if turns else (self._arc_lengths, arc_length)
        times = (time - span * np.arange(pieces + 1) / pieces).tolist()
        speeds = np.array([self._speed(values, each) for each in times])
        # The robot program assumes a constant acceleration between two speeds. Where it is not
        # constant, the inner speeds are changed so that the piece has its length. The speeds at
        # both ends stay exact, because the program compares the tool's speed at the beginning with
        # the planned one to measure how much the motion is slowed.
        lengths = np.array([self._between(values, each) for each in times])
        lacking = -np.diff(lengths) * (pieces / span) - 0.5 * (speeds[1:] + speeds[:-1])
        speeds[1:-1] += 0.5 * (lacking[1:] + lacking[:-1])
        speeds[[1, -2]] += 0.5 * lacking[[0, -1]]
        return length, np.maximum(speeds, 0.0), turns

    def max_speed(self, begin: float, end: float) -> float:
        """Return the largest speed of the tool from one time to another [m/s]."""
        (first, _), (last, _) = self._piece(begin), self._piece(end)
        own, after = slice(first, last + 1), slice(first + 1, last + 2)
        spans = self._times[after] - self._times[own]
        u, v = self._speeds[own], self._speeds[after]
        # Spans and u + v are positive where the tool moves; elsewhere the result is 0.
        means = (self._arc_lengths[after] - self._arc_lengths[own]) / np.maximum(spans, 1e-12)
        factors = 2.0 * means / np.maximum(u + v, 1e-300)
        parts = np.clip(
            (np.array([[begin], [end]]) - self._times[own]) / np.maximum(spans, 1e-12), 0.0, 1.0
        )
        return float((factors * (u + (v - u) * parts)).max())

    def time_at(self, arc_length: float, *, leaving: bool) -> float:
        """
        Return the time [s] at which the tool has moved a distance from the start.

        :param leaving: whether to return the end of the rest, if the tool rests there.
        """
        if leaving:
            k = int(np.searchsorted(self._arc_lengths, arc_length + _NO_LENGTH, side='right')) - 1
        else:
            k = int(np.searchsorted(self._arc_lengths, arc_length - _NO_LENGTH, side='left')) - 1
        k = min(max(k, 0), len(self._steps) - 1)
        begin, end = float(self._arc_lengths[k]), float(self._arc_lengths[k + 1])
        part = min(max((arc_length - begin) / (end - begin), 0.0), 1.0) if end > begin else 0.0
        span = float(self._times[k + 1] - self._times[k])
        u, v = float(self._speeds[k]), float(self._speeds[k + 1])
        # The part of the distance is (u t + (v - u) t^2 / 2) / ((u + v) / 2), with t = 0 to 1.
        root = sqrt(max(u * u + (v * v - u * u) * part, 0.0))
        t = part * (u + v) / (u + root) if u + root > 0.0 else part
        return float(self._times[k]) + span * t

    def _piece(self, time: float) -> tuple[int, float]:
        """Return the sample before a time, and the passed part of the distance to the next one."""
        k = int(np.searchsorted(self._times, time, side='right')) - 1
        k = min(max(k, 0), len(self._steps) - 1)
        span = float(self._times[k + 1] - self._times[k])
        t = min(max((time - float(self._times[k])) / span, 0.0), 1.0) if span > 0.0 else 1.0
        u, v = float(self._speeds[k]), float(self._speeds[k + 1])
        return k, (2.0 * u + (v - u) * t) * t / (u + v) if u + v > 0.0 else t

    def _speed(self, values: Floats, time: float) -> float:
        """Return the rate of change at a time [1/s] of a quantity with ``values`` at samples."""
        k, _ = self._piece(time)
        span = float(self._times[k + 1] - self._times[k])
        u, v = float(self._speeds[k]), float(self._speeds[k + 1])
        if span <= 0.0 or u + v <= 0.0:
            return 0.0
        t = min(max((time - float(self._times[k])) / span, 0.0), 1.0)
        return float(values[k + 1] - values[k]) / span * 2.0 * (u + (v - u) * t) / (u + v)

    def _between(self, values: Floats, time: float) -> float:
        k, part = self._piece(time)
        return float(values[k] + part * (values[k + 1] - values[k]))


def _speeds(steps: Floats, spans: Floats, dense: float) -> Floats:
    """
    Return the speed at each sample (m,) of a path that begins at rest, or with dense samples.

    The unit is arbitrary, as only the ratios of speeds at both ends of a piece are used.

    :param steps: length of each piece (m - 1,).
    :param spans: its duration (m - 1,) [s].
    :param dense: samples no farther apart than this are dense [s]; inf = all are.
    """
    speeds = [0.0]
    pieces = list(zip(steps.tolist(), spans.tolist(), strict=True))
    for k, (step, span) in enumerate(pieces):
        after, after_span = pieces[k + 1] if k + 1 < len(pieces) else (0.0, 0.0)
        if span <= 0.0:
            speeds.append(speeds[-1])
        elif step <= _NO_LENGTH:
            speeds.append(0.0)
        elif after > _NO_LENGTH and 0.0 < after_span <= dense and span <= dense:
            mean, mean_after = step / span, after / after_span
            speeds.append((mean * after_span + mean_after * span) / (span + after_span))
        else:
            speeds.append(max(2.0 * step / span - speeds[-1], 0.0))
    if pieces and 0.0 < pieces[0][1] <= dense:  # appended points begin in motion
        speeds[0] = max(2.0 * pieces[0][0] / pieces[0][1] - speeds[1], 0.0)
    return np.array(speeds)
