# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The sequence of move paths and blends that the arm follows, each with its profile.

A program calls the next move only when the arm enters the blend of the present one. Each move is
therefore planned to end at rest at its waypoint. If the next call comes in time, the blend and the
next path replace the end of the present path.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf, sqrt
from typing import Any

from ur_cartesian_driver.motion.geometry.pose import distance
from ur_cartesian_driver.sim.motion.motion_values import Move
from ur_cartesian_driver.sim.motion.paths.motion_profile import (
    MotionProfile,
    ramp,
    s_curve,
    timed,
    timed_ramp,
    trapezoid,
    two_ramps,
)
from ur_cartesian_driver.sim.motion.paths.move_paths import (
    end_within_radius,
    make_blend,
    MotionPath,
    MovePath,
    Setpoint,
    start_within_radius,
)

# A section is over when less than this time is left [s], because sums of cycles are rounded.
_ROUNDING = 1e-9
# Speeds and lengths up to this are treated as zero, in the units of any path.
_MIN_SPEED = 1e-9
# A timed move that has lost time in a blend runs faster afterwards. Its average speed after the
# blend is at most this many times the average speed that its time requires from the entry of the
# blend to the end.
_MAX_CATCH_UP = 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ProfileParameters:
    """
    Acceleration and speed along a path, in its unit (rad or m) per s^2 and per s.

    :param time: time of the move [s]; 0 = no time is given. With a time, acceleration and speed
        only determine the fraction of the time for the ramps.
    :param jerk: bound on the jerk, for an S-curve; None = trapezoid.
    :param braking: deceleration at the end, if it differs from the acceleration.
    """

    acceleration: float
    speed: float
    time: float = 0.0
    jerk: float | None = None
    braking: float | None = None

    def profile(self, length: float, start_speed: float = 0.0) -> MotionProfile:
        """Return the profile that covers a length and ends at rest."""
        if self.time > 0.0:
            return timed(length, self.time, start_speed, self.ramp_part(length))
        if self.jerk is not None:
            return s_curve(length, self.acceleration, self.speed, self.jerk, start_speed)
        return trapezoid(length, self.acceleration, self.speed, start_speed, self.braking)

    def ramp_part(self, length: float) -> float:
        """Return the fraction of a timed move's time that each of its two ramps takes."""
        return timed_ramp(length, self.acceleration, self.speed)

    def strongest(self, length: float) -> float:
        """Return the highest acceleration on a path; of a timed move, as if from rest to rest."""
        if self.time > 0.0:
            part = self.ramp_part(length)
            return length / (part * (1.0 - part) * self.time**2)
        return max(self.acceleration, self.braking or 0.0)


@dataclass(frozen=True, slots=True)
class PathSection:
    """
    A path with its profile.

    :param offset: path parameter at which the profile begins.
    :param stop: profile time at which the next section begins [s].
    """

    path: MotionPath
    profile: MotionProfile
    offset: float
    stop: float

    def at(self, time: float) -> Setpoint:
        """Return the set-point; from the end of the profile on, exactly the end of the path."""
        if time >= self.profile.duration:
            return self.path.at(inf)
        return self.path.at(self.offset + self.profile.at(time))


@dataclass(frozen=True, slots=True)
class LastMove:
    """
    The last move of a :class:`PathMotion`, and the values needed to blend the next one into it.

    :param radius: blend radius at the waypoint [m]; 0 = no blend.
    :param entry: profile time at which the blend begins [s]; the duration if there is no blend.
    """

    move_path: MovePath
    parameters: ProfileParameters
    radius: float
    entry: float
    call: Move


@dataclass(slots=True)
class PathMotion:
    """
    The sections to follow; the arm is at ``time`` [s] in the profile of section ``index``.

    The last section always belongs to ``last_move``. ``spare`` is the part of a cycle [s] that was
    left when the last section ended.
    """

    sections: tuple[PathSection, ...]
    last_move: LastMove
    index: int = 0
    time: float = 0.0
    spare: float = 0.0
    real_time = False

    def preview(self, h: float) -> tuple[Setpoint, tuple[int, float, float]]:
        """Return the set-point and state (see :meth:`accept`) after ``h`` more profile seconds."""
        i, t = self.index, self.time
        while True:
            section = self.sections[i]
            left = section.stop - t
            if h < left - _ROUNDING:
                t += h
                break
            last = i + 1 == len(self.sections)
            h = max(h - left, 0.0)
            if last:
                return self.sections[i].at(section.stop), (i, section.stop, h)
            i, t = i + 1, 0.0
        return self.sections[i].at(t), (i, t, 0.0)

    def accept(self, state: Any) -> None:
        """Go to a state that ``preview`` returned."""
        self.index, self.time, self.spare = state

    @property
    def finished(self) -> bool:
        """Whether the last waypoint is reached."""
        return self.index + 1 == len(self.sections) and self.time >= self.sections[-1].stop

    @property
    def next_change(self) -> float:
        """The profile time [s] of the next change: entry of the blend, or end of the section."""
        entry = self.last_move.entry
        in_last = self.index + 1 == len(self.sections)
        if in_last and self.last_move.radius > 0.0 and self.time < entry:
            return entry
        return self.sections[self.index].stop

    def may_return(self, cycle: float) -> bool:
        """Return whether the call may return: the blend begins in a cycle, or the move is over."""
        if self.index + 1 < len(self.sections):
            return False
        if self.last_move.radius > 0.0:
            return self.time + cycle >= self.last_move.entry - _ROUNDING
        return self.finished


def start_from_rest(
    move_path: MovePath,
    parameters: ProfileParameters,
    radius: float,
    call: Move,
    spare: float = 0.0,
) -> PathMotion:
    """
    Return the motion along one path, from rest to rest.

    :param spare: the part of the last cycle that the previous move did not use [s].
    """
    profile = parameters.profile(move_path.length)
    section = PathSection(move_path, profile, 0.0, profile.duration)
    entry = _blend_entry_time(section, move_path, radius)
    return PathMotion((section,), LastMove(move_path, parameters, radius, entry, call), 0, spare)


def with_blend_radius(path_motion: PathMotion, radius: float) -> PathMotion:
    """Return the motion with another blend radius [m] at its last waypoint."""
    last_move = path_motion.last_move
    entry = _blend_entry_time(path_motion.sections[-1], last_move.move_path, radius)
    return replace(path_motion, last_move=replace(last_move, radius=radius, entry=entry))


def append_move_path(
    path_motion: PathMotion,
    move_path: MovePath,
    parameters: ProfileParameters,
    radius: float,
    call: Move,
    circular: bool,
    speed_ratio: float = 1.0,
) -> tuple[PathMotion, bool]:
    """
    Return the motion with one more path, and whether the path is blended.

    The blend begins at the blend radius, or at the arm's position if the call comes late, and ends
    at the same distance after the waypoint. If the arm already stands still, or the new path does
    not leave the blend radius, there is no blend and the arm stops at the waypoint. (A new path
    that lies wholly in the blend would run at the speed of the last move, because a blend has one
    speed for both moves.)

    :param speed_ratio: the ``ratio`` of :func:`two_ramps` in the blend; 1 = a single ramp.
    """
    last, last_move = path_motion.sections[-1], path_motion.last_move
    ahead = path_motion.sections[path_motion.index : -1]
    now = path_motion.time if path_motion.index + 1 == len(path_motion.sections) else 0.0
    leave = max(now, last_move.entry)
    tail = last_move.move_path.length - last.offset - last.profile.at(leave)
    head = _blend_head(last_move, tail, last.profile.speed(leave), move_path)
    if head is None:
        rest = start_from_rest(move_path, parameters, radius, call)
        sections = (*ahead, last, *rest.sections)
        return PathMotion(sections, rest.last_move, 0, path_motion.time), False
    blend = make_blend(last_move.move_path, tail, move_path, head, circular)
    through, after = _blend_profiles(
        (blend.entry_rate, blend.exit_rate),
        last.profile.speed(leave),
        last.profile.duration - leave,
        last_move,
        parameters,
        head,
        move_path.length - head,
        speed_ratio,
    )
    end = PathSection(move_path, after, head, after.duration)
    blended = PathSection(blend, through, 0.0, through.duration)
    sections = (*ahead, replace(last, stop=leave), blended, end)
    entry = _blend_entry_time(end, move_path, radius)
    new_last_move = LastMove(move_path, parameters, radius, entry, call)
    return PathMotion(sections, new_last_move, 0, path_motion.time), True


def _blend_head(
    last_move: LastMove, tail: float, speed: float, move_path: MovePath
) -> float | None:
    """
    Return the length of the new path that the blend covers; None = no blend.

    :param tail: length of the last path from the entry of the blend to the waypoint.
    :param speed: speed at the entry of the blend.
    """
    if speed <= _MIN_SPEED or tail <= _MIN_SPEED:
        return None
    path = last_move.move_path
    entry, waypoint = path.pose(path.length - tail).position, path.pose(inf).position
    return start_within_radius(move_path, min(distance(entry, waypoint), last_move.radius))


def _blend_entry_time(section: PathSection, move_path: MovePath, radius: float) -> float:
    """Return the profile time at which the path comes within the radius [m] of its end."""
    if radius <= 0.0:
        return section.stop
    tail = end_within_radius(move_path, radius)
    if tail is None:
        return 0.0
    return section.profile.time_at(move_path.length - tail - section.offset)


def _blend_profiles(
    rates: tuple[float, float],
    speed: float,
    remaining: float,
    last_move: LastMove,
    after: ProfileParameters,
    head: float,
    rest: float,
    speed_ratio: float = 1.0,
) -> tuple[MotionProfile, MotionProfile]:
    """
    Return the profiles of the blend (0 to 1) and of the remainder of the new path.

    The rate u' of the blend parameter changes at a constant acceleration from its value at the
    entry to the value for the next cruising speed. It does not grow beyond a bound for each of the
    two moves: s'' = 2 r u'^2 <= a, with the acceleration a of the move and the length r of its
    path in the blend. The rate at the entry keeps the bound of a first move with a trapezoid,
    because v <= sqrt(2 a r) there. If the first move has a time, its a is the larger of two: its
    acceleration from rest to rest, and the next move's acceleration times the ratio of the first
    length to the next. Without a time for the next move, the rate at the exit is also so low that
    the remainder of the new path is long enough to brake.

    If the next move has a time, the sum of both times is kept: the time that the previous move had
    left until its waypoint is added to the time of the next move.

    :param rates: path units per unit of the blend's parameter, at entry and exit.
    :param speed: speed at the entry.
    :param remaining: time from the entry until rest at the waypoint [s], if there were no blend.
    :param after: the parameters of the new move.
    :param head: length of the new path within the blend.
    :param rest: length of the new path after the blend.
    :param speed_ratio: see :func:`append_move_path`.
    """
    (entry_rate, exit_rate), before = rates, last_move.parameters
    u0 = speed / entry_rate
    time, whole = after.time + remaining, head + rest
    acceleration = after.strongest(whole) if after.time > 0.0 else after.acceleration
    length = last_move.move_path.length
    strongest = before.strongest(length)
    if before.time > 0.0:
        strongest = max(strongest, acceleration * length / whole)
    if after.time > 0.0:
        # The speed is assumed to be constant from the entry on, except for the braking at the end.
        cruise = (whole + head) / (time * (1.0 - 0.5 * after.ramp_part(whole)))
    else:
        stoppable = sqrt(2.0 * (after.braking or acceleration) * rest)
        cruise = min(after.speed, stoppable)
    allowed = sqrt(min(strongest / entry_rate, acceleration / exit_rate))
    u1 = min(cruise / exit_rate, max(u0, allowed))
    through = ramp(1.0, u0, u1) if speed_ratio == 1.0 else two_ramps(u0, u1, speed_ratio)
    if after.time > 0.0:
        min_time = time * rest / (whole + head) / _MAX_CATCH_UP
        left = max(time - through.duration, min_time)
        return through, timed(rest, left, u1 * exit_rate, after.ramp_part(whole))
    return through, after.profile(rest, u1 * exit_rate)
