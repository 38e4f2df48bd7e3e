# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
How fast each segment goes: from the times of the goal, from its speeds, or from the defaults.

``movel`` and ``movej`` take a time on the wire. ``movec`` and ``movep`` do not: their speed is
derived so that the time is met. All of it is about the quantity that leads a segment, see
:mod:`~.limits`.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, hypot, inf, sqrt

from ur_cartesian_driver.kinematics.robots import RobotModel
from ur_cartesian_driver.motion.errors import InvalidGoal, TooFast
from ur_cartesian_driver.motion.goal import SegmentType
from ur_cartesian_driver.planning.leg import Leg, Timing
from ur_cartesian_driver.planning.limits import (
    is_blended,
    Limits,
    limits_of,
    measure,
    moves,
    speed_unit,
)
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.profile import (
    cruise_for,
    least_time,
    peak_of,
    Profile,
    timed,
    trapezoid,
)
from ur_cartesian_driver.planning.validate import is_optimized, point_field

#: The lowest speed that the wire carries well enough: it counts in millionths.
LEAST_SPEED = 1e-5
#: What an OPTIMIZED move is taken to accelerate with at fraction 1 [rad/s^2]; the robot's own
#: limits are not published. It only serves to say about how long such a move takes.
_OPTIMIZED_JOINT_ACCELERATION = 40.0
_TIME_SAYS_SO = 'its time_from_start says so'
#: Motions whose messages have a time.
_HAVE_TIMES = (SegmentType.LINEAR, SegmentType.JOINT)
#: Rounds in which speeds and the times in corners are made to agree.
_ROUNDS = 12


def schedule(legs: Sequence[Leg], options: PlanningOptions, model: RobotModel) -> list[Timing]:
    """
    Return the timing of every leg.

    :raises TooFast: a time needs more speed or acceleration than the limits allow.
    :raises InvalidGoal: a speed is too low for the wire.
    """
    measures = [measure(leg) for leg in legs]
    timings = [
        _first_guess(leg, length, unit, options, model)
        for leg, (length, unit) in zip(legs, measures, strict=True)
    ]
    derived = [
        k
        for k, leg in enumerate(legs)
        if leg.time is not None and not _takes_time(leg.kind, options)
    ]
    # The time in a corner depends on the speeds on both of its sides, so go round a few times.
    for _ in range(_ROUNDS if any(is_blended(legs[k]) for k in derived) else 1):
        changed = 0.0
        for k in derived:
            new = _for_time(legs[k], measures[k], _corner_time(legs, timings, k), options, model)
            changed = max(changed, abs(new.velocity / timings[k].velocity - 1.0))
            timings[k] = new
        if changed < 1e-6:
            break
    for leg, timing in zip(legs, timings, strict=True):
        _check_wire(leg, timing, options)
    for k in range(1, len(legs)):
        if legs[k].before is not None and legs[k].time is None:
            timings[k] = _from_corner(legs, timings, k)
    corners = [
        corner_duration(legs[k], timings[k], legs[k + 1], timings[k + 1])
        if legs[k].after is not None
        else 0.0
        for k in range(len(legs))
    ]
    return [
        _whole(leg, timing, before, after)
        for leg, timing, before, after in zip(
            legs, timings, [0.0, *corners[:-1]], corners, strict=True
        )
    ]


def _check_wire(leg: Leg, timing: Timing, options: PlanningOptions) -> None:
    """Refuse what would be zero on the wire, or next to it, and times that it does not carry."""
    if timing.wire_time > options.max_segment_time:
        raise InvalidGoal(
            point_field(leg.index),
            f'would be approached in {timing.wire_time:.4g} s, more than '
            f'max_segment_time = {options.max_segment_time:.0f} s',
            'raise velocity or acceleration',
        )
    if timing.wire_time > 0.0:
        return
    unit = speed_unit(timing.unit)
    for value, name in ((timing.velocity, unit), (timing.acceleration, f'{unit}^2')):
        if value < LEAST_SPEED:
            raise InvalidGoal(
                point_field(leg.index),
                f'would be approached with {value:.2g} {name}, less than '
                f'the {LEAST_SPEED:g} that the robot can be told',
                'give it less time' if leg.time else 'raise velocity or acceleration',
            )


def _from_corner(legs: Sequence[Leg], timings: Sequence[Timing], k: int) -> Timing:
    """
    Return the timing of a leg that comes out of a corner no faster than both legs accelerate.

    In the corner the way of the first leg ends as r1 (1 - s)^2, that of the second begins as
    r2 s^2, so s' may grow to sqrt(a / 2r) of either.
    """
    before, old = timings[k - 1].profile, timings[k].profile
    r1 = (1.0 - legs[k - 1].u_after) * before.length / legs[k - 1].share
    r2 = legs[k].u_before * old.length / legs[k].share
    pace = max(
        before.leave / (2.0 * r1), sqrt(min(before.acceleration / r1, old.acceleration / r2) / 2.0)
    )
    enter = min(
        timings[k].velocity,
        2.0 * r2 * pace,
        sqrt(2.0 * old.acceleration * old.length + old.leave**2),
    )
    profile = trapezoid(
        old.length,
        timings[k].velocity,
        old.acceleration,
        enter,
        0.5 * old.leave**2 / old.acceleration,
    )
    return _with(timings[k], profile)


def _whole(leg: Leg, timing: Timing, before: float, after: float) -> Timing:
    """
    Return the timing with its expected duration, half of each corner included.

    :param before: time in the corners before and after it [s].
    """
    in_corners, profile = 0.5 * (before + after), timing.profile
    if timing.wire_time > 0.0 and in_corners > 0.0:
        # What is sent as a time is kept in sum: corners are shorter, so what is left has longer.
        left = max(timing.wire_time - in_corners, 0.05 * timing.wire_time)
        profile = timed(profile.length, left, *_stands(leg))
    return _with(timing, profile, profile.duration + in_corners, after)


def _with(timing: Timing, profile: Profile, duration: float = 0.0, corner: float = 0.0) -> Timing:
    """Return the timing with another profile; ``replace`` takes twice as long, for each leg."""
    return Timing(
        velocity=timing.velocity,
        acceleration=timing.acceleration,
        wire_time=timing.wire_time,
        unit=timing.unit,
        profile=profile,
        duration=duration,
        corner=corner,
        reason=timing.reason,
        remark=timing.remark,
    )


def _takes_time(kind: SegmentType, options: PlanningOptions) -> bool:
    """
    Tell whether the wire carries a time for a motion.

    Never in the dialect that counts in milliseconds: a robot program that counts in microseconds
    would run a segment a thousand times too fast, and nobody can ask a program how it counts.
    """
    return kind in _HAVE_TIMES and not options.dialect.is_coarse


def _own_acceleration(leg: Leg) -> float:
    """Return the acceleration of a timed leg that the goal may choose, 0 = it has none."""
    return 0.0 if leg.kind in _HAVE_TIMES else leg.segment.acceleration


def _stands(leg: Leg) -> tuple[bool, bool]:
    return leg.before is None, leg.after is None


def _tail(leg: Leg, length: float) -> float:
    """Return how far behind its end between corners the robot plans to stop, see trapezoid."""
    if leg.after is not None and leg.kind == SegmentType.PROCESS:
        return inf
    return length * (1.0 - leg.u_after)


def _first_guess(
    leg: Leg, length: float, unit: str, options: PlanningOptions, model: RobotModel
) -> Timing:
    if leg.time is None:
        return _by_speed(leg, length, unit, options, model)
    if _takes_time(leg.kind, options):
        return _by_time(leg, length, unit, options, model)
    return _for_time(leg, (length, unit), 0.0, options, model, strict=False)


# -- speeds ---------------------------------------------------------------------------------------


def _by_speed(
    leg: Leg, length: float, unit: str, options: PlanningOptions, model: RobotModel
) -> Timing:
    """Return the timing of a leg without a time."""
    wanted, reason = _wanted_speed(leg, unit, options)
    acceleration = leg.segment.acceleration or _default_acceleration(leg, unit, options)
    limits = limits_of(leg, length, options, model)
    if not is_optimized(leg.kind):
        acceleration = min(acceleration, limits.acceleration)
    turns_on_the_way = leg.kind == SegmentType.LINEAR and unit == 'rad' and moves(leg)
    if turns_on_the_way:
        return _turning_line(leg, length, wanted, acceleration, reason, options)
    velocity = min(wanted, limits.speed)
    remark = ''
    if velocity < wanted:
        remark = (
            f'point {leg.index}: slowed from {wanted:.3g} to {velocity:.3g} '
            f'{speed_unit(unit)} by {limits.name}'
        )
    rate = acceleration
    if is_optimized(leg.kind):
        rate *= _OPTIMIZED_JOINT_ACCELERATION / min(model.max_joint_speed)
    profile = trapezoid(
        length * leg.share, velocity, rate, inf if leg.before else 0.0, _tail(leg, length)
    )
    return Timing(
        velocity=velocity,
        acceleration=acceleration,
        wire_time=0.0,
        unit=unit,
        profile=profile,
        duration=profile.duration,
        reason=reason,
        remark=remark,
    )


def _wanted_speed(leg: Leg, unit: str, options: PlanningOptions) -> tuple[float, str]:
    """Return the speed that the goal asks for, and the words for where it comes from."""
    if leg.segment.velocity > 0.0:
        return leg.segment.velocity, 'its velocity says so'
    if is_optimized(leg.kind):
        return options.optimized_velocity, 'that is the default speed'
    if leg.kind == SegmentType.JOINT:
        return options.joint_velocity, 'that is the default speed'
    twist = leg.waypoint.twist
    speed = hypot(*twist[:3]) if moves(leg) else hypot(*twist[3:])
    if speed > 0.0:
        return speed, 'its twist says so'
    if not moves(leg):
        return options.angular_velocity, 'that is the default speed'
    if unit == 'rad' and leg.kind != SegmentType.LINEAR:
        # One number for both: as rad/s the turn may have more, but never more than the tool may.
        fastest = options.max_tool_speed or options.angular_velocity
        return (
            max(options.linear_velocity, min(options.angular_velocity, fastest)),
            'it turns more than it moves',
        )
    return options.linear_velocity, 'that is the default speed'


def _default_acceleration(leg: Leg, unit: str, options: PlanningOptions) -> float:
    if is_optimized(leg.kind):
        return options.optimized_acceleration
    if leg.kind == SegmentType.JOINT:
        return options.joint_acceleration
    return options.linear_acceleration if moves(leg) else options.angular_acceleration


def _turning_line(
    leg: Leg,
    angle: float,
    velocity: float,
    acceleration: float,
    reason: str,
    options: PlanningOptions,
) -> Timing:
    """
    Return the timing of a line on which the turn leads.

    The robot's one number would turn the tool as slowly as it moves, so a time is sent in which
    the tool keeps its speed [m/s] and turns no faster than the default.
    """
    remark = ''
    if 0.0 < options.max_tool_speed < velocity:
        remark = (
            f'point {leg.index}: slowed from {velocity:.3g} to {options.max_tool_speed:.3g} '
            'm/s by max_tool_speed'
        )
        velocity = options.max_tool_speed
    time = max(
        least_time(leg.path.length, velocity, acceleration),
        least_time(angle, options.angular_velocity, options.angular_acceleration),
    )
    profile = timed(angle * leg.share, time * leg.share, *_stands(leg))
    wire_time = time
    if not _takes_time(leg.kind, options):
        velocity, wire_time = profile.cruise, 0.0
        _, acceleration = peak_of(angle, time)
    return Timing(
        velocity=velocity,
        acceleration=acceleration,
        wire_time=wire_time,
        unit='rad',
        profile=profile,
        duration=time,
        reason=f'{reason} and it turns on the way',
        remark=remark,
    )


# -- times ----------------------------------------------------------------------------------------


def _by_time(
    leg: Leg, length: float, unit: str, options: PlanningOptions, model: RobotModel
) -> Timing:
    """Return the timing of a leg for which the wire carries the time."""
    assert leg.time is not None
    limits = limits_of(leg, length, options, model)
    least = least_time(length, limits.speed, limits.acceleration)
    time, remark = leg.time, ''
    if time < least * (1.0 - 1e-9):
        time, remark = _slowed(leg, length, unit, least, limits, options)
    profile = timed(length * leg.share, time * leg.share, *_stands(leg))
    # The robot ignores speed and acceleration when it has a time; they say what it will need.
    velocity, acceleration = peak_of(length, time)
    return Timing(
        velocity=velocity,
        acceleration=acceleration,
        wire_time=time,
        unit=unit,
        profile=profile,
        duration=time,
        reason=_TIME_SAYS_SO,
        remark=remark,
    )


def _for_time(
    leg: Leg,
    measured: tuple[float, str],
    in_corners: float,
    options: PlanningOptions,
    model: RobotModel,
    strict: bool = True,
) -> Timing:
    """
    Return the timing of a leg that has to meet a time by its speed.

    :param in_corners: the part of the time that passes in the corners at its ends [s].
    :param strict: whether a time that is too short is refused (not in a first guess).
    """
    assert leg.time is not None
    length, unit = measured
    limits = limits_of(leg, length, options, model)
    way, tail = length * leg.share, _tail(leg, length)
    bound = _bound(leg, limits)
    time, remark = leg.time, ''
    least = in_corners + _least_by_speed(leg, way, limits.speed, bound)
    if strict and time < least * (1.0 - 1e-9):
        time, remark = _slowed(leg, length, unit, least, limits, options)
    between = max(time - in_corners, 0.05 * time)
    acceleration = _own_acceleration(leg) or max(
        _default_acceleration(leg, unit, options),
        # A third each of speeding up, cruising and braking; and no braking before a blend.
        min(bound, 4.5 * way / between**2),
        min(bound, (way / between) ** 2 / tail if 0.0 < tail < inf else 0.0),
    )
    velocity = cruise_for(way, between, acceleration, sum(_stands(leg)))
    if velocity is None:  # only before the corners are known, or within rounding
        velocity = 2.0 * way / between
    profile = trapezoid(way, velocity, acceleration, inf if leg.before else 0.0, tail)
    return Timing(
        velocity=velocity,
        acceleration=acceleration,
        wire_time=0.0,
        unit=unit,
        profile=profile,
        duration=time,
        reason=_TIME_SAYS_SO,
        remark=remark,
    )


def _slowed(
    leg: Leg, length: float, unit: str, least: float, limits: Limits, options: PlanningOptions
) -> tuple[float, str]:
    """Return the time that the limits allow and the remark, or refuse."""
    assert leg.time is not None
    if least > options.max_segment_time:
        raise TooFast(
            point_field(leg.index, 'time_from_start'),
            f'gives the segment {leg.time:.3f} s, but because of {limits.name} it takes '
            f'{least:.0f} s, more than max_segment_time = {options.max_segment_time:.0f} s',
            'go around the place where it has to be slow, or use a JOINT segment',
        )
    if options.on_too_fast == 'slow':
        return least, (
            f'point {leg.index}: takes {least:.3f} s instead of {leg.time:.3f} s, '
            f'because of {limits.name}'
        )
    speed, acceleration = peak_of(length, leg.time)
    raise TooFast(
        point_field(leg.index, 'time_from_start'),
        f'gives the segment {leg.time:.3f} s for {length:.3f} {unit}, which needs up to '
        f'{speed:.3f} {speed_unit(unit)} and {acceleration:.3f} {speed_unit(unit)}^2; '
        f'allowed are {limits.speed:.3f} {speed_unit(unit)} ({limits.name}) and '
        f'{_bound(leg, limits):.3f} {speed_unit(unit)}^2',
        f'give it at least {ceil(1e3 * least) / 1e3:.3f} s, or set on_too_fast to slow',
    )


def _least_by_speed(leg: Leg, way: float, speed: float, acceleration: float) -> float:
    """Return the shortest time between the corners of a leg that is sent as a speed."""
    ramps = sum(_stands(leg))
    peak = min(speed, sqrt(2.0 * acceleration * way / ramps)) if ramps else speed
    return way / peak + 0.5 * ramps * peak / acceleration


def _bound(leg: Leg, limits: Limits) -> float:
    """Return the largest acceleration that a time may lead to."""
    if own := _own_acceleration(leg):
        return min(own, limits.acceleration)
    return limits.acceleration


# -- corners --------------------------------------------------------------------------------------


def _corner_time(legs: Sequence[Leg], timings: Sequence[Timing], k: int) -> float:
    """Return the time that a leg spends in its halves of the corners at its ends [s]."""
    time = 0.0
    if legs[k].before is not None:
        time += corner_duration(legs[k - 1], timings[k - 1], legs[k], timings[k]) / 2.0
    if legs[k].after is not None:
        time += corner_duration(legs[k], timings[k], legs[k + 1], timings[k + 1]) / 2.0
    return time


def corner_duration(first: Leg, timing: Timing, second: Leg, next_timing: Timing) -> float:
    """Return the time in the corner between two legs [s]; the tool's speed changes evenly."""
    assert first.after is not None
    speeds = (
        timing.profile.leave * first.path.length / timing.profile.length * first.share
        + next_timing.profile.enter
        * second.path.length
        / next_timing.profile.length
        * second.share
    )
    return 2.0 * first.after.length / max(speeds, 1e-9)
