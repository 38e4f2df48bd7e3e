# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The speed of each segment: from the times of the goal, from its speeds, or from the defaults.

``movel`` and ``movej`` take a time on the wire. ``movec`` and ``movep`` do not: their speed is
derived so that the time is met. All numbers are about the leading quantity of a segment, see
:mod:`~.speed_limits`. How moves and blends follow each other is that of :mod:`~.move_chain`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import ceil, hypot, inf, isnan, nan, sqrt

import numpy as np

from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES, RobotModel
from ur_cartesian_driver.motion.errors import InvalidGoal, TooFast
from ur_cartesian_driver.motion.goal import SegmentType
from ur_cartesian_driver.motion.plan import PlannedSegment
from ur_cartesian_driver.motion.pose_rows import Floats
from ur_cartesian_driver.motion.primitive import Spline
from ur_cartesian_driver.planning.geometry.blend import Blend
from ur_cartesian_driver.planning.moves.move_chain import (
    MoveChain,
    Moves,
    Rows,
)
from ur_cartesian_driver.planning.moves.segment_data import (
    BlendSamples,
    SegmentGeometry,
    SegmentTiming,
)
from ur_cartesian_driver.planning.moves.speed_limits import (
    is_blended,
    leading_quantity,
    speed_limits,
    speed_unit,
    translates,
)
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.goal_fields import (
    is_optimized,
    point_field,
    segment_field,
)

#: A move with a time stretches the trapezoid of the speed and acceleration beside it (recorded on
#: a UR3). We send 1.5 d/T and 4.5 d/T^2: a third of the time each for accelerating, cruising and
#: braking, which is also what robots would do that ignore the two.
RAMP_SHARE = 1.0 / 3.0

#: Minimum speed that the wire carries accurately enough: it counts in millionths.
MIN_SPEED = 1e-5
#: Assumed acceleration of an OPTIMIZED move at fraction 1 [rad/s^2]; the robot's own limits are
#: not published. It only serves to estimate the time of such a move.
_OPTIMIZED_JOINT_ACCELERATION = 40.0
#: Motions that take a time on the wire.
_TIMED_ON_WIRE = (SegmentType.LINEAR, SegmentType.JOINT)
#: Motions that take none, whose turn has never been measured.
_UNMEASURED_TURNS = (SegmentType.CIRCULAR, SegmentType.PROCESS)
#: Motions whose blends the robot leaves out if it passes their radius within a control cycle.
_NEEDS_A_CYCLE = (SegmentType.CIRCULAR, SegmentType.PROCESS)
#: Peak over mean of the speed of a timed move: in thirds, and in the triangle that a line whose
#: turn leads makes of the same numbers if the robot turns the tool faster than it moves it.
_PEAK, _PEAK_OF_TURN = 1.0 / (1.0 - RAMP_SHARE), 2.0
#: A time that is longer by less than this factor is not remarked, or kept.
_NOTICEABLY, _NEARLY = 1.001, 1.0 + 1e-5
#: What exceeds a limit by less than this factor keeps to it. Faster moves are slowed so often.
_WITHIN = 1.0 + 1e-6
_MAX_ROUNDS = 12
#: A point that is passed no earlier than this is in time [s].
_EARLY = 0.001


def min_duration(length: float, speed: float, acceleration: float, peak: float = _PEAK) -> float:
    """
    Return the shortest time on the wire that keeps its peaks from rest to rest within bounds [s].

    :param peak: speed over mean speed; 2 where it might be a triangle, whose acceleration is less.
    """
    return max(
        peak * length / speed,
        sqrt(length / acceleration / (RAMP_SHARE * (1.0 - RAMP_SHARE))),
    )


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
    timers = [_SegmentTimer(geometry, options, model) for geometry in geometries]
    timetable = _Timetable(timers, options, blend_samples, running)
    timetable.solve()
    return timetable.timings(), timetable.chain


@dataclass(slots=True, kw_only=True)
class SpeedRequest:
    """What a segment asks of its move, in the lengths that the robot counts."""

    #: Its greatest speed; its acceleration, and the greatest one that may follow from a time.
    speed: float
    acceleration: float
    max_acceleration: float
    #: 1 / time on the wire, or speed / length [1/s]. Faster only as its limits allow.
    rate: float
    has_wire_time: bool = False
    source: str
    remark: str = ''
    #: Its time; NaN = it has none. At least: what its limits allow at rest at both ends.
    time: float = nan
    min_time: float = 0.0


class _Timetable:
    """Finds the speeds of all segments; columns (n,)."""

    def __init__(
        self,
        timers: Sequence[_SegmentTimer],
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
        self._max_rate = np.where(
            np.isnan(self._time), self._rate, self._speed / self._moves.length
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
        self._wanted += late

    def _go_ahead(self, late: Floats) -> bool:
        """
        Let points be passed early where the next one would be late; return whether there are any.

        Where a slow move is blended into a fast one they share the speed in the blend.
        """
        moves = self._moves
        alone = shortest_duration(moves.length, self._speed, self._most, 2.0)
        rows = np.flatnonzero(
            (late[1:] > 0.0)
            & (self._wanted[1:] > alone[1:])
            & (moves.tail[:-1] > 0.0)
            & (self._rate[:-1] < self._max_rate[:-1])
            & (self._ahead[:-1] + late[1:] < 0.5 * self._wanted[:-1])
        )
        self._ahead[rows] += late[rows + 1]
        return len(rows) > 0

    def timings(self) -> list[SegmentTiming]:
        """
        Return the timings of the segments.

        :raises GoalRefused: a time is too short, a speed too low, a blend too small.
        """
        times, moves = self.chain.times, self._moves
        least, greatest = self._bounds()
        columns = (
            moves.speed,
            moves.acceleration,
            moves.time,
            times.durations,
            self._wanted,
            self._ahead,
            least,
            greatest,
        )
        return [
            timer.timing(request, self._limit_names.get(k, ''), *row)
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


class _SegmentTimer:
    """Times one segment."""

    def __init__(
        self, geometry: SegmentGeometry, options: PlanningOptions, model: RobotModel
    ) -> None:
        self.geometry, self._options, self.model = geometry, options, model
        self._length, self._unit = leading_quantity(geometry)
        self._speed_unit = speed_unit(self._unit)
        self._limits = speed_limits(geometry, self._length, options, model)
        self._turn_leads_line = self._unit == 'rad' and geometry.kind == SegmentType.LINEAR
        self._peak = _PEAK_OF_TURN if self._turn_leads_line else _PEAK
        self._ramp_share = RAMP_SHARE
        #: Part of its length that the robot counts, by the turn ratio.
        self._counted = 1.0
        if self._turn_leads_line:
            counted = max(geometry.curve.length, self._length / options.turn_ratio)
            self._counted = counted / self._length
            # Of the trapezoid of 1.5 d/T and 4.5 d/T^2 over the length that counts.
            self._ramp_share = 1.0 / (1.0 + max(1.0, 2.0 * self._counted))
        #: The acceleration that the robot makes of the one that is sent.
        self._acceleration_unit = 1.0
        if is_optimized(geometry.kind):
            self._acceleration_unit = _OPTIMIZED_JOINT_ACCELERATION / min(model.max_joint_speed)

    @property
    def takes_time(self) -> bool:
        """
        Tell whether the wire carries a time for the motion.

        Never in the dialect that counts in milliseconds: a robot program that counts in
        microseconds would run a segment a thousand times too fast, and a program does not report
        how it counts.
        """
        return self.geometry.kind in _TIMED_ON_WIRE and not self._options.dialect.is_coarse

    def move(self) -> tuple[float, ...]:
        """Return its row of :class:`Moves`, still without speeds and time."""
        geometry, counted = self.geometry, self._length * self._counted
        before, after = geometry.blend_before, geometry.blend_after
        head = counted * geometry.u_join if before else 0.0
        tail = max(counted * (1.0 - geometry.u_leave), 1e-12) if after else 0.0
        stops_within = inf
        if after is not None and geometry.kind == SegmentType.PROCESS:
            stops_within = after.radius
        return (
            counted,
            1.0,
            1.0,
            0.0,
            self._ramp_share,
            stops_within,
            head,
            tail,
            self._blend_rate(before, head),
            self._blend_rate(after, tail),
        )

    def _blend_rate(self, blend: Blend | None, part: float) -> float:
        """Return its length for a unit of ``s`` at its end of a blend."""
        if blend is not None and blend.fillet:
            return blend.length * self._length / self.geometry.curve.length
        return max(2.0 * part, 1e-12)

    def request(self) -> SpeedRequest:
        """Return what it asks for."""
        geometry = self.geometry
        if geometry.time is None:
            return self._by_speed()
        if not self.takes_time and self._unit == 'rad' and geometry.kind in _UNMEASURED_TURNS:
            raise InvalidGoal(
                point_field(geometry.index, 'time_from_start'),
                f'is the time of a {geometry.kind.name} segment that turns the tool by '
                f'{self._length:.3f} rad over {geometry.curve.length:.3f} m; how fast the '
                'robot runs it where the turn is the larger number has not been measured',
                'give velocity instead of times, or turn the tool on LINEAR segments',
            )
        return self._by_time()

    def request_again(self, running: PlannedSegment) -> SpeedRequest:
        """Return what has been sent already."""
        sent, time = running.primitive, getattr(running.primitive, 'duration', 0.0)
        assert not isinstance(sent, Spline)
        speed, acceleration = sent.velocity, sent.acceleration * self._acceleration_unit
        return SpeedRequest(
            speed=speed,
            acceleration=acceleration,
            max_acceleration=acceleration,
            rate=1.0 / time if time else speed / (self._length * self._counted),
            has_wire_time=time > 0.0,
            source='',
        )

    def timing(
        self,
        request: SpeedRequest,
        limit_name: str,
        speed: float,
        acceleration: float,
        wire_time: float,
        duration: float,
        wanted: float,
        ahead: float,
        least_time: float,
        greatest_time: float,
    ) -> SegmentTiming:
        """
        Return its timing.

        :param limit_name: what slows it where it is not a limit of its own.
        :param wanted: its time, longer where it is slowed [s]; NaN = none.
        :param ahead: so much before its time its point is passed [s].
        """
        geometry, remark = self.geometry, request.remark
        limit_name = limit_name or self._limits.name
        if wanted > request.time * _NEARLY:
            remark = self._too_fast(wanted, limit_name)
        elif wire_time > 1.0 / request.rate * _NEARLY and isnan(request.time):
            remark = (
                f'point {geometry.index}: takes {wire_time:.3f} s instead of '
                f'{1.0 / request.rate:.3f} s, because of {limit_name}'
            )
        elif isnan(request.time) and wire_time <= 0.0 and speed * _NEARLY < request.speed:
            remark = (
                f'point {geometry.index}: slowed from {request.speed:.3g} to {speed:.3g} '
                f'{self._speed_unit} by {limit_name}'
            )
        if ahead > _EARLY:
            early = (
                f'point {geometry.index}: passed {ahead:.3f} s before its time, because the next '
                'segment could not make good the time in the blend'
            )
            remark = f'{remark}; {early}' if remark else early
        timing = SegmentTiming(
            speed,
            acceleration / self._acceleration_unit,
            request.source,
            remark,
            wire_time=wire_time,
            duration=duration,
            least_time=least_time,
            greatest_time=greatest_time,
        )
        if wire_time > 0.0:
            # A third each of speeding up, cruising and braking, as far as the speed is allowed.
            timing.velocity = self._length / wire_time / (1.0 - RAMP_SHARE)
            if not self._turn_leads_line:
                timing.velocity = min(timing.velocity, max(self._limits.speed, MIN_SPEED))
            timing.acceleration = 2.0 * timing.velocity**2 / self._length
        self._check_wire(timing)
        self._check_blend(timing)
        return timing

    def _check_wire(self, timing: SegmentTiming) -> None:
        """Refuse speeds too small for the wire, and times too large for it."""
        if timing.wire_time > self._options.max_segment_time:
            raise InvalidGoal(
                point_field(self.geometry.index),
                f'would be approached in {timing.wire_time:.4g} s, more than '
                f'max_segment_time = {self._options.max_segment_time:.0f} s',
                'raise velocity or acceleration',
            )
        if timing.wire_time > 0.0:
            return
        unit = self._speed_unit
        for value, name in ((timing.velocity, unit), (timing.acceleration, f'{unit}^2')):
            if value < MIN_SPEED:
                raise InvalidGoal(
                    point_field(self.geometry.index),
                    f'would be approached with {value:.2g} {name}, less than '
                    f'the {MIN_SPEED:g} that can be sent',
                    'give it less time'
                    if self.geometry.time
                    else 'raise velocity or acceleration',
                )

    def _check_blend(self, timing: SegmentTiming) -> None:
        """Refuse a blend that the robot does not make: it would stop at the point (C171)."""
        blend = self.geometry.blend_after
        if blend is None or self.geometry.kind not in _NEEDS_A_CYCLE:
            return
        travel = timing.velocity * self.model.control_cycle
        if blend.radius < travel:
            raise InvalidGoal(
                segment_field(self.geometry.index, 'blend_radius'),
                f'is {1e3 * blend.radius:g} mm, less than the {1e3 * travel:.3g} mm that the '
                f'robot moves in one control cycle at {timing.velocity:.3g} {self._speed_unit}: '
                'it would stop at the point',
                'enlarge it, move slower, or set it to 0 to stop there',
            )

    # -- speeds ----------------------------------------------------------------------------------

    def _by_speed(self) -> SpeedRequest:
        """Return what a segment without a time asks for."""
        geometry, limits = self.geometry, self._limits
        bound, name, unit = limits.speed, limits.name, self._speed_unit
        if self._turn_leads_line and translates(geometry):
            bound, name, unit = self._options.max_tool_speed or inf, 'max_tool_speed', 'm/s'
        wanted, source = self._wanted_speed()
        velocity = min(wanted, bound)
        remark = ''
        if velocity < wanted:
            remark = (
                f'point {geometry.index}: slowed from {wanted:.3g} to {velocity:.3g} {unit} '
                f'by {name}'
            )
        acceleration = geometry.segment.acceleration or self._default_acceleration()
        if not is_optimized(geometry.kind):
            acceleration = min(acceleration, limits.acceleration)
        if self._turn_leads_line:
            return self._turning_line(velocity, acceleration, source, remark)
        acceleration *= self._acceleration_unit
        return SpeedRequest(
            speed=velocity,
            acceleration=acceleration,
            max_acceleration=acceleration,
            rate=velocity / self._length,
            source=source,
            remark=remark,
        )

    def _wanted_speed(self) -> tuple[float, str]:
        """Return the speed that the goal asks for, and where it comes from."""
        geometry, options = self.geometry, self._options
        if geometry.segment.velocity > 0.0:
            return geometry.segment.velocity, f'speed from segments[{geometry.index}].velocity'
        if is_optimized(geometry.kind):
            return options.optimized_velocity, 'speed from optimized_velocity'
        if geometry.kind == SegmentType.JOINT:
            return options.joint_velocity, 'speed from joint_velocity'
        twist = geometry.waypoint.twist
        speed = hypot(*twist[:3]) if translates(geometry) else hypot(*twist[3:])
        if speed > 0.0:
            return speed, f'speed from points[{geometry.index}].twist'
        if not translates(geometry):
            return options.angular_velocity, 'speed from angular_velocity'
        if self._unit == 'rad' and geometry.kind != SegmentType.LINEAR:
            # One number for both: the turn may be faster [rad/s], but no faster than the tool
            # [m/s].
            fastest = options.max_tool_speed or options.angular_velocity
            return (
                max(options.linear_velocity, min(options.angular_velocity, fastest)),
                'speed from linear_velocity and angular_velocity, as the turn leads',
            )
        return options.linear_velocity, 'speed from linear_velocity'

    def _default_acceleration(self) -> float:
        options = self._options
        if is_optimized(self.geometry.kind):
            return options.optimized_acceleration
        if self.geometry.kind == SegmentType.JOINT:
            return options.joint_acceleration
        if translates(self.geometry):
            return options.linear_acceleration
        return options.angular_acceleration

    def _turning_line(
        self, velocity: float, acceleration: float, source: str, remark: str
    ) -> SpeedRequest:
        """
        Return what a line asks for on which the turn leads.

        The robot may turn the tool as slowly as it moves it, or several times as fast: a time is
        sent instead, in which the tool keeps its speed [m/s] and turns no faster than the default
        (without a way: than was asked for), whichever it is.
        """
        options, limits, peak = self._options, self._limits, self._peak
        turn = velocity, acceleration
        line_time = 0.0
        if translates(self.geometry):
            line_time = min_duration(self.geometry.curve.length, velocity, acceleration, peak)
            turn = options.angular_velocity, options.angular_acceleration
            source = f'{source}, turn within angular_velocity'
        turn_rate = min(turn[1], limits.acceleration)
        time, wanted = (
            max(line_time, min_duration(self._length, turn_speed, turn_rate, peak))
            for turn_speed in (min(turn[0], limits.speed), turn[0])
        )
        if time > wanted * _NOTICEABLY:
            slowed = (
                f'point {self.geometry.index}: turns in {time:.3f} s instead of {wanted:.3f} s, '
                f'because of {limits.name}'
            )
            remark = f'{remark}; {slowed}' if remark else slowed
        counted, timed, peak = self._counted, self.takes_time, self._peak
        # Without a time on the wire: a third each of speeding up, cruising and braking.
        speed = self._length / time * (peak if timed else _PEAK)
        acceleration = turn_rate if timed else 4.5 * self._length / time**2
        return SpeedRequest(
            speed=speed * counted,
            acceleration=acceleration * counted,
            max_acceleration=acceleration * counted,
            rate=1.0 / time if timed else speed / self._length,
            has_wire_time=timed,
            source=source,
            remark=remark,
        )

    # -- times -----------------------------------------------------------------------------------

    def _by_time(self) -> SpeedRequest:
        """Return what a segment with a time asks for."""
        geometry, limits = self.geometry, self._limits
        assert geometry.time is not None
        length = self._length * geometry.unblended_fraction
        mean = length / geometry.time
        most = self._max_acceleration()
        least = most
        if not self.takes_time:
            least = self._own_acceleration() or max(
                self._default_acceleration(),
                # A third each of speeding up, cruising and braking; and no braking before a blend.
                4.5 * length / geometry.time**2,
                mean**2 / (self._length * (1.0 - geometry.u_leave))
                if geometry.blend_after and geometry.kind != SegmentType.PROCESS
                else 0.0,
            )
        counted = self._counted
        return SpeedRequest(
            speed=limits.speed * counted,
            acceleration=min(least, most) * counted,
            max_acceleration=most * counted,
            rate=1.0 / geometry.time,
            has_wire_time=self.takes_time,
            source=f'time from points[{geometry.index}].time_from_start',
            time=geometry.time,
            # A move with a time is planned to rest at its waypoint, also where it is blended.
            min_time=min_duration(self._length, limits.speed, limits.acceleration, self._peak)
            if self.takes_time
            else 0.0,
        )

    def _too_fast(self, min_time: float, limit_name: str) -> str:
        """
        Return the remark on a time that is too short.

        :raises TooFast: it is refused.
        """
        time, limits, unit = self.geometry.time, self._limits, self._speed_unit
        assert time is not None
        where = point_field(self.geometry.index, 'time_from_start')
        if min_time > self._options.max_segment_time:
            raise TooFast(
                where,
                f'gives the segment {time:.3f} s, but because of {limit_name} it takes '
                f'{min_time:.0f} s, more than max_segment_time = '
                f'{self._options.max_segment_time:.0f} s',
                'move the path away from there, or use a JOINT segment',
            )
        if self._options.on_too_fast == 'slow':
            return (
                f'point {self.geometry.index}: takes {min_time:.3f} s instead of {time:.3f} s, '
                f'because of {limit_name}'
            )
        speed, acceleration = self._peak * self._length / time, 4.5 * self._length / time**2
        raise TooFast(
            where,
            f'gives the segment {time:.3f} s for {self._length:.3f} {self._unit}, which needs up '
            f'to {speed:.3f} {unit} and {acceleration:.3f} {unit}^2; '
            f'allowed are {limits.speed:.3f} {unit} ({limit_name}) and '
            f'{self._max_acceleration():.3f} {unit}^2',
            f'give it at least {ceil(1e3 * min_time) / 1e3:.3f} s, or set on_too_fast to slow',
        )

    def _own_acceleration(self) -> float:
        """Return the acceleration that the goal gives a timed segment; 0 = none."""
        timed = self.geometry.kind in _TIMED_ON_WIRE
        return 0.0 if timed else self.geometry.segment.acceleration

    def _max_acceleration(self) -> float:
        """Return the maximum acceleration that may follow from a time."""
        return min(self._own_acceleration() or inf, self._limits.acceleration)
