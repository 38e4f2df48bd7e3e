# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Check that a robot program which reports no progress moves about as fast as planned.

Our own program counts the points that it begins, which shows that it reads them as intended. A
foreign program may read them in another wire dialect, and nothing on the wire reveals this: a time
becomes a thousand times as long, or an acceleration becomes a speed. The path is then right, but
the speed is wrong. The bounds are wide: they only detect such a wrong reading.
"""

from __future__ import annotations

from math import hypot

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.geometry.pose_rows import length_rows
from ur_cartesian_driver.motion.geometry.vectors import Vector6
from ur_cartesian_driver.motion.plan.plan import ReferencePath

#: The peak speed of a motion from rest to rest is at most twice its average speed.
PEAK_TO_MEAN = 2.0
#: Margins on the limits [m/s], [rad/s], so that no limit is near 0 for a plan that hardly moves.
SPEED_MARGINS = (0.02, 0.1)
#: The longest duration is this multiple of the planned one, plus this time to begin [s].
MAX_SLOWDOWN, MAX_START_DELAY = 20.0, 3.0
#: The remedy for a robot program that reads the points in another wire dialect.
REMEDY = 'set wire_dialect to the version of that program'
_CAUSE = f'the robot program reads the points in another wire dialect; {REMEDY}'


class SpeedCheck:
    """Bounds on speed and duration that follow from a plan."""

    def __init__(self, path: ReferencePath) -> None:
        """Find the largest speeds of the planned path."""
        passed = np.diff(path.time)
        distances = length_rows(np.diff(path.poses[:, :3], axis=0))
        # A turn is four times the arcsine of half the chord from a to the nearer of b and -b.
        a, b = path.poses[:-1, 3:], path.poses[1:, 3:]
        chords = np.minimum(length_rows(b - a), length_rows(b + a))
        turns = 4.0 * np.arcsin(np.minimum(0.5 * chords, 1.0))
        self._limits = tuple(
            PEAK_TO_MEAN * _max_speed(lengths, passed) + margin
            for lengths, margin in zip((distances, turns), SPEED_MARGINS, strict=True)
        )

    def violation(self, twist: Vector6, elapsed: float, planned: float) -> str | None:
        """
        Return the exceeded bound on speed or duration, as a clause, or None.

        :param twist: twist of the controller's own target.
        :param elapsed: time since the start, as the controller's clock ran [s].
        :param planned: planned time of the present position on the path [s].
        """
        speeds = hypot(*twist[:3]), hypot(*twist[3:])
        for speed, limit, unit in zip(speeds, self._limits, ('m/s', 'rad/s'), strict=True):
            if speed > limit:
                return (
                    f'the controller moves the tool at {speed:.3f} {unit}, and the plan explains '
                    f'at most {limit:.3f} {unit}: {_CAUSE}'
                )
        if elapsed > MAX_START_DELAY + MAX_SLOWDOWN * planned:
            return (
                f'after {elapsed:.1f} s the controller has come only as far as the plan after '
                f'{planned:.2f} s: {_CAUSE}'
            )
        return None


def _max_speed(lengths: Floats, times: Floats) -> float:
    """Return the largest average speed on an edge; infinite if a moving edge takes no time."""
    moving = lengths > 1e-9
    if not moving.any():
        return 0.0
    with np.errstate(divide='ignore'):
        return float((lengths[moving] / times[moving]).max())
