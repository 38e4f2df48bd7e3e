# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The place of the tool in the frame of the file, from the coordinates of the program.

A program does not say where the tool is when it begins, and the places of a machine (G28, G53)
are not known here. So an axis is known from its first absolute coordinate on. An axis that begins
with increments begins at 0, as in RS274/NGC; an axis that no line names stays at 0.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

from ur_cartesian_driver.importing.imported_path import BrokenFile, PathCollector

AXES = 'XYZ'
#: The states of an axis; a state above 0 is the line that made its place unknown.
_KNOWN, _BEGIN = 0, -1


class _Offset(NamedTuple):
    """A length that is added to a coordinate [m]; it is unknown unless its state is _KNOWN."""

    length: float = 0.0
    state: int = _KNOWN


class Coordinates:
    """Follows the tool through coordinates and offsets [m]."""

    def __init__(self) -> None:
        """Begin at an unknown place."""
        self.place = [0.0, 0.0, 0.0]
        self.states = [_BEGIN, _BEGIN, _BEGIN]
        #: Flags since the last point: the tool went to a place of the machine; states changed.
        self.is_away, self.has_changed = False, True
        #: The present offsets, the offsets without G92 and G52, and those that G92.2 suspended.
        self._offsets = self._origin = [_Offset(), _Offset(), _Offset()]
        self._suspended: list[_Offset] = []
        #: The code whose offsets are in use, G92 or G52; empty = neither.
        self._preset_by = ''
        self._is_named, self._was_known = [False, False, False], [False, False, False]
        self._counts_from_zero = [False, False, False]
        #: Rows of the path, and the states of the axes from each of these rows on.
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
        """Return whether the program has given a coordinate on an axis."""
        return self._is_named[AXES.index(axis)]

    def absolute(self, axis: int, coordinate: float) -> float:
        """Return a coordinate in the frame of the file."""
        return coordinate + self._offsets[axis].length

    def lose(self, axes: str, line: int) -> None:
        """Go to a place of the machine along some axes; their coordinates become unknown."""
        for axis in map(AXES.index, axes):
            self.is_away = True
            self._set_state(axis, line)
            # Homing ends G92 in Marlin, but not in RS274/NGC.
            if self._preset_by == 'G92' and self._offsets[axis] != self._origin[axis]:
                self._set_offset(axis, _Offset(state=line))

    def _set_state(self, axis: int, state: int) -> None:
        self.states[axis] = state
        self.has_changed = True

    # ---- offsets -------------------------------------------------------------------------------

    def preset(self, line: int, coordinates: Mapping[int, float]) -> str:
        """
        Set the coordinates of the present place of the tool (G92).

        :returns: the axes along which the place was not known before.
        :raises BrokenFile: the place was known earlier in the program, but is not now.
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
        Set the coordinates of the present place of the tool for good (G10 L20).

        :raises BrokenFile: G92 or G52 is in use, or as for :meth:`preset`.
        """
        if self._preset_by:
            raise BrokenFile(line, f'G10 L20 while {self._preset_by} is in use; cancel it before')
        self.preset(line, coordinates)
        self._origin, self._preset_by = self._offsets, ''

    def shift(self, line: int, offsets: Mapping[int, float]) -> None:
        """
        Move the origin of coordinates (G52).

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
        End G92 and G52 (G92.1, G92.2), or restore the offsets that G92.2 suspended (G92.3).

        :raises BrokenFile: there are no suspended offsets.
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
        """Return whether the axes known after the last motion were also known at its start."""
        return self.states == states_before or all(
            before == after or (before == _BEGIN and from_zero)
            for before, after, from_zero in zip(
                states_before, self.states, self._counts_from_zero, strict=True
            )
        )

    def record(self, row: int) -> None:
        """Remember the present states of the axes, from a row of the path on."""
        self._history.append((row, (*self.states,)))
        for axis, state in enumerate(self.states):
            self._was_known[axis] |= state == _KNOWN
        self.has_changed = self.is_away = False

    def finish(self, into: PathCollector) -> None:
        """Leave out the rows whose place is not known, and add remarks on the assumptions."""
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
