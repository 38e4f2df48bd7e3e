# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Random programs lead where LinuxCNC's interpreter leads, with the same feeds and outputs.

`files/rs274.json` has its canonical output, made by `scripts/make_rs274_judgements.py`.
"""

import json
from math import atan2, cos, hypot, pi, sin
from pathlib import Path

from gcode_programs import line_of
import numpy as np
import pytest
from random_cases import random_of

from ur_cartesian_driver.importing import FORMATS, ImportOptions, parse_code_output, Treatment
from ur_cartesian_driver.importing.gcode.codes import CODES
from ur_cartesian_driver.importing.imported_path import PathCollector
from ur_cartesian_driver.motion.goal.goal import SegmentType

JUDGED = json.loads((Path(__file__).parent / 'files' / 'rs274.json').read_text())
#: [m]; the interpreter prints 0.1 µm.
NEAR = 1e-6
TOLERANCE = 5e-5
OUTPUTS = dict(
    map(
        parse_code_output,
        (
            *('M3=standard:0:1', 'M4=standard:1:1', 'M5=standard:2:1', 'S=analog:0:1000'),
            *('M7=standard:3:1', 'M8=standard:4:1', 'M9=standard:5:1'),
        ),
    )
)


def imported(tmp_path, text):
    file = tmp_path / 'a.ngc'
    file.write_text(text)
    into = PathCollector()
    FORMATS['gcode'].collect(file, ImportOptions(outputs=OUTPUTS, tolerance=TOLERANCE), into)
    return into.path()


def states(path):
    """Spindle, power and coolant during the motion to each row."""
    spindle, power, coolant = 'M5', 0.0, ''
    commands = list(path.outputs)
    found = []
    for row in range(len(path)):
        while commands and commands[0].waypoint < row:
            command = commands.pop(0)
            if command.output.name.endswith('ANALOG'):
                power = command.value
            elif command.pin < 3:
                spindle = f'M{3 + command.pin}'
            else:
                coolant = f'M{4 + command.pin}'
        found.append((spindle, power, coolant))
    return found


def angle_from(start, end, direction):
    """The angle from one vector to another, positive in the direction."""
    turn = atan2(start[0] * end[1] - start[1] * end[0], start[0] * end[0] + start[1] * end[1])
    return (direction * turn) % (2.0 * pi)


class Judged:
    """A path beside the canonical motions; row by row."""

    def __init__(self, path, motions):
        self.path, self.motions = path, motions
        self.positions = 1e3 * path.positions
        self.states = states(path)
        self.row = 0

    def check(self):
        first = self.motions[0]
        # The first motion leads from the beginning, if that is known.
        begin = self.path.lines[0] == self.path.lines[1]
        here = self.positions[0] if begin else np.array(first[4])
        for motion in self.motions[not begin :]:
            here = (self.arc if motion[3] == 'A' else self.line)(here, motion)
        assert self.row == len(self.path) - 1

    def next_row(self, motion):
        self.row += 1
        spindle, power, coolant, kind, _, feed, *_ = motion
        if self.row > 1:  # what comes before the first point is switched there
            on = spindle != 'M5'
            assert self.states[self.row][0] == spindle
            assert self.states[self.row][1] == pytest.approx(power / 1000.0 if on else 0.0)
            assert self.states[self.row][2] == coolant
        if kind == 'T':
            assert self.path.travels[self.row]
        else:
            assert self.path.speeds[self.row] == pytest.approx(feed / 60e3, rel=1e-6)
        return self.row

    def line(self, _, motion):
        row = self.next_row(motion)
        assert self.path.types[row] == SegmentType.LINEAR
        assert self.positions[row] == pytest.approx(motion[4], abs=1e3 * NEAR)
        return np.array(motion[4])

    def arc(self, start, motion):
        end = np.array(motion[4])
        (a, b, c), centre, turns = motion[6:]
        direction = 1 if turns > 0 else -1
        radius = hypot(start[a] - centre[0], start[b] - centre[1])
        total = angle_from(
            (start[a] - centre[0], start[b] - centre[1]),
            (end[a] - centre[0], end[b] - centre[1]),
            direction,
        )
        total = (total if total > 1e-6 else 2.0 * pi) + 2.0 * pi * (abs(turns) - 1)
        begin = atan2(start[b] - centre[1], start[a] - centre[0])

        def on_curve(share):
            place = np.array(start + share * (end - start))
            place[a] = centre[0] + radius * cos(begin + direction * share * total)
            place[b] = centre[1] + radius * sin(begin + direction * share * total)
            return place

        share, point = 0.0, start
        while share < 1.0 - 1e-9:
            row = self.next_row(motion)
            is_arc = self.path.types[row] == SegmentType.CIRCULAR
            assert is_arc == (abs(end[c] - start[c]) < 1e-6)
            for place in (1e3 * self.path.vias[row], self.positions[row])[not is_arc :]:
                step = angle_from(
                    (point[a] - centre[0], point[b] - centre[1]),
                    (place[a] - centre[0], place[b] - centre[1]),
                    direction,
                )
                if not is_arc:
                    middle = on_curve(share + 0.5 * step / total)
                    off = np.linalg.norm(middle - 0.5 * (point + place))
                    assert off <= 1e3 * (TOLERANCE + NEAR)
                share, point = share + step / total, place
                assert place == pytest.approx(on_curve(share), abs=1e3 * NEAR)
        assert share == pytest.approx(1.0, abs=1e-6)
        return end


@pytest.mark.parametrize('number', range(len(JUDGED)))
def test_a_program_leads_where_linuxcnc_leads(tmp_path, number):
    program, motions = JUDGED[number]
    Judged(imported(tmp_path, program), motions).check()


#: Terms that have no effect on the path, each with a line.
NEUTRAL = [
    name
    for name, row in CODES.items()
    if row.treatment is Treatment.LEFT_OUT and not row.moves_away
]
#: So many programs have the words of other machines in between.
MIXED = 50


@pytest.mark.parametrize('number', range(MIXED))
def test_words_of_other_machines_do_not_change_the_path(tmp_path, number):
    program, motions = JUDGED[number]
    lines = program.split('\n')
    first = next(row for row, line in enumerate(lines) if line[:1] not in '%O') + 1
    last = 1 + next(row for row, line in enumerate(lines) if line in ('M2', 'M30', '%') and row)
    # G96, G50 S and G92 S are of lathes, whose feeds can begin per turn.
    lines.insert(first - 1, 'G94')
    for name in NEUTRAL[number::MIXED]:
        row = random_of('mixed', name).randint(first, last)
        # G96 gives S another meaning, until G97.
        lines[row:row] = [line_of(name), *(['G97'] if name == 'G96' else [])]
        last += 1
    Judged(imported(tmp_path, '\n'.join(lines)), motions).check()


def test_the_judged_programs_have_enough_of_everything():
    assert len(JUDGED) >= 150
    text = '\n'.join(program for program, _ in JUDGED).upper()
    kinds = [motion[3] for _, motions in JUDGED for motion in motions]
    assert len(kinds) > 1000
    assert kinds.count('A') > 200
    for word in ('G18', 'G19', 'G20', 'G90.1', 'G92.2', 'G52', 'L20', 'G7', 'R', 'P3', 'M98'):
        assert word in text
