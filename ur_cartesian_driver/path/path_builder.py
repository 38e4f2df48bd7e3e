# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
A path of the tool, composed motion by motion.

A :class:`Path` never changes: each method returns a new one. Units are SI (:func:`~.units.mm` and
:func:`~.units.deg` convert). Each pose is the pose of the controlled frame (by default the active
TCP) in the frame of the path (by default the robot's base). A mistake raises an
:exc:`~ur_cartesian_driver.motion.errors.InvalidGoal` at the program line that makes it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import partial
from numbers import Integral
import os
from pathlib import Path as FilePath
from typing import Any

from ur_cartesian_driver.goal_files import (
    fields_of_goal,
    goal_from_fields,
    goal_text,
    read_goal_file,
)
from ur_cartesian_driver.goal_files.goal_reading import nanoseconds
from ur_cartesian_driver.goal_files.goal_schema import message_of, with_defaults
from ur_cartesian_driver.motion.errors import GoalRefused, InvalidGoal, NotAvailable
from ur_cartesian_driver.motion.events import PathPlace
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, Pose
from ur_cartesian_driver.motion.geometry.vectors import ZERO3
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import (
    CORNER_ANGLE,
    CORNER_DEVIATION,
    FeedOverride,
    Goal,
    OnPathTolerance,
    PathOffset,
    Segment,
    StaleOffset,
    Tolerance,
)
from ur_cartesian_driver.motion.goal.goal_columns import goal_table, GoalTable
from ur_cartesian_driver.motion.goal.known_frames import ArmSnapshot, Frames
from ur_cartesian_driver.path.centre_line import CentreLine, RestToRest
from ur_cartesian_driver.path.outputs import Output
from ur_cartesian_driver.path.path_events import PathWithEvents
from ur_cartesian_driver.path.path_goal import (
    goal_of_points,
    points_of_goal,
    SETTINGS,
    settings_of,
)
from ur_cartesian_driver.path.path_motions import (
    MAX_BLEND,
    MAX_COORDINATE,
    MAX_COORDINATE_OF_BASE,
    mixed_spline,
)
from ur_cartesian_driver.path.path_numbers import (
    amount,
    any_number,
    NANOSECONDS,
    to_nanoseconds,
    unit_quaternion,
    vector,
)
from ur_cartesian_driver.path.path_points import (
    backwards,
    is_same,
    merged,
    moved,
    PathPoint,
    point_fields,
    seen_from,
)
from ur_cartesian_driver.path.resumption import APPROACH, OVERLAP, resume
from ur_cartesian_driver.path.travels.traveller import (
    AirTravel,
    ArmStand,
    Leg,
    no_start,
    PathBegin,
    Traveller,
)
from ur_cartesian_driver.path.weave import strokes, woven
from ur_cartesian_driver.planning.request.goal_fields import is_rounded
from ur_cartesian_driver.planning.request.validate import check
from ur_cartesian_driver.planning.travel.travel_to_goal import BLEND_FACTORS


@dataclass(frozen=True, slots=True, init=False, repr=False)
class Path(PathWithEvents):
    """
    A path from a start through points, for use with or without ROS.

    ::

        square = (
            Path(start)
            .at(speed=0.1, acceleration=0.5, blend=mm(10))
            .by(dy=0.2).by(dx=0.2).by(dy=-0.2).by(dx=-0.2)
        )
        driver.execute(square).raise_for_error()

    The start is not a point of the goal. The arm has to be at the start when the goal begins, the
    first :meth:`by` is relative to the start, and the start's orientation holds until another one
    is given.
    """

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

        :param time: largest delay of the end after its planned time [s]; negative = no limit.
        :param stall: longest wait of the motion for an arm outside the path tolerance [s], SERVO
            only; 0 = no wait: the arm is stopped, and the goal ends.
        :raises InvalidGoal: a value is not a tolerance, or not a finite time.
        """
        where = 'tolerances()'
        given: dict[str, Any] = {'path_tolerance': path, 'goal_tolerance': goal}
        if stall is not None:
            length = to_nanoseconds(where, amount(where, 'stall', stall, 3600.0, 's'))
            stall = length / NANOSECONDS
            choice = OnPathTolerance.STALL if stall else OnPathTolerance.ABORT
            given |= {'on_path_tolerance': choice, 'stall_timeout': stall}
        if time is not None:
            delay = to_nanoseconds(where, any_number(where, 'time', time))
            given['goal_time_tolerance'] = delay / NANOSECONDS
        return self._with_settings(
            where, **{k: value for k, value in given.items() if value is not None}
        )

    def asking(self, **fields: Any) -> Path:
        """
        Set goal fields that have no method of their own, by their names in the action.

        :raises InvalidGoal: a field cannot have the value, or is no setting of a whole path.
        """
        for name in fields:
            if name not in SETTINGS:
                raise InvalidGoal(
                    'asking()',
                    f'names {name}, which is no setting of a whole path',
                    f'use one of {", ".join(SETTINGS)}, or the methods of the path',
                )
        return self._with_settings('asking()', **fields)

    def executed_as(self, mode: ExecutionMode) -> Path:
        """
        Choose how the path is executed, such as by the robot (SPLINE) or streamed (SERVO).

        :raises InvalidGoal: there is no such mode.
        """
        return self._with_settings('executed_as()', execution=mode)

    def steady(self, min_fraction: float = 0.95) -> Path:
        """
        Have planning refuse the path if it is anywhere slower than a fraction of its given speed.

        :param min_fraction: the fraction, 0 to 1.
        :raises InvalidGoal: the fraction is out of its range.
        """
        return self._with_settings('steady()', min_speed_fraction=min_fraction)

    def rounded(self, deviation: float, angle: float = 0.0) -> Path:
        """
        Round the corners of lines and arcs, so that the arm passes their points without a stop.

        The planned path is nowhere farther from the lines and arcs than the deviation, and the
        tool slows down where necessary. A motion can have its own deviation at its end:
        ``line(..., corner_deviation=mm(0.1))``.

        :param deviation: largest distance from the lines and arcs [m]; 0 = corners are rounded
            only after motions with their own deviation.
        :param angle: largest turn of the tool away from its programmed orientation [rad]; 0
            selects the default, 0.02.
        :raises InvalidGoal: a number is out of its range.
        """
        for name, value, bounds, remedy in (
            ('deviation', deviation, CORNER_DEVIATION, 'mm() converts'),
            ('angle', angle, CORNER_ANGLE, 'deg() converts'),
        ):
            number = any_number('rounded()', name, value)
            if not bounds.holds(number):
                raise InvalidGoal(f'rounded(): {name}', bounds.refusal(number)[0], remedy)
        return self._with_settings(
            'rounded()', corner_deviation=float(deviation), corner_angle=float(angle)
        )

    def path_offset(
        self,
        *,
        along: float = 0.0,
        across: float = 0.0,
        normal: float = 0.0,
        speed: float = 0.0,
        acceleration: float = 0.0,
        timeout: float = 0.0,
        on_stale: StaleOffset = StaleOffset.HOLD,
    ) -> Path:
        """
        Allow offsets from the path while the arm moves, in PRIMITIVES or SERVO.

        Offsets are set by ``set_path_offset`` of the running motion, or on the topic
        ``~/path_offset``.

        :param along: largest offset along the path, either way [m]; ``across``: along the cross
            product of the path's direction and the tool's z axis; ``normal``: normal to both.
        :param speed: largest speed of the offset along each of these axes [m/s]; 0 selects the
            default, 0.02.
        :param acceleration: largest acceleration of the offset along each axis [m/s^2]; 0 selects
            the default, 0.2.
        :param timeout: age from which an offset is stale [s]; 0 selects the default, 0.5.
        :param on_stale: whether a stale offset stays, or the tool goes back to its path.
        :raises InvalidGoal: a number is out of its range.
        """
        offset = PathOffset(
            limits=(along, across, normal),
            speed=speed,
            acceleration=acceleration,
            timeout=timeout,
            on_stale=on_stale,
        )
        return self._with_settings('path_offset()', path_offset=offset)

    def feed_override(
        self, minimum: float, *, maximum: float = 1.0, rate: float = 0.0, timeout: float = 0.0
    ) -> Path:
        """
        Allow a signal to slow the motion while the arm moves, in SPLINE or SERVO.

        The signal is set by ``set_feed_override`` of the running motion, or on the topic
        ``~/feed_override``.

        :param minimum: smallest fraction of the planned speed, 0.01 to 1; also before the first
            signal, and while the signal is stale or invalid.
        :param maximum: largest fraction of the planned speed.
        :param rate: largest change of the fraction [1/s]; 0 selects the default, 0.5.
        :param timeout: age from which the signal is stale [s]; 0 selects the default, 0.5.
        :raises InvalidGoal: a number is out of its range.
        """
        bounds = FeedOverride(minimum=minimum, maximum=maximum, rate=rate, timeout=timeout)
        return self._with_settings('feed_override()', feed_override=bounds)

    def keep_open(self, replace_horizon: float = 0.0) -> Path:
        """
        Allow points to be appended while the arm moves.

        :param replace_horizon: time from now for which the motion is fixed [s]; points after this
            time can be replaced. 0 = no points can be replaced.
        :raises InvalidGoal: the horizon is out of its range.
        """
        return self._with_settings('keep_open()', keep_open=True, replace_horizon=replace_horizon)

    def allow_travel(self) -> Path:
        """
        Let the arm travel to the path if the arm is far away, or the direct way is refused.

        The driver plans the travel together with the path (PRIMITIVES without durations). If the
        path has a start, the start becomes its first point; the arm moves there on a line if that
        is free of collisions.
        """
        path = self._with_settings('allow_travel()', allow_travel=True)
        if self._start is None:
            return path
        begin = self._with(_start=None, _points=()).line(self._start.pose, blend=0.0)
        return path._with(_start=None, _points=(*begin._points, *self._points))

    def safe(self, output: Output, value: float, *, restore: bool = False) -> Path:
        """
        Set the value that an output takes if the motion fails, is cancelled or is paused.

        :param restore: whether the output gets its previous value back after a pause; if not, the
            goal ends when the paused program is resumed.
        :raises InvalidGoal: the output cannot have the value, or has a safe value already.
        """
        safe, known = output.safe(value, restore), self._settings.safe_outputs
        if any((other.output, other.pin) == (safe.output, safe.pin) for other in known):
            raise InvalidGoal('safe()', f'names {output} a second time', 'name it once')
        return self._with_settings('safe()', safe_outputs=(*known, safe))

    # ---- new paths from paths ------------------------------------------------------------------

    def then(self, other: Path) -> Path:
        """
        Return this path followed by another one.

        :raises InvalidGoal: frames, tools or settings differ, the other path begins elsewhere, or
            only one of the paths is a spline or has durations.
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
            after, last = other._points[0], self._points[-1]
            if after.in_spline != last.in_spline:
                raise mixed_spline('then()')
            if bool(after.duration) != bool(last.duration):
                raise InvalidGoal(
                    'then()', 'joins a path with durations and one without', 'give both, or none'
                )
        first, start = self, self._start
        if other._start is not None:
            rest = other._start.segment.dwell  # the dwell of a reversed path
            if not self._points and (start is None or rest):
                start = other._start
            elif rest and not self._points[-1].segment.dwell:
                first = self.dwell(rest)
        return self._with(
            _start=start,
            _points=(*first._points, *other._points),
            _feed=other._feed,
            _settings=merged(self._settings, other._settings),
        )

    def travel_to(self, other: Path, by: AirTravel) -> Path:
        """
        Return this path, a travel through the air, and another path, as one path.

        The tool is retracted along its axis z, the arm moves without contact at the joint speed of
        :meth:`at`, and the tool approaches the start of the other path along its axis z. If this
        path has no points, the travel begins at the joints of the arm.

        :param by: the arm, its state when this path begins, and the settings of the travel.
        :raises GoalRefused: a path cannot be executed, or no travel was found.
        :raises InvalidGoal: the other path has no start, or cannot follow this one.
        """
        place = by.begin
        if self._points:
            place = by.end_of(self.goal(by.frames, by.snapshot), place)
        return self._travelled(other, by, place, 'The travel')[0]

    def _travelled(
        self, other: Path, by: AirTravel, place: ArmStand, where: str
    ) -> tuple[Path, ArmStand]:
        """
        Return the path of :meth:`travel_to`, and the arm's joints and the cell at its end.

        :param place: the arm's joints and the cell at the end of this path.
        :param where: the beginning of error messages, such as "The travel".
        """
        traveller = Traveller(by, place, other._begin(by, where), where)
        runs = traveller.runs()
        legs, entry = traveller.legs(tuple(runs))
        path = self
        if legs and self._points:
            last = self._points[-1]  # the tool reaches it before it is retracted
            segment = replace(last.segment, blend_radius=0.0)
            last = replace(last, segment=segment, feed_blend=False, auto_blend=False)
            path = self._with(_points=(*self._points[:-1], last))
        refusal: GoalRefused | None = None
        for factor in BLEND_FACTORS if legs else ():
            air = self._with(_start=None, _points=())._with_legs(legs, factor)
            try:
                by.end_of(air.goal(by.frames, by.snapshot), place)
            except GoalRefused as error:
                refusal = error
            else:
                path, refusal = path._with_legs(legs, factor), None
                break
        if refusal is not None:
            raise refusal.reworded(f'{where}: {refusal}')
        joined = path.then(other)
        goal = joined.goal(by.frames, by.snapshot)
        if legs and is_rounded(goal_table(goal)):
            raise InvalidGoal(
                where,
                'leads to or from a path with rounded corners, which has no joint motions',
                'execute the paths one by one',
            )
        check(goal, by.options)
        return joined, runs[entry]

    def _with_feed_of(self, other: Path) -> Path:
        """Return this path with the speeds that hold at the end of another one."""
        return self._with(_feed=other._feed)

    def _begin(self, by: AirTravel, where: str) -> PathBegin:
        """
        Return the beginning of the path, for an arm that travels to it.

        :raises InvalidGoal: the path has no start.
        :raises NotAvailable: the path's frame moves with the arm, on a held part.
        """
        if self.start is None or not self._points:
            raise no_start(where)
        goal = self.goal(by.frames, by.snapshot)
        if goal.moving_frame is not None:
            raise NotAvailable(
                where,
                f'leads to a path on {self.frame}, which the arm holds, and travels are joint '
                'motions and blends, which such paths do not have',
                'send each path as a goal of its own, with a joint goal in between',
            )
        return PathBegin(goal, self.start)

    def _with_legs(self, legs: Iterable[Leg], factor: float) -> Path:
        """Return this path followed by a travel's motions, their blends scaled by ``factor``."""
        path = self.free(None)
        for leg in legs:
            blend = factor * leg.blend
            if leg.posture is None:
                path = path.line(leg.pose, blend=blend)
            else:
                path = path.joint(leg.pose, blend=blend, posture=leg.posture)
        return path._with(_feed=self._feed)

    def offset(
        self, dx: float = 0.0, dy: float = 0.0, dz: float = 0.0, *, of_tool: bool = False
    ) -> Path:
        """
        Return this path moved by a distance [m].

        :param of_tool: move each point along the tool's axes at this point, not along the axes of
            the path's frame.
        :raises InvalidGoal: with ``of_tool``, an arc turns the tool, so that the result is not an
            arc; or the tool turns in a spline at a point whose twist has no angular part.
        """
        step = vector('offset()', (dx, dy, dz), MAX_COORDINATE_OF_BASE, 'd')
        if not of_tool:
            return self.transformed(Pose(step))
        if step == ZERO3:
            return self
        T_tool_new = Pose(step)
        poses = (self.start, *self.poses, None)
        start = self._start
        known = self._points if start is None else (start, *self._points)
        move = partial(seen_from, quintic=any(any(point.waypoint.acceleration) for point in known))
        points = (
            move(point, T_tool_new, poses[i], poses[i + 2], f'offset() at point {i}')
            for i, point in enumerate(self._points)
        )
        return self._with(
            _start=None
            if start is None
            else move(start, T_tool_new, poses[0], poses[1], 'offset() at the start'),
            _points=tuple(points),
        )

    def transformed(self, T: Pose) -> Path:
        """
        Return this path with each pose replaced by ``T @ pose``, both in the path's frame.

        :raises InvalidGoal: the position of ``T`` is out of bounds, or ``T`` turns a twist of a
            spline that has only some of its linear or angular components.
        """
        T = Pose(
            vector('transformed()', T.position, MAX_COORDINATE), unit_quaternion('T', T.quaternion)
        )
        return self._with(
            _start=None if self._start is None else moved(self._start, T, 'transformed()'),
            _points=tuple(
                moved(point, T, f'transformed() at point {i}')
                for i, point in enumerate(self._points)
            ),
        )

    def reversed(self) -> Path:
        """
        Return the path backwards, from its end to its start.

        A dwell at the end becomes a dwell at the start. No goal can begin with a dwell, so such a
        path has to follow another one, by :meth:`then`.

        :raises InvalidGoal: the path has no start at which to end, or has events, which cannot be
            reversed.
        """
        if self._start is None:
            raise InvalidGoal('reversed()', 'has no start to go back to', 'write Path(start)')
        if any(point.events for point in self._points):
            raise InvalidGoal(
                'reversed()',
                'has outputs, inputs, payloads or presses, which have no reverse',
                'set them afterwards',
            )
        if not self._points:
            return self
        places = (self._start, *self._points)
        # Blend and dwell of a segment belong to its point, the other fields to its motion.
        points = [
            replace(
                motion,
                waypoint=backwards(place.waypoint),
                segment=replace(motion.segment, **point_fields(place.segment)),
                feed_blend=place.feed_blend,
                auto_blend=place.auto_blend,
            )
            for place, motion in zip(places, self._points, strict=False)
        ]
        end = places[-1]
        start = PathPoint(
            waypoint=backwards(end.waypoint),
            segment=Segment(**point_fields(end.segment)),
            feed_blend=end.feed_blend,
            auto_blend=end.auto_blend,
        )
        return self._with(_start=start, _points=tuple(points[::-1]))

    def resumed(
        self, place: PathPlace, *, overlap: float = OVERLAP, approach: float = APPROACH
    ) -> Path:
        """
        Return the remainder of the path after its goal stopped at a place (``outcome.stopped``).

        For ``overlap`` and ``approach`` [m] see :func:`~.resumption.resume`.

        :raises InvalidGoal: the path has :meth:`keep_open`, its frame moves with the arm, or a
            number is out of its range.
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
        Return this path repeated, each pass moved by a step [m] from the one before.

        If a pass does not begin at the end of the one before, a line leads there, with the speed
        and blend that hold at the end of the path.

        :param alternating: every second pass goes backwards.
        :raises InvalidGoal: the path has no start, or the passes cannot be joined.
        """
        if not isinstance(times, Integral) or times < 1:
            raise InvalidGoal('repeated()', f'is asked for {times!r} times', 'use 1 or more')
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
        Return a spline that swings to both sides of this path, at right angles to the tool's z.

        Lines and arcs without corners become a spline through eight points on each wave. The
        motion is from rest to rest, at the speed along the path that :meth:`at` has set.

        :param amplitude: largest distance to either side [m].
        :param wavelength: length of one wave [m], rounded so that whole waves fit into the path.
        :raises InvalidGoal: the path has corners, motions other than lines and arcs, events,
            durations, postures or dwells; start or speed is missing; or the tool points along
            the path.
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
        Return the path as a goal whose frames are resolved, which is what the driver plans.

        :param frames: poses of the frames that the path names; None = only the frames that every
            robot has.
        :param snapshot: the state of the arm; needed if a frame moves with the arm.
        :raises InvalidGoal: a frame is not known.
        :raises RobotNotReady: a frame moves with the arm, whose pose is not known.
        """
        frames = Frames() if frames is None else frames
        return frames.resolve(self._table(), self.frame, self.tool, snapshot)

    @classmethod
    def from_goal(cls, goal: Goal) -> Path:
        """
        Return the path of a goal; the path has no start.

        If the frame of the goal has a pose but no name, the path is transformed into the base.

        :raises InvalidGoal: planning would refuse the goal, too, or its controlled frame has a
            pose but no name.
        """
        if goal.T_flange_controlled is not None and not goal.controlled_frame:
            raise InvalidGoal(
                'controlled_frame', 'has no name', 'name it, so that it can be found'
            )
        path = cls(frame=goal.frame_id, tool=goal.controlled_frame)._with(
            _points=points_of_goal(goal), _settings=settings_of(goal)
        )
        unnamed = goal.frame_id in ('', 'base') and goal.T_base_frame != IDENTITY
        return path.transformed(goal.T_base_frame) if unnamed else path

    def to_message(self) -> Any:
        """Return the goal message of the action; needs ROS."""
        from ur_cartesian_driver.action import FollowCartesianTrajectory

        return message_of(with_defaults(self._fields()), FollowCartesianTrajectory.Goal)

    @classmethod
    def from_message(cls, message: Any) -> Path:
        """
        Return the path of a goal message, whether its points are packed or not.

        :raises InvalidGoal: the message has a start time or ``validate_only``, which a path cannot
            have.
        """
        if nanoseconds(message.trajectory.header.stamp) or message.validate_only:
            raise InvalidGoal(
                'trajectory.header.stamp or validate_only',
                'is set, which is no part of a path',
                'leave it out, and set it when the goal is sent',
            )
        return cls.from_goal(goal_from_fields(message))

    def to_yaml(self) -> str:
        """Return the YAML of a goal file; reading it back gives exactly the same numbers."""
        return goal_text(self._fields())

    @classmethod
    def from_yaml(cls, text: str) -> Path:
        """
        Return the path of a goal in YAML.

        :raises GoalFileError: the text is not a goal.
        :raises InvalidGoal: as for :meth:`from_message`.
        """
        return cls.from_message(read_goal_file(text))

    def save(self, file: str | os.PathLike[str]) -> None:
        """Write a goal file, which :meth:`load` and all commands read."""
        FilePath(file).write_text(self.to_yaml(), encoding='utf-8')

    @classmethod
    def load(cls, file: str | os.PathLike[str]) -> Path:
        """Return the path of a goal file; errors as for :meth:`from_yaml`."""
        return cls.from_message(read_goal_file(FilePath(file)))

    def _table(self) -> GoalTable:
        """Return the path as a goal that names its frames, but does not have their poses."""
        self._check_ends()
        if self._start is not None and self._start.segment.dwell:
            raise InvalidGoal(
                'reversed()',
                f'has a dwell of {self._start.segment.dwell:g} s at its start, where no goal can '
                'have one',
                'call dwell(0) before it, or let it follow another path by then()',
            )
        return goal_of_points(self._points, self._settings, self.start, self.frame, self.tool)

    def _fields(self) -> dict[str, Any]:
        return fields_of_goal(self._table())


def _apart(a: Pose, b: Pose) -> str:
    return f'{1e3 * a.distance_to(b):.3g} mm and {a.angle_to(b):.3g} rad'
