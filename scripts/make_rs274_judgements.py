# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Write test/importing/files/rs274.json: random programs, and their motions by LinuxCNC.

Needs `rs274` of LinuxCNC (Debian: linuxcnc-uspace) and a file with a table of one tool::

    echo 'T1 P1 Z0 D0' > tool.tbl
    python scripts/make_rs274_judgements.py rs274 tool.tbl
"""

from __future__ import annotations

from collections.abc import Iterator
import json
from pathlib import Path
import random
import re
import subprocess
import sys
from tempfile import TemporaryDirectory

TESTS = Path(__file__).resolve().parents[1] / 'test'
FILE = TESTS / 'importing' / 'files' / 'rs274.json'
PROGRAMS = 200
_CALL = re.compile(r'\s*\d+ N\S*\s+(\w+)\((.*)\)')
_PLANES = {'XY': (0, 1, 2), 'XZ': (2, 0, 1), 'YZ': (1, 2, 0)}


def canonical(program: str, rs274: str, tools: str) -> list[list[object]] | None:
    """
    Return the motions of a program, each with its state; None = the interpreter refuses it.

    A motion is ``[spindle, power, coolant, kind, end, feed]``, and of an arc also its axes, its
    centre and its turns; lengths are in mm, feeds in mm/min.
    """
    with TemporaryDirectory() as folder:
        file, numbers = Path(folder) / 'p.ngc', Path(folder) / 'p.var'
        file.write_text(program)
        numbers.touch()
        ran = subprocess.run(
            [rs274, '-t', tools, '-v', str(numbers), '-g', str(file)],
            capture_output=True,
            text=True,
            check=False,
        )
    calls = [
        (match[1], match[2]) for line in ran.stdout.splitlines() if (match := _CALL.match(line))
    ]
    ends = 'PROGRAM_END' in [name for name, _ in calls] or '%' in program
    if ran.returncode or not ends:
        return None
    return list(_motions(calls))


def _motions(calls: list[tuple[str, str]]) -> Iterator[list[object]]:
    unit, plane, feed = 1.0, (0, 1, 2), 0.0
    frame, preset = [0.0] * 3, [0.0] * 3
    spindle, power, coolant = 'M5', 0.0, ''
    for name, text in calls:
        values = [float(each) for each in re.findall(r'-?\d+\.?\d*(?![\w.])', text)]
        if name == 'USE_LENGTH_UNITS':
            unit = 25.4 if 'INCHES' in text else 1.0
        elif name == 'SELECT_PLANE':
            plane = _PLANES[text[-2:]]
        elif name == 'SET_G5X_OFFSET':
            frame = [unit * value for value in values[1:4]]
        elif name == 'SET_G92_OFFSET':
            preset = [unit * value for value in values[:3]]
        elif name == 'SET_FEED_RATE':
            feed = unit * values[0]
        elif name == 'SET_SPINDLE_SPEED':
            power = values[-1]
        elif name in ('START_SPINDLE_CLOCKWISE', 'START_SPINDLE_COUNTERCLOCKWISE'):
            spindle = 'M4' if 'COUNTER' in name else 'M3'
        elif name == 'STOP_SPINDLE_TURNING':
            spindle = 'M5'
        elif name in ('MIST_ON', 'FLOOD_ON', 'MIST_OFF', 'FLOOD_OFF'):
            coolant = {'MIST_ON': 'M7', 'FLOOD_ON': 'M8'}.get(name, 'M9')
        shift = [a + b for a, b in zip(frame, preset, strict=True)]
        state: list[object] = [spindle, power, coolant]
        if name in ('STRAIGHT_TRAVERSE', 'STRAIGHT_FEED'):
            end = [unit * value + s for value, s in zip(values[:3], shift, strict=True)]
            yield [*state, name[9], rounded(end), round(feed, 4)]
        elif name == 'ARC_FEED':
            a, b, c = plane
            end = [0.0, 0.0, 0.0]
            for axis, value in zip((a, b, c), (values[0], values[1], values[5]), strict=True):
                end[axis] = unit * value + shift[axis]
            centre = [unit * values[2] + shift[a], unit * values[3] + shift[b]]
            turns = int(values[4])
            yield [*state, 'A', rounded(end), round(feed, 4), plane, rounded(centre), turns]


def rounded(values: list[float]) -> list[float]:
    """Return lengths to 0.1 µm."""
    return [round(value, 4) + 0.0 for value in values]


def main() -> None:
    """Write random programs and their motions, until the interpreter has accepted enough."""
    sys.path.insert(0, str(TESTS / 'support'))
    from random_gcode import RandomProgram

    rs274, tools = sys.argv[1:]
    found: list[str] = []
    seed = refused = 0
    while len(found) < PROGRAMS:
        seed += 1
        program = '\n'.join(RandomProgram(random.Random(seed), 12).lines) + '\n'
        motions = canonical(program, rs274, tools)
        if motions is None:
            refused += 1
            continue
        found.append(json.dumps([program, motions], separators=(',', ':')))
    FILE.write_text('[\n' + ',\n'.join(found) + '\n]\n', encoding='utf-8')
    sys.stdout.write(f'{len(found)} programs; the interpreter refused {refused} more\n')


if __name__ == '__main__':
    main()
