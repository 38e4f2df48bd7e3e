# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The speed of each segment: from the times of the goal, from its speeds, or from the defaults.

``movel`` and ``movej`` take a time on the wire. ``movec`` and ``movep`` do not: their speed is
derived so that the time is met. All numbers are about the leading quantity of a segment, see
:mod:`~.speed_limits`.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, hypot, inf, sqrt

from ur_cartesian_driver.kinematics.robot_models import RobotModel
from ur_cartesian_driver.motion.errors import InvalidGoal, TooFast
from ur_cartesian_driver.motion.goal import SegmentType
from ur_cartesian_driver.planning.geometry.speed_profile import (
    cruise_speed_for,
    min_duration,
    peak_speed_and_acceleration,
    profile_for_time,
    RAMP_SHARE,
    required_acceleration,
    shortest_duration,
    SpeedProfile,
    trapezoid,
)
from ur_cartesian_driver.planning.moves.segment_data import SegmentGeometry, SegmentTiming
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
#: A time that is longer by less than this factor is not remarked.
_NOTICEABLY = 1.001
#: Iterations until speeds and the times in blends agree.
_MAX_ITERATIONS = 12


def schedule(
    geometries: Sequence[SegmentGeometry], options: PlanningOptions, model: RobotModel
) -> list[SegmentTiming]:
    """
    Return the timing of every segment.

    :raises TooFast: a time needs more speed or acceleration than the limits allow.
    :raises InvalidGoal: a speed is too low for the wire.
    """
    timers = [_SegmentTimer(geometry, options, model) for geometry in geometries]
    timings = [timer.first_guess() for timer in timers]
    _meet_times_by_speed(timers, timings)
    for timer, timing in zip(timers, timings, strict=True):
        timer.check_wire(timing)
        timer.check_blend(timing)
    for k, geometry in enumerate(geometries):
        if geometry.blend_before is not None and geometry.time is None:
            timings[k].profile = _profile_after_blend(geometries, timings, k)
    for k, timing in enumerate(timings):
        timing.blend_time = _blend_time(geometries, timings, k)
    before = 0.0
    for timer, timing in zip(timers, timings, strict=True):
        timer.add_time_in_blends(timing, 0.5 * (before + timing.blend_time))
        before = timing.blend_time
    for timer, timing in zip(timers, timings, strict=True):
        timer.bound_time(timing)
    for k, geometry in enumerate(geometries):
        if (blend := geometry.blend_after) is not None:
            speed = max(timers[n].tool_speed(timings[n]) for n in (k, k + 1))
            # Legs of the radius r with a chord c between them: no blend is longer than r + c / 2.
            timings[k].least_time += max(2.0 * (blend.length - blend.radius), 0.0) / speed
    return timings


def _meet_times_by_speed(timers: Sequence[_SegmentTimer], timings: list[SegmentTiming]) -> None:
    """Replace the first guesses of segments that have to meet a time by their speed."""
    geometries = [timer.geometry for timer in timers]
    derived = [
        k
        for k, timer in enumerate(timers)
        if timer.geometry.time is not None and not timer.takes_time
    ]
    # The time in a blend depends on the speeds on both of its sides, so iterate.
    for _ in range(_MAX_ITERATIONS if any(is_blended(geometries[k]) for k in derived) else 1):
        changed = 0.0
        for k in derived:
            halves = sum(_blend_time(geometries, timings, n) / 2.0 for n in (k - 1, k) if n >= 0)
            new = timers[k].by_speed_for_time(halves)
            changed = max(changed, abs(new.velocity / timings[k].velocity - 1.0))
            timings[k] = new
        if changed < 1e-6:
            break


def _blend_time(
    geometries: Sequence[SegmentGeometry], timings: Sequence[SegmentTiming], k: int
) -> float:
    """Return the time in the blend after a segment [s]; the tool's speed changes evenly."""
    blend = geometries[k].blend_after
    if blend is None:
        return 0.0
    speeds = 0.0
    for n, speed in ((k, timings[k].profile.leave), (k + 1, timings[k + 1].profile.enter)):
        curve, profile = geometries[n].curve, timings[n].profile
        speeds += speed * curve.length / profile.length * geometries[n].unblended_fraction
    return 2.0 * blend.length / max(speeds, 1e-9)


def _profile_after_blend(
    geometries: Sequence[SegmentGeometry], timings: Sequence[SegmentTiming], k: int
) -> SpeedProfile:
    """
    Return the profile of a segment that leaves a blend no faster than both segments accelerate.

    In the blend the distance left on the first segment is r1 (1 - s)^2, that done on the second
    r2 s^2, so s' may grow to sqrt(a / 2r) of either.
    """
    before, old, velocity = timings[k - 1].profile, timings[k].profile, timings[k].velocity
    r1 = (1.0 - geometries[k - 1].u_leave) * before.length / geometries[k - 1].unblended_fraction
    r2 = geometries[k].u_join * old.length / geometries[k].unblended_fraction
    blend_rate = max(
        before.leave / (2.0 * r1), sqrt(min(before.acceleration / r1, old.acceleration / r2) / 2.0)
    )
    enter = min(
        velocity, 2.0 * r2 * blend_rate, sqrt(2.0 * old.acceleration * old.length + old.leave**2)
    )
    stop_distance = 0.5 * old.leave**2 / old.acceleration
    return trapezoid(old.length, velocity, old.acceleration, enter, stop_distance)


class _SegmentTimer:
    """Times one segment."""

    def __init__(
        self, geometry: SegmentGeometry, options: PlanningOptions, model: RobotModel
    ) -> None:
        self.geometry, self._options, self._model = geometry, options, model
        self._length, self._unit = leading_quantity(geometry)
        self._speed_unit = speed_unit(self._unit)
        self._limits = speed_limits(geometry, self._length, options, model)
        self._rests = geometry.blend_before is None, geometry.blend_after is None
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

    @property
    def takes_time(self) -> bool:
        """
        Tell whether the wire carries a time for the motion.

        Never in the dialect that counts in milliseconds: a robot program that counts in
        microseconds would run a segment a thousand times too fast, and a program does not report
        how it counts.
        """
        return self.geometry.kind in _TIMED_ON_WIRE and not self._options.dialect.is_coarse

    def first_guess(self) -> SegmentTiming:
        """Return the timing, final unless the segment has to meet a time by its speed."""
        if self.geometry.time is None:
            return self._by_speed()
        if self.takes_time:
            return self._by_time()
        if self._unit == 'rad' and self.geometry.kind in _UNMEASURED_TURNS:
            raise InvalidGoal(
                point_field(self.geometry.index, 'time_from_start'),
                f'is the time of a {self.geometry.kind.name} segment that turns the tool by '
                f'{self._length:.3f} rad over {self.geometry.curve.length:.3f} m; how fast the '
                'robot runs it where the turn is the larger number has not been measured',
                'give velocity instead of times, or turn the tool on LINEAR segments',
            )
        return self.by_speed_for_time(0.0, strict=False)

    def check_wire(self, timing: SegmentTiming) -> None:
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

    def check_blend(self, timing: SegmentTiming) -> None:
        """Refuse a blend that the robot does not make: it would stop at the point (C171)."""
        blend = self.geometry.blend_after
        if blend is None or self.geometry.kind not in _NEEDS_A_CYCLE:
            return
        travel = timing.velocity * self._model.control_cycle
        if blend.radius < travel:
            raise InvalidGoal(
                segment_field(self.geometry.index, 'blend_radius'),
                f'is {1e3 * blend.radius:g} mm, less than the {1e3 * travel:.3g} mm that the '
                f'robot moves in one control cycle at {timing.velocity:.3g} {self._speed_unit}: '
                'it would stop at the point',
                'enlarge it, move slower, or set it to 0 to stop there',
            )

    def add_time_in_blends(self, timing: SegmentTiming, time_in_blends: float) -> None:
        """
        Set the expected duration.

        :param time_in_blends: half of the time in the blends at its ends [s].
        """
        profile = timing.profile
        if timing.wire_time > 0.0 and time_in_blends > 0.0:
            # The time on the wire is met in total: blends are shorter, so the rest takes longer.
            left = max(timing.wire_time - time_in_blends, 0.05 * timing.wire_time)
            profile = timing.profile = profile_for_time(
                profile.length, left, *self._rests, self._ramp_share
            )
        timing.duration = profile.duration + time_in_blends

    def bound_time(self, timing: SegmentTiming) -> None:
        """
        Set the least time without its blends, and the greatest time: with rest at each point.

        Both hold for whatever law by which the robot passes blends.
        """
        if not is_blended(self.geometry):
            timing.least_time = timing.greatest_time = timing.duration
            return
        speed, acceleration = timing.velocity, timing.acceleration
        if timing.wire_time <= 0.0:
            speed, acceleration = speed / self._counted, timing.profile.acceleration
        between = self._length * self.geometry.unblended_fraction
        timing.least_time = shortest_duration(between, speed, acceleration, sum(self._rests))
        timing.greatest_time = (
            timing.wire_time or trapezoid(self._length, speed, acceleration).duration
        )

    def tool_speed(self, timing: SegmentTiming) -> float:
        """Return the speed of the tool when it cruises [m/s]."""
        speed = timing.velocity if timing.wire_time > 0.0 else timing.velocity / self._counted
        return speed * max(self.geometry.curve.length, 1e-9) / self._length

    # -- speeds ----------------------------------------------------------------------------------

    def _by_speed(self) -> SegmentTiming:
        """Return the timing of a segment without a time."""
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
        rate = acceleration
        if is_optimized(geometry.kind):
            rate *= _OPTIMIZED_JOINT_ACCELERATION / min(self._model.max_joint_speed)
        else:
            rate = acceleration = min(acceleration, limits.acceleration)
        if self._turn_leads_line:
            return self._turning_line(velocity, acceleration, source, remark)
        profile = self._profile_by_speed(velocity, rate)
        return SegmentTiming(velocity, acceleration, profile, source, remark)

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
    ) -> SegmentTiming:
        """
        Return the timing of a line on which the turn leads.

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
        speed, rate = peak_speed_and_acceleration(self._length, time)
        timing = SegmentTiming(
            speed, rate, self._profile_by_time(time), source, remark, wire_time=time
        )
        if not self.takes_time:
            timing.wire_time = 0.0
            timing.velocity, timing.acceleration = speed * self._counted, rate * self._counted
        return timing

    def _profile_by_speed(self, velocity: float, acceleration: float) -> SpeedProfile:
        """Return the profile between the blends of a segment that is sent as a speed."""
        distance = self._length * self.geometry.unblended_fraction
        enter = inf if self.geometry.blend_before else 0.0
        return trapezoid(distance, velocity, acceleration, enter, self._stop_distance())

    def _stop_distance(self) -> float:
        """Return how far behind the start of its blend the robot plans to stop, see trapezoid."""
        if self.geometry.blend_after is not None and self.geometry.kind == SegmentType.PROCESS:
            return inf
        return self._length * (1.0 - self.geometry.u_leave)

    # -- times -----------------------------------------------------------------------------------

    def _by_time(self) -> SegmentTiming:
        """Return the timing of a segment for which the wire carries the time."""
        limits = self._limits
        min_time = min_duration(self._length, limits.speed, limits.acceleration, self._peak)
        time, remark = self._time_within_limits(min_time)
        # These make the robot speed up, cruise and brake for a third of the time each.
        velocity, acceleration = peak_speed_and_acceleration(self._length, time)
        profile = self._profile_by_time(time)
        return SegmentTiming(
            velocity, acceleration, profile, self._time_source(), remark, wire_time=time
        )

    def _profile_by_time(self, time: float) -> SpeedProfile:
        """Return the profile between the blends of a segment that is sent with a time [s]."""
        fraction = self.geometry.unblended_fraction
        length, share = self._length * fraction, self._ramp_share
        return profile_for_time(length, time * fraction, *self._rests, share)

    def by_speed_for_time(self, time_in_blends: float, strict: bool = True) -> SegmentTiming:
        """
        Return the timing of a segment that has to meet a time by its speed.

        :param time_in_blends: the part of the time spent in the blends at its ends [s].
        :param strict: whether a time that is too short is refused (not in a first guess).
        :raises TooFast: the time is too short.
        """
        assert self.geometry.time is not None
        distance = self._length * self.geometry.unblended_fraction
        stop_distance = self._stop_distance()
        bound, ramps = self._max_acceleration(), sum(self._rests)
        time, remark = self.geometry.time, ''
        if strict:
            between = shortest_duration(distance, self._limits.speed, bound, ramps)
            time, remark = self._time_within_limits(time_in_blends + between)
        between = max(time - time_in_blends, 0.05 * time)
        acceleration = self._own_acceleration() or max(
            self._default_acceleration(),
            # A third each of speeding up, cruising and braking; and no braking before a blend.
            4.5 * distance / between**2,
            (distance / between) ** 2 / stop_distance if 0.0 < stop_distance < inf else 0.0,
            # With less, the speed that meets the time would be too high.
            required_acceleration(distance, between, self._limits.speed, ramps),
        )
        acceleration = min(acceleration, bound)
        velocity = cruise_speed_for(distance, between, acceleration, ramps)
        if velocity is None:  # only before the blends are known, or within rounding
            velocity = 2.0 * distance / between
        return SegmentTiming(
            velocity * self._counted,
            acceleration * self._counted,
            self._profile_by_speed(velocity, acceleration),
            self._time_source(),
            remark,
        )

    def _time_source(self) -> str:
        return f'time from points[{self.geometry.index}].time_from_start'

    def _time_within_limits(self, min_time: float) -> tuple[float, str]:
        """
        Return the time of the goal; the shortest one, with a remark, where that is too short.

        :raises TooFast: the time is too short.
        """
        time, limits, unit = self.geometry.time, self._limits, self._speed_unit
        assert time is not None
        is_too_short = time < min_time * (1.0 - 1e-9)
        if not is_too_short:  # the minimum of a segment without any motion is not a number
            return time, ''
        where = point_field(self.geometry.index, 'time_from_start')
        if min_time > self._options.max_segment_time:
            raise TooFast(
                where,
                f'gives the segment {time:.3f} s, but because of {limits.name} it takes '
                f'{min_time:.0f} s, more than max_segment_time = '
                f'{self._options.max_segment_time:.0f} s',
                'move the path away from there, or use a JOINT segment',
            )
        if self._options.on_too_fast == 'slow':
            return min_time, (
                f'point {self.geometry.index}: takes {min_time:.3f} s instead of {time:.3f} s, '
                f'because of {limits.name}'
            )
        speed, acceleration = peak_speed_and_acceleration(self._length, time)
        speed *= self._peak / _PEAK
        raise TooFast(
            where,
            f'gives the segment {time:.3f} s for {self._length:.3f} {self._unit}, which needs up '
            f'to {speed:.3f} {unit} and {acceleration:.3f} {unit}^2; '
            f'allowed are {limits.speed:.3f} {unit} ({limits.name}) and '
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
