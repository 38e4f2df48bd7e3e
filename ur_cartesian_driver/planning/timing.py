# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
How fast each segment goes: from the times of the goal, from its speeds, or from the defaults.

``movel`` and ``movej`` take a time on the wire. ``movec`` and ``movep`` do not: their speed is
derived so that the time is met. The robot has one speed for the translation and the turn of the
tool, in m/s and rad/s, which neither may exceed; so the quantity that *leads* a segment is the
larger of both numbers (for joint moves the joint that turns farthest).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import hypot, inf, sqrt

from ur_cartesian_driver.kinematics.robots import JOINT_NAMES, RobotModel
from ur_cartesian_driver.motion.errors import InvalidGoal, TooFast
from ur_cartesian_driver.motion.goal import ArcMode, Segment, SegmentType, Waypoint
from ur_cartesian_driver.motion.primitive import Joints
from ur_cartesian_driver.planning.corner import Corner
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.path import Arc, JointLine, Path, SAME_POSITION
from ur_cartesian_driver.planning.postures import Trace
from ur_cartesian_driver.planning.profile import (
    cruise_for,
    peak_factor,
    Profile,
    timed,
    trapezoid,
)
from ur_cartesian_driver.planning.validate import is_optimized, point_field, segment_field

#: The lowest speed that the wire carries well enough: it counts in millionths.
LEAST_SPEED = 1e-5
#: What an OPTIMIZED move is taken to accelerate with at fraction 1 [rad/s^2]; the robot's own
#: limits are not published. It only serves to say about how long such a move takes.
_OPTIMIZED_JOINT_ACCELERATION = 15.0
#: Where the robot stands at the first point already, the way there counts as this.
_NO_WAY = 1e-9
#: Rounds in which speeds and the times in corners are made to agree.
_ROUNDS = 12


@dataclass(frozen=True, slots=True, kw_only=True)
class Leg:
    """A segment whose way is decided and whose speed is not."""

    index: int
    #: What will be sent: AUTO resolved, JOINT where a posture cannot be reached otherwise.
    kind: SegmentType
    waypoint: Waypoint
    segment: Segment
    path: Path
    #: Configurations before, along and at the end.
    q_start: Joints
    trace: Trace
    #: Time that the goal gives it [s]; None = speeds decide.
    time: float | None
    #: The corners at its ends; None = it stands there.
    before: Corner | None = None
    after: Corner | None = None

    @property
    def joints(self) -> Joints:
        """Configuration at the end [rad]."""
        return self.trace[-1][1]

    @property
    def u_before(self) -> float:
        """Where the path is joined after the corner before."""
        return self.before.join if self.before else 0.0

    @property
    def u_after(self) -> float:
        """Where the path is left for the corner after."""
        return self.after.leave if self.after else 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Timing:
    """How fast one leg goes."""

    #: What the wire carries; ``wire_time`` 0 = speed and acceleration count.
    velocity: float
    acceleration: float
    wire_time: float
    #: The leading quantity, its unit, and the motion between the corners.
    unit: str
    profile: Profile
    #: Expected time, half of each corner included [s].
    duration: float
    #: Why, as the end of "because ...".
    reason: str
    #: What was changed, empty if nothing.
    remark: str = ''


@dataclass(frozen=True, slots=True, kw_only=True)
class _Limits:
    """The largest speed of the leading quantity, what sets it, and the largest acceleration."""

    speed: float
    name: str
    acceleration: float


def schedule(legs: Sequence[Leg], options: PlanningOptions, model: RobotModel) -> list[Timing]:
    """
    Return the timing of every leg.

    :raises TooFast: a time needs more speed or acceleration than the limits allow.
    :raises InvalidGoal: a speed is too low for the wire.
    """
    measures = [measure(leg, model) for leg in legs]
    timings = [_first_guess(leg, length, unit, options, model)
               for leg, (length, unit) in zip(legs, measures, strict=True)]
    derived = [k for k, leg in enumerate(legs)
               if leg.time is not None and not _takes_time(leg.kind)]
    # The time in a corner depends on the speeds on both of its sides, so go round a few times.
    for _ in range(_ROUNDS if any(_is_blended(legs[k]) for k in derived) else 1):
        changed = 0.0
        for k in derived:
            new = _for_time(legs[k], measures[k], _corner_time(legs, timings, measures, k),
                            options, model)
            changed = max(changed, abs(new.velocity / timings[k].velocity - 1.0))
            timings[k] = new
        if changed < 1e-6:
            break
    for leg, timing in zip(legs, timings, strict=True):
        if timing.wire_time == 0.0 and timing.velocity < LEAST_SPEED:
            raise InvalidGoal(
                point_field(leg.index), f'would be approached at {timing.velocity:.2g} '
                f'{timing.unit}/s, less than the {LEAST_SPEED:g} that the robot can be told',
                'give it less time')
    return [replace(timing, duration=timing.profile.duration
                    + _corner_time(legs, timings, measures, k))
            for k, timing in enumerate(timings)]


def measure(leg: Leg, model: RobotModel) -> tuple[float, str]:
    """
    Return the length of the leading quantity and its unit (m or rad; s for OPTIMIZED moves).

    OPTIMIZED moves are measured by the time that they would take at all joints' limits.
    """
    path = leg.path
    if is_optimized(leg.kind):
        length, unit = sum(_joint_times(leg, model)), 's'
    elif isinstance(path, JointLine):
        length, unit = max(path.travel), 'rad'
    elif path.length >= path.angle or (isinstance(path, Arc) and path.mode == ArcMode.FIXED):
        length, unit = path.length, 'm'
    else:
        length, unit = path.angle, 'rad'
    return max(length, _NO_WAY), unit


def _takes_time(kind: SegmentType) -> bool:
    return kind in (SegmentType.LINEAR, SegmentType.JOINT)


def _is_blended(leg: Leg) -> bool:
    return leg.before is not None or leg.after is not None


def _stands(leg: Leg) -> tuple[bool, bool]:
    return leg.before is None, leg.after is None


def _share(leg: Leg) -> float:
    """Return the part of the leg between its corners; blends that touch leave nearly nothing."""
    return max(leg.u_after - leg.u_before, 1e-9)


def _first_guess(leg: Leg, length: float, unit: str, options: PlanningOptions,
                 model: RobotModel) -> Timing:
    if leg.time is None:
        return _by_speed(leg, length, unit, options, model)
    if _takes_time(leg.kind):
        return _by_time(leg, length, unit, options, model)
    return _for_time(leg, (length, unit), 0.0, options, model, strict=True)


# -- speeds ---------------------------------------------------------------------------------------


def _by_speed(leg: Leg, length: float, unit: str, options: PlanningOptions,
              model: RobotModel) -> Timing:
    """Return the timing of a leg without a time."""
    wanted, reason = _wanted_speed(leg, unit, options)
    acceleration = leg.segment.acceleration or _default_acceleration(leg, unit, options)
    turns_on_the_way = leg.kind == SegmentType.LINEAR and unit == 'rad' and _moves(leg)
    if turns_on_the_way:
        return _turning_line(leg, length, wanted, acceleration, reason, options)
    limits = _limits(leg, length, options, model)
    velocity = min(wanted, limits.speed)
    remark = ''
    if velocity < wanted:
        remark = (f'point {leg.index}: slowed from {wanted:.3g} to {velocity:.3g} '
                  f'{_speed_unit(unit)} by {limits.name}')
    way = length * _share(leg)
    if is_optimized(leg.kind):
        rate = acceleration * _OPTIMIZED_JOINT_ACCELERATION / min(model.max_joint_speed)
        profile = trapezoid(way, velocity, rate, *_stands(leg))
    else:
        profile = trapezoid(way, velocity, acceleration, *_stands(leg))
    return Timing(velocity=velocity, acceleration=acceleration, wire_time=0.0, unit=unit,
                  profile=profile, duration=profile.duration, reason=reason, remark=remark)


def _wanted_speed(leg: Leg, unit: str, options: PlanningOptions) -> tuple[float, str]:
    """Return the speed that the goal asks for, and the words for where it comes from."""
    if leg.segment.velocity > 0.0:
        return leg.segment.velocity, f'{segment_field(leg.index, "velocity")} says so'
    if is_optimized(leg.kind):
        return options.optimized_velocity, 'that is the default of the driver'
    if leg.kind == SegmentType.JOINT:
        return options.joint_velocity, 'that is the default of the driver'
    twist = leg.waypoint.twist
    speed = hypot(*twist[:3]) if _moves(leg) else hypot(*twist[3:])
    if speed > 0.0:
        return speed, "that is the point's twist"
    if not _moves(leg):
        return options.angular_velocity, 'that is the default of the driver'
    if unit == 'rad' and leg.kind != SegmentType.LINEAR:
        # One number for both: as rad/s the turn may have more, but never more than the tool may.
        fastest = options.max_tool_speed or options.angular_velocity
        return (max(options.linear_velocity, min(options.angular_velocity, fastest)),
                'it turns more than it moves')
    return options.linear_velocity, 'that is the default of the driver'


def _default_acceleration(leg: Leg, unit: str, options: PlanningOptions) -> float:
    if is_optimized(leg.kind):
        return options.optimized_acceleration
    if leg.kind == SegmentType.JOINT:
        return options.joint_acceleration
    return options.linear_acceleration if _moves(leg) else options.angular_acceleration


def _turning_line(leg: Leg, angle: float, velocity: float, acceleration: float, reason: str,
                  options: PlanningOptions) -> Timing:
    """
    Return the timing of a line on which the turn leads.

    The robot's one number would turn the tool as slowly as it moves, so a time is sent in which
    the tool keeps its speed [m/s] and turns no faster than the default.
    """
    remark = ''
    if 0.0 < options.max_tool_speed < velocity:
        remark = (f'point {leg.index}: slowed from {velocity:.3g} to {options.max_tool_speed:.3g} '
                  'm/s by max_tool_speed')
        velocity = options.max_tool_speed
    stands = _stands(leg)
    length = leg.path.length
    time = max(_least_time(length, velocity, acceleration, stands),
               _least_time(angle, options.angular_velocity, options.angular_acceleration, stands))
    profile = timed(angle * _share(leg), time * _share(leg), *stands)
    return Timing(velocity=velocity, acceleration=acceleration, wire_time=time, unit='rad',
                  profile=profile, duration=time, reason=f'{reason} and it turns on the way',
                  remark=remark)


# -- times ----------------------------------------------------------------------------------------


def _by_time(leg: Leg, length: float, unit: str, options: PlanningOptions,
             model: RobotModel) -> Timing:
    """Return the timing of a leg for which the wire carries the time."""
    assert leg.time is not None
    limits, stands = _limits(leg, length, options, model), _stands(leg)
    least = _least_time(length, limits.speed, limits.acceleration, stands)
    time, remark = leg.time, ''
    if time < least * (1.0 - 1e-9):
        time, remark = _slowed(leg, length, unit, least, limits, options)
    profile = timed(length * _share(leg), time * _share(leg), *stands)
    # The robot ignores speed and acceleration when it has a time; they say what it will need.
    return Timing(velocity=profile.cruise, acceleration=profile.acceleration, wire_time=time,
                  unit=unit, profile=profile, duration=time, reason=_time_reason(leg),
                  remark=remark)


def _for_time(leg: Leg, measured: tuple[float, str], in_corners: float, options: PlanningOptions,
              model: RobotModel, strict: bool = True) -> Timing:
    """
    Return the timing of a leg that has to meet a time by its speed.

    :param in_corners: the part of the time that passes in the corners at its ends [s].
    :param strict: whether a time that is too short is refused (not in a first guess).
    """
    assert leg.time is not None
    length, unit = measured
    limits, stands = _limits(leg, length, options, model), _stands(leg)
    way, ramps = length * _share(leg), sum(stands)
    time, remark = leg.time, ''
    least = in_corners + _least_time(way, limits.speed, _bound(leg, limits), stands)
    if strict and time < least * (1.0 - 1e-9):
        time, remark = _slowed(leg, length, unit, least, limits, options)
    between = max(time - in_corners, 0.05 * time)
    acceleration = leg.segment.acceleration or _default_acceleration(leg, unit, options)
    if not leg.segment.acceleration:
        # At least what makes a third each of speeding up, cruising and braking.
        acceleration = max(acceleration, 3.0 * peak_factor(*stands) * way / between ** 2)
    velocity = cruise_for(way, between, acceleration, ramps)
    if velocity is None:  # only before the corners are known, or within rounding
        velocity = way / between * peak_factor(*stands)
    profile = trapezoid(way, velocity, acceleration, *stands)
    return Timing(velocity=velocity, acceleration=acceleration, wire_time=0.0, unit=unit,
                  profile=profile, duration=time, reason=_time_reason(leg), remark=remark)


def _slowed(leg: Leg, length: float, unit: str, least: float, limits: _Limits,
            options: PlanningOptions) -> tuple[float, str]:
    """Return the time that the limits allow and the remark, or refuse."""
    assert leg.time is not None
    if options.on_too_fast == 'slow':
        return least, (f'point {leg.index}: takes {least:.3f} s instead of {leg.time:.3f} s, '
                       f'because of {limits.name}')
    speed = length / leg.time * peak_factor(*_stands(leg))
    raise TooFast(
        point_field(leg.index, 'time_from_start'),
        f'gives the segment {leg.time:.3f} s for {length:.3f} {unit}, which needs a speed of '
        f'{speed:.3f} {_speed_unit(unit)} and {3.0 * speed / leg.time:.3f} {_speed_unit(unit)}^2; '
        f'allowed are {limits.speed:.3f} {_speed_unit(unit)} ({limits.name}) and '
        f'{_bound(leg, limits):.3f} {_speed_unit(unit)}^2',
        f'give it at least {least:.3f} s, or set on_too_fast to slow')


def _least_time(length: float, speed: float, acceleration: float,
                stands: tuple[bool, bool]) -> float:
    """Return the shortest time in which a timed motion stays within speed and acceleration."""
    factor = peak_factor(*stands)
    by_speed = length * factor / speed
    by_acceleration = sqrt(3.0 * factor * length / acceleration) if any(stands) else 0.0
    return max(by_speed, by_acceleration)


def _bound(leg: Leg, limits: _Limits) -> float:
    """Return the largest acceleration that a time may lead to."""
    if leg.segment.acceleration and not _takes_time(leg.kind):
        return min(leg.segment.acceleration, limits.acceleration)
    return limits.acceleration


def _time_reason(leg: Leg) -> str:
    return f'{point_field(leg.index, "time_from_start")} says so'


# -- corners --------------------------------------------------------------------------------------


def _corner_time(legs: Sequence[Leg], timings: Sequence[Timing],
                 measures: Sequence[tuple[float, str]], k: int) -> float:
    """Return the time that a leg spends in its halves of the corners at its ends [s]."""
    time = 0.0
    for corner, other in ((legs[k].before, k - 1), (legs[k].after, k + 1)):
        if corner is not None:
            mine = _tool_speed(legs[k], timings[k], measures[k][0])
            its = _tool_speed(legs[other], timings[other], measures[other][0])
            time += corner_duration(corner, mine, its) / 2.0
    return time


def corner_duration(corner: Corner, speed: float, other: float) -> float:
    """Return the time in a corner [s] in which the tool changes evenly between two speeds."""
    return 2.0 * corner.length / max(speed + other, 1e-9)


def _tool_speed(leg: Leg, timing: Timing, length: float) -> float:
    return timing.profile.cruise * leg.path.length / length


# -- limits ---------------------------------------------------------------------------------------


def _limits(leg: Leg, length: float, options: PlanningOptions, model: RobotModel) -> _Limits:
    """Return what bounds the leading quantity of a leg."""
    tool = inf
    if options.max_tool_speed > 0.0 and _moves(leg):
        tool = options.max_tool_speed / _tool_per_unit(leg, length, model)
    speed, name = tool, f'max_tool_speed = {options.max_tool_speed:g} m/s'
    if leg.kind == SegmentType.JOINT and isinstance(leg.path, JointLine):
        for k, way in enumerate(leg.path.travel):
            if way > 0.0 and model.max_joint_speed[k] * length / way < speed:
                speed = model.max_joint_speed[k] * length / way
                name = f'the limit of {JOINT_NAMES[k]}, {model.max_joint_speed[k]:.3f} rad/s'
        return _Limits(speed=speed, name=name, acceleration=options.max_joint_acceleration)
    bound = (options.max_linear_acceleration * length / leg.path.length
             if _moves(leg) else inf)
    if leg.path.angle > 0.0:
        bound = min(bound, options.max_angular_acceleration * length / leg.path.angle)
    return _Limits(speed=speed, name=name, acceleration=bound)


def _tool_per_unit(leg: Leg, length: float, model: RobotModel) -> float:
    """Return the most metres that the tool goes per unit of the leading quantity."""
    path = leg.path
    if isinstance(path, JointLine):
        return path.length * path.unevenness / length
    if is_optimized(leg.kind):
        places = [0.0, *(u for u, _ in leg.trace)]
        ways = [(b - a) * path.length for a, b in pairwise(places)]
        times = _joint_times(leg, model)
        return max(way / time for way, time in zip(ways, times, strict=True) if time > 0.0)
    return path.length / length


def _joint_times(leg: Leg, model: RobotModel) -> list[float]:
    """Return for each step of the trace the time that the slowest joint needs at its limit."""
    configurations = [leg.q_start, *(q for _, q in leg.trace)]
    return [max(abs(b - a) / limit
                for a, b, limit in zip(p, q, model.max_joint_speed, strict=True))
            for p, q in pairwise(configurations)]


def _moves(leg: Leg) -> bool:
    """Tell whether the tool's position changes; if not the leg only turns it."""
    return leg.path.length > SAME_POSITION


def _speed_unit(unit: str) -> str:
    return 'of the limits' if unit == 's' else f'{unit}/s'
