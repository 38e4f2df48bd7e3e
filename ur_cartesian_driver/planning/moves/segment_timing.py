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
    SpeedProfile,
    trapezoid,
)
from ur_cartesian_driver.planning.moves.segment_data import SegmentGeometry, SegmentTiming
from ur_cartesian_driver.planning.moves.speed_limits import (
    is_blended,
    leading_quantity,
    speed_limits,
    speed_unit,
    SpeedLimits,
    translates,
)
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.goal_fields import is_optimized, point_field

#: Minimum speed that the wire carries accurately enough: it counts in millionths.
MIN_SPEED = 1e-5
#: Assumed acceleration of an OPTIMIZED move at fraction 1 [rad/s^2]; the robot's own limits are
#: not published. It only serves to estimate the time of such a move.
_OPTIMIZED_JOINT_ACCELERATION = 40.0
#: Motions that take a time on the wire.
_TIMED_ON_WIRE = (SegmentType.LINEAR, SegmentType.JOINT)
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
    measures = [leading_quantity(geometry) for geometry in geometries]
    timings = [
        _first_guess(geometry, length, unit, options, model)
        for geometry, (length, unit) in zip(geometries, measures, strict=True)
    ]
    derived = [
        k
        for k, geometry in enumerate(geometries)
        if geometry.time is not None and not _takes_time(geometry.kind, options)
    ]
    # The time in a blend depends on the speeds on both of its sides, so iterate.
    for _ in range(_MAX_ITERATIONS if any(is_blended(geometries[k]) for k in derived) else 1):
        changed = 0.0
        for k in derived:
            new = _by_speed_for_time(
                geometries[k], measures[k], _blend_time(geometries, timings, k), options, model
            )
            changed = max(changed, abs(new.velocity / timings[k].velocity - 1.0))
            timings[k] = new
        if changed < 1e-6:
            break
    for geometry, timing in zip(geometries, timings, strict=True):
        _check_wire(geometry, timing, options)
    for k in range(1, len(geometries)):
        if geometries[k].blend_before is not None and geometries[k].time is None:
            timings[k] = _after_blend(geometries, timings, k)
    blend_times = [
        blend_duration(geometries[k], timings[k], geometries[k + 1], timings[k + 1])
        if geometries[k].blend_after is not None
        else 0.0
        for k in range(len(geometries))
    ]
    return [
        _with_duration(geometry, timing, before, after)
        for geometry, timing, before, after in zip(
            geometries, timings, [0.0, *blend_times[:-1]], blend_times, strict=True
        )
    ]


def _check_wire(
    geometry: SegmentGeometry, timing: SegmentTiming, options: PlanningOptions
) -> None:
    """Refuse speeds too small for the wire, and times too large for it."""
    if timing.wire_time > options.max_segment_time:
        raise InvalidGoal(
            point_field(geometry.index),
            f'would be approached in {timing.wire_time:.4g} s, more than '
            f'max_segment_time = {options.max_segment_time:.0f} s',
            'raise velocity or acceleration',
        )
    if timing.wire_time > 0.0:
        return
    unit = speed_unit(timing.unit)
    for value, name in ((timing.velocity, unit), (timing.acceleration, f'{unit}^2')):
        if value < MIN_SPEED:
            raise InvalidGoal(
                point_field(geometry.index),
                f'would be approached with {value:.2g} {name}, less than '
                f'the {MIN_SPEED:g} that can be sent',
                'give it less time' if geometry.time else 'raise velocity or acceleration',
            )


def _after_blend(
    geometries: Sequence[SegmentGeometry], timings: Sequence[SegmentTiming], k: int
) -> SegmentTiming:
    """
    Return the timing of a segment that leaves a blend no faster than both segments accelerate.

    In the blend the distance left on the first segment is r1 (1 - s)^2, that done on the second
    r2 s^2, so s' may grow to sqrt(a / 2r) of either.
    """
    before, old = timings[k - 1].profile, timings[k].profile
    r1 = (1.0 - geometries[k - 1].u_leave) * before.length / geometries[k - 1].unblended_fraction
    r2 = geometries[k].u_join * old.length / geometries[k].unblended_fraction
    blend_rate = max(
        before.leave / (2.0 * r1), sqrt(min(before.acceleration / r1, old.acceleration / r2) / 2.0)
    )
    enter = min(
        timings[k].velocity,
        2.0 * r2 * blend_rate,
        sqrt(2.0 * old.acceleration * old.length + old.leave**2),
    )
    profile = trapezoid(
        old.length,
        timings[k].velocity,
        old.acceleration,
        enter,
        0.5 * old.leave**2 / old.acceleration,
    )
    return _with_profile(timings[k], profile)


def _with_duration(
    geometry: SegmentGeometry, timing: SegmentTiming, before: float, after: float
) -> SegmentTiming:
    """
    Return the timing with its expected duration, half of each blend included.

    :param before: time in the blend before it [s], and ``after`` in the one after it.
    """
    time_in_blends, profile = 0.5 * (before + after), timing.profile
    if timing.wire_time > 0.0 and time_in_blends > 0.0:
        # The time on the wire is met in total: blends are shorter, so the rest takes longer.
        left = max(timing.wire_time - time_in_blends, 0.05 * timing.wire_time)
        profile = profile_for_time(profile.length, left, *_rests_at_ends(geometry))
    return _with_profile(timing, profile, profile.duration + time_in_blends, after)


def _with_profile(
    timing: SegmentTiming, profile: SpeedProfile, duration: float = 0.0, blend_time: float = 0.0
) -> SegmentTiming:
    """Return the timing with another profile; ``replace`` takes twice as long."""
    return SegmentTiming(
        velocity=timing.velocity,
        acceleration=timing.acceleration,
        wire_time=timing.wire_time,
        unit=timing.unit,
        profile=profile,
        duration=duration,
        blend_time=blend_time,
        source=timing.source,
        remark=timing.remark,
    )


def _takes_time(kind: SegmentType, options: PlanningOptions) -> bool:
    """
    Tell whether the wire carries a time for a motion.

    Never in the dialect that counts in milliseconds: a robot program that counts in microseconds
    would run a segment a thousand times too fast, and a program does not report how it counts.
    """
    return kind in _TIMED_ON_WIRE and not options.dialect.is_coarse


def _own_acceleration(geometry: SegmentGeometry) -> float:
    """Return the acceleration that the goal gives a timed segment; 0 = none."""
    return 0.0 if geometry.kind in _TIMED_ON_WIRE else geometry.segment.acceleration


def _rests_at_ends(geometry: SegmentGeometry) -> tuple[bool, bool]:
    return geometry.blend_before is None, geometry.blend_after is None


def _profile_between_blends(geometry: SegmentGeometry, length: float, time: float) -> SpeedProfile:
    """Return the profile of the unblended part of a segment that takes a time as a whole [s]."""
    fraction = geometry.unblended_fraction
    return profile_for_time(length * fraction, time * fraction, *_rests_at_ends(geometry))


def _stop_distance(geometry: SegmentGeometry, length: float) -> float:
    """Return how far behind the start of its blend the robot plans to stop, see trapezoid."""
    if geometry.blend_after is not None and geometry.kind == SegmentType.PROCESS:
        return inf
    return length * (1.0 - geometry.u_leave)


def _first_guess(
    geometry: SegmentGeometry,
    length: float,
    unit: str,
    options: PlanningOptions,
    model: RobotModel,
) -> SegmentTiming:
    if geometry.time is None:
        return _by_speed(geometry, length, unit, options, model)
    if _takes_time(geometry.kind, options):
        return _by_time(geometry, length, unit, options, model)
    return _by_speed_for_time(geometry, (length, unit), 0.0, options, model, strict=False)


# -- speeds ---------------------------------------------------------------------------------------


def _by_speed(
    geometry: SegmentGeometry,
    length: float,
    unit: str,
    options: PlanningOptions,
    model: RobotModel,
) -> SegmentTiming:
    """Return the timing of a segment without a time."""
    wanted, source = _wanted_speed(geometry, unit, options)
    acceleration = geometry.segment.acceleration or _default_acceleration(geometry, unit, options)
    limits = speed_limits(geometry, length, options, model)
    if not is_optimized(geometry.kind):
        acceleration = min(acceleration, limits.acceleration)
    turn_leads = geometry.kind == SegmentType.LINEAR and unit == 'rad' and translates(geometry)
    if turn_leads:
        return _turning_line(geometry, length, wanted, acceleration, source, options)
    velocity = min(wanted, limits.speed)
    remark = ''
    if velocity < wanted:
        remark = (
            f'point {geometry.index}: slowed from {wanted:.3g} to {velocity:.3g} '
            f'{speed_unit(unit)} by {limits.name}'
        )
    rate = acceleration
    if is_optimized(geometry.kind):
        rate *= _OPTIMIZED_JOINT_ACCELERATION / min(model.max_joint_speed)
    profile = trapezoid(
        length * geometry.unblended_fraction,
        velocity,
        rate,
        inf if geometry.blend_before else 0.0,
        _stop_distance(geometry, length),
    )
    return SegmentTiming(
        velocity=velocity,
        acceleration=acceleration,
        unit=unit,
        profile=profile,
        source=source,
        remark=remark,
    )


def _wanted_speed(
    geometry: SegmentGeometry, unit: str, options: PlanningOptions
) -> tuple[float, str]:
    """Return the speed that the goal asks for, and where it comes from."""
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
    if unit == 'rad' and geometry.kind != SegmentType.LINEAR:
        # One number for both: the turn may be faster [rad/s], but no faster than the tool [m/s].
        fastest = options.max_tool_speed or options.angular_velocity
        return (
            max(options.linear_velocity, min(options.angular_velocity, fastest)),
            'speed from linear_velocity and angular_velocity, as the turn leads',
        )
    return options.linear_velocity, 'speed from linear_velocity'


def _time_source(geometry: SegmentGeometry) -> str:
    return f'time from points[{geometry.index}].time_from_start'


def _default_acceleration(geometry: SegmentGeometry, unit: str, options: PlanningOptions) -> float:
    if is_optimized(geometry.kind):
        return options.optimized_acceleration
    if geometry.kind == SegmentType.JOINT:
        return options.joint_acceleration
    return options.linear_acceleration if translates(geometry) else options.angular_acceleration


def _turning_line(
    geometry: SegmentGeometry,
    angle: float,
    velocity: float,
    acceleration: float,
    source: str,
    options: PlanningOptions,
) -> SegmentTiming:
    """
    Return the timing of a line on which the turn leads.

    One number for both would turn the tool as slowly as it moves: a time is sent instead, in which
    the tool keeps its speed [m/s] and turns no faster than the default.
    """
    remark = ''
    if 0.0 < options.max_tool_speed < velocity:
        remark = (
            f'point {geometry.index}: slowed from {velocity:.3g} to {options.max_tool_speed:.3g} '
            'm/s by max_tool_speed'
        )
        velocity = options.max_tool_speed
    time = max(
        min_duration(geometry.curve.length, velocity, acceleration),
        min_duration(angle, options.angular_velocity, options.angular_acceleration),
    )
    profile = _profile_between_blends(geometry, angle, time)
    wire_time = time
    if not _takes_time(geometry.kind, options):
        velocity, wire_time = profile.cruise, 0.0
        _, acceleration = peak_speed_and_acceleration(angle, time)
    return SegmentTiming(
        velocity=velocity,
        acceleration=acceleration,
        wire_time=wire_time,
        unit='rad',
        profile=profile,
        source=f'{source}, turn within angular_velocity',
        remark=remark,
    )


# -- times ----------------------------------------------------------------------------------------


def _by_time(
    geometry: SegmentGeometry,
    length: float,
    unit: str,
    options: PlanningOptions,
    model: RobotModel,
) -> SegmentTiming:
    """Return the timing of a segment for which the wire carries the time."""
    assert geometry.time is not None
    limits = speed_limits(geometry, length, options, model)
    min_time = min_duration(length, limits.speed, limits.acceleration)
    time, remark = geometry.time, ''
    if time < min_time * (1.0 - 1e-9):
        time, remark = _slow_or_refuse(geometry, length, unit, min_time, limits, options)
    profile = _profile_between_blends(geometry, length, time)
    # The robot ignores speed and acceleration when it has a time; these are what it will need.
    velocity, acceleration = peak_speed_and_acceleration(length, time)
    return SegmentTiming(
        velocity=velocity,
        acceleration=acceleration,
        wire_time=time,
        unit=unit,
        profile=profile,
        source=_time_source(geometry),
        remark=remark,
    )


def _by_speed_for_time(
    geometry: SegmentGeometry,
    measured: tuple[float, str],
    time_in_blends: float,
    options: PlanningOptions,
    model: RobotModel,
    strict: bool = True,
) -> SegmentTiming:
    """
    Return the timing of a segment that has to meet a time by its speed.

    :param time_in_blends: the part of the time spent in the blends at its ends [s].
    :param strict: whether a time that is too short is refused (not in a first guess).
    """
    assert geometry.time is not None
    length, unit = measured
    limits = speed_limits(geometry, length, options, model)
    distance, stop_distance = (
        length * geometry.unblended_fraction,
        _stop_distance(geometry, length),
    )
    bound = _max_acceleration(geometry, limits)
    time, remark = geometry.time, ''
    min_time = time_in_blends + _min_time_by_speed(geometry, distance, limits.speed, bound)
    if strict and time < min_time * (1.0 - 1e-9):
        time, remark = _slow_or_refuse(geometry, length, unit, min_time, limits, options)
    between = max(time - time_in_blends, 0.05 * time)
    acceleration = _own_acceleration(geometry) or max(
        _default_acceleration(geometry, unit, options),
        # A third each of speeding up, cruising and braking; and no braking before a blend.
        min(bound, 4.5 * distance / between**2),
        min(
            bound, (distance / between) ** 2 / stop_distance if 0.0 < stop_distance < inf else 0.0
        ),
    )
    velocity = cruise_speed_for(distance, between, acceleration, sum(_rests_at_ends(geometry)))
    if velocity is None:  # only before the blends are known, or within rounding
        velocity = 2.0 * distance / between
    profile = trapezoid(
        distance, velocity, acceleration, inf if geometry.blend_before else 0.0, stop_distance
    )
    return SegmentTiming(
        velocity=velocity,
        acceleration=acceleration,
        unit=unit,
        profile=profile,
        source=_time_source(geometry),
        remark=remark,
    )


def _slow_or_refuse(
    geometry: SegmentGeometry,
    length: float,
    unit: str,
    min_time: float,
    limits: SpeedLimits,
    options: PlanningOptions,
) -> tuple[float, str]:
    """Return the shortest time within the limits with a remark, or refuse."""
    assert geometry.time is not None
    if min_time > options.max_segment_time:
        raise TooFast(
            point_field(geometry.index, 'time_from_start'),
            f'gives the segment {geometry.time:.3f} s, but because of {limits.name} it takes '
            f'{min_time:.0f} s, more than max_segment_time = {options.max_segment_time:.0f} s',
            'move the path away from there, or use a JOINT segment',
        )
    if options.on_too_fast == 'slow':
        return min_time, (
            f'point {geometry.index}: takes {min_time:.3f} s instead of {geometry.time:.3f} s, '
            f'because of {limits.name}'
        )
    speed, acceleration = peak_speed_and_acceleration(length, geometry.time)
    raise TooFast(
        point_field(geometry.index, 'time_from_start'),
        f'gives the segment {geometry.time:.3f} s for {length:.3f} {unit}, which needs up to '
        f'{speed:.3f} {speed_unit(unit)} and {acceleration:.3f} {speed_unit(unit)}^2; '
        f'allowed are {limits.speed:.3f} {speed_unit(unit)} ({limits.name}) and '
        f'{_max_acceleration(geometry, limits):.3f} {speed_unit(unit)}^2',
        f'give it at least {ceil(1e3 * min_time) / 1e3:.3f} s, or set on_too_fast to slow',
    )


def _min_time_by_speed(
    geometry: SegmentGeometry, distance: float, speed: float, acceleration: float
) -> float:
    """Return the shortest time between the blends of a segment that is sent as a speed."""
    ramps = sum(_rests_at_ends(geometry))
    peak = min(speed, sqrt(2.0 * acceleration * distance / ramps)) if ramps else speed
    return distance / peak + 0.5 * ramps * peak / acceleration


def _max_acceleration(geometry: SegmentGeometry, limits: SpeedLimits) -> float:
    """Return the maximum acceleration that may follow from a time."""
    if own := _own_acceleration(geometry):
        return min(own, limits.acceleration)
    return limits.acceleration


# -- blends ---------------------------------------------------------------------------------------


def _blend_time(
    geometries: Sequence[SegmentGeometry], timings: Sequence[SegmentTiming], k: int
) -> float:
    """Return the time that a segment spends in its halves of the blends at its ends [s]."""
    time = 0.0
    if geometries[k].blend_before is not None:
        time += blend_duration(geometries[k - 1], timings[k - 1], geometries[k], timings[k]) / 2.0
    if geometries[k].blend_after is not None:
        time += blend_duration(geometries[k], timings[k], geometries[k + 1], timings[k + 1]) / 2.0
    return time


def blend_duration(
    first: SegmentGeometry,
    timing: SegmentTiming,
    second: SegmentGeometry,
    next_timing: SegmentTiming,
) -> float:
    """Return the time in the blend between two segments [s]; the tool's speed changes evenly."""
    assert first.blend_after is not None
    speeds = (
        timing.profile.leave
        * first.curve.length
        / timing.profile.length
        * first.unblended_fraction
        + next_timing.profile.enter
        * second.curve.length
        / next_timing.profile.length
        * second.unblended_fraction
    )
    return 2.0 * first.blend_after.length / max(speeds, 1e-9)
