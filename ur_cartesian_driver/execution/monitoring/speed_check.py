# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Whether a robot program that says nothing on its way goes about as fast as it was told.

Our own program counts the points that it begins, which shows that it reads them as they were
meant. Another program may read them in another wire dialect, and nothing on the wire tells: a
time becomes a thousand times as long, or an acceleration a speed. The place on the path is then
right and the pace is wrong. The bounds are wide, because they are not there to judge a motion: it
is the plan's, or another one.
"""

from __future__ import annotations

from math import hypot

import numpy as np
from numpy.typing import NDArray

from ur_cartesian_driver.motion.plan import ReferencePath
from ur_cartesian_driver.motion.vectors import Vector6

#: The peak of a motion from rest to rest is at most twice its average.
PEAK_TO_MEAN = 2.0
#: Speeds that harm nobody [m/s], [rad/s].
MIN_SPEED_LIMITS = (0.02, 0.1)
#: So many times longer than planned, beyond the time that a program may need to begin [s].
MAX_SLOWDOWN, MAX_START_DELAY = 20.0, 3.0
_CAUSE = (
    'the robot program reads the points in another way than they were meant; set '
    'wire_dialect to the version of that program'
)


class SpeedCheck:
    """The speeds that a plan leads to."""

    def __init__(self, path: ReferencePath) -> None:
        """Find the largest speeds of the planned path."""
        passed = np.diff(path.time)
        distances = np.linalg.norm(np.diff(path.poses[:, :3], axis=0), axis=1)
        # Twice the arcsine of half the chord, whose end is the nearer one of q and -q.
        a, b = path.poses[:-1, 3:], path.poses[1:, 3:]
        chords = np.minimum(np.linalg.norm(b - a, axis=1), np.linalg.norm(b + a, axis=1))
        turns = 4.0 * np.arcsin(np.minimum(0.5 * chords, 1.0))
        self._limits = tuple(
            PEAK_TO_MEAN * _max_speed(lengths, passed) + min_limit
            for lengths, min_limit in zip((distances, turns), MIN_SPEED_LIMITS, strict=True)
        )

    def violation(self, twist: Vector6, elapsed: float, planned: float) -> str | None:
        """
        Return what is wrong with the pace, as a clause, or None.

        :param twist: that of the controller's own target.
        :param elapsed: time since the start in which the controller's clock ran [s].
        :param planned: when the plan has the tool at its present place [s].
        """
        speeds = hypot(*twist[:3]), hypot(*twist[3:])
        for speed, limit, unit in zip(speeds, self._limits, ('m/s', 'rad/s'), strict=True):
            if speed > limit:
                return (
                    f'the controller moves the tool with {speed:.3f} {unit}, and the plan '
                    f'with no more than {limit:.3f} {unit}: {_CAUSE}'
                )
        if elapsed > MAX_START_DELAY + MAX_SLOWDOWN * planned:
            return (
                f'after {elapsed:.1f} s the controller is where the plan is after '
                f'{planned:.2f} s: {_CAUSE}'
            )
        return None


def _max_speed(lengths: NDArray[np.float64], times: NDArray[np.float64]) -> float:
    """Return the largest average speed of the edges; infinite where one takes no time."""
    moving = lengths > 1e-9
    if not moving.any():
        return 0.0
    with np.errstate(divide='ignore'):
        return float((lengths[moving] / times[moving]).max())
