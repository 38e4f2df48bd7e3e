# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The geometry of all segments in columns: curves, blends, joints, and what bounds the speed.

They are also a sequence of :class:`~.segment_data.SegmentGeometry`, made when somebody looks.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import overload

import numpy as np
from numpy.typing import NDArray

from ur_cartesian_driver.motion.goal import SegmentType
from ur_cartesian_driver.motion.goal_table import Integers, Rows, SegmentRows, WaypointRows
from ur_cartesian_driver.motion.pose_rows import Floats
from ur_cartesian_driver.motion.vectors import vector6
from ur_cartesian_driver.planning.geometry.blended_path import BlendedPath
from ur_cartesian_driver.planning.moves.segment_data import JointSpeedBound, SegmentGeometry
from ur_cartesian_driver.planning.preflight.tightest_margins import TightestMargins

_KINDS = tuple(SegmentType)


@dataclass(frozen=True, slots=True, eq=False, repr=False, kw_only=True)
class JointSpeedBounds(Rows[JointSpeedBound]):
    """The times of segments at the speed limits of the joints; see :class:`JointSpeedBound`."""

    #: (n,) each
    times: Floats
    joints: NDArray[np.intp]
    fractions: Floats
    shortest_times: Floats
    times_at_limits: Floats

    def __len__(self) -> int:
        return len(self.times)

    def __iter__(self) -> Iterator[JointSpeedBound]:
        return map(
            JointSpeedBound,
            self.times.tolist(),
            self.joints.tolist(),
            self.fractions.tolist(),
            self.shortest_times.tolist(),
            self.times_at_limits.tolist(),
        )


@dataclass(frozen=True, slots=True, eq=False, repr=False, kw_only=True)
class SegmentGeometries(Sequence[SegmentGeometry]):
    """The segments of a goal with their curves and joints, still without speed; a row for each."""

    #: Index of the waypoint at the end of the first.
    begin: int
    #: (n,) the numbers of the types that are sent: AUTO resolved, JOINT where that replaces a line
    #: or an arc.
    kinds: Integers
    waypoints: WaypointRows
    segments: SegmentRows
    #: The curves with their blends: ``path.curves``, ``path.u_join``, ``path.u_leave``, ...
    path: BlendedPath
    #: (n, 6) configurations at the ends [rad].
    joints: Floats
    #: (n,) times from the goal [s]; NaN = by speed.
    times: Floats
    #: What limits their speeds, and their distances from singularities and joint limits.
    speed_bounds: JointSpeedBounds
    tightest_margins: TightestMargins
    #: Whether the arm stands at the first point already, and waits until its time.
    waits: bool = False

    @property
    def unblended_fractions(self) -> Floats:
        """(n,) the fractions of them between their blends; blends that touch leave nearly none."""
        fractions: Floats = np.maximum(self.path.u_leave - self.path.u_join, 1e-9)
        return fractions

    def __len__(self) -> int:
        return len(self.kinds)

    @overload
    def __getitem__(self, index: int) -> SegmentGeometry: ...

    @overload
    def __getitem__(self, index: slice) -> list[SegmentGeometry]: ...

    def __getitem__(self, index: int | slice) -> SegmentGeometry | list[SegmentGeometry]:
        rows = range(len(self))[index]
        if isinstance(rows, range):
            return [self[row] for row in rows]
        return next(self._objects(slice(rows, rows + 1)))

    def __iter__(self) -> Iterator[SegmentGeometry]:
        return self._objects(slice(0, len(self)))

    def _objects(self, rows: slice) -> Iterator[SegmentGeometry]:
        path = self.path
        for row, curve, kind, waypoint, segment, joints, time, bound, margin, fraction in zip(
            range(len(self))[rows],
            path.curves.objects(rows),
            self.kinds[rows].tolist(),
            self.waypoints[rows],
            self.segments[rows],
            self.joints[rows].tolist(),
            self.times[rows].tolist(),
            self.speed_bounds[rows],
            self.tightest_margins[rows],
            self.unblended_fractions[rows].tolist(),
            strict=True,
        ):
            yield SegmentGeometry(
                index=self.begin + row,
                kind=_KINDS[kind],
                waypoint=waypoint,
                segment=segment,
                curve=curve,
                joints=vector6(joints),
                time=time if time == time else None,
                speed_bound=bound,
                tightest_margin=margin,
                blend_before=path.blend(row - 1),
                blend_after=path.blend(row),
                u_join=float(path.u_join[row]),
                u_leave=float(path.u_leave[row]),
                unblended_fraction=fraction,
                waits=self.waits and row == 0,
            )
