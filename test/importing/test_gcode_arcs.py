# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Arcs, circles and helices against their geometry."""

from math import cos, pi, radians, sin

from gcode_programs import imported, positions, refusal, remarks
import numpy as np
import pytest

from ur_cartesian_driver.motion.goal.goal import SegmentType


def vias(found):
    """The middles of arcs (n, 3) [mm]."""
    arcs = np.array(found.goal.segments.types) == SegmentType.CIRCULAR
    return 1e3 * np.array(found.goal.segments.vias)[arcs, :3]


@pytest.mark.parametrize(
    ('plane', 'start', 'arc', 'via'),
    [
        ('G17', 'X1 Y0 Z0', 'G3 X-1 Y0 I-1 J0', (0, 1, 0)),
        ('G17', 'X1 Y0 Z0', 'G2 X-1 Y0 I-1 J0', (0, -1, 0)),
        ('G18', 'X0 Y0 Z1', 'G3 X0 Z-1 K-1', (1, 0, 0)),
        ('G18', 'X0 Y0 Z1', 'G2 X0 Z-1 K-1', (-1, 0, 0)),
        ('G19', 'X0 Y1 Z0', 'G3 Y-1 Z0 J-1', (0, 0, 1)),
        ('G19', 'X0 Y1 Z0', 'G2 Y-1 Z0 J-1', (0, 0, -1)),
        ('G17 G90.1', 'X1 Y0 Z0', 'G3 X-1 Y0 I0 J0', (0, 1, 0)),
        ('G18 G90.1', 'X0 Y0 Z1', 'G3 X0 Z-1 I0 K0', (1, 0, 0)),
    ],
)
def test_half_circles_in_each_plane_turn_the_right_direction(tmp_path, plane, start, arc, via):
    found = imported(tmp_path, f'G21 {plane}\nG0 {start}\n{arc} F60\n')
    places = np.vstack((vias(found), positions(found)))
    assert np.linalg.norm(places - np.array(via), axis=1).min() < 1e-6


@pytest.mark.parametrize(
    ('arc', 'degrees'),
    [
        ('G3 X0 Y10 R10', 90),
        ('G2 X0 Y10 R10', -90),
        ('G3 X0 Y10 R-10', 270),
        ('G2 X0 Y10 R-10', -270),
        ('G3 X-10 Y0 R10', 180),
        ('G2 X-10 Y0 R-10', -180),
        ('G3 I-10', 360),
        ('G2 X10 Y0 I-10 J0', -360),
        ('G3 X0 Y10 I-10 P1', 90),
        ('G3 X0 Y10 I-10 P3', 810),
        ('G2 X0 Y10 I-10 P2', -630),
        ('G3 I-10 P2', 720),
        ('G3 X0 Y10 R10 P2', 450),
    ],
)
def test_the_points_of_an_arc_divide_its_turns_evenly(tmp_path, arc, degrees):
    found = imported(tmp_path, f'G21\nG0 X10 Y0 Z0\n{arc} F60\n')
    through = [
        point for pair in zip(vias(found), positions(found)[1:], strict=True) for point in pair
    ]
    # The short way with a radius has another centre than the origin.
    centre = (10.0, 10.0) if (degrees == -90 or degrees == 270) and 'R' in arc else (0.0, 0.0)
    begin = -90 if centre[0] else 0
    step = degrees / len(through)
    assert abs(2 * step) < 180.0
    for i, point in enumerate(through, start=1):
        angle = radians(begin + i * step)
        expected = [centre[0] + 10 * cos(angle), centre[1] + 10 * sin(angle), 0.0]
        assert point == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize('scale', [1.0, -10.0, 0.1])
def test_a_helix_keeps_radius_pitch_and_tolerance(tmp_path, scale):
    found = imported(tmp_path, 'G21\nG0 X10 Y0 Z0\nG3 X10 Y0 Z4 I-10 P2 F60\n', scale=scale)
    points = positions(found)[1:] / scale
    assert np.hypot(*points[:, :2].T) == pytest.approx(10.0)
    angles = np.unwrap(np.arctan2(points[:, 1], points[:, 0]))
    assert angles[-1] == pytest.approx(4.0 * pi - (angles[0] < 0.0) * 2.0 * pi, abs=1e-6)
    assert points[:, 2] == pytest.approx(4.0 * angles / (4.0 * pi))
    middles = np.hypot(*(0.5 * (points[1:] + points[:-1]))[:, :2].T)
    assert 0.01 < abs(scale) * (10.0 - middles.min()) <= 0.05
    assert f'line 3: G3 with a rise: a helix, made of {len(points)} lines' in remarks(found)


@pytest.mark.parametrize(
    ('arc', 'is_arc'),
    [
        # LinuxCNC and GRBL: 0.005 mm, or 0.1 % up to 0.5 mm.
        ('G3 X0 Y5.004 I-5', True),
        ('G3 X0 Y5.006 I-5', False),
        ('G3 X-95 Y100.09 I-100', True),
        ('G3 X-95 Y100.11 I-100', False),
        ('G3 X-995 Y1000.4 I-1000', True),
        ('G3 X-995 Y1000.6 I-1000', False),
        ('G3 X-5 Y0 R4.996', True),
        ('G3 X-5 Y0 R4.99', False),
    ],
)
def test_the_radii_may_differ_as_much_as_the_controls_allow(tmp_path, arc, is_arc):
    text = f'G21\nG0 X5 Y0 Z0\n{arc} F60\n'
    if is_arc:
        end = positions(imported(tmp_path, text))[-1]
        assert end[:2] == pytest.approx([float(word[1:]) for word in arc.split()[1:3]])
    else:
        assert refusal(tmp_path, text).startswith('line 3: the arc ')


@pytest.mark.parametrize(
    ('text', 'said'),
    [
        ('G2 X1 Y0', 'the arc needs I and J, or R'),
        ('G18 G2 X1 Z0', 'the arc needs K and I, or R'),
        ('G90.1 G2 X1 Y0 I5', 'the arc needs I and J, or R'),
        ('G2 X1 Y0 I3 J0', 'the arc begins 3 mm and ends 2 mm from its centre'),
        ('G2 X9 Y0 R1', 'the arc spans 9 mm, more than twice its radius 1 mm'),
        ('G2 X0 Y0 R5', 'an arc with R ends where it begins'),
        ('G2 R5', 'an arc with R ends where it begins'),
        ('G2 X1 Y0 R0', 'the arc spans 1 mm, more than twice its radius 0 mm'),
        ('G2 X1 Y1 I1 R1', 'an arc has I and J, or R, and not both'),
        ('G17 G2 X1 Y1 I1 K1', 'an arc in G17 has no K'),
        ('G18 G2 X1 Z1 K1 J1', 'an arc in G18 has no J'),
        ('G2 X1 Y1 I1 P0', 'P0 of an arc is no whole number of turns'),
        ('G2 X1 Y1 I1 P1.5', 'P1.5 of an arc is no whole number of turns'),
        ('G2 X1 Y1 I1 P1e9', 'has an exponent'),
        ('G2 X1 Y1 I1 P99999', 'P99999 of an arc is no whole number of turns'),
        ('G2 I0 J0', 'the arc begins 0 mm and ends 0 mm from its centre'),
        ('G17 G2 X0 Y0 Z1 I9000000 P1000', 'the helix would need'),
        # A lathe means G18 without a word, a mill G17.
        ('G2 X1 Z-1 R1', 'an arc along X and Z needs G17 or G18 before'),
        ('G2 X1 Z-1 I1 K0', 'an arc along X and Z needs G17 or G18 before'),
    ],
)
def test_an_arc_that_is_none_is_refused(tmp_path, text, said):
    sentence = refusal(tmp_path, f'G21\nG0 X0 Y0 Z0\n{text} F60\n')
    assert sentence.startswith('line 3: ')
    assert said in sentence


def test_a_centre_of_zero_beside_the_plane_is_written_by_posts(tmp_path):
    found = imported(tmp_path, 'G21\nG0 X10 Y0 Z0\nG3 X0 Y10 I-10 J0 K0.000 F60\n')
    assert positions(found)[-1] == pytest.approx([0, 10, 0], abs=1e-9)


def test_an_arc_at_the_begin_starts_at_the_known_place(tmp_path):
    found = imported(tmp_path, 'G21 G91\nG3 X-10 Y10 I-10 F60\n')
    assert positions(found) == pytest.approx(np.array([[0, 0, 0], [-10, 10, 0]]), abs=1e-9)
    assert vias(found)[0] == pytest.approx([10 * (0.5**0.5 - 1), 10 * 0.5**0.5, 0])
