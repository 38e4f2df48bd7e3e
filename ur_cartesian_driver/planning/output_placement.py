# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Outputs during a motion: place the commands of a goal as records behind the right primitives.

The robot program reads a record when the motion before it returns, at its stop or where its blend
begins, and switches the output when the tool reaches the trigger pose. So the time of a command
(of its point, plus its offset) becomes a trigger pose on the planned path, and the record
stands behind the last motion that has returned by then. A slower robot switches at the same poses.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.geometry.pose import conjugate, Pose, pose_from_row, rotate
from ur_cartesian_driver.motion.geometry.pose_rows import Floats
from ur_cartesian_driver.motion.geometry.vectors import subtract, Vector6
from ur_cartesian_driver.motion.goal.goal import IOCommand, OutputKind, ProportionalOutput
from ur_cartesian_driver.motion.plan.plan import PlannedRows, ReferencePath
from ur_cartesian_driver.motion.plan.primitive import (
    OutputRecord,
    SpeedLaw,
    Spline,
    Stop,
    SwitchOutput,
    Wait,
)
from ur_cartesian_driver.planning.request.io_commands import describe_command
from ur_cartesian_driver.protocol.program.trajectory_points import MAX_PENDING_OUTPUTS

# Times that differ by less are the same [s].
_SAME_TIME = 1e-6
# Half of the time over which the trigger direction is measured [s], at first and at most.
_DIRECTION_TIME, _MAX_DIRECTION_TIME = 0.002, 0.6
# A shorter motion has no direction [m], [rad]; one with less distance per turn has that of its
# turn [m/rad].
_MIN_MOTION = 1e-7
_TURNING = 0.01
# Where the tool gets on by less than this part of its way, it turns back.
_TURNS_BACK = 0.1
# From this distance beyond the trigger pose on, the tool counts as coming round to it [m], [rad].
_BEYOND = 1e-4


def place_outputs(
    segments: PlannedRows,
    reference: ReferencePath,
    commands: Sequence[IOCommand],
    *,
    proportional: Sequence[ProportionalOutput] = (),
    blend_halves: Floats | None = None,
    start_time: float = 0.0,
) -> PlannedRows:
    """
    Return the segments with the outputs that are switched during the motion, in order of time.

    :param reference: the path of the TCP, with the times of the segments.
    :param commands: their waypoints are numbered as the segments are.
    :param blend_halves: the time in the first half of the blend after each segment [s]; None =
        no blends.
    :param start_time: when the first segment begins [s].
    :raises InvalidGoal: no motion leads to a point, or too many outputs are pending at a time.
    """
    if not commands and not proportional:
        return segments
    timed_path = _TimedPath(segments, reference, blend_halves, start_time)
    switches = sorted(
        (
            *(
                timed_path.switch(command, f'io_commands[{i}]')
                for i, command in enumerate(commands)
            ),
            *(
                switch
                for i, output in enumerate(proportional)
                for switch in timed_path.follow(output, f'proportional_outputs[{i}]')
            ),
        ),
        key=lambda found: found.time,
    )
    outputs: dict[int, tuple[OutputRecord, ...]] = {}
    notes = dict(segments.notes)
    for found in switches:
        row, line = found.after_index, found.report_index
        outputs[row] = (*outputs.get(row, ()), *found.records)
        notes[line] = f'{notes.get(line, "")}; {found.text}'
    for row in sorted(outputs):
        if _waiting(outputs[row]) > MAX_PENDING_OUTPUTS:
            raise InvalidGoal(
                'io_commands',
                f'switches more than {MAX_PENDING_OUTPUTS} outputs between two motions, '
                f'after point {segments.waypoints[row]}',
                'add a point in between',
            )
    return replace(segments, outputs=outputs, notes=notes)


@dataclass(frozen=True, slots=True, kw_only=True)
class _PlacedOutput:
    """One output: its time, the segment that it follows, and the segment that reports it."""

    time: float
    after_index: int
    report_index: int
    records: tuple[OutputRecord, ...]
    text: str


def _waiting(records: Sequence[OutputRecord]) -> int:
    """Return how many records wait for a trigger pose, laws included."""
    return sum(isinstance(each, SpeedLaw) or each.trigger_pose is not None for each in records)


class _TimedPath:
    """The segments over time, with their path."""

    def __init__(
        self,
        segments: PlannedRows,
        reference: ReferencePath,
        blend_halves: Floats | None,
        start_time: float,
    ) -> None:
        """Compute when each motion ends, and when it returns."""
        self.segments, self.reference = segments, reference
        self.ends: Floats = start_time + np.cumsum(segments.durations)
        self.blend_halves = np.zeros(len(segments)) if blend_halves is None else blend_halves
        self.returns: Floats = self.ends - self.blend_halves
        still = (segments.lengths == 0.0) & (np.diff(segments.waypoints, prepend=-1) == 0)
        stops = {
            k: segments.primitives[k]
            for k in np.flatnonzero(still).tolist()
            if isinstance(segments.primitives[k], Stop)
        }
        #: By waypoint: the row of its rest.
        self.rests = {
            int(segments.waypoints[k]): k for k, stop in stops.items() if isinstance(stop, Wait)
        }
        #: The row whose motion leads to each point.
        self.index = {
            waypoint: k for k, waypoint in enumerate(segments.waypoints.tolist()) if k not in stops
        }

    def switch(self, command: IOCommand, field: str) -> _PlacedOutput:
        """Return when and where a command switches its output."""
        report_index = self.index.get(command.waypoint)
        if report_index is None:
            raise InvalidGoal(
                f'{field}.point_index',
                f'is {command.waypoint}, but no motion leads there: the robot is already there',
                'switch the output before the goal',
            )
        time, last = float(self.ends[report_index]) + command.offset, len(self.segments) - 1
        late, delay = time - float(self.ends[last]), 0.0
        if command.offset <= _SAME_TIME:
            after_index, trigger_time, where = (
                report_index,
                self._at_point(report_index),
                self._where(report_index),
            )
        elif (rest := self.rests.get(command.waypoint)) is not None and time <= self.ends[rest]:
            after_index, trigger_time, delay = rest - 1, None, command.offset
            where = f'{command.offset:.3f} s after stopping there'
        elif late > -_SAME_TIME:
            after_index, trigger_time, delay = last, None, max(late, 0.0)
            where = f'{delay:.3f} s after the end'
        else:
            after_index, trigger_time, where = (
                self._last_returned(time),
                time,
                f'{command.offset:.3f} s after it',
            )
        record = SwitchOutput(
            output=command.output,
            pin=command.pin,
            value=command.value,
            domain=command.domain,
            delay=delay,
        )
        if trigger_time is not None:
            record = self._at(record, trigger_time, float(self.returns[after_index]))
        return _PlacedOutput(
            time=time if trigger_time is None else trigger_time,
            after_index=after_index,
            report_index=report_index,
            records=(record,),
            text=f'switches {describe_command(command)} {where}',
        )

    def follow(self, output: ProportionalOutput, field: str) -> list[_PlacedOutput]:
        """Return where an output begins to follow the speed, and where it ends."""
        switch = SwitchOutput(
            output=OutputKind.STANDARD_ANALOG,
            pin=output.pin,
            value=output.idle,
            domain=output.domain,
        )
        law = SpeedLaw(
            gain=output.gain,
            offset=output.offset,
            minimum=output.minimum,
            maximum=output.maximum,
            filter_time=output.filter_time,
        )
        name = f'standard analog output {output.pin}'
        begin = self._ahead(
            # A value that is not 0: a stop does not carry it out.
            replace(switch, value=1.0, follows_speed=True),
            output.first_waypoint,
            output.begin_lead,
            f'{field}.begin_lead',
            f'{name} follows the speed',
        )
        end = self._ahead(
            switch,
            output.last_waypoint,
            output.end_lead,
            f'{field}.end_lead',
            f'{name} follows it no more',
        )
        if end.time <= begin.time:
            raise InvalidGoal(
                f'{field}.end_lead',
                f'is {output.end_lead:g} s, so the output would end before it begins',
                'reduce it',
            )
        return [replace(begin, records=(law, *begin.records)), end]

    def _ahead(
        self, record: SwitchOutput, waypoint: int, lead: float, field: str, what: str
    ) -> _PlacedOutput:
        """Return a record placed so long before a point [s]."""
        report_index = self.index.get(waypoint)
        if report_index is None:
            raise InvalidGoal(
                field.rpartition('.')[0],
                f'names point {waypoint}, but no motion leads there: the robot is already there',
                'begin at the next point',
            )
        if lead <= _SAME_TIME:
            time = self._at_point(report_index)
            after_index = report_index
        else:
            time = float(self.ends[report_index]) - lead
            after_index = self._last_returned(time)
            if after_index < 0:
                raise InvalidGoal(
                    field,
                    f'is {lead:g} s, but no motion has ended so long before point {waypoint}',
                    'reduce it, or add a point before',
                )
        if time is not None:
            record = self._at(record, time, float(self.returns[after_index]))
        where = self._where(report_index) if lead <= _SAME_TIME else f'{lead:.3f} s before it'
        return _PlacedOutput(
            time=float(self.ends[report_index]) if time is None else time,
            after_index=after_index,
            report_index=report_index,
            records=(record,),
            text=f'{what}, {where}',
        )

    def _last_returned(self, time: float) -> int:
        """Return the index of the last motion that has returned at a time [s]."""
        return int(np.searchsorted(self.returns, time + _SAME_TIME, side='right')) - 1

    def _passes(self, k: int) -> bool:
        """Tell whether the arm moves at the end of a motion."""
        piece = self.segments.primitives[k]
        return self.blend_halves[k] > 0.0 or (isinstance(piece, Spline) and any(piece.velocities))

    def _where(self, k: int) -> str:
        if self.blend_halves[k] > 0.0:
            return 'in the middle of its blend'
        return 'while passing it' if self._passes(k) else 'after stopping there'

    def _at_point(self, k: int) -> float | None:
        """Return when the tool is closest to the end of a motion [s], None where it stops."""
        if not self._passes(k):
            return None
        end, half = float(self.ends[k]), float(self.blend_halves[k])
        target = getattr(self.segments.primitives[k], 'target', None)
        if half <= 0.0 or not isinstance(target, Pose):
            return end
        return self._nearest(np.array(target.position), end - half, end + half, end)

    def _nearest(self, position: Floats, begin: float, end: float, middle: float) -> float:
        """Return when the path is closest to a position; the middle where the tool rests."""
        times, rows = self.reference.time, self.reference.poses
        own = slice(
            max(int(np.searchsorted(times, begin, side='right')) - 1, 0),
            int(np.searchsorted(times, end)) + 1,
        )
        points, t = rows[own, :3], times[own]
        chords = np.diff(points, axis=0)
        square = (chords * chords).sum(axis=1)
        if square.max(initial=0.0) < _MIN_MOTION**2:
            return middle
        along = ((position - points[:-1]) * chords).sum(axis=1) / np.maximum(square, 1e-300)
        u = np.clip(along, 0.0, 1.0)
        k = int(np.argmin(np.linalg.norm(points[:-1] + u[:, None] * chords - position, axis=1)))
        return float(np.clip(t[k] + u[k] * (t[k + 1] - t[k]), begin, end))

    def _at(self, record: SwitchOutput, time: float, read: float) -> SwitchOutput:
        """Return a record with the tool pose at a time as trigger; ``read`` is when it is read."""
        trigger_pose, trigger_direction = self._pose(time), self._trigger_direction(time)
        if trigger_direction is None:
            return record
        start = (trigger_pose.inverse() @ self._pose(read)).rotation_vector()
        beyond = sum(a * b for a, b in zip(start, trigger_direction, strict=True))
        return replace(
            record,
            trigger_pose=trigger_pose,
            trigger_direction=trigger_direction,
            starts_beyond=beyond > _BEYOND,
        )

    def _pose(self, time: float) -> Pose:
        times, rows = self.reference.time, self.reference.poses
        k = min(max(int(np.searchsorted(times, time)), 1), len(times) - 1)
        before, span = float(times[k - 1]), float(times[k] - times[k - 1])
        part = min(max((time - before) / span, 0.0), 1.0) if span > 0.0 else 1.0
        return pose_from_row(rows[k - 1]).interpolate(pose_from_row(rows[k]), part)

    def _trigger_direction(self, time: float) -> Vector6 | None:
        """Return the direction of the path at a time, None where the tool rests or turns back."""
        pose, half = self._pose(time), _DIRECTION_TIME
        while half <= _MAX_DIRECTION_TIME:
            a, b = self._pose(time - half), self._pose(time + half)
            distance, angle = a.distance_to(b), a.angle_to(b)
            if distance < _TURNS_BACK * (a.distance_to(pose) + pose.distance_to(b)):
                return None
            if distance > max(_MIN_MOTION, _TURNING * angle):
                displacement = subtract(b.position, a.position)
                x, y, z = rotate(conjugate(pose.quaternion), displacement)
                return (x / distance, y / distance, z / distance, 0.0, 0.0, 0.0)
            if angle > _MIN_MOTION:
                *_, x, y, z = (a.inverse() @ b).rotation_vector()
                return (0.0, 0.0, 0.0, x / angle, y / angle, z / angle)
            half *= 4.0
        return None
