# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A segment while it is planned: first its geometry, then its timing."""

from __future__ import annotations

from dataclasses import dataclass

from ur_cartesian_driver.motion.goal import Segment, SegmentType, Waypoint
from ur_cartesian_driver.motion.primitive import Joints
from ur_cartesian_driver.planning.geometry.blend import Blend
from ur_cartesian_driver.planning.geometry.curves import SegmentCurve
from ur_cartesian_driver.planning.geometry.speed_profile import SpeedProfile
from ur_cartesian_driver.planning.preflight.tightest_margins import TightestMargin


@dataclass(frozen=True, slots=True)
class JointSpeedBound:
    """The time of a segment at the speed limits of the joints."""

    #: At the rate of the sample where the joints are fastest [s].
    time: float
    #: The leading joint there, and the fraction of the segment.
    joint: int
    fraction: float
    #: At the rate of the sample where they are slowest; with some joint at its limit everywhere.
    shortest_time: float
    time_at_limits: float


@dataclass(frozen=True, slots=True, kw_only=True)
class SegmentGeometry:
    """A segment with its curve and joints, still without speed."""

    index: int
    #: The type that is sent: AUTO resolved, JOINT where that replaces a line or an arc.
    kind: SegmentType
    waypoint: Waypoint
    segment: Segment
    curve: SegmentCurve
    #: Configuration at the end [rad].
    joints: Joints
    #: What limits its speed, and its distance from singularities and joint limits.
    speed_bound: JointSpeedBound
    tightest_margin: TightestMargin
    #: Time from the goal [s]; None = by speed.
    time: float | None
    #: The blends at its ends; None = it is at rest there.
    blend_before: Blend | None = None
    blend_after: Blend | None = None
    #: The ``u`` where the curve is joined after the blend before, and left for the blend after.
    u_join: float = 0.0
    u_leave: float = 1.0
    #: The fraction of it between its blends; blends that touch leave nearly nothing.
    unblended_fraction: float = 1.0
    #: Whether the arm stands there already, and waits until its time.
    waits: bool = False


@dataclass(slots=True)
class SegmentTiming:
    """The speed of one segment over time; its blends change it until it is returned."""

    #: What the wire carries; ``wire_time`` 0 = speed and acceleration count.
    velocity: float
    acceleration: float
    #: The speed profile of its leading quantity between the blends.
    profile: SpeedProfile
    #: Where speed or time come from, for the report.
    source: str
    #: On a change that the limits made; empty = none.
    remark: str
    wire_time: float = 0.0
    #: Expected time, half of each blend included [s]; 0 until the blends are timed.
    duration: float = 0.0
    #: Time in the blend after it [s], 0 without one.
    blend_time: float = 0.0
    #: Bounds of the time, whatever the law by which the robot passes its blends [s].
    least_time: float = 0.0
    greatest_time: float = 0.0
