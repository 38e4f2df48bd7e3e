# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The points of a path, and how they change when the path is moved or reversed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import isnan
from typing import Any, TypeVar

from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.geometry.pose import Pose, Quaternion, rotate
from ur_cartesian_driver.motion.geometry.vectors import add, Vector3, Vector6, vector6, ZERO6
from ur_cartesian_driver.motion.goal.declared_types import with_declared_types, WrongType
from ur_cartesian_driver.motion.goal.field_annotations import goal_fields
from ur_cartesian_driver.motion.goal.goal import ArcMode, Goal, Segment, Waypoint
from ur_cartesian_driver.motion.state.rigid_body import acceleration_at, twist_at
from ur_cartesian_driver.planning.request.field_rules import check_record

T = TypeVar('T')

#: Poses that differ by no more than this count as the same [m], [rad].
SAME_POSITION, SAME_ANGLE = 1e-6, 1e-6
#: Two axes count as perpendicular up to this cosine of the angle between them.
_ALIGNED = 1e-12
#: The fields of a waypoint that are rates, which are derivatives of its pose over time.
RATES = ('twist', 'acceleration', 'jerk')


@dataclass(frozen=True, slots=True, kw_only=True)
class Feed:
    """
    Settings of a path's motions, which hold until they are changed [m, rad, s].

    A value of 0 selects the driver's default.
    """

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
    #: The events that happen or begin here; their waypoint indices count from this point. If an
    #: event covers several points, a last waypoint of 0 means that its end is not given yet.
    events: tuple[Any, ...] = ()
    #: Whether the blend comes from the :class:`Feed`, not from the motion; if so, the last point
    #: of a path gets no blend.
    feed_blend: bool = False
    #: Whether the driver chooses the blend when the path becomes a goal.
    auto_blend: bool = False
    #: Whether a spline leads to the point.
    in_spline: bool = False

    @property
    def pose(self) -> Pose:
        """The pose of the point."""
        return self.waypoint.pose


@dataclass(frozen=True, slots=True)
class MotionOptions:
    """Settings given for one motion, except its target; None = not given, see :class:`Feed`."""

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

    :param where: the name of the goal or segment in error messages.
    :raises InvalidGoal: a field does not accept its new value.
    """
    kind: type[T] = type(record)
    try:
        changed = with_declared_types(replace(record, **fields), kind, where)  # type: ignore[type-var]  # a dataclass
    except WrongType as error:
        raise InvalidGoal(error.field, error.problem) from None
    check_record(where, changed)
    return changed


def point_fields(segment: Segment) -> dict[str, Any]:
    """Return the names and values of a segment's fields that concern only its end point."""
    return {
        each.name: getattr(segment, each.name) for each in goal_fields(Segment) if each.is_of_point
    }


def moved(point: PathPoint, T: Pose, where: str) -> PathPoint:
    """
    Return a point moved by ``T``: poses become ``T @ pose``, and rates turn with ``T``.

    :param where: the name of the operation in error messages.
    :raises InvalidGoal: a rate has both free (NaN) and given components, which the rotation would
        mix.
    """
    waypoint, via = point.waypoint, point.segment.via
    rates: dict[str, Any] = {
        name: _turned(getattr(waypoint, name), T.quaternion, where, name) for name in RATES
    }
    return replace(
        point,
        waypoint=replace(waypoint, pose=T @ waypoint.pose, **rates),
        segment=point.segment if via is None else replace(point.segment, via=T @ via),
    )


def _turned(rates: Vector6, q: Quaternion, where: str, name: str) -> Vector6:
    if rates == ZERO6:
        return rates
    x, y, z, a, b, c = rates
    return (*_rotated(q, (x, y, z), where, name), *_rotated(q, (a, b, c), where, name))


def _rotated(q: Quaternion, v: Vector3, where: str, name: str) -> Vector3:
    """Return a rotated vector; NaN stands for a component that the driver chooses."""
    if not any(map(isnan, v)):
        return rotate(q, v)
    axes = [rotate(q, axis) for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))]
    rotated = []
    for i in range(3):
        parts = [(axis[i], x) for axis, x in zip(axes, v, strict=True) if abs(axis[i]) > _ALIGNED]
        free = [isnan(x) for _, x in parts]
        if any(free) and not all(free):
            raise InvalidGoal(
                where,
                f'turns a {name} of which only some components are given',
                'give all of its linear and all of its angular components, or none',
            )
        rotated.append(sum(factor * x for factor, x in parts))
    x, y, z = rotated
    return (x, y, z)


def seen_from(
    point: PathPoint,
    T_tool_new: Pose,
    before: Pose | None,
    after: Pose | None,
    where: str,
    *,
    quintic: bool,
) -> PathPoint:
    """
    Convert a point given for the tool to the point for another frame on the tool.

    :param T_tool_new: the pose of the other frame in the frame of the tool.
    :param before: the pose of the preceding point or start; None = not known.
    :param after: the pose of the following point; None = there is none.
    :param where: the name of the operation in error messages.
    :param quintic: whether the points of the path give accelerations; if not, the acceleration
        stays 0, which means that none is given.
    :raises InvalidGoal: the tool turns on an arc, so that the other frame leaves the arc; or the
        driver chooses how the tool turns at a point of a spline, so that the other frame's speed
        is not known.
    """
    waypoint, segment = point.waypoint, point.segment
    offset = rotate(waypoint.pose.quaternion, T_tool_new.position)
    turns = before is None or before.angle_to(waypoint.pose) > SAME_ANGLE
    if segment.via is not None:
        if turns or segment.arc_mode is ArcMode.FIXED:
            raise InvalidGoal(
                where, 'turns the tool on an arc, which is none beside it', 'use a spline'
            )
        via = Pose(add(segment.via.position, offset), segment.via.quaternion)
        segment = replace(segment, via=via)
    turns = turns or (after is not None and after.angle_to(waypoint.pose) > SAME_ANGLE)
    twist, acceleration = waypoint.twist, waypoint.acceleration
    turn, turn_change = (_turn_of(rates, turns) for rates in (twist, acceleration))
    new_twist = twist_at((*twist[:3], *turn), offset)
    new_acceleration = acceleration
    if quintic:
        new_acceleration = acceleration_at(
            (*acceleration[:3], *turn_change), (*twist[:3], *turn), offset
        )
    for name, old, new in (
        ('twist', twist, new_twist),
        ('acceleration', acceleration, new_acceleration),
    ):
        if any(isnan(b) and not isnan(a) for a, b in zip(old[:3], new[:3], strict=True)):
            raise InvalidGoal(
                where,
                f'has a linear {name}, but the driver chooses how the tool turns there',
                'give the angular components, too',
            )
    return replace(
        point,
        waypoint=replace(
            waypoint,
            pose=waypoint.pose @ T_tool_new,
            twist=(*new_twist[:3], *twist[3:]),
            acceleration=(*new_acceleration[:3], *acceleration[3:]),
        ),
        segment=segment,
    )


def _turn_of(rates: Vector6, turns: bool) -> Vector3:
    """Return the angular part of rates; free (NaN) components are 0 if the tool does not turn."""
    a, b, c = (x if turns or not isnan(x) else 0.0 for x in rates[3:])
    return (a, b, c)


def backwards(point: Waypoint) -> Waypoint:
    """
    Return a point for the opposite direction of motion.

    Twist and jerk change sign; the acceleration does not.
    """
    return replace(point, twist=_negative(point.twist), jerk=_negative(point.jerk))


def _negative(rates: Vector6) -> Vector6:
    return vector6(0.0 - value for value in rates)  # no -0.0


def is_same(a: Pose, b: Pose) -> bool:
    """Return whether two poses are the same, so that there is no motion between them."""
    return a.distance_to(b) <= SAME_POSITION and a.angle_to(b) <= SAME_ANGLE


def merged(first: Goal, second: Goal) -> Goal:
    """
    Return the goal fields of two joined paths: for each field, the value that is not the default.

    :raises InvalidGoal: the paths set the same field to different values.
    """
    usual, values = Goal(waypoints=()), {}
    for each in goal_fields(Goal):
        mine, its, default = (getattr(x, each.name) for x in (first, second, usual))
        if mine not in (its, default) and its != default:
            raise InvalidGoal('then()', f'joins paths of different {each.name}', 'set it once')
        values[each.name] = its if mine == default else mine
    return Goal(**values)
