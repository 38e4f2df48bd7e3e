# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Make a goal from the rest of a goal that was stopped on its way.

The resumed goal approaches a place on the path some way before the stop (the overlap), puts the
outputs into their state at this place, and follows the original path to its end. The rest of a
line is a line, the rest of an arc an arc of the same circle, and the rest of a spline the same
curve, on which the arm gathers speed within the overlap.

A place on a path is a number: ``k + u`` is at the fraction u of the segment to point k.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import floor, inf, sqrt
from typing import Any

import numpy as np

from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.events import PathPlace
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, Pose, pose_from_row
from ur_cartesian_driver.motion.geometry.vectors import vector6
from ur_cartesian_driver.motion.goal.goal import (
    Goal,
    Posture,
    Segment,
    SegmentType,
    Waypoint,
)
from ur_cartesian_driver.motion.goal.goal_columns import goal_table, GoalTable, rows_where
from ur_cartesian_driver.motion.goal.known_frames import FRAMES_OF_TOOL
from ur_cartesian_driver.planning.geometry.blended_path import curves_of
from ur_cartesian_driver.planning.geometry.tool_spline import ToolPoints, ToolSpline
from ur_cartesian_driver.planning.request.goal_fields import (
    gives_joints,
    is_rounded,
    is_spline,
    is_timed,
    resolve_execution_mode,
)
from ur_cartesian_driver.planning.request.point_events.goal_rest import GoalRest, NO_FRACTION
from ur_cartesian_driver.planning.request.point_events.registry import EVENT_KINDS
from ur_cartesian_driver.planning.spline.spline_points import tool_points

#: Distance before the stop at which the path is resumed, and distance from the path at which the
#: approach begins, backwards along the tool's z axis [m].
OVERLAP, APPROACH = 0.005, 0.03
#: The largest overlap and the largest approach [m]; more must be millimetres by mistake.
MAX_RESUME_LENGTH = 1.0
#: In a goal with times: time until the approach begins [s], and speed of the approach [m/s].
APPROACH_TIME, APPROACH_SPEED = 4.0, 0.03
#: Factor on blend radii: on arcs, blends begin somewhat farther from their points.
_BLEND_MARGIN = 1.05
#: If less than this remains of a segment [m], it is left out.
_NOTHING = 1e-5
#: The smallest length, and the smallest height above the chord, of the rest of an arc [m].
_MIN_ARC, _MIN_HEIGHT = 4e-3, 3e-5
#: The shortest time in which the arm gathers speed on a spline [s]; number of points in this time.
_RAMP_TIME, _RAMP_POINTS = 0.4, 8
#: Number of chords that measure the length of a piece of a spline.
_CHORDS = 64
_DIGITS = 9
_JOINT_MOTIONS = (SegmentType.JOINT, SegmentType.OPTIMIZED_JOINT)


@dataclass(frozen=True, slots=True, kw_only=True)
class ResumedGoal:
    """The rest of a stopped goal (the original), as a goal of its own."""

    goal: Goal
    #: The place on the original path where this goal begins.
    begin: PathPlace
    #: (n,) the places of this goal's points on the original path, as numbers; see the module.
    places: tuple[float, ...]

    def original(self, place: PathPlace) -> PathPlace:
        """Return the place on the original path for a place on the path of this goal."""
        here = self.places[min(place.point, len(self.places) - 1)]
        before = self.places[place.point - 1] if place.point else here
        return _path_place(before + place.fraction * (here - before), round(self.places[-1]))


def resume(
    goal: Goal,
    place: PathPlace,
    *,
    overlap: float = OVERLAP,
    approach: float = APPROACH,
    start: Pose | None = None,
) -> ResumedGoal:
    """
    Return the rest of a goal that was stopped at a place, as a goal.

    :param place: the place of the stop, as the outcome of the goal reports it.
    :param overlap: distance before that place at which the path is resumed [m]; farther if a blend
        is there, but never before the beginning of a joint motion or of the path.
    :param approach: distance from which the tool comes down to the path, backwards along the z
        axis of the tool [m]; 0 = straight to the path.
    :param start: pose of the tool when the goal began, in the frame of the goal; needed only for a
        spline whose first twist is NaN.
    :raises InvalidGoal: the goal is kept open, its frame moves with the arm, it is a spline with
        dwells, or a number is out of its range.
    """
    return _Resumption(goal, place, overlap, approach, start).resumed()


class _Resumption:
    """Makes the resumed goal."""

    def __init__(
        self, goal: Goal, place: PathPlace, overlap: float, approach: float, start: Pose | None
    ) -> None:
        self.goal, self.approach = goal, approach
        self.points = tuple(goal.waypoints)
        self.segments = tuple(goal.segments) or (Segment(),) * len(self.points)
        _check(goal, place, overlap, approach)
        table = goal_table(replace(goal, T_base_frame=IDENTITY))
        self.timed, self.mode = is_timed(table), resolve_execution_mode(table)
        self.spline = _Spline(table, start) if is_spline(table) else None
        self.rounded = is_rounded(table)
        poses = table.waypoints.poses
        #: The lines and arcs; the beginning of segment 0 is not known, but it is never cut.
        self.curves, self.faults = curves_of(
            table.motions, IDENTITY, np.concatenate([poses[:1], poses[:-1]]), poses.copy()
        )
        # Joint motions would turn a held part.
        by_moves = self.spline is None and not self.rounded
        self.moves_joints = by_moves and goal.moving_frame is None
        self.stopped = place.point + place.fraction
        self.begin = self._begin(place, overlap)

    def resumed(self) -> ResumedGoal:
        """Return the resumed goal."""
        n, k = len(self.points), min(floor(self.begin), len(self.points) - 1)
        if k == self.begin == self.stopped > 0.0:
            k -= 1  # the arm rests at a point, and is not on its way to the next one
        u = self.begin - k
        if self._is_new_start(k):
            points, segments = list(self.points[k:]), self._from_anywhere(k)
            places: list[float] = []
            times = self._times(k, 0.0)
        else:
            points, segments, places = self._approach(k, u)
            if self.spline is not None:
                return self._resumed_spline(points)
            times = self._times(k, u, approach=len(points))
            is_turn = self._length(k) <= _NOTHING and u < 1.0
            if self._length(k) * (1.0 - u) > _NOTHING or is_turn:
                points.append(self.points[k])
                segments.append(self._cut(k, u))
            else:  # the arm is at the end of the segment: the next segment follows
                self.begin = k + 1.0
                places = [self.begin] * len(points)
                del times[len(points)]
            points += self.points[k + 1 :]
            segments += self.segments[k + 1 :]
        places += [j + 1.0 for j in range(n - len(points) + len(places), n)]
        if self.timed:
            points = [replace(point, time=time) for point, time in zip(points, times, strict=True)]
        return self._goal(points, segments, places)

    def _goal(
        self, points: Sequence[Waypoint], segments: Sequence[Segment], places: Sequence[float]
    ) -> ResumedGoal:
        rest = GoalRest(
            begin=self.begin,
            stopped=self.stopped,
            places=places,
            time_since=self._time_since,
            distance=self._distance,
            behind=self._behind,
        )
        if self.rounded and not self.goal.corner_deviation:
            segments = self._with_a_corner(segments)
        left: dict[str, Any] = {
            kind.field: tuple(kind.left(kind.of(self.goal), rest)) for kind in EVENT_KINDS.values()
        }
        goal = replace(
            self.goal,
            waypoints=tuple(points),
            segments=tuple(segments) if self.goal.segments or self.spline is None else (),
            **left,
            execution=self.mode,
            age=None,
        )
        return ResumedGoal(
            goal=goal,
            begin=_path_place(self.begin, len(self.points)),
            places=tuple(places),
        )

    def _with_a_corner(self, segments: Sequence[Segment]) -> Sequence[Segment]:
        """Return segments, one with a corner deviation, which has no effect at the last point."""
        if any(segment.corner_deviation for segment in segments):
            return segments
        largest = max(segment.corner_deviation for segment in self.segments)
        return [*segments[:-1], replace(segments[-1], corner_deviation=largest)]

    # -- the beginning ---------------------------------------------------------------------------

    def _is_new_start(self, k: int) -> bool:
        """Return whether a segment can begin wherever the arm is."""
        return k == 0 or self.segments[k].type in _JOINT_MOTIONS

    def _from_anywhere(self, k: int) -> list[Segment]:
        """Return the segments from k on, the first of which begins wherever the arm is."""
        first, *rest = self.segments[k:]
        # The arm may be in the blend already. A goal that demands a speed keeps the blend, because
        # without it the tool would stop.
        if self.stopped > k and not self.goal.min_speed_fraction:
            first = replace(first, blend_radius=0.0)
        return [first, *rest]

    def _begin(self, place: PathPlace, overlap: float) -> float:
        """Return the place at which the path is resumed."""
        k, u, left = place.point, place.fraction, overlap
        if self._is_new_start(k):
            return float(k)
        while (length := self._length(k)) * u < left:
            left -= length * u
            if self._is_new_start(k - 1):
                return float(k)
            k, u = k - 1, 1.0
        u -= left / length if length > 0.0 else 0.0
        return self._before_blends(k, u)

    def _before_blends(self, k: int, u: float) -> float:
        """Return a place outside of blends: the given one, or one before the blends around it."""
        if self.spline is not None:
            return k + u
        while True:
            length = self._length(k)
            after, before = (
                _BLEND_MARGIN * self.segments[j].blend_radius if j + 1 < len(self.points) else 0.0
                for j in (k, k - 1)
            )
            if after > 0.0 and length * (1.0 - u) < after:
                u = max(0.0, 1.0 - after / length)
            if before <= 0.0 or length * u >= before:
                return k + self._enough_of_an_arc(k, u)
            if self._is_new_start(k - 1):
                return float(k - 1)
            k, u = k - 1, 1.0

    def _enough_of_an_arc(self, k: int, u: float) -> float:
        """Return a fraction, reduced on an arc until the rest of the arc determines a circle."""
        if self.segments[k].type is not SegmentType.CIRCULAR:
            return u
        length, radius = self._length(k), float(self.curves.arcs.radius[k])
        least = max(_MIN_ARC, sqrt(8.0 * _MIN_HEIGHT * radius))
        return min(u, max(0.0, 1.0 - least / length))

    # -- the curves ------------------------------------------------------------------------------

    def _length(self, k: int) -> float:
        if self.spline is not None:
            return self.spline.length(k)
        if k in self.faults:
            raise InvalidGoal(f'segments[{k}].via', f'makes no arc: {self.faults[k]}')
        return float(self.curves.length[k])

    def _distance(self, begin: float, end: float) -> float:
        """Return the way from one place to another [m]; negative if it leads back."""
        if end < begin:
            return -self._distance(end, begin)
        return sum(
            self._length(k) * (min(end, k + 1.0) - max(begin, float(k)))
            for k in range(floor(begin), min(floor(end) + 1, len(self.points)))
        )

    def _behind(self, place: float, distance: float) -> float:
        """Return the place at a distance [m] after a place; a negative distance leads back."""
        step = 1 if distance > 0.0 else -1
        k, left = round(place) - (step < 0), abs(distance)
        while 0 <= k < len(self.points) and (length := self._length(k)) < left:
            left, k = left - length, k + step
        if k < 0:
            return 0.5  # somewhere on segment 0, whose length is not known
        if k >= len(self.points):
            return float(k)
        u = left / length if length > 0.0 else 0.0
        return k + u if step > 0 else k + 1.0 - u

    def _pose(self, k: int, u: float) -> Pose:
        if self.spline is not None:
            return self.spline.pose(k, u)
        return pose_from_row(self.curves.rows(np.array([k]), np.array([u]))[0])

    def _cut(self, k: int, u: float) -> Segment:
        """Return the rest of a segment after a fraction of it."""
        segment = self.segments[k]
        if segment.type is not SegmentType.CIRCULAR:
            return segment
        return replace(segment, via=self._pose(k, 0.5 * (1.0 + u)), via_posture=Posture())

    # -- the approach ----------------------------------------------------------------------------

    def _approach(self, k: int, u: float) -> tuple[list[Waypoint], list[Segment], list[float]]:
        """
        Return points, segments and places of the approach, which ends at rest on the path.

        :param k: segment on which the approach ends, at the fraction ``u``.
        """
        there = self._pose(k, u)
        poses = [there]
        if self.approach > 0.0:
            poses.insert(0, there @ Pose((0.0, 0.0, -self.approach)))
        kinds = [SegmentType.LINEAR] * len(poses)
        if self.moves_joints and (len(poses) > 1 or self.goal.min_speed_fraction):
            kinds[0] = SegmentType.JOINT
        if self.moves_joints and self.goal.min_speed_fraction:
            kinds[-1] = SegmentType.JOINT  # a stop between lines would break min_speed_fraction
        cut = self.segments[k]
        free = Segment(free_axis=cut.free_axis, free_min=cut.free_min, free_max=cut.free_max)
        return (
            [Waypoint(pose=pose) for pose in poses],
            [replace(free, type=kind) for kind in kinds],
            [self.begin] * len(poses),
        )

    def _approach_times(self) -> list[float]:
        if self.approach <= 0.0:
            return [APPROACH_TIME]
        return [APPROACH_TIME, APPROACH_TIME + max(0.5, self.approach / APPROACH_SPEED)]

    def _times(self, k: int, u: float, approach: int = 0) -> list[float]:
        """Return the times of all points of a goal without a spline, with the approach first."""
        if not self.timed:
            return [0.0] * (len(self.points) - k + approach)
        arrive = [point.time for point in self.points]
        took = arrive[k] - (arrive[k - 1] if k else 0.0)
        dwell = self.segments[k - 1].dwell if k else 0.0
        times = self._approach_times() if approach else []
        # From rest to rest at the same acceleration, the time grows as the root of the distance.
        took = sqrt(1.0 - u) * (took - dwell)
        end = times[-1] + took if times else max(took, APPROACH_TIME * (k > 0))
        return [*times, *(round(end + time - arrive[k], _DIGITS) for time in arrive[k:])]

    # -- splines ---------------------------------------------------------------------------------

    def _resumed_spline(self, points: list[Waypoint]) -> ResumedGoal:
        """Return the resumed goal of a spline, on which the arm first gathers speed from rest."""
        assert self.spline is not None
        spline, zero = self.spline, self._approach_times()[: len(points)]
        points = [replace(point, time=time) for point, time in zip(points, zero, strict=True)]
        places = [self.begin] * len(points)
        begin, end = spline.time(self.begin), spline.end
        ramp = min(max(2.0 * (spline.time(self.stopped) - begin), _RAMP_TIME), end - begin)
        # After a time t of the ramp, t^2 / (2 ramp) of the curve's time has passed.
        knots = [time for time in spline.knots if begin + NO_FRACTION < time]
        gathered = begin + 0.5 * ramp * np.linspace(0.0, 1.0, _RAMP_POINTS + 1)[1:] ** 2
        apart = ramp / _RAMP_POINTS**2
        inner = [x for x in gathered.tolist() if all(abs(x - knot) > apart for knot in knots)]
        if spline.points.quintic:
            points[-1] = replace(
                points[-1], acceleration=spline.waypoint(begin, 0.0, 0.0, 1.0 / ramp).acceleration
            )
        after = zero[-1]
        for time in sorted([*inner, *knots]):
            passed = time - begin
            if passed < 0.5 * ramp - NO_FRACTION:
                t = sqrt(2.0 * ramp * passed)
                rate, gain = t / ramp, 1.0 / ramp
            else:
                t, rate, gain = passed + 0.5 * ramp, 1.0, 0.0
            points.append(spline.waypoint(time, after + t, rate, gain))
            places.append(spline.place(time))
        last = len(self.segments) - 1
        segments = [self.segments[min(floor(p - NO_FRACTION), last)] for p in places]
        return self._goal(points, segments, places)

    # -- events ----------------------------------------------------------------------------------

    def _time_since(self, place: float, field: str, offset: float) -> float:
        """
        Return the time from a place to the place of resumption [s]; inf = not known.

        :raises InvalidGoal: it is not known, and the offset is positive.
        """
        if self.timed:
            return self._time(self.begin) - self._time(place)
        elapsed = 0.0
        for k in range(floor(place), len(self.points)):
            if self.begin <= k:
                break
            if place <= k and k > 0:
                elapsed += self.segments[k - 1].dwell
            if not self.segments[k].velocity:
                if offset <= 0.0:
                    return inf
                raise InvalidGoal(
                    field,
                    f'is {offset:g} s after its place, but when the arm was there is not known: '
                    f'segments[{k}] has no velocity',
                    'give it one, or switch the output at a point',
                )
            part = min(1.0, self.begin - k) - max(0.0, place - k)
            elapsed += part * self._length(k) / self.segments[k].velocity
        return elapsed

    def _time(self, place: float) -> float:
        """Return the time of a place of a timed goal [s], interpolated between its points."""
        k = min(floor(place), len(self.points) - 1)
        before = self.points[k - 1].time if k else 0.0
        return before + (place - k) * (self.points[k].time - before)


class _Spline:
    """The curve of a spline goal in its frame, from the start if known, else from point 0."""

    def __init__(self, table: GoalTable, start: Pose | None) -> None:
        points = table.waypoints
        #: The number of the first segment that is known.
        self.first = 1 if start is None else 0
        if len(points) == self.first:
            self.curve, self.knots = None, [float(points.times[0])]
            return
        begin = ToolPoints(
            times=np.zeros(1) if start else points.times[:1],
            poses=np.array([start.row()]) if start else points.poses[:1],
            twists=np.nan_to_num(points.twists[:1]) if start is None else np.zeros((1, 6)),
            accelerations=np.zeros((1, 6)),
            quintic=False,
        )
        rest = replace(
            table,
            waypoints=points[self.first :],
            segments=table.segments[self.first :],
            io_commands=(),
        )
        self.points = tool_points(rest, begin)
        self.curve = ToolSpline.through(self.points)
        self.knots = points.times.tolist()

    @property
    def end(self) -> float:
        """The time of the last point [s]."""
        return float(self.knots[-1])

    def time(self, place: float) -> float:
        """Return the time of a place [s]."""
        k = min(floor(place), len(self.knots) - 1)
        before = self.knots[k - 1] if k else 0.0
        return float(before + (place - k) * (self.knots[k] - before))

    def place(self, time: float) -> float:
        """Return the place at a time [s]."""
        k = min(int(np.searchsorted(self.knots, time - 1e-9)), len(self.knots) - 1)
        before = self.knots[k - 1] if k else 0.0
        return k + min(1.0, (time - before) / (self.knots[k] - before))

    def pose(self, k: int, u: float) -> Pose:
        """Return the pose at a place."""
        assert self.curve is not None
        row = self.curve.at(np.array([self.time(k + u)])).poses[0]
        return pose_from_row(row.tolist())

    def length(self, k: int) -> float:
        """Return the length of a segment [m], 0 if it is not known."""
        if self.curve is None or k < self.first:
            return 0.0
        times = np.linspace(self.time(k), self.time(k + 1.0), _CHORDS + 1)
        return float(
            np.linalg.norm(np.diff(self.curve.at(times).poses[:, :3], axis=0), axis=1).sum()
        )

    def waypoint(self, time: float, at: float, rate: float, gain: float) -> Waypoint:
        """
        Return the point of the curve at a time [s], for a goal that passes the curve at a rate.

        :param at: time of the point in that goal [s].
        :param rate: time on the curve per time of that goal; ``gain``: change of the rate [1/s].
        """
        assert self.curve is not None
        rows = self.curve.at(np.array([time]))
        last = time >= self.end - 1e-9
        twist = rows.twists[0] * rate * (not last)
        acceleration = (rows.accelerations[0] * rate**2 + rows.twists[0] * gain) * (not last)
        return Waypoint(
            time=round(at, _DIGITS),
            pose=pose_from_row(rows.poses[0].tolist()),
            twist=vector6(twist.tolist()),
            acceleration=vector6((acceleration * self.points.quintic).tolist()),
        )


def _path_place(place: float, points: int) -> PathPlace:
    k = max(min(floor(place), points - 1), 0)
    return PathPlace(point=k, fraction=min(1.0, place - k))


def _check(goal: Goal, place: PathPlace, overlap: float, approach: float) -> None:
    if goal.keep_open:
        raise InvalidGoal(
            'keep_open',
            'is true, so the goal does not hold all points of its path',
            'send the rest of the path as a goal of its own',
        )
    # The name may have a prefix. If the goal has the pose of its frame, this pose is kept.
    moved = goal.T_base_frame == IDENTITY and goal.moving_frame is None
    if goal.frame_id.endswith(FRAMES_OF_TOOL) and moved:
        raise InvalidGoal(
            'trajectory.header.frame_id',
            f'is {goal.frame_id}, which has moved with the arm since the goal began, and the path '
            'with it',
            'give the path in base, or in another frame that stays',
        )
    for k in rows_where(gives_joints(goal_table(goal)))[:1]:
        raise InvalidGoal(
            f'trajectory.points[{k}].pose',
            'is given by joint positions, so the path around it is not known without the arm',
            'give the pose, or send the rest of the path as a goal of its own',
        )
    for k, segment in enumerate(goal.segments):
        if segment.dwell and resolve_execution_mode(goal_table(goal)).traits.is_spline:
            raise InvalidGoal(
                f'segments[{k}].dwell',
                'is in a spline, of which no part can be resumed',
                'split the goal at its rests',
            )
    if not (0 <= place.point < len(goal.waypoints) and 0.0 <= place.fraction <= 1.0):
        raise InvalidGoal(
            'stopped_point, stopped_fraction',
            f'are {place.point} and {place.fraction:g}, but the goal has points 0 to '
            f'{len(goal.waypoints) - 1} and fractions from 0 to 1',
            'take those of the result of this goal',
        )
    for name, value in (('overlap', overlap), ('approach', approach)):
        if not 0.0 <= value <= MAX_RESUME_LENGTH:  # or NaN
            raise InvalidGoal(
                name,
                f'is {value:g} m, but must be from 0 to {MAX_RESUME_LENGTH:g} m',
                'mm() converts',
            )
