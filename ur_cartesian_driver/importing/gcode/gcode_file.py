# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
G-code of CAM systems, laser cutters and slicers: moves in a plane or in space.

What would change the meaning of later coordinates (cycles, cutter compensation, scaling,
variables) ends the import. What does not (spindles without an output, coolant, extruders) is left
out.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import acos, atan2, ceil, cos, hypot, pi, sin
from pathlib import Path
import re

from ur_cartesian_driver.importing.import_format import ImportFormat, term_table
from ur_cartesian_driver.importing.import_options import ImportOptions, LENGTH_UNITS
from ur_cartesian_driver.importing.imported_path import BrokenFile, PathCollector
from ur_cartesian_driver.importing.text_file import file_lines, file_text
from ur_cartesian_driver.motion.goal import SegmentType
from ur_cartesian_driver.motion.vectors import Vector3

_COMMENT = re.compile(r'\([^()]*\)|;.*')
_WORD = re.compile(r'\s*([A-Za-z])\s*([-+]?(?:\d+\.?\d*|\.\d+)?)')
#: A command of a printer's firmware by its name.
_MACRO = re.compile(r'[A-Za-z]+_\w*(\s+\S+)*|[A-Za-z]{3,}(\s+\w+=\S+)*')
#: M-codes with a text behind.
_TEXT_CODES = re.compile(r'\s*(?:N\d+\s*)?(M(?:117|118|23|28|30\.1|928))\b', re.I)

#: The axes of an arc in each plane, and its centre: right-handed, counterclockwise is G3.
_PLANES = {17: (0, 1, 2), 18: (2, 0, 1), 19: (1, 2, 0)}
_CENTRE = 'IJK'
_AXES = 'XYZ'

#: Codes that are done, besides the moves.
_DONE = {'G17', 'G18', 'G19', 'G20', 'G21', 'G90', 'G91', 'G90.1', 'G91.1', 'G92', 'G94'}
_MODES_WITHOUT_EFFECT = {'G40', 'G49', 'G69', 'G80'}
_STAYS = 'where the machine is afterwards is not known, so the path goes on from the point before'
_LEFT_OUT = {
    'G4': 'the path does not wait',
    'G9': 'the blend says where the tool stops',
    'G10': 'tables of a machine are not used',
    'G11': 'there is no extruder',
    'G28': f'the home of a machine is not one of the robot; {_STAYS}',
    'G29': 'a bed is not measured',
    'G30': f'the home of a machine is not one of the robot; {_STAYS}',
    'G43': 'the length of the tool is in the active TCP',
    'G53': f'the coordinates of a machine are not those of the robot; {_STAYS}',
    'G54': 'the frame of the goal takes its place',
    'G61': 'the blend says where the tool stops',
    'G64': 'the blend says where the tool stops',
    'G98': 'there are no cycles',
    'G99': 'there are no cycles',
}
#: Switched before the motion of their line by RS274/NGC (table of the order of execution), as by
#: LinuxCNC and GRBL; controls whose order is configured may do it afterwards.
_SWITCHED_OFF = {'M5', 'M9'}
_REFUSED = {
    **dict.fromkeys(
        ('G41', 'G42', 'G41.1', 'G42.1'), 'cutter compensation; let the CAM compensate'
    ),
    **dict.fromkeys(('G50', 'G51'), 'scaling; use the option scale'),
    **dict.fromkeys(('G15', 'G16'), 'polar coordinates'),
    **dict.fromkeys(('G52', 'G68'), 'a moved or turned frame; use frame and origin'),
    **dict.fromkeys(('G5', 'G5.1', 'G5.2', 'G6'), 'splines; let the CAM write lines or arcs'),
    **dict.fromkeys(('G7', 'G93', 'G95'), 'a mode of lathes, or of inverse time'),
    **dict.fromkeys(
        ('G55', 'G56', 'G57', 'G58', 'G59'), 'a second work offset; use one file each'
    ),
    **{f'G{n}': 'a cycle; let the CAM write single moves' for n in (33, 76, *range(81, 90))},
}
#: Words that say nothing about the tool.
_WORDS_LEFT_OUT = {
    'E': 'there is no extruder',
    'T': 'tools are not changed',
    'D': 'there is no table of tools',
    'H': 'there is no table of tools',
    **dict.fromkeys('ABCUVW', 'there is no such axis; the option orientation turns the tool'),
}
#: The ends of an arc may differ in radius by so much [m], or by this share.
_SAME_RADIUS, _SAME_RADIUS_SHARE = 2e-5, 0.005


def collect_gcode(file: Path, options: ImportOptions, into: PathCollector) -> None:
    """
    Read a program.

    :raises BrokenFile: a line is no G-code, or cannot be done.
    """
    _Program(options, into, file_text(file)).run()


class _Program:
    """The state of a machine that executes G-code."""

    def __init__(self, options: ImportOptions, into: PathCollector, text: str) -> None:
        self._options, self._into = options, into
        self._lines = file_lines(text)
        self._position: list[float] = [0.0, 0.0, 0.0]
        #: What G92 added to the coordinates.
        self._shift = [0.0, 0.0, 0.0]
        self._known = [False, False, False]
        self._motion: int | None = None
        self._plane, self._relative, self._relative_centre = 17, False, True
        self._unit: float | None = LENGTH_UNITS.get(options.unit)
        self._feed: float | None = None
        self._line = 0

    def run(self) -> None:
        """Execute all lines."""
        self._take_missing_axes()
        for number, raw in enumerate(self._lines, start=1):
            self._line = number
            line = raw.strip()
            if not line or line[0] == '%':
                continue
            if line[0] == '/':
                self._omit(line, 'a line that is skipped on request')
                continue
            if _TEXT_CODES.match(line):
                self._omit(line.split()[0], 'a message')
                continue
            line = _COMMENT.sub(' ', line).split('*')[0].strip()
            if line and not self._execute(line):
                return

    def _take_missing_axes(self) -> None:
        """Set axes that are in no line to 0: a laser cutter has no Z."""
        code = '\n'.join(_COMMENT.sub(' ', line) for line in self._lines).upper()
        for axis, name in enumerate(_AXES):
            if not re.search(rf'{name}\s*[-+.\d]', code):
                self._known[axis] = True
                self._into.remarks.add(0, f'no {name} in the file', f'{name} is 0')

    def _omit(self, what: str, why: str) -> None:
        self._into.remarks.add(self._line, what, why)

    def _fail(self, text: str) -> BrokenFile:
        return BrokenFile(self._line, text)

    def _execute(self, line: str) -> bool:
        """Execute one line; return False at the end of the program."""
        codes, words = self._words(line)
        if codes is None:
            return True
        own_words = True
        moves = False
        for code in codes:
            if code in ('M2', 'M30'):
                continue
            if code[0] == 'M':
                self._switch(code, words)
            elif code in ('G0', 'G1', 'G2', 'G3'):
                self._motion = int(code[1])
            elif code in _DONE:
                self._set_mode(code, words)
                own_words = own_words and code != 'G92'
            elif code in _REFUSED:
                raise self._fail(f'{code} is not read: {_REFUSED[code]}')
            elif code not in _MODES_WITHOUT_EFFECT:
                base = code.split('.')[0]
                if base not in _LEFT_OUT:
                    raise self._fail(f'{code} is not known; remove it, or write it as moves')
                self._omit(code, _LEFT_OUT[base])
                # The other words belong to it.
                own_words = own_words and base in ('G9', 'G43', 'G54', 'G61', 'G64', 'G98', 'G99')
                if base in ('G43', 'G64'):
                    words.pop('P', None)
        if 'F' in words and own_words:
            self._feed = words.pop('F') * self._lengths() / 60.0
        if 'S' in words and own_words and not any(code[0] == 'M' for code in codes):
            self._switch('S', words)
        if own_words:
            moves = any(name in words for name in 'XYZ' + 'IJKR')
        if moves:
            for code in _SWITCHED_OFF.intersection(codes, self._options.outputs):
                self._omit(
                    f'{code} beside a motion',
                    'it acts before the motion, as in RS274/NGC; some controls do it afterwards',
                )
            self._move(words)
        # The end comes after the motion of its line.
        return not {'M2', 'M30'}.intersection(codes)

    def _words(self, line: str) -> tuple[list[str] | None, dict[str, float]]:
        """Return the codes of a line and its other words; no codes = it was left out."""
        codes: list[str] = []
        words: dict[str, float] = {}
        place = 0
        if '#' in line or '[' in line:
            raise self._fail(f'{line!r:.60} has variables, which are not read')
        while place < len(line):
            match = _WORD.match(line, place)
            if match is None:
                if _MACRO.fullmatch(line):
                    self._omit(line.split()[0], 'a command of a printer')
                    return None, {}
                raise self._fail(f'{line[place:].strip()!r:.60} is no G-code')
            letter, number = match[1].upper(), match[2]
            place = match.end()
            if letter in 'GM':
                if not number:
                    raise self._fail(f'{letter} has no number')
                codes.append(f'{letter}{float(number):g}')
            elif letter == 'N':
                continue
            elif letter == 'O' and not codes and not words:
                return None, {}  # the number of the program
            elif not number:
                if _MACRO.fullmatch(line):
                    self._omit(line.split()[0], 'a command of a printer')
                    return None, {}
                if not codes and not any(character.isdigit() for character in line):
                    raise self._fail(f'{line!r:.60} is no G-code')
                if any(code in ('G28', 'G29', 'G92') for code in codes):
                    words[letter] = 0.0
                    continue
                raise self._fail(f'{letter} has no number')
            elif letter in words:
                raise self._fail(f'{letter} is there twice')
            else:
                words[letter] = float(number)
            if place < len(line) and line[place] == '.':
                raise self._fail(f'{line!r:.60} has a number with two points')
        for letter in list(words):
            if letter in _WORDS_LEFT_OUT:
                del words[letter]
                self._omit(f'word {letter}', _WORDS_LEFT_OUT[letter])
        return codes, words

    def _lengths(self) -> float:
        """Return the unit of lengths [m]."""
        if self._unit is None:
            self._unit = LENGTH_UNITS['mm']
            self._omit('no G20 or G21 before', 'lengths are in mm')
        return self._unit

    def _set_mode(self, code: str, words: Mapping[str, float]) -> None:
        if code in ('G17', 'G18', 'G19'):
            self._plane = int(code[1:])
        elif code in ('G20', 'G21'):
            self._unit = LENGTH_UNITS['in' if code == 'G20' else 'mm']
        elif code in ('G90', 'G91'):
            self._relative = code == 'G91'
        elif code in ('G90.1', 'G91.1'):
            self._relative_centre = code == 'G91.1'
        elif code == 'G92':
            for axis, name in enumerate(_AXES):
                if name in words:
                    value = words[name] * self._lengths()
                    self._shift[axis] += self._position[axis] - value
                    self._position[axis] = value

    def _switch(self, code: str, words: dict[str, float]) -> None:
        """Set the outputs of a code, and of the number of a spindle beside it."""
        number = words.pop('S', None)
        output = self._options.outputs.get(code)
        level = self._options.outputs.get('S')
        if code != 'S':
            if output is None:
                self._omit(code, 'no output is given for it')
            else:
                self._into.switch(output.command(output.value))
        for name in 'PQR':
            if code != 'S' and words.pop(name, None) is not None:
                self._omit(f'word {name} of {code}', 'an output has no such value')
        if number is not None:
            if level is None:
                self._omit('word S', 'no output is given for it')
            elif not 0.0 <= number <= level.value:
                raise self._fail(f'S{number:g} is not within 0 and {level.value:g}')
            else:
                self._into.switch(level.command(number / level.value))

    # ---- moves ---------------------------------------------------------------------------------

    def _move(self, words: Mapping[str, float]) -> None:
        if self._motion is None:
            raise self._fail('coordinates without G0, G1, G2 or G3 before')
        unit = self._lengths()
        end = list(self._position)
        for axis, name in enumerate(_AXES):
            if name in words:
                value = words[name] * unit
                end[axis] = self._position[axis] + value if self._relative else value
                self._known[axis] = True
        start, self._position = self._position, end
        if not all(self._known) and not self._relative:
            missing = ' and '.join(
                n for n, known in zip(_AXES, self._known, strict=True) if not known
            )
            self._omit(f'G{self._motion}', f'the position in {missing} is not known yet')
            return
        if self._motion in (0, 1):
            if any(name in words for name in 'IJKR'):
                raise self._fail(f'G{self._motion} is a line, and has no I, J, K or R')
            travel = self._motion == 0
            self._into.add(
                self._line,
                self._moved(end),
                travel=travel,
                speed=None if travel else self._feed,
            )
            return
        if not len(self._into):
            # An arc needs a point to begin at.
            self._into.add(self._line, self._moved(start), travel=True)
        self._arc(start, end, words, unit)

    def _moved(self, position: list[float]) -> Vector3:
        x, y, z = self._shift
        return (position[0] + x, position[1] + y, position[2] + z)

    def _arc(
        self, start: list[float], end: list[float], words: Mapping[str, float], unit: float
    ) -> None:
        a, b, c = _PLANES[self._plane]
        turn = -1.0 if self._motion == 2 else 1.0
        ax, ay, bx, by = start[a], start[b], end[a], end[b]
        if 'R' in words:
            cx, cy = self._centre_of_radius(ax, ay, bx, by, words['R'] * unit, turn)
        else:
            names = _CENTRE[a], _CENTRE[b]
            if not any(name in words for name in names):
                raise self._fail(f'the arc needs {names[0]} and {names[1]}, or R')
            u, v = (words.get(name, 0.0) * unit for name in names)
            cx, cy = (ax + u, ay + v) if self._relative_centre else (u, v)
        radius, other = hypot(ax - cx, ay - cy), hypot(bx - cx, by - cy)
        if abs(radius - other) > max(_SAME_RADIUS, _SAME_RADIUS_SHARE * radius) or radius == 0.0:
            raise self._fail(
                f'the arc begins {1e3 * radius:.4g} mm and ends {1e3 * other:.4g} mm from its '
                'centre'
            )
        begin = atan2(ay - cy, ax - cx)
        sweep = turn * (atan2(by - cy, bx - cx) - begin) % (2.0 * pi)
        if sweep < 1e-9:
            sweep = 2.0 * pi
        # The radius passes from one end to the other: a post-processor rounds both.
        rises = abs(end[c] - start[c]) > 1e-6

        def place(share: float) -> Vector3:
            angle = begin + turn * share * sweep
            r = radius + share * (other - radius)
            point = [0.0, 0.0, 0.0]
            point[a], point[b] = cx + r * cos(angle), cy + r * sin(angle)
            point[c] = start[c] + share * (end[c] - start[c])
            return self._moved(point)

        if rises:
            step = 2.0 * acos(max(0.0, 1.0 - min(1.0, self._options.tolerance / radius)))
            count = max(2, ceil(sweep / max(step, 1e-3)))
            self._omit(f'G{self._motion} with a rise', f'a helix, made of {count} lines')
            for i in range(1, count + 1):
                self._into.add(self._line, place(i / count), speed=self._feed)
            return
        # The robot takes arcs through three points; a half circle is known best.
        count = ceil(sweep / (0.9 * pi))
        for i in range(count):
            self._into.add(
                self._line,
                place((i + 1) / count) if i + 1 < count else self._moved(end),
                SegmentType.CIRCULAR,
                via=place((i + 0.5) / count),
                speed=self._feed,
            )

    def _centre_of_radius(
        self, ax: float, ay: float, bx: float, by: float, radius: float, turn: float
    ) -> tuple[float, float]:
        """Return the centre of an arc by its radius, negative for more than a half circle."""
        dx, dy = bx - ax, by - ay
        chord = hypot(dx, dy)
        if chord < 1e-9:
            raise self._fail('an arc with R ends where it begins; give I and J for a circle')
        square = radius * radius - 0.25 * chord * chord
        if square < -2.0 * _SAME_RADIUS * abs(radius):
            raise self._fail(
                f'the arc spans {1e3 * chord:.4g} mm, more than twice its radius '
                f'{1e3 * abs(radius):.4g} mm'
            )
        height = max(0.0, square) ** 0.5 * (1.0 if radius > 0.0 else -1.0) * turn
        return (ax + bx) / 2.0 - height * dy / chord, (ay + by) / 2.0 + height * dx / chord


FORMAT = ImportFormat(
    name='gcode',
    suffixes=('.gcode', '.nc', '.ngc', '.gco', '.g', '.tap', '.cnc', '.mpf'),
    terms=term_table(),
    others='Every other code refuses the file.',
    collect=collect_gcode,
)
