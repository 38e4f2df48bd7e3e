# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The contents of an imported file, before the options of the import are applied.

Each point keeps its line of the file, so that remarks and errors can name the line.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import nan

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats, Int64s
from ur_cartesian_driver.motion.geometry.vectors import Vector3
from ur_cartesian_driver.motion.goal.goal import (
    ArcMode,
    InputWait,
    IOCommand,
    Posture,
    SegmentType,
)

#: The optional columns of a point, and the number of values in each.
_OPTIONAL = {
    'vias': 3,
    'quaternions': 4,
    'normals': 3,
    'speeds': 1,
    'accelerations': 1,
    'blends': 1,
    'corners': 1,
    'times': 1,
    'dwells': 1,
}
#: Largest accepted distance [m] of a point from the origin; no arm reaches so far. A larger
#: distance means, for example, that millimetres were read as metres.
MAX_DISTANCE = 20.0
JOINTS_HAVE_NO_FRAME = 'joint positions have no frame; give no frame, tool, origin or scale'
UNKNOWN3: Vector3 = (nan, nan, nan)
#: The types of motions whose speed an option of the import can set.
TYPES_WITH_SPEED = (SegmentType.LINEAR, SegmentType.CIRCULAR, SegmentType.PROCESS)
#: Two points are the same if they are less than this distance [m] apart and their orientations
#: differ by less than this angle [rad].
SAME_POINT, SAME_TURN = 5e-6, 1e-4


class BrokenFile(ValueError):
    """A file cannot be read; the message names the line at fault."""

    def __init__(self, line: int, text: str, unit: str = 'line') -> None:
        """
        Put the line before the text of the message.

        :param line: the line at fault; 0 = no particular line.
        :param text: a sentence without a full stop.
        :param unit: the word for the parts that ``line`` numbers, if the file has no lines.
        """
        super().__init__(f'{unit} {line}: {text}.' if line else f'{text}.')
        self.line = line


@dataclass(frozen=True, slots=True, kw_only=True)
class ImportNote:
    """A remark that something in a file was left out, or was converted to another form."""

    #: 1-based lines, in rising order; empty = the note concerns the whole file.
    lines: tuple[int, ...]
    what: str
    why: str

    def text(self, max_ranges: int = 8) -> str:
        """
        Return one line of text.

        :param max_ranges: the number of line ranges to name; the remaining lines are only counted.
        """
        if not self.lines:
            return f'{self.what}: {self.why}'
        ranges = list(_ranges(self.lines))
        named = ', '.join(
            f'{first}' if first == last else f'{first}-{last}'
            for first, last in ranges[:max_ranges]
        )
        rest = sum(1 for line in self.lines if line > ranges[:max_ranges][-1][1])
        plural = 's' if len(self.lines) > 1 else ''
        more = f' and {rest} more' if rest else ''
        return f'line{plural} {named}{more}: {self.what}: {self.why}'


def _ranges(lines: Sequence[int]) -> Iterator[tuple[int, int]]:
    first = last = lines[0]
    for line in lines[1:]:
        if line > last + 1:
            yield first, last
            first = line
        last = line
    yield first, last


class ImportNotes:
    """Collects remarks; equal remarks are merged into one with all their lines."""

    def __init__(self) -> None:
        """Begin with no remarks."""
        self._lines: dict[tuple[str, str], set[int]] = {}

    def add(self, line: int, what: str, why: str) -> None:
        """Add a remark on a line; line 0 = the remark concerns the whole file."""
        lines = self._lines.setdefault((what, why), set())
        if line:
            lines.add(line)

    def result(self) -> tuple[ImportNote, ...]:
        """Return the remarks in the order of their first occurrence."""
        return tuple(
            ImportNote(lines=tuple(sorted(lines)), what=what, why=why)
            for (what, why), lines in self._lines.items()
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ImportedPath:
    """
    Points in columns, n rows [m, m/s, s]; NaN = the file has no value.

    The motion described by a row ends at the point in this row.
    """

    positions: Floats
    #: (n,) 1-based lines of the file; 0 = unknown.
    lines: Int64s
    #: (n,) numbers of :class:`~ur_cartesian_driver.motion.goal.goal.SegmentType`.
    types: Int64s
    #: (n,) whether the motion only brings the tool to the point, without work on the way.
    travels: Flags
    #: (n,) whether the tool has to be lifted for the motion.
    lifts: Flags
    #: (n,) numbers of :class:`~ur_cartesian_driver.motion.goal.goal.ArcMode`.
    arc_modes: Int64s
    #: (n, 3) a point on each arc.
    vias: Floats
    #: (n, 4) unit quaternions of the tool.
    quaternions: Floats
    #: (n, 3) normals of the surface.
    normals: Floats
    #: (n,), like all columns up to ``dwells``.
    speeds: Floats
    accelerations: Floats
    blends: Floats
    #: Largest distance of the path from the corner at the point; 0 = the arm stops there.
    corners: Floats
    times: Floats
    #: (n,) time for which the arm rests at the row's point.
    dwells: Floats
    #: The postures that the file gives, by row.
    postures: Mapping[int, Posture] = field(default_factory=dict)
    outputs: tuple[IOCommand, ...] = ()
    waits: tuple[InputWait, ...] = ()
    frame: str = ''

    def __len__(self) -> int:
        """Return the number of points."""
        return len(self.positions)

    @property
    def rests(self) -> Flags:
        """Flags (n,) of the points at which the arm rests for a time, or waits for an input."""
        found = self.dwells > 0.0
        found[[wait.waypoint for wait in self.waits]] = True
        return found

    @property
    def is_rounded(self) -> bool:
        """Whether any corner of the path is rounded."""
        return bool((self.corners > 0.0).any())

    def take(self, rows: Int64s) -> ImportedPath:
        """
        Return the path with only the given rows.

        Outputs at a removed row move to the last kept row before it.

        :param rows: (m,) rising row indices, which must include every row with a wait.
        """
        new_row = {int(row): i for i, row in enumerate(rows)}
        return replace(
            self,
            **{name: getattr(self, name)[rows] for name in COLUMNS},
            postures={new_row[row]: p for row, p in self.postures.items() if row in new_row},
            outputs=tuple(
                replace(
                    output,
                    waypoint=max(0, int(np.searchsorted(rows, output.waypoint, side='right')) - 1),
                )
                for output in self.outputs
            ),
            waits=tuple(replace(wait, waypoint=new_row[wait.waypoint]) for wait in self.waits),
        )


#: The names of all columns.
COLUMNS = (
    *('positions', 'lines', 'types', 'travels', 'lifts', 'arc_modes'),
    *_OPTIONAL,
)


class PathCollector:
    """Collects the points of a file."""

    def __init__(self) -> None:
        """Begin without points."""
        self._positions: list[Sequence[float]] = []
        self._plain: list[tuple[int, int, bool, bool, int]] = []
        self._optional: dict[str, dict[int, float | Sequence[float]]] = {
            name: {} for name in _OPTIONAL
        }
        self._postures: dict[int, Posture] = {}
        self._outputs: list[IOCommand] = []
        self._left_out: set[int] = set()
        self._waits: list[InputWait] = []
        self.remarks = ImportNotes()
        self.frame = ''

    def __len__(self) -> int:
        """Return the number of points so far."""
        return len(self._positions)

    def add(
        self,
        line: int,
        position: Sequence[float],
        kind: SegmentType = SegmentType.LINEAR,
        *,
        travel: bool = False,
        lift: bool = False,
        arc_mode: ArcMode = ArcMode.UNCONSTRAINED,
        posture: Posture | None = None,
        via: Sequence[float] | None = None,
        quaternion: Sequence[float] | None = None,
        normal: Sequence[float] | None = None,
        speed: float | None = None,
        acceleration: float | None = None,
        blend: float | None = None,
        corner: float | None = None,
        time: float | None = None,
        dwell: float | None = None,
    ) -> None:
        """Add a point; its fields are named as in :class:`ImportedPath`, None = unknown."""
        row = len(self._positions)
        self._positions.append(position)
        self._plain.append((line, kind, travel, lift, arc_mode))
        for name, value in (
            ('vias', via),
            ('quaternions', quaternion),
            ('normals', normal),
            ('speeds', speed),
            ('accelerations', acceleration),
            ('blends', blend),
            ('corners', corner),
            ('times', time),
            ('dwells', dwell),
        ):
            if value is not None:
                self._optional[name][row] = value
        if posture:
            self._postures[row] = posture

    def add_lines(
        self, lines: Sequence[int], positions: Floats, **optional: Floats | None
    ) -> None:
        """Add points joined by lines, in columns as in :class:`ImportedPath`; None = unknown."""
        row = len(self._positions)
        self._positions.extend(positions.tolist())
        plain = (SegmentType.LINEAR, False, False, ArcMode.UNCONSTRAINED)
        self._plain.extend((line, *plain) for line in lines)
        for name, values in optional.items():
            if values is not None:
                self._optional[name].update(enumerate(values.tolist(), row))

    def switch(self, output: IOCommand) -> None:
        """Switch an output at the newest point; if there is none yet, at the first one."""
        self._outputs.append(replace(output, waypoint=max(0, len(self) - 1)))

    def leave_out(self, rows: range, what: str, why: str) -> None:
        """Remove added points, with a remark; the tool is lifted before the next point."""
        self._left_out.update(rows)
        for row in rows:
            self.remarks.add(self._plain[row][0], what, why)

    def wait(self, wait: InputWait) -> None:
        """Wait for an input at the newest point."""
        self._waits.append(replace(wait, waypoint=len(self) - 1))

    def path(self) -> ImportedPath:
        """
        Return the collected points.

        :raises BrokenFile: there are no points.
        """
        kept = [row for row in range(len(self)) if row not in self._left_out]
        if not kept:
            remarks = [remark.text() for remark in self.remarks.result()]
            left_out = f'; left out: {"; ".join(remarks)}' if remarks else ''
            raise BrokenFile(0, f'there is no point of a path in the file{left_out}')
        plain = np.array(self._plain, dtype=np.int64)
        path = ImportedPath(
            positions=np.array(self._positions, dtype=np.float64),
            lines=plain[:, 0],
            types=plain[:, 1],
            travels=plain[:, 2] > 0,
            lifts=plain[:, 3] > 0,
            arc_modes=plain[:, 4],
            **{name: self._column(name) for name in _OPTIONAL},
            postures=self._postures,
            outputs=tuple(self._outputs),
            waits=tuple(self._waits),
            frame=self.frame,
        )
        if not self._left_out:
            return path
        path = path.take(np.array(kept, dtype=np.int64))
        gaps = np.diff(kept, prepend=kept[0] - 1) > 1
        return replace(path, travels=path.travels | gaps, lifts=path.lifts | gaps)

    def _column(self, name: str) -> Floats:
        width, given = _OPTIONAL[name], self._optional[name]
        column = np.full((len(self), width), nan)
        if given:
            values = np.array(list(given.values()), dtype=np.float64)
            column[list(given)] = values.reshape(len(given), width)
        return column[:, 0] if width == 1 else column
