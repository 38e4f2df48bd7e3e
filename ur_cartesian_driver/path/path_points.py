# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The points of a path, and how they change when the path is moved or reversed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.geometry.pose import Pose, Quaternion, rotate
from ur_cartesian_driver.motion.geometry.vectors import add, Vector6, vector6, ZERO6
from ur_cartesian_driver.motion.goal.declared_types import with_declared_types, WrongType
from ur_cartesian_driver.motion.goal.field_annotations import goal_fields
from ur_cartesian_driver.motion.goal.goal import ArcMode, Goal, Segment, Waypoint
from ur_cartesian_driver.motion.state.rigid_body import acceleration_at, twist_at
from ur_cartesian_driver.planning.request.field_rules import check_record

T = TypeVar('T')

#: Poses that differ by less than this [m], [rad] are the same.
SAME_POSITION, SAME_ANGLE = 1e-6, 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class Feed:
    """Settings of motions, which hold until they are changed; 0 = the driver's default."""

    speed: float = 0.0
    acceleration: float = 0.0
    #: None = no blend, except a small one before and after PROCESS motions.
    blend: float | None = None
    joint_speed: float = 0.0
    joint_acceleration: float = 0.0
    turn_speed: float = 0.0
    turn_acceleration: float = 0.0
    #: The other segment fields of the motions.
    segment: Segment = field(default_factory=Segment)


@dataclass(frozen=True, slots=True, kw_only=True)
class PathPoint:
    """A point, the motion that ends there, and the events there."""

    waypoint: Waypoint
    segment: Segment = field(default_factory=Segment)
    #: Duration of the motion [ns]; 0 = the speed decides.
    duration: int = 0
    #: The events that happen or begin here, with waypoints numbered as if this were point 0. An
    #: event that has to end, but whose last waypoint is 0, has no end yet.
    events: tuple[Any, ...] = ()
    #: Whether the blend comes from the feed; if so, it is left out at the last point of a path.
    feed_blend: bool = False
    #: Whether the blend is chosen when the path becomes a goal.
    auto_blend: bool = False
    #: Whether a spline leads to the point.
    in_spline: bool = False

    @property
    def pose(self) -> Pose:
        """The pose of the point."""
        return self.waypoint.pose


@dataclass(frozen=True, slots=True)
class MotionOptions:
    """Settings of one motion, except its place."""

    blend: float | None
    speed: float | None
    acceleration: float | None
    duration: float | None
    posture: Mapping[str, float] | None
    #: Other fields of the segment.
    fields: Mapping[str, Any]


def with_fields(where: str, record: T, fields: Mapping[str, Any]) -> T:
    """
    Return a goal or a segment with other values in some of its fields.

    :param where: the name of the goal or segment in a refusal.
    :raises InvalidGoal: a field cannot have the value.
    """
    kind: type[T] = type(record)
    try:
        changed = with_declared_types(replace(record, **fields), kind, where)  # type: ignore[type-var]  # a dataclass
    except WrongType as error:
        raise InvalidGoal(error.field, error.problem) from None
    check_record(where, changed)
    return changed


def point_fields(segment: Segment) -> dict[str, Any]:
    """Return the fields of a segment that belong to the point where it ends."""
    return {
        each.name: getattr(segment, each.name) for each in goal_fields(Segment) if each.is_of_point
    }


def moved(point: PathPoint, T: Pose) -> PathPoint:
    """Return a point with its poses and rates transformed by a pose in its frame."""
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
    """Return a point as passed by another frame on the tool, whose pose is ``T_tool_new``."""
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
    """Return whether two poses are the same, so that there is no motion between them."""
    return a.distance_to(b) <= SAME_POSITION and a.angle_to(b) <= SAME_ANGLE


def merged(first: Goal, second: Goal) -> Goal:
    """
    Return the combined settings of two paths.

    :raises InvalidGoal: the paths set the same field to different values.
    """
    usual, values = Goal(waypoints=()), {}
    for each in goal_fields(Goal):
        mine, its, default = (getattr(x, each.name) for x in (first, second, usual))
        if mine not in (its, default) and its != default:
            raise InvalidGoal('then()', f'joins paths of different {each.name}', 'set it once')
        values[each.name] = its if mine == default else mine
    return Goal(**values)
