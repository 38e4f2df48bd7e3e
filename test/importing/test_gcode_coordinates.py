# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Positions of a program: its start, offsets, and places of the machine.

They are worked out by hand from the documents of LinuxCNC, GRBL and Marlin.
"""

import re

from gcode_programs import imported, positions, refusal, remarks
import numpy as np
import pytest


def path_of(tmp_path, text):
    return positions(imported(tmp_path, 'G21\nF600\n' + text)).round(4).tolist()


@pytest.mark.parametrize(
    ('begin', 'first'),
    [
        ('G92 X0 Y0 Z0\nG1 X10', [0, 0, 0]),
        ('G91\nG1 X10', [0, 0, 0]),
        ('G91 G1 X10', [0, 0, 0]),
        ('G10 L20 P0 X0 Y0 Z0\nG1 X10', [0, 0, 0]),
        ('G10 P1 L20 X0 Y0 Z0\nG1 X10', [0, 0, 0]),
        ('G92 X4 Y5 Z6\nG1 X10', [4, 5, 6]),
        ('G28\nG92 X0 Y0 Z0\nG1 X10', [0, 0, 0]),
    ],
)
def test_a_begin_that_is_said_is_the_first_point(tmp_path, begin, first):
    end = [10.0, *first[1:]]
    assert path_of(tmp_path, begin) == [first, end]


def test_a_begin_is_said_in_a_remark(tmp_path):
    found = remarks(imported(tmp_path, 'G21 F60\nG92 X0 Y0\nG1 X10\nZ-1 Y2\n'))
    assert 'line 2: G92 before a motion in XY: the program begins there' in found
    assert 'lines 3: a move: the position in Z is not known yet' not in found
    assert 'line 3: a move: the position in Z is not known yet' in found
    found = remarks(imported(tmp_path, 'G21 F60 G91\nG1 X10\nY2\n'))
    assert 'X begins with an increment: it counts from X 0' in found
    assert 'no Z in the file: Z is 0' in found


def test_a_program_of_increments_keeps_its_first_stretch(tmp_path):
    square = 'G91\nG1 X10\nY10\nX-10\nY-10\nG90\nG0 X0 Y0\nM2\n'
    assert path_of(tmp_path, square) == [
        [0, 0, 0], [10, 0, 0], [10, 10, 0], [0, 10, 0], [0, 0, 0],
    ]  # fmt: skip
    assert path_of(tmp_path, 'G91\nG1 X10 Z1\nG90\nX5 Y5\nX6\n') == [[5, 5, 1], [6, 5, 1]]


def test_a_move_before_all_axes_are_known_is_left_out(tmp_path):
    assert path_of(tmp_path, 'G0 Z5\nZ4\nX1 Y2\nX3\n') == [[1, 2, 4], [3, 2, 4]]
    # The lift of a slicer before homing says nothing about X and Y.
    assert path_of(tmp_path, 'G91\nG1 Z5\nG90\nG28\nG1 X1 Y2 Z3\nX4\n') == [[1, 2, 3], [4, 2, 3]]


@pytest.mark.parametrize('code', ['G28', 'G30', 'G29', 'G32', 'G27 P2', 'G28 W'])
def test_after_a_place_of_the_machine_nothing_is_invented(tmp_path, code):
    text = f'G1 X1 Y2 Z3\n{code}\nG91\nG1 X5\nG90\nX1\nY9\nG2 X5 Y13 I4\nG1 Z3\nX6\n'
    found = imported(tmp_path, 'G21 F600\n' + text)
    assert positions(found).round(4).tolist() == [[1, 2, 3], [5, 13, 3], [6, 13, 3]]
    said = remarks(found)
    assert 'line 5: a move: the position in X and Y and Z is not known since line 3' in said
    assert 'line 9: G2 from an unknown place: only its end is taken' not in said
    assert 'lines 8-9: a move: the position in Z is not known since line 3' in said
    assert 'line 10: a contour begins elsewhere: straight to it, without lift' in said


def test_the_tool_is_lifted_after_a_gap(tmp_path):
    text = 'G21 F600\nG1 X1 Y2 Z3\nX9\nG28 Z0\nX5\nZ3\n'
    found = imported(tmp_path, text, lift=0.02)
    assert positions(found).round(3).tolist() == [
        [1, 2, 3], [9, 2, 3], [9, 2, 23], [5, 2, 23], [5, 2, 3],
    ]  # fmt: skip


@pytest.mark.parametrize(
    ('text', 'known'),
    [
        ('G28 Z0\nX5', False),
        ('G28 Z0\nX5 Z7', True),
        ('G28 X0 Y0\nX5 Y2', True),
        ('G91 G28 Z0\nG90\nX5', False),
        ('G0 G28 Z0\nX5', False),
        ('G53 G0 Z0\nX5', False),
        ('G53 Z-5\nZ7 X5', True),
        ('G28.1\nX5', True),
        ('G28 A0\nX5', True),
        ('M125\nX5', False),
        ('$H\nX5', False),
        ('$32=1\nX5', True),
        ('G29.1 Z0.1\nX5', True),
    ],
)
def test_only_the_axes_that_went_away_are_unknown(tmp_path, text, known):
    points = path_of(tmp_path, f'G1 X1 Y2 Z7\n{text}\n')
    assert points == ([[1, 2, 7], [5, 2, 7]] if known else [[1, 2, 7]])


@pytest.mark.parametrize(
    ('text', 'x'),
    [
        ('G92 X0\nG1 X5', 15),
        ('G92 X0\nG92.1\nG1 X5', 5),
        ('G92 X0\nG92.2\nG1 X5\nG92.3\nX5', 15),
        ('G92 X3\nG1 X4\nG92 X0\nG1 X5', 16),
        ('G52 X20\nG1 X5', 25),
        ('G52 X20\nG52 X0\nG1 X5', 5),
        ('G52 X20\nG52 X1\nG1 X5', 6),
        ('G52 X20\nG92.1\nG1 X5', 5),
        ('G52 X20\nG92 X0\nG1 X5', 15),
        ('G91\nG92 X0\nG1 X5\nG90\nX6', 16),
        ('G10 L20 P1 X0\nG1 X5', 15),
        ('G10 L20 P1 X0\nG92 X0\nG92.1\nG1 X5', 15),
        ('G10 L20 P2 X0\nG1 X5', 5),
        ('G7\nG92 X0\nG1 X10', 15),
        ('G20\nG92 X0\nG1 X1', 35.4),
        ('G92 E0\nG1 X5', 5),
    ],
)
def test_offsets_move_the_coordinates(tmp_path, text, x):
    assert path_of(tmp_path, f'G1 X10 Y0 Z0\n{text}\n')[-1] == [x, 0, 0]


@pytest.mark.parametrize(
    ('text', 'said'),
    [
        ('G92', 'line 3: G92 without coordinates'),
        ('G52', 'line 3: G52 without coordinates'),
        ('G92.3', 'line 3: G92.3 without G92.2 before'),
        ('G92 X0\nG52 X5', 'line 4: G52 while G92 is in use'),
        ('G92 X0\nG10 L20 P1 X5', 'line 4: G10 L20 while G92 is in use'),
        ('G10 L2 P1 X5', 'line 3: G10 L2 moves or turns the frame in use'),
        ('G10 L3 P1 X5', 'line 3: G10 is not known'),
        ('G28\nG92 X0', 'line 4: X is set while the position in it is not known, since line 3'),
        ('G55', 'line 3: G55 is a second work offset after G54'),
        ('G54.1 P3', 'line 3: G54.1 P3 is a second work offset after G54'),
        ('G68 X0 Y0 R30', 'line 3: G68 is not read'),
        ('G51 X0 Y0 P2', 'line 3: G51 is not read'),
        ('G50 X5 Z5', 'line 3: G50 X is not read'),
        ('G16', 'line 3: G16 is not read'),
        ('W5', 'line 3: W is not read'),
        ('G1 U5', 'line 3: U is not read'),
    ],
)
def test_what_would_move_later_coordinates_in_an_unknown_way_is_refused(tmp_path, text, said):
    sentence = refusal(tmp_path, f'G21 F600\nG1 X10 Y0 Z0\n{text}\nX5\n')
    assert sentence.startswith(said)


def test_after_an_offset_without_its_origin_nothing_is_invented(tmp_path):
    # G92 defined the frame; where the coordinates without it begin is not known.
    text = 'G92 X0 Y0 Z0\nG1 X10\nG92.1\nX3\n'
    assert path_of(tmp_path, text) == [[0, 0, 0], [10, 0, 0]]
    # Marlin ends G92 by homing, LinuxCNC does not.
    text = 'G1 X1 Y1 Z1\nG92 X0\nG28 X0\nX3\nX4\n'
    found = imported(tmp_path, 'G21 F600\n' + text)
    assert len(positions(found)) == 1
    assert 'lines 5-6: a move: the position in X is not known since line 4' in remarks(found)


def test_an_axis_that_no_line_names_is_zero(tmp_path):
    assert path_of(tmp_path, 'G28\nG0 X1 Y1\nG28\nX2 Y2\nG91 X1\n') == [
        [1, 1, 0], [2, 2, 0], [3, 2, 0],
    ]  # fmt: skip
    found = imported(tmp_path, 'G21 F60\nM851 Z-1.2\nG28 Z\nG0 X1 Y1\nX2 (Z5)\n')
    assert 'no Z in the file: Z is 0' in remarks(found)


def test_a_program_without_a_known_place_is_refused_with_the_reasons(tmp_path):
    said = refusal(tmp_path, 'G21\nG0 Z5\nG28\nG91\nG1 X5 F60\nY2\n')
    assert said.startswith('there is no point of a path in the file; left out: ')
    assert 'line 2: a move: the position in X and Y is not known yet' in said


def test_units_may_change(tmp_path):
    text = 'G20 G1 X1 Y0 Z0 F10\nG21 X10\nG91 X1\nG20 X1\n'
    found = imported(tmp_path, text)
    assert positions(found)[:, 0] == pytest.approx([25.4, 10.0, 11.0, 36.4])
    # The feed stays the same.
    assert found.goal.segments.velocities == pytest.approx(np.full(4, 10 * 0.0254 / 60))


def test_the_diameter_mode_halves_x(tmp_path):
    text = 'G18 G7 G1 X20 Z0 Y0\nG91 X4\nG90\nG3 X28 Z-2 I0 K-2\nG8 G1 X20\n'
    assert path_of(tmp_path, text) == [
        [10, 0, 0], [12, 0, 0], [14, 0, -2], [20, 0, -2],
    ]  # fmt: skip


def test_the_radii_of_a_lathe_are_said(tmp_path):
    found = imported(tmp_path, 'G21 G18\nG50 S2000\nG96 S200 M3\nG0 X10 Z5\nG1 Z0 F100\n')
    assert 'X of a lathe: a radius, because there is no G7' in remarks(found)
    for mark in (
        'G50 S2000',
        'G92 S2000',
        'G28 U0 W0',
        'G99\nG1 X9 F0.2',
        'G1 X9 F100\nG97 G99\nX8 F.2',
    ):
        found = imported(tmp_path, f'G21 G18\n{mark}\nG0 X10 Z5\nG1 Z0\n')
        assert 'X of a lathe: a radius, because there is no G7' in remarks(found)
    for other in (
        'G50',
        '(G96)',
        'G28 W',
        'G28 U0 V0',
        'G99\nG98\nG1 X9 F100',
        'G92 X0',
        'G1 X9 F100\nG99',
    ):
        found = imported(tmp_path, f'G21 G18\n{other}\nG0 X10 Z5\nG1 Z0\n')
        assert not any('X of a lathe' in text for text in remarks(found))
    found = imported(tmp_path, 'G21 G18 G8\nG96 S200 M3\nG0 X10 Z5\nG1 Z0 F100\n')
    assert not any('X of a lathe' in text for text in remarks(found))


@pytest.mark.parametrize(
    ('text', 'sentence'),
    [
        ('G21 G99\nG0 X52. Z2.\nG92 X48. Z-30. F1.5\nX47.4\nG0 X60. Z5.\n', 'G92 .*a threading'),
        ('G21 G98\nG0 X52. Z2.\nG92 X48. Z-30. F1.5\n', 'G92 with X or Z is a threading'),
        ('G21 G99\nG0 X52. Z2.\nG90 X48. Z-30. F0.2\nX44.\n', 'G90 with X or Z is a turning'),
        ('G21 G98\nG0 X52. Z2.\nG94 X48. Z-30. F100.\nG96 S200\n', 'G94 with X or Z is a turn'),
    ],
)
def test_the_cycles_of_a_lathe_are_refused(tmp_path, text, sentence):
    said = refusal(tmp_path, text)
    assert re.match(f'line 3: {sentence}.* cycle.*; let the CAM write single moves', said)


def test_modes_beside_the_moves_of_a_lathe_are_no_cycles(tmp_path):
    text = 'G21 G96 S200\nG90 G0 X2 Z3\nG94 G1 X4 Z5 F100\nG90 F90\nG92 X4\nG92 E0 F90\n'
    found = imported(tmp_path, text)
    assert positions(found) == pytest.approx(np.array([[2, 0, 3], [4, 0, 5]]))
    mill = imported(tmp_path, 'G21 G94\nG0 X1 Z1\nG90 X2 Z3\n')
    assert positions(mill) == pytest.approx(np.array([[1, 0, 1], [2, 0, 3]]))


@pytest.mark.parametrize('line', ['G1 X50. A45.', 'Z-20. C2.'])
def test_angles_and_chamfers_of_a_lathe_are_refused(tmp_path, line):
    said = refusal(tmp_path, f'G21 G18 G1 X40. Z0. F100\n{line}\nG96 S200\n')
    assert said.startswith(f'line 2: {line[-4 if "A" in line else -3]} is not read: on a lathe')
    assert len(positions(imported(tmp_path, f'G21 G18 G1 X40. Z0. F100\n{line}\n'))) == 2


def test_a_feed_per_turn_is_no_speed(tmp_path):
    text = 'G21 G99\nG0 X10 Y0 Z5\nG1 Z0 F0.2\nG98\nG1 Z1 F60\n'
    found = imported(tmp_path, text)
    assert found.goal.segments.velocities.tolist() == pytest.approx([0.0, 0.0, 0.001])
    assert 'line 3: word F: after G99 a lathe gives it per turn, so it is no speed' in (
        remarks(found)
    )
    assert "line 3: G1 without F: its speed is the driver's" in remarks(found)


@pytest.mark.parametrize('mark', ['G50 S2500', 'G96 S180', 'G28 U0. W0.', 'G30 X5 U0'])
@pytest.mark.parametrize(('mode', 'speed'), [('', 0.0), ('G98', 0.001), ('G94', 0.001)])
def test_a_feed_of_a_lathe_is_a_speed_if_the_program_says_so(tmp_path, mark, mode, speed):
    found = imported(tmp_path, f'G21 {mode}\n{mark}\nG0 X10 Y0 Z5\nG1 Z0 F60\n')
    assert found.goal.segments.velocities[-1] == pytest.approx(speed)
    said = 'line 4: word F: per turn or per minute, as the lathe is set; write G98 or G99'
    assert (said in remarks(found)) == (not mode)
