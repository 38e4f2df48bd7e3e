# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Broken programs: a goal that is near the curve of the file, or one sentence with its line."""

from pathlib import Path
import re

from broken_files import broken_texts, goal_or_sentence
from gcode_reference import Move, moves_of, OutOfScope
import numpy as np
import pytest
from random_cases import cases, random_of
from random_gcode import RandomProgram

from ur_cartesian_driver.importing import FORMATS, ImportOptions
from ur_cartesian_driver.importing.imported_path import PathCollector

FILES = [
    file.read_text() for file in sorted((Path(__file__).parent / 'files' / 'gcode').iterdir())
]
#: [mm]
TOLERANCE = 0.05
PARTS = 10


def distance_to_curve(point, curve):
    """The distance of a point from a polyline."""
    a, b = curve[:-1], curve[1:]
    along = b - a
    square = np.maximum(np.einsum('ij,ij->i', along, along), 1e-30)
    share = np.clip(np.einsum('ij,ij->i', point - a, along) / square, 0.0, 1.0)
    return float(np.linalg.norm(a + share[:, None] * along - point, axis=1).min())


def compare(text, path):
    """Assert that a path follows the moves of the reference; return how many there are."""
    moves = list(moves_of(text))
    unnamed = [np.isnan([move.curve[-1, axis] for move in moves]).all() for axis in range(3)]
    known = [move for move in moves if not np.isnan(move.curve[-1][np.invert(unnamed)]).any()]
    lines = path.lines.tolist()
    assert sorted(set(lines)) == [move.line for move in known]
    for move in known:
        curve = move.curve.copy()
        curve[:, unnamed] = 0.0
        rows = [row for row, line in enumerate(lines) if line == move.line]
        assert 1e3 * path.positions[rows[-1]] == pytest.approx(curve[-1], abs=1e-3)
        if np.isnan(curve).any():  # the start is not known
            assert len(rows) == 1
            continue
        for row in rows:
            places = [path.positions[row], path.vias[row]]
            if row != rows[0]:
                places.append(0.5 * (path.positions[row] + path.positions[row - 1]))
            is_arc = not np.isnan(path.vias[row, 0])
            for place in places[:2] if is_arc else [places[0], *places[2:]]:
                assert distance_to_curve(1e3 * place, curve) <= TOLERANCE + 2e-3
    return len(known)


def collected(tmp_path, text):
    file = tmp_path / 'a.ngc'
    file.write_text(text, encoding='utf-8', newline='', errors='surrogatepass')
    into = PathCollector()
    FORMATS['gcode'].collect(file, ImportOptions(), into)
    return into.path()


def line_or_arc(random):
    """A line of a program in the language of the reference; now and then of no language."""
    words = [random.choice(('G0', 'G1', 'G2', 'G3', '', '', 'G17', 'G18', 'G19', 'G20', 'G21'))]
    words += [random.choice(('G90', 'G91', 'G90.1', 'G91.1', '', '', '', '', 'M3', 'M8', '(x)'))]
    for letter in random.sample('XYZ', random.randint(0, 3)):
        words.append(f'{letter}{random.randint(-20, 20)}{random.choice(("", ".", ".5"))}')
    if random.random() < 0.3:
        i = random.randint(1, 9)
        words.append(random.choice((f'I{i}', f'J{i}', f'K{i}', f'I{i} J0', f'R{3 * i}', f'R-{i}')))
    if random.random() < 0.3:
        words.append(f'F{random.randint(0, 900)}')
    random.shuffle(words)
    return random.choice(('', ' ')).join(words)


def round_trip(random):
    """Arcs that end where the line before began: half circles in any plane."""
    a, b, c, d = random.choice((('X', 'Y', 'I', 'J'), ('X', 'Z', 'I', 'K'), ('Y', 'Z', 'J', 'K')))
    u, v = (2 * random.randint(-9, 9) for _ in 'uv')
    plane = {'J': 'G17', 'K': 'G18' if a == 'X' else 'G19'}[d]
    back = f'{a}{-u} {b}{-v} {c}{-u / 2:g} {d}{-v / 2:g}'
    return f'{plane} G91 G1 {a}{u} {b}{v}\n{random.choice(("G2", "G3"))} {back}\nG90 G1'


def plain_program(random):
    """Return a program whose lines are mostly in the language of the reference."""
    lines = [random.choice((line_or_arc, round_trip))(random) for _ in range(4)]
    return '\n'.join(['G21 G17 G1 X0 Y0 Z0 F60', *lines]) + '\n'


def reference_program(random):
    """Return a program that the reference reads."""
    while True:
        text = plain_program(random)
        try:
            list(moves_of(text))
        except OutOfScope:
            continue
        return text


@pytest.mark.random
@pytest.mark.parametrize('part', range(PARTS))
def test_a_broken_program_is_a_goal_near_its_curve_or_one_sentence(tmp_path, part):
    random = random_of('gcode', part)
    programs = ['\n'.join(RandomProgram(random, 8).lines) for _ in range(20)]
    programs += [reference_program(random) for _ in range(20)]
    count = cases(10_000 // PARTS)
    goals = compared = 0
    for drawn, text in enumerate(broken_texts([*FILES, *programs], 10 * count, random)):
        # The reference reads some 6 of 100, so now and then none of the first 100.
        if drawn >= count and compared >= 0.01 * count:
            break
        found = goal_or_sentence(tmp_path / 'a.nc', text)
        if isinstance(found, str):
            continue
        goals += 1
        try:
            moves = list(moves_of(text))
        except OutOfScope:
            continue
        if moves:
            compared += compare(text, collected(tmp_path, text)) > 0
    assert goals >= 0.1 * drawn
    assert compared >= 0.01 * count


@pytest.mark.random
@pytest.mark.parametrize('part', range(PARTS))
def test_a_random_program_follows_the_reference(tmp_path, part):
    random = random_of('gcode reference', part)
    compared = accepted = 0
    for _ in range(cases(20_000 // PARTS)):
        text = plain_program(random)
        try:
            moves = list(moves_of(text))
        except OutOfScope:
            continue
        accepted += 1
        assert all(isinstance(move, Move) for move in moves)
        found = goal_or_sentence(tmp_path / 'a.nc', text)
        if isinstance(found, str):
            # The importer reads every other program that the reference reads.
            assert re.search('F beside G2[01] is of one unit or the other', found), text
            continue
        assert compare(text, collected(tmp_path, text)) > 0
        compared += 1
    assert accepted >= 10
    # Some 96 of 100 have no F beside a change of the unit; a part draws only some 80.
    assert compared >= 0.75 * accepted
