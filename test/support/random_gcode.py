# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Random programs in the language of RS274/NGC, and the same programs with words of other machines.

All lengths are even multiples of 0.254 mm, which are exact with few digits in inches, too. All
arcs lead between points with whole coordinates, around centres with whole coordinates.
"""

from collections.abc import Sequence
from random import Random

#: [mm]
STEP = 0.254
#: Points on a circle with a radius of 5, counterclockwise.
_CIRCLE = (
    *((5, 0), (4, 3), (3, 4), (0, 5), (-3, 4), (-4, 3)),
    *((-5, 0), (-4, -3), (-3, -4), (0, -5), (3, -4), (4, -3)),
)
_PLANES = {'G17': (0, 1, 2), 'G18': (2, 0, 1), 'G19': (1, 2, 0)}
_AXES, _CENTRES = 'XYZ', 'IJK'
#: Codes with their words that have no effect on the path.
_NEUTRAL = (
    *('G4 P0.1', 'G61', 'G61.1', 'G64', 'G64 P0.01', 'G64 P0.01 Q0.02', 'G40', 'G49', 'G97'),
    *('G54', 'M0', 'M1', 'M48', 'M49', 'M50 P1', 'M51 P0', 'M53 P1', 'M64 P0', 'M65 P1', 'T1'),
    *('M62 P2', 'M63 P2', 'M67 E0 Q1.5', 'M68 E1 Q0.5', '(MSG, go on)', '(a comment; still one)'),
    *('G98', 'M60', '; the rest of a line', ''),
)


class RandomProgram:
    """Writes one program; the text is in `lines`."""

    def __init__(self, random: Random, statements: int) -> None:
        self.random = random
        self.lines: list[str] = []
        self.subprogram: list[str] = []
        #: The position in steps; None after a change of coordinates.
        self.at: list[int] | None = None
        self.plane, self.unit, self.share_of_x = 'G17', 1.0, 1
        self.relative, self.relative_centre = False, True
        #: The code in use, G92 or G52; 'begin' = G92 defines the place of the beginning.
        self.preset, self.motion = '', ''
        self._begin()
        for _ in range(statements):
            self._statement()
        self._end()

    # ---- text ----------------------------------------------------------------------------------

    def _number(self, value: float) -> str:
        text = f'{value:.4f}'.rstrip('0')
        style = self.random.randrange(4)
        if style == 0:
            text = text.rstrip('.')
        elif style == 1 and value >= 0.0:
            text = f'+{text}'
        elif style == 2 and text.startswith('0.') and len(text) > 2:
            text = text[1:]
        return text

    def _length(self, steps: int) -> str:
        return self._number(steps * STEP / (25.4 if self.unit != 1.0 else 1.0))

    def _words(self, named: dict[str, int]) -> list[str]:
        return [
            letter + self._length(steps * (self.share_of_x if letter == 'X' else 1))
            for letter, steps in named.items()
        ]

    def _put(self, words: Sequence[str], into: list[str] | None = None) -> None:
        words = [
            word.replace('G', 'G0', 1) if word in ('G0', 'G1', 'G2', 'G3') and odd else word
            for word in words
            for odd in (self.random.random() < 0.3,)
        ]
        self.random.shuffle(words)
        text = self.random.choice((' ', ' ', '', '\t')).join(words)
        if self.random.random() < 0.15:
            text = text.lower()
        if self.random.random() < 0.1:
            text = f'{text} {self.random.choice(("(x)", "; x"))}'
        lines = self.lines if into is None else into
        if self.random.random() < 0.2:
            text = f'N{10 * len(lines) + 10} {text}'
        lines.append(text)

    # ---- statements ----------------------------------------------------------------------------

    def _begin(self) -> None:
        if self.random.random() < 0.3:
            self.lines.append('%')
        if self.random.random() < 0.3:
            self.lines.append(f'O{self.random.randint(1, 99)} (random)')
        if self.random.random() < 0.3:
            self._set_unit('G20')
        elif self.random.random() < 0.7:
            self._set_unit('G21')
        self._put(['F' + self._number(25.4 * self.random.randint(2, 40) / self._inch())])
        begin = self.random.choice(('absolute', 'absolute', 'preset', 'relative'))
        if begin == 'absolute':
            self._line(full=True)
        elif begin == 'preset':
            self._put(['G92', 'X0', 'Y0', 'Z0'])
            self.at, self.preset = [0, 0, 0], 'begin'
        else:
            self._put(['G91'])
            self.relative, self.at = True, [0, 0, 0]
            self._line(full=True)

    def _inch(self) -> float:
        return 25.4 if self.unit != 1.0 else 1.0

    def _statement(self) -> None:
        kinds = (
            *(self._line, self._line, self._line, self._arc, self._arc, self._arc, self._mode),
            *(self._mode, self._offset, self._spindle, self._coolant, self._neutral, self._feed),
            self._call,
        )
        self.random.choice(kinds)()

    def _line(self, *, full: bool = False) -> None:
        axes = [axis for axis in range(3) if full or self.random.random() < 0.6]
        if not axes:
            axes = [self.random.randrange(3)]
        goal = {axis: 2 * self.random.randint(-60, 60) for axis in axes}
        words = self._words({_AXES[axis]: steps for axis, steps in goal.items()})
        code = self.random.choice(('G0', 'G1'))
        if code != self.motion or self.random.random() < 0.5:
            words.append(code)
            self.motion = code
        if self.random.random() < 0.2:
            words.append(self._feed_word())
        self._put(words)
        if self.at is not None:
            for axis, steps in goal.items():
                self.at[axis] = self.at[axis] + steps if self.relative else steps
        elif full and not self.relative:
            self.at = [goal[axis] for axis in range(3)]

    def _arc(self) -> None:
        if self.at is None:
            if self.relative:
                self._put(['G90'])
                self.relative = False
            self._line(full=True)
        assert self.at is not None
        a, b, c = _PLANES[self.plane]
        size = 2 * self.random.randint(1, 8)
        begin, end = self.random.sample(_CIRCLE, 2)
        if self.random.random() < 0.15:
            end = begin
        clockwise = self.random.random() < 0.5
        target = list(self.at)
        target[a] += size * (end[0] - begin[0])
        target[b] += size * (end[1] - begin[1])
        if self.random.random() < 0.25:
            target[c] += 2 * self.random.randint(-10, 10)
        named = {
            _AXES[axis]: target[axis] - (self.at[axis] if self.relative else 0)
            for axis in range(3)
            if axis != c or target[c] != self.at[c]
        }
        words = self._words({} if end == begin and target[c] == self.at[c] else named)
        radius = end != begin and self.random.random() < 0.3
        if radius:
            # The number of points on the circle from begin to end, counterclockwise.
            turn = _CIRCLE.index(end) - _CIRCLE.index(begin)
            cross = begin[0] * end[1] - begin[1] * end[0]
            if cross == 0:
                radius = False
            else:
                is_short = (cross > 0) is not clockwise
                assert turn
                words.append('R' + self._length(5 * size * (1 if is_short else -1)))
        if not radius:
            centre = (-size * begin[0], -size * begin[1])
            if not self.relative_centre:
                centre = (self.at[a] + centre[0], self.at[b] + centre[1])
            for axis, steps in zip((a, b), centre, strict=True):
                if steps or not self.relative_centre or self.random.random() < 0.5:
                    words.append(_CENTRES[axis] + self._length(steps))
        if self.random.random() < 0.15:
            words.append(f'P{self.random.randint(1, 3)}')
        code = 'G2' if clockwise else 'G3'
        if code != self.motion or self.random.random() < 0.5:
            words.append(code)
            self.motion = code
        self._put(words)
        self.at = target

    def _mode(self) -> None:
        kind = self.random.randrange(6)
        if kind == 0:
            self.plane = self.random.choice(tuple(_PLANES))
            self._put([self.plane])
        elif kind == 1:
            self._set_unit(self.random.choice(('G20', 'G21')))
        elif kind == 2:
            self.relative = self.random.random() < 0.5
            self._put(['G91' if self.relative else 'G90'])
        elif kind == 3:
            self.relative_centre = self.random.random() < 0.5
            self._put(['G91.1' if self.relative_centre else 'G90.1'])
        elif kind == 4:
            self.share_of_x = self.random.choice((1, 2))
            self._put(['G7' if self.share_of_x == 2 else 'G8'])
        else:
            self._put(['G80'])
            self.motion = ''

    def _set_unit(self, code: str) -> None:
        self.unit = 25.4 if code == 'G20' else 1.0
        self._put([code])

    def _offset(self) -> None:
        words = self._words({axis: 2 * self.random.randint(-20, 20) for axis in 'XYZ'})
        words = self.random.sample(words, self.random.randint(1, 3))
        if self.preset == 'begin':
            self._put(['G92', *words])
        elif not self.preset:
            self.preset = self.random.choice(('G92', 'G52', ''))
            self._put([self.preset, *words] if self.preset else ['G10', 'L20', 'P1', *words])
        elif self.preset == 'G92':
            code = self.random.choice(('G92', 'G92.1', 'G92.2'))
            self._put([code, *words] if code == 'G92' else [code])
            self.preset = 'G92' if code == 'G92' else ''
            if code == 'G92.2' and self.random.random() < 0.5:
                self._put(['G92.3'])
                self.preset = 'G92'
        else:
            code = self.random.choice(('G52', 'G92.1'))
            self._put([code, *words] if code == 'G52' else [code])
            self.preset = 'G52' if code == 'G52' else ''
        self.at = None

    def _spindle(self) -> None:
        words = [self.random.choice(('M3', 'M4', 'M5'))]
        if self.random.random() < 0.6:
            words.append(f'S{self.random.randint(0, 1000)}')
        self._put(self.random.choice((words, words, words[1:] or words)))

    def _coolant(self) -> None:
        self._put([self.random.choice(('M7', 'M8', 'M9'))])

    def _neutral(self) -> None:
        self.lines.append(self.random.choice(_NEUTRAL))

    def _feed_word(self) -> str:
        return 'F' + self._number(25.4 * self.random.randint(2, 40) / self._inch())

    def _feed(self) -> None:
        # In LinuxCNC, G94 ends the previous feed.
        self._put([self._feed_word(), *(['G94'] * self.random.randrange(2))])

    def _call(self) -> None:
        if not self.subprogram:
            self.subprogram_unit = self.unit
            self.subprogram = ['O1234']
            for _ in range(self.random.randint(1, 3)):
                x, y = (self._length(2 * self.random.randint(-9, 9)) for _ in 'XY')
                self._put(['G91', 'G1', f'X{x}', f'Y{y}'], self.subprogram)
            self._put(['G90', 'G8'], self.subprogram)
            self.subprogram.append('M99')
        if self.unit != self.subprogram_unit:
            return
        # LinuxCNC requires the code to be first.
        self.lines.append(self.random.choice(('M98 P1234', 'M98 P1234 L1', 'm98p1234l2')))
        self.relative, self.at, self.motion, self.share_of_x = False, None, 'G1', 1

    def _end(self) -> None:
        self._line(full=True)
        if self.subprogram:
            self.lines += [self.random.choice(('M2', 'M30')), *self.subprogram]
        elif self.lines[0] != '%' or self.random.random() < 0.5:
            self.lines.append(self.random.choice(('M2', 'M30')))
        if self.lines[0] == '%':
            self.lines += ['%', 'G0 X99 Y99 (never read)']
