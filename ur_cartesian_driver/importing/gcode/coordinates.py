# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The position of the tool in the frame of the file, from the coordinates of the program.

A program does not give the start position of the tool, and the machine positions of G28 and G53
are not known here. So the position along an axis is unknown before the first absolute coordinate
of that axis. If increments come first, the position along the axis starts at 0, as in RS274/NGC.
An axis that no line names stays at 0.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

from ur_cartesian_driver.importing.imported_path import BrokenFile, PathCollector

AXES = 'XYZ'
#: Two states of an axis: the position along it is known, or not known yet. A state above 0 is the
#: number of the line that lost the position, see :meth:`Coordinates.lose`.
_KNOWN, _BEGIN = 0, -1


class _Offset(NamedTuple):
    """A length [m] that is added to a coordinate; it is known only if its state is _KNOWN."""

    length: float = 0.0
    state: int = _KNOWN


class Coordinates:
    """Follows the position of the tool through coordinates and offsets [m]."""

    def __init__(self) -> None:
        """Begin at an unknown position."""
        #: The position [m] and the state along each axis, in the order of AXES.
        self.place = [0.0, 0.0, 0.0]
        self.states = [_BEGIN, _BEGIN, _BEGIN]
        #: ``is_away``: the tool has gone to a machine position since the last :meth:`record`;
        #: ``has_changed``: the state of an axis has changed since then.
        self.is_away, self.has_changed = False, True
        #: ``_offsets`` are the present offsets; ``_origin`` are the offsets without G92 and G52.
        self._offsets = self._origin = [_Offset(), _Offset(), _Offset()]
        #: The offsets that G92.2 suspended; empty = none.
        self._suspended: list[_Offset] = []
        #: The code whose offsets are in use: G92 or G52; empty = neither.
        self._preset_by = ''
        self._is_named, self._was_known = [False, False, False], [False, False, False]
        self._counts_from_zero = [False, False, False]
        #: Rows of the path at which states changed, each with the states from that row on.
        self._history: list[tuple[int, Sequence[int]]] = []

    # ---- moves ---------------------------------------------------------------------------------

    def go_to(self, axis: int, coordinate: float) -> None:
        """Move along an axis to a coordinate."""
        offset, state = self._offsets[axis]
        self.place[axis] = coordinate + offset
        if self.states[axis] != state or not self._is_named[axis]:
            self._is_named[axis] = True
            self._set_state(axis, state)

    def go_by(self, axis: int, increment: float) -> None:
        """Move along an axis by an increment."""
        self.place[axis] += increment
        self._is_named[axis] = True
        if self.states[axis] == _BEGIN:
            self._counts_from_zero[axis] = True
            self._set_state(axis, _KNOWN)

    def is_named(self, axis: str) -> bool:
        """Return whether the program has given a coordinate or an increment of an axis."""
        return self._is_named[AXES.index(axis)]

    def absolute(self, axis: int, coordinate: float) -> float:
        """Convert a coordinate of the program to the frame of the file [m]."""
        return coordinate + self._offsets[axis].length

    def lose(self, axes: str, line: int) -> None:
        """Go to a machine position along some axes; their coordinates become unknown."""
        for axis in map(AXES.index, axes):
            self.is_away = True
            self._set_state(axis, line)
            # Homing cancels G92 in Marlin but not in RS274/NGC, so the offset is now unknown.
            if self._preset_by == 'G92' and self._offsets[axis] != self._origin[axis]:
                self._set_offset(axis, _Offset(state=line))

    def _set_state(self, axis: int, state: int) -> None:
        self.states[axis] = state
        self.has_changed = True

    # ---- offsets -------------------------------------------------------------------------------

    def preset(self, line: int, coordinates: Mapping[int, float]) -> str:
        """
        Assign coordinates to the tool's present position (G92).

        :returns: the names of the axes along which the position was not known before.
        :raises BrokenFile: the position along an axis was known earlier in the program, but is
            not known now.
        """
        begun = ''
        for axis, coordinate in coordinates.items():
            if self.states[axis] != _KNOWN and self._was_known[axis]:
                raise BrokenFile(
                    line,
                    f'{AXES[axis]} is set while the position in it is not known, since line '
                    f'{self.states[axis]}; move to a coordinate before',
                )
            if self.states[axis] != _KNOWN:
                # The first coordinate on this axis defines the frame of the file.
                begun += AXES[axis]
                self.place[axis] = coordinate
                self._origin = [*self._origin]
                self._origin[axis] = _Offset(state=line)
                self._is_named[axis] = True
                self._set_state(axis, _KNOWN)
            self._set_offset(axis, _Offset(self.place[axis] - coordinate))
        self._preset_by = 'G92'
        return begun

    def preset_origin(self, line: int, coordinates: Mapping[int, float]) -> None:
        """
        Assign coordinates to the tool's present position, by the work offset (G10 L20).

        :raises BrokenFile: G92 or G52 is in use, or :meth:`preset` refuses the coordinates.
        """
        if self._preset_by:
            raise BrokenFile(line, f'G10 L20 while {self._preset_by} is in use; cancel it before')
        self.preset(line, coordinates)
        self._origin, self._preset_by = self._offsets, ''

    def shift(self, line: int, offsets: Mapping[int, float]) -> None:
        """
        Shift the origin of the coordinates by offsets [m] from the work offset (G52).

        :raises BrokenFile: G92 is in use.
        """
        if self._preset_by == 'G92':
            raise BrokenFile(line, 'G52 while G92 is in use; cancel it before, by G92.1')
        for axis, offset in offsets.items():
            length, state = self._origin[axis]
            self._set_offset(axis, _Offset(length + offset, state))
        self._preset_by = 'G52' if self._offsets != self._origin else ''

    def cancel_preset(self, code: str, line: int) -> None:
        """
        Cancel the offsets of G92 and G52 (G92.1, G92.2), or restore what G92.2 cancelled (G92.3).

        :raises BrokenFile: G92.3 is given, but G92.2 has not suspended any offsets.
        """
        if code == 'G92.3':
            if not self._suspended:
                raise BrokenFile(line, 'G92.3 without G92.2 before, so its offsets are not known')
            self._offsets, self._preset_by = self._suspended, 'G92'
            return
        self._suspended = self._offsets if code == 'G92.2' else []
        self._offsets = [
            offset if offset.state == _KNOWN else _Offset(state=line) for offset in self._origin
        ]
        self._preset_by = ''

    def _set_offset(self, axis: int, offset: _Offset) -> None:
        self._offsets = [*self._offsets]
        self._offsets[axis] = offset

    # ---- rows of the path ----------------------------------------------------------------------

    def start_is_known(self, states_before: Sequence[int]) -> bool:
        """Return whether the last motion's start is known along each axis whose end is known."""
        return self.states == states_before or all(
            before == after or (before == _BEGIN and from_zero)
            for before, after, from_zero in zip(
                states_before, self.states, self._counts_from_zero, strict=True
            )
        )

    def record(self, row: int) -> None:
        """Record that the present states of the axes apply from a row of the path on."""
        self._history.append((row, (*self.states,)))
        for axis, state in enumerate(self.states):
            self._was_known[axis] |= state == _KNOWN
        self.has_changed = self.is_away = False

    def finish(self, into: PathCollector) -> None:
        """Leave out the rows whose position is not known, and add remarks on assumed positions."""
        for axis, name in enumerate(AXES if len(into) else ''):
            if not self._is_named[axis]:
                into.remarks.add(0, f'no {name} in the file', f'{name} is 0')
            elif self._counts_from_zero[axis]:
                into.remarks.add(0, f'{name} begins with an increment', f'it counts from {name} 0')
        for (first, states), (end, _) in pairwise((*self._history, (len(into), ()))):
            missing = [
                axis
                for axis, state in enumerate(states)
                if self._is_named[axis]
                and (state > _KNOWN or (state == _BEGIN and not self._counts_from_zero[axis]))
            ]
            if missing:
                since = max(states[axis] for axis in missing)
                names = ' and '.join(AXES[axis] for axis in missing)
                into.leave_out(
                    range(first, end),
                    'a move',
                    f'the position in {names} is not known '
                    + ('yet' if since == _BEGIN else f'since line {since}'),
                )
