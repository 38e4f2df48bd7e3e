# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Subprograms: Fanuc's M98 and M99, as LinuxCNC executes them too."""

from gcode_programs import imported, positions, refusal, remarks
import pytest

BEGIN = 'G21 G91 G1 F600 X0 Y0 Z0\n'


def xs(tmp_path, text):
    """The x of all points behind the begin."""
    return positions(imported(tmp_path, BEGIN + text))[1:, 0].round(6).tolist()


@pytest.mark.parametrize(
    ('text', 'expected'),
    [
        ('M98 P100\nX5\nM30\nO100\nX1\nM99\n', [1, 6]),
        ('M98 P100 L3\nM30\nO100\nX1\nM99\n', [1, 2, 3]),
        ('M98 P100 L0\nX5\nM30\nO100\nX1\nM99\n', [5]),
        ('M98 P30100\nM30\nO100\nX1\nM99\n', [1, 2, 3]),
        ('M98 P0030100\nM30\nO100\nX1\nM99\n', [1, 2, 3]),
        # A program with that number is meant before repetitions are.
        ('M98 P30100\nM30\nO100\nX1\nM99\nO30100\nX7\nM99\n', [7]),
        ('M98 P100\nM30\nO0100 (corner)\nX1\nM99\n', [1]),
        ('M98 P100\nM30\n:100\nX1\nM99\n', [1]),
        ('M98 P100\nM30\nN5 O100\nX1\nN9 M99\n', [1]),
        ('X2 M98 P100\nM30\nO100\nX1\nM99\n', [2, 3]),
        ('M98 P1 L2\nM30\nO1\nX1\nM98 P2 L2\nM99\nO2\nX10\nM99\n', [1, 11, 21, 22, 32, 42]),
        ('M98 P100\nX5\nM30\nO100\nX1 M99\nX3\n', [1, 6]),
        ('M98 P100\nX5\nM30\nO100\nX1\nM30\nM99\n', [1]),
    ],
)
def test_subprograms_run_where_they_are_called(tmp_path, text, expected):
    assert xs(tmp_path, text) == expected


def test_a_point_has_the_line_of_the_subprogram(tmp_path):
    found = imported(tmp_path, BEGIN + 'M98 P100 L2\nM30\nO100\nX1\nM99\n')
    assert found.lines.tolist()[-2:] == [5, 5]


@pytest.mark.parametrize(
    ('text', 'said'),
    [
        ('M98 P100\nM30\n', 'line 2: O100 is not in the file, and other files are not read'),
        ('M98 P10000\nM30\n', 'line 2: O10000 is not in the file'),
        ('M98\nM30\n', 'line 2: M98 takes P, the number of a subprogram, L'),
        ('M98 P100 H20\nM30\nO100\nM99\n', 'line 2: M98 takes P, the number of a subprogram, L'),
        ('M98 P1.5\nM30\n', 'line 2: M98 needs a whole P of at least 1, and L from 0 to 9999'),
        ('M98 P-1\nM30\n', 'line 2: M98 needs a whole P of at least 1, and L from 0 to 9999'),
        (
            'M98 P1 L-1\nM30\nO1\nM99',
            'line 2: M98 needs a whole P of at least 1, and L from 0 to 9999',
        ),
        ('M98 (a.g)\nM30\n', 'line 2: M98 takes P, the number of a subprogram, L'),
        ('M98 P<a>\nM30\n', "line 2: 'M98 P<a>' is not read: other files are not read"),
        ('M198 P1\nM30\n', 'line 2: M198 is not read: other files are not read'),
        ('M97 P10\nM30\n', 'line 2: M97 is not read'),
        ('G65 P100\nM30\n', 'line 2: G65 is not read'),
        ('M98 P1\nM30\nO1\nX1\n', 'line 5: the subprogram O1 has no M99'),
        ('M98 P1\nM30\nO1\nX1\nO2\nM99\n', 'line 6: the subprogram O1 reaches O2 without M99'),
        ('M98 P1\nM30\nO1\nM99\nO1\nM99\n', 'line 2: O1 is there twice, in lines 4 and 6'),
        ('M98 P1\nM30\nO1\nM99 P20\n', 'line 5: M99 with a line to continue at (P) is not read'),
        ('M98 P1\nM30\nO1\nM98 P1\nM99\n', 'line 5: subprograms are nested more than 10 deep'),
        ('X1\nO1\nX2\nM99\n', 'line 3: the main program runs into O1; end it by M30 before'),
        (
            'X1\nM99\nO5\nX2\nM30\n',
            'line 3: M99 ends the main program; put the main program first',
        ),
        (
            'M98 P1 L9999\nM30\nO1\nM98 P2 L9999\nM99\nO2\nX0\nM99\n',
            'subprograms would execute more than 200000 lines',
        ),
    ],
)
def test_a_call_that_cannot_be_done_is_refused(tmp_path, text, said):
    assert said in refusal(tmp_path, BEGIN + text)


@pytest.mark.parametrize(
    'end', ['M30', 'M5 M30', 'G0 Z5 M30', '(end) M30', '/M30', 'N90 M02 ; over']
)
def test_a_subprogram_before_the_main_program_is_refused_however_that_ends(tmp_path, end):
    text = f'O1000\n{BEGIN}X1\nM99\nO1\nM98 P1000\nX9\n{end}\n'
    assert 'M99 ends the main program; put the main program first' in refusal(tmp_path, text)


def test_the_end_of_an_endless_main_program_is_said(tmp_path):
    text = BEGIN + 'M98 P1\nM99\nO1\nX3\nM99\n'
    found = imported(tmp_path, text)
    assert positions(found)[-1, 0] == pytest.approx(3.0)
    assert 'line 3: M99 in the main program: it is executed once' in remarks(found)


@pytest.mark.parametrize(
    ('text', 'said'),
    [
        (
            'M98 P1\nM30\n(part)\nO1 (a)\nX1\nM99\nO2\nX5\nM99\n%\n',
            'lines 8-10: not executed: the program ends in line 3',
        ),
        # Two programs in one file, as when files are joined.
        (
            'X1\nM30\n%\n%\nO2\nX9\nM30\n%\n',
            'lines 6-8: not executed: the program ends in line 3',
        ),
    ],
)
def test_lines_that_are_never_executed_are_said(tmp_path, text, said):
    assert said in remarks(imported(tmp_path, BEGIN + text))


def test_the_number_of_the_main_program_is_passed_by(tmp_path):
    found = imported(tmp_path, '%\nO0001 (name)\n' + BEGIN + 'X4\nM30\n%\n')
    assert positions(found)[-1, 0] == pytest.approx(4.0)
    assert not any('O0001' in text for text in remarks(found))
