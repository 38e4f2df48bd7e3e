# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The band in which a path may give way, and the frame of the path.

The controller's own path offsets have the same frame (``path_offset_set``, type MOTION): *along*
is the tangent of the path, *across* = along x the z axis of the tool, *normal* = along x across.
For a tool whose z axis points into the work, normal points out of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats
from ur_cartesian_driver.motion.geometry.vectors import Vector3, vector3, ZERO3
from ur_cartesian_driver.motion.goal.goal import StaleOffset

#: The axes of the frame, as words for users.
OFFSET_AXES = ('along', 'across', 'normal')


class AppliedOffset(NamedTuple):
    """The displacement of the tool from the path of the goal by path offsets."""

    #: In the base [m].
    shift: Vector3 = ZERO3
    #: In the frame of the path [m].
    offset: Vector3 = ZERO3


#: The path is as the goal says.
NO_OFFSET = AppliedOffset()


@dataclass(frozen=True, slots=True, kw_only=True)
class OffsetFeedback:
    """One packet of the robot program about the offset that the controller adds to its motion."""

    #: The last sequence number that it has read.
    last_sequence: int
    #: Along, across, normal; and the offset that the controller applies, in the base [m].
    offset: Vector3
    shift: Vector3


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OffsetBand:
    """The limits of path offsets, and their place."""

    #: Along, across, normal [m].
    limits: Vector3
    #: Of the offset along each axis [m/s], [m/s^2].
    speed: float
    acceleration: float
    #: When an offset is stale [s], and what follows.
    timeout: float
    on_stale: StaleOffset
    #: Of the rows below [s].
    step: float
    #: (n, 3 axes, 3) in the base, at the times 0, step, 2 step, ... of the motion.
    axes: Floats
    #: (n,) whether the path may give way there; if not, the offset fades out.
    is_open: Flags

    def axes_at(self, time: float) -> Floats:
        """Return the axes at a time of the motion [s] in the base (3 axes, 3)."""
        row = min(max(time / self.step, 0.0), len(self.axes) - 1.0)
        k = min(int(row), len(self.axes) - 2)
        part = row - k
        axes: Floats = (1.0 - part) * self.axes[k] + part * self.axes[k + 1]
        return axes

    def shift(self, time: float, offset: Vector3) -> Vector3:
        """Return an offset at a time of the motion [s] in the base."""
        return vector3((offset @ self.axes_at(time)).tolist())

    def opens(self, time: float) -> bool:
        """Tell whether the path may give way at a time of the motion [s]."""
        row = int(time / self.step)
        return row < len(self.is_open) and bool(self.is_open[row])
