# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Find, for each segment, the speed that meets the segment's time within the limits.

``movel`` and ``movej`` accept a time on the wire. ``movec`` and ``movep`` do not: their speed is
chosen so that they meet the time. :mod:`~.move_chain` computes the times of moves and blends in
sequence; :mod:`~.speed_requests` finds the speeds and times that the goal requests.
"""

from __future__ import annotations

from collections.abc import Collection
from math import ceil, inf, pi

import numpy as np

from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES, RobotModel
from ur_cartesian_driver.motion.errors import InvalidGoal, TooFast
from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats, Indices
from ur_cartesian_driver.motion.goal.goal_columns import rows_where
from ur_cartesian_driver.motion.plan.plan import PlannedSegment
from ur_cartesian_driver.motion.plan.slow_stretch import SlowCause, SpeedLimit
from ur_cartesian_driver.planning.moves.move_chain import MoveChain, Moves, ramp_rate
from ur_cartesian_driver.planning.moves.path_samples import BlendSamples
from ur_cartesian_driver.planning.moves.segment_geometries import SegmentGeometries
from ur_cartesian_driver.planning.moves.speed_limits import arc_limit
from ur_cartesian_driver.planning.moves.speed_requests import (
    min_duration,
    RAMP_SHARE,
    SpeedRequests,
)
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.goal_fields import (
    IS_ARC_OR_PROCESS,
    point_field,
    segment_field,
)

#: Times that differ by less than the factor ``_NEARLY`` are the same. A time that is exceeded by
#: less than the factor ``_KEPT`` counts as met.
_NEARLY, _KEPT = 1.0 + 1e-5, 1.002
#: Smallest speed or acceleration that the wire, which transmits millionths, carries accurately.
MIN_SPEED = 1e-5
#: A limit exceeded by less than this factor counts as kept.
_WITHIN = 1.0 + 1e-6
#: Greatest number of rounds in which moves that are too fast are slowed.
_MAX_ROUNDS = 40
#: A point that is passed early by at most this [s] counts as passed in time.
_EARLY = 0.001


def shortest_duration(
    length: Floats, speed: Floats, acceleration: Floats, ramps: Floats | float
) -> Floats:
    """
    Return the shortest times [s] of motions that are sent with a speed instead of a time.

    From rest to rest T = d/v + v/a if d > v^2/a, else the triangle T = 2 sqrt(d/a).

    :param ramps: number of ramps from or to rest, 0 to 2.
    """
    peak = np.minimum(speed, np.sqrt(2.0 * acceleration * length / np.maximum(ramps, 1e-9)))
    time: Floats = length / peak + 0.5 * ramps * peak / acceleration
    return time


class SegmentTimings:
    """
    The speeds with which segments meet their times within the limits; columns (n,).

    :param running: the first segment as it was planned before, if it has already been sent.
    :param stops: the waypoints at which the robot program does more than move the arm.
    :raises TooFast: a time needs more speed or acceleration than the limits allow.
    :raises InvalidGoal: a speed is too low for the wire, or a blend is too small.
    """

    #: Speeds on the wire.
    velocities: Floats
    #: Accelerations on the wire.
    accelerations: Floats
    #: Times on the wire [s]; 0 = speed and acceleration apply.
    wire_times: Floats
    #: Expected times from point to point [s]; blended points are passed in mid-blend.
    durations: Floats

    def __init__(
        self,
        geometries: SegmentGeometries,
        options: PlanningOptions,
        model: RobotModel,
        blend_samples: BlendSamples,
        running: PlannedSegment | None = None,
        stops: Collection[int] = (),
    ) -> None:
        """Begin with the requested speeds and times, and change them until all limits are kept."""
        self._geometries, self.options, self._model = geometries, options, model
        self._samples = blend_samples
        # Times per unit of the blend's parameter [s]: at the tool's speed limit (_tool_time), and
        # at the speed at which the blend's arc needs the maximum linear acceleration (_arc_time).
        distance = blend_samples.tool_distance
        self._tool_time = distance / (options.max_tool_speed or inf)
        radius = geometries.path.arc_radius[blend_samples.index - geometries.begin]
        self._arc_time = distance / np.sqrt(options.max_linear_acceleration * radius)
        self._arc_leads = self._arc_time > np.maximum(blend_samples.joint_time, self._tool_time)
        n = len(geometries)
        does_else = np.zeros(n, dtype=np.bool_)
        does_else[[point - geometries.begin for point in stops if point >= geometries.begin]] = (
            True
        )
        does_else[0] |= geometries.waits
        #: The requested speeds and times, with remarks on changes due to the limits.
        self.requests = requests = SpeedRequests(geometries, options, model, does_else, running)
        self._time, self._timed, self._rate = requests.time, requests.has_wire_time, requests.rate
        self._speed = requests.speed
        self._least, self._most = requests.acceleration, requests.max_acceleration
        self._wanted = np.maximum(self._time, requests.min_time)
        #: Lead [s] with which each point is passed early, so that the next point is in time.
        self._ahead = np.zeros(n)
        #: Index of the blend sample that slows each segment; -1 = none does.
        self._slowed_at: Indices = np.full(n, -1)
        self._moves = requests.moves()
        # Even blended moves get no less time on the wire than they need from rest to rest.
        self._max_rate = np.where(
            np.isnan(self._time), self._rate, 1.0 / np.maximum(requests.min_time, 1e-9)
        )
        self._allow_acceleration()
        self._rate = np.minimum(self._rate, self._max_rate)
        self._moves = self._at_rate(np.arange(n), self._rate)
        entry = running.blend_entry if running and self._moves.tail[0] > 0.0 else None
        #: The times of the moves in sequence.
        self.chain = MoveChain(self._moves, entry)
        if entry is not None:
            self._wanted[0] = self.chain.times.between[0] + entry.half
        self._solve()
        self.durations = self.chain.times.durations
        self._set_wire_values()
        self._remark_changes()

    def _solve(self) -> None:
        """Meet the times within the limits; a move that cannot meet its time takes longer."""
        for _ in range(_MAX_ROUNDS):
            wanted = self._wanted - self._ahead + np.append(0.0, self._ahead[:-1])
            late = self.chain.meet(wanted, self._rate, self._max_rate, self._at_rate) - wanted
            late[~((late > wanted * (_NEARLY - 1.0)) & (self._rate >= self._max_rate))] = 0.0
            if not self._slow_down() and not self._go_ahead(late):
                break
        self._wanted += np.where(late > self._wanted * (_KEPT - 1.0), late, 0.0)

    def _go_ahead(self, late: Floats) -> bool:
        """
        Pass points early if the next point would be late otherwise; return whether leads changed.

        A fast move loses time in a blend with a slow one, as both have the same speed there.
        """
        moves = self._moves
        if not late.any():
            return False
        # Points that cannot be passed as early as planned get a shorter lead: their moves have
        # been slowed since.
        back = np.minimum(late, self._ahead)
        self._ahead -= back
        alone = shortest_duration(moves.length, self._speed, self._most, 2.0)
        late = late - back
        late = np.where(self._timed | (self._wanted > alone), late, 0.0)
        # Time by which each move can be shortened, so that its own point is passed early.
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

    def _set_wire_values(self) -> None:
        requests, moves = self.requests, self._moves
        on_wire = moves.time > 0.0
        # Speeding up, cruising and braking take a third of the time each.
        time = np.where(on_wire, moves.time, 1.0)
        cruise = requests.length / time / (1.0 - RAMP_SHARE)
        sent = moves.acceleration / requests.acceleration_unit
        self.velocities = np.where(on_wire, cruise, moves.speed)
        self.accelerations = np.where(on_wire, cruise / (RAMP_SHARE * time), sent)
        self.wire_times = moves.time

    def _at_rate(self, rows: Indices, rate: Floats) -> Moves:
        """Return the moves at given rates; rates above the greatest speed raise accelerations."""
        moves, speed = self._moves.take(rows), self._speed[rows]
        asked = rate * moves.length
        more = np.maximum(asked / speed, 1.0) ** 2
        moves.speed = np.minimum(asked, speed)
        moves.acceleration = np.minimum(self._least[rows] * more, self._most[rows])
        moves.time = np.where(self._timed[rows], 1.0 / rate, 0.0)
        return moves

    def _allow_acceleration(self) -> None:
        """Raise the greatest rates of moves that meet times by speed, as acceleration allows."""
        self._max_rate = np.where(
            self._timed | np.isnan(self._time),
            self._max_rate,
            self._speed / self._moves.length * np.sqrt(self._most / self._least),
        )

    def _slow_down(self) -> bool:
        """Slow down the moves that exceed limits when blended; return whether any move does."""
        times = self.chain.times
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
        self._slow_blends(slower, speed)
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
        return bool(len(rows))

    def _slow_blends(self, rate: Floats, speed: Floats) -> None:
        """Lower, in place, the rates and speeds of moves whose blends exceed a limit."""
        samples, times = self._samples, self.chain.times
        if not len(samples.index):
            return
        after = samples.index - self._geometries.begin + 1
        begin, end = times.begin_rate[after], times.end_rate[after]
        # A measured law may slow a blend, but never make the arm faster than the assumed law does.
        bend = np.maximum(times.bend[after], 1.0)
        # If a measured law makes the blend faster, the rate has a peak half-way. So the rate is
        # taken at the end of each sample's step that is nearer to this peak.
        nearer = np.clip(0.5, samples.s - samples.half_step, samples.s + samples.half_step)
        at_sample = ramp_rate(begin, end, np.where(bend > 1.0, nearer, samples.s), bend)
        over = at_sample * np.maximum(
            np.maximum(samples.joint_time, self._tool_time), self._arc_time
        )
        worst = np.flatnonzero(over > _WITHIN)
        if not len(worst):
            return
        # The move at the faster end of the blend is slowed.
        after, over, speeds_up = after[worst], over[worst], (end > begin)[worst]
        row = np.where(speeds_up, after, after - 1)
        there = np.where(speeds_up, times.enter[after], times.leave[after - 1])
        on_wire = self._timed[row]
        np.minimum.at(rate, row[on_wire], self._rate[row[on_wire]] / over[on_wire])
        np.minimum.at(speed, row[~on_wire], there[~on_wire] / over[~on_wire])
        self._slowed_at[row] = worst

    def _is_slowed_in_arc(self) -> Flags:
        """Return whether each segment is slowed because of the arc of a blend (n,)."""
        slowed: Flags = np.append(self._arc_leads, False)[self._slowed_at]  # -1 = none
        return slowed

    def _limit(self, row: int) -> SpeedLimit:
        """Return the limit that slows a segment."""
        sample, samples = int(self._slowed_at[row]), self._samples
        if sample < 0:
            limits = self.requests.limits
            return limits.acceleration_limit(row) if self._is_ramp(row) else limits.limit(row)
        if self._arc_leads[sample]:
            point = samples.index[sample]
            radius = self._geometries.path.arc_radius[point - self._geometries.begin]
            return arc_limit(self.options, f'in the blend at point {point},', float(radius))
        if samples.joint_time[sample] < self._tool_time[sample]:
            text = f'max_tool_speed = {self.options.max_tool_speed:g} m/s'
            return SpeedLimit(SlowCause.TOOL_LIMIT, text)
        joint = int(samples.joint[sample])
        return SpeedLimit(
            SlowCause.JOINT_LIMIT,
            f'the joint speed limits ({JOINT_NAMES[joint]} in the blend at point '
            f'{samples.index[sample]}{self._model.speed_source(joint)})',
        )

    def _is_ramp(self, row: int) -> bool:
        """Return whether acceleration, not speed, limits a timed segment from rest to rest."""
        if not self._timed[row]:
            return False
        requests, limits = self.requests, self.requests.limits
        at = slice(row, row + 1)
        length, speed, peak = requests.length[at], limits.speed[at], requests.peak[at]
        ramps = min_duration(length, speed, limits.acceleration[at], peak)
        return bool(ramps > min_duration(length, speed, np.array([inf]), peak))

    def bounds(self) -> tuple[Floats, Floats]:
        """
        Return the least and greatest times [s] of segments, however the robot passes blends.

        For the greatest times, the arm comes to rest at each point. For the least times, the arm
        cruises between the blends and crosses each blend in a straight line, at the higher speed
        of the two segments.
        """
        times, moves, path = self.chain.times, self._moves, self._geometries.path
        before, after = path.has_blend_before, path.has_blend_after
        timed, blended = moves.time > 0.0, before | after
        time = np.where(timed, moves.time, 1.0)
        speed = np.where(timed, moves.length / time / (1.0 - RAMP_SHARE), moves.speed)
        acceleration = np.where(timed, speed / (RAMP_SHARE * time), moves.acceleration)
        between = moves.length * self._geometries.unblended_fractions
        ramps = 2.0 - before.astype(np.float64) - after
        least = shortest_duration(between, speed, acceleration, ramps)
        greatest = shortest_duration(moves.length, speed, acceleration, 2.0)
        tool_speed = speed * np.maximum(path.curves.length, 1e-9) / moves.length
        # A blend with legs of length r and a chord c is at most r + c / 2 long. So its length
        # gives a lower bound of c.
        across = np.where(after, 2.0 * np.maximum(path.blend_length - path.reach, 0.0), 0.0)
        least[:-1] += across[:-1] / np.maximum(tool_speed[:-1], tool_speed[1:])
        return (
            np.where(blended, least, times.durations),
            np.where(blended, np.where(timed, moves.time, greatest), times.durations),
        )

    # -- remarks and refusals --------------------------------------------------------------------

    def _remark_changes(self) -> None:
        """
        Remark on moves that are slower than requested, and on points that are passed early.

        :raises GoalRefused: a time is too short or long, a speed too low, or a blend too small.
        """
        requests, path, timed = self.requests, self._geometries.path, ~np.isnan(self._time)
        is_late = self._wanted > self._time * _NEARLY
        takes_longer = ~timed & (self.wire_times > 1.0 / requests.rate * _NEARLY)
        by_speed = self.wire_times <= 0.0
        is_slower = ~timed & by_speed & (self._moves.speed * _NEARLY < requests.speed)
        is_ahead = self._ahead > _EARLY
        takes_too_long = self.wire_times > self.options.max_segment_time
        slowest = np.minimum(self.velocities, self.accelerations)
        too_slow = by_speed & (slowest < MIN_SPEED)
        # The robot skips such a blend if the tool covers its radius in one control cycle.
        needs_a_cycle = IS_ARC_OR_PROCESS[self._geometries.kinds] & path.has_blend_after
        # A blend that is too small for the requested speed is refused, not passed slowly.
        asked = np.where(self._is_slowed_in_arc(), requests.speed, self.velocities)
        too_small = needs_a_cycle & (path.radius < asked * self._model.control_cycle)
        # On a smaller arc, half a turn at the acceleration limit takes less than a control cycle.
        turns_back = path.has_blend_after & (
            path.arc_radius
            < self.options.max_linear_acceleration * (self._model.control_cycle / pi) ** 2
        )
        refused = takes_too_long | too_slow | too_small | turns_back
        remarks = requests.remarks
        for row in rows_where(is_late | takes_longer | is_slower | is_ahead | refused):
            point = self._geometries.begin + row
            if is_late[row] or takes_longer[row] or is_slower[row]:
                requests.limited[row] = self._limit(row)
            if is_late[row]:
                remarks[row] = self._too_fast(row)
            elif takes_longer[row]:
                remarks[row] = (
                    f'point {point}: takes {self.wire_times[row]:.3f} s instead of '
                    f'{1.0 / requests.rate[row]:.3f} s, because of {self._limit(row).text}'
                )
            elif is_slower[row]:
                remarks[row] = (
                    f'point {point}: slowed from {requests.speed[row]:.3g} to '
                    f'{self._moves.speed[row]:.3g} {requests.limits.unit(row)} by '
                    f'{self._limit(row).text}'
                )
            elif is_ahead[row]:
                remarks[row] = (
                    f'point {point}: passed {self._ahead[row]:.3f} s before its time, because '
                    'the next segment could not make good the time in the blend'
                )
            if takes_too_long[row]:
                raise self._too_long(row)
            if turns_back[row]:
                raise self._turning_back(row)
            if too_slow[row]:
                raise self._too_slow(row)
            if too_small[row]:
                raise self._too_small(row, asked[row])

    def _too_long(self, row: int) -> InvalidGoal:
        """Return the refusal of a move that takes too long."""
        return InvalidGoal(
            point_field(self._geometries.begin + row),
            f'would be approached in {self.wire_times[row]:.4g} s, more than '
            f'max_segment_time = {self.options.max_segment_time:.0f} s',
            'raise velocity or acceleration',
        )

    def _turning_back(self, row: int) -> InvalidGoal:
        """Return the refusal of a blend whose arc no robot can pass."""
        path = self._geometries.path
        return InvalidGoal(
            segment_field(self._geometries.begin + row, 'blend_radius'),
            f'is {1e3 * path.radius[row]:g} mm, but the path turns back there: PROCESS '
            'would keep its speed around an arc with a radius of '
            f'{1e3 * path.arc_radius[row]:.2g} mm, and no robot reverses in motion',
            'set it to 0 to stop there, or add a point beside it',
        )

    def _too_small(self, row: int, speed: float) -> InvalidGoal:
        """Return the refusal of a blend that the robot would skip, with the message C171."""
        return InvalidGoal(
            segment_field(self._geometries.begin + row, 'blend_radius'),
            f'is {1e3 * self._geometries.path.radius[row]:g} mm, less than the '
            f'{1e3 * speed * self._model.control_cycle:.3g} mm that the robot moves in one '
            f'control cycle at {speed:.3g} {self.requests.limits.unit(row)}: it would stop at the '
            'point',
            'enlarge it, move slower, or set it to 0 to stop there',
        )

    def _too_slow(self, row: int) -> InvalidGoal:
        """Return the refusal of a speed or acceleration that is too small for the wire."""
        unit, value = self.requests.limits.unit(row), self.velocities[row]
        if value >= MIN_SPEED:
            unit, value = f'{unit}^2', self.accelerations[row]
        return InvalidGoal(
            point_field(self._geometries.begin + row),
            f'would be approached with {value:.2g} {unit}, less than the {MIN_SPEED:g} that can '
            'be sent',
            'give it less time'
            if self._geometries.times[row] > 0.0
            else 'raise velocity or acceleration',
        )

    def _too_fast(self, row: int) -> str:
        """
        Return the remark on a time that is too short.

        :raises TooFast: the options do not allow the planner to extend the time that far.
        """
        requests, limits, options = self.requests, self.requests.limits, self.options
        point, min_time = self._geometries.begin + row, float(self._wanted[row])
        time, length = self._geometries.times[row], requests.length[row]
        unit, name = limits.unit(row), self._limit(row).text
        where = point_field(point, 'time_from_start')
        if min_time > options.max_segment_time:
            raise TooFast(
                where,
                f'gives the segment {time:.3f} s, but because of {name} it takes '
                f'{min_time:.0f} s, more than max_segment_time = '
                f'{options.max_segment_time:.0f} s',
                'move the path away from there, or use a JOINT segment',
            )
        if options.on_too_fast == 'slow':
            return (
                f'point {point}: takes {min_time:.3f} s instead of {time:.3f} s, because of {name}'
            )
        speed, acceleration = requests.peak[row] * length / time, 4.5 * length / time**2
        raise TooFast(
            where,
            f'gives the segment {time:.3f} s for {length:.3f} {limits.length_unit(row)}, which '
            f'needs up to {speed:.3f} {unit} and {acceleration:.3f} {unit}^2; allowed are '
            f'{limits.speed[row]:.3f} {unit} ({name}) and '
            f'{requests.allowed_acceleration[row]:.3f} {unit}^2',
            f'give it at least {ceil(1e3 * min_time) / 1e3:.3f} s, or set on_too_fast to slow',
        )
