# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The speeds and times requested of moves, from the goal's times, its speeds or the defaults.

All numbers refer to the leading quantity of a segment, see :mod:`~.speed_limits`. On a line whose
turn leads, the robot uses another length: the turn divided by the turn ratio, or the length of the
line if that is larger.
"""

from __future__ import annotations

from math import inf, nan

import numpy as np

from ur_cartesian_driver.kinematics.robot_models import RobotModel
from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats
from ur_cartesian_driver.motion.goal.goal import SegmentType
from ur_cartesian_driver.motion.goal.goal_columns import rows_where
from ur_cartesian_driver.motion.plan.plan import PlannedSegment
from ur_cartesian_driver.motion.plan.primitive import Spline, Stop
from ur_cartesian_driver.motion.plan.slow_stretch import SlowCause, SpeedLimit
from ur_cartesian_driver.planning.moves.move_chain import Moves
from ur_cartesian_driver.planning.moves.segment_geometries import SegmentGeometries
from ur_cartesian_driver.planning.moves.speed_limits import SpeedLimits
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.goal_fields import (
    FOLLOWS_BLEND_LAWS,
    IS_ARC_OR_PROCESS,
    IS_JOINT,
    IS_LINEAR,
    IS_PROCESS,
    point_field,
)
from ur_cartesian_driver.planning.request.program_features import takes_times

#: If a move has a time T, the robot stretches the trapezoid of its speed and acceleration to T
#: (recorded on a UR3). For a length d we send 1.5 d/T and 4.5 d/T^2, for which accelerating,
#: cruising and braking take T/3 each. We also assume these thirds of robots that ignore speed and
#: acceleration.
RAMP_SHARE = 1.0 / 3.0
#: Assumed acceleration of an OPTIMIZED move at fraction 1 [rad/s^2]; the robot's own limits are
#: not published. It is only used to estimate the time of such a move.
_OPTIMIZED_JOINT_ACCELERATION = 40.0
#: Motions that accept a time on the wire.
_TIMED_ON_WIRE = IS_LINEAR | IS_JOINT
#: Ratios of peak speed to mean speed of a timed move: ``_PEAK`` for the trapezoid in thirds;
#: ``_PEAK_OF_TURN`` for the triangle that results on a line whose turn leads, if the robot turns
#: the tool at a higher number [rad/s] than it moves the tool [m/s].
_PEAK, _PEAK_OF_TURN = 1.0 / (1.0 - RAMP_SHARE), 2.0
#: Acceleration limit of a segment without motion, which has no limit of its own.
_UNLIMITED = 1e9
#: Times that exceed the wanted ones by less than this factor get no remark.
_NOTICEABLY = 1.001
#: Speeds that limits reduce to at least this fraction of the wanted ones get no remark.
_ROUNDED = 1.0 - 1e-9
#: Smallest speed and acceleration in computations; 1 / 1e-310 overflows.
_TINY = 1e-300
#: The sources of speeds, as the report names them.
_BOTH = 'speed from linear_velocity and angular_velocity, as the turn leads'
_SOURCES = (
    'speed from segments[{}].velocity',
    'speed from optimized_velocity',
    'speed from joint_velocity',
    'speed from points[{}].twist',
    'speed from angular_velocity',
    _BOTH,
    'speed from linear_velocity',
)


def min_duration(length: Floats, speed: Floats, acceleration: Floats, peak: Floats) -> Floats:
    """
    Return the shortest times [s] on the wire that keep peaks within bounds, from rest to rest.

    :param peak: ratio of peak speed to mean speed; 2 if the profile might be a triangle, whose
        acceleration is lower.
    """
    ramps = np.sqrt(length / acceleration / (RAMP_SHARE * (1.0 - RAMP_SHARE)))
    return np.maximum(peak * length / speed, ramps)


class SpeedRequests:
    """
    The requested speeds and times of moves, in the lengths that the robot uses; columns (n,).

    :param stops: (n,) whether the program does more than move the arm at the end of each segment.
    :param running: the first segment as it was planned before, if it has already been sent.
    :raises InvalidGoal: a CIRCULAR or PROCESS segment on which the turn leads has a time, but the
        robot's speed on such segments is not known.
    """

    #: Greatest speeds.
    speed: Floats
    #: Accelerations.
    acceleration: Floats
    #: Greatest accelerations that may be used to meet a time.
    max_acceleration: Floats
    #: Greatest accelerations that goal and limits allow, for the leading quantity instead of the
    #: length that the robot uses.
    allowed_acceleration: Floats
    #: Rates: 1 / time on the wire, or speed / length [1/s].
    rate: Floats
    #: Requested times [s]; NaN = none.
    time: Floats
    #: Shortest times on the wire that the limits allow [s]; 0 = any.
    min_time: Floats

    def __init__(
        self,
        geometries: SegmentGeometries,
        options: PlanningOptions,
        model: RobotModel,
        stops: Flags,
        running: PlannedSegment | None = None,
    ) -> None:
        self.geometries, self._options = geometries, options
        self.limits = limits = SpeedLimits(geometries, options, model)
        self._kinds, self._curves = geometries.kinds, geometries.path.curves
        self.length: Floats = limits.length
        #: Whether each segment is a line on which the turn leads.
        self.turn_leads_line = limits.is_turn & IS_LINEAR[self._kinds]
        self.peak = np.where(self.turn_leads_line, _PEAK_OF_TURN, _PEAK)
        # The length that the robot uses, by the turn ratio, as a fraction of the leading length.
        ratio = options.laws.turn_ratio
        if not takes_times(options):
            # Without a time on the wire the tool turns as fast as its ratio lets it.
            ratio = max(ratio, options.turn_ratio)
        counted = np.maximum(self._curves.length, self.length / ratio) / self.length
        self._counted = np.where(self.turn_leads_line, counted, 1.0)
        #: Acceleration of the leading quantity per unit of the acceleration that is sent.
        self.acceleration_unit = np.where(
            limits.is_optimized, _OPTIMIZED_JOINT_ACCELERATION / min(model.max_joint_speed), 1.0
        )
        #: (n,) whether each segment is sent with a time.
        self.has_wire_time = _TIMED_ON_WIRE[self._kinds] & takes_times(options)
        #: Remarks on changes due to the limits, by row.
        self.remarks: dict[int, str] = {}
        #: The limits that make a segment slower than requested, by row.
        self.limited: dict[int, SpeedLimit] = {}
        self._wanted = np.full(len(geometries), nan)
        self._source = np.zeros(len(geometries), dtype=np.intp)
        self.time, self.min_time = geometries.times.copy(), np.zeros(len(geometries))
        self.is_timed = bool(geometries.times[0] > 0.0)
        if self.is_timed:
            self._by_time()
        else:
            self._by_speed()
        #: Whether the arm rests after each segment but the last only because there is no blend.
        self.rests_between = ~geometries.path.has_blend_after[:-1] & ~stops[:-1]
        #: Whether the blend before each segment follows the laws of blends, which arcs of PROCESS
        #: do not.
        self.blends_by_law = geometries.path.has_blend_before.copy()
        self.blends_by_law[1:] &= FOLLOWS_BLEND_LAWS[self._kinds[:-1]]
        self.blends_by_law[0] = False
        self._is_running = running is not None
        if running is not None:
            self._request_again(running)

    def source(self, row: int) -> str:
        """Return the source of a segment's speed or time; '' if the segment is already running."""
        point = self.geometries.begin + row
        if self._is_running and row == 0:
            return ''
        if self.is_timed:
            return f'time from points[{point}].time_from_start'
        within = self.turn_leads_line[row] and self.limits.translates[row]
        source = _SOURCES[self._source[row]].format(point)
        return source + (', turn within angular_velocity' if within else '')

    @property
    def asked(self) -> Floats:
        """
        Requested tool speeds (n,) [m/s], valid for segments that carry the tool along a path.

        If the goal has times, these are the mean speeds that result from the times.
        """
        if not self.is_timed:
            return self._wanted
        return self._curves.length / self.geometries.times

    def moves(self) -> Moves:
        """Return the moves, still without speeds and times."""
        path, counted = self.geometries.path, self.length * self._counted
        before, after = path.has_blend_before, path.has_blend_after
        head = np.where(before, counted * path.u_join, 0.0)
        tail = np.where(after, np.maximum(counted * (1.0 - path.u_leave), 1e-12), 0.0)
        # Fraction of T in each ramp, if 1.5 d/T and 4.5 d/T^2 apply to the length that the robot
        # uses.
        ramp = np.where(
            self.turn_leads_line, 1.0 / (1.0 + np.maximum(1.0, 2.0 * self._counted)), RAMP_SHARE
        )
        fillet, arc = path.fillet & after, path.blend_length
        at_radius = after & IS_PROCESS[self._kinds]
        # Lengths per unit of ``s``.
        leaving = np.maximum(2.0 * tail, 1e-12)
        joining = np.maximum(2.0 * head, 1e-12)
        per_metre = self.length / np.maximum(self._curves.length, 1e-300)
        joining[1:] = np.where(fillet[:-1], arc[:-1] * per_metre[1:], joining[1:])
        leaving = np.where(fillet, arc * per_metre, leaving)
        one, laws = np.ones(len(counted)), self._options.laws
        chained = np.append(False, self.rests_between)
        return Moves(
            length=counted,
            speed=one,
            acceleration=one,
            time=0.0 * one,
            ramp_part=ramp,
            stops_within=np.where(at_radius, path.radius, inf),
            head=head,
            tail=tail,
            exit_rate=joining,
            entry_rate=leaving,
            idle=np.where(chained, laws.idle_between_moves, 0.0),
            bend=np.where(self.blends_by_law, laws.blend_speed_ratio, 1.0),
        )

    def _request_again(self, running: PlannedSegment) -> None:
        """Request the values that have already been sent for the running segment."""
        sent, time = running.primitive, getattr(running.primitive, 'duration', 0.0)
        assert not isinstance(sent, Spline | Stop)
        acceleration = sent.acceleration * self.acceleration_unit[0]
        self.speed[0], self.acceleration[0] = sent.velocity, acceleration
        self.max_acceleration[0] = acceleration
        counted = self.length[0] * self._counted[0]
        self.rate[0] = 1.0 / time if time else sent.velocity / counted
        self.has_wire_time[0] = time > 0.0
        self.time[0], self.min_time[0] = nan, 0.0
        self.remarks.pop(0, None)

    # -- speeds ----------------------------------------------------------------------------------

    def _by_speed(self) -> None:
        """Request the speeds of the goal, or the default ones, within the limits."""
        options, limits = self._options, self.limits
        at_speed_of_tool = self.turn_leads_line & limits.translates
        bound = np.where(at_speed_of_tool, options.max_tool_speed or inf, limits.speed)
        wanted = self._wanted_speeds()
        velocity = np.minimum(wanted, bound)
        both = self._source == _SOURCES.index(_BOTH)
        self._wanted = np.where(both, np.minimum(wanted, options.linear_velocity), wanted)
        for row in rows_where(velocity < wanted * _ROUNDED):
            limit, unit = limits.limit(row), limits.unit(row)
            if at_speed_of_tool[row]:
                limit, unit = SpeedLimit(SlowCause.TOOL_LIMIT, 'max_tool_speed'), 'm/s'
            self.limited[row] = limit
            self.remarks[row] = (
                f'point {self.geometries.begin + row}: slowed from {wanted[row]:.3g} to '
                f'{velocity[row]:.3g} {unit} by {limit.text}'
            )
        own = self.geometries.segments.accelerations
        acceleration = np.where(own > 0.0, np.maximum(own, _TINY), self._default_accelerations())
        acceleration = np.where(
            limits.is_optimized, acceleration, np.minimum(acceleration, limits.acceleration)
        )
        self.speed, self.rate = velocity, velocity / self.length
        self.acceleration = acceleration * self.acceleration_unit
        self.has_wire_time &= self.turn_leads_line
        self._turning_lines(velocity, acceleration)
        self.max_acceleration = self.acceleration.copy()

    def _wanted_speeds(self) -> Floats:
        """Return the speeds that the goal asks for."""
        options, segments, kinds = self._options, self.geometries.segments, self._kinds
        limits, twists = self.limits, self.geometries.waypoints.twists
        with np.errstate(over='ignore'):  # a goal may contain any number
            speeds = np.where(
                limits.translates,
                np.linalg.norm(twists[:, :3], axis=1),
                np.linalg.norm(twists[:, 3:], axis=1),
            )
        # One number limits translation and turn. Since the turn leads, this number can be the
        # default angular velocity [rad/s], but not above the greatest tool speed [m/s].
        fastest = options.max_tool_speed or options.angular_velocity
        both = max(options.linear_velocity, min(options.angular_velocity, fastest))
        choices = (
            (segments.velocities > 0.0, np.maximum(segments.velocities, _TINY)),
            (limits.is_optimized, options.optimized_velocity),
            (IS_JOINT[kinds], options.joint_velocity),
            (speeds > 0.0, np.maximum(speeds, _TINY)),
            (~limits.translates, options.angular_velocity),
            (limits.is_turn & ~IS_LINEAR[kinds], both),
        )
        found = np.full(len(kinds), options.linear_velocity)
        self._source[:] = len(choices)
        for number, (condition, speed) in reversed([*enumerate(choices)]):
            self._source[condition] = number
            found = np.where(condition, speed, found)
        return found

    def _default_accelerations(self) -> Floats:
        options = self._options
        of_tool = np.where(
            self.limits.translates, options.linear_acceleration, options.angular_acceleration
        )
        moves = np.where(IS_JOINT[self._kinds], options.joint_acceleration, of_tool)
        return np.where(self.limits.is_optimized, options.optimized_acceleration, moves)

    def _turning_lines(self, velocity: Floats, acceleration: Floats) -> None:
        """
        Request times for lines on which the turn leads.

        For a speed of v m/s, the robot may turn the tool at v rad/s or several times as fast. So a
        time is sent instead. With this time, the tool exceeds neither its speed [m/s] nor the
        default turn rate (for a turn on the spot: the requested one), however the robot turns it.
        """
        rows = np.flatnonzero(self.turn_leads_line)
        if not len(rows):
            return
        options, translates, peak = self._options, self.limits.translates[rows], self.peak[rows]
        length, counted, timed = self.length[rows], self._counted[rows], self.has_wire_time[rows]
        speed_limit, velocity = self.limits.speed[rows], velocity[rows]
        line_time = np.where(
            translates,
            min_duration(self._curves.length[rows], velocity, acceleration[rows], peak),
            0.0,
        )
        turn_speed = np.where(translates, options.angular_velocity, velocity)
        turn_rate = np.where(translates, options.angular_acceleration, acceleration[rows])
        turn_rate = np.minimum(turn_rate, self.limits.acceleration[rows])
        time, wanted = (
            np.maximum(line_time, min_duration(length, speed, turn_rate, peak))
            for speed in (np.minimum(turn_speed, speed_limit), turn_speed)
        )
        for k in rows_where(time > wanted * _NOTICEABLY):
            row = int(rows[k])
            self.limited[row] = self.limits.limit(row)
            before = f'{self.remarks[row]}; ' if row in self.remarks else ''
            self.remarks[row] = (
                f'{before}point {self.geometries.begin + row}: turns in {time[k]:.3f} s instead '
                f'of {wanted[k]:.3f} s, because of {self.limited[row].text}'
            )
        # If no time is sent, speeding up, cruising and braking take a third of the time each.
        speed = length / time * np.where(timed, peak, _PEAK)
        self.speed[rows] = speed * counted
        self.acceleration[rows] = counted * np.where(timed, turn_rate, 4.5 * length / time**2)
        self.rate[rows] = np.where(timed, 1.0 / time, speed / length)

    # -- times -----------------------------------------------------------------------------------

    def _by_time(self) -> None:
        """Request the times of the goal."""
        geometries, limits, timed = self.geometries, self.limits, self.has_wire_time
        # The speed of these motions has not been measured if the turn leads.
        unmeasured = ~timed & limits.is_turn & IS_ARC_OR_PROCESS[self._kinds]
        for row in rows_where(unmeasured)[:1]:
            raise InvalidGoal(
                point_field(geometries.begin + row, 'time_from_start'),
                f'is the time of a {SegmentType(self._kinds[row]).name} segment that turns the '
                f'tool by {self.length[row]:.3f} rad over {self._curves.length[row]:.3f} m; how '
                'fast the robot runs it where the turn is the larger number has not been measured',
                'give velocity instead of times, or turn the tool on LINEAR segments',
            )
        length, path = self.length * geometries.unblended_fractions, geometries.path
        own = self._own_accelerations()
        most = np.minimum(np.where(own > 0.0, own, inf), limits.acceleration)
        self.allowed_acceleration, most = most, np.minimum(most, _UNLIMITED)
        # Speeding up, cruising and braking take a third of the time each; a move that is blended
        # begins to brake for its point only in the blend.
        brakes = path.has_blend_after & ~IS_PROCESS[self._kinds]
        tail = np.where(brakes, self.length * (1.0 - path.u_leave), inf)
        needed = np.maximum(4.5 * length / self.time**2, (length / self.time) ** 2 / tail)
        by_speed = np.where(own > 0.0, own, np.maximum(self._default_accelerations(), needed))
        least = np.minimum(np.where(timed, most, by_speed), most)
        self.speed = limits.speed * self._counted
        self.acceleration, self.max_acceleration = least * self._counted, most * self._counted
        self.rate = 1.0 / self.time
        # The robot plans a move with a time to come to rest at its waypoint, even before a blend.
        alone = min_duration(self.length, limits.speed, limits.acceleration, self.peak)
        self.min_time = np.where(timed, alone, 0.0)

    def _own_accelerations(self) -> Floats:
        """Return the goal's accelerations; 0 = none, or a motion that accepts a time instead."""
        timed = _TIMED_ON_WIRE[self._kinds]
        return np.where(timed, 0.0, self.geometries.segments.accelerations)
