# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A segment while it is planned: first its geometry, then its timing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ur_cartesian_driver.motion.goal import Segment, SegmentType, Waypoint
from ur_cartesian_driver.motion.pose_rows import Floats
from ur_cartesian_driver.motion.primitive import Joints
from ur_cartesian_driver.planning.geometry.blended_path import Blend
from ur_cartesian_driver.planning.geometry.curves import SegmentCurve
from ur_cartesian_driver.planning.geometry.samples import Ints
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


@dataclass(frozen=True, slots=True, kw_only=True)
class BlendSamples:
    """The samples in all blends of a goal; columns (n,)."""

    #: The waypoint that the blend rounds, and the parameter half-way to the sample before.
    index: Ints
    s: Floats
    #: For a unit of ``s`` there: time at the joint speed limits [s], with the joint that takes
    #: longest, and distance of the tool [m].
    joint_time: Floats
    joint: NDArray[np.intp]
    tool_distance: Floats


@dataclass(slots=True)
class SegmentTiming:
    """The speed of one segment over time."""

    #: What the wire carries; ``wire_time`` 0 = speed and acceleration count.
    velocity: float
    acceleration: float
    #: Where speed or time come from, for the report.
    source: str
    #: On a change that the limits made; empty = none.
    remark: str
    wire_time: float = 0.0
    #: Expected time from point to point [s]; blended points are passed in the middle of the blend.
    duration: float = 0.0
    #: Bounds of the time, whatever the law by which the robot passes its blends [s].
    least_time: float = 0.0
    greatest_time: float = 0.0
