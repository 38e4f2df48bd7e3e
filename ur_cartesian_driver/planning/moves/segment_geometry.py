# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""What the planner knows of one segment: its way first, then how fast it goes."""

from __future__ import annotations

from dataclasses import dataclass

from ur_cartesian_driver.motion.goal import Segment, SegmentType, Waypoint
from ur_cartesian_driver.motion.primitive import Joints
from ur_cartesian_driver.planning.geometry.blend import Blend
from ur_cartesian_driver.planning.geometry.curves import SegmentCurve
from ur_cartesian_driver.planning.geometry.speed_profile import SpeedProfile
from ur_cartesian_driver.planning.preflight.margins import TightestMargin


@dataclass(frozen=True, slots=True)
class JointSpeedBound:
    """How long the joints need for a segment, each of them at its limit at the most."""

    #: All of it at the pace of the place where the joints are fastest [s].
    time: float
    #: The number of the joint, and where on the segment.
    joint: int
    fraction: float
    #: The same of the place where they are slowest, and with some joint at its limit everywhere.
    shortest_time: float
    time_at_limits: float


@dataclass(frozen=True, slots=True, kw_only=True)
class SegmentGeometry:
    """A segment whose way is decided and whose speed is not."""

    index: int
    #: What will be sent: AUTO resolved, JOINT where a posture cannot be reached otherwise.
    kind: SegmentType
    waypoint: Waypoint
    segment: Segment
    curve: SegmentCurve
    #: Configuration at the end [rad].
    joints: Joints
    #: What the joints and the singularities say about it.
    speed_bound: JointSpeedBound
    tightest_margin: TightestMargin
    #: Time that the goal gives it [s]; None = speeds decide.
    time: float | None
    #: The corners at its ends; None = it stands there.
    blend_before: Blend | None = None
    blend_after: Blend | None = None
    #: Where the path is joined after the corner before, and left for the corner after.
    u_join: float = 0.0
    u_leave: float = 1.0
    #: The part of it between its corners; blends that touch leave nearly nothing.
    unblended_fraction: float = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class SegmentTiming:
    """How fast one leg goes."""

    #: What the wire carries; ``wire_time`` 0 = speed and acceleration count.
    velocity: float
    acceleration: float
    wire_time: float
    #: The leading quantity, its unit, and the motion between the corners.
    unit: str
    profile: SpeedProfile
    #: Expected time, half of each corner included [s].
    duration: float
    #: Time in the corner after it [s], 0 without one.
    blend_time: float = 0.0
    #: Where speed or time come from, for the report.
    source: str = ''
    #: What was changed, empty if nothing.
    remark: str = ''
