# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The machine that executes a program, line by line.

The codes of a line act in the order of RS274/NGC: modes, feed, spindle and outputs, offsets, the
motion, and last the end of the program.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
import re

from ur_cartesian_driver.importing.gcode.codes import (
    Code,
    code_on_line,
    CODES,
    NO_OUTPUT,
    PATH_CONTROL,
    Stage,
)
from ur_cartesian_driver.importing.gcode.coordinates import AXES, Coordinates
from ur_cartesian_driver.importing.gcode.subprograms import LineSequence
from ur_cartesian_driver.importing.gcode.switching import CodeOutputs
from ur_cartesian_driver.importing.gcode.toolpath import Toolpath
from ur_cartesian_driver.importing.gcode.words import Block, COMMENT, read_line
from ur_cartesian_driver.importing.import_format import Treatment
from ur_cartesian_driver.importing.import_options import ImportOptions, LENGTH_UNITS
from ur_cartesian_driver.importing.imported_path import BrokenFile, PathCollector
from ur_cartesian_driver.importing.text_file import quoted

_MOTIONS = frozenset(('G0', 'G1', 'G2', 'G3'))
_OF_MOTION = frozenset('XYZIJKRP')
# The letters of axes with G28, G30 and G53. W is not among them, because it is no axis on Prusa's
# printers; nor is U, because U and W are increments along X and Z on a lathe.
_AXIS_WORDS = frozenset('XYZABCE')
#: Codes that move to a machine position: along the named axes, or along all if none is named.
_WITH_AXES = ('G28', 'G30', 'G53')
#: Matches the codes from which _is_lathe() recognises a lathe, and those that end G99 (G94, G98).
_LATHE_CODE = re.compile(r'G\s*0*(50|92|94|96|98|99)(?![.\d])', re.I)
#: Matches a move home along X by an increment U, which only a lathe or a wire machine has.
_LATHE_HOME = re.compile(r'G\s*0*(28|30)(?![.\d]).*U\s*[-+.\d]', re.I)
_S_WORD, _F_WORD, _AXIS = (
    re.compile(rf'{letter}\s*[-+.\d]', re.I) for letter in ('S', 'F', '[XYZ]')
)
_CONDITION_END = re.compile(r'\s*M623\b', re.I)
_UNITS = {'G20': LENGTH_UNITS['in'], 'G21': LENGTH_UNITS['mm']}
#: The codes of the work offsets, in the order in which the P of a G10 numbers them from 1.
_FRAMES = ('G54', 'G55', 'G56', 'G57', 'G58', 'G59', 'G59.1', 'G59.2', 'G59.3')
#: Any of these words in the line of a G4 is its time. If the line has none of them, its S or F is.
_DWELL = 'PXU'
#: Codes that get a P only if no other code of their line takes it.
_LEAVE_P = frozenset((*_FRAMES, 'M0', 'M1', 'M2', 'M6', 'M30', 'M60'))

_Words = dict[str, float]


class GcodeMachine:
    """Executes a program and collects its points."""

    def __init__(
        self,
        lines: Sequence[str],
        options: ImportOptions,
        into: PathCollector,
        *,
        is_sinumerik: bool = False,
    ) -> None:
        """
        Begin at the first line.

        :param is_sinumerik: whether names call subprograms and M17 ends them, as on a Sinumerik;
            such lines are refused.
        """
        self._is_sinumerik = is_sinumerik
        self._lines, self._options, self._into = lines, options, into
        self._sequence = LineSequence(lines)
        self._outputs = CodeOutputs(options.outputs, into)
        self._path = Toolpath(options, into)
        self._line = 0
        self._has_begun = self._seen_percent = False
        self._frame = _FRAMES[0]
        self._surface_speed = False
        #: Whether F is per turn of the spindle; None = no code has determined it yet.
        self._feed_per_turn: bool | None = None
        #: The line of an M622 whose M623 is still to come; 0 = none.
        self._condition = 0
        #: For each M120 whose M121 is still to come: whether increments were in effect (G91).
        self._saved: list[bool] = []
        #: The lines of the G0 motions during which the output of S stays on.
        self._powered_travels: list[int] = []

    def run(self) -> None:
        """
        Execute the program.

        :raises BrokenFile: a line is no G-code, or cannot be executed.
        """
        for number, line in self._sequence:
            self._line = number
            if self._condition:
                self._pass_by(line)
            elif (block := read_line(number, line)) is not None:
                self._execute(block)
        self._finish()

    def _finish(self) -> None:
        """Add the remarks that need the whole program; refuse a condition that does not end."""
        if self._condition:
            raise BrokenFile(self._condition, 'M622 begins a condition, and no M623 ends it')
        self._outputs.finish()
        for line in self._sequence.never_executed():
            self._into.remarks.add(
                line, 'not executed', f'the program ends in line {self._sequence.end_line}'
            )
        for line in self._powered_travels if not self._path.coordinates.is_named('Z') else ():
            self._into.remarks.add(
                line, 'G0 while S is on', 'the output stays on; a laser mode would switch it off'
            )
        if self._is_lathe and self._path.share_of_x is None:
            self._into.remarks.add(0, 'X of a lathe', 'a radius, because there is no G7')
        self._path.coordinates.finish(self._into)

    def _pass_by(self, line: str) -> None:
        """Leave out a line that a printer executes only under a condition."""
        if _CONDITION_END.match(line):
            self._condition = 0
        elif line.strip() and line.lstrip()[0] != ';':
            self._omit('a line under a condition', CODES['M622'].reason)

    def _omit(self, what: str, why: str) -> None:
        self._into.remarks.add(self._line, what, why)

    def _fail(self, text: str) -> BrokenFile:
        return BrokenFile(self._line, text)

    # ---- a line --------------------------------------------------------------------------------

    def _execute(self, block: Block) -> None:
        codes, words, bare = block
        if len(codes) > 1 or bare or (codes and codes[0] not in _MOTIONS):
            self._obey(codes, words, bare)
            return
        if codes:
            self._path.motion = codes[0]
        self._has_begun = True
        self._take_words(words)
        if words:
            self._move(words)

    def _obey(self, codes: Sequence[str], words: _Words, bare: str) -> None:
        """Execute a line with a code other than G0 to G3, with several codes, or bare letters."""
        rows = [self._row(code, words, is_alone=len(codes) == 1) for code in codes]
        if len(rows) == 1 and rows[0].alone:
            self._do(codes[0], rows[0], words, bare)
            return
        self._check_codes(codes, rows, words)
        own: list[_Words] = [{} for _ in rows]
        # G64 takes its P and Q first; the codes in _LEAVE_P take theirs last. In ``todo``, G64
        # comes last, so that a G20 or G21 of the line sets the unit of P before.
        order = {
            i: (row.group != PATH_CONTROL, codes[i] in _LEAVE_P) for i, row in enumerate(rows)
        }
        for i in sorted(order, key=order.__getitem__):
            own[i] = _taken(codes[i], rows[i], words)
        self._check_words(codes, rows, own, words, bare)
        self._has_begun |= codes[0][0] in 'GM'
        spindle = any(row.group == 'spindle' for row in rows)
        todo = sorted(
            zip(codes, rows, own, strict=True), key=lambda each: each[1].group == PATH_CONTROL
        )
        for stage in Stage:
            if stage is Stage.OUTPUT:
                self._take_words(words, beside_spindle=spindle)
            if stage is Stage.END and words:
                self._say_what_acts_before(codes)
                self._move(words)
            for code, row, values in todo:
                if row.stage is stage:
                    self._do(code, row, values, bare)

    def _row(self, code: str, words: Mapping[str, float], *, is_alone: bool) -> Code:
        row = code_on_line(code, words, is_alone=is_alone)
        if row is None:
            raise self._fail(f'{code} is not known; remove it, or write it as moves')
        if row.treatment is Treatment.REFUSED:
            raise self._fail(f'{row.name} is not read: {row.reason}')
        if self._is_sinumerik and (code == 'M17' or _is_name(code)):
            raise self._fail(f'{code} is not read: it calls or ends a subprogram of a Sinumerik')
        return row

    def _check_codes(self, codes: Sequence[str], rows: Sequence[Code], words: _Words) -> None:
        self._check_cycles(codes, words)
        groups: dict[str, str] = {}
        for code, row in zip(codes, rows, strict=True):
            if row.group and groups.setdefault(row.group, code) != code:
                raise self._fail(f'{groups[row.group]} and {code} exclude each other on a line')
            if (
                row.group == 'unit'
                and 'F' in words
                and self._path.unit not in (None, _UNITS[code])
            ):
                raise self._fail(
                    f'F beside {code} is of one unit or the other; give it in a line after'
                )

    def _check_cycles(self, codes: Sequence[str], words: _Words) -> None:
        """Refuse the cycles of Fanuc's lathes whose codes are modes or offsets elsewhere."""
        if words.keys().isdisjoint('XZ') or not _MOTIONS.isdisjoint(codes):
            return
        for code in codes:
            if (code == 'G92' and 'F' in words) or (code in ('G90', 'G94') and self._is_lathe):
                what = 'threading' if code == 'G92' else 'turning'
                raise self._fail(
                    f"{code} with X or Z is a {what} cycle on Fanuc's lathes; let the CAM write "
                    'single moves'
                )

    def _check_words(
        self,
        codes: Sequence[str],
        rows: Sequence[Code],
        own: Sequence[_Words],
        words: _Words,
        bare: str,
    ) -> None:
        """Refuse letters that lack a number, and words that could belong to several codes."""
        for letter in bare:
            if not any(letter in row.bare for row in rows):
                raise self._fail(f'{letter} has no number')
        has_motion = not _MOTIONS.isdisjoint(codes)
        shared = _OF_MOTION if not {'G2', 'G3'}.isdisjoint(codes) else {*AXES}
        for code, row, values in zip(codes, rows, own, strict=True):
            if row.group == PATH_CONTROL:
                self._check_path_control(code, values, codes, rows)
            if has_motion and not row.moves_away and not shared.isdisjoint(values):
                raise self._fail(f'{code} and a motion cannot share {min(shared & {*values})}')
            others = set(words) - ((_OF_MOTION | {'F', 'T'}) if has_motion else {'T'})
            if any(each.group == 'spindle' for each in rows):
                others.discard('S')
            if row.name == 'other M-codes':
                others &= _OF_MOTION
            if code != 'G96':  # because its S is for the spindle anyway
                self._check_shared(code, values, rows, has_motion=has_motion)
            if others and (row.alone or row.name == 'other M-codes'):
                raise self._fail(
                    f'{min(others)} could belong to {code} or not; give {code} a line of its own'
                )

    def _check_shared(
        self, code: str, own: _Words, rows: Sequence[Code], *, has_motion: bool
    ) -> None:
        """Refuse an S or F that could belong to a code or to the spindle or motion of its line."""
        has_spindle = any(row.group == 'spindle' for row in rows)
        for letter, is_shared in (('S', has_spindle), ('F', has_motion)):
            if letter in own and is_shared:
                raise self._fail(
                    f'{letter} could belong to {code} or not; give {code} a line of its own'
                )

    def _check_path_control(
        self, code: str, own: _Words, codes: Sequence[str], rows: Sequence[Code]
    ) -> None:
        """Refuse a P or Q of G64 that is negative, or that could belong to another code."""
        for letter, value in own.items():
            if value < 0.0:
                raise self._fail(f'{code} {letter}{value:g} is no tolerance')
            for other, row in zip(codes, rows, strict=True):
                if other != code and letter in row.words and other not in _LEAVE_P:
                    raise self._fail(
                        f'{letter} could belong to {code} or {other}; give it a line of its own'
                    )

    def _do(self, code: str, row: Code, own: _Words, bare: str) -> None:
        """Carry out a code with its own words."""
        if row.name in _DO:
            _DO[row.name](self, code, own)
        elif row.name == 'G53' and not own:
            self._omit(code, 'it holds for its line, which has no coordinates')
            return
        elif row.treatment is Treatment.LEFT_OUT:
            self._leave_out(code, row, own)
        if row.moves_away:
            named = {*own, *bare} & _AXIS_WORDS if row.name in _WITH_AXES else set()
            self._path.coordinates.lose(
                ''.join(named.intersection(AXES)) if named else AXES, self._line
            )

    def _leave_out(self, code: str, row: Code, own: _Words) -> None:
        """Switch the output of an M-code, or else add the remark that the code is left out."""
        if code[0] == 'M' and (row.reason == NO_OUTPUT or code in self._outputs):
            self._outputs.switch(self._line, code, own)
        else:
            self._omit(code, row.reason)

    def _take_words(self, words: _Words, *, beside_spindle: bool = False) -> None:
        """Carry out and remove the words that belong neither to a code nor to a motion."""
        if words.keys() <= _OF_MOTION:
            return
        for letter in [each for each in words if each not in _OF_MOTION]:
            value = words.pop(letter)
            row = CODES.get(letter)
            if letter == 'F':
                self._set_feed(value)
            elif letter == 'S' and not self._surface_speed:
                self._outputs.set_power(self._line, value, beside_spindle=beside_spindle)
            elif letter == 'S':
                self._omit('word S', CODES['G96'].reason)
            elif letter == 'W' or (letter == 'U' and not self._has_v):
                raise self._fail(f'{letter} is not read: {CODES["W"].reason}')
            elif letter in 'AC' and self._is_lathe:
                raise self._fail(
                    f'{letter} is not read: on a lathe it is an angle, a chamfer or a turn of the '
                    'spindle; let the CAM write single moves'
                )
            elif not row or not row.reason or (letter in 'HD' and words.keys() & _OF_MOTION):
                raise self._fail(f'{letter}{value:g} belongs to no code of its line')
            else:
                self._omit(f'word {letter}', row.reason)

    def _move(self, words: _Words) -> None:
        if words.keys() == {'P'}:
            raise self._fail(f'P{words["P"]:g} belongs to no code of its line')
        if self._path.motion == 'G0' and self._outputs.drives_power:
            self._powered_travels.append(self._line)
        self._path.move(self._line, words)

    def _say_what_acts_before(self, codes: Sequence[str]) -> None:
        for code in codes:
            if code in ('M5', 'M9') and code in self._outputs:
                self._omit(
                    f'{code} beside a motion',
                    'it acts before the motion, as in RS274/NGC; some controls do it afterwards',
                )

    # ---- codes ---------------------------------------------------------------------------------

    def _set_feed(self, value: float) -> None:
        if not value > 0.0:
            raise self._fail(f'F{value:g} is no feed')
        if self._feed_per_turn:
            self._omit('word F', 'after G99 a lathe gives it per turn, so it is no speed')
            self._path.feed = None
        elif self._feed_per_turn is None and self._is_lathe:
            self._omit('word F', 'per turn or per minute, as the lathe is set; write G98 or G99')
            self._path.feed = None
        else:
            self._path.feed = value * self._path.length(self._line) / 60.0

    def _set_plane(self, code: str, _: _Words) -> None:
        self._path.plane = code

    def _set_unit(self, code: str, _: _Words) -> None:
        self._path.unit = _UNITS[code]

    def _set_distance(self, code: str, _: _Words) -> None:
        if code in ('G90', 'G91'):
            self._path.relative = code == 'G91'
        else:
            self._path.relative_centre = code == 'G91.1'

    def _set_diameter(self, code: str, _: _Words) -> None:
        self._path.share_of_x = 0.5 if code == 'G7' else 1.0

    def _set_path_control(self, code: str, own: _Words) -> None:
        """Set the tolerance for rounding corners (G64 P), or stop at them (G61)."""
        if self._options.blend:
            self._omit(code, 'the option blend says where the tool stops')
            return
        if 'Q' in own:
            self._omit('G64 Q', CODES['G64 Q'].reason)
        # As in LinuxCNC, P0 is the same as no P.
        tolerance = own.get('P') or None
        self._path.set_corner(tolerance if code == 'G64' else 0.0)
        if code != 'G64':
            return
        if tolerance is None and not self._options.corner:
            self._omit('G64', CODES['G64'].reason)
        elif tolerance is not None and self._path.unit is None:
            self._omit('G64 before G20 and G21', 'its P is in the unit that follows')

    def _set_feed_mode(self, code: str, _: _Words) -> None:
        self._feed_per_turn = code == 'G99'

    def _set_spindle_mode(self, code: str, _: _Words) -> None:
        self._surface_speed = code == 'G96'
        if code != 'G97':
            self._omit(code, CODES['G96'].reason)

    def _set_motion(self, code: str, _: _Words) -> None:
        self._path.motion = code

    def _set_frame(self, code: str, own: _Words) -> None:
        frame = f'{code} P{own["P"]:g}' if 'P' in own else code
        if frame == self._frame:
            return
        if len(self._into):
            raise self._fail(
                f'{frame} is a second work offset after {self._frame}; use one file for each'
            )
        self._frame, self._path.coordinates = frame, Coordinates()

    def _set_offset(self, code: str, own: _Words) -> None:
        lengths = self._path.lengths(self._line, own)
        for letter in own:
            if letter not in AXES and (row := CODES[letter]):
                self._omit(f'word {letter}', row.reason)
        if not own:
            raise self._fail(f'{code} without coordinates differs among machines; give them')
        where = self._path.coordinates
        if code == 'G52':
            where.shift(self._line, lengths)
        elif begun := where.preset(self._line, lengths):
            self._omit(f'{code} before a motion in {begun}', 'the program begins there')

    def _cancel_offset(self, code: str, _: _Words) -> None:
        self._path.coordinates.cancel_preset(code, self._line)

    def _set_table(self, code: str, own: _Words) -> None:
        """Set the present coordinates (G10 L20), or leave out or refuse a work offset (G10 L2)."""
        number = own.get('P', 0.0)
        kind = f'{code} L{own["L"]:g}'
        if number and (number not in range(1, 10) or _FRAMES[int(number) - 1] != self._frame):
            self._omit(f'{kind} P{number:g}', 'this work offset is not in use')
        elif own['L'] == 20.0:
            self._path.coordinates.preset_origin(self._line, self._path.lengths(self._line, own))
        elif len(self._into) or own.get('R'):
            raise self._fail(f'{kind} moves or turns the frame in use; use one file for each')
        else:
            self._omit(kind, CODES[kind].reason)

    def _switch(self, code: str, own: _Words) -> None:
        self._outputs.switch(self._line, code, own)

    def _end(self, code: str, _: _Words) -> None:
        self._outputs.end(self._line, code)
        self._sequence.end()

    def _call(self, _: str, own: _Words) -> None:
        self._sequence.call(self._line, own)

    def _return(self, code: str, own: _Words) -> None:
        if not self._sequence.back(self._line, own):
            self._omit(f'{code} in the main program', 'it is executed once')

    def _save_modes(self, code: str, own: _Words) -> None:
        self._saved.append(self._path.relative)
        self._leave_out(code, CODES[code], own)

    def _restore_modes(self, code: str, own: _Words) -> None:
        if self._saved and self._saved.pop() != self._path.relative:
            raise self._fail(
                'M121 restores G90 or G91 of M120 in RepRapFirmware, not in Marlin; write G90 or '
                'G91 before it, as at M120'
            )
        self._leave_out(code, CODES[code], own)

    def _begin_condition(self, code: str, _: _Words) -> None:
        self._condition = self._line
        self._omit(code, CODES['M622'].reason)

    def _percent(self, *_: object) -> None:
        if self._has_begun or self._seen_percent:
            text = COMMENT.sub('', self._lines[self._line - 1]).strip()
            if not text.endswith('%'):
                raise self._fail(f'{quoted(text)} ends no program; % alone does')
            self._sequence.end()
        self._seen_percent = True

    def _number(self, _: str, own: _Words) -> None:
        self._sequence.check_program_number(
            self._line, int(own['O']), is_first=not self._has_begun
        )

    @cached_property
    def _is_lathe(self) -> bool:
        """
        Return whether the program is for a lathe.

        It sets a surface speed (G96), limits the spindle speed (G50 S, G92 S), gives a feed per
        turn (G99), or goes home along U without having V words.
        """
        per_turn = False
        for line in self._lines:
            text = COMMENT.sub('', line)
            if _LATHE_HOME.search(text) and not self._has_v:
                return True
            for match in _LATHE_CODE.finditer(text):
                per_turn = match[1] == '99' or (per_turn and match[1] not in ('94', '98'))
                if match[1] == '96' or (
                    match[1] in ('50', '92') and _S_WORD.search(text) and not _AXIS.search(text)
                ):
                    return True
            if per_turn and _F_WORD.search(text):
                return True
        return False

    @cached_property
    def _has_v(self) -> bool:
        """Return whether there are V words, so that U is an axis of a wire, not along X."""
        return any(re.search(r'V\s*[-+.0-9]', line, re.I) for line in self._lines)


_Action = Callable[[GcodeMachine, str, _Words], None]
_DO: Mapping[str, _Action] = {
    name: action
    for names, action in (
        ('G0 G1 G2 G3 G80', GcodeMachine._set_motion),
        ('G17 G18 G19', GcodeMachine._set_plane),
        ('G20 G21', GcodeMachine._set_unit),
        ('G90 G91 G90.1 G91.1', GcodeMachine._set_distance),
        ('G7 G8', GcodeMachine._set_diameter),
        ('G61 G61.1 G64', GcodeMachine._set_path_control),
        ('G94 G98 G99', GcodeMachine._set_feed_mode),
        ('G96 G97', GcodeMachine._set_spindle_mode),
        ('G54 G55 G56 G57 G58 G59 G54.1 G59.1 G59.2 G59.3 G154', GcodeMachine._set_frame),
        ('G52 G92', GcodeMachine._set_offset),
        ('G92.1 G92.2 G92.3', GcodeMachine._cancel_offset),
        ('M3 M4 M5 M7 M8 M9', GcodeMachine._switch),
        ('M2 M30', GcodeMachine._end),
        ('M98', GcodeMachine._call),
        ('M99', GcodeMachine._return),
        ('M120', GcodeMachine._save_modes),
        ('M121', GcodeMachine._restore_modes),
        ('M622', GcodeMachine._begin_condition),
        ('%', GcodeMachine._percent),
        ('O', GcodeMachine._number),
    )
    for name in names.split()
} | {
    'G10 L2': GcodeMachine._set_table,
    'G10 L20': GcodeMachine._set_table,
    'G64 P': GcodeMachine._set_path_control,
    'G64 Q': GcodeMachine._set_path_control,
}


def _taken(code: str, row: Code, words: _Words) -> _Words:
    """Remove and return the words of a line that belong to a code."""
    letters = row.words
    if code == 'G4' and any(letter in words for letter in _DWELL):
        letters = _DWELL
    return {letter: words.pop(letter) for letter in letters if letter in words}


def _is_name(code: str) -> bool:
    """Return whether a code is a name, such as PARK or _HOME, and no letter with a number."""
    return len(code) > 1 and code[:2].replace('_', 'A').isalpha()
