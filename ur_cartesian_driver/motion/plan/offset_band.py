# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The band within which path offsets may displace the tool, and the frame of the path.

The controller's own path offsets use the same frame (``path_offset_set``, type MOTION): *along*
is the tangent of the path, *across* = along x the z axis of the tool, *normal* = along x across.
For a tool whose z axis points into the work, normal points out of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats
from ur_cartesian_driver.motion.geometry.vectors import Vector3, vector3, ZERO3
from ur_cartesian_driver.motion.goal.goal import StaleOffset

#: The names of the frame's axes, for users.
OFFSET_AXES = ('along', 'across', 'normal')


class AppliedOffset(NamedTuple):
    """The displacement of the tool from the path of the goal by path offsets."""

    #: The displacement in the base [m].
    shift: Vector3 = ZERO3
    #: The displacement in the frame of the path [m].
    offset: Vector3 = ZERO3


#: No displacement: the tool is on the path of the goal.
NO_OFFSET = AppliedOffset()


@dataclass(frozen=True, slots=True, kw_only=True)
class OffsetFeedback:
    """The robot program's report, in one packet, on the offset that the controller applies."""

    #: The last sequence number that the robot program has read.
    last_sequence: int
    #: The applied offset in the frame of the path: along, across, normal [m].
    offset: Vector3
    #: The applied offset in the base [m].
    shift: Vector3


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OffsetBand:
    """The limits of path offsets, and the frame of the path over time."""

    #: Largest offset along, across and normal to the path [m].
    limits: Vector3
    #: Largest speed of the offset along each axis [m/s].
    speed: float
    #: Largest acceleration of the offset along each axis [m/s^2].
    acceleration: float
    #: The age at which an offset is stale [s].
    timeout: float
    #: The reaction to a stale offset.
    on_stale: StaleOffset
    #: Time between two rows of ``axes`` and ``is_open`` [s].
    step: float
    #: (n, 3 axes, 3) the frame of the path in the base, at the times 0, step, 2 step, ...
    axes: Floats
    #: (n,) whether offsets are allowed at the time of the row; if not, the offset fades out.
    is_open: Flags

    def axes_at(self, time: float) -> Floats:
        """Return the axes of the path in the base (3 axes, 3) at a time of the motion [s]."""
        row = min(max(time / self.step, 0.0), len(self.axes) - 1.0)
        k = min(int(row), len(self.axes) - 2)
        part = row - k
        axes: Floats = (1.0 - part) * self.axes[k] + part * self.axes[k + 1]
        return axes

    def shift(self, time: float, offset: Vector3) -> Vector3:
        """Return an offset as a vector in the base [m], at a time of the motion [s]."""
        return vector3((offset @ self.axes_at(time)).tolist())

    def opens(self, time: float) -> bool:
        """Return whether offsets are allowed at a time of the motion [s]."""
        row = int(time / self.step)
        return row < len(self.is_open) and bool(self.is_open[row])
