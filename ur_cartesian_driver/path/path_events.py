# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""What happens at the points of a path: outputs, inputs, rests, presses."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Self

from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.geometry.vectors import ZERO6
from ur_cartesian_driver.motion.goal.goal import (
    ContactEnd,
    InputWait,
    OutputKind,
    PayloadChange,
    Press,
    PressFrame,
    ProportionalOutput,
    ScriptCall,
)
from ur_cartesian_driver.path.outputs import Input, Output
from ur_cartesian_driver.path.path_motions import PathOfMotions
from ur_cartesian_driver.path.path_numbers import amount, NANOSECONDS, to_nanoseconds, vector
from ur_cartesian_driver.path.path_points import PathPoint
from ur_cartesian_driver.planning.request.io_commands import check_proportional_output
from ur_cartesian_driver.planning.request.presses import check_press
from ur_cartesian_driver.planning.request.stops import (
    check_input_wait,
    check_payload,
    check_script_call,
    MAX_DWELL,
    MAX_OFFSET,
)


@dataclass(frozen=True, slots=True, init=False, repr=False)
class PathWithEvents(PathOfMotions):
    """A path whose points have events; see :class:`~.path_builder.Path`."""

    def set(
        self, output: Output, value: float, *, after: float = 0.0, before: float = 0.0
    ) -> Self:
        """
        Set an output when the tool passes the point before.

        :param value: True or False of a digital output, a fraction of the range of an analog one.
        :param after: time after the point [s].
        :param before: time before the point [s]; only where the motion to it has a duration.
        :raises InvalidGoal: there is no point, no such output, or no such value.
        """
        if not self._points:
            raise InvalidGoal('set()', 'comes before the first point', 'add a motion first')
        index, offset = len(self) - 1, after
        where = f'set() at point {index}'
        for name, time in (('after', after), ('before', before)):
            amount(where, name, time, 60.0, 's')
        if before:
            index, offset = index - 1, self._points[-1].duration / NANOSECONDS - before
            if not self._points[-1].duration or offset < 0.0 or index < 0 or after:
                raise InvalidGoal(
                    where,
                    f'has before={before:g} s, but no motion with a duration of that time leads '
                    'there from another point',
                    'add a point where the output is to change',
                )
            offset += self._points[index].segment.dwell
        command = output.command(value, 0, round(offset * NANOSECONDS) / NANOSECONDS)
        point = self._points[index]
        point = replace(point, outputs=(*point.outputs, command))
        return self._with(_points=(*self._points[:index], point, *self._points[index + 1 :]))

    def follow_speed(
        self,
        output: Output,
        gain: float,
        *,
        offset: float = 0.0,
        minimum: float = 0.0,
        maximum: float = 1.0,
        filter_time: float = 0.0,
        lead: float = 0.0,
        idle: float = 0.0,
    ) -> Self:
        """
        Let an analog output follow the speed of the tool from the point before on.

        It is ``offset + gain * speed``, within the bounds, all fractions of its range.

        :param gain: per speed [1/(m/s)].
        :param filter_time: time constant of a low-pass filter for the speed [s].
        :param lead: begin so long before the point [s].
        :param idle: value at its end, and when the motion does not go on as planned.
        :raises InvalidGoal: there is no point or no such output, or a number cannot be meant.
        """
        where = f'follow_speed() at point {len(self) - 1}'
        if not self._points:
            raise InvalidGoal('follow_speed()', 'comes before the first point', 'add a motion')
        if output.kind is not OutputKind.STANDARD_ANALOG:
            raise InvalidGoal(where, f'names {output}', 'use analog()')
        proportional = ProportionalOutput(
            first_waypoint=0,
            last_waypoint=1,
            pin=output.pin,
            domain=output.domain,
            gain=float(gain),
            offset=float(offset),
            minimum=float(minimum),
            maximum=float(maximum),
            filter_time=float(filter_time),
            begin_lead=float(lead),
            idle=float(idle),
        )
        check_proportional_output(where, proportional, 2)
        return self._begin_stretch(self._points[-1], replace(proportional, last_waypoint=0))

    def end_follow_speed(self, output: Output, *, lead: float = 0.0) -> Self:
        """
        End :meth:`follow_speed` at the point before.

        :param lead: end so long before the point [s].
        :raises InvalidGoal: the output does not follow the speed, or began to at this point.
        """
        begun = self._open_stretch(
            lambda one: isinstance(one, ProportionalOutput) and one.pin == output.pin
        )
        last = len(self) - 1
        if begun is None:
            raise InvalidGoal(
                f'end_follow_speed() at point {last}',
                f'has no begin for analog output {output.pin} at a point before',
                'call follow_speed() there',
            )
        i, k = begun
        proportional = self._points[i].stretches[k]
        assert isinstance(proportional, ProportionalOutput)
        proportional = replace(proportional, end_lead=float(lead))
        check_proportional_output(
            'end_follow_speed()', replace(proportional, last_waypoint=last - i), last + 1
        )
        return self._end_stretch(i, k, proportional)

    def press(
        self,
        forces: Mapping[str, float],
        *,
        frame: PressFrame = PressFrame.TOOL,
        speed_limits: Mapping[str, float] | None = None,
        max_yield: float = 0.0,
        max_yield_angle: float = 0.0,
        max_deviation: float = 0.0,
        max_deviation_angle: float = 0.0,
        damping: float = 0.005,
        gain_scaling: float = 1.0,
        zero_sensor: bool = False,
        contact: ContactEnd = ContactEnd.NONE,
    ) -> Self:
        """
        Press with the controller's force mode from the point before on; there it has no blend.

        :param forces: what the tool applies along compliant axes of the frame, 'x' 'y' 'z' [N],
            and about them, 'rx' 'ry' 'rz' [Nm]; empty where it only watches for contact.
        :param speed_limits: how fast it gives way, for the same axes [m/s], [rad/s]; None = 0.05
            and 0.2.
        :param max_yield: how far it may give way along them [m]; ``max_yield_angle`` [rad].
        :param max_deviation: how far it may be off its path along the others [m];
            ``max_deviation_angle`` [rad]. 0 = the default, for all four.
        :param damping: of force mode, 0 to 1; ``gain_scaling``: 0 to 2.
        :param zero_sensor: zero the force sensor before.
        :param contact: whether the goal ends where the tool touches.
        :raises InvalidGoal: as :meth:`dwell`, or a number cannot be meant.
        """
        where, point = self._stop('press')
        limits = speed_limits or {}
        axes = tuple(forces)
        if limits and set(limits) != set(axes):
            raise InvalidGoal(
                where, f'has speed_limits for {", ".join(limits)}', 'name the axes of forces'
            )
        press = Press(
            first_waypoint=0,
            last_waypoint=1,
            frame=frame,
            axes=axes,
            forces=tuple(float(forces[axis]) for axis in axes),
            speed_limits=tuple(float(limits[axis]) for axis in axes if limits),
            max_yield=float(max_yield),
            max_yield_angle=float(max_yield_angle),
            max_deviation=float(max_deviation),
            max_deviation_angle=float(max_deviation_angle),
            damping=float(damping),
            gain_scaling=float(gain_scaling),
            zero_sensor=zero_sensor,
            contact=contact,
        )
        check_press(where, press)
        return self._begin_stretch(point, replace(press, last_waypoint=0))

    def end_press(self) -> Self:
        """
        End :meth:`press` at the point before; there it has no blend.

        The motion to the next point begins where the tool is, and leads straight there.

        :raises InvalidGoal: as :meth:`dwell`, or no press has begun at a point before.
        """
        where, point = self._stop('end_press')
        begun = self._open_stretch(lambda one: isinstance(one, Press))
        if begun is None:
            raise InvalidGoal(where, 'has no begin at a point before', 'call press() there')
        i, k = begun
        ended = self._end_stretch(i, k, self._points[i].stretches[k])
        return ended._with(_points=(*ended._points[:-1], point))

    def _begin_stretch(self, point: PathPoint, stretch: ProportionalOutput | Press) -> Self:
        """Return the path with something that begins at the last point, given as it is there."""
        point = replace(point, stretches=(*point.stretches, stretch))
        return self._with(_points=(*self._points[:-1], point))

    def _open_stretch(
        self, is_wanted: Callable[[ProportionalOutput | Press], bool]
    ) -> tuple[int, int] | None:
        """Return the latest point at which one began that has no end, and its number there."""
        for i in range(len(self) - 2, -1, -1):
            for k, stretch in enumerate(self._points[i].stretches):
                if not stretch.last_waypoint and is_wanted(stretch):
                    return i, k
        return None

    def _end_stretch(self, i: int, k: int, stretch: ProportionalOutput | Press) -> Self:
        """Return the path with the end of one at the last point."""
        point = self._points[i]
        stretch = replace(stretch, last_waypoint=len(self) - 1 - i)
        stretches = (*point.stretches[:k], stretch, *point.stretches[k + 1 :])
        point = replace(point, stretches=stretches)
        return self._with(_points=(*self._points[:i], point, *self._points[i + 1 :]))

    def dwell(self, time: float) -> Self:
        """
        Let the arm rest at the point before for a time; there it has no blend.

        Durations are those of motions: what follows is later by the time [s].

        :raises InvalidGoal: there is no point, or it is passed with a blend or a twist of its own.
        """
        where, point = self._stop('dwell')
        length = to_nanoseconds(where, amount(where, 'time', time, MAX_DWELL, 's')) / NANOSECONDS
        segment = replace(point.segment, dwell=length)
        return self._with(_points=(*self._points[:-1], replace(point, segment=segment)))

    def call(self, function: str, *arguments: float, timeout: float = 10.0) -> Self:
        """
        Call a function of ``script_prelude`` at the point before; there it has no blend.

        :param function: its name; a driver that does not have it refuses the path.
        :param timeout: longest time until it returns [s].
        :raises InvalidGoal: as :meth:`dwell`, or a number cannot be meant.
        """
        where, point = self._stop('call')
        numbers = tuple(float(argument) for argument in arguments)
        call = ScriptCall(waypoint=0, function=function, arguments=numbers, timeout=float(timeout))
        check_script_call(where, call)
        point = replace(point, stops=(*point.stops, call))
        return self._with(_points=(*self._points[:-1], point))

    def wait_for(
        self,
        what: Input,
        value: float = True,
        *,
        timeout: float,
        below: bool = False,
        go_on: bool = False,
    ) -> Self:
        """
        Let the arm rest at the point before until an input has a value; there it has no blend.

        A :meth:`dwell` there, and the time of an output, count from when the input has come.

        :param value: True or False of a digital input, the level of an analog one [A] or [V].
        :param timeout: longest wait [s].
        :param below: until an analog input is below the level, not at it or above.
        :param go_on: go on if the input does not come; else the goal fails.
        :raises InvalidGoal: as :meth:`dwell`, or there is no such input or level.
        """
        where, point = self._stop('wait_for')
        wait = what.wait(float(value), timeout, below, go_on)
        check_input_wait(where, wait)
        if any(isinstance(other, InputWait) for other in point.stops):
            raise InvalidGoal(where, 'waits for a second input', 'add a point for it')
        if any(isinstance(other, ScriptCall) for other in point.stops):
            raise InvalidGoal(
                where, 'follows a call(), which comes after it', 'let the function wait'
            )
        point = replace(point, stops=(*point.stops, wait))
        return self._with(_points=(*self._points[:-1], point))

    def payload(self, mass: float, center_of_gravity: Sequence[float] = (0.0, 0.0, 0.0)) -> Self:
        """
        Set the payload where the arm stops at the point before; there it has no blend.

        :param mass: [kg].
        :param center_of_gravity: in the flange frame [m].
        :raises InvalidGoal: as :meth:`dwell`, or a number cannot be meant.
        """
        where, point = self._stop('payload')
        cog = vector(where, center_of_gravity, MAX_OFFSET)
        change = PayloadChange(waypoint=0, mass=float(mass), center_of_gravity=cog)
        check_payload(where, change)
        point = replace(point, stops=(*point.stops, change))
        return self._with(_points=(*self._points[:-1], point))

    def _stop(self, name: str) -> tuple[str, PathPoint]:
        """Return where the method is, and the last point as one at which the arm stops."""
        if not self._points:
            raise InvalidGoal(f'{name}()', 'comes before the first point', 'add a motion first')
        where, point = f'{name}() at point {len(self) - 1}', self._points[-1]
        segment, waypoint = point.segment, point.waypoint
        own_blend = segment.blend_radius > 0.0 and not point.feed_blend
        moves = any(abs(rate) > 0.0 for rate in (*waypoint.twist, *waypoint.acceleration))
        if own_blend or moves:
            raise InvalidGoal(where, 'is where the arm does not stop', 'leave out blend and twist')
        if point.in_spline:
            waypoint = replace(waypoint, twist=ZERO6, acceleration=ZERO6)
        point = replace(
            point,
            waypoint=waypoint,
            segment=replace(segment, blend_radius=0.0),
            feed_blend=False,
            auto_blend=False,
        )
        return where, point
