# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The planned motions over time, for outputs that are switched during these motions.

An output is switched by a *record*, an instruction that is sent to the robot program between two
motions. The program reads the record when the motion before it *returns* (at that motion's stop,
or where its blend begins), and switches the output when the tool reaches the record's trigger
pose. So the time of a command (the time of its point plus its offset) becomes a trigger pose on
the planned path, and the record is sent after the last motion that has returned by then. A robot
that runs slower than planned switches at the same poses. All times here are *at full speed*: as
planned, with the robot's speed slider at 100 %.

On lines the tool moves at constant acceleration between two samples of the path, because the
planner places a sample wherever the acceleration changes. So the times of the samples and the
distances between them give the speeds at the samples, and the position of the tool at each time.
For splines, see ``path_clock``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeAlias

import numpy as np

from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.geometry.pose import conjugate, Pose, pose_from_row, rotate
from ur_cartesian_driver.motion.geometry.vectors import subtract, Vector6
from ur_cartesian_driver.motion.plan.plan import PlannedRows, ReferencePath
from ur_cartesian_driver.motion.plan.primitive import (
    LEAD_PIECES,
    LeadLaw,
    OutputRecord,
    Spline,
    Stop,
    SwitchOutput,
    Wait,
)
from ur_cartesian_driver.planning.request.point_events.path_clock import PathClock

#: Returns the poses of the TCP in base (n, 7) for poses of the tool (n, 7) in base or, if the arm
#: holds a part, in the frame of the part.
ToTcp: TypeAlias = Callable[[Floats], Floats]

#: Times that differ by at most this [s] are the same.
SAME_TIME = 1e-6
# The trigger direction is measured from this time before the trigger pose to this time after it
# [s]. If the motion is too short, a longer time is tried, up to the second value.
_DIRECTION_TIME, _MAX_DIRECTION_TIME = 0.002, 0.6
# A motion shorter than this [m], [rad] has no direction.
_MIN_MOTION = 1e-7
# A motion with less distance per turn than this [m/rad] has the direction of its turn, an axis.
_TURNING = 0.01
# The tool turns back if its displacement is less than this fraction of the distance travelled.
_TURNS_BACK = 0.1
# If the tool is past the trigger pose by more than this [m], [rad] when the record is read, the
# tool must come back to that pose before the output is switched.
_BEYOND = 1e-4


@dataclass(frozen=True, slots=True, kw_only=True)
class DrivenStretch:
    """A stretch of the path on which the robot program computes an output's value by a law."""

    #: Time at which the stretch ends, at full speed [s].
    end: float
    #: The law (for example, the value follows the speed) and the points between which it holds, as
    #: part of a sentence.
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class PlacedOutput:
    """The records of one output event of the goal, with their place in the plan."""

    #: Name of the event in error messages.
    field: str
    #: Time at which the output is switched, at full speed [s].
    time: float
    #: The row of the segment after which the records are sent.
    after_index: int
    #: The row of the segment whose report line names the output.
    report_index: int
    records: tuple[OutputRecord, ...]
    #: Description of the output and its place, for the report.
    text: str
    #: The stretch that begins here, if one does.
    stretch: DrivenStretch | None = None
    #: Whether a stretch ends here.
    ends_stretch: bool = False
    #: Time by which the output is switched before the tool is at its place, at full speed [s].
    lead: float = 0.0
    #: Name in error messages of the field that gives the lead.
    lead_field: str = ''


@dataclass(frozen=True, slots=True, kw_only=True)
class PassedPoint:
    """The passage of the tool through a point of the goal, or its stop there."""

    #: The row of the motion that leads to the point.
    row: int
    #: The row of the motion after which the record of an output at the point is read.
    after: int
    #: Time at which the point is reached [s].
    time: float
    #: Time at which an output there is triggered [s]; None = as soon as its record is read.
    trigger_time: float | None
    #: A clause for the report.
    where: str


class TimedPath:
    """The planned segments over time, with their path."""

    def __init__(
        self,
        segments: PlannedRows,
        reference: ReferencePath,
        blend_halves: Floats | None,
        start_time: float,
        point_times: Floats | None = None,
        control_cycle: float = 0.0,
        to_tcp: ToTcp | None = None,
    ) -> None:
        """
        Compute when each motion ends, and when it returns, so that the program goes on.

        :param reference: the path of the tool along the segments; its times and ``start_time``
            have the same zero.
        :param blend_halves: duration of the first half of the blend after each segment [s]; None =
            no blends.
        :param start_time: time at which the first segment begins [s].
        :param point_times: (n,) time at which each point is passed within a motion [s]; None =
            each point is at the end of a motion.
        :param control_cycle: cycle of the controller [s], needed for pulses only.
        :param to_tcp: converts poses of the tool to poses of the TCP in base, which the robot
            program compares with trigger poses; None = the tool is the TCP.
        """
        self.control_cycle = control_cycle
        self._to_tcp = to_tcp
        self._point_times = point_times
        self._primitives, self._reference = segments.primitives, reference
        self._is_spline = segments.are_spline
        self.clock = PathClock(reference, is_spline=self._is_spline)
        self.ends: Floats = start_time + np.cumsum(segments.durations)
        self._blend_halves = np.zeros(len(segments)) if blend_halves is None else blend_halves
        self._returns: Floats = self.ends - self._blend_halves
        still = (segments.lengths == 0.0) & (np.diff(segments.waypoints, prepend=-1) == 0)
        stops = {
            k: segments.primitives[k]
            for k in np.flatnonzero(still).tolist()
            if isinstance(segments.primitives[k], Stop)
        }
        self._stops, self._begins = list(stops), self.ends - segments.durations
        #: Rows of the waits, by waypoint.
        self.rests = {
            int(segments.waypoints[k]): k for k, stop in stops.items() if isinstance(stop, Wait)
        }
        self._rows = {
            waypoint: k for k, waypoint in enumerate(segments.waypoints.tolist()) if k not in stops
        }

    def point(self, waypoint: int) -> PassedPoint | None:
        """Return the passage of the tool through a point; None if no motion leads there."""
        row = self._rows.get(waypoint)
        if self._point_times is not None and (row is None or self._passes(row)):
            return self._within(waypoint, float(self._point_times[waypoint]))
        if row is None:
            return None
        return PassedPoint(
            row=row,
            after=row,
            time=float(self.ends[row]),
            trigger_time=self._at_end(row),
            where=self._where(row),
        )

    def beside(self, waypoint: int, distance: float, fraction: float, field: str) -> PassedPoint:
        """
        Return the passage of the tool through a place before or after a point.

        :param distance: distance along the path from the point to the place [m], negative before
            the point; 0 = ``fraction`` gives it.
        :param fraction: this distance as a fraction of the segment after the point or, if
            negative, before the point.
        :param field: name of the event in error messages.
        :raises InvalidGoal: the path does not lead there, or the robot program would read the
            record too late.
        """
        here, clock = self.arc_length_of(waypoint), self.clock
        name, value, where = 'distance', f'{distance:g} m', f'{1e3 * abs(distance):g} mm'
        if not distance:
            length = self.arc_length_of(waypoint + (1 if fraction > 0.0 else -1)) - here
            distance = abs(fraction) * length
            name, value = 'fraction', f'{fraction:g} ({1e3 * distance:.3g} mm)'
            where = f'{100.0 * abs(fraction):g} % of the segment'
        side = 'before' if distance < 0.0 or fraction < 0.0 else 'after'
        arc_length, length = here + distance, clock.length
        if not -_MIN_MOTION <= arc_length <= length + _MIN_MOTION or not distance:
            left = here if side == 'before' else length - here
            raise InvalidGoal(
                f'{field}.{name}',
                f'is {value}, but the path {side} point {waypoint} is {1e3 * left:.4g} mm long',
                'reduce it, or name another point',
            )
        time = clock.time_at(arc_length, leaving=distance < 0.0)
        after = self.last_returned(time)
        if after < 0:
            first = clock.arc_length(float(self._returns[0])) - here
            raise InvalidGoal(
                f'{field}.{name}',
                f'is {value}, but the robot program reads outputs only when its first motion has '
                f'returned, {1e3 * abs(first):.4g} mm {"before" if first < 0.0 else "after"} '
                f'point {waypoint}',
                'name a place after that, or add a point before it',
            )
        return PassedPoint(
            row=min(int(np.searchsorted(self.ends, time)), len(self.ends) - 1),
            after=after,
            time=time,
            trigger_time=time,
            where=f'{where} {side} it{self._doubt(time)}',
        )

    def _doubt(self, time: float) -> str:
        """Return a clause about the uncertainty of a place in a blend, or ''."""
        k = min(
            max(int(np.searchsorted(self._reference.time, time)), 1), len(self._reference.time)
        )
        bound = float(self._reference.blend_tolerance[k - 1 : k + 1, 0].max(initial=0.0))
        if bound <= 0.0:
            return ''
        return (
            f', in a blend whose shape is known to {1e3 * bound:.2g} mm (corner_deviation makes '
            'the place exact)'
        )

    def arc_length_of(self, waypoint: int) -> float:
        """Return the length of the path to a point [m]; 0 before the first motion."""
        if waypoint < 0:
            return 0.0
        if waypoint > max(self._rows):
            return self.clock.length
        point = self.point(waypoint)
        if point is None:
            return 0.0
        return self.clock.arc_length(
            point.time if point.trigger_time is None else point.trigger_time
        )

    def _within(self, waypoint: int, time: float) -> PassedPoint:
        """Return the passage of the tool through a point at a time [s] within a motion."""
        after = self.last_returned(time)
        return PassedPoint(
            row=min(int(np.searchsorted(self.ends, time)), len(self.ends) - 1),
            after=max(after, 0),
            time=time,
            trigger_time=None if after < 0 else time,
            where=f'while passing point {waypoint}',
        )

    def triggered(self, record: SwitchOutput, time: float | None, after: int) -> SwitchOutput:
        """
        Return a record that is triggered where the TCP is at a time [s].

        It has no trigger if the time is None, or if the TCP rests or turns back at that time.

        :param after: the row of the motion after which the record is read.
        """
        if time is None or (direction := self._trigger_direction(time)) is None:
            return record
        pose, read = self._tcp_pose(time), self._tcp_pose(float(self._returns[after]))
        start = (pose.inverse() @ read).rotation_vector()
        beyond = sum(a * b for a, b in zip(start, direction, strict=True))
        return replace(
            record,
            trigger_pose=pose,
            trigger_direction=direction,
            starts_beyond=beyond > _BEYOND,
        )

    def ahead(self, time: float, lead: float, field: str) -> tuple[int, float, LeadLaw]:
        """
        Return the row after which a record with a lead is read, its trigger time [s], and its law.

        The tool passes the trigger pose one lead before the place at full speed. The law delays
        the switching of a slower tool, so that the lead stays the same in real time.

        :param time: time at which the tool is at the place of the output [s].
        :param lead: real time by which the output switches before ``time`` [s].
        :raises InvalidGoal: the lead begins before the record can be read, or before a rest; the
            text gives the longest possible lead.
        """
        rests = [
            float(self.ends[k])
            for k in self._stops
            if time - lead < self.ends[k] - SAME_TIME and self._begins[k] + SAME_TIME < time
        ]
        begin = max([float(self._returns[0]), *rests])
        if time - lead < begin - SAME_TIME:
            why = (
                'the arm rests before that'
                if rests
                else 'the robot program has not read the record by then'
            )
            value = lead if field.endswith('.lead') else -lead
            raise InvalidGoal(
                field,
                f'is {value:g} s, but {why}: the longest lead here is '
                f'{max(time - begin, 0.0):.3f} s',
                'reduce the lead, or move the place',
            )
        distance, speeds, turns = self._clock_of_tcp.motion_back(time, lead, LEAD_PIECES)
        law = LeadLaw(lead=lead, distance=distance, speeds=tuple(speeds.tolist()), turns=turns)
        return self.last_returned(time - lead), time - lead, law

    def last_returned(self, time: float) -> int:
        """Return the index of the last motion that has returned by a time [s]; -1 = none."""
        return int(np.searchsorted(self._returns, time + SAME_TIME, side='right')) - 1

    def _passes(self, k: int) -> bool:
        """Return whether the arm still moves at the end of a motion."""
        piece = self._primitives[k]
        return self._blend_halves[k] > 0.0 or (isinstance(piece, Spline) and any(piece.velocities))

    def _where(self, k: int) -> str:
        """Describe where an output at the end of a motion is switched."""
        if self._blend_halves[k] > 0.0:
            return 'in the middle of its blend'
        return 'while passing it' if self._passes(k) else 'after stopping there'

    def _at_end(self, k: int) -> float | None:
        """
        Return the time [s] at which an output at the end of a motion is triggered.

        This is when the tool is closest to the target; None if it stops there.
        """
        if not self._passes(k):
            return None
        end, half = float(self.ends[k]), float(self._blend_halves[k])
        target = getattr(self._primitives[k], 'target', None)
        if half <= 0.0 or not isinstance(target, Pose):
            return end
        return self._nearest(np.array(target.position), end - half, end + half, end)

    def _nearest(self, position: Floats, begin: float, end: float, middle: float) -> float:
        """Return the time at which the tool is nearest to a position; ``middle`` if it rests."""
        times, rows = self._reference.time, self._reference.poses
        own = slice(
            max(int(np.searchsorted(times, begin, side='right')) - 1, 0),
            int(np.searchsorted(times, end)) + 1,
        )
        points, t = rows[own, :3], times[own]
        chords = np.diff(points, axis=0)
        square = (chords * chords).sum(axis=1)
        if square.max(initial=0.0) < _MIN_MOTION**2:
            return middle
        along = ((position - points[:-1]) * chords).sum(axis=1) / np.maximum(square, 1e-300)
        u = np.clip(along, 0.0, 1.0)
        k = int(np.argmin(np.linalg.norm(points[:-1] + u[:, None] * chords - position, axis=1)))
        return float(np.clip(t[k] + u[k] * (t[k + 1] - t[k]), begin, end))

    def _tcp_pose(self, time: float) -> Pose:
        """Return the pose of the TCP in base at a time."""
        pose = self.clock.pose(time)
        if self._to_tcp is None:
            return pose
        return pose_from_row(self._to_tcp(np.array([pose.row()]))[0].tolist())

    @cached_property
    def _clock_of_tcp(self) -> PathClock:
        """The motion of the TCP in base."""
        if self._to_tcp is None:
            return self.clock
        path = replace(self._reference, poses=self._to_tcp(self._reference.poses))
        return PathClock(path, is_spline=self._is_spline)

    def _trigger_direction(self, time: float) -> Vector6 | None:
        """Return the direction of the TCP at a time; None if it rests or turns back there."""
        pose, half = self._tcp_pose(time), _DIRECTION_TIME
        while half <= _MAX_DIRECTION_TIME:
            a, b = self._tcp_pose(time - half), self._tcp_pose(time + half)
            distance, angle = a.distance_to(b), a.angle_to(b)
            if distance < _TURNS_BACK * (a.distance_to(pose) + pose.distance_to(b)):
                return None
            if distance > max(_MIN_MOTION, _TURNING * angle):
                displacement = subtract(b.position, a.position)
                x, y, z = rotate(conjugate(pose.quaternion), displacement)
                return (x / distance, y / distance, z / distance, 0.0, 0.0, 0.0)
            if angle > _MIN_MOTION:
                *_, x, y, z = (a.inverse() @ b).rotation_vector()
                return (0.0, 0.0, 0.0, x / angle, y / angle, z / angle)
            half *= 4.0
        return None
