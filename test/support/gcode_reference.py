# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
A reference for the moves of RS274/NGC, written from NIST IR 6556 without code of the package.

It knows lines and arcs, planes, units, distance modes and comments; a program with anything else
is `OutOfScope`.
"""

from collections.abc import Iterator
from dataclasses import dataclass
import re
from typing import Any

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Floats

Floats = Floats
_Modes = dict[str, Any]
#: Codes that leave the path as it is.
_NO_MOTION = {'G40', 'G49', 'G54', 'G61', 'G64', 'G94', 'M3', 'M4', 'M5', 'M7', 'M8', 'M9'}
_PLANES = {'G17': 'XYZ', 'G18': 'ZXY', 'G19': 'YZX'}
_OFFSET_OF = dict(zip('XYZ', 'IJK', strict=True))
#: Largest distance of an arc from the chords between its points [mm].
_SAG = 1e-3


class OutOfScope(Exception):
    """The program has words that the reference does not know."""


@dataclass(frozen=True)
class Move:
    """A move of one line; nan if the program has not determined a position."""

    line: int
    is_rapid: bool
    #: (n, 3) points of a polyline within `_SAG` [mm], from the start to the end.
    curve: Floats


def moves_of(text: str) -> Iterator[Move]:
    """Return the moves of a program in their order."""
    place = {axis: np.nan for axis in 'XYZ'}
    mode: _Modes = {
        'motion': '',
        'plane': 'G17',
        'unit': 1.0,
        'distance': 'G90',
        'centre': 'G91.1',
    }
    started = False
    for number, line in enumerate(re.split('\r\n|\n|\r', text), start=1):
        if '%' in line:
            if line.strip(' \t') != '%':
                raise OutOfScope(line)
            if started:
                return
            started = True
            continue
        words = list(_words(_without_comments(line)))
        if not words:
            continue
        started = True
        values = {letter: value for letter, value in words if letter not in 'GMN'}
        if len(values) + sum(letter in 'GM' for letter, _ in words) != len(words):
            raise OutOfScope(line)
        ends = _set_modes(
            [f'{letter}{value:g}' for letter, value in words if letter in 'GM'], mode
        )
        if set(values) - set('XYZIJKRFST'):
            raise OutOfScope(line)
        if values.get('F', 1.0) <= 0.0:
            raise OutOfScope(line)
        if values.keys() & set('XYZIJKR'):
            yield _move(number, values, place, mode)
        if ends:
            return


def _without_comments(line: str) -> str:
    left = ''
    while line:
        if line[0] == ';':
            break
        if line[0] == '(':
            inside, closing, line = line[1:].partition(')')
            if not closing or '(' in inside or re.match(r'\s*(msg|debug|print|log)', inside, re.I):
                raise OutOfScope(inside)
            left += '|'  # no word goes across a comment
        else:
            left, line = left + line[0], line[1:]
    return left


def _words(line: str) -> Iterator[tuple[str, float]]:
    for part in re.sub('[ \t]', '', line).split('|'):
        rest = part
        while rest:
            found = re.match(r'([A-Za-z])([+-]?(?:\d{1,9}\.?\d{0,9}|\.\d{1,9}))', rest, re.ASCII)
            if found is None or found[1] in 'eE':
                raise OutOfScope(line)
            yield found[1].upper(), float(found[2])
            rest = rest[found.end() :]


def _set_modes(codes: list[str], mode: _Modes) -> bool:
    """Set the modes by the codes of one line; return whether these end the program."""
    groups = {
        'motion': {'G0', 'G1', 'G2', 'G3'},
        'plane': set(_PLANES),
        'unit': {'G20', 'G21'},
        'distance': {'G90', 'G91'},
        'centre': {'G90.1', 'G91.1'},
        'end': {'M2', 'M30'},
    }
    for group, members in groups.items():
        asked = [code for code in codes if code in members]
        if len(asked) > 1:
            raise OutOfScope(str(asked))
        if asked and group == 'unit':
            mode['unit'] = 25.4 if asked[0] == 'G20' else 1.0
        elif asked:
            mode[group] = asked[0]
    known = set.union(_NO_MOTION, *groups.values())
    if set(codes) - known or len(set(codes)) < len(codes):
        raise OutOfScope(str(codes))
    return mode.pop('end', None) is not None


def _move(number: int, values: dict[str, float], place: dict[str, float], mode: _Modes) -> Move:
    start = np.array([place[axis] for axis in 'XYZ'])
    for axis in 'XYZ':
        if axis in values:
            value = values[axis] * mode['unit']
            place[axis] = value + (place[axis] if mode['distance'] == 'G91' else 0.0)
            if np.isnan(place[axis]):
                raise OutOfScope('where increments begin is a matter of agreement')
    end = np.array([place[axis] for axis in 'XYZ'])
    is_arc = mode['motion'] in ('G2', 'G3')
    if not mode['motion'] or (not is_arc and values.keys() & set('IJKR')):
        raise OutOfScope(str(values))
    curve = _arc(start, end, values, mode) if is_arc else np.array([start, end])
    return Move(number, mode['motion'] == 'G0', curve)


def _arc(start: Floats, end: Floats, values: dict[str, float], mode: _Modes) -> Floats:
    """Return the arc by turning the first radius; positions in the plane are complex numbers."""
    first, second, third = tuple(_PLANES[mode['plane']])
    i, j, k = ('XYZ'.index(axis) for axis in (first, second, third))
    a, b = complex(start[i], start[j]), complex(end[i], end[j])
    sense = -1.0 if mode['motion'] == 'G2' else 1.0
    offsets = [_OFFSET_OF[first], _OFFSET_OF[second]]
    given = values.keys() & set('IJKR')
    if np.isnan(start).any() or np.isnan(end).any():
        raise OutOfScope('an arc between unknown places')
    if given == {'R'}:
        radius, half = values['R'] * mode['unit'], abs(b - a) / 2.0
        if half < 1e-3 or abs(radius) < half:
            raise OutOfScope('no such arc')
        rise = (radius**2 - half**2) ** 0.5 * (1.0 if radius > 0.0 else -1.0) * sense
        centre = (a + b) / 2.0 + 1j * (b - a) / abs(b - a) * rise
    elif given and given <= set(offsets):
        if mode['centre'] == 'G90.1' and len(given) < 2:
            raise OutOfScope('an absolute centre needs both')
        u, v = (values.get(letter, 0.0) * mode['unit'] for letter in offsets)
        centre = complex(u, v) + (a if mode['centre'] == 'G91.1' else 0.0)
    else:
        raise OutOfScope(str(values))
    before, after = a - centre, b - centre
    # NIST allows 0.002 mm; programs are rounded to 0.001.
    if abs(before) < 1e-3 or abs(abs(before) - abs(after)) > 0.002:
        raise OutOfScope('two radii')
    turn = sense * np.angle(after / before) % (2.0 * np.pi)
    if turn < 1e-6 or 2.0 * np.pi - turn < 1e-6:
        if abs(b - a) > 1e-6:
            raise OutOfScope('nearly a full circle, or nearly nothing')
        turn = 2.0 * np.pi
    count = int(np.ceil(turn / (8.0 * _SAG / abs(before)) ** 0.5)) + 1
    if count > 100_000:
        raise OutOfScope('too large')
    shares = np.linspace(0.0, 1.0, count + 1)
    around = centre + before * np.exp(1j * sense * turn * shares)
    around += shares * (b - around[-1])
    curve = np.empty((count + 1, 3))
    curve[:, i], curve[:, j] = around.real, around.imag
    curve[:, k] = start[k] + shares * (end[k] - start[k])
    return curve
