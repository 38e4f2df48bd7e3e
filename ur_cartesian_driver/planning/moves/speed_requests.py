# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
What a segment asks of its move: from the times of the goal, from its speeds, or from the defaults.

All numbers are about the leading quantity of a segment, see :mod:`~.speed_limits`.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot, inf, nan, sqrt

from ur_cartesian_driver.kinematics.robot_models import RobotModel
from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.goal import SegmentType
from ur_cartesian_driver.motion.plan import PlannedSegment
from ur_cartesian_driver.motion.primitive import Spline
from ur_cartesian_driver.planning.geometry.blended_path import Blend
from ur_cartesian_driver.planning.moves.segment_data import SegmentGeometry
from ur_cartesian_driver.planning.moves.speed_limits import (
    leading_quantity,
    speed_limits,
    speed_unit,
    translates,
)
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.goal_fields import is_optimized, point_field

#: A move with a time stretches the trapezoid of the speed and acceleration beside it (recorded on
#: a UR3). We send 1.5 d/T and 4.5 d/T^2: a third of the time each for accelerating, cruising and
#: braking, which is also what robots would do that ignore the two.
RAMP_SHARE = 1.0 / 3.0
#: Assumed acceleration of an OPTIMIZED move at fraction 1 [rad/s^2]; the robot's own limits are
#: not published. It only serves to estimate the time of such a move.
_OPTIMIZED_JOINT_ACCELERATION = 40.0
#: Motions that take a time on the wire.
_TIMED_ON_WIRE = (SegmentType.LINEAR, SegmentType.JOINT)
#: Motions that take none, whose turn has never been measured.
_UNMEASURED_TURNS = (SegmentType.CIRCULAR, SegmentType.PROCESS)
#: Peak over mean of the speed of a timed move: in thirds, and in the triangle that a line whose
#: turn leads makes of the same numbers if the robot turns the tool faster than it moves it.
_PEAK, _PEAK_OF_TURN = 1.0 / (1.0 - RAMP_SHARE), 2.0
#: Of a segment without any motion no acceleration is too much.
_UNLIMITED = 1e9
#: A time that is longer by less than this factor is not remarked.
_NOTICEABLY = 1.001


def min_duration(length: float, speed: float, acceleration: float, peak: float = _PEAK) -> float:
    """
    Return the shortest time on the wire that keeps its peaks from rest to rest within bounds [s].

    :param peak: speed over mean speed; 2 where it might be a triangle, whose acceleration is less.
    """
    return max(
        peak * length / speed,
        sqrt(length / acceleration / (RAMP_SHARE * (1.0 - RAMP_SHARE))),
    )


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


class SegmentTimer:
    """Knows what one segment asks of its move, and its limits."""

    def __init__(
        self, geometry: SegmentGeometry, options: PlanningOptions, model: RobotModel
    ) -> None:
        self.geometry, self.options, self.model = geometry, options, model
        self.length, self.unit = leading_quantity(geometry)
        self.speed_unit = speed_unit(self.unit)
        self.limits = speed_limits(geometry, self.length, options, model)
        self.turn_leads_line = self.unit == 'rad' and geometry.kind == SegmentType.LINEAR
        self.peak = _PEAK_OF_TURN if self.turn_leads_line else _PEAK
        self._ramp_share = RAMP_SHARE
        #: Part of its length that the robot counts, by the turn ratio.
        self._counted = 1.0
        if self.turn_leads_line:
            counted = max(geometry.curve.length, self.length / options.turn_ratio)
            self._counted = counted / self.length
            # Of the trapezoid of 1.5 d/T and 4.5 d/T^2 over the length that counts.
            self._ramp_share = 1.0 / (1.0 + max(1.0, 2.0 * self._counted))
        #: The acceleration that the robot makes of the one that is sent.
        self.acceleration_unit = 1.0
        if is_optimized(geometry.kind):
            self.acceleration_unit = _OPTIMIZED_JOINT_ACCELERATION / min(model.max_joint_speed)

    @property
    def takes_time(self) -> bool:
        """
        Tell whether the wire carries a time for the motion.

        Never in the dialect that counts in milliseconds: a robot program that counts in
        microseconds would run a segment a thousand times too fast, and a program does not report
        how it counts.
        """
        return self.geometry.kind in _TIMED_ON_WIRE and not self.options.dialect.is_coarse

    def move(self) -> tuple[float, ...]:
        """Return its row of :class:`Moves`, still without speeds and time."""
        geometry, counted = self.geometry, self.length * self._counted
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
            return blend.length * self.length / self.geometry.curve.length
        return max(2.0 * part, 1e-12)

    def request(self) -> SpeedRequest:
        """Return what it asks for."""
        geometry = self.geometry
        if geometry.time is None:
            return self._by_speed()
        if not self.takes_time and self.unit == 'rad' and geometry.kind in _UNMEASURED_TURNS:
            raise InvalidGoal(
                point_field(geometry.index, 'time_from_start'),
                f'is the time of a {geometry.kind.name} segment that turns the tool by '
                f'{self.length:.3f} rad over {geometry.curve.length:.3f} m; how fast the '
                'robot runs it where the turn is the larger number has not been measured',
                'give velocity instead of times, or turn the tool on LINEAR segments',
            )
        return self._by_time()

    def request_again(self, running: PlannedSegment) -> SpeedRequest:
        """Return what has been sent already."""
        sent, time = running.primitive, getattr(running.primitive, 'duration', 0.0)
        assert not isinstance(sent, Spline)
        speed, acceleration = sent.velocity, sent.acceleration * self.acceleration_unit
        return SpeedRequest(
            speed=speed,
            acceleration=acceleration,
            max_acceleration=acceleration,
            rate=1.0 / time if time else speed / (self.length * self._counted),
            has_wire_time=time > 0.0,
            source='',
        )

    # -- speeds ----------------------------------------------------------------------------------

    def _by_speed(self) -> SpeedRequest:
        """Return what a segment without a time asks for."""
        geometry, limits = self.geometry, self.limits
        bound, name, unit = limits.speed, limits.name, self.speed_unit
        if self.turn_leads_line and translates(geometry):
            bound, name, unit = self.options.max_tool_speed or inf, 'max_tool_speed', 'm/s'
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
        if self.turn_leads_line:
            return self._turning_line(velocity, acceleration, source, remark)
        acceleration *= self.acceleration_unit
        return SpeedRequest(
            speed=velocity,
            acceleration=acceleration,
            max_acceleration=acceleration,
            rate=velocity / self.length,
            source=source,
            remark=remark,
        )

    def _wanted_speed(self) -> tuple[float, str]:
        """Return the speed that the goal asks for, and where it comes from."""
        geometry, options = self.geometry, self.options
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
        if self.unit == 'rad' and geometry.kind != SegmentType.LINEAR:
            # One number for both: the turn may be faster [rad/s], but no faster than the tool
            # [m/s].
            fastest = options.max_tool_speed or options.angular_velocity
            return (
                max(options.linear_velocity, min(options.angular_velocity, fastest)),
                'speed from linear_velocity and angular_velocity, as the turn leads',
            )
        return options.linear_velocity, 'speed from linear_velocity'

    def _default_acceleration(self) -> float:
        options = self.options
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
        options, limits, peak = self.options, self.limits, self.peak
        turn = velocity, acceleration
        line_time = 0.0
        if translates(self.geometry):
            line_time = min_duration(self.geometry.curve.length, velocity, acceleration, peak)
            turn = options.angular_velocity, options.angular_acceleration
            source = f'{source}, turn within angular_velocity'
        turn_rate = min(turn[1], limits.acceleration)
        time, wanted = (
            max(line_time, min_duration(self.length, turn_speed, turn_rate, peak))
            for turn_speed in (min(turn[0], limits.speed), turn[0])
        )
        if time > wanted * _NOTICEABLY:
            slowed = (
                f'point {self.geometry.index}: turns in {time:.3f} s instead of {wanted:.3f} s, '
                f'because of {limits.name}'
            )
            remark = f'{remark}; {slowed}' if remark else slowed
        counted, timed, peak = self._counted, self.takes_time, self.peak
        # Without a time on the wire: a third each of speeding up, cruising and braking.
        speed = self.length / time * (peak if timed else _PEAK)
        acceleration = turn_rate if timed else 4.5 * self.length / time**2
        return SpeedRequest(
            speed=speed * counted,
            acceleration=acceleration * counted,
            max_acceleration=acceleration * counted,
            rate=1.0 / time if timed else speed / self.length,
            has_wire_time=timed,
            source=source,
            remark=remark,
        )

    # -- times -----------------------------------------------------------------------------------

    def _by_time(self) -> SpeedRequest:
        """Return what a segment with a time asks for."""
        geometry, limits = self.geometry, self.limits
        assert geometry.time is not None
        length = self.length * geometry.unblended_fraction
        mean = length / geometry.time
        most = min(self.max_acceleration(), _UNLIMITED)
        least = most
        if not self.takes_time:
            least = self._own_acceleration() or max(
                self._default_acceleration(),
                # A third each of speeding up, cruising and braking; and no braking before a blend.
                4.5 * length / geometry.time**2,
                mean**2 / (self.length * (1.0 - geometry.u_leave))
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
            min_time=min_duration(self.length, limits.speed, limits.acceleration, self.peak)
            if self.takes_time
            else 0.0,
        )

    def _own_acceleration(self) -> float:
        """Return the acceleration that the goal gives a timed segment; 0 = none."""
        timed = self.geometry.kind in _TIMED_ON_WIRE
        return 0.0 if timed else self.geometry.segment.acceleration

    def max_acceleration(self) -> float:
        """Return the maximum acceleration that may follow from a time."""
        return min(self._own_acceleration() or inf, self.limits.acceleration)
