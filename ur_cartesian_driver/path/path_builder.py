# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
A path of the tool, composed motion by motion.

A :class:`Path` never changes: each method returns a new one. Units are SI (:func:`~.units.mm` and
:func:`~.units.deg` convert), poses are those of the controlled frame in the frame of the path. A
mistake is an :exc:`~ur_cartesian_driver.motion.errors.InvalidGoal` at the line that makes it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from importlib import import_module
from math import nan, tau
import os
from pathlib import Path as FilePath
from typing import Any, TypeAlias

from ur_cartesian_driver.goal_files import (
    fields_of_goal,
    goal_from_fields,
    goal_text,
    read_goal_file,
)
from ur_cartesian_driver.goal_files.goal_reading import nanoseconds
from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.events import PathPlace
from ur_cartesian_driver.motion.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal import (
    ArcMode,
    FreeAxis,
    Goal,
    InputWait,
    OnPathTolerance,
    OutputKind,
    PayloadChange,
    ProportionalOutput,
    Segment,
    SegmentType,
    Tolerance,
    Waypoint,
)
from ur_cartesian_driver.motion.goal_table import GoalTable
from ur_cartesian_driver.motion.known_frames import ArmSnapshot, Frames
from ur_cartesian_driver.motion.pose import IDENTITY, multiply, Pose, Quaternion, rotate
from ur_cartesian_driver.motion.vectors import add, Vector6, ZERO6
from ur_cartesian_driver.path.centre_line import arc, CentreLine, RestToRest, turned
from ur_cartesian_driver.path.outputs import Input, Output
from ur_cartesian_driver.path.path_goal import goal_of_points, points_of_goal
from ur_cartesian_driver.path.path_numbers import (
    amount,
    any_number,
    NANOSECONDS,
    posture_near,
    six_numbers,
    to_nanoseconds,
    unit_quaternion,
    vector,
)
from ur_cartesian_driver.path.path_points import (
    backwards,
    Feed,
    is_same,
    merged,
    MotionRates,
    moved,
    PathPoint,
    PathSettings,
    POINT_FIELDS,
    SAME_ANGLE,
    SAME_POSITION,
    seen_from,
)
from ur_cartesian_driver.path.resumption import APPROACH, OVERLAP, resume
from ur_cartesian_driver.path.weave import strokes, woven
from ur_cartesian_driver.planning.request.io_commands import check_proportional_output
from ur_cartesian_driver.planning.request.stops import (
    check_input_wait,
    check_payload,
    MAX_DWELL,
    MAX_OFFSET,
)

#: A place: a position x y z [m], or a pose.
Place: TypeAlias = Sequence[float] | Pose

#: In a twist or an acceleration of a spline: the driver chooses what fits the neighbours.
FREE: Vector6 = (nan,) * 6

#: Larger numbers are mistakes, mostly of the unit. Other frames may be far from the robot.
MAX_COORDINATE_OF_BASE = 3.0
MAX_COORDINATE = 50.0
MAX_BLEND = 0.5
MAX_DURATION = 3600.0
#: By the unit of a motion's speed: the largest speed and acceleration.
_TOOL, _JOINTS, _FRACTION = 'm/s', 'rad/s', 'of the limits of the robot'
_MAX_SPEED = {_TOOL: (5.0, 100.0), _JOINTS: (20.0, 200.0), _FRACTION: (1.0, 1.0)}

_BASE_FRAMES = ('', 'base', 'base_link')
_JOINT_TYPES = (SegmentType.JOINT, SegmentType.OPTIMIZED_JOINT)
_OPTIMIZED_TYPES = (SegmentType.OPTIMIZED_LINEAR, SegmentType.OPTIMIZED_JOINT)
_FREE_AXES = {axis.name.lower(): axis for axis in FreeAxis if axis}
_BY_NAME = {
    'line': SegmentType.LINEAR,
    'joint': SegmentType.JOINT,
    'process': SegmentType.PROCESS,
}


@dataclass(frozen=True, slots=True, init=False, repr=False)
class Path:
    """
    A path from a start through points, without ROS and for ROS.

    ::

        square = (
            Path(start)
            .at(speed=0.1, acceleration=0.5, blend=mm(10))
            .by(dy=0.2).by(dx=0.2).by(dy=-0.2).by(dx=-0.2)
        )
        driver.execute(square).raise_for_error()

    The start is no point of the goal: it is where the arm is to stand, what the first :meth:`by`
    counts from, and its orientation holds until another one is given.
    """

    frame: str
    tool: str
    #: A place like a point, with no motion to it.
    _start: PathPoint | None
    _points: tuple[PathPoint, ...]
    _feed: Feed
    _settings: PathSettings

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

        :param start: where the arm stands; None where the first motion says where it goes.
        :param frame: the frame of all poses, as ``header.frame_id`` of a goal.
        :param tool: the controlled frame; empty = the robot's active TCP.
        :raises InvalidGoal: the start is no place that an arm can reach.
        """
        for name, value in (('frame', frame), ('tool', tool)):
            if not isinstance(value, str):
                raise InvalidGoal(name, f'is {value!r:.60}', 'give its name; transformed() places')
            object.__setattr__(self, name, value)
        self._set(_start=None, _points=(), _feed=Feed(), _settings=PathSettings())
        if start is not None:
            pose = self._pose('start', start, orientation, 'start')
            self._set(_start=PathPoint(waypoint=Waypoint(pose=pose), auto_blend=True))

    def _set(self, **values: Any) -> None:
        for name, value in values.items():
            object.__setattr__(self, name, value)

    def _with(self, **changes: Any) -> Path:
        """Return this path with other values in some of its fields."""
        path = object.__new__(Path)
        path._set(**{each.name: getattr(self, each.name) for each in fields(self)} | changes)
        return path

    def __repr__(self) -> str:
        return f'<Path of {len(self)} points in frame {self.frame or "base"!r}>'

    def __len__(self) -> int:
        return len(self._points)

    # ---- where it is ---------------------------------------------------------------------------

    @property
    def start(self) -> Pose | None:
        """The pose at which the path begins; None if the path does not say."""
        return None if self._start is None else self._start.pose

    @property
    def end(self) -> Pose | None:
        """The pose of the last point, or the start."""
        return self._points[-1].pose if self._points else self.start

    @property
    def poses(self) -> tuple[Pose, ...]:
        """The poses of all points, without the start."""
        return tuple(point.pose for point in self._points)

    @property
    def starts_with_joint_motion(self) -> bool:
        """Whether the first motion goes from wherever the arm stands, as joint motions can."""
        return bool(self._points) and self._points[0].segment.type in _JOINT_TYPES

    # ---- what holds from here on ---------------------------------------------------------------

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
    ) -> Path:
        """
        Set speeds and blends of the motions that follow, like a feed rate; None = as before.

        :param speed: of the tool on lines, arcs and PROCESS [m/s], with ``acceleration`` [m/s^2].
        :param blend: radius around each point [m]; 0 = stop there.
        :param joint_speed: of the leading axis in joint motions [rad/s], [rad/s^2].
        :param turn_speed: of the tool where it only turns [rad/s], [rad/s^2].
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
        start = self._start
        if start is not None and not self._points and 'blend' in given:  # for the way back
            segment = replace(start.segment, blend_radius=given['blend'])
            start = replace(start, segment=segment, feed_blend=True, auto_blend=False)
        return self._with(_feed=replace(self._feed, **given), _start=start)

    def free(self, axis: str | None, low: float | None = None, high: float | None = None) -> Path:
        """
        Let the tool turn about an axis of its own at the points that follow; the driver chooses.

        :param axis: ``x``, ``y`` or ``z``; None ends it.
        :param low: the least rotation from the orientation of each point [rad], with ``high``;
            without both any will do.
        :raises InvalidGoal: there is no such axis, or the range is none.
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
        given: dict[str, Any] = {
            'free_axis': FreeAxis.NONE if axis is None else _FREE_AXES[axis],
            'free_min': least,
            'free_max': greatest,
        }
        start = self._start
        if start is not None and not self._points:  # for the way back
            start = replace(start, segment=replace(start.segment, **given))
        return self._with(_feed=replace(self._feed, **given), _start=start)

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
    ) -> Path:
        """
        Add a straight line.

        :param place: where it ends: a position with the orientation of the point before, or with
            its own, or a pose.
        :param blend: instead of that of :meth:`at`, as ``speed`` and ``acceleration``.
        :param duration: of this motion [s]; a path has durations everywhere, or nowhere.
        :param posture: joint positions to arrive near to, by joint name [rad].
        :param optimized: as fast as the robot can (optimovel); speed and acceleration are
            fractions then.
        :raises InvalidGoal: a value cannot be meant.
        """
        kind = SegmentType.OPTIMIZED_LINEAR if optimized else SegmentType.LINEAR
        rates = MotionRates(blend, speed, acceleration, duration)
        return self._move(kind, place, orientation, rates, posture)

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
    ) -> Path:
        """
        Add a joint motion, in which the path of the tool is not straight; as :meth:`line`.

        ``speed`` and ``acceleration`` are those of the leading axis [rad/s], [rad/s^2].
        """
        kind = SegmentType.OPTIMIZED_JOINT if optimized else SegmentType.JOINT
        rates = MotionRates(blend, speed, acceleration, duration)
        return self._move(kind, place, orientation, rates, posture)

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
    ) -> Path:
        """
        Add a straight line at constant speed with rounded corners (movep); as :meth:`line`.

        Without a blend it gets one of 2 mm or so, because the arm would stop at its point;
        ``blend=0`` means a stop. So does an arc before it.
        """
        rates = MotionRates(blend, speed, acceleration, duration)
        return self._move(SegmentType.PROCESS, place, orientation, rates, posture)

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
    ) -> Path:
        """
        Add an arc through a point on the way; as :meth:`line`.

        :param via: a position on the arc, or a pose (whose orientation only counts with
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
        if follow and self._feed.free_axis:
            raise InvalidGoal(
                where,
                'turns the tool with the arc, but its axis is free',
                'write free(None) first',
            )
        pose = self._pose(where, place, orientation, 'end')
        T_via = self._pose(where, via, pose.quaternion, 'via')
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
        rates = MotionRates(blend, speed, acceleration, duration)
        return self._move(SegmentType.CIRCULAR, pose, None, rates, posture, arc_fields)

    def spline(
        self,
        place: Place,
        orientation: Quaternion | None = None,
        *,
        duration: float,
        twist: Sequence[float] = FREE,
        acceleration: Sequence[float] = FREE,
        posture: Mapping[str, float] | None = None,
    ) -> Path:
        """
        Add a point that a spline passes through; the points of a path are all of one, or none is.

        :param duration: from the point before [s].
        :param twist: linear [m/s] and angular [rad/s] velocity there, in the frame of the path, or
            the linear one alone; NaN = the driver chooses, 0 = the arm stops.
        :param acceleration: the same [m/s^2], [rad/s^2].
        :raises InvalidGoal: as :meth:`line`.
        """
        where = self._where('spline')
        if self._points and not self._points[-1].in_spline:
            raise _mixed(where)
        waypoint = Waypoint(
            pose=self._pose(where, place, orientation, 'end'),
            twist=six_numbers(f'{where}: twist', twist),
            acceleration=six_numbers(f'{where}: acceleration', acceleration),
            posture=posture_near(f'{where}: posture', posture),
        )
        point = PathPoint(
            waypoint=waypoint,
            segment=Segment(**self._feed.free),
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
    ) -> Path:
        """
        Add a motion from the point before by a distance [m] and a turn.

        :param turn: a rotation, by :func:`~.orientations.axis_angle` for example.
        :param of_tool: distance and turn along the axes of the tool, not of the frame.
        :param motion: ``line``, ``process`` or ``joint``; all else as there.
        :raises InvalidGoal: the path does not say where it is, or as :meth:`line`.
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
        rates = MotionRates(blend, speed, acceleration, duration)
        return self._move(_BY_NAME[motion], Pose(there, turned_q), None, rates, posture)

    # ---- what happens at points ----------------------------------------------------------------

    def set(
        self, output: Output, value: float, *, after: float = 0.0, before: float = 0.0
    ) -> Path:
        """
        Set an output when the tool passes the point before.

        :param value: True or False of a digital output, a fraction of the range of an analog one.
        :param after: time after the point [s].
        :param before: time before the point [s]; only where the motion to it has a duration.
        :raises InvalidGoal: there is no point, no such output, or no such value.
        """
        if not self._points:
            raise InvalidGoal('set()', 'comes before the first point', 'add a motion first')
        index, offset = len(self) - 1, after
        where = f'set() at point {index}'
        for name, time in (('after', after), ('before', before)):
            amount(where, name, time, 60.0, 's')
        if before:
            index, offset = index - 1, self._points[-1].duration / NANOSECONDS - before
            if not self._points[-1].duration or offset < 0.0 or index < 0 or after:
                raise InvalidGoal(
                    where,
                    f'has before={before:g} s, but no motion with a duration of that time leads '
                    'there from another point',
                    'add a point where the output is to change',
                )
            offset += self._points[index].segment.dwell
        command = output.command(value, 0, round(offset * NANOSECONDS) / NANOSECONDS)
        point = self._points[index]
        point = replace(point, outputs=(*point.outputs, command))
        return self._with(_points=(*self._points[:index], point, *self._points[index + 1 :]))

    def follow_speed(
        self,
        output: Output,
        gain: float,
        *,
        offset: float = 0.0,
        minimum: float = 0.0,
        maximum: float = 1.0,
        filter_time: float = 0.0,
        lead: float = 0.0,
        idle: float = 0.0,
    ) -> Path:
        """
        Let an analog output follow the speed of the tool from the point before on.

        It is ``offset + gain * speed``, within the bounds, all fractions of its range.

        :param gain: per speed [1/(m/s)].
        :param filter_time: time constant of a low-pass filter for the speed [s].
        :param lead: begin so long before the point [s].
        :param idle: value at its end, and when the motion does not go on as planned.
        :raises InvalidGoal: there is no point or no such output, or a number cannot be meant.
        """
        where = f'follow_speed() at point {len(self) - 1}'
        if not self._points:
            raise InvalidGoal('follow_speed()', 'comes before the first point', 'add a motion')
        if output.kind is not OutputKind.STANDARD_ANALOG:
            raise InvalidGoal(where, f'names {output}', 'use analog()')
        proportional = ProportionalOutput(
            first_waypoint=0,
            last_waypoint=1,
            pin=output.pin,
            domain=output.domain,
            gain=float(gain),
            offset=float(offset),
            minimum=float(minimum),
            maximum=float(maximum),
            filter_time=float(filter_time),
            begin_lead=float(lead),
            idle=float(idle),
        )
        check_proportional_output(where, proportional, 2)
        point = self._points[-1]
        amounts = (*point.amounts, replace(proportional, last_waypoint=0))
        return self._with(_points=(*self._points[:-1], replace(point, amounts=amounts)))

    def end_follow_speed(self, output: Output, *, lead: float = 0.0) -> Path:
        """
        End :meth:`follow_speed` at the point before.

        :param lead: end so long before the point [s].
        :raises InvalidGoal: the output does not follow the speed, or began to at this point.
        """
        last = len(self) - 1
        for i in range(last - 1, -1, -1):
            point = self._points[i]
            for k, proportional in enumerate(point.amounts):
                if proportional.pin == output.pin and not proportional.last_waypoint:
                    proportional = replace(
                        proportional, last_waypoint=last - i, end_lead=float(lead)
                    )
                    check_proportional_output('end_follow_speed()', proportional, last + 1)
                    amounts = (*point.amounts[:k], proportional, *point.amounts[k + 1 :])
                    point = replace(point, amounts=amounts)
                    return self._with(_points=(*self._points[:i], point, *self._points[i + 1 :]))
        raise InvalidGoal(
            f'end_follow_speed() at point {last}',
            f'has no begin for analog output {output.pin} at a point before',
            'call follow_speed() there',
        )

    def dwell(self, time: float) -> Path:
        """
        Let the arm rest at the point before for a time; there it has no blend.

        Durations are those of motions: what follows is later by the time [s].

        :raises InvalidGoal: there is no point, or it is passed with a blend or a twist of its own.
        """
        where, point = self._stop('dwell')
        length = to_nanoseconds(where, amount(where, 'time', time, MAX_DWELL, 's')) / NANOSECONDS
        segment = replace(point.segment, dwell=length)
        return self._with(_points=(*self._points[:-1], replace(point, segment=segment)))

    def wait_for(
        self,
        what: Input,
        value: float = True,
        *,
        timeout: float,
        below: bool = False,
        go_on: bool = False,
    ) -> Path:
        """
        Let the arm rest at the point before until an input has a value; there it has no blend.

        A :meth:`dwell` there, and the time of an output, count from when the input has come.

        :param value: True or False of a digital input, the level of an analog one [A] or [V].
        :param timeout: longest wait [s].
        :param below: until an analog input is below the level, not at it or above.
        :param go_on: go on if the input does not come; else the goal fails.
        :raises InvalidGoal: as :meth:`dwell`, or there is no such input or level.
        """
        where, point = self._stop('wait_for')
        wait = what.wait(float(value), timeout, below, go_on)
        check_input_wait(where, wait)
        if any(isinstance(other, InputWait) for other in point.stops):
            raise InvalidGoal(where, 'waits for a second input', 'add a point for it')
        point = replace(point, stops=(*point.stops, wait))
        return self._with(_points=(*self._points[:-1], point))

    def payload(self, mass: float, center_of_gravity: Sequence[float] = (0.0, 0.0, 0.0)) -> Path:
        """
        Set the payload where the arm stops at the point before; there it has no blend.

        :param mass: [kg].
        :param center_of_gravity: in the flange frame [m].
        :raises InvalidGoal: as :meth:`dwell`, or a number cannot be meant.
        """
        where, point = self._stop('payload')
        cog = vector(where, center_of_gravity, MAX_OFFSET)
        change = PayloadChange(waypoint=0, mass=float(mass), center_of_gravity=cog)
        check_payload(where, change)
        point = replace(point, stops=(*point.stops, change))
        return self._with(_points=(*self._points[:-1], point))

    def _stop(self, name: str) -> tuple[str, PathPoint]:
        """Return where the method is, and the last point as one at which the arm stops."""
        if not self._points:
            raise InvalidGoal(f'{name}()', 'comes before the first point', 'add a motion first')
        where, point = f'{name}() at point {len(self) - 1}', self._points[-1]
        segment, waypoint = point.segment, point.waypoint
        own_blend = segment.blend_radius > 0.0 and not point.feed_blend
        moves = any(abs(rate) > 0.0 for rate in (*waypoint.twist, *waypoint.acceleration))
        if own_blend or moves:
            raise InvalidGoal(where, 'is where the arm does not stop', 'leave out blend and twist')
        if point.in_spline:
            waypoint = replace(waypoint, twist=ZERO6, acceleration=ZERO6)
        point = replace(
            point,
            waypoint=waypoint,
            segment=replace(segment, blend_radius=0.0),
            feed_blend=False,
            auto_blend=False,
        )
        return where, point

    # ---- the path as a whole -------------------------------------------------------------------

    def tolerances(
        self,
        *,
        path: Tolerance | None = None,
        goal: Tolerance | None = None,
        time: float | None = None,
        stall: float | None = None,
    ) -> Path:
        """
        Set the largest deviations on the path and at its end; None = as before.

        :param time: how much later than planned the end may come [s], negative = any time.
        :param stall: how long the motion waits for an arm that is off its path [s], SERVO only;
            0 = such an arm is stopped, and the goal ends.
        """
        settings = self._settings
        if stall is not None:
            amount('tolerances()', 'stall', stall, 3600.0, 's')
            stall = round(stall * NANOSECONDS) / NANOSECONDS
            choice = OnPathTolerance.STALL if stall else OnPathTolerance.ABORT
            settings = replace(settings, on_path_tolerance=choice, stall_timeout=stall)
        return self._with(
            _settings=replace(
                settings,
                path_tolerance=settings.path_tolerance if path is None else path,
                goal_tolerance=settings.goal_tolerance if goal is None else goal,
                goal_time_tolerance=settings.goal_time_tolerance
                if time is None
                else round(time * NANOSECONDS) / NANOSECONDS,
            )
        )

    def executed_as(self, mode: ExecutionMode) -> Path:
        """Choose how the path is executed: a spline by the robot (SPLINE) or streamed (SERVO)."""
        return self._with(_settings=replace(self._settings, execution=mode))

    def steady(self, min_fraction: float = 0.95) -> Path:
        """Refuse the path where the tool would be slower than this part of its speed (0 to 1)."""
        return self._with(_settings=replace(self._settings, min_speed_fraction=min_fraction))

    def keep_open(self) -> Path:
        """Let points be appended while the arm moves."""
        return self._with(_settings=replace(self._settings, keep_open=True))

    def safe(self, output: Output, value: float, *, restore: bool = False) -> Path:
        """
        Name the value that an output takes when the motion does not go on as planned.

        :param restore: whether it gets its value back after a pause.
        :raises InvalidGoal: there is no such output or value, or it has one already.
        """
        safe, known = output.safe(value, restore), self._settings.safe_outputs
        if any((other.output, other.pin) == (safe.output, safe.pin) for other in known):
            raise InvalidGoal('safe()', f'names {output} a second time', 'name it once')
        return self._with(_settings=replace(self._settings, safe_outputs=(*known, safe)))

    # ---- new paths from paths ------------------------------------------------------------------

    def then(self, other: Path) -> Path:
        """
        Return this path and another one after it.

        :raises InvalidGoal: frames, tools or settings differ, or the other begins elsewhere.
        """
        for name in ('frame', 'tool'):
            mine, its = getattr(self, name), getattr(other, name)
            if mine != its:
                raise InvalidGoal(
                    'then()', f'joins the {name}s {mine!r} and {its!r}', 'use one for both'
                )
        if (
            self.end is not None
            and other.start is not None
            and not is_same(self._end, other.start)
        ):
            raise InvalidGoal(
                'then()',
                f'joins a path that ends {_apart(self._end, other.start)} away from where '
                'the other begins',
                'add a motion to there',
            )
        if self._points and other._points:
            first, last = other._points[0], self._points[-1]
            if first.in_spline != last.in_spline:
                raise _mixed('then()')
            if bool(first.duration) != bool(last.duration):
                raise InvalidGoal(
                    'then()', 'joins a path with durations and one without', 'give both, or none'
                )
        return self._with(
            _start=self._start if len(self) or self._start else other._start,
            _points=(*self._points, *other._points),
            _feed=other._feed,
            _settings=merged(self._settings, other._settings),
        )

    def offset(
        self, dx: float = 0.0, dy: float = 0.0, dz: float = 0.0, *, of_tool: bool = False
    ) -> Path:
        """
        Return this path beside itself.

        :param of_tool: along the axes of the tool at each point, not of the frame.
        :raises InvalidGoal: of the tool, where it turns on an arc: the result is no arc.
        """
        step = vector('offset()', (dx, dy, dz), MAX_COORDINATE_OF_BASE, 'd')
        if not of_tool:
            return self.transformed(Pose(step))
        T_tool_new = Pose(step)
        previous = (self.start, *self.poses)
        points = (
            seen_from(point, T_tool_new, before, f'offset() at point {i}')
            for i, (point, before) in enumerate(zip(self._points, previous, strict=False))
        )
        start = self._start
        return self._with(
            _start=None if start is None else seen_from(start, T_tool_new, None, 'offset()'),
            _points=tuple(points),
        )

    def transformed(self, T: Pose) -> Path:
        """Return this path with all its poses moved by a pose of the frame: ``T @ pose``."""
        T = Pose(
            vector('transformed()', T.position, MAX_COORDINATE), unit_quaternion('T', T.quaternion)
        )
        return self._with(
            _start=None if self._start is None else moved(self._start, T),
            _points=tuple(moved(point, T) for point in self._points),
        )

    def reversed(self) -> Path:
        """
        Return the way back: from the end to the start.

        :raises InvalidGoal: the path has no start to end at, or outputs, which have no reverse.
        """
        if self._start is None:
            raise InvalidGoal('reversed()', 'has no start to go back to', 'write Path(start)')
        if any(point.outputs or point.stops or point.amounts for point in self._points):
            raise InvalidGoal(
                'reversed()',
                'has outputs, inputs or payloads, which have no reverse',
                'set them afterwards',
            )
        if not self._points:
            return self
        places = (self._start, *self._points)
        # Blend and dwell belong to their point, all else of a segment to the motion.
        points = [
            replace(
                motion,
                waypoint=backwards(place.waypoint),
                segment=replace(
                    motion.segment,
                    **{name: getattr(place.segment, name) for name in POINT_FIELDS},
                ),
                feed_blend=place.feed_blend,
                auto_blend=place.auto_blend,
            )
            for place, motion in zip(places, self._points, strict=False)
        ]
        end = places[-1]
        start = PathPoint(
            waypoint=backwards(end.waypoint),
            segment=Segment(**{name: getattr(end.segment, name) for name in POINT_FIELDS}),
            feed_blend=end.feed_blend,
            auto_blend=end.auto_blend,
        )
        return self._with(_start=start, _points=tuple(points[::-1]))

    def resumed(
        self, place: PathPlace, *, overlap: float = OVERLAP, approach: float = APPROACH
    ) -> Path:
        """
        Return what is left of the path when it was stopped at a place (``outcome.stopped``).

        As :func:`~.resumption.resume`: overlap and approach are lengths [m].

        :raises InvalidGoal: the path is kept open, or a number is out of its range.
        """
        left = resume(self._table(), place, overlap=overlap, approach=approach, start=self.start)
        return Path.from_goal(left.goal)

    def repeated(
        self,
        times: int,
        dx: float = 0.0,
        dy: float = 0.0,
        dz: float = 0.0,
        *,
        alternating: bool = False,
    ) -> Path:
        """
        Return this path several times, each one a step beside the one before.

        Where a pass begins away from the end of the one before, a line leads there, with speed and
        blend of the end of the path.

        :param alternating: every second pass goes backwards.
        :raises InvalidGoal: the path has no start, or the passes cannot be joined.
        """
        if times < 1:
            raise InvalidGoal('repeated()', f'is asked for {times} times', 'use 1 or more')
        path = self
        for i in range(1, times):
            one = self.offset(i * dx, i * dy, i * dz)
            one = one.reversed() if alternating and i % 2 else one
            if one.start is None or self.end is None:
                raise InvalidGoal(
                    'repeated()', 'has no start to come back to', 'write Path(start)'
                )
            if not is_same(path._end, one.start):
                path = path.line(one.start)
            path = path.then(one)
        return path

    def weave(self, amplitude: float, wavelength: float) -> Path:
        """
        Return a spline that swings to both sides of this path, across the axis z of the tool.

        Lines and arcs without corners become a spline through eight points on each wave. The
        speed along the path is that of :meth:`at`, from rest to rest; whole waves fit into it.

        :param amplitude: to either side [m].
        :param wavelength: about the length of one wave [m].
        :raises InvalidGoal: the path has a corner, outputs, no start or no speed, or is no path of
            lines and arcs by speed.
        """
        for name, value in (('amplitude', amplitude), ('wavelength', wavelength)):
            amount('weave()', name, value, MAX_BLEND, 'm')
        speed, start = self._feed.speed, self.start
        if not speed or not wavelength:
            raise InvalidGoal('weave()', 'needs a speed and a wavelength', 'use at(speed=...)')
        if start is None or not self._points:
            raise InvalidGoal('weave()', 'has no line to follow', 'write Path(start).line(...)')
        centre = CentreLine(strokes(start, self._points))
        motion = RestToRest(centre.length, speed, self._feed.acceleration or 10.0 * speed)
        path, before = self._with(_points=()), 0.0
        try:
            waves = max(1, round(centre.length / wavelength))
            for pose, time, twist in woven(centre, motion, amplitude, waves):
                path = path.spline(pose, duration=time - before, twist=twist)
                before = time
        except ZeroDivisionError:
            raise InvalidGoal(
                'weave()', 'has a tool that points along the path', 'turn it across'
            ) from None
        return path

    # ---- the path as a goal --------------------------------------------------------------------

    def goal(self, frames: Frames | None = None, snapshot: ArmSnapshot | None = None) -> Goal:
        """
        Return the goal, as the driver plans it.

        :param frames: where the frames are that the path names; None = those of every robot.
        :param snapshot: where the arm is, for frames that move with it.
        :raises InvalidGoal: a frame is not known.
        :raises RobotNotReady: a frame moves with the arm, whose pose is not known.
        """
        frames = Frames() if frames is None else frames
        return frames.resolve(self._table(), self.frame, self.tool, snapshot)

    @classmethod
    def from_goal(cls, goal: Goal) -> Path:
        """
        Return the path of a goal; it has no start.

        A goal in a frame without a name is transformed into the base.

        :raises InvalidGoal: the goal is refused anyway, or its controlled frame has no name.
        """
        if goal.T_flange_controlled is not None and not goal.controlled_frame:
            raise InvalidGoal(
                'controlled_frame', 'has no name', 'name it, so that it can be found'
            )
        path = cls(frame=goal.frame_id, tool=goal.controlled_frame)._with(
            _points=points_of_goal(goal),
            _settings=PathSettings(
                **{each.name: getattr(goal, each.name) for each in fields(PathSettings)}
            ),
        )
        unnamed = goal.frame_id in ('', 'base') and goal.T_base_frame != IDENTITY
        return path.transformed(goal.T_base_frame) if unnamed else path

    def to_message(self) -> Any:
        """Return the goal message of the action; needs ROS."""
        messages = import_module('ur_cartesian_driver.ros.messages.goal_messages')
        return messages.goal_message(self._fields())

    @classmethod
    def from_message(cls, message: Any) -> Path:
        """
        Return the path of a goal message, in either form.

        :raises InvalidGoal: it has what a path has not: a start time, or ``validate_only``.
        """
        if nanoseconds(message.trajectory.header.stamp) or message.validate_only:
            raise InvalidGoal(
                'trajectory.header.stamp or validate_only',
                'is set, which is no part of a path',
                'leave it out, and set it when the goal is sent',
            )
        return cls.from_goal(goal_from_fields(message))

    def to_yaml(self) -> str:
        """Return the YAML of a goal file, exactly."""
        return goal_text(self._fields())

    @classmethod
    def from_yaml(cls, text: str) -> Path:
        """
        Return the path of a goal in YAML.

        :raises GoalFileError: the text is no goal.
        :raises InvalidGoal: as :meth:`from_message`.
        """
        return cls.from_message(read_goal_file(text))

    def save(self, file: str | os.PathLike[str]) -> None:
        """Write a goal file, which :meth:`load` and all commands read."""
        FilePath(file).write_text(self.to_yaml(), encoding='utf-8')

    @classmethod
    def load(cls, file: str | os.PathLike[str]) -> Path:
        """Read a goal file; as :meth:`from_yaml`."""
        return cls.from_message(read_goal_file(FilePath(file)))

    # ---- inside --------------------------------------------------------------------------------

    @property
    def _end(self) -> Pose:
        assert self.end is not None
        return self.end

    def _where(self, kind: str) -> str:
        return f'point {len(self)} ({kind})'

    def _table(self) -> GoalTable:
        """Return the goal with its frames unresolved."""
        return goal_of_points(self._points, self._settings, self.start, self.frame, self.tool)

    def _fields(self) -> dict[str, Any]:
        return fields_of_goal(self._table())

    def _pose(self, where: str, place: Place, orientation: Quaternion | None, name: str) -> Pose:
        """Return the pose of a place; the orientation holds on if none is given."""
        if isinstance(place, Pose):
            if orientation is not None:
                return self._pose(where, place.position, orientation, name)
            position, q = place.position, place.quaternion
        else:
            here = self.end
            if orientation is None and here is None:
                raise InvalidGoal(
                    where, 'has no orientation, and there is none before', 'give one, or a start'
                )
            position = place  # type: ignore[assignment]
            q = orientation if orientation is not None else here.quaternion  # type: ignore[union-attr]
        is_base = self.frame in _BASE_FRAMES
        bound = MAX_COORDINATE_OF_BASE if is_base else MAX_COORDINATE
        return Pose(vector(where, position, bound), unit_quaternion(where, q))

    def _move(
        self,
        kind: SegmentType,
        place: Place,
        orientation: Quaternion | None,
        rates: MotionRates,
        posture: Mapping[str, float] | None,
        arc_fields: Mapping[str, Any] | None = None,
    ) -> Path:
        name = {SegmentType.CIRCULAR: 'arc'}.get(kind, kind.name.lower().split('_')[-1])
        where = self._where('line' if name == 'linear' else name)
        if self._points and self._points[-1].in_spline:
            raise _mixed(where)
        pose, here = self._pose(where, place, orientation, 'end'), self.end
        moved = here is None or here.distance_to(pose) > SAME_POSITION
        if not moved and not posture and kind is not SegmentType.JOINT:
            assert here is not None
            if here.angle_to(pose) <= SAME_ANGLE and (self._points or not rates.duration):
                raise InvalidGoal(
                    where, 'is where the tool is before: it has no distance to go', 'leave it out'
                )
        duration = self._nanoseconds(where, rates.duration)
        velocity, acceleration = self._rates(where, kind, rates, moved, bool(duration))
        blend = amount(where, 'blend', rates.blend, MAX_BLEND, 'm')
        feed_blend = blend is None and self._feed.blend is not None
        blend = self._feed.blend if blend is None else blend
        point = PathPoint(
            waypoint=Waypoint(pose=pose, posture=posture_near(f'{where}: posture', posture)),
            segment=Segment(
                type=kind,
                blend_radius=blend or 0.0,
                velocity=velocity,
                acceleration=acceleration,
                **self._feed.free,
                **(arc_fields or {}),
            ),
            duration=duration,
            feed_blend=feed_blend,
            auto_blend=blend is None and kind in (SegmentType.PROCESS, SegmentType.CIRCULAR),
        )
        return self._with(_points=(*self._points, point))

    def _rates(
        self, where: str, kind: SegmentType, rates: MotionRates, moved: bool, timed: bool
    ) -> tuple[float, float]:
        """Return speed and acceleration of a motion, in the units of its type."""
        feed = self._feed
        unit, usual = _TOOL, (feed.speed, feed.acceleration)
        if kind in _OPTIMIZED_TYPES:
            unit, usual = _FRACTION, (0.0, 0.0)
        elif kind is SegmentType.JOINT:
            unit, usual = _JOINTS, (feed.joint_speed, feed.joint_acceleration)
        elif not moved:
            unit, usual = _JOINTS, (feed.turn_speed, feed.turn_acceleration)
        bounds = _MAX_SPEED[unit]
        speed = amount(where, 'speed', rates.speed, bounds[0], unit)
        acceleration = amount(where, 'acceleration', rates.acceleration, bounds[1], unit)
        speed = usual[0] if speed is None else speed
        if timed and (speed or kind in _OPTIMIZED_TYPES):
            raise InvalidGoal(
                where, 'has a duration and a speed', 'give one of them; at(speed=0) unsets it'
            )
        return speed, usual[1] if acceleration is None else acceleration

    def _nanoseconds(self, where: str, duration: float | None) -> int:
        if duration is None:
            if self._points and self._points[-1].duration:
                raise InvalidGoal(
                    where, 'has no duration, but the points before have', 'give each one'
                )
            return 0
        if self._points and not self._points[-1].duration:
            raise InvalidGoal(
                where, 'has a duration, but the points before have none', 'give each one, or none'
            )
        time = to_nanoseconds(where, amount(where, 'duration', duration, MAX_DURATION, 's'))
        if not time:
            raise InvalidGoal(where, 'has a duration of 0', 'give the motion some time')
        return time


def _apart(a: Pose, b: Pose) -> str:
    return f'{1e3 * a.distance_to(b):.3g} mm and {a.angle_to(b):.3g} rad'


def _mixed(where: str) -> InvalidGoal:
    return InvalidGoal(
        where,
        'mixes spline points with other motions, but a spline joins all points of a path',
        'make two paths, or use spline() for every point',
    )
