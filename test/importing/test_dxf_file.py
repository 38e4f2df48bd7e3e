# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Drawings: those that ezdxf writes, and one as Inkscape writes R12."""

import io
from itertools import pairwise
from math import cos, pi, radians, sin

import numpy as np
import pytest

from ur_cartesian_driver.importing import BrokenFile, import_file, ImportOptions
from ur_cartesian_driver.motion.goal import SegmentType

ezdxf = pytest.importorskip('ezdxf')

#: As Inkscape's export for desktop cutting plotters: no header variables of units, no handles.
INKSCAPE = '\n'.join(
    '0 SECTION 2 HEADER 9 $ACADVER 1 AC1009 0 ENDSEC 0 SECTION 2 ENTITIES '
    '0 LINE 8 Layer1 10 0 20 0 30 0 11 10 21 0 31 0 '
    '0 LINE 8 Layer1 10 10 20 5 30 0 11 10 21 0 31 0 '
    '0 ARC 8 Layer1 10 5 20 5 30 0 40 5 50 0 51 180 '
    '0 ENDSEC 0 EOF'.split(' ')
)


def drawing(draw, unit=4, version='R2010'):
    """Return the text of a drawing that a function draws."""
    doc = ezdxf.new(version, units=unit)
    draw(doc.modelspace())
    text = io.StringIO()
    doc.write(text)
    return text.getvalue()


def imported(tmp_path, text, **options):
    file = tmp_path / 'part.dxf'
    file.write_text(text)
    return import_file(file, ImportOptions(**options))


def millimetres(found):
    return 1e3 * np.array(found.goal.waypoints.poses)[:, :3]


def vias(found):
    has = np.array(found.goal.segments.has_via)
    return 1e3 * np.array(found.goal.segments.vias)[has, :3]


def remarks(found):
    return '\n'.join(remark.text() for remark in found.remarks)


def test_inkscape_lines_are_joined_also_against_their_direction(tmp_path):
    found = imported(tmp_path, INKSCAPE, unit='mm')
    assert millimetres(found) == pytest.approx(
        np.array([[0, 0, 0], [10, 0, 0], [10, 5, 0], [5, 10, 0], [0, 5, 0]]), abs=1e-9
    )
    half = 5.0 * 0.5**0.5
    assert vias(found) == pytest.approx(
        np.array([[5 + half, 5 + half, 0.0], [5 - half, 5 + half, 0.0]])
    )
    assert found.lines.tolist() == [15, 15, 31, 47, 47]


def test_a_polyline_with_bulges_of_all_sizes_is_on_the_arcs_that_ezdxf_finds(tmp_path):
    corners = [(0, 0, 0.3), (10, 0, -0.7), (20, 5, 2.5), (30, 5, -5.0), (40, 0, 0.0), (50, 0, 0)]
    found = imported(tmp_path, drawing(lambda space: space.add_lwpolyline(corners, format='xyb')))
    assert millimetres(found)[-1] == pytest.approx([50.0, 0.0, 0.0])
    points = list(millimetres(found))
    types, places = found.goal.segments.types, 1e3 * np.array(found.goal.segments.vias)[:, :3]
    from ezdxf.math import bulge_to_arc

    circles = [bulge_to_arc(a[:2], b[:2], a[2]) for a, b in pairwise(corners) if a[2]]
    for i in range(1, len(points)):
        if types[i] == SegmentType.CIRCULAR:
            at_all = [
                max(
                    abs(np.hypot(*(p[:2] - np.array([centre.x, centre.y]))) - radius)
                    for p in (points[i - 1], places[i], points[i])
                )
                for centre, _, _, radius in circles
            ]
            assert min(at_all) < 1e-6
    # The middle of the first arc lies below its chord: it turns to the left.
    assert places[1] == pytest.approx([5.0, -1.5, 0.0])


def test_circles_and_arcs_seen_from_below(tmp_path):
    def draw(space):
        space.add_circle((5, 5), 5)
        space.add_arc((20, 0), 2, 30, 200, dxfattribs={'extrusion': (0, 0, -1)})

    found = imported(tmp_path, drawing(draw))
    around = np.vstack((millimetres(found)[:5], vias(found)[:4]))
    assert np.hypot(*(around[:, :2] - 5.0).T) == pytest.approx(5.0)
    # Seen from below x points the other direction.
    start, end = millimetres(found)[5], millimetres(found)[6]
    assert start == pytest.approx([-20 - 2 * cos(radians(30)), 2 * sin(radians(30)), 0.0])
    assert end == pytest.approx([-20 - 2 * cos(radians(200)), 2 * sin(radians(200)), 0.0])
    assert 'straight to it, without lift' in remarks(found)


def test_a_lift_between_two_contours(tmp_path):
    def draw(space):
        space.add_line((0, 0), (10, 0))
        space.add_line((0, 5), (10, 5))

    found = imported(tmp_path, drawing(draw), lift=0.02, travel_speed=0.2, speed=0.05)
    assert millimetres(found) == pytest.approx(
        np.array([[0, 0, 0], [10, 0, 0], [10, 0, 20], [0, 5, 20], [0, 5, 0], [10, 5, 0]])
    )
    assert found.goal.segments.velocities.tolist() == [0.2, 0.05, 0.2, 0.2, 0.2, 0.05]


def test_splines_and_ellipses_are_within_the_tolerance(tmp_path):
    def draw(space):
        space.add_ellipse((0, 0), (10, 0), 0.5)

    found = imported(tmp_path, drawing(draw), tolerance=1e-5)
    x, y = millimetres(found)[:, 0], millimetres(found)[:, 1]
    assert np.hypot(x / 10.0, y / 5.0) == pytest.approx(1.0)
    t = np.linspace(0.0, 2.0 * pi, 20_000)
    curve = np.stack((10.0 * np.cos(t), 5.0 * np.sin(t)), axis=1)
    middles = 0.5 * (millimetres(found)[1:] + millimetres(found)[:-1])[:, :2]
    nearest = [np.hypot(*(curve - m).T).min() for m in middles]
    assert max(nearest) < 0.0105


def test_what_is_no_path_is_said_with_its_line(tmp_path):
    def draw(space):
        space.add_text('no path')
        space.add_line((0, 0, 1), (10, 0, 1))
        space.add_point((1, 1))

    text = drawing(draw, unit=1)
    found = imported(tmp_path, text)
    assert millimetres(found)[1] == pytest.approx([254.0, 0.0, 25.4])
    lines = text.splitlines()
    for kind, remark in zip(('TEXT', 'POINT'), found.remarks, strict=False):
        assert remark.what == kind
        assert lines[remark.lines[0]].strip() == kind


@pytest.mark.parametrize(
    ('change', 'line', 'part'),
    [
        (lambda t: 'hello\nworld\n', 1, 'no group code'),
        (lambda t: t[: len(t) // 2], None, 'ends here'),
        (lambda t: t.replace('\n11\n10\n', '\n11\nten\n'), 26, "'ten' is no number"),
        (
            lambda t: t.replace('\nARC\n', '\nTEXT\n', 1).replace('\nLINE\n', '\nTEXT\n'),
            0,
            'no point',
        ),
    ],
)
def test_a_broken_file_is_one_sentence_with_its_line(tmp_path, change, line, part):
    with pytest.raises(BrokenFile, match=part) as caught:
        imported(tmp_path, change(INKSCAPE), unit='mm')
    text = change(INKSCAPE)
    assert caught.value.line == (len(text.splitlines()) if line is None else line)
    assert '\n' not in str(caught.value)


def test_a_drawing_without_a_unit_is_refused(tmp_path):
    with pytest.raises(BrokenFile, match='give the option unit'):
        imported(tmp_path, INKSCAPE)


def test_without_ezdxf_a_sentence_says_what_to_install(tmp_path, monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, 'ezdxf', None)
    monkeypatch.setitem(sys.modules, 'ezdxf.filemanagement', None)
    with pytest.raises(ImportError, match='pip install ezdxf'):
        imported(tmp_path, INKSCAPE, unit='mm')
