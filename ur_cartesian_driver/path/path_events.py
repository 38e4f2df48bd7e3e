# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Events at the points of a path, such as outputs, waits for inputs, dwells and presses."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.geometry.vectors import ZERO6
from ur_cartesian_driver.motion.goal.goal import (
    ContactEnd,
    InputWait,
    MAX_OUTPUT_LEAD,
    MAX_OUTPUT_OFFSET,
    MAX_STOP_TIME,
    OutputKind,
    PartAction,
    PartChange,
    PayloadChange,
    Press,
    PressFrame,
    ProportionalOutput,
    PulseTrain,
    ScriptCall,
)
from ur_cartesian_driver.path.outputs import Input, Output
from ur_cartesian_driver.path.path_motions import PathOfMotions
from ur_cartesian_driver.path.path_numbers import (
    amount,
    any_number,
    many_numbers,
    NANOSECONDS,
    numbers,
    to_nanoseconds,
    vector,
)
from ur_cartesian_driver.path.path_points import PathPoint, with_fields
from ur_cartesian_driver.planning.request.point_events.payload_changes import MAX_OFFSET
from ur_cartesian_driver.planning.request.point_events.registry import check_event

#: For each event with a begin and an end: the method that sets the begin, the method that sets the
#: end, and a phrase that identifies the event.
_METHODS = {
    Press: ('press()', 'end_press()', ''),
    ProportionalOutput: ('follow_speed()', 'end_follow_speed()', ' for analog output {0.pin}'),
    PulseTrain: ('pulses()', 'end_pulses()', ' for pin {0.pin}'),
}


@dataclass(frozen=True, slots=True, init=False, repr=False)
class PathWithEvents(PathOfMotions):
    """A path whose points have events; see :class:`~.path_builder.Path`."""

    def set(
        self,
        output: Output,
        value: float,
        *,
        after: float = 0.0,
        before: float = 0.0,
        distance: float = 0.0,
        fraction: float = 0.0,
        lead: float | str = 0.0,
    ) -> Self:
        """
        Set an output when the tool passes the last point, or a place before or after it.

        :param value: True or False for a digital output, fraction of the range for an analog one.
        :param after: time after the place [s].
        :param before: time before the point [s]; only if the motion to it has a duration.
        :param distance: way along the path from the point to the place [m]; negative = before it.
        :param fraction: the same as a fraction of a segment: if negative, of the segment to the
            point; if positive, of the segment after it.
        :param lead: how much ahead of the place to switch, in real time [s]: the dead time of a
            valve, or the name of the valve in the driver's ``lead_file``.
        :raises InvalidGoal: there is no point, or the value, a time or the place is not possible.
        """
        if not self._points:
            raise InvalidGoal('set()', 'comes before the first point', 'add a motion first')
        index = len(self) - 1
        where = f'set() at point {index}'
        distance = any_number(where, 'distance', distance)
        fraction = any_number(where, 'fraction', fraction)
        valve, ahead = (
            (lead, 0.0) if isinstance(lead, str) else ('', any_number(where, 'lead', lead))
        )
        after, before = any_number(where, 'after', after), any_number(where, 'before', before)
        for name, time, most in (
            ('after', after, MAX_OUTPUT_OFFSET),
            ('before', before, MAX_OUTPUT_OFFSET),
            ('lead', ahead, MAX_OUTPUT_LEAD),
        ):
            amount(where, name, time, most, 's')
        if before and (distance or fraction):
            raise InvalidGoal(
                where,
                'combines before with distance or fraction',
                'use one of these; a distance or fraction below 0 lies before the point',
            )
        if before and after:
            raise InvalidGoal(where, 'combines before with after', 'use one of them')
        if lead and (after or before):
            raise InvalidGoal(
                where, 'combines lead with after or before', 'move the place by a distance'
            )
        offset = after
        if before:
            index, offset = index - 1, self._points[-1].duration / NANOSECONDS - before
            if not self._points[-1].duration or offset < 0.0 or index < 0:
                raise InvalidGoal(
                    where,
                    f'has before={before:g} s, but the motion to this point has no duration, a '
                    'shorter one, or begins at no point',
                    'add a point where the output is to change',
                )
            offset += self._points[index].segment.dwell
        command = replace(
            output.command(value, 0, round((offset - ahead) * NANOSECONDS) / NANOSECONDS),
            distance=distance,
            fraction=fraction,
            lead=valve,
        )
        check_event(where, command)
        point = self._points[index]
        return self._with_point(index, replace(point, events=(*point.events, command)))

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
        Make an analog output follow the speed of the tool from the last point on.

        The output is ``offset + gain * speed``, but at least ``minimum`` and at most ``maximum``,
        all as fractions of its range.

        :param gain: fraction of the range per speed [1/(m/s)].
        :param filter_time: time constant of a low-pass filter for the speed [s].
        :param lead: how long before the point the output begins to follow [s].
        :param idle: value after the end, and when the motion does not go on as planned.
        :raises InvalidGoal: there is no point, the output is not analog, or a number is out of its
            range.
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
            begin_lead=any_number(where, 'lead', lead),
            **numbers(
                where,
                gain=gain,
                offset=offset,
                minimum=minimum,
                maximum=maximum,
                filter_time=filter_time,
                idle=idle,
            ),
        )
        return self._with_event(where, self._points[-1], proportional)

    def end_follow_speed(self, output: Output, *, lead: float = 0.0) -> Self:
        """
        End :meth:`follow_speed` at the last point.

        :param lead: how long before the point the output ceases to follow [s].
        :raises InvalidGoal: the output does not follow the speed from an earlier point on, or
            ``lead`` is out of its range.
        """
        where = f'end_follow_speed() at point {len(self) - 1}'
        if output.kind is not OutputKind.STANDARD_ANALOG:
            raise InvalidGoal(where, f'names {output}', 'use analog()')
        begun = self._begun(
            lambda one: isinstance(one, ProportionalOutput) and one.pin == output.pin
        )
        if begun is None:
            raise InvalidGoal(
                where,
                f'ends follow_speed({output}), which has not begun',
                'call it at an earlier point',
            )
        end_lead = any_number(where, 'lead', lead)
        check_event(where, replace(begun[1], end_lead=end_lead, last_waypoint=1))
        return self._ended(*begun, end_lead=end_lead)

    def pulses(
        self,
        output: Output,
        distance: float,
        *,
        width: float = 0.0,
        phase: float = 0.0,
        count: int = 0,
    ) -> Self:
        """
        Make a digital output give pulses from the last point on, evenly along the path.

        :param distance: way along the path from pulse to pulse [m].
        :param width: how long the output stays on [s], in real time; 0 = one cycle.
        :param phase: way along the path from the point to the first pulse [m].
        :param count: number of pulses; 0 = as many as there is room for.
        :raises InvalidGoal: there is no point, the output is not digital, or a number is out of
            its range.
        """
        where = f'pulses() at point {len(self) - 1}'
        if not self._points:
            raise InvalidGoal('pulses()', 'comes before the first point', 'add a motion')
        train = PulseTrain(
            first_waypoint=0,
            last_waypoint=1,
            output=output.kind,
            pin=output.pin,
            count=count,
            distance=any_number(where, 'distance', distance),
            phase=any_number(where, 'phase', phase),
            width=any_number(where, 'width', width),
        )
        return self._with_event(where, self._points[-1], train)

    def end_pulses(self, output: Output) -> Self:
        """
        End :meth:`pulses` at the last point.

        :raises InvalidGoal: the output gives no pulses from an earlier point on.
        """
        begun = self._begun(
            lambda one: (
                isinstance(one, PulseTrain) and (one.output, one.pin) == (output.kind, output.pin)
            )
        )
        if begun is None:
            raise InvalidGoal(
                f'end_pulses() at point {len(self) - 1}',
                f'ends pulses({output}), which has not begun',
                'call it at an earlier point',
            )
        return self._ended(*begun)

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
        Press with the controller's force mode from the last point on, where the arm stops.

        :param forces: forces along the compliant axes of the frame, 'x' 'y' 'z' [N], and torques
            about them, 'rx' 'ry' 'rz' [Nm]; empty = no force, only watch for contact.
        :param speed_limits: how fast the tool may give way along and about the same axes [m/s],
            [rad/s]; None = 0.05 and 0.2.
        :param max_yield: how far the tool may give way along the compliant axes [m]; 0 = the
            default, here and in the three below.
        :param max_yield_angle: how far it may give way about them [rad].
        :param max_deviation: how far the tool may be off its path along the other axes [m].
        :param max_deviation_angle: how far it may be turned about them [rad].
        :param damping: damping of force mode, 0 to 1.
        :param gain_scaling: gain scaling of force mode, 0 to 2.
        :param zero_sensor: zero the force sensor before the press.
        :param contact: the effect of the tool's first contact, which can end the goal.
        :raises InvalidGoal: as for :meth:`dwell`, or a number is out of its range.
        """
        where, point = self._as_stop('press')
        for what, given in (('forces', forces), ('speed_limits', speed_limits or {})):
            if not isinstance(given, Mapping):
                raise InvalidGoal(
                    where, f'has the {what} {given!r:.60}', "name the axes, like {'z': 20.0}"
                )
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
            forces=tuple(any_number(where, f'force {each}', forces[each]) for each in axes),
            speed_limits=tuple(
                any_number(where, f'speed limit {each}', limits[each]) for each in axes if limits
            ),
            zero_sensor=zero_sensor,
            contact=contact,
            **numbers(
                where,
                max_yield=max_yield,
                max_yield_angle=max_yield_angle,
                max_deviation=max_deviation,
                max_deviation_angle=max_deviation_angle,
                damping=damping,
                gain_scaling=gain_scaling,
            ),
        )
        return self._with_event(where, point, press)

    def end_press(self) -> Self:
        """
        End :meth:`press` at the last point, where the arm stops.

        The motion to the next point begins where the tool is, and leads straight to that point.

        :raises InvalidGoal: as for :meth:`dwell`, or no press has begun at an earlier point.
        """
        where, point = self._as_stop('end_press')
        begun = self._begun(lambda one: isinstance(one, Press))
        if begun is None:
            raise InvalidGoal(
                where, 'ends press(), which has not begun', 'call it at an earlier point'
            )
        return self._with_point(-1, point)._ended(*begun)

    def dwell(self, time: float) -> Self:
        """
        Make the arm stop at the last point and wait there for a time [s].

        The durations of motions do not include this time: it delays everything that follows.

        :raises InvalidGoal: there is no point, the point has a blend, twist or acceleration of its
            own, or the time is out of its range.
        """
        where, point = self._as_stop('dwell')
        length = (
            to_nanoseconds(where, amount(where, 'time', time, MAX_STOP_TIME, 's')) / NANOSECONDS
        )
        segment = replace(point.segment, dwell=length)
        return self._with_point(-1, replace(point, segment=segment))

    def call(self, function: str, *arguments: float, timeout: float = 10.0) -> Self:
        """
        Call a function of ``script_prelude`` at the last point, where the arm stops.

        :param function: the function's name; a driver without such a function refuses the path.
        :param timeout: longest time until the function returns [s].
        :raises InvalidGoal: as for :meth:`dwell`, or a number is out of its range.
        """
        where, point = self._as_stop('call')
        call = ScriptCall(
            waypoint=0,
            function=function,
            arguments=many_numbers(where, 'argument', arguments),
            timeout=any_number(where, 'timeout', timeout),
        )
        return self._with_event(where, point, call)

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
        Make the arm stop at the last point and wait there until an input has a value.

        A :meth:`dwell` and the times of outputs at this point begin when this wait ends.

        :param value: True or False for a digital input, the level of an analog one [A] or [V].
        :param timeout: longest wait [s].
        :param below: wait until an analog input is below the level, instead of at it or above.
        :param go_on: whether the motion goes on after the timeout; if not, the goal fails.
        :raises InvalidGoal: as for :meth:`dwell`, there is no such input or level, or the point
            already has a wait or a call.
        """
        where, point = self._as_stop('wait_for')
        given = numbers(where, value=value, timeout=timeout)
        wait = what.wait(**given, below=below, go_on=go_on)
        path = self._with_event(where, point, wait)
        if any(isinstance(other, InputWait) for other in point.events):
            raise InvalidGoal(where, 'waits for a second input', 'add a point for it')
        if any(isinstance(other, ScriptCall) for other in point.events):
            raise InvalidGoal(
                where,
                'is written after call(), but at one point the robot waits before it calls',
                'let the function wait',
            )
        return path

    def payload(
        self,
        mass: float,
        center_of_gravity: Sequence[float] = (0.0, 0.0, 0.0),
        *,
        inertia: Sequence[float] = (),
        transition: float = 0.0,
    ) -> Self:
        """
        Set the payload at the last point, where the arm stops.

        :param mass: mass of the payload [kg].
        :param center_of_gravity: its position in the flange frame [m].
        :param inertia: xx, yy, zz, xy, xz, yz about the centre of gravity, along the axes of the
            flange [kg m^2]; empty = a point mass.
        :param transition: time that the controller takes to change to this payload [s].
        :raises InvalidGoal: as for :meth:`dwell`, or a number is out of its range.
        """
        where, point = self._as_stop('payload')
        cog = vector(where, center_of_gravity, MAX_OFFSET)
        change = PayloadChange(
            waypoint=0,
            mass=any_number(where, 'mass', mass),
            center_of_gravity=cog,
            inertia=many_numbers(where, 'inertia', inertia),
            transition_time=any_number(where, 'transition', transition),
        )
        return self._with_event(where, point, change)

    def attach(
        self,
        part: str,
        *,
        mass: float | None = None,
        center_of_gravity: Sequence[float] = (0.0, 0.0, 0.0),
    ) -> Self:
        """
        Take a body of the cell at the last point, where the arm stops.

        From there on, the body moves with the flange in the checks. Close the gripper with
        :meth:`set` at the same point.

        :param part: name of the body in the driver's cell.
        :param mass: mass of the payload from there on [kg]; None = the payload does not change.
        :param center_of_gravity: centre of gravity of this payload, in the flange frame [m].
        :raises InvalidGoal: as for :meth:`dwell`, or a number is out of its range.
        """
        return self._with_part(part, PartAction.ATTACH, mass, center_of_gravity)

    def release(
        self,
        part: str,
        *,
        mass: float | None = None,
        center_of_gravity: Sequence[float] = (0.0, 0.0, 0.0),
    ) -> Self:
        """
        Put a body of the cell down at the last point, where the arm stops; it stays there.

        Open the gripper with :meth:`set` at the same point.

        :param part: name of a body that the tool carries.
        :param mass: mass of the payload from there on [kg]; None = the payload does not change.
        :param center_of_gravity: centre of gravity of this payload, in the flange frame [m].
        :raises InvalidGoal: as for :meth:`dwell`, or a number is out of its range.
        """
        return self._with_part(part, PartAction.RELEASE, mass, center_of_gravity)

    # ---- inside --------------------------------------------------------------------------------

    def _with_part(
        self,
        part: str,
        action: PartAction,
        mass: float | None,
        center_of_gravity: Sequence[float],
    ) -> Self:
        """Return the path with a change of a part at the last point, and of the payload."""
        where, point = self._as_stop(action.name.lower())
        path = self._with_event(where, point, PartChange(waypoint=0, body=part, action=action))
        return path if mass is None else path.payload(mass, center_of_gravity)

    def _with_point(self, index: int, point: PathPoint) -> Self:
        """Return the path with one of its points replaced."""
        points = list(self._points)
        points[index] = point
        return self._with(_points=tuple(points))

    def _with_event(self, where: str, point: PathPoint, event: Any) -> Self:
        """
        Return the path with an event at the last point.

        :param point: the last point, changed as the event requires.
        :param event: the event, numbered as if the last point were point 0. An event that needs an
            end has it at point 1 for the check, and none afterwards.
        """
        event = with_fields(where, event, {})
        check_event(where, event)
        if type(event) in _METHODS:
            event = replace(event, last_waypoint=0)
        return self._with_point(-1, replace(point, events=(*point.events, event)))

    def _begun(self, is_wanted: Callable[[Any], bool]) -> tuple[int, Any] | None:
        """Return point index and event of the latest wanted event without an end; None = none."""
        for i in range(len(self) - 2, -1, -1):
            for event in self._points[i].events:
                if type(event) in _METHODS and not event.last_waypoint and is_wanted(event):
                    return i, event
        return None

    def _ended(self, i: int, event: Any, **changes: float) -> Self:
        """Return the path in which an event that begins at point i ends at the last point."""
        ended = replace(event, last_waypoint=len(self) - 1 - i, **changes)
        point = self._points[i]
        events = tuple(ended if each is event else each for each in point.events)
        return self._with_point(i, replace(point, events=events))

    def _check_ends(self) -> None:
        """
        Refuse events without an end.

        :raises InvalidGoal: an event has no end; the text names the methods that set begin and
            end.
        """
        for i, point in enumerate(self._points):
            for event in point.events:
                if type(event) in _METHODS and not event.last_waypoint:
                    begin, end, what = _METHODS[type(event)]
                    raise InvalidGoal(
                        f'{begin} at point {i}',
                        f'has no end{what.format(event)}',
                        f'call {end} at a later point',
                    )

    def _as_stop(self, name: str) -> tuple[str, PathPoint]:
        """Return the beginning of error texts, and the last point, changed to a stop."""
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
