# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Drawings: those that ezdxf writes, one as Inkscape writes R12, and plain ones."""

import io
from itertools import pairwise
from math import cos, radians, sin, sqrt

from dxf_text import drawing, imported, line_of, millimetres, remarks, vias
import numpy as np
import pytest

from ur_cartesian_driver.importing import BrokenFile
from ur_cartesian_driver.motion.goal.goal import SegmentType

#: As Inkscape's export for desktop cutting plotters: no header variables of units, no handles.
INKSCAPE = '\n'.join(
    '0 SECTION 2 HEADER 9 $ACADVER 1 AC1009 0 ENDSEC 0 SECTION 2 ENTITIES '
    '0 LINE 8 Layer1 10 0 20 0 30 0 11 10 21 0 31 0 '
    '0 LINE 8 Layer1 10 10 20 5 30 0 11 10 21 0 31 0 '
    '0 ARC 8 Layer1 10 5 20 5 30 0 40 5 50 0 51 180 '
    '0 ENDSEC 0 EOF'.split(' ')
)
LINE = 'LINE 5 2F 10 0 20 0 11 10 21 0'


def by_ezdxf(draw, unit=4, version='R2010'):
    """Return the text of a drawing that a function draws."""
    ezdxf = pytest.importorskip('ezdxf')
    doc = ezdxf.new(version, units=unit)
    draw(doc.modelspace())
    text = io.StringIO()
    doc.write(text)
    return text.getvalue()


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
    found = imported(tmp_path, by_ezdxf(lambda space: space.add_lwpolyline(corners, format='xyb')))
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

    found = imported(tmp_path, by_ezdxf(draw))
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

    found = imported(tmp_path, by_ezdxf(draw), lift=0.02, travel_speed=0.2, speed=0.05)
    assert millimetres(found) == pytest.approx(
        np.array([[0, 0, 0], [10, 0, 0], [10, 0, 20], [0, 5, 20], [0, 5, 0], [10, 5, 0]])
    )
    assert found.goal.segments.velocities.tolist() == [0.2, 0.05, 0.2, 0.2, 0.2, 0.05]


def test_what_is_no_path_is_said_with_its_line(tmp_path):
    def draw(space):
        space.add_text('no path')
        space.add_line((0, 0, 1), (10, 0, 1))
        space.add_point((1, 1))

    text = by_ezdxf(draw, unit=1)
    found = imported(tmp_path, text)
    assert millimetres(found)[1] == pytest.approx([254.0, 0.0, 25.4])
    lines = text.splitlines()
    for kind, remark in zip(('TEXT', 'POINT'), found.remarks, strict=False):
        assert remark.what.startswith(f'{kind} (handle ')
        assert lines[remark.lines[0]].strip() == kind


# What nobody sees


def test_layers_decide_what_is_seen_also_in_blocks(tmp_path):
    """Off hides entities; frozen also hides blocks. In a block, layer 0 is the INSERT's."""
    layers = ['Off 62 -7', 'Frozen 70 1', 'Locked 70 4']
    seen = {
        'Off': [100, 300],
        'Frozen': [],
        'Locked': [0, 100, 300],
    }
    for layer, places in seen.items():
        text = drawing(
            'LINE 10 500 20 0 11 501 21 0',
            f'LINE 8 {layer} 10 0 20 0 11 1 21 0',
            f'INSERT 8 {layer} 2 B 10 100 20 0',
            f'INSERT 8 {layer} 2 Zero 10 200 20 0',
            f'INSERT 8 {layer} 2 Nested 10 300 20 0',
            layers=layers,
            blocks={
                'B': '0 LINE 8 Other 10 0 20 0 11 1 21 0',
                'Zero': '0 LINE 8 0 10 0 20 0 11 1 21 0',
                'Nested': '0 INSERT 8 0 2 B 10 0 20 0',
            },
        )
        found = imported(tmp_path, text)
        expected = [500, *places, *([200] if layer == 'Locked' else [])]
        assert sorted(millimetres(found)[::2, 0].round(6)) == sorted(expected)
        if layer != 'Locked':
            assert f'on layer {layer}' in remarks(found)


def test_an_invisible_entity_hides_its_block(tmp_path):
    text = drawing(LINE, 'INSERT 60 1 2 B 10 0 20 0', blocks={'B': '0 LINE 10 7 20 7 11 8 21 8'})
    found = imported(tmp_path, text)
    assert len(millimetres(found)) == 2
    note = found.remarks[0]
    assert (note.lines, note.why) == ((line_of(text, 'INSERT'),), 'it is invisible')


def test_a_remark_names_the_layer_that_hides(tmp_path):
    block = {'B': '0 CIRCLE 8 0 10 0 20 0 40 5'}
    text = drawing(LINE, 'INSERT 8 off 2 B 10 0 20 0', layers=['Off 62 -7'], blocks=block)
    found = imported(tmp_path, text)
    line = line_of(text, 'CIRCLE')
    assert found.remarks[0].text() == f'line {line}: CIRCLE on layer Off: its layer is off'


def test_entities_of_a_block_that_nobody_inserts_are_not_seen(tmp_path):
    found = imported(tmp_path, drawing(LINE, blocks={'B': '0 LINE 10 7 20 7 11 8 21 8'}))
    assert len(millimetres(found)) == 2


def test_the_sheets_of_a_drawing_are_left_out(tmp_path):
    blocks = {'*Paper_Space0': '0 CIRCLE 5 9A 10 0 20 0 40 1 0 VIEWPORT 5 9B 67 1'}
    found = imported(tmp_path, drawing(LINE, blocks=blocks))
    assert remarks(found).splitlines()[0].endswith('CIRCLE (handle 9A): it is in paper space')
    assert 'VIEWPORT' not in remarks(found)


# Blocks


def test_a_block_in_a_block_is_placed_by_both(tmp_path):
    """Turned and scaled unevenly twice; the expected place is computed by hand."""
    text = drawing(
        'INSERT 2 Outer 10 0.002582 20 -0.08868 41 1.5 42 0.5 50 33.3',
        blocks={
            'Part 10 0.062788 20 0.077231': '0 LINE 10 0.11594 20 -0.11453 11 1 21 1',
            'Outer 10 0.189137 20 -0.18549': '0 INSERT 2 Part 10 -0.03391 20 0.085952 '
            '41 1.5 42 0.5 50 90',
        },
        units=6,
    )
    places = millimetres(imported(tmp_path, text))
    assert places[0] == pytest.approx([-253.25, -46.65, 0.0], abs=0.02)


def test_an_arc_in_an_unevenly_scaled_block_is_an_ellipse(tmp_path):
    text = drawing(
        'INSERT 2 B 10 0 20 0 41 2 42 0.5',
        blocks={'B': '0 CIRCLE 10 0 20 0 40 10'},
    )
    found = imported(tmp_path, text, tolerance=1e-5)
    x, y, _ = millimetres(found).T
    assert np.hypot(x / 20.0, y / 5.0) == pytest.approx(1.0)
    mirrored = imported(tmp_path, text.replace('42\n0.5', '42\n-2'))
    assert len(vias(mirrored)) == 4
    # A mirrored circle is followed in the other direction.
    assert vias(mirrored)[0] == pytest.approx([10 * sqrt(2), -10 * sqrt(2), 0.0])


def test_an_axis_that_hardly_leaves_the_plane_of_its_ellipse_keeps_its_length(tmp_path):
    """As files with few digits have it; half of the axis is the other one."""
    entity = 'ELLIPSE 10 0 20 0 11 10 21 0 31 0.04 40 0.5 41 0 42 1.5707963267949'
    x, y, z = millimetres(imported(tmp_path, drawing(entity))).T
    assert (x[0], z[0]) == pytest.approx((10.0, 0.04))
    assert (x[-1], y[-1], z[-1]) == pytest.approx((0.0, 0.5 * np.hypot(10.0, 0.04), 0.0), abs=1e-9)


def test_the_outer_knots_do_not_change_a_spline(tmp_path):
    entity = 'SPLINE 71 2 40 {} 40 0 40 0 40 1 40 1 40 {} 10 0 20 0 10 5 20 9 10 10 20 0'
    whole, other = (
        millimetres(imported(tmp_path, drawing(entity.format(*knots))))
        for knots in ((0, 1), (-9.3, 7))
    )
    assert whole[[0, -1]] == pytest.approx(np.array([[0.0, 0, 0], [10, 0, 0]]))
    assert other == pytest.approx(whole)


# Polylines


@pytest.mark.parametrize('version', ['', 'AC1009', 'AC1015'])
def test_a_closed_polyline_keeps_its_last_side_and_its_elevation(tmp_path, version):
    entity = 'LWPOLYLINE 8 0 90 3 70 1 38 4 10 0 20 0 10 10 20 0 10 10 20 10'
    found = imported(tmp_path, drawing(entity, version=version))
    corners = [[0, 0, 4], [10, 0, 4], [10, 10, 4], [0, 0, 4]]
    assert millimetres(found) == pytest.approx(np.array(corners, dtype=float))


@pytest.mark.parametrize('point', ['', '10 0 20 0 38 5', '10 0 20 0 30 5'])
def test_a_polyline_has_its_own_elevation_or_that_of_its_vertices(tmp_path, point):
    entity = f'POLYLINE {point} 0 VERTEX 10 0 20 0 30 5 0 VERTEX 10 9 20 0 30 5 0 SEQEND'
    found = imported(tmp_path, drawing(entity))
    assert millimetres(found) == pytest.approx(np.array([[0.0, 0, 5], [9, 0, 5]]))


@pytest.mark.parametrize(('flags', 'frame', 'fitted'), [(4, 16, 8), (12, 48, 40)])
def test_the_frame_of_a_fitted_polyline_is_not_cut(tmp_path, flags, frame, fitted):
    vertices = [(0, 0, frame), (0, 0, fitted), (5, 4, fitted), (5, 20, frame), (10, 0, fitted)]
    entity = f'POLYLINE 66 1 70 {flags} ' + ' '.join(
        f'0 VERTEX 10 {x} 20 {y} 70 {kind}' for x, y, kind in vertices
    )
    found = imported(tmp_path, drawing(entity + ' 0 SEQEND'))
    assert millimetres(found)[:, :2] == pytest.approx(np.array([[0.0, 0], [5, 4], [10, 0]]))


def test_the_sides_of_a_curve_fitted_polyline_are_arcs(tmp_path):
    entity = (
        'POLYLINE 66 1 70 2 0 VERTEX 10 0 20 0 42 1 70 2 50 45 '
        '0 VERTEX 10 10 20 0 42 -1 70 1 0 VERTEX 10 20 20 0 70 2 0 SEQEND'
    )
    found = imported(tmp_path, drawing(entity))
    assert millimetres(found) == pytest.approx(
        np.array([[0.0, 0, 0], [5, -5, 0], [10, 0, 0], [15, 5, 0], [20, 0, 0]])
    )


# Files as old and other programs write them


def test_codes_may_come_in_any_order(tmp_path):
    """As an old QCAD writes LINE, and with the place of an ARC at its end."""
    text = drawing('LINE 10 0 11 10 20 0 21 5', 'ARC 51 90 50 0 40 5 30 0 20 7 10 20 8 0')
    places = millimetres(imported(tmp_path, text))[:, :2]
    assert places == pytest.approx(np.array([[0.0, 0], [10, 5], [25, 7], [20, 12]]))


@pytest.mark.parametrize(
    'change',
    [
        lambda t: t.replace('\n', '\r\n'),
        lambda t: t.replace('\n', '\r'),
        lambda t: '\ufeff' + t,
        lambda t: '999\nby a hand\n' + t,
        lambda t: t.replace('0\nLINE', '  0\nLINE').replace('10\n', ' 10 \n'),
        lambda t: t + '\n\n',
        lambda t: t.encode('utf-16'),
    ],
)
def test_forms_of_the_file(tmp_path, change):
    assert len(millimetres(imported(tmp_path, change(drawing(LINE))))) == 2


@pytest.mark.parametrize(
    ('units', 'length'),
    [
        *((1, 25.4), (2, 304.8), (4, 1.0), (5, 10.0), (6, 1e3), (9, 0.0254), (10, 914.4)),
        *((14, 100.0), (15, 1e4), (21, 304.8006096), (22, 25.4000508), (23, 914.4018288)),
    ],
)
def test_lengths_of_units(tmp_path, units, length):
    """In mm; a survey foot is 1200 / 3937 m by the NIST Handbook 44, Appendix C."""
    found = imported(tmp_path, drawing('LINE 10 0 20 0 11 0.75 21 0.25', units=units))
    assert millimetres(found)[1] == pytest.approx([0.75 * length, 0.25 * length, 0.0])


def test_the_option_unit_goes_before_that_of_the_drawing_and_is_said(tmp_path):
    text = drawing(LINE, units=1)
    found = imported(tmp_path, text, unit='mm')
    assert millimetres(found)[1, 0] == pytest.approx(10.0)
    assert '$INSUNITS (inches): the option unit says mm' in remarks(found)
    assert found.remarks[0].lines == (text.splitlines().index('$INSUNITS'),)


def test_the_tolerance_holds_after_the_scale(tmp_path):
    entity = 'ELLIPSE 10 0 20 0 11 1 21 0 40 0.5 41 0 42 7'
    few = imported(tmp_path, drawing(entity, units=6), scale=1e-3)
    many = imported(tmp_path, drawing(entity), scale=1.0)
    assert millimetres(few) == pytest.approx(millimetres(many))


# Refusals


@pytest.mark.parametrize(
    ('entity', 'sentence'),
    [
        ('LINE 5 2F 10 0 20 0 11 5', 'LINE 2F: group code 21 is missing.'),
        ('LINE 5 2F 10 0 20 0 11 nan 21 0', "LINE 2F: 'nan' is no number (group code 11)."),
        ('LINE 5 2F 10 0 20 0 11 1_0 21 0', "LINE 2F: '1_0' is no number (group code 11)."),
        ('LINE 5 2F 10 0 20 0 11 1e99 21 0', "LINE 2F: '1e99' is too large (group code 11)."),
        ('LINE 10 0 20 0 11 5 21 5 11 6', 'LINE: group code 11 occurs twice.'),
        ('CIRCLE 5 2F 10 0 20 0 40 -1', 'CIRCLE 2F: its radius is -1.'),
        ('CIRCLE 10 0 20 0 40 1 210 0 220 0 230 0', 'its extrusion has no direction'),
        ('LWPOLYLINE 38 -5 210 0 220 0 10 0 20 0 10 1 20 1', 'its extrusion has no direction'),
        ('ELLIPSE 10 0 20 0 11 0 21 0 40 0.5', 'it has an axis without a length.'),
        (
            'ELLIPSE 5 2F 10 0 20 0 11 3 21 4 31 2 40 0.5',
            'ELLIPSE 2F: its axis leaves its plane by 2 (group codes 11 and 210).',
        ),
        ('ELLIPSE 10 0 20 0 11 0.01 21 0 210 1 220 0 230 0 40 0.5', 'leaves its plane by 0.01'),
        (
            'POLYLINE 10 0 20 0 0 VERTEX 10 0 20 0 30 5 0 VERTEX 10 9 20 0 30 5 0 SEQEND',
            'its elevation is missing (group code 30), and its points lie at z from 0 to 5.',
        ),
        (
            'POLYLINE 70 0 0 VERTEX 10 0 20 0 30 5 0 VERTEX 10 9 20 0 30 7 0 SEQEND',
            'its elevation is missing (group code 30), and its points lie at z from 5 to 7.',
        ),
        (
            'POLYLINE 10 0 20 0 30 0 10 9 20 0 30 0 0 VERTEX 10 0 20 0 0 SEQEND',
            'POLYLINE: group code 10 occurs twice.',
        ),
        (
            'POLYLINE 70 8 0 VERTEX 10 0 20 0 42 1 0 VERTEX 10 9 20 0 0 SEQEND',
            'VERTEX: a vertex in space has no bulge (group code 42).',
        ),
        (
            'POLYLINE 70 1 0 VERTEX 10 0 20 0 0 VERTEX 10 9 20 0 70 16 0 SEQEND',
            'VERTEX: it is a control point (group code 70), but its POLYLINE is no fitted spline.',
        ),
        ('LWPOLYLINE 90 3 10 0 20 0 10 1 20 1', 'it has 2 vertices in place of 3'),
        ('LWPOLYLINE 90 2 10 0 10 1 20 1', 'a vertex has no y (group code 20).'),
        ('LWPOLYLINE 20 0 10 1 20 1', 'group code 20 stands before the first 10.'),
        ('LWPOLYLINE 10 0 20 0 20 1', 'group code 20 occurs twice for a vertex.'),
        ('LWPOLYLINE 70 1.5 10 0 20 0', '1.5 is no integer (group code 70).'),
        ('SPLINE 71 1 40 0 40 0 40 1 10 0 20 0 10 1 20 1', 'need 4 knots'),
        ('SPLINE 71 1 72 3 40 0 40 0 40 1 40 1 10 0 20 0 10 1 20 1', '4 knots in place of 3'),
        ('SPLINE 71 1 40 0 40 1 40 0 40 1 10 0 20 0 10 1 20 1', 'its knots do not rise'),
        ('SPLINE 71 1 40 0 40 0 40 0 40 0 10 0 20 0 10 1 20 1', 'its knots are all the same'),
        ('SPLINE 71 0 40 0 40 0 40 1 10 0 20 0 10 1 20 1', 'its degree is 0'),
        ('SPLINE 71 1 40 0 40 0 40 1 40 1 10 0 20 0 10 1', '2 points have 1 coordinates y'),
        (
            'SPLINE 71 1 40 0 40 0 40 1 40 1 41 1 41 -1 10 0 20 0 10 1 20 1',
            'a weight is not positive',
        ),
        (
            'SPLINE 71 1 40 0 40 0 40 1 40 1 41 1 10 0 20 0 10 1 20 1',
            'it has 1 weights for 2 control points',
        ),
        (
            'SPLINE 71 1 40 0 40 0 40 1 40 1 40 2 40 2 10 0 20 0 10 1 20 0 10 5 20 5 10 6 20 5',
            'its knots break it into parts',
        ),
        ('INSERT 5 3F 2 B 10 0 20 0 42 0', 'INSERT 3F: a scale is 0'),
        ('INSERT 2 B 10 0 20 0 70 9999 71 9999 44 1 45 1', 'it has 9999 x 9999 places'),
        ('INSERT 2 B', 'group code 10 is missing'),
        ('INSERT 2 Deep0 10 0 20 0', 'it is in more than 64 blocks'),
        ('INSERT 2 Bomb 10 0 20 0', 'the blocks have more than 100,000 entities'),
        ('SPLINE 71 1 40 0 40 0 40 1 40 1 10 0 20 0 10 9e11 20 1', 'farther than 20 m'),
        (
            'SPLINE 71 2 40 0 40 0 40 0 40 1 40 1 40 1 10 0 20 0 10 9e9 20 9e9 10 0 20 9e9',
            'it would take too many lines',
        ),
    ],
)
def test_what_cannot_be_meant_is_refused_with_line_and_handle(tmp_path, entity, sentence):
    blocks = {'B': '0 LINE 10 0 20 0 11 1 21 1'}
    blocks['Bomb'] = '0 INSERT 2 B0 10 0 20 0'
    for i in range(9):
        blocks[f'B{i}'] = f'0 INSERT 2 B{i + 1} 10 0 20 0 70 10 44 1'
    blocks |= {f'Deep{i}': f'0 INSERT 2 Deep{i + 1} 10 0 20 0' for i in range(65)}
    text = drawing(entity, blocks=blocks)
    with pytest.raises(BrokenFile) as caught:
        imported(tmp_path, text)
    assert sentence in str(caught.value)
    first = max(i for i, line in enumerate(text.splitlines()) if line == entity.split()[0])
    assert caught.value.line >= (1 if 'Bomb' in entity or 'Deep' in entity else first)
    assert '\n' not in str(caught.value)


@pytest.mark.parametrize(
    ('entity', 'marker'),
    [
        ('LWPOLYLINE {} 100 AcDbPolyline 100 {} 10 0 20 0 10 9 20 0', 'AcDb3dPolylineVertex'),
        ('LINE {} 100 AcDbLine 10 0 20 0 11 9 21 0 100 {}', 'AcDbLine'),
        ('LINE {} 100 {} 10 0 20 0 11 9 21 0', 'AcDbLime'),
        ('CIRCLE {} 10 0 20 0 40 9 100 {}', 'AcDbHelix'),
    ],
)
def test_a_marker_of_another_entity_is_refused_with_its_line(tmp_path, entity, marker):
    text = drawing(entity.format('100 AcDbEntity', marker))
    line = len(text.splitlines()) - text.splitlines()[::-1].index(marker)
    with pytest.raises(BrokenFile) as caught:
        imported(tmp_path, text)
    kind = entity.split()[0]
    assert str(caught.value) == f'line {line}: {kind}: its marker {marker!r} is wrong.'


def test_an_insert_of_many_places_has_a_marker_of_its_own(tmp_path):
    insert = 'INSERT 100 AcDbEntity 8 0 100 {} 2 B 10 100 20 0 70 1'
    blocks = {'B': '0 ' + LINE}
    for marker in ('AcDbBlockReference', 'AcDbMInsertBlock'):
        found = imported(tmp_path, drawing(insert.format(marker), blocks=blocks))
        assert millimetres(found) == pytest.approx(np.array([[100.0, 0, 0], [110, 0, 0]]))


def test_a_group_of_an_application_has_to_end(tmp_path):
    text = drawing('LWPOLYLINE 10 0 20 0 10 9 20 0 102 {ACAD 70 1')
    with pytest.raises(BrokenFile, match=r"LWPOLYLINE: its group '{ACAD' does not end \(group"):
        imported(tmp_path, text)


def test_nothing_is_embedded_in_an_entity_with_a_path(tmp_path):
    entity = 'LWPOLYLINE 10 0 20 0 10 9 20 0 101 Embedded 70 1'
    found = imported(tmp_path, drawing(entity))
    assert millimetres(found) == pytest.approx(np.array([[0.0, 0, 0], [9, 0, 0], [0, 0, 0]]))
    assert 'LWPOLYLINE: group code 101 is none of a LWPOLYLINE' in remarks(found)


@pytest.mark.parametrize(
    ('text', 'record'),
    [
        (drawing('TEXT 100 AcDbEntity 8 0 10 0 20 0 100 AcDbEntity 8 0'), 'TEXT'),
        (drawing('TEXT 100 AcDbEntity 8 0 10 0 20 0 100 AcDbLine 10 0 20 0 11 9 21 0'), 'TEXT'),
        (drawing('TEXT 8 0 10 0 20 0 8 0 10 0 20 0 11 9 21 0'), 'TEXT'),
        (drawing('POLYLINE 0 VERTEX 10 0 20 0 0 SEQEND 10 0 20 0 11 9 21 0'), 'SEQEND'),
        (drawing(LINE, blocks={'B': '0 ENDBLK 10 0 20 0 11 9 21 0'}), 'ENDBLK'),
        (drawing(LINE, blocks={'B 8 0 10 0 20 0 8 0 11 9 21 0': ''}), 'BLOCK'),
        (drawing(LINE).replace('ENTITIES', 'ENTITIES\n10\n0\n20\n0\n11\n9\n21\n0'), 'SECTION'),
        (drawing(LINE, layers=['Cut 100 AcDbLine 11 9 21 0']), 'LAYER'),
    ],
)
def test_an_entity_whose_beginning_is_missing_is_refused(tmp_path, text, record):
    with pytest.raises(BrokenFile, match=rf'^line \d+: {record}: it goes on as another entity'):
        imported(tmp_path, text)


@pytest.mark.parametrize(
    ('text', 'sentence'),
    [
        (drawing(LINE, layers=[f'A 0 {LINE}']), 'LINE 2F: it cannot be in the section TABLES'),
        (drawing(LINE, objects=f'0 {LINE}'), 'LINE 2F: it cannot be in the section OBJECTS'),
        (drawing(LINE, header=f'0 {LINE}'), 'LINE 2F: it cannot be in the section HEADER'),
        (
            drawing(LINE, layers=['Off 62 -7']).replace('TABLES', 'OBJECTS', 1),
            'TABLE: it cannot be in the section OBJECTS',
        ),
        (drawing(LINE, 'LAYER 2 Off 62 -7'), 'LAYER: it cannot be in the section ENTITIES'),
        (
            drawing(LINE, blocks={'A': '', 'B': ''}).replace('0\nENDBLK\n', '', 1),
            'BLOCK: the block before it has not ended',
        ),
        (
            drawing(LINE, blocks={'A': ''}).replace('0\nENDBLK\n', ''),
            'ENDSEC: the block before it has not ended',
        ),
    ],
)
def test_a_record_of_another_section_is_refused(tmp_path, text, sentence):
    with pytest.raises(BrokenFile, match=rf'^line \d+: {sentence}; the file is broken\.$'):
        imported(tmp_path, text)


def test_two_units_are_refused(tmp_path):
    twice = drawing(LINE, header='9 $INSUNITS 70 {}')
    assert len(millimetres(imported(tmp_path, twice.format(4)))) == 2
    with pytest.raises(BrokenFile, match=r'^line \d+: \$INSUNITS: it occurs twice\.$'):
        imported(tmp_path, twice.format(5))


def test_two_layers_of_one_name_must_not_differ_in_what_is_seen(tmp_path):
    same = imported(tmp_path, drawing(LINE, layers=['Cut 62 3', 'CUT 5 77 62 5']))
    assert "LAYER' (handle 77): the first layer of this name counts" in remarks(same)
    for hidden in ('62 -3', '62 3 70 1'):
        with pytest.raises(BrokenFile) as caught:
            imported(tmp_path, drawing(LINE, layers=['Cut 62 3', f'CUT 5 77 {hidden}']))
        sentence = "LAYER 77: a layer 'CUT' came before, and one of the two is off or frozen."
        assert str(caught.value).endswith(sentence)


def test_two_blocks_of_one_name_are_refused(tmp_path):
    text = drawing(LINE, blocks={'B': '', 'b 5 77': ''})
    with pytest.raises(BrokenFile, match="BLOCK 77: a block 'b' came before"):
        imported(tmp_path, text)


@pytest.mark.parametrize(
    ('text', 'what'),
    [
        (drawing(LINE).replace('BLOCKS', 'BLOKS'), 'section BLOKS'),
        (drawing(LINE).replace('0\nENDSEC\n0\nEOF', '0\nENDSEC\n0\nARC\n8\n0\n0\nEOF'), 'ARC'),
        ('5\nstray\n' + drawing(LINE), "'the beginning of the file'"),
    ],
)
def test_what_stands_at_a_strange_place_is_said(tmp_path, text, what):
    assert any(note.what == what for note in imported(tmp_path, text).remarks)


@pytest.mark.parametrize(
    ('change', 'line', 'part'),
    [
        (lambda t: 'hello\nworld\n', 1, 'no group code'),
        (lambda t: 'garbage', 1, "this is no DXF: 'garbage' is no group code"),
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


@pytest.mark.parametrize('stray', ['0 LINE 5 4F 10 0 20 0 11 1 21 0', '0 ENTITIES 5 4F'])
def test_an_entity_between_blocks_is_refused(tmp_path, stray):
    text = drawing(LINE, blocks={'B': '0 ENDBLK ' + stray})
    with pytest.raises(BrokenFile, match=r'^line \d+: \w+ 4F: it stands between blocks'):
        imported(tmp_path, text)


def test_a_vertex_without_a_polyline_is_said(tmp_path):
    found = imported(tmp_path, drawing(LINE, 'VERTEX 5 4F 10 0 20 0'))
    assert 'VERTEX (handle 4F): it follows no POLYLINE' in remarks(found)


def test_a_whole_ellipse_can_have_four_decimals(tmp_path):
    entity = 'ELLIPSE 10 0 20 0 11 10 21 0 40 0.5 41 0 42 6.2832'
    x, y, _ = millimetres(imported(tmp_path, drawing(entity))).T
    assert (x[0], y[0], x[-1], y[-1]) == pytest.approx((10.0, 0.0, 10.0, 0.0), abs=1e-9)
    assert (x.min(), y.min(), y.max()) == pytest.approx((-10.0, -5.0, 5.0), abs=0.2)
