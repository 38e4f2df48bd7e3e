# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Outputs that codes switch: spindles, lasers, pens, coolant."""

from gcode_programs import imported, positions, refusal, remarks, switched
import pytest

BEGIN = 'G21 G90 F600\nG1 X0 Y0 Z0\n'
S = 'S=analog:0:100'


@pytest.mark.parametrize(
    ('text', 'expected'),
    [
        ('M3 S50\nX1\nM5\n', [(0, 0.5), (1, 0.0)]),
        ('S50\nM3\nX1\n', [(0, 0.5)]),
        ('M3\nS50\nX1\n', [(0, 0.5)]),
        # GRBL: a power beside a motion holds for that motion already.
        ('M4 S0\nX1 S20\nX2 S40\nX3\nS0\nX4\n', [(0, 0.0), (0, 0.2), (1, 0.4), (3, 0.0)]),
        ('M3 S50\nX1\nM30\n', [(0, 0.5), (1, 0.0)]),
        ('M3 S50\nX1 M2\nX2', [(0, 0.5), (1, 0.0)]),
        ('M3 S50\nX1\nM5\nS70\nX2\nM3\n', [(0, 0.5), (1, 0.0), (2, 0.7)]),
        ('S50\nX1\n', []),
        # The values of other codes are no power.
        ('M3 S50\nM204 S5000\nM104 S215\nX1\nG4 S3\n', [(0, 0.5)]),
        ('M3 S50 G4 P2\nX1\nG4 P1 S70\nX2\n', [(0, 0.5), (1, 0.7)]),
        ('G96 S999 M3\nX1\nS999\nG97 S30\n', [(1, 0.3)]),
        ('G50 S9999\nM3 S5\nX1\n', [(0, 0.05)]),
    ],
)
def test_s_is_the_power_while_the_spindle_is_on(tmp_path, text, expected):
    found = imported(tmp_path, BEGIN + text, S)
    assert [(row, value) for row, _, value in switched(found)] == expected


def test_a_power_out_of_range_is_refused_when_it_would_act(tmp_path):
    assert refusal(tmp_path, BEGIN + 'M3 S150\nX1\n', S) == (
        'line 3: S150 is not within 0 and 100.'
    )
    assert refusal(tmp_path, BEGIN + 'M3 S-1\nX1\n', S).startswith('line 3: S-1 is not within')
    assert len(positions(imported(tmp_path, BEGIN + 'S150\nX1\n', S))) == 2


def test_a_power_that_never_acts_is_said(tmp_path):
    said = remarks(imported(tmp_path, BEGIN + 'X1 S50\n', S))
    assert 'S without M3 or M4: its output is never switched' in said
    assert 'line 3: word S: no output is given for it' in remarks(
        imported(tmp_path, BEGIN + 'X1 S50\n')
    )


def test_codes_act_before_the_motion_of_their_line_and_the_end_after_it(tmp_path):
    # The order of execution of RS274/NGC: spindle, coolant, motion, end.
    text = BEGIN + 'G1 X10 M3\nG1 X20 M5\nG1 X30 M30\nG1 X40\n'
    found = imported(tmp_path, text, 'M3=standard:2:1', 'M5=standard:2:0', 'M30=standard:3:1')
    assert positions(found)[:, 0] == pytest.approx([0.0, 10.0, 20.0, 30.0])
    assert switched(found) == [(0, 2, 1.0), (1, 2, 0.0), (3, 3, 1.0)]
    (said,) = [text for text in remarks(found) if text.startswith('line 4: M5')]
    assert 'before the motion' in said


def test_the_end_of_a_program_switches_off_what_is_on(tmp_path):
    outputs = ('M3=standard:0:1', 'M5=standard:0:0', 'M8=standard:1:1', 'M9=standard:1:0')
    found = imported(tmp_path, BEGIN + 'M3\nM8\nX1\nM2\n', *outputs)
    assert switched(found) == [(0, 0, 1.0), (0, 1, 1.0), (1, 0, 0.0), (1, 1, 0.0)]
    found = imported(tmp_path, BEGIN + 'M3\nM8\nX1\nM5 M9\nM2\n', *outputs)
    assert switched(found) == [(0, 0, 1.0), (0, 1, 1.0), (1, 0, 0.0), (1, 1, 0.0)]


def test_a_spindle_code_takes_no_word_of_an_arc(tmp_path):
    found = imported(tmp_path, BEGIN + 'G3 M3 I-5 J0\n', 'M3=standard:0:1')
    assert positions(found)[1:].min(axis=0) == pytest.approx([-7.5, -4.3301, 0.0], abs=1e-3)


def test_values_choose_the_output_of_a_code(tmp_path):
    outputs = ('M280 S40=standard:0:0', 'M280 S90=standard:0:1')
    text = BEGIN + 'M280 P0 S90\nX1\nM280 P0 S40\nX2\nM280 P0 S41\nM280 P0 S90.0\n'
    found = imported(tmp_path, text, *outputs)
    assert switched(found) == [(0, 0, 1.0), (1, 0, 0.0), (2, 0, 1.0)]
    assert 'line 7: M280 P0 S41: no output is given for it' in remarks(found)
    pins = ('M62 P0=standard:0:1', 'M62 P1=standard:1:1', 'M63 P1=standard:1:0')
    found = imported(tmp_path, BEGIN + 'M62 P1\nX1\nM62 P0\nM63 P1\n', *pins)
    assert switched(found) == [(0, 1, 1.0), (1, 0, 1.0), (1, 1, 0.0)]


def test_an_output_without_values_for_a_code_with_some_is_refused(tmp_path):
    # M106 S0 is off, M106 S255 is on.
    said = refusal(tmp_path, BEGIN + 'M106 S0\nX1\n', 'M106=standard:0:1')
    assert said == (
        'line 3: M106 S0 has values, and the output of M106 is given without; give one for each, '
        "such as --output-of 'M106 S0=standard:0:1'."
    )
    found = imported(tmp_path, BEGIN + 'M107\nX1\n', 'M107=standard:0:0')
    assert switched(found) == [(0, 0, 0.0)]


def test_a_pen_that_a_spindle_code_lifts(tmp_path):
    outputs = ('M3 S30=standard:0:0', 'M3 S90=standard:0:1', 'M5=standard:0:0')
    text = BEGIN + 'M3S30\nX1\nM3S90\nX2\nS30\nX3\nM3\nM5\n'
    found = imported(tmp_path, text, *outputs)
    assert switched(found) == [(0, 0, 0.0), (1, 0, 1.0), (2, 0, 0.0), (3, 0, 0.0), (3, 0, 0.0)]
    assert not any('word S' in text for text in remarks(found))


def test_a_laser_that_stays_on_in_a_travel_is_said(tmp_path):
    laser = 'G21 G90\nM4 S0\nG0 X0 Y0\nG1 X1 S50 F600\nG0 X2\nG1 X3 S0\nG0 X5\n'
    found = imported(tmp_path, laser, S)
    (said,) = [text for text in remarks(found) if 'G0 while S is on' in text]
    assert said == (
        'line 5: G0 while S is on: the output stays on; a laser mode would switch it off'
    )
    # A spindle turns in a travel too.
    found = imported(tmp_path, laser.replace('Y0', 'Y0 Z1'), S)
    assert not any('G0 while S is on' in text for text in remarks(found))
