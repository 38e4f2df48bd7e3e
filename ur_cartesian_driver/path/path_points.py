# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The points of a path, and how they change when the path is moved or reversed."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from typing import Any

from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.geometry.pose import Pose, Quaternion, rotate
from ur_cartesian_driver.motion.geometry.vectors import add, Vector6, vector6, ZERO6
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import (
    ArcMode,
    FreeAxis,
    InputWait,
    IOCommand,
    OnPathTolerance,
    PathOffset,
    PayloadChange,
    Press,
    ProportionalOutput,
    SafeOutput,
    ScriptCall,
    Segment,
    Tolerance,
    Waypoint,
)
from ur_cartesian_driver.motion.state.rigid_body import acceleration_at, twist_at

#: Poses that are nearer are the same [m], [rad].
SAME_POSITION, SAME_ANGLE = 1e-6, 1e-6
#: What belongs to the point at which a segment ends, not to the motion.
FREE_FIELDS = ('free_axis', 'free_min', 'free_max')
POINT_FIELDS = ('blend_radius', 'dwell', *FREE_FIELDS)


@dataclass(frozen=True, slots=True, kw_only=True)
class Feed:
    """What holds for motions until it is changed; 0 = the driver's parameter."""

    speed: float = 0.0
    acceleration: float = 0.0
    #: None = none, and a small one at PROCESS points.
    blend: float | None = None
    joint_speed: float = 0.0
    joint_acceleration: float = 0.0
    turn_speed: float = 0.0
    turn_acceleration: float = 0.0
    #: As in a segment.
    free_axis: FreeAxis = FreeAxis.NONE
    free_min: float = 0.0
    free_max: float = 0.0

    @property
    def free(self) -> dict[str, Any]:
        """The fields of a segment that let its point turn."""
        return {name: getattr(self, name) for name in FREE_FIELDS}


@dataclass(frozen=True, slots=True, kw_only=True)
class PathPoint:
    """A point, the motion that ends there, and what happens there."""

    waypoint: Waypoint
    segment: Segment = field(default_factory=Segment)
    #: Of the motion [ns]; 0 = by its speed.
    duration: int = 0
    #: With the waypoint 0, whichever point this is.
    outputs: tuple[IOCommand, ...] = ()
    stops: tuple[InputWait | ScriptCall | PayloadChange, ...] = ()
    #: Those that begin here: with the first waypoint 0, and the number of points to their end as
    #: the last one; 0 = not ended yet.
    stretches: tuple[ProportionalOutput | Press, ...] = ()
    #: Whether the blend is that of the feed, which the last point of a path does without, and
    #: whether it is chosen when the path is finished.
    feed_blend: bool = False
    auto_blend: bool = False
    in_spline: bool = False

    @property
    def pose(self) -> Pose:
        """Where it is."""
        return self.waypoint.pose


@dataclass(frozen=True, slots=True, kw_only=True)
class PathSettings:
    """What holds for the whole path."""

    path_tolerance: Tolerance = field(default_factory=Tolerance)
    goal_tolerance: Tolerance = field(default_factory=Tolerance)
    goal_time_tolerance: float = 0.0
    execution: ExecutionMode = ExecutionMode.AUTO
    keep_open: bool = False
    replace_horizon: float = 0.0
    safe_outputs: tuple[SafeOutput, ...] = ()
    on_path_tolerance: OnPathTolerance = OnPathTolerance.ABORT
    stall_timeout: float = 0.0
    min_speed_fraction: float = 0.0
    path_offset: PathOffset = field(default_factory=PathOffset)


@dataclass(frozen=True, slots=True)
class MotionRates:
    """What one motion says about its speed and blend."""

    blend: float | None
    speed: float | None
    acceleration: float | None
    duration: float | None


def moved(point: PathPoint, T: Pose) -> PathPoint:
    """Return a point moved by a pose of its frame."""
    waypoint, via = point.waypoint, point.segment.via
    return replace(
        point,
        waypoint=replace(
            waypoint,
            pose=T @ waypoint.pose,
            twist=_turned(waypoint.twist, T.quaternion),
            acceleration=_turned(waypoint.acceleration, T.quaternion),
            jerk=_turned(waypoint.jerk, T.quaternion),
        ),
        segment=point.segment if via is None else replace(point.segment, via=T @ via),
    )


def _turned(rates: Vector6, q: Quaternion) -> Vector6:
    if rates == ZERO6:
        return rates
    x, y, z, a, b, c = rates
    return (*rotate(q, (x, y, z)), *rotate(q, (a, b, c)))


def seen_from(point: PathPoint, T_tool_new: Pose, before: Pose | None, where: str) -> PathPoint:
    """Return a point at which another frame of the tool is where the tool was."""
    waypoint, segment = point.waypoint, point.segment
    offset = rotate(waypoint.pose.quaternion, T_tool_new.position)
    if segment.via is not None:
        turns = before is None or before.angle_to(waypoint.pose) > SAME_ANGLE
        if turns or segment.arc_mode is ArcMode.FIXED:
            raise InvalidGoal(
                where, 'turns the tool on an arc, which is none beside it', 'use a spline'
            )
        via = Pose(add(segment.via.position, offset), segment.via.quaternion)
        segment = replace(segment, via=via)
    return replace(
        point,
        waypoint=replace(
            waypoint,
            pose=waypoint.pose @ T_tool_new,
            twist=twist_at(waypoint.twist, offset),
            acceleration=acceleration_at(waypoint.acceleration, waypoint.twist, offset),
        ),
        segment=segment,
    )


def backwards(point: Waypoint) -> Waypoint:
    """Return a point passed the other way: speeds and jerks change sign, accelerations do not."""
    return replace(point, twist=_negative(point.twist), jerk=_negative(point.jerk))


def _negative(rates: Vector6) -> Vector6:
    return vector6(0.0 - value for value in rates)  # no -0.0


def is_same(a: Pose, b: Pose) -> bool:
    """Tell whether there is no motion between two poses."""
    return a.distance_to(b) <= SAME_POSITION and a.angle_to(b) <= SAME_ANGLE


def merged(first: PathSettings, second: PathSettings) -> PathSettings:
    """
    Return the settings of two paths as one.

    :raises InvalidGoal: both have chosen, and differ.
    """
    usual, values = PathSettings(), {}
    for each in fields(PathSettings):
        mine, its, default = (getattr(x, each.name) for x in (first, second, usual))
        if mine not in (its, default) and its != default:
            raise InvalidGoal('then()', f'joins paths of different {each.name}', 'set it once')
        values[each.name] = its if mine == default else mine
    return PathSettings(**values)
