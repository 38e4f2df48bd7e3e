# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The geometry of all segments in columns: curves, blends, joints, and speed bounds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats, Int64s
from ur_cartesian_driver.motion.goal.goal_columns import SegmentRows, WaypointRows
from ur_cartesian_driver.planning.geometry.blended_path import BlendedPath
from ur_cartesian_driver.planning.moves.path_samples import JointSpeedBounds
from ur_cartesian_driver.planning.preflight.tightest_margins import TightestMargins
from ur_cartesian_driver.planning.request.goal_fields import IS_OPTIMIZED


@dataclass(frozen=True, slots=True, kw_only=True)
class SegmentGeometries:
    """The segments of a goal with curves and joints, still without speeds; one per row."""

    #: Index of the waypoint at the end of the first segment.
    begin: int
    #: (n,) type numbers; AUTO has become LINEAR, and a segment replaced by a joint move JOINT.
    kinds: Int64s
    waypoints: WaypointRows
    segments: SegmentRows
    #: The curves with their blends: ``path.curves``, ``path.u_join``, ``path.u_leave``, ...
    path: BlendedPath
    #: (n, 6) configurations at the ends of the segments [rad].
    joints: Floats
    #: (n,) durations of the segments by the goal's times [s]; NaN = no times, speeds apply.
    times: Floats
    #: Joint speed bounds of the segments.
    speed_bounds: JointSpeedBounds
    #: The segments' smallest distances from singularities and joint limits.
    tightest_margins: TightestMargins
    #: Whether the arm is already at the first point, and waits there until the point's time.
    waits: bool = False

    def __len__(self) -> int:
        return len(self.kinds)

    @property
    def is_optimized(self) -> Flags:
        """(n,) whether each segment's speed is a fraction of the robot's limits."""
        return IS_OPTIMIZED[self.kinds]

    @property
    def unblended_fractions(self) -> Floats:
        """(n,) the fraction of each segment between its blends; touching blends leave almost 0."""
        fractions: Floats = np.maximum(self.path.u_leave - self.path.u_join, 1e-9)
        return fractions
