# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Each row of the table of codes is treated as the table says."""

from gcode_programs import EXAMPLES, imported, line_of, positions, refusal, remarks, switched
import numpy as np
import pytest

from ur_cartesian_driver.importing import Treatment
from ur_cartesian_driver.importing.gcode.codes import CODES, TOOLS_OF_PRINTER

#: The tool at (1, 1, 1) before and at (2, 1, 1) after the line of a term, which is the third.
BEFORE = 'G21 G90 G94\nG1 X1 Y1 Z1 F600\n'
AFTER = '\nG1 X2 Y1 Z1\n'
HERE, THERE = (1, 1, 1), (2, 1, 1)

#: Programs that show the effect of a term: what follows BEFORE, and the points [mm].
EFFECTS: dict[str, tuple[str, list[tuple[float, float, float]]]] = {
    'G0': ('G0 X3', [HERE, (3, 1, 1)]),
    'G1': ('G1 Y3', [HERE, (1, 3, 1)]),
    'G2': ('G2 X2 Y2 I1', [HERE, (2, 2, 1)]),
    'G3': ('G3 X2 Y0 I1', [HERE, (2, 0, 1)]),
    'G80': ('G80\nG0 X3', [HERE, (3, 1, 1)]),
    'X': ('X3', [HERE, (3, 1, 1)]),
    'Y': ('Y3', [HERE, (1, 3, 1)]),
    'Z': ('Z3', [HERE, (1, 1, 3)]),
    'I': ('G2 X2 Y2 I1', [HERE, (2, 2, 1)]),
    'J': ('G3 X2 Y2 J1', [HERE, (2, 2, 1)]),
    'K': ('G18 G2 X2 Z2 K1', [HERE, (2, 1, 2)]),
    'R': ('G2 X2 Y2 R1', [HERE, (2, 2, 1)]),
    # A quarter and a whole turn, 450 degrees in three arcs.
    'P': ('G2 X2 Y2 I1 P2', [HERE, (2.0 + 0.75**0.5, 1.5, 1)]),
    'F': ('G1 X3 F1200', [HERE, (3, 1, 1)]),
    'G61': ('G61\nX3', [HERE, (3, 1, 1)]),
    'G61.1': ('G61.1 X3', [HERE, (3, 1, 1)]),
    'G64 P': ('G64 P0.1\nX3', [HERE, (3, 1, 1)]),
    'G17': ('G18\nG17 G2 X2 Y2 I1', [HERE, (2, 2, 1)]),
    'G18': ('G18 G2 X2 Z2 K1', [HERE, (2, 1, 2)]),
    'G19': ('G19 G2 Y2 Z2 J1', [HERE, (1, 2, 2)]),
    'G20': ('G20 X1', [HERE, (25.4, 1, 1)]),
    'G21': ('G20\nG21 X3', [HERE, (3, 1, 1)]),
    'G90': ('G91\nG90 X3', [HERE, (3, 1, 1)]),
    'G91': ('G91 X3', [HERE, (4, 1, 1)]),
    'G90.1': ('G90.1 G2 X2 Y2 I2 J1', [HERE, (2, 2, 1)]),
    'G91.1': ('G90.1\nG91.1 G2 X2 Y2 I1', [HERE, (2, 2, 1)]),
    'G7': ('G7 X6', [HERE, (3, 1, 1)]),
    'G8': ('G7\nG8 X3', [HERE, (3, 1, 1)]),
    'G52': ('G52 X5\nX-2', [HERE, (3, 1, 1)]),
    'G92': ('G92 X5\nX7', [HERE, (3, 1, 1)]),
    'G92.1': ('G92 X5\nG92.1\nX3', [HERE, (3, 1, 1)]),
    'G92.2': ('G92 X5\nG92.2\nX3', [HERE, (3, 1, 1)]),
    'G92.3': ('G92 X5\nG92.2\nG92.3\nX7', [HERE, (3, 1, 1)]),
    'G10 L20': ('G10 L20 P0 X5\nX7', [HERE, (3, 1, 1)]),
    'M2': ('M2\nX3', [HERE]),
    'M30': ('M30\nX3', [HERE]),
    'M98': ('M98 P7\nM2\nO7\nX3\nM99', [HERE, (3, 1, 1)]),
    'M99': ('M98 P7\nX4\nM2\nO7\nX3\nM99', [HERE, (3, 1, 1), (4, 1, 1)]),
    'O': ('M98 P7\nM2\nO7\nX3\nM99', [HERE, (3, 1, 1)]),
    '%': ('X3\n%\nX4', [HERE, (3, 1, 1)]),
    'N': ('N30 X3', [HERE, (3, 1, 1)]),
    '( )': ('X3 (X4)', [HERE, (3, 1, 1)]),
    ';': ('X3 ;X4', [HERE, (3, 1, 1)]),
    '*': ('N3 X3*71', [HERE, (3, 1, 1)]),
}
#: What is said of these programs.
EFFECTS_SAID = {
    'P': ['line 3: P of an arc: turns in all, as in LinuxCNC; Marlin adds them to the arc'],
    'M2': ['line 4: not executed: the program ends in line 3'],
    'M30': ['line 4: not executed: the program ends in line 3'],
    '%': ['line 5: not executed: the program ends in line 4'],
}
#: Modes that are the default, or end a mode that is refused anyway: they change nothing.
CANCELS = (
    *('G13.1', 'G15', 'G23', 'G40', 'G40.1', 'G49', 'G50', 'G50.1', 'G67', 'G69', 'G94'),
    *('G97', 'G98', 'G99', 'G54'),
)
#: The first work offset is the frame of the file.
FRAMES = tuple(name for name in CODES if CODES[name].group == 'frame' and name != 'G54')
OUTPUTS = ('M3', 'M4', 'M5', 'M7', 'M8', 'M9')


def rows(treatment):
    return [name for name, row in CODES.items() if row.treatment is treatment]


def test_each_honoured_row_has_a_program():
    known = {*EFFECTS, *CANCELS, *FRAMES, *OUTPUTS, 'S'}
    assert known == set(rows(Treatment.HONOURED))


@pytest.mark.parametrize('name', EFFECTS)
def test_a_row_has_its_effect(tmp_path, name):
    text, expected = EFFECTS[name]
    found = imported(tmp_path, BEFORE + text + '\n')
    assert positions(found)[: len(expected)] == pytest.approx(np.array(expected), abs=1e-6)
    assert name == 'P' or len(positions(found)) == len(expected)
    assert remarks(found) == EFFECTS_SAID.get(name, [])


def test_a_feed_is_a_speed(tmp_path):
    found = imported(tmp_path, BEFORE + 'G1 X3 F1200\nG20 Y1 \nF10\nX2\n')
    assert found.goal.segments.velocities.tolist() == pytest.approx(
        [0.01, 0.02, 0.02, 10 * 0.0254 / 60]
    )


@pytest.mark.parametrize(
    ('line', 'speed'),
    [('G4 P1 F1200', 0.02), ('G4 X1 F1200', 0.02), ('G4 F1200', 0.01), ('G28 F1200', 0.02)],
)
def test_a_feed_beside_another_code_is_a_feed(tmp_path, line, speed):
    found = imported(tmp_path, f'{BEFORE}{line}\nG0 X1 Y1 Z2\nG1 X3\n')
    assert found.goal.segments.velocities[-1] == pytest.approx(speed)


def test_coordinates_are_set_beside_a_power(tmp_path):
    found = imported(tmp_path, f'{BEFORE}G92 X5 M3 S50\nX7\n', 'S=analog:0:100')
    assert positions(found) == pytest.approx(np.array([HERE, (3, 1, 1)]))
    assert [value for _, _, value in switched(found)] == [0.5]


def test_a_length_of_the_tool_beside_the_end_of_a_cycle_moves_nothing_away(tmp_path):
    found = imported(tmp_path, f'{BEFORE}G0 G80 G43 H1 X3\n')
    assert positions(found) == pytest.approx(np.array([HERE, (3, 1, 1)]))
    assert remarks(found) == ['line 3: G43: the length of the tool is in the active TCP']


def test_a_tool_beside_a_way_home_is_said(tmp_path):
    said = remarks(imported(tmp_path, f'{BEFORE}G91 G28 Z0 T2 M6\n'))
    assert 'line 3: word T: tools are not changed' in said


def test_a_work_offset_leaves_p_to_other_codes(tmp_path):
    text = f'G54 G4 P2\n{BEFORE}G54 M98 P7\nM2\nO7\nX3\nM99\n'
    assert positions(imported(tmp_path, text)) == pytest.approx(np.array([HERE, (3, 1, 1)]))


@pytest.mark.parametrize('code', CANCELS)
def test_a_cancel_changes_nothing(tmp_path, code):
    found = imported(tmp_path, BEFORE + code + AFTER)
    assert positions(found) == pytest.approx(np.array([HERE, THERE]))
    assert remarks(found) == []


@pytest.mark.parametrize('code', FRAMES)
def test_the_first_work_offset_is_the_frame_of_the_file(tmp_path, code):
    word = ' P3' if code in ('G54.1', 'G154') else ''
    found = imported(tmp_path, f'{code}{word}\n{BEFORE}{code}{word}{AFTER}')
    assert positions(found) == pytest.approx(np.array([HERE, THERE]))
    assert remarks(found) == []
    said = refusal(tmp_path, f'{BEFORE}{code}{word}{AFTER}')
    assert said.startswith(f'line 3: {code}{word} is a second work offset after G54')


@pytest.mark.parametrize('code', OUTPUTS)
def test_a_code_switches_its_output(tmp_path, code):
    found = imported(tmp_path, BEFORE + code + AFTER, f'{code}=standard:2:1')
    assert switched(found) == [(0, 2, 1.0)]
    assert remarks(found) == []
    assert f'line 3: {code}: no output is given for it' in remarks(
        imported(tmp_path, BEFORE + code + AFTER)
    )


def test_s_drives_its_output(tmp_path):
    found = imported(tmp_path, BEFORE + 'M3 S50' + AFTER, 'M3=standard:1:1', 'S=analog:0:100')
    assert switched(found) == [(0, 0, 0.5), (0, 1, 1.0)]


@pytest.mark.parametrize('topic', dict.fromkeys(row.topic for row in CODES.values()))
def test_a_row_is_left_out_and_said(tmp_path, topic):
    names = [name for name in rows(Treatment.LEFT_OUT) if CODES[name].topic == topic]
    names = [name for name in names if name != 'M622']  # changes the lines behind it
    # All in one program, each in a line of its own.
    found = imported(tmp_path, BEFORE + '\n'.join(map(line_of, names)) + AFTER)
    assert positions(found) == pytest.approx(np.array([HERE, THERE]))
    notes = found.remarks
    for line, name in enumerate(names, start=3):
        has_own_name = name in ('< >', *TOOLS_OF_PRINTER.values())
        of_line = name[0] in 'GM' or (name in EXAMPLES and not has_own_name)
        named = line_of(name).split()[0] if of_line else name
        said = [note for note in notes if line in note.lines and 'contour' not in note.what]
        assert said, name
        assert said[0].what.startswith((named, f'word {named}')), name
        assert said[0].why == CODES[name].reason or name == 'G10 L2', name
    assert names or topic == 'modes'


@pytest.mark.parametrize('name', rows(Treatment.REFUSED))
def test_a_row_is_refused(tmp_path, name):
    example = EXAMPLES.get(name) or (f'{name}5' if name[-1] in 'XZ' else name)
    said = refusal(tmp_path, BEFORE + example + AFTER)
    assert said.startswith('line 3: ')
    assert CODES[name].reason in said


def test_what_no_row_has_is_refused_or_left_out(tmp_path):
    for text in ('G123', 'G3.7', 'FOO', 'HELLO WORLD', 'X1 Q5', 'L3', '@5 ^30'):
        assert refusal(tmp_path, BEFORE + text + AFTER).startswith('line 3: ')
    assert refusal(tmp_path, BEFORE + 'M88 X5' + AFTER).startswith(
        'line 3: X could belong to M88 or not'
    )
