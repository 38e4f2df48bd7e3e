# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The grammar of lines: numbers, comments, and the forms that printers have."""

from gcode_programs import imported, positions, refusal, remarks, switched
import numpy as np
import pytest

from ur_cartesian_driver.importing import BrokenFile, import_file

HERE = 'G21 G90\nG1 X1 Y1 Z1 F600\n'


@pytest.mark.parametrize(
    ('line', 'x'),
    [
        ('G1 X+3', 3.0),
        ('G1 X-.5', -0.5),
        ('G1 X3.', 3.0),
        ('G1 X003.50', 3.5),
        ('g1x3', 3.0),
        ('G01X3', 3.0),
        ('G1. X3', 3.0),
        ('X3G1', 3.0),
        ('G 1 X 1 2 . 5', 12.5),
        ('\tG1\tX\t3', 3.0),
        ('N10 G1 X3', 3.0),
        ('N10.5X3', 3.0),
        ('N7 G1 X3*85', 3.0),
        ('G1 X3 ; X4 (no', 3.0),
        ('G1 (X4; ) X3', 3.0),
        ('G1 X3 E5', 3.0),
        ('G1X3E5.5', 3.0),
        ('G1X3 E5', 3.0),
        ('G92E0\nX3', 3.0),
        ('N5\nN6*12\n*12\n \t\nX3', 3.0),
        ('G1E5F300X3', 3.0),
        ('T1 H1 F100\nX3', 3.0),
    ],
)
def test_a_number_is_read_as_the_grammar_says(tmp_path, line, x):
    assert positions(imported(tmp_path, HERE + line))[-1] == pytest.approx([x, 1.0, 1.0])


@pytest.mark.parametrize(
    ('line', 'said'),
    [
        ('G1 X1e1', "'G1 X1e1' has an exponent"),
        ('G1 Y2.5e-05', "'G1 Y2.5e-05' has an exponent"),
        ('G1 Y2.5E-05 (x)', "'G1 Y2.5E-05 (x)' has an exponent"),
        ('G1 X1 F-1.08e+006', 'has an exponent'),
        ('G1X1E5', 'the word of an extruder needs a blank before'),
        ('G1 X-', 'X has no number'),
        ('G1 X--5', 'X has no number'),
        ('G1 X+-5', 'X has no number'),
        ('G1 X.', 'X has no number'),
        ('G1 X', 'X has no number'),
        ('G1 X Y5', 'X has no number'),
        ('G X5', 'G has no number'),
        ('M', 'M has no number'),
        ('G1 X1.2.3', 'two points'),
        ('G1 X1..2', 'two points'),
        ('G1 X' + '9' * 400, 'has a number of more than 15 digits'),
        ('G1 X1 X2', 'X is there twice'),
        ('G1 X1 F10 F20', 'F is there twice'),
        ('G1 X1,5', 'is no G-code'),
        ('G1 X\u0661', 'X has no number'),
        ('G1 X1\xa0Y2', 'is no G-code'),
        ('G1 \u0131 5', 'is no G-code'),
        ('G1 X(5)5', 'a comment divides a word'),
        ('G1 X5(0)0', 'a comment divides a word'),
        ('G1 X5 (a (b) c)', 'has a parenthesis without the other one'),
        ('G1 X5 (a', 'has a parenthesis without the other one'),
        ('G1 X5 a)', 'has a parenthesis without the other one'),
        ('N1 G1 X5 N5', 'N5 belongs to no code'),
        ('G1 X5~Y3', 'is no G-code'),
        ('X_5', 'is no G-code'),
        ('G1 N5 X5', 'N5 belongs to no code'),
        ('G1 X5 O3', 'O3 belongs to no code'),
        ('G1 X5 L3', 'L3 belongs to no code'),
        ('G1 X5 Q3', 'Q3 belongs to no code'),
        ('G1 X5 H1', 'H1 belongs to no code'),
        ('G1 X5 P2', 'G1 is a line, and has no P'),
        ('G1 X5 I2 J3', 'G1 is a line, and has no I and J'),
        ('G0 X5 R3', 'G0 is a line, and has no R'),
        ('G1 X5 *', 'is no G-code'),
        ('G1 X#1', 'has #, which is not read'),
        ('G1 X[1+2]', 'has [, which is not read'),
        ('R1=5', 'has =, which is not read'),
        ('G1 X=IC(5)', 'has =, which is not read'),
        ('o<turn> call [1]', 'o-word is not read'),
        ('O100 if [#1 GT 5]', 'o-word is not read'),
        ('IF [#1 EQ 0] GOTO 10', 'IF is not read'),
        ('TRANS X10 Y5', 'is no G-code'),
        ('TRANS X=10', 'has =, which is not read'),
        ('ROT RPL=30', 'has =, which is not read'),
        ('DIAMON', 'is no G-code'),
        ('CYCLE81(10,0,2,-5)', 'is no G-code'),
        ('L X+10 Y+5 R0 FMAX', 'has no number'),
        ('G1 X10 FMAX', 'F has no number'),
        ('MSG("hello")', 'is no G-code'),
        ('G70', 'G70 is not read: a cycle; let the CAM write single moves; or inches: write G20'),
        ('G71', 'or millimetres: write G21'),
        ('G5 X5 P2', 'G5 is not read: splines'),
        ('0  BEGIN PGM 12 MM', "'0  BEGIN PGM 12 MM' begins with a number without a letter"),
        ('T0 P0', 'P0 belongs to no code of its line'),
        ('M3 P100 S255', 'P100 belongs to no code of its line'),
        ('G1 X5 F0', 'F0 is no feed'),
        ('G1 X5 F-10', 'F-10 is no feed'),
        ('G0 G1 X5', 'G0 and G1 exclude each other'),
        ('G90 G91 X5', 'G90 and G91 exclude each other'),
        ('G20 G21', 'G20 and G21 exclude each other'),
        ('M3 M5', 'M3 and M5 exclude each other'),
        ('G17 G18', 'G17 and G18 exclude each other'),
        ('G1 G92 X0', 'G92 and a motion cannot share X'),
        ('G4 G1 X5', 'G4 and a motion cannot share X'),
        ('M3 G4 S2', 'S could belong to G4 or not; give G4 a line of its own'),
        ('G1 Y5 G4 F2', 'F could belong to G4 or not; give G4 a line of its own'),
        ('G50 M3 S900', 'S could belong to G50 or not; give G50 a line of its own'),
        ('G92 S900 M3', 'S could belong to G92 or not; give G92 a line of its own'),
        ('G50 S900 X5', 'G50 X is not read'),
        ('G2 X2 I0.5 G64 P2', 'G64 and a motion cannot share P'),
        ('G61 G64 P0.1', 'G61 and G64 exclude each other'),
        ('G61 P0.1', 'P0.1 belongs to no code of its line'),
        ('G64 P-0.1', 'G64 P-0.1 is no tolerance'),
        ('G64 P0.1 Q-1', 'G64 Q-1 is no tolerance'),
        ('M62 P1 G64', 'P could belong to G64 or M62; give it a line of its own'),
        ('M3 S50 M1', 'S could belong to M1 or not; give M1 a line of its own'),
        ('G80 X5', 'coordinates without G0, G1, G2 or G3 since G80'),
        ('G1 X5 ,R2.', 'has ,R, which is not read: it rounds or chamfers a corner'),
        ('O<LID> SUB', 'o-word is not read'),
        ('G20 F10', 'F beside G20 is of one unit or the other'),
        ('G1 X2 M104 S200', 'S could belong to M104 or not'),
        ('M80 G0 X10 "a"', 'is no G-code'),
    ],
)
def test_what_cannot_be_meant_is_one_sentence_with_its_line(tmp_path, line, said):
    text = refusal(tmp_path, HERE + line + '\nG1 X2\n')
    assert text.startswith('line 3: ')
    assert said in text
    assert text.endswith('.')
    assert '\n' not in text


@pytest.mark.parametrize(
    'line',
    [
        'M205 X8 Y8',
        'M851 Z-1.2',
        'M600 X0 Y0 Z20',
        'M201 X9000 Y9000 Z500 E10000',
        'M92 X80 Y80 Z400 E93',
        'M203 X500 Y500 Z12 E120',
        'M206 X1 Y2 Z3',
        'M290 Z0.1',
        'M420 S1 Z10',
        'M574 X1 Y1 Z1 S0',
        'M906 X800 Y800 Z800',
        'M862.3 P "MK3S"',
        'M115 U3.13.2',
        'M900 K0.05',
        'M301 P19.86 I1.0 D98.93',
        'M486 AName',
        'M486 Alid(1).stl',
        'M117 layer 1(2)3',
        'EXCLUDE_OBJECT_START NAME=lid(1).stl',
        'M84 X Y E',
        'M84XYE',
        'N5 M84 X Y',
        'M204 S5000',
        'M204 P1250 R1250 T1250',
        'M104 S215',
        'M73 P0 R10',
        'G29.1 Z-0.02',
        'M117 G1 X50 Y60',
        'M118 E1 P0 done',
        'M23 /part.gco',
        'M32 "part.gco"',
        'M587 S"net" P"G1 X5"',
        'M569 P0.0 S1',
        'M970.3 Q1 A7 B30 C80 H15 K0',
        'M0 Click to continue',
        'M1 P5000 Turn the part',
        'M620 S0A',
        'EXCLUDE_OBJECT_DEFINE NAME=x POLYGON=[[1,2],[3,4]]',
        'SET_VELOCITY_LIMIT ACCEL=3000',
        'SAVE_GCODE_STATE NAME=a',
        'BEEP',
    ],
)
def test_commands_of_printers_own_their_words(tmp_path, line):
    found = imported(tmp_path, f'{HERE}{line}\nG1 X2\n')
    assert positions(found) == pytest.approx(np.array([[1, 1, 1], [2, 1, 1]]))
    assert found.goal.segments.velocities.tolist() == pytest.approx([0.01, 0.01])
    (said,) = remarks(found)
    name = line.split()[1 if line[0] == 'N' else 0]
    assert said.startswith('line 3: ')
    assert said.split(': ')[1] in (name, name.upper(), 'M84', 'E')


@pytest.mark.parametrize('end', ['M2', 'M30', 'm02', 'N99 M30', '%', 'G1 X3 M30'])
def test_what_stands_behind_the_end_is_said_and_not_read(tmp_path, end):
    text = f'%\n{HERE}{end}\nG1 X9\n(comment)\n\n%\nthis is [no] G-code\n'
    found = imported(tmp_path, text)
    assert positions(found)[-1, 0] == (3.0 if 'X3' in end else 1.0)
    assert remarks(found) == ['lines 5, 9: not executed: the program ends in line 4']


def test_a_percent_sign_begins_a_program_once(tmp_path):
    found = imported(tmp_path, f'(MSG, before)\n%\nO1 (name)\n{HERE}G1 X2\n')
    assert len(positions(found)) == 2
    # Without one at the beginning, one is the end.
    assert len(positions(imported(tmp_path, f'{HERE}%\nG1 X2\n'))) == 1


@pytest.mark.parametrize('line', ['%wait', '%global.x=5', '%_N_L10_SPF'])
def test_a_percent_sign_with_a_text_is_no_end(tmp_path, line):
    assert refusal(tmp_path, f'%100\n{HERE}{line}\nG1 X2\n') == (
        f"line 4: '{line}' ends no program; % alone does."
    )
    assert len(positions(imported(tmp_path, f'{HERE}N9 % (end)\nG1 X2\n'))) == 1


def test_lines_under_a_condition_of_a_printer_are_left_out(tmp_path):
    text = HERE + 'M1002 judge_flag x\nM622 J1\n  G1 X5 {what}\n  G29\nM623\nX2\nG1 X3 Y1 Z1\n'
    found = imported(tmp_path, text)
    assert positions(found) == pytest.approx(np.array([[1, 1, 1], [3, 1, 1]]))
    said = remarks(found)
    assert 'lines 5-6: a line under a condition: whether its condition holds is not known' in said
    assert 'line 8: a move: the position in Y and Z is not known since line 4' in said
    assert refusal(tmp_path, HERE + 'M622 J1\nG1 X5\n') == (
        'line 3: M622 begins a condition, and no M623 ends it.'
    )


@pytest.mark.parametrize('line', ['P0 S1', 'N4 P0 S1 L2 D0', 'T1 S1 L0 D0', 't1s1l1'])
def test_the_tool_is_elsewhere_after_a_printer_has_changed_heads(tmp_path, line):
    found = imported(tmp_path, f'{HERE}{line}\nG1 Y5\nG1 X7\nG1 Z8\n')
    assert positions(found) == pytest.approx(np.array([[1, 1, 1], [7, 5, 8]]))
    assert remarks(found)[0].startswith('line 3: ')
    assert remarks(found)[0].endswith('where its tools are parked is not known')
    assert not switched(found)


@pytest.mark.parametrize('first', ['O0012 <BRACKET 7>', '<BRACKET-7>', 'O12'])
def test_a_program_may_have_a_name(tmp_path, first):
    assert len(positions(imported(tmp_path, f'%\n{first}\n{HERE}G1 X2\nM30\n%\n'))) == 2


def test_g53_without_coordinates_holds_for_nothing(tmp_path):
    found = imported(tmp_path, f'{HERE}G53\nG1 X2\n')
    assert positions(found) == pytest.approx(np.array([[1, 1, 1], [2, 1, 1]]))
    assert remarks(found) == ['line 3: G53: it holds for its line, which has no coordinates']


def test_coordinates_before_any_motion_code_are_a_travel(tmp_path):
    found = imported(tmp_path, 'G21 G90\nG43 H1 X1 Y2 Z3\nX5\n')
    assert positions(found) == pytest.approx(np.array([[1, 2, 3], [5, 2, 3]]))
    assert 'line 2: no G0 to G3 before: a line, as after power-up' in remarks(found)


def test_messages_are_said_beside_words(tmp_path):
    found = imported(tmp_path, f'{HERE}G1 X2 (MSG, turn the part)\n(debug, #5)\n(plain)\n')
    assert positions(found)[-1, 0] == pytest.approx(2.0)
    assert remarks(found) == ['line 3: (MSG,: a message', 'line 4: (DEBUG,: a message']


@pytest.mark.parametrize(
    'line',
    [
        *('start_print bed=60', 'PAUSE', 'PARK', 'RESUME', 'QUAD_GANTRY_LEVEL', '_CLEAR_VARS'),
        *('BED_MESH_CALIBRATE', 'SET_KINEMATIC_POSITION X=0', 'SET_GCODE_OFFSET Z=1'),
    ],
)
def test_the_tool_is_elsewhere_after_a_macro(tmp_path, line):
    found = imported(tmp_path, f'{HERE}{line}\nG1 Y5\nG1 X7\nG1 Z8\n')
    assert positions(found) == pytest.approx(np.array([[1, 1, 1], [7, 5, 8]]))
    name = line.split()[0].upper()
    assert f'line 3: {name}: a command or a macro whose moves are not in the file' in (
        remarks(found)
    )


def test_names_of_a_sinumerik_are_calls(tmp_path):
    for line in ('MY_PART', 'M17', 'SET_UP', 'PARK'):
        file = tmp_path / 'part.mpf'
        file.write_text(f'{HERE}{line}\nG1 X2\n')
        with pytest.raises(BrokenFile, match=f'^line 3: {line} is not read: it calls or ends'):
            import_file(file)


def test_saved_modes_are_not_guessed(tmp_path):
    state = '{0}_GCODE_STATE NAME=a\n'
    text = f'{HERE}{state.format("SAVE")}G91\nG1 Z5\n{state.format("RESTORE")}G1 X10 Y10 Z0\n'
    assert refusal(tmp_path, text).startswith(
        'line 6: RESTORE_GCODE_STATE is not read: it restores modes'
    )
    text = f'{HERE}M120\nG91\nG1 Z5\n%sM121\nG1 X10 Y10 Z0\n'
    assert refusal(tmp_path, text % '').startswith('line 6: M121 restores G90 or G91 of M120')
    assert positions(imported(tmp_path, text % 'G90\n'))[-1] == pytest.approx([10, 10, 0])
    # Marlin: the switches of the ends of axes.
    assert positions(imported(tmp_path, f'{HERE}M121\nG1 X2\nM120\nG1 X3\n'))[-1, 0] == 3.0
