# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The recording of a motion, which the analyses of the experiments read."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionSamples:
    """
    Samples of a recorded motion, one row per cycle.

    :param time: time by the controller's clock (n,) [s].
    :param target_q: target joint positions (n, 6) [rad].
    :param actual_q: measured joint positions (n, 6) [rad].
    :param tool_speed: speed of the target TCP (n,) [m/s].
    :param scaling: RTDE output speed_scaling (n,).
    :param fraction: RTDE output target_speed_fraction (n,).
    :param stop_sent: time of the stop command by the controller's clock [s]; NaN = none was sent.
    :param target_distance: distance of the target TCP from its first position (n,) [m].
    :param actual_distance: distance of the measured TCP from its first position (n,) [m].
    :param spline_time: time since the program began its current piece of a corner (n,) [s].
    :param pieces_begun: number of pieces of a corner that the program has begun (n,).
    :param runtime_state: (n,) see :class:`~...motion.state.rtde_state.RuntimeState`.
    """

    time: Floats
    target_q: Floats
    actual_q: Floats
    tool_speed: Floats
    scaling: Floats
    fraction: Floats
    stop_sent: float
    target_distance: Floats
    actual_distance: Floats
    spline_time: Floats
    pieces_begun: Floats
    runtime_state: Floats

    def as_lists(self) -> dict[str, Any]:
        """Return the columns as lists for JSON, rounded to 6 decimals."""
        columns = {f.name: getattr(self, f.name) for f in fields(self) if f.name != 'stop_sent'}
        return {name: np.round(column, 6).tolist() for name, column in columns.items()}

    @property
    def moving(self) -> Flags:
        """Return a mask (n,) of the rows whose target joints differ from the row before."""
        steps = np.abs(np.diff(self.target_q, axis=0)).max(axis=1) > 1e-9
        return np.concatenate([[False], steps])

    @property
    def duration(self) -> float:
        """The time from the first to the last change of the target joints [s]; 0 = none."""
        rows = np.flatnonzero(self.moving)
        return float(self.time[rows[-1]] - self.time[rows[0] - 1]) if len(rows) else 0.0
