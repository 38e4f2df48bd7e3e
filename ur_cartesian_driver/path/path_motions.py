# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The motions of a path: their targets and speeds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from math import nan, tau
from typing import Any, Self, TypeAlias

from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.geometry.pose import multiply, Pose, Quaternion, rotate
from ur_cartesian_driver.motion.geometry.vectors import add, Vector6
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import (
    ArcMode,
    FreeAxis,
    Goal,
    Segment,
    SegmentType,
    Waypoint,
)
from ur_cartesian_driver.path.centre_line import arc, turned
from ur_cartesian_driver.path.path_numbers import (
    amount,
    any_number,
    posture_near,
    six_numbers,
    to_nanoseconds,
    unit_quaternion,
    vector,
)
from ur_cartesian_driver.path.path_points import (
    Feed,
    MotionOptions,
    PathPoint,
    point_fields,
    SAME_ANGLE,
    SAME_POSITION,
    with_fields,
)

#: A place: a position x y z [m], or a pose.
Place: TypeAlias = Sequence[float] | Pose

#: For a spline point: a twist or an acceleration that the driver chooses to fit the neighbours.
FREE: Vector6 = (nan,) * 6

#: Larger coordinates [m], blends [m] and durations [s] must be mistakes, mostly of the unit. The
#: bound is larger in frames other than the base, which may be far from the robot.
MAX_COORDINATE_OF_BASE = 3.0
MAX_COORDINATE = 50.0
MAX_BLEND = 0.5
MAX_DURATION = 3600.0
#: The units of speeds, and the largest speed and acceleration of a motion for each unit.
_TOOL, _JOINTS, _FRACTION = 'm/s', 'rad/s', 'of the limits of the robot'
_MAX_SPEED = {_TOOL: (5.0, 100.0), _JOINTS: (20.0, 200.0), _FRACTION: (1.0, 1.0)}

#: The name of the start in refusals.
_START = 'start'
_BASE_FRAMES = ('', 'base', 'base_link')
_JOINT_TYPES = (SegmentType.JOINT, SegmentType.OPTIMIZED_JOINT)
_OPTIMIZED_TYPES = (SegmentType.OPTIMIZED_LINEAR, SegmentType.OPTIMIZED_JOINT)
_FREE_AXES = {axis.name.lower(): axis for axis in FreeAxis if axis}
#: Segment fields for which the methods have parameters; all others are given by field name.
_OWN_WORDS = {
    *('type', 'blend_radius', 'dwell', 'velocity', 'acceleration'),
    *('via', 'via_posture', 'arc_mode', 'free_axis', 'free_min', 'free_max'),
}
_BY_NAME = {
    'line': SegmentType.LINEAR,
    'joint': SegmentType.JOINT,
    'process': SegmentType.PROCESS,
}


@dataclass(frozen=True, slots=True, init=False, repr=False)
class PathOfMotions:
    """A path that motions are added to; see :class:`~.path_builder.Path`."""

    frame: str
    tool: str
    #: The start, as a point to which no motion leads.
    _start: PathPoint | None
    _points: tuple[PathPoint, ...]
    _feed: Feed
    #: A goal without points, with the settings of the whole path.
    _settings: Goal

    def __init__(
        self,
        start: Place | None = None,
        orientation: Quaternion | None = None,
        *,
        frame: str = 'base',
        tool: str = '',
    ) -> None:
        """
        Begin a path.

        :param start: the pose of the tool when the path begins; None = not known.
        :param frame: the frame of all poses, like ``header.frame_id`` of a goal.
        :param tool: the controlled frame; empty = the robot's active TCP.
        :raises InvalidGoal: a name is not a text, or the start is not a pose or is too far away.
        """
        for name, value in (('frame', frame), ('tool', tool)):
            if not isinstance(value, str):
                raise InvalidGoal(name, f'is {value!r:.60}', 'give its name; transformed() places')
            object.__setattr__(self, name, value)
        self._set(_start=None, _points=(), _feed=Feed(), _settings=Goal(waypoints=()))
        if start is not None:
            pose = self._pose(_START, start, orientation)
            self._set(_start=PathPoint(waypoint=Waypoint(pose=pose), auto_blend=True))

    def _set(self, **values: Any) -> None:
        for name, value in values.items():
            object.__setattr__(self, name, value)

    def _with(self, **changes: Any) -> Self:
        """Return this path with other values in some of its fields."""
        path = object.__new__(type(self))
        path._set(**{each.name: getattr(self, each.name) for each in fields(self)} | changes)
        return path

    def _with_settings(self, where: str, **fields: Any) -> Self:
        """
        Return the path with other values in some fields of its goal.

        :raises InvalidGoal: a field cannot have the value.
        """
        return self._with(_settings=with_fields(where, self._settings, fields))

    def __repr__(self) -> str:
        return f'<Path of {len(self)} points in frame {self.frame or "base"!r}>'

    def __len__(self) -> int:
        return len(self._points)

    # ---- poses ---------------------------------------------------------------------------------

    @property
    def start(self) -> Pose | None:
        """The pose at which the path begins; None if it is not known."""
        return None if self._start is None else self._start.pose

    @property
    def end(self) -> Pose | None:
        """The pose of the last point, or the start if there are no points."""
        return self._points[-1].pose if self._points else self.start

    @property
    def poses(self) -> tuple[Pose, ...]:
        """The poses of all points, without the start."""
        return tuple(point.pose for point in self._points)

    @property
    def starts_with_joint_motion(self) -> bool:
        """Whether the first motion is a joint motion, which can begin wherever the arm is."""
        return bool(self._points) and self._points[0].segment.type in _JOINT_TYPES

    # ---- settings of the motions that follow ---------------------------------------------------

    def at(
        self,
        *,
        speed: float | None = None,
        acceleration: float | None = None,
        blend: float | None = None,
        joint_speed: float | None = None,
        joint_acceleration: float | None = None,
        turn_speed: float | None = None,
        turn_acceleration: float | None = None,
        **fields: Any,
    ) -> Self:
        """
        Set speeds and blends of the motions that follow, like a feed rate; None = as before.

        :param speed: speed of the tool on lines, arcs and PROCESS motions [m/s]; ``acceleration``:
            likewise [m/s^2].
        :param blend: blend radius at each point [m]; 0 = stop there.
        :param joint_speed: speed of the leading axis in joint motions [rad/s];
            ``joint_acceleration``: likewise [rad/s^2].
        :param turn_speed: speed of the tool in motions that only turn it [rad/s];
            ``turn_acceleration``: likewise [rad/s^2].
        :param fields: other fields of a segment, by their names in ``MotionSegment``.
        :raises InvalidGoal: a value is negative, or looks like millimetres or degrees.
        """
        where = f'at() after {len(self)} points'
        given: dict[str, Any] = {
            name: number
            for name, value, bound, hint in (
                ('speed', speed, _MAX_SPEED[_TOOL][0], 'm/s'),
                ('acceleration', acceleration, _MAX_SPEED[_TOOL][1], 'm/s^2'),
                ('blend', blend, MAX_BLEND, 'm'),
                ('joint_speed', joint_speed, _MAX_SPEED[_JOINTS][0], 'rad/s'),
                ('joint_acceleration', joint_acceleration, _MAX_SPEED[_JOINTS][1], 'rad/s^2'),
                ('turn_speed', turn_speed, _MAX_SPEED[_JOINTS][0], 'rad/s'),
                ('turn_acceleration', turn_acceleration, _MAX_SPEED[_JOINTS][1], 'rad/s^2'),
            )
            if (number := amount(where, name, value, bound, hint)) is not None
        }
        path = self._with_segment(self._segment(where, fields))
        path = path._with(_feed=replace(path._feed, **given))
        start = path._start
        if start is None or self._points or 'blend' not in given:
            return path
        segment = replace(start.segment, blend_radius=given['blend'])  # for reversed()
        start = replace(start, segment=segment, feed_blend=True, auto_blend=False)
        return path._with(_start=start)

    def _with_segment(self, segment: Segment) -> Self:
        """Return the path with other segment fields for the motions that follow."""
        start = self._start
        if start is not None and not self._points:  # for reversed()
            own = {**point_fields(segment), 'blend_radius': start.segment.blend_radius}
            start = replace(start, segment=replace(start.segment, **own))
        return self._with(_feed=replace(self._feed, segment=segment), _start=start)

    def free(self, axis: str | None, low: float | None = None, high: float | None = None) -> Self:
        """
        Free an axis of the tool at the points that follow: the driver chooses the turn about it.

        :param axis: ``x``, ``y`` or ``z``; None = no axis is free any longer.
        :param low: least rotation from the orientation of each point [rad]; ``high``: greatest
            rotation. If neither is given, any rotation is allowed.
        :raises InvalidGoal: there is no such axis, or the range is empty or too large.
        """
        where = f'free() after {len(self)} points'
        if axis is not None and axis not in _FREE_AXES:
            raise InvalidGoal(where, f'has the axis {axis!r:.60}', 'use x, y, z or None')
        if (low is None) != (high is None) or (axis is None and low is not None):
            raise InvalidGoal(where, 'has half a range, or one of no axis', 'give both, or none')
        least = 0.0 if low is None else any_number(where, 'low', low)
        greatest = 0.0 if high is None else any_number(where, 'high', high)
        if low is not None and not (
            -tau <= least <= greatest <= tau and 0.0 < greatest - least <= tau
        ):
            raise InvalidGoal(
                where,
                f'has the range {least:g} to {greatest:g} rad',
                'give it in radians, of at most a full turn; deg() converts',
            )
        segment = replace(
            self._feed.segment,
            free_axis=FreeAxis.NONE if axis is None else _FREE_AXES[axis],
            free_min=least,
            free_max=greatest,
        )
        return self._with_segment(segment)

    # ---- motions -------------------------------------------------------------------------------

    def line(
        self,
        place: Place,
        orientation: Quaternion | None = None,
        *,
        blend: float | None = None,
        speed: float | None = None,
        acceleration: float | None = None,
        duration: float | None = None,
        posture: Mapping[str, float] | None = None,
        optimized: bool = False,
        **fields: Any,
    ) -> Self:
        """
        Add a straight line.

        :param place: the end of the line: a pose, or a position [m].
        :param orientation: orientation at the end of the line; None = as in the pose, or at the
            point before.
        :param blend: replaces the blend of :meth:`at`; likewise ``speed`` and ``acceleration``.
        :param duration: duration of this motion [s]; in a path, either all motions have one, or
            none has.
        :param posture: joint positions near which the arm is to arrive, by joint name [rad].
        :param optimized: use optimovel; speed and acceleration are then fractions of the limits.
        :param fields: other fields of the segment, by their names in ``MotionSegment``.
        :raises InvalidGoal: a value is missing, is out of its range or contradicts another one.
        """
        kind = SegmentType.OPTIMIZED_LINEAR if optimized else SegmentType.LINEAR
        options = MotionOptions(blend, speed, acceleration, duration, posture, fields)
        return self._move(kind, place, orientation, options)

    def joint(
        self,
        place: Place,
        orientation: Quaternion | None = None,
        *,
        blend: float | None = None,
        speed: float | None = None,
        acceleration: float | None = None,
        duration: float | None = None,
        posture: Mapping[str, float] | None = None,
        optimized: bool = False,
        **fields: Any,
    ) -> Self:
        """
        Add a joint motion, on which the tool does not move straight; otherwise like :meth:`line`.

        ``speed`` and ``acceleration`` belong to the leading axis [rad/s], [rad/s^2].
        """
        kind = SegmentType.OPTIMIZED_JOINT if optimized else SegmentType.JOINT
        options = MotionOptions(blend, speed, acceleration, duration, posture, fields)
        return self._move(kind, place, orientation, options)

    def process(
        self,
        place: Place,
        orientation: Quaternion | None = None,
        *,
        blend: float | None = None,
        speed: float | None = None,
        acceleration: float | None = None,
        duration: float | None = None,
        posture: Mapping[str, float] | None = None,
        **fields: Any,
    ) -> Self:
        """
        Add a straight line at constant speed (movep); parameters as for :meth:`line`.

        If no blend is given, the motion gets one of about 2 mm, because the arm would otherwise
        stop at its point; ``blend=0`` means a stop. An arc before it gets such a blend, too.
        """
        options = MotionOptions(blend, speed, acceleration, duration, posture, fields)
        return self._move(SegmentType.PROCESS, place, orientation, options)

    def arc(
        self,
        place: Place,
        orientation: Quaternion | None = None,
        *,
        via: Place,
        follow: bool = False,
        blend: float | None = None,
        speed: float | None = None,
        acceleration: float | None = None,
        duration: float | None = None,
        posture: Mapping[str, float] | None = None,
        via_posture: Mapping[str, float] | None = None,
        **fields: Any,
    ) -> Self:
        """
        Add an arc through a point on the way; other parameters as for :meth:`line`.

        :param via: a position on the arc, or a pose (whose orientation is only used with
            ``via_posture``).
        :param follow: turn the tool with the arc, so that it keeps its angle to the tangent; the
            orientation at the end follows from that.
        :raises InvalidGoal: the three points make no arc.
        """
        where = self._where('arc')
        if follow and (orientation is not None or isinstance(place, Pose)):
            raise InvalidGoal(
                where, 'has an orientation, but the arc turns the tool', 'give the position only'
            )
        if follow and self._feed.segment.free_axis:
            raise InvalidGoal(
                where,
                'turns the tool with the arc, but its axis is free',
                'write free(None) first',
            )
        pose = self._pose(where, place, orientation)
        T_via = self._pose(where, via, pose.quaternion)
        if self.end is not None:
            stroke = arc(self.end, T_via.position, pose)
            if stroke is None:
                raise InvalidGoal(
                    where,
                    'goes through three points of one line, or comes back to its beginning',
                    'move the via off the line; a full circle takes two arcs',
                )
            if follow:
                pose = turned(stroke)
                T_via = Pose(T_via.position, pose.quaternion)
        elif follow:
            raise InvalidGoal(
                where,
                'turns the tool from an orientation that the path does not say',
                'begin the path with a start',
            )
        arc_fields = {
            'via': T_via,
            'via_posture': posture_near(f'{where}: via_posture', via_posture),
            'arc_mode': ArcMode.FIXED if follow else ArcMode.UNCONSTRAINED,
        }
        options = MotionOptions(blend, speed, acceleration, duration, posture, fields)
        return self._move(SegmentType.CIRCULAR, pose, None, options, arc_fields)

    def spline(
        self,
        place: Place,
        orientation: Quaternion | None = None,
        *,
        duration: float,
        twist: Sequence[float] = FREE,
        acceleration: Sequence[float] = FREE,
        posture: Mapping[str, float] | None = None,
        **fields: Any,
    ) -> Self:
        """
        Add a point of a spline; if a path has such points, it has no others.

        :param duration: time from the point before [s].
        :param twist: linear [m/s] and angular [rad/s] velocity at the point, in the frame of the
            path, or the linear one alone; NaN = the driver chooses, 0 = the arm stops.
        :param acceleration: likewise [m/s^2], [rad/s^2].
        :raises InvalidGoal: as for :meth:`line`, or the path has other motions.
        """
        where = self._where('spline')
        if self._points and not self._points[-1].in_spline:
            raise mixed_spline(where)
        waypoint = Waypoint(
            pose=self._pose(where, place, orientation),
            twist=six_numbers(f'{where}: twist', twist),
            acceleration=six_numbers(f'{where}: acceleration', acceleration),
            posture=posture_near(f'{where}: posture', posture),
        )
        point = PathPoint(
            waypoint=waypoint,
            segment=self._segment(where, fields),
            duration=self._nanoseconds(where, duration),
            in_spline=True,
        )
        settings = self._settings
        if settings.execution is ExecutionMode.AUTO:
            settings = replace(settings, execution=ExecutionMode.SPLINE)
        return self._with(_points=(*self._points, point), _settings=settings)

    def by(
        self,
        dx: float = 0.0,
        dy: float = 0.0,
        dz: float = 0.0,
        *,
        turn: Quaternion | None = None,
        of_tool: bool = False,
        motion: str = 'line',
        blend: float | None = None,
        speed: float | None = None,
        acceleration: float | None = None,
        duration: float | None = None,
        posture: Mapping[str, float] | None = None,
        **fields: Any,
    ) -> Self:
        """
        Add a motion by a distance [m] and a turn from the last point, or else from the start.

        :param turn: a rotation, made by :func:`~.orientations.axis_angle` for example.
        :param of_tool: whether distance and turn are along the axes of the tool, not of the frame.
        :param motion: ``line``, ``process`` or ``joint``; the other parameters are as for the
            method of this name.
        :raises InvalidGoal: as for :meth:`line`, or the path has neither a point nor a start.
        """
        if motion not in _BY_NAME:
            raise InvalidGoal(
                self._where('by'), f'has the motion {motion!r}', f'use {", ".join(_BY_NAME)}'
            )
        where, here = self._where(motion), self.end
        if here is None:
            raise InvalidGoal(where, 'is relative, but the path has no start', 'write Path(start)')
        step = vector(where, (dx, dy, dz), MAX_COORDINATE_OF_BASE, 'd')
        q = here.quaternion
        turned_q = q
        if turn is not None:
            turn = unit_quaternion(where, turn)
            turned_q = multiply(q, turn) if of_tool else multiply(turn, q)
        there = add(here.position, rotate(q, step) if of_tool else step)
        options = MotionOptions(blend, speed, acceleration, duration, posture, fields)
        return self._move(_BY_NAME[motion], Pose(there, turned_q), None, options)

    # ---- inside --------------------------------------------------------------------------------

    @property
    def _end(self) -> Pose:
        assert self.end is not None
        return self.end

    def _where(self, kind: str) -> str:
        return f'point {len(self)} ({kind})'

    def _pose(self, where: str, place: Place, orientation: Quaternion | None) -> Pose:
        """Return a pose; ``orientation`` None = that of ``place``, or else of the last point."""
        before = place if isinstance(place, Pose) else self.end
        position = place.position if isinstance(place, Pose) else place
        if orientation is None:
            if before is None and where == _START:
                raise InvalidGoal(where, 'has no orientation', 'write Path(position, orientation)')
            if before is None:
                raise InvalidGoal(
                    where, 'has no orientation, and there is none before', 'give one, or a start'
                )
            orientation = before.quaternion
        is_base = self.frame in _BASE_FRAMES
        bound = MAX_COORDINATE_OF_BASE if is_base else MAX_COORDINATE
        return Pose(vector(where, position, bound), unit_quaternion(where, orientation))

    def _move(
        self,
        kind: SegmentType,
        place: Place,
        orientation: Quaternion | None,
        options: MotionOptions,
        arc_fields: Mapping[str, Any] | None = None,
    ) -> Self:
        name = {SegmentType.CIRCULAR: 'arc'}.get(kind, kind.name.lower().split('_')[-1])
        where = self._where('line' if name == 'linear' else name)
        if self._points and self._points[-1].in_spline:
            raise mixed_spline(where)
        pose, here = self._pose(where, place, orientation), self.end
        moved = here is None or here.distance_to(pose) > SAME_POSITION
        if not moved and not options.posture and kind is not SegmentType.JOINT:
            assert here is not None
            if here.angle_to(pose) <= SAME_ANGLE and (self._points or not options.duration):
                raise InvalidGoal(
                    where, 'is where the tool is before: it has no distance to go', 'leave it out'
                )
        duration = self._nanoseconds(where, options.duration)
        velocity, acceleration = self._rates(where, kind, options, moved, bool(duration))
        blend = amount(where, 'blend', options.blend, MAX_BLEND, 'm')
        feed_blend = blend is None and self._feed.blend is not None
        blend = self._feed.blend if blend is None else blend
        point = PathPoint(
            waypoint=Waypoint(
                pose=pose, posture=posture_near(f'{where}: posture', options.posture)
            ),
            segment=replace(
                self._segment(where, options.fields),
                type=kind,
                blend_radius=blend or 0.0,
                velocity=velocity,
                acceleration=acceleration,
                **(arc_fields or {}),
            ),
            duration=duration,
            feed_blend=feed_blend,
            auto_blend=blend is None and kind in (SegmentType.PROCESS, SegmentType.CIRCULAR),
        )
        return self._with(_points=(*self._points, point))

    def _segment(self, where: str, fields: Mapping[str, Any]) -> Segment:
        """Return the segment of a motion from the fields that are given by name."""
        if own := _OWN_WORDS & set(fields):
            raise TypeError(f'{where} has a word of its own for the field {min(own)}')
        return with_fields(where, self._feed.segment, fields) if fields else self._feed.segment

    def _rates(
        self, where: str, kind: SegmentType, options: MotionOptions, moved: bool, timed: bool
    ) -> tuple[float, float]:
        """Return speed and acceleration of a motion, in the units of its type."""
        feed = self._feed
        unit, word, usual = _TOOL, 'speed', (feed.speed, feed.acceleration)
        if kind in _OPTIMIZED_TYPES:
            unit, usual = _FRACTION, (0.0, 0.0)
        elif kind is SegmentType.JOINT:
            unit, word = _JOINTS, 'joint_speed'
            usual = (feed.joint_speed, feed.joint_acceleration)
        elif not moved:
            unit, word, usual = _JOINTS, 'turn_speed', (feed.turn_speed, feed.turn_acceleration)
        bounds = _MAX_SPEED[unit]
        speed = amount(where, 'speed', options.speed, bounds[0], unit)
        acceleration = amount(where, 'acceleration', options.acceleration, bounds[1], unit)
        is_own = speed is not None
        speed = usual[0] if speed is None else speed
        if timed and kind in _OPTIMIZED_TYPES:
            raise InvalidGoal(
                where,
                'has a duration, which an optimized motion cannot keep',
                'leave out the duration or optimized',
            )
        if timed and speed:
            remedy = 'give one of them' if is_own else f'at({word}=0) before it unsets the speed'
            raise InvalidGoal(where, 'has a duration and a speed', remedy)
        return speed, usual[1] if acceleration is None else acceleration

    def _nanoseconds(self, where: str, duration: float | None) -> int:
        if duration is None:
            if self._points and self._points[-1].duration:
                raise InvalidGoal(
                    where,
                    'has no duration, but the motions before have',
                    'give one to each motion, or to none',
                )
            return 0
        if self._points and not self._points[-1].duration:
            raise InvalidGoal(
                where,
                'has a duration, but the motions before have none',
                'give one to each motion, or to none',
            )
        time = to_nanoseconds(where, amount(where, 'duration', duration, MAX_DURATION, 's'))
        if not time:
            raise InvalidGoal(where, 'has a duration of 0', 'give the motion some time')
        return time


def mixed_spline(where: str) -> InvalidGoal:
    return InvalidGoal(
        where,
        'mixes spline points with other motions, but a spline joins all points of a path',
        'make two paths, or use spline() for every point',
    )
