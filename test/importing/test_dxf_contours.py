# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Contours of drawings: entities whose ends meet, in any order and direction."""

from itertools import permutations, product
from math import cos, pi, sin

from dxf_text import drawing, imported, line_of, millimetres, remarks, vias
import numpy as np
import pytest

from ur_cartesian_driver.importing import ImportOptions
from ur_cartesian_driver.importing.dxf.dxf_file import collect_dxf
from ur_cartesian_driver.importing.imported_path import PathCollector

LINE = 'LINE 5 2F 10 0 20 0 11 10 21 0'
SIDES = [((0, 0), (10, 0)), ((10, 0), (10, 10)), ((10, 10), (0, 10)), ((0, 10), (0, 0))]


def contours(folder, *entities):
    """Return the points of each contour [mm]."""
    (folder / 'part.dxf').write_text(drawing(*entities))
    into = PathCollector()
    collect_dxf(folder / 'part.dxf', ImportOptions(), into)
    path = into.path()
    return np.split(1e3 * path.positions, np.flatnonzero(path.travels)[1:])


def side(a, b, turned=False):
    (ax, ay), (bx, by) = (b, a) if turned else (a, b)
    return f'LINE 10 {ax} 20 {ay} 11 {bx} 21 {by}'


def test_four_lines_in_any_order_and_direction_are_one_closed_contour(tmp_path):
    count = 0
    for order in permutations(SIDES):
        for turned in product((False, True), repeat=4):
            lines = [side(a, b, t) for (a, b), t in zip(order, turned, strict=True)]
            (contour,) = contours(tmp_path, *lines)
            assert len(contour) == 5
            assert {tuple(p) for p in contour.round(9)} == {(*a, 0) for a, _ in SIDES}
            a, b = order[0][::-1] if turned[0] else order[0]
            assert contour[[0, 1, 4], :2].round(9).tolist() == [[*a], [*b], [*a]]
            count += 1
    assert count == 24 * 16


def test_a_slot_of_lines_and_arcs_in_any_order_and_direction_is_one_contour(tmp_path):
    """Arcs are counter-clockwise in a file, unless they are seen from below."""
    top = ['LINE 10 10 20 5 11 0 21 5', 'LINE 10 0 20 5 11 10 21 5']
    left = ['ARC 10 0 20 0 40 5 50 90 51 270', 'ARC 10 0 20 0 40 5 50 270 51 90 230 -1']
    bottom = ['LINE 10 0 20 -5 11 10 21 -5', 'LINE 10 10 20 -5 11 0 21 -5']
    right = ['ARC 10 10 20 0 40 5 50 270 51 90', 'ARC 10 -10 20 0 40 5 50 90 51 270 230 -1']
    for lines in product(top, left, bottom, right):
        for order in permutations(lines):
            file = drawing(*(line.replace('230', '210 0 220 0 230') for line in order))
            found = imported(tmp_path, file)
            places, middles = millimetres(found), vias(found)
            assert not any('contour' in note.what for note in found.remarks)
            assert places[-1] == pytest.approx(places[0])
            corners = {(0, 5), (0, -5), (10, 5), (10, -5), (-5, 0), (15, 0)}
            assert {(x + 0.0, y + 0.0) for x, y in places[:, :2].round(6)} == corners
            off = np.hypot(
                np.where(middles[:, 0] > 5, middles[:, 0] - 10, middles[:, 0]), middles[:, 1]
            )
            assert off == pytest.approx(5.0)
            assert len(off) == 4


def test_an_open_contour_has_the_direction_of_its_first_entity(tmp_path):
    lines = [side((10, 0), (20, 0)), side((10, 0), (0, 0)), side((30, 0), (20, 0))]
    (contour,) = contours(tmp_path, *lines)
    assert contour[:, 0].round(9).tolist() == [0, 10, 20, 30]


def test_contours_come_in_the_order_of_their_first_entities(tmp_path):
    lines = [side((0, 5), (1, 5)), side((0, 0), (1, 0)), side((1, 5), (2, 5))]
    found = contours(tmp_path, *lines)
    assert [contour[0, 1].round(9) for contour in found] == [5, 0]
    assert len(found[0]) == 3


@pytest.mark.parametrize(('gap', 'count'), [(0.0099, 1), (0.0101, 2)])
def test_ends_are_joined_over_a_hundredth_of_a_millimetre(tmp_path, gap, count):
    for angle in np.linspace(0.0, 2.0 * pi, 17):
        x, y = 10 + gap * cos(angle), gap * sin(angle)
        lines = [side((0, 0), (10, 0)), f'LINE 10 {x} 20 {y} 11 20 21 5']
        assert len(contours(tmp_path, *lines)) == count


def test_a_contour_ends_where_more_than_two_ends_meet(tmp_path):
    lines = [*(side(*ends) for ends in SIDES), side((0, 0), (10, 10)), side((10, 10), (20, 20))]
    for order in permutations(lines):
        found = contours(tmp_path, *order)
        assert sorted(len(contour) for contour in found) == [2, 2, 3, 3]
    goal = imported(tmp_path, drawing(*lines))
    note = next(note for note in goal.remarks if 'more than two ends meet' in note.why)
    assert len(note.lines) == 6


def test_what_was_drawn_twice_is_followed_once(tmp_path):
    entities = [LINE, 'LINE 5 3F 10 10 20 0 11 0 21 0', *['CIRCLE 5 4F 10 50 20 0 40 5'] * 2]
    assert [len(contour) for contour in contours(tmp_path, *entities)] == [2, 5]
    text = drawing(*entities)
    for note, kind in zip(imported(tmp_path, text).remarks, ('LINE', 'CIRCLE'), strict=False):
        assert note.lines == (line_of(text, kind, 2),)
        assert note.why == 'the same was drawn before, and is followed once'


def test_lines_shorter_than_a_joint_stay_one_contour(tmp_path):
    lines = [side((0.004 * i, 0), (0.004 * (i + 1), 0)) for i in range(100)]
    (contour,) = contours(tmp_path, *lines[::-1])
    assert contour[[0, -1], 0] == pytest.approx([0.0, 0.4])


def test_what_is_closed_joins_nothing(tmp_path):
    entities = ['CIRCLE 10 0 20 0 40 5', side((5, 0), (9, 0))]
    assert [len(contour) for contour in contours(tmp_path, *entities)] == [5, 2]
    assert 'more than two' not in remarks(imported(tmp_path, drawing(*entities)))


def test_what_is_smaller_than_any_motion_is_left_out(tmp_path):
    found = imported(tmp_path, drawing(LINE, 'CIRCLE 5 3F 10 0 20 0 40 0.002'))
    assert 'CIRCLE (handle 3F): its contour is smaller than 0.005 mm' in remarks(found)
    assert len(millimetres(found)) == 2


def test_a_closed_curve_within_the_tolerance_is_left_out(tmp_path):
    ellipse = 'ELLIPSE 5 3F 10 0 20 0 11 0.02 21 0 40 0.5'
    found = imported(tmp_path, drawing(LINE, ellipse))
    assert 'ELLIPSE (handle 3F): its contour is smaller than' in remarks(found)
    assert len(millimetres(found)) == 2
    fine = imported(tmp_path, drawing(LINE, ellipse), tolerance=1e-6)
    assert np.abs(millimetres(fine)[2:, 0]).max() == pytest.approx(0.02)
