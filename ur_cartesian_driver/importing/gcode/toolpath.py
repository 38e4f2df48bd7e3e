# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The motions of a program: its modal state, and the points to which lines and arcs lead."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ur_cartesian_driver.importing.gcode.arcs import arc_between, ArcPlane, PLANES
from ur_cartesian_driver.importing.gcode.coordinates import AXES, Coordinates
from ur_cartesian_driver.importing.import_options import ImportOptions, LENGTH_UNITS
from ur_cartesian_driver.importing.imported_path import BrokenFile, PathCollector
from ur_cartesian_driver.motion.geometry.vectors import Vector3
from ur_cartesian_driver.motion.goal.goal import SegmentType

_MAX_TURNS = 1000


class Toolpath:
    """Collects the points of motions, in the modes that the codes set."""

    def __init__(self, options: ImportOptions, into: PathCollector) -> None:
        """Begin in the modes of RS274/NGC, at an unknown position."""
        self._options, self._into = options, into
        self.coordinates = Coordinates()
        #: The motion code in effect, G0 to G3, or G80 (no motion); empty = none has been given.
        self.motion = ''
        #: The code of the plane, G17 to G19; empty = none has been given, so G17 applies.
        self.plane = ''
        self.relative, self.relative_centre = False, True
        #: The unit of lengths [m]; None = not given yet.
        self.unit = LENGTH_UNITS.get(options.unit)
        #: The feed [m/s]; None = not given, or given per turn of a spindle.
        self.feed: float | None = None
        #: Factor on X: 0.5 if X is a diameter (G7), 1 if it is a radius (G8); None = not given.
        self.share_of_x: float | None = None
        self._has_begun = False
        #: Distance by which the tool may miss a corner, in ``_corner_unit``; 0 = the tool stops at
        #: the corner, None = as the options say.
        self._corner: float | None = None
        #: The unit of ``_corner`` [m]; None = the first unit in the file.
        self._corner_unit: float | None = None

    def length(self, line: int) -> float:
        """Return the unit of lengths [m]; if none has been given, it is mm, with a remark."""
        if self.unit is None:
            self.unit = LENGTH_UNITS['mm']
            self._into.remarks.add(line, 'no G20 or G21 before', 'lengths are in mm')
        return self.unit

    def lengths(self, line: int, words: Mapping[str, float]) -> dict[int, float]:
        """Return the coordinates [m] among some words, by axis."""
        share = self.share_of_x or 1.0
        return {
            axis: words[name] * self.length(line) * (share if axis == 0 else 1.0)
            for axis, name in enumerate(AXES)
            if name in words
        }

    def set_corner(self, number: float | None) -> None:
        """
        Set the distance by which the tool may miss the following corners.

        :param number: the distance in the unit of lengths; 0 = the tool stops at each corner,
            None = as the options say.
        """
        self._corner, self._corner_unit = number, self.unit

    def _corner_at(self, line: int) -> float | None:
        """Return the distance [m] by which the tool may miss the corner; None = as in options."""
        if not self._corner:
            return self._corner
        if self._corner_unit is None:
            self._corner_unit = self.length(line)
        return self._corner * self._corner_unit

    def move(self, line: int, words: Mapping[str, float]) -> None:
        """
        Carry out a motion.

        :param words: coordinates, and the centre or radius of an arc.
        :raises BrokenFile: the words do not describe a motion, or do not suit the motion code.
        """
        if self.motion == 'G80':
            raise BrokenFile(line, 'coordinates without G0, G1, G2 or G3 since G80')
        if not self.motion:
            self.motion = 'G0'
            self._into.remarks.add(line, 'no G0 to G3 before', 'a line, as after power-up')
        where = self.coordinates
        start, known_before = where.place[:], where.states[:]
        go = where.go_by if self.relative else where.go_to
        unit, count = self.unit or self.length(line), 0
        for axis, name in enumerate(AXES):
            if name in words:
                count += 1
                go(axis, words[name] * (unit if axis else unit * (self.share_of_x or 1.0)))
        is_arc = self.motion in ('G2', 'G3')
        if is_arc or not self._has_begun:
            is_known = where.start_is_known(known_before)
            if is_known and not self._has_begun:
                where.record(0)
                self._into.add(line, start, travel=True, corner=self._corner_at(line))
            self._has_begun = True
            if is_arc:
                self._arc(line, start if is_known else None, words)
                return
        if count < len(words):
            extra = ' and '.join(name for name in words if name not in AXES)
            raise BrokenFile(line, f'{self.motion} is a line, and has no {extra}')
        self._add(line, where.place[:])

    def _add(
        self,
        line: int,
        place: Sequence[float],
        kind: SegmentType = SegmentType.LINEAR,
        via: Vector3 | None = None,
    ) -> None:
        where = self.coordinates
        is_travel = self.motion == 'G0' or where.is_away
        if not is_travel and self.feed is None and self._options.speed is None:
            self._into.remarks.add(line, f'{self.motion} without F', "its speed is the driver's")
        lift = where.is_away
        if where.has_changed:
            where.record(len(self._into))
        self._into.add(
            line,
            place,
            kind,
            travel=is_travel,
            lift=lift,
            via=via,
            speed=None if is_travel else self.feed,
            corner=self._corner_at(line),
        )

    def _arc(self, line: int, start: Sequence[float] | None, words: Mapping[str, float]) -> None:
        end = self.coordinates.place[:]
        if start is None:
            self._into.remarks.add(
                line, f'{self.motion} from an unknown place', 'only its end is taken'
            )
            self._add(line, end)
            return
        plane, turns = PLANES[self.plane or 'G17'], words.get('P', 1.0)
        direction = -1 if self.motion == 'G2' else 1
        try:
            if turns % 1.0 or not 1.0 <= turns <= _MAX_TURNS:
                raise ValueError(
                    f'P{turns:g} of an arc is no whole number of turns up to {_MAX_TURNS}'
                )
            centre = self._centre(line, plane, start, words)
            arc = arc_between(plane, start, end, centre, direction, int(turns))
            # The scale is applied later, and the tolerance is meant for the scaled path.
            tolerance = self._options.tolerance / abs(self._options.scale)
            lines = arc.lines(tolerance) if arc.rises else []
        except ValueError as error:
            raise BrokenFile(line, str(error)) from None
        if 'P' in words:
            self._into.remarks.add(
                line, 'P of an arc', 'turns in all, as in LinuxCNC; Marlin adds them to the arc'
            )
        if lines:
            self._into.remarks.add(
                line, f'{self.motion} with a rise', f'a helix, made of {len(lines)} lines'
            )
            for place in lines:
                self._add(line, place)
            return
        for via, place in arc.arcs():
            self._add(line, place, SegmentType.CIRCULAR, via)

    def _centre(
        self, line: int, plane: ArcPlane, start: Sequence[float], words: Mapping[str, float]
    ) -> tuple[float, float] | float:
        """
        Return the centre of an arc, or else its radius, depending on the words of the line.

        :raises ValueError: the words are incomplete, or contradict each other.
        """
        if not self.plane and 'Z' in words and 'Y' not in words and 'J' not in words:
            raise ValueError('an arc along X and Z needs G17 or G18 before, which say its plane')
        first, second, third = plane.letters
        u, v = words.get(first), words.get(second)
        if words.get(third):
            raise ValueError(f'an arc in {plane.name} has no {third}')
        unit = self.length(line)
        if 'R' in words:
            if u is not None or v is not None:
                raise ValueError(f'an arc has {first} and {second}, or R, and not both')
            return words['R'] * unit
        if (u is None and v is None) or ((u is None or v is None) and not self.relative_centre):
            raise ValueError(f'the arc needs {first} and {second}, or R')
        x, y, (a, b, _) = (u or 0.0) * unit, (v or 0.0) * unit, plane.axes
        if self.relative_centre:
            return start[a] + x, start[b] + y
        return self.coordinates.absolute(a, x), self.coordinates.absolute(b, y)
