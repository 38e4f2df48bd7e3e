# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
A plan: primitives, the reference path of the tool, and a report of the planner's choices.

A primitive is one motion or rest of the robot. A time *at full speed* is the expected time if the
robot's speed slider is at 100 %. The package ``planning`` makes a plan after all checks have
passed. Plans are immutable.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cache
from typing import Any, NamedTuple, overload

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Floats, Indices, Int32s
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, Pose
from ur_cartesian_driver.motion.geometry.pose_rows import keep_hemisphere
from ur_cartesian_driver.motion.geometry.vectors import Joints, vector6
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import Goal
from ur_cartesian_driver.motion.goal.goal_columns import Rows, zeros
from ur_cartesian_driver.motion.goal.joint_goal import JointTolerances
from ur_cartesian_driver.motion.plan.joint_spline import JointSpline
from ur_cartesian_driver.motion.plan.move_rows import classes, SplineRows
from ur_cartesian_driver.motion.plan.offset_band import OffsetBand
from ur_cartesian_driver.motion.plan.primitive import (
    Instruction,
    OutputRecord,
    Primitive,
    Spline,
    still_spline,
    Stop,
    Wait,
)
from ur_cartesian_driver.motion.plan.slow_stretch import SlowStretch


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ReferencePath:
    """
    The planned path of the TCP in the robot's base, as samples that are joined by straight lines.

    If the arm holds a part, it is the path of the fixed tool in the frame of the part. A straight
    segment needs only its ends; arcs, joint moves and blends are sampled finely enough that the
    chords stay within a few micrometres of the curve. Row 0 is the start.
    """

    #: (m, 7) x y z [m], unit quaternion x y z w.
    poses: Floats
    #: (m,) index of the point at the end of the segment on which the sample lies.
    point: Int32s
    #: (m,) expected time from the start of the motion [s] at full speed, not decreasing.
    time: Floats
    #: (m, 2) largest distance [m] and angle [rad] of the sample from the robot's actual blend, as
    #: UR publishes the size of blends but not their shape; 0 outside blends. Empty = 0 everywhere.
    blend_tolerance: Floats = field(default_factory=lambda: np.empty((0, 2)))
    #: (m,) fraction of the segment that lies before the sample, as in :class:`~.events.PathPlace`.
    #: Empty = 0 everywhere.
    fraction: Floats = field(default_factory=lambda: np.empty(0))

    def __post_init__(self) -> None:
        """Check the shapes and make the arrays read-only."""
        m = len(self.poses)
        if not len(self.blend_tolerance):
            object.__setattr__(self, 'blend_tolerance', np.zeros((m, 2)))
        if not len(self.fraction):
            object.__setattr__(self, 'fraction', np.zeros(m))
        arrays = (self.poses, self.point, self.time, self.blend_tolerance, self.fraction)
        if [array.shape for array in arrays] != [(m, 7), (m,), (m,), (m, 2), (m,)]:
            raise ValueError(
                'reference path shapes differ: ' + ', '.join(str(array.shape) for array in arrays)
            )
        for array in arrays:
            array.setflags(write=False)

    def since(self, time: float) -> ReferencePath:
        """Return the path from a time [s] on, as a copy, so that the whole path can be freed."""
        row = max(int(np.searchsorted(self.time, time, side='right')) - 1, 0)
        return ReferencePath(**{k: column[row:].copy() for k, column in self._columns().items()})

    def __add__(self, other: ReferencePath) -> ReferencePath:
        """Return this path, followed by one that begins at its end."""
        columns = {
            name: np.concatenate([column, getattr(other, name)[1:]])
            for name, column in self._columns().items()
        }
        keep_hemisphere(columns['poses'])
        return ReferencePath(**columns)

    def _columns(self) -> dict[str, Any]:
        return {each.name: getattr(self, each.name) for each in fields(self)}


class BlendEntry(NamedTuple):
    """
    The state of the controller at the beginning of the blend after a segment.

    The parameter of a blend runs from 0 at its beginning to 1 at its end.
    """

    #: The rate of the parameter [1/s].
    rate: float
    #: Time until the arm would come to rest at the segment's point if there were no blend [s].
    remaining: float
    #: Acceleration of the segment, as an acceleration of the parameter [1/s^2].
    acceleration: float
    #: Length of the segment in units of the parameter, if it is sent with a time.
    length: float
    #: Time from the beginning of the blend to its middle, where the point is passed [s].
    half: float


#: Greatest number of segments and slow stretches that have a line in a short report; number of
#: lines that are made at a time.
MAX_REPORT_LINES, _LINES_AT_ONCE = 10_000, 1000
_NO_BLEND = BlendEntry(0.0, 0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedSegment:
    """One primitive, with the path and the time that are expected of it."""

    primitive: Primitive
    #: Index of the waypoint at the end of the primitive.
    waypoint: int
    #: Length of the tool's path from waypoint to waypoint [m].
    length: float
    #: Turn of the tool from waypoint to waypoint [rad].
    angle: float
    #: Expected time at full speed [s].
    duration: float
    #: Joint positions predicted at the end of the primitive [rad].
    joints: Joints
    #: The line of the report; empty if another piece of the same segment has the line (a SPLINE
    #: can have several pieces between two points).
    report_line: str
    #: The state at the beginning of the next blend; None = there is no blend, or it is not known.
    blend_entry: BlendEntry | None = None
    #: The instructions for outputs that are sent to the robot after the primitive, in this order.
    outputs: tuple[OutputRecord, ...] = ()


class LateLines(Sequence[str]):
    """Lines of a report, made only when they are read, because long goals have many."""

    def __init__(self, rows: range, make: Callable[[range], Sequence[str]]) -> None:
        """
        Store the function that makes the lines.

        :param rows: the row of each line.
        :param make: returns the lines of a part of these rows, in order.
        """
        self._rows, self._make = rows, make

    @classmethod
    def at_once(cls, count: int, make: Callable[[], Sequence[str]]) -> LateLines:
        """Return lines that are all made when any of them is first read."""
        lines = cache(make)
        return cls(range(count), lambda rows: lines()[rows.start : rows.stop])

    def __add__(self, other: Sequence[str]) -> LateLines:
        """Return these lines, followed by others."""
        return LateLines.at_once(len(self) + len(other), lambda: [*self, *other])

    def __len__(self) -> int:
        """Return the number of lines."""
        return len(self._rows)

    def __iter__(self) -> Iterator[str]:
        """Make the lines block by block."""
        for first in range(0, len(self), _LINES_AT_ONCE):
            yield from self._make(self._rows[first : first + _LINES_AT_ONCE])

    @overload
    def __getitem__(self, index: int) -> str: ...

    @overload
    def __getitem__(self, index: slice) -> LateLines: ...

    def __getitem__(self, index: int | slice) -> str | LateLines:
        """Return a line; or a slice of the lines (with a step of 1), which are not made yet."""
        if isinstance(index, slice):
            return LateLines(self._rows[index], self._make)
        row = self._rows[index]
        return self._make(range(row, row + 1))[0]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class PlannedRows(Rows[PlannedSegment]):
    """The segments of a plan in columns, with the units of :class:`PlannedSegment`."""

    #: (n,), like the next three columns
    waypoints: Int32s
    lengths: Floats
    angles: Floats
    durations: Floats
    #: (n, 5) the blend entries; a row of zeros = there is no entry.
    blend_entries: Floats
    #: (n, 6)
    joints: Floats
    primitives: Sequence[Primitive]
    #: Lines of the report, without the notes.
    report_lines: Sequence[str]
    #: Texts about outputs and stops that are appended to lines of the report, by row.
    notes: Mapping[int, str] = field(default_factory=dict)
    #: The instructions for outputs that are sent after the primitive of a row, by row.
    outputs: Mapping[int, tuple[OutputRecord, ...]] = field(default_factory=dict)

    @classmethod
    def of(cls, segments: Iterable[PlannedSegment]) -> PlannedRows:
        """Return segments as rows; rows are returned unchanged."""
        if isinstance(segments, cls):
            return segments
        every = tuple(segments)
        return cls(
            waypoints=np.array([segment.waypoint for segment in every], dtype=np.int32),
            lengths=np.array([segment.length for segment in every], dtype=np.float64),
            angles=np.array([segment.angle for segment in every], dtype=np.float64),
            durations=np.array([segment.duration for segment in every], dtype=np.float64),
            blend_entries=np.array(
                [segment.blend_entry or _NO_BLEND for segment in every]
            ).reshape(len(every), 5),
            joints=np.array([segment.joints for segment in every]).reshape(len(every), 6),
            primitives=tuple(segment.primitive for segment in every),
            report_lines=tuple(segment.report_line for segment in every),
            outputs={i: segment.outputs for i, segment in enumerate(every) if segment.outputs},
        )

    @property
    def are_spline(self) -> bool:
        """Whether the motions are pieces of a spline, not the controller's own motions."""
        moves = (each for each in self.primitives if not isinstance(each, Stop))
        return isinstance(next(moves, None), Spline)

    @classmethod
    def of_pieces(
        cls,
        pieces: SplineRows,
        waypoints: Int32s,
        lengths: Floats,
        angles: Floats,
        report_lines: Sequence[str],
    ) -> PlannedRows:
        """Return pieces of a spline as rows; the other parameters are columns of the rows."""
        return cls(
            waypoints=waypoints,
            lengths=lengths,
            angles=angles,
            durations=pieces.durations,
            blend_entries=zeros(len(pieces), 5),
            joints=pieces.targets,
            primitives=pieces,
            report_lines=report_lines,
        )

    @property
    def records(self) -> Indices:
        """(n,) number of instructions that are sent for each row: its primitive and outputs."""
        counts = np.ones(len(self), dtype=np.intp)
        for row, outputs in self.outputs.items():
            counts[row] += len(outputs)
        return counts

    @property
    def kinds(self) -> dict[int, str]:
        """
        The class name of the motion to each point, by point index.

        A point that is passed within a motion has the class of that motion; the point at the end
        of a travel has the class of the travel's last motion.
        """
        found: dict[int, str] = {}
        passed = 0
        for waypoint, kind in zip(self.waypoints.tolist(), classes(self.primitives), strict=True):
            if not issubclass(kind, Stop):
                found |= dict.fromkeys(range(min(passed, waypoint), waypoint + 1), kind.__name__)
                passed = waypoint + 1
        return found

    def __len__(self) -> int:
        return len(self.waypoints)

    def __iter__(self) -> Iterator[PlannedSegment]:
        numbers = self._numbers(
            'waypoints', 'lengths', 'angles', 'durations', 'blend_entries', 'joints'
        )
        for i, ((waypoint, length, angle, duration, entry, joints), primitive, line) in enumerate(
            zip(numbers, self.primitives, self.report_lines, strict=True)
        ):
            yield PlannedSegment(
                primitive=primitive,
                waypoint=waypoint,
                length=length,
                angle=angle,
                duration=duration,
                blend_entry=BlendEntry(*entry) if entry[0] > 0.0 else None,
                joints=vector6(joints),
                report_line=line + self.notes.get(i, ''),
                outputs=self.outputs.get(i, ()),
            )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Plan:
    """A goal that passed all checks, ready to be executed from the state it was planned for."""

    goal: Goal
    segments: Sequence[PlannedSegment]
    reference: ReferencePath
    #: Joint positions at the start [rad].
    start: Joints
    #: The active TCP of the robot at the time of planning.
    T_flange_active: Pose = IDENTITY
    #: The temporary TCP, which the robot has only during the motion; None = the active TCP stays.
    T_flange_tcp: Pose | None = None
    #: Pose of the controlled frame in the TCP that the robot has during the motion: IDENTITY,
    #: unless the TCP must not change.
    T_tcp_controlled: Pose = IDENTITY
    #: The version of the older robot program that the plan is for; '' = the driver's own program.
    older_program: str = ''
    #: The execution mode: PRIMITIVES, SPLINE or SERVO.
    execution: ExecutionMode = ExecutionMode.PRIMITIVES
    #: The band of path offsets; None = offsets are not allowed.
    offset_band: OffsetBand | None = None
    #: The tolerances of a joint goal; None if the goal is Cartesian.
    joint_tolerances: JointTolerances | None = None
    #: The requested goal, if the plan begins with a travel (a motion through the air to the first
    #: point); it is planned again if the arm has been moved before the motion starts.
    travelled_goal: Goal | None = None
    #: Lines of the report about ignored, slowed or changed requests, or about the whole goal.
    remarks: tuple[str, ...] = field(default=())
    #: Finds the slow stretches; called only on demand, because long goals have many.
    find_slow_stretches: Callable[[], Sequence[SlowStretch]] = field(default=tuple)

    @property
    def duration(self) -> float:
        """Expected time of the whole motion at full speed [s]."""
        return float(np.cumsum(self.rows.durations)[-1]) if self.segments else 0.0

    @property
    def rows(self) -> PlannedRows:
        """The segments in columns."""
        return PlannedRows.of(self.segments)

    @property
    def report(self) -> tuple[str, ...]:
        """One line for each segment, the remarks, and one line for each slow stretch."""
        stretches = self.find_slow_stretches()
        return (
            *self._segment_lines(range(len(self.segments))),
            *self.remarks,
            *(stretch.line for stretch in stretches),
        )

    def short_report(self, limit: int = MAX_REPORT_LINES) -> tuple[str, ...]:
        """
        Return the report, with all remarks; if it is long, the first and last segments only.

        :param limit: greatest number of segments and slow stretches that have lines.
        """
        count, stretches = len(self.segments), self.find_slow_stretches()
        if count + len(stretches) <= limit:
            return self.report
        half = limit // 2
        first = range(min(half, count))
        shown = stretches[:half]
        end = range(max(len(first), count + len(shown) - half), count)
        segments, left_out = count - len(first) - len(end), len(stretches) - len(shown)
        return (
            *self._segment_lines(first),
            *([f'(segments left out here: {segments})'] if segments else []),
            *self._segment_lines(end),
            *self.remarks,
            *(stretch.line for stretch in shown),
            *([f'(slow stretches left out here: {left_out})'] if left_out else []),
        )

    def _segment_lines(self, rows: range) -> tuple[str, ...]:
        planned = self.rows
        lines = planned.report_lines[rows.start : rows.stop]
        # A piece that passes several points has a line for each.
        return tuple(
            line
            for row, lines in zip(rows, lines, strict=True)
            for line in (lines + planned.notes.get(row, '')).split('\n')
            if line
        )

    @property
    def joint_spline(self) -> JointSpline:
        """The joints over time, rests included, for a plan whose motions are all splines."""
        pieces: list[Spline] = []
        primitives = self.rows.primitives
        if isinstance(primitives, SplineRows):
            return JointSpline.of(self.start, primitives)
        for primitive in primitives:
            if isinstance(primitive, Spline):
                pieces.append(primitive)
            elif isinstance(primitive, Wait):  # a rest follows a motion
                pieces.append(still_spline(pieces[-1], primitive.duration))
        return JointSpline.of(self.start, pieces)

    @property
    def instructions(self) -> Iterator[Instruction]:
        """The primitives and the instructions for outputs, in the order in which they are sent."""
        rows = self.rows
        for i, primitive in enumerate(rows.primitives):
            yield primitive
            yield from rows.outputs.get(i, ())
