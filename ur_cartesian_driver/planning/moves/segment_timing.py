# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The speed of each segment, so that times are met within the limits.

``movel`` and ``movej`` take a time on the wire. ``movec`` and ``movep`` do not: their speed is
derived so that the time is met. How moves and blends follow each other is that of
:mod:`~.move_chain`; what they are asked for is found in :mod:`~.speed_requests`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import ceil, isnan
from typing import Any, NamedTuple

import numpy as np

from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES, RobotModel
from ur_cartesian_driver.motion.errors import InvalidGoal, TooFast
from ur_cartesian_driver.motion.goal import SegmentType
from ur_cartesian_driver.motion.plan import PlannedSegment
from ur_cartesian_driver.motion.pose_rows import Floats
from ur_cartesian_driver.planning.moves.move_chain import MoveChain, Moves, Rows
from ur_cartesian_driver.planning.moves.segment_data import (
    BlendSamples,
    SegmentGeometry,
    SegmentTiming,
)
from ur_cartesian_driver.planning.moves.speed_limits import is_blended
from ur_cartesian_driver.planning.moves.speed_requests import (
    RAMP_SHARE,
    SegmentTimer,
    SpeedRequest,
)
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.goal_fields import point_field, segment_field

#: Times that differ by less than this factor are the same. One that comes out longer by less than
#: the second is kept.
_NEARLY, _KEPT = 1.0 + 1e-5, 1.002
#: Minimum speed that the wire carries accurately enough: it counts in millionths.
MIN_SPEED = 1e-5
#: Motions whose blends the robot leaves out if it passes their radius within a control cycle.
_NEEDS_A_CYCLE = (SegmentType.CIRCULAR, SegmentType.PROCESS)
#: What exceeds a limit by less than this factor keeps to it. Faster moves are slowed so often.
_WITHIN = 1.0 + 1e-6
_MAX_ROUNDS = 40
#: A point that is passed no earlier than this is in time [s].
_EARLY = 0.001


def shortest_duration(
    length: Floats, speed: Floats, acceleration: Floats, ramps: Floats | float
) -> Floats:
    """
    Return the shortest times of motions that are sent with speeds [s].

    From rest to rest T = d/v + v/a if d > v^2/a, else the triangle T = 2 sqrt(d/a).

    :param ramps: from and to rest, 0 to 2.
    """
    peak = np.minimum(speed, np.sqrt(2.0 * acceleration * length / np.maximum(ramps, 1e-9)))
    time: Floats = length / peak + 0.5 * ramps * peak / acceleration
    return time


def schedule(
    geometries: Sequence[SegmentGeometry],
    options: PlanningOptions,
    model: RobotModel,
    blend_samples: BlendSamples,
    running: PlannedSegment | None = None,
) -> tuple[list[SegmentTiming], MoveChain]:
    """
    Return the timing of every segment, and the chain of moves.

    :param running: the first segment as it was planned, where it has been sent.
    :raises TooFast: a time needs more speed or acceleration than the limits allow.
    :raises InvalidGoal: a speed is too low for the wire.
    """
    timers = [SegmentTimer(geometry, options, model) for geometry in geometries]
    timetable = _Timetable(timers, options, blend_samples, running)
    timetable.solve()
    return timetable.timings(), timetable.chain


class _Result(NamedTuple):
    """What has been found for a segment, or columns of it; see :class:`SegmentTiming`."""

    speed: Any
    acceleration: Any
    wire_time: Any
    duration: Any
    #: Its time, longer where it is slowed [s]; NaN = none.
    wanted: Any
    #: So much before its time its point is passed [s].
    ahead: Any
    least_time: Any
    greatest_time: Any


class _Timetable:
    """Finds the speeds of all segments; columns (n,)."""

    def __init__(
        self,
        timers: Sequence[SegmentTimer],
        options: PlanningOptions,
        blend_samples: BlendSamples,
        running: PlannedSegment | None,
    ) -> None:
        """Begin with what is asked for."""
        self._timers, self._options, self._samples = timers, options, blend_samples
        self._requests = requests = [
            timer.request() if k or running is None else timer.request_again(running)
            for k, timer in enumerate(timers)
        ]
        self._time, min_time, self._speed, self._least, self._most, self._rate, timed = np.array(
            [
                (
                    r.time,
                    r.min_time,
                    r.speed,
                    r.acceleration,
                    r.max_acceleration,
                    r.rate,
                    r.has_wire_time,
                )
                for r in requests
            ]
        ).T
        self._timed = timed > 0.0
        self._wanted = np.maximum(self._time, min_time)
        #: So much before their times points are passed, for the sake of the next ones [s].
        self._ahead = np.zeros(len(timers))
        #: What slows a segment where it is not a limit of its own.
        self._limit_names: dict[int, str] = {}
        self._moves = Moves.of([timer.move() for timer in timers])
        # No time on the wire is less than the robot needs from rest to rest, however it blends.
        self._max_rate = np.where(
            np.isnan(self._time), self._rate, 1.0 / np.maximum(min_time, 1e-9)
        )
        self._allow_acceleration()
        self._rate = np.minimum(self._rate, self._max_rate)
        self._moves = self._at_rate(np.arange(len(timers)), self._rate)
        entry = running.blend_entry if running and self._moves.tail[0] > 0.0 else None
        self.chain = MoveChain(self._moves, entry)
        if entry is not None:
            self._wanted[0] = self.chain.times.between[0] + entry.half

    def solve(self) -> None:
        """Meet the times within the limits; what cannot be met takes longer."""
        for _ in range(_MAX_ROUNDS):
            wanted = self._wanted - self._ahead + np.append(0.0, self._ahead[:-1])
            self.chain.meet(wanted, self._rate, self._max_rate, self._at_rate)
            late = self.chain.times.durations - wanted
            late[~((late > wanted * (_NEARLY - 1.0)) & (self._rate >= self._max_rate))] = 0.0
            if not self._slow_down() and not self._go_ahead(late):
                break
        self._wanted += np.where(late > self._wanted * (_KEPT - 1.0), late, 0.0)

    def _go_ahead(self, late: Floats) -> bool:
        """
        Let points be passed early where the next one would be late; return whether there are any.

        Where a slow move is blended into a fast one they share the speed in the blend.
        """
        moves = self._moves
        if not late.any():
            return False
        # What cannot be passed as early as that is not: its time at rest has changed since.
        back = np.minimum(late, self._ahead)
        self._ahead -= back
        alone = shortest_duration(moves.length, self._speed, self._most, 2.0)
        late = late - back
        late = np.where(self._timed | (self._wanted > alone), late, 0.0)
        # By how much moves can take less time, so that their own points are passed early.
        spare = np.where(
            self._timed,
            1.0 / self._rate - 1.0 / self._max_rate,
            np.maximum(self._wanted - alone, 0.0),
        )
        blended, most = moves.tail > 0.0, 0.7 * self._wanted - self._ahead
        more = np.zeros(len(late))
        for k in range(len(late) - 1, 0, -1):
            needed = late[k] + max(more[k] - spare[k], 0.0)
            if 0.0 < needed < most[k - 1] and blended[k - 1]:
                more[k - 1] = needed
        self._ahead += more
        return bool((more + back).max() > _EARLY * (_NEARLY - 1.0))

    def timings(self) -> list[SegmentTiming]:
        """
        Return the timings of the segments.

        :raises GoalRefused: a time is too short, a speed too low, a blend too small.
        """
        times, moves = self.chain.times, self._moves
        columns = _Result(
            moves.speed,
            moves.acceleration,
            moves.time,
            times.durations,
            self._wanted,
            self._ahead,
            *self._bounds(),
        )
        return [
            _timing(timer, request, self._limit_names.get(k, timer.limits.name), _Result(*row))
            for k, (timer, request, *row) in enumerate(
                zip(self._timers, self._requests, *(c.tolist() for c in columns), strict=True)
            )
        ]

    def _at_rate(self, rows: Rows, rate: Floats) -> Moves:
        """Return moves at rates; a rate beyond the greatest speed stands for more acceleration."""
        moves, speed = self._moves.take(rows), self._speed[rows]
        asked = rate * moves.length
        more = np.maximum(asked / speed, 1.0) ** 2
        moves.speed = np.minimum(asked, speed)
        moves.acceleration = np.minimum(self._least[rows] * more, self._most[rows])
        moves.time = np.where(self._timed[rows], 1.0 / rate, 0.0)
        return moves

    def _allow_acceleration(self) -> None:
        """Let moves that meet a time by their speed accelerate as hard as they may."""
        self._max_rate = np.where(
            self._timed | np.isnan(self._time),
            self._max_rate,
            self._speed / self._moves.length * np.sqrt(self._most / self._least),
        )

    def _slow_down(self) -> bool:
        """Slow moves that are too fast when blended; return whether there are any."""
        times, slowed = self.chain.times, False
        over = np.maximum(
            np.maximum(times.cruise, times.enter) / self._speed,
            np.sqrt(
                np.maximum(
                    np.where(times.enter != times.cruise, times.acceleration, 0.0),
                    np.where(times.leave < times.cruise, times.braking, 0.0),
                )
                / self._most
            ),
        )
        slower = np.where(self._timed & (over > _WITHIN), self._rate / over, self._max_rate)
        speed = self._speed.copy()
        for k, ratio, name in self._fast_blends():
            # The move at the faster end of the blend is slowed.
            row = k if times.end_rate[k] > times.begin_rate[k] else k - 1
            there = times.enter[k] if row == k else times.leave[k - 1]
            if self._timed[row]:
                slower[row] = min(slower[row], self._rate[row] / ratio)
            else:
                speed[row] = min(speed[row], there / ratio)
            self._limit_names[row] = name
        by_speed = ~self._timed & (speed < self._speed)
        self._speed = speed
        slower = np.where(by_speed, np.minimum(slower, speed / self._moves.length), slower)
        rows = np.flatnonzero((slower < self._max_rate) | by_speed)
        self._max_rate = slower
        self._allow_acceleration()
        self._rate = np.minimum(self._rate, self._max_rate)
        if len(rows):
            self._moves.put(rows, self._at_rate(rows, self._rate[rows]))
            self.chain.follow(rows)
            slowed = True
        return slowed

    def _fast_blends(self) -> Iterator[tuple[int, float, str]]:
        """Yield the blends (as the rows behind them) that are too fast, and how much."""
        samples, times = self._samples, self.chain.times
        if not len(samples.s):
            return
        row = samples.index - self._timers[0].geometry.index + 1
        begin, end = times.begin_rate[row], times.end_rate[row]
        rate = np.sqrt(np.maximum(begin**2 + (end**2 - begin**2) * samples.s, 0.0))
        least = samples.joint_time
        if self._options.max_tool_speed > 0.0:
            least = np.maximum(least, samples.tool_distance / self._options.max_tool_speed)
        over = rate * least
        for worst in np.flatnonzero(over > _WITHIN):
            name = f'max_tool_speed = {self._options.max_tool_speed:g} m/s'
            joint = samples.joint[worst]
            if samples.joint_time[worst] >= least[worst]:
                source = self._timers[0].model.speed_source(joint)
                name = (
                    f'the joint speed limits ({JOINT_NAMES[joint]} in the blend at point '
                    f'{samples.index[worst]}{source})'
                )
            yield int(row[worst]), float(over[worst]), name

    def _bounds(self) -> tuple[Floats, Floats]:
        """
        Return bounds of the times of segments, whatever the law by which blends are passed [s].

        At most the arm rests at each point; at least it cruises between the blends and passes each
        straight across, at the faster of its two speeds.
        """
        times, moves, geometries = (
            self.chain.times,
            self._moves,
            [t.geometry for t in self._timers],
        )
        blended = np.array([is_blended(geometry) for geometry in geometries])
        timed = moves.time > 0.0
        time = np.where(timed, moves.time, 1.0)
        speed = np.where(timed, moves.length / time / (1.0 - RAMP_SHARE), moves.speed)
        acceleration = np.where(timed, speed / (RAMP_SHARE * time), moves.acceleration)
        ramps = np.array(
            [(g.blend_before is None) + (g.blend_after is None) for g in geometries], dtype=float
        )
        between = moves.length * np.array([g.unblended_fraction for g in geometries])
        least = shortest_duration(between, speed, acceleration, ramps)
        greatest = shortest_duration(moves.length, speed, acceleration, 2.0)
        tool_speed = speed * np.array([max(g.curve.length, 1e-9) for g in geometries])
        tool_speed /= moves.length
        # Legs of the radius r with a chord c between them: no blend is longer than r + c / 2.
        across = np.array(
            [
                2.0 * max(g.blend_after.length - g.blend_after.radius, 0.0)
                if g.blend_after
                else 0.0
                for g in geometries
            ]
        )
        least[:-1] += across[:-1] / np.maximum(tool_speed[:-1], tool_speed[1:])
        return (
            np.where(blended, least, times.durations),
            np.where(blended, np.where(timed, moves.time, greatest), times.durations),
        )


def _timing(
    timer: SegmentTimer, request: SpeedRequest, limit_name: str, result: _Result
) -> SegmentTiming:
    """
    Return the timing of a segment.

    :param limit_name: what slows it.
    :raises GoalRefused: its time is too short, its speed too low, its blend too small.
    """
    geometry, remark = timer.geometry, request.remark
    speed, acceleration, wire_time, duration, wanted, ahead, least, greatest = result
    if wanted > request.time * _NEARLY:
        remark = _too_fast(timer, wanted, limit_name)
    elif wire_time > 1.0 / request.rate * _NEARLY and isnan(request.time):
        remark = (
            f'point {geometry.index}: takes {wire_time:.3f} s instead of '
            f'{1.0 / request.rate:.3f} s, because of {limit_name}'
        )
    elif isnan(request.time) and wire_time <= 0.0 and speed * _NEARLY < request.speed:
        remark = (
            f'point {geometry.index}: slowed from {request.speed:.3g} to {speed:.3g} '
            f'{timer.speed_unit} by {limit_name}'
        )
    elif ahead > _EARLY:
        remark = (
            f'point {geometry.index}: passed {ahead:.3f} s before its time, because the next '
            'segment could not make good the time in the blend'
        )
    timing = SegmentTiming(
        speed,
        acceleration / timer.acceleration_unit,
        request.source,
        remark,
        wire_time=wire_time,
        duration=duration,
        least_time=least,
        greatest_time=greatest,
    )
    if wire_time > 0.0:
        # A third each of speeding up, cruising and braking.
        timing.velocity = timer.length / wire_time / (1.0 - RAMP_SHARE)
        timing.acceleration = timing.velocity / (RAMP_SHARE * wire_time)
    _check_wire(timer, timing)
    _check_blend(timer, timing)
    return timing


def _check_wire(timer: SegmentTimer, timing: SegmentTiming) -> None:
    """Refuse speeds too small for the wire, and times too large for it."""
    if timing.wire_time > timer.options.max_segment_time:
        raise InvalidGoal(
            point_field(timer.geometry.index),
            f'would be approached in {timing.wire_time:.4g} s, more than '
            f'max_segment_time = {timer.options.max_segment_time:.0f} s',
            'raise velocity or acceleration',
        )
    if timing.wire_time > 0.0:
        return
    unit = timer.speed_unit
    for value, name in ((timing.velocity, unit), (timing.acceleration, f'{unit}^2')):
        if value < MIN_SPEED:
            raise InvalidGoal(
                point_field(timer.geometry.index),
                f'would be approached with {value:.2g} {name}, less than '
                f'the {MIN_SPEED:g} that can be sent',
                'give it less time' if timer.geometry.time else 'raise velocity or acceleration',
            )


def _check_blend(timer: SegmentTimer, timing: SegmentTiming) -> None:
    """Refuse a blend that the robot does not make: it would stop at the point (C171)."""
    blend = timer.geometry.blend_after
    if blend is None or timer.geometry.kind not in _NEEDS_A_CYCLE:
        return
    travel = timing.velocity * timer.model.control_cycle
    if blend.radius < travel:
        raise InvalidGoal(
            segment_field(timer.geometry.index, 'blend_radius'),
            f'is {1e3 * blend.radius:g} mm, less than the {1e3 * travel:.3g} mm that the '
            f'robot moves in one control cycle at {timing.velocity:.3g} {timer.speed_unit}: '
            'it would stop at the point',
            'enlarge it, move slower, or set it to 0 to stop there',
        )


def _too_fast(timer: SegmentTimer, min_time: float, limit_name: str) -> str:
    """
    Return the remark on a time that is too short.

    :raises TooFast: it is refused.
    """
    time, limits, unit = timer.geometry.time, timer.limits, timer.speed_unit
    assert time is not None
    where = point_field(timer.geometry.index, 'time_from_start')
    if min_time > timer.options.max_segment_time:
        raise TooFast(
            where,
            f'gives the segment {time:.3f} s, but because of {limit_name} it takes '
            f'{min_time:.0f} s, more than max_segment_time = '
            f'{timer.options.max_segment_time:.0f} s',
            'move the path away from there, or use a JOINT segment',
        )
    if timer.options.on_too_fast == 'slow':
        return (
            f'point {timer.geometry.index}: takes {min_time:.3f} s instead of {time:.3f} s, '
            f'because of {limit_name}'
        )
    speed, acceleration = timer.peak * timer.length / time, 4.5 * timer.length / time**2
    raise TooFast(
        where,
        f'gives the segment {time:.3f} s for {timer.length:.3f} {timer.unit}, which needs up '
        f'to {speed:.3f} {unit} and {acceleration:.3f} {unit}^2; '
        f'allowed are {limits.speed:.3f} {unit} ({limit_name}) and '
        f'{timer.max_acceleration():.3f} {unit}^2',
        f'give it at least {ceil(1e3 * min_time) / 1e3:.3f} s, or set on_too_fast to slow',
    )
