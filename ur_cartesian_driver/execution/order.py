# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""What the machine is told of a goal: less than the plan, as it crosses to another process."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ur_cartesian_driver.motion.goal import ExecutionMode, Tolerance
from ur_cartesian_driver.motion.joint_spline import JointSpline
from ur_cartesian_driver.motion.plan import Plan, ReferencePath
from ur_cartesian_driver.motion.pose import IDENTITY, Pose
from ur_cartesian_driver.motion.primitive import OptimoveJ, OptimoveL, Spline, SwitchOutput
from ur_cartesian_driver.protocol.dialects import Dialect, NEWEST


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Order:
    """What of a plan the machine needs; small to send to another process."""

    #: How many records there are on the wire: motions and outputs.
    points: int
    reference: ReferencePath
    #: Expected time at full speed [s].
    duration: float
    #: When the last point is due [s]; None where the goal names no times.
    due: float | None = None
    T_base_frame: Pose = IDENTITY
    #: The TCP that the plan found, the one that it needs (None = that one), and where the
    #: controlled frame is behind it.
    T_flange_active: Pose = IDENTITY
    T_flange_tcp: Pose | None = None
    T_tcp_controlled: Pose = IDENTITY
    path_tolerance: Tolerance = field(default_factory=Tolerance)
    goal_tolerance: Tolerance = field(default_factory=Tolerance)
    #: 0 = the default, negative = without end [s].
    goal_time_tolerance: float = 0.0
    #: Whether the robot program tells how many points it has begun; if not, nobody looks there.
    reports_begun: bool = True
    #: Whether the plan knows its speeds: not those of OPTIMIZED moves.
    knows_pace: bool = True
    execution: ExecutionMode = ExecutionMode.PRIMITIVES
    #: (records,) the waypoint of the goal that each record leads to, or belongs to; empty = each
    #: record is the motion to the waypoint of its number.
    waypoint: NDArray[np.int32] = field(default_factory=lambda: np.empty(0, dtype=np.int32))
    #: (records,) which of them are motions: these the robot program counts; empty = all.
    is_motion: NDArray[np.bool_] = field(default_factory=lambda: np.empty(0, dtype=np.bool_))
    #: SERVO: the joints over time.
    spline: JointSpline | None = None


def order_of(plan: Plan, dialect: Dialect = NEWEST) -> Order:
    """Return what of a plan the machine needs, for a robot program of this dialect."""
    goal = plan.goal
    times = goal.waypoints[-1].time
    waypoints = [segment.waypoint for segment in plan.segments
                 for _ in range(1 + len(segment.outputs))]
    pieces = [segment.primitive for segment in plan.segments
              if isinstance(segment.primitive, Spline)]
    return Order(
        points=len(waypoints), reference=plan.reference, duration=plan.duration,
        due=times if times > 0.0 else None, T_base_frame=goal.T_base_frame,
        T_flange_active=plan.T_flange_active, T_flange_tcp=plan.T_flange_tcp,
        T_tcp_controlled=plan.T_tcp_controlled,
        path_tolerance=goal.path_tolerance, goal_tolerance=goal.goal_tolerance,
        goal_time_tolerance=goal.goal_time_tolerance,
        reports_begun=dialect is NEWEST,
        knows_pace=not any(isinstance(segment.primitive, OptimoveJ | OptimoveL)
                           for segment in plan.segments),
        execution=plan.execution, waypoint=np.array(waypoints, dtype=np.int32),
        is_motion=np.array([not isinstance(instruction, SwitchOutput)
                            for instruction in plan.instructions]),
        spline=JointSpline.of(plan.start, pieces)
        if plan.execution is ExecutionMode.SERVO else None)
