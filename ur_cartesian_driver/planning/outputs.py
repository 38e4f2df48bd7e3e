# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Outputs on the way: from a command of the goal to a record behind the right motion.

The robot program reads a record when the motion before it returns, at its stop or where its blend
begins, and switches the output when the tool gets to a place. So the time of a command (that of
its point, and its offset) is turned into a place on the planned path, and the record stands behind
the last motion that has returned by then. A robot that is slowed down switches at the same places.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import isfinite

import numpy as np

from ur_cartesian_driver.motion.errors import InvalidGoal, NotAvailable
from ur_cartesian_driver.motion.goal import Goal, IOCommand, OutputKind
from ur_cartesian_driver.motion.plan import PlannedSegment, ReferencePath
from ur_cartesian_driver.motion.pose import conjugate, Pose, pose_from_row, rotate, Vector6
from ur_cartesian_driver.motion.primitive import Spline, SwitchOutput
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.pose_rows import Floats
from ur_cartesian_driver.protocol.dialects import NEWEST
from ur_cartesian_driver.protocol.trajectory import MOST_OUTPUTS

#: The longest time after a point [s].
LARGEST_OFFSET = 60.0

_OUTPUTS = {
    OutputKind.STANDARD_DIGITAL: ('standard digital output', 8),
    OutputKind.CONFIGURABLE_DIGITAL: ('configurable digital output', 8),
    OutputKind.TOOL_DIGITAL: ('tool digital output', 2),
    OutputKind.STANDARD_ANALOG: ('standard analog output', 2),
}
# Two times nearer than this are one [s].
_NOW = 1e-6
# Half of the time over which a heading is looked for [s], and how long it may get.
_HEADING, _LONGEST_HEADING = 0.002, 0.6
# Where the tool moves by less than this the heading means nothing [m], [rad]; where it moves by
# less than so much for a turn, it is that of the turn [m/rad].
_NO_WAY = 1e-7
_TURNING = 0.01
# A tool that is less beyond a place when its record is read does not come round to it [m], [rad].
_BEYOND = 1e-4


def check_outputs(goal: Goal, options: PlanningOptions) -> None:
    """
    Check the commands by themselves.

    :raises InvalidGoal: names field, value and bound.
    :raises NotAvailable: the robot program is not ours.
    """
    if goal.io_commands and options.dialect is not NEWEST:
        raise NotAvailable(
            'io_commands',
            'is not empty, and robot programs of wire dialect '
            f'{options.dialect.name} switch no outputs on the way',
            'leave it empty, or let the driver send its own robot program',
        )
    for i, command in enumerate(goal.io_commands):
        _check(command, f'io_commands[{i}]', len(goal.waypoints))


def _check(command: IOCommand, field: str, points: int) -> None:
    name, pins = _OUTPUTS[command.output]
    if not 0 <= command.waypoint < points:
        raise InvalidGoal(
            f'{field}.point_index',
            f'is {command.waypoint}, and the points are 0 to {points - 1}',
            'name one of these',
        )
    if not 0.0 <= command.offset <= LARGEST_OFFSET:
        raise InvalidGoal(
            f'{field}.offset',
            f'is {command.offset:g} s; it is 0 to {LARGEST_OFFSET:g} s after the point',
            'name a later point',
        )
    if not 0 <= command.pin < pins:
        raise InvalidGoal(
            f'{field}.pin',
            f'is {command.pin}, and there are {name}s 0 to {pins - 1}',
            'name one of these',
        )
    is_analog = command.output is OutputKind.STANDARD_ANALOG
    if (
        not isfinite(command.value)
        or not 0.0 <= command.value <= 1.0
        or (not is_analog and command.value not in (0.0, 1.0))
    ):
        raise InvalidGoal(
            f'{field}.value',
            f'is {command.value:g}; a {name} takes '
            + ('0 to 1, the fraction of its range' if is_analog else '0 (off) or 1 (on)'),
            'give one of these',
        )


def with_outputs(
    segments: Sequence[PlannedSegment],
    reference: ReferencePath,
    commands: Sequence[IOCommand],
    *,
    corners: Sequence[float] = (),
    since: float = 0.0,
) -> tuple[PlannedSegment, ...]:
    """
    Return the segments with the outputs that are switched on the way, in their order in time.

    :param reference: the path of the TCP; its times are those of the segments.
    :param commands: their waypoints are numbered as those of the segments.
    :param corners: the time in the corner after each segment [s]; empty = there are none.
    :param since: when the first segment begins [s].
    :raises InvalidGoal: no motion leads to a point, or too many outputs wait at one time.
    """
    if not commands:
        return tuple(segments)
    way = _Way(segments, reference, corners, since)
    switches = sorted(
        (way.switch(command, f'io_commands[{i}]') for i, command in enumerate(commands)),
        key=lambda found: found.time,
    )
    outputs: list[list[SwitchOutput]] = [[] for _ in segments]
    notes = [segment.note for segment in segments]
    for found in switches:
        outputs[found.behind].append(found.record)
        notes[found.told] += f'; {found.text}'
    for own, segment in zip(outputs, segments, strict=True):
        if sum(record.place is not None for record in own) > MOST_OUTPUTS:
            raise InvalidGoal(
                'io_commands',
                f'switches more than {MOST_OUTPUTS} outputs between two motions, '
                f'behind point {segment.waypoint}',
                'add a point in between',
            )
    return tuple(
        replace(segment, outputs=tuple(own), note=note) if own or note != segment.note else segment
        for segment, own, note in zip(segments, outputs, notes, strict=True)
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Switch:
    """One output: when, behind which segment, and in which segment's line it is told."""

    time: float
    behind: int
    told: int
    record: SwitchOutput
    text: str


class _Way:
    """The motions in time, and the path."""

    def __init__(
        self,
        segments: Sequence[PlannedSegment],
        reference: ReferencePath,
        corners: Sequence[float],
        since: float,
    ) -> None:
        """Note when each motion ends, and when it returns."""
        self.segments, self.reference = segments, reference
        self.ends: Floats = since + np.cumsum([segment.duration for segment in segments])
        self.corners = np.array(corners or [0.0] * len(segments))
        self.returns: Floats = self.ends - 0.5 * self.corners
        self.index = {segment.waypoint: k for k, segment in enumerate(segments)}

    def switch(self, command: IOCommand, field: str) -> _Switch:
        """Return when and where a command is carried out."""
        told = self.index.get(command.waypoint)
        if told is None:
            raise InvalidGoal(
                f'{field}.point_index',
                f'is {command.waypoint}, and no motion leads there: the robot stands there',
                'set the output before',
            )
        time, last = float(self.ends[told]) + command.offset, len(self.segments) - 1
        late = time - float(self.ends[last])
        if command.offset <= _NOW:
            behind, place, where = told, self._at_point(told), self._where(told)
        elif late > -_NOW:
            behind, place = last, None
            where = f'{max(late, 0.0):.3f} s after the end'
        else:
            behind, place, where = self._behind(time), time, f'{command.offset:.3f} s after it'
        record = SwitchOutput(
            output=command.output,
            pin=command.pin,
            value=command.value,
            domain=command.domain,
            delay=max(late, 0.0) if place is None and command.offset > _NOW else 0.0,
        )
        if place is not None:
            record = self._at(record, place, float(self.returns[behind]))
        return _Switch(
            time=time if place is None else place,
            behind=behind,
            told=told,
            record=record,
            text=f'switches {_spoken(command)} {where}',
        )

    def _behind(self, time: float) -> int:
        """Return the number of the last motion that has returned at a time [s]."""
        return int(np.searchsorted(self.returns, time + _NOW, side='right')) - 1

    def _passes(self, k: int) -> bool:
        """Tell whether the arm moves at the end of a motion."""
        piece = self.segments[k].primitive
        return self.corners[k] > 0.0 or (isinstance(piece, Spline) and any(piece.velocities))

    def _where(self, k: int) -> str:
        if self.corners[k] > 0.0:
            return 'in the middle of its corner'
        return 'on passing it' if self._passes(k) else 'when it has stopped there'

    def _at_point(self, k: int) -> float | None:
        """Return when the tool is nearest to the end of a motion [s], None where it stops."""
        if not self._passes(k):
            return None
        end, half = float(self.ends[k]), 0.5 * float(self.corners[k])
        target = getattr(self.segments[k].primitive, 'target', None)
        if half <= 0.0 or not isinstance(target, Pose):
            return end
        return self._nearest(np.array(target.position), end - half, end + half, end)

    def _nearest(self, position: Floats, begin: float, end: float, middle: float) -> float:
        """Return when the path is nearest to a position within a time, the middle if always."""
        times, rows = self.reference.time, self.reference.poses
        own = slice(
            max(int(np.searchsorted(times, begin, side='right')) - 1, 0),
            int(np.searchsorted(times, end)) + 1,
        )
        points, t = rows[own, :3], times[own]
        way = np.diff(points, axis=0)
        square = (way * way).sum(axis=1)
        if square.max(initial=0.0) < _NO_WAY**2:
            return middle
        along = ((position - points[:-1]) * way).sum(axis=1) / np.maximum(square, 1e-300)
        u = np.clip(along, 0.0, 1.0)
        k = int(np.argmin(np.linalg.norm(points[:-1] + u[:, None] * way - position, axis=1)))
        return float(np.clip(t[k] + u[k] * (t[k + 1] - t[k]), begin, end))

    def _at(self, record: SwitchOutput, time: float, read: float) -> SwitchOutput:
        """Return a record with its place: where the tool is at a time, read at another [s]."""
        place, heading = self._pose(time), self._heading(time)
        if heading is None:
            return record
        start = (place.inverse() @ self._pose(read)).rotation_vector()
        beyond = sum(a * b for a, b in zip(start, heading, strict=True))
        return replace(record, place=place, heading=heading, comes_round=beyond > _BEYOND)

    def _pose(self, time: float) -> Pose:
        times, rows = self.reference.time, self.reference.poses
        k = min(max(int(np.searchsorted(times, time)), 1), len(times) - 1)
        before, span = float(times[k - 1]), float(times[k] - times[k - 1])
        part = min(max((time - before) / span, 0.0), 1.0) if span > 0.0 else 1.0
        return pose_from_row(rows[k - 1]).interpolate(pose_from_row(rows[k]), part)

    def _heading(self, time: float) -> Vector6 | None:
        """Return the direction of the path at a time, None where it stands."""
        place, half = self._pose(time), _HEADING
        while half <= _LONGEST_HEADING:
            a, b = self._pose(time - half), self._pose(time + half)
            way, angle = a.distance_to(b), a.angle_to(b)
            if way > max(_NO_WAY, _TURNING * angle):
                x, y, z = rotate(
                    conjugate(place.quaternion),
                    (
                        b.position[0] - a.position[0],
                        b.position[1] - a.position[1],
                        b.position[2] - a.position[2],
                    ),
                )
                return (x / way, y / way, z / way, 0.0, 0.0, 0.0)
            if angle > _NO_WAY:
                *_, x, y, z = (a.inverse() @ b).rotation_vector()
                return (0.0, 0.0, 0.0, x / angle, y / angle, z / angle)
            half *= 4.0
        return None


def _spoken(command: IOCommand) -> str:
    name, _ = _OUTPUTS[command.output]
    if command.output is OutputKind.STANDARD_ANALOG:
        return f'{name} {command.pin} to {command.value:g} ({command.domain.name.lower()})'
    return f'{name} {command.pin} {"on" if command.value else "off"}'
