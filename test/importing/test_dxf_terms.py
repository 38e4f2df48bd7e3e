# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Each term of DXF has the treatment that the table says."""

from math import pi, sqrt
from typing import Any

from dxf_text import drawing, imported, line_of, millimetres, vias
import numpy as np
import pytest

from ur_cartesian_driver.importing import BrokenFile, Treatment
from ur_cartesian_driver.importing.dxf.dxf_terms import TERMS, UNITS

LINE = 'LINE 5 2F 10 1 20 2 30 3 11 4 21 5 31 6'
ARC = 'ARC 5 2F 10 1 20 2 40 5 50 0 51 90'
ELLIPSE = f'ELLIPSE 5 2F 10 1 20 2 11 10 21 0 40 0.5 41 0 42 {pi / 2}'
CIRCLE = 'CIRCLE 5 2F 10 1 20 2 40 5'
LWPOLYLINE = 'LWPOLYLINE 5 2F 90 3 {} 10 0 20 0 10 10 20 0 {} 10 10 20 10'
POLYLINE = (
    'POLYLINE 5 2F 66 1 {} 0 VERTEX 10 0 20 0 0 VERTEX 10 10 20 0 {} 0 VERTEX 10 10 20 10 0 SEQEND'
)
#: A quarter of a circle about (0, 0), with a weight; a polynomial one is a parabola.
SPLINE = (
    '5 2F 71 2 72 6 73 3 40 0 40 0 40 0 40 1 40 1 40 1 {} '
    f'10 10 20 0 10 10 20 10 10 0 20 10 41 1 41 {sqrt(0.5)} 41 1'
)
CLOSED_SPLINE = 'SPLINE 71 1 {} 40 0 40 0 40 1 40 2 40 2 10 0 20 0 10 9 20 0 10 0 20 0'
INSERT = 'INSERT 5 3F 2 B 10 100 20 0'
BLOCKS = {'B 10 1 20 1': '0 ' + LINE}
SQUARE = [(0, 0), (10, 0), (10, 10)]

#: Entities with a term, and the points [mm] of the goal.
HONOURED: dict[str, tuple[str, list[Any]]] = {
    'LINE': (LINE, [(1, 2, 3), (4, 5, 6)]),
    'LINE 10': (LINE, [(1, 2, 3), (4, 5, 6)]),
    'LINE 11': (LINE, [(1, 2, 3), (4, 5, 6)]),
    'LINE 210': (LINE + ' 210 0 220 0 230 -1', [(1, 2, 3), (4, 5, 6)]),
    '38': ('LINE 10 1 20 2 38 7 11 4 21 5', [(1, 2, 7), (4, 5, 7)]),
    'ARC': (ARC, [(6, 2), (1, 7)]),
    'ARC 10': (ARC, [(6, 2), (1, 7)]),
    'ARC 40': (ARC.replace('40 5', '40 7'), [(8, 2), (1, 9)]),
    'ARC 50': (ARC.replace('50 0', '50 -90'), [(1, -3), (6, 2), (1, 7)]),
    'ARC 51': (ARC.replace('51 90', '51 0'), [(6, 2), (1, 7), (-4, 2), (1, -3), (6, 2)]),
    'ARC 210': (ARC + ' 210 0 220 0 230 -1', [(-6, 2), (-1, 7)]),
    'CIRCLE': (CIRCLE, [(6, 2), (1, 7), (-4, 2), (1, -3), (6, 2)]),
    'CIRCLE 10': (CIRCLE + ' 30 4', [(6, 2, 4), (1, 7, 4), (-4, 2, 4), (1, -3, 4), (6, 2, 4)]),
    'CIRCLE 40': (CIRCLE[:-1] + '1', [(2, 2), (1, 3), (0, 2), (1, 1), (2, 2)]),
    'CIRCLE 210': (CIRCLE + ' 210 1 220 0 230 0', [(0, 6, 2), (0, 1, 7), ..., (0, 6, 2)]),
    'ELLIPSE': (ELLIPSE, [(11, 2), ..., (1, 7)]),
    'ELLIPSE 10': (ELLIPSE + ' 30 9', [(11, 2, 9), ..., (1, 7, 9)]),
    'ELLIPSE 11': (ELLIPSE.replace('21 0', '21 10'), [(11, 12), ..., (-4, 7)]),
    'ELLIPSE 40': (ELLIPSE.replace('40 0.5', '40 0.2'), [(11, 2), ..., (1, 4)]),
    'ELLIPSE 41': (ELLIPSE.replace('41 0', f'41 {-pi / 2}'), [(1, -3), ..., (1, 7)]),
    'ELLIPSE 42': (ELLIPSE.replace(f'{pi / 2}', f'{pi}'), [(11, 2), ..., (-9, 2)]),
    'ELLIPSE 210': (ELLIPSE + ' 210 0 220 0 230 -1', [(11, 2), ..., (1, -3)]),
    'LWPOLYLINE': (LWPOLYLINE.format('', ''), SQUARE),
    'LWPOLYLINE 10': (LWPOLYLINE.format('', ''), SQUARE),
    'LWPOLYLINE 42': (LWPOLYLINE.format('', '42 0.5'), SQUARE),
    'LWPOLYLINE 70=1': (LWPOLYLINE.format('70 1', ''), [*SQUARE, (0, 0)]),
    'LWPOLYLINE 90': (LWPOLYLINE.format('', ''), SQUARE),
    'LWPOLYLINE 210': (
        LWPOLYLINE.format('38 3 210 0 220 0 230 -1', ''),
        [(0, 0, -3), (-10, 0, -3), (-10, 10, -3)],
    ),
    'POLYLINE': (POLYLINE.format('', ''), SQUARE),
    'POLYLINE 10': (POLYLINE.format('10 0 20 0 30 4', ''), [(x, y, 4) for x, y in SQUARE]),
    'POLYLINE 70=1': (POLYLINE.format('70 1', ''), [*SQUARE, (0, 0)]),
    'POLYLINE 70=8': (POLYLINE.format('70 8', '30 5'), [(0, 0), (10, 0, 5), (10, 10)]),
    'POLYLINE 210': (
        POLYLINE.format('210 0 220 0 230 -1', ''),
        [(0, 0), (-10, 0), (-10, 10)],
    ),
    'VERTEX': (POLYLINE.format('', ''), SQUARE),
    'SEQEND': (POLYLINE.format('', ''), SQUARE),
    'VERTEX 10': (POLYLINE.format('', ''), SQUARE),
    'VERTEX 42': (POLYLINE.format('', '42 0.5'), SQUARE),
    'VERTEX 70=16': (POLYLINE.format('70 4', '70 16'), [(0, 0), (10, 10)]),
    'SPLINE': ('SPLINE ' + SPLINE.format(''), [(10, 0), ..., (0, 10)]),
    'SPLINE 10': ('SPLINE ' + SPLINE.format(''), [(10, 0), ..., (0, 10)]),
    'SPLINE 40': (
        'SPLINE 71 1 72 4 73 2 40 5 40 5 40 6 40 6 10 0 20 0 10 3 20 4',
        [(0, 0), (3, 4)],
    ),
    'SPLINE 41': ('SPLINE ' + SPLINE.format(''), [(10, 0), ..., (0, 10)]),
    'SPLINE 71': (
        'SPLINE 71 1 72 5 73 3 40 0 40 0 40 1 40 2 40 2 10 0 20 0 10 10 20 0 10 10 20 10',
        SQUARE,
    ),
    'SPLINE 72': ('SPLINE ' + SPLINE.format(''), [(10, 0), ..., (0, 10)]),
    'SPLINE 73': ('SPLINE ' + SPLINE.format(''), [(10, 0), ..., (0, 10)]),
    'HELIX': (
        'HELIX ' + SPLINE.format('') + ' 100 AcDbHelix 10 7 20 7 11 7 21 7 40 3',
        [(10, 0), ..., (0, 10)],
    ),
    'INSERT': (INSERT, [(100, 1, 3), (103, 4, 6)]),
    'BLOCK 2': (INSERT, [(100, 1, 3), (103, 4, 6)]),
    'BLOCK 10': (INSERT, [(100, 1, 3), (103, 4, 6)]),
    'INSERT 2': (INSERT, [(100, 1, 3), (103, 4, 6)]),
    'INSERT 10': (INSERT + ' 30 1', [(100, 1, 4), (103, 4, 7)]),
    'INSERT 41': (INSERT + ' 41 -2', [(100, 1, 3), (94, 4, 6)]),
    'INSERT 42': (INSERT + ' 42 2', [(100, 2, 3), (103, 8, 6)]),
    'INSERT 43': (INSERT + ' 43 0.5', [(100, 1, 1.5), (103, 4, 3)]),
    'INSERT 50': (INSERT + ' 50 90', [(99, 0, 3), (96, 3, 6)]),
    'INSERT 44': (INSERT + ' 70 2 44 20', [(100, 1, 3), (103, 4, 6), (120, 1, 3), (123, 4, 6)]),
    'INSERT 45': (INSERT + ' 71 2 45 -5', [(100, 1, 3), (103, 4, 6), (100, -4, 3), (103, -1, 6)]),
    'INSERT 70': (INSERT + ' 70 2 44 20', [(100, 1, 3), (103, 4, 6), (120, 1, 3), (123, 4, 6)]),
    'INSERT 71': (
        INSERT + ' 50 90 71 2 45 -5',
        [(99, 0, 3), (96, 3, 6), (104, 0, 3), (101, 3, 6)],
    ),
    'INSERT 210': (INSERT + ' 210 0 220 0 230 -1', [(-100, 1, -3), (-103, 4, -6)]),
    '8': ('LINE 8 Cut 10 1 20 2 30 3 11 4 21 5 31 6', [(1, 2, 3), (4, 5, 6)]),
}
#: Entities without a term, and how a value of it is written.
NO_EFFECT = {
    'LWPOLYLINE': (LWPOLYLINE, '{}', ''),
    'POLYLINE': (POLYLINE, '{}', ''),
    'VERTEX': (POLYLINE, '', '{}'),
    'SPLINE': ('SPLINE ' + SPLINE, '{}', ''),
    'SPLINE 70=1': (CLOSED_SPLINE, '{}', ''),
    'INSERT': (INSERT + ' {}', '{}', ''),
}
ALWAYS = {
    '5': '5 ABC',
    '100': '100 AcDbEntity',
    '102': '102 {ACAD_REACTORS 10 99 102 }',
    '330': '330 1F',
    '360': '360 1F',
    '999': '999 hello',
}
#: Drawings with a term, and the entity that a remark names with its line.
LEFT_OUT = {
    'SPLINE 11 without 10': (drawing(LINE, 'SPLINE 71 3 74 2 11 0 21 0 11 5 21 5'), 'SPLINE'),
    'SPLINE 70=1 with a gap': (drawing('SPLINE 70 1 ' + SPLINE.format('')), 'SPLINE'),
    'POLYLINE 70=16': (drawing(LINE, POLYLINE.format('70 16', '')), 'POLYLINE'),
    'POLYLINE 70=64': (drawing(LINE, POLYLINE.format('70 64', '')), 'POLYLINE'),
    'VERTEX 30': (
        drawing(POLYLINE.format('30 2', '30 7').replace('20 0 0', '20 0 30 2 0')),
        'VERTEX',
    ),
    'LWPOLYLINE 40': (drawing(LWPOLYLINE.format('40 0', '40 0.5 40 0.7')), 'LWPOLYLINE'),
    'LWPOLYLINE 41': (drawing(LWPOLYLINE.format('', '41 0.5')), 'LWPOLYLINE'),
    'LWPOLYLINE 43': (drawing(LWPOLYLINE.format('43 0.5', '')), 'LWPOLYLINE'),
    'POLYLINE 40': (drawing(POLYLINE.format('40 0.5', '')), 'POLYLINE'),
    'POLYLINE 41': (drawing(POLYLINE.format('41 0.5', '')), 'POLYLINE'),
    'VERTEX 40': (drawing(POLYLINE.format('', '40 0.5')), 'VERTEX'),
    'VERTEX 41': (drawing(POLYLINE.format('', '41 0.5')), 'VERTEX'),
    'BLOCK 70=4': (drawing(LINE, INSERT, blocks={'B 70 4 1 a.dwg': ''}), 'INSERT'),
    'BLOCK 70=8': (drawing(LINE, INSERT, blocks={'B 70 8 1 a.dwg': ''}), 'INSERT'),
    'INSERT without BLOCK': (drawing(LINE, INSERT), 'INSERT'),
    'SPATIAL_FILTER': (
        drawing(
            LINE,
            INSERT,
            blocks=BLOCKS,
            objects='0 DICTIONARY 5 A1 330 3F 0 DICTIONARY 5 A2 330 A1 '
            '0 SPATIAL_FILTER 5 A3 330 A2 71 1',
        ),
        'INSERT',
    ),
    'LAYER 290=0': (drawing(LINE + ' 8 Cut', layers=['Cut 290 0']), 'LAYER'),
    'LAYER 62<0': (drawing(LINE, CIRCLE + ' 8 Cut', layers=['Cut 62 -7']), 'CIRCLE'),
    'LAYER 70=1': (drawing(LINE, CIRCLE + ' 8 Cut', layers=['Cut 70 65']), 'CIRCLE'),
    'LAYER Defpoints': (drawing(LINE, CIRCLE + ' 8 DEFPOINTS'), 'CIRCLE'),
    '60': (drawing(LINE, CIRCLE + ' 60 1'), 'CIRCLE'),
    '67': (drawing(LINE, CIRCLE + ' 67 1'), 'CIRCLE'),
    '410': (drawing(LINE, CIRCLE + ' 410 Layout1'), 'CIRCLE'),
    'LAYER 6': (drawing(LINE + ' 8 Cut', layers=['Cut 6 DASHED']), 'LAYER'),
    'LAYER 62': (drawing(LINE + ' 8 Cut', layers=['Cut 62 3']), 'LAYER'),
    'LAYER 370': (drawing(LINE + ' 8 Cut', layers=['Cut 370 50']), 'LAYER'),
    'LAYER 420': (drawing(LINE + ' 8 Cut', layers=['Cut 420 255']), 'LAYER'),
    '$MEASUREMENT': (drawing(LINE, header='9 $MEASUREMENT 70 0'), ''),
}
VALUES = {'6': 'DASHED', '48': '0.5', '310': '0A 310 0B', '1001': 'ACAD 1000 two 1070 3'}
REFUSED = {
    'INSERT in its own BLOCK': drawing(INSERT, blocks={'B': '0 ' + INSERT}).encode(),
    '$INSUNITS 0': drawing(LINE, units=0).encode(),
    'binary DXF': b'AutoCAD Binary DXF\r\n\x1a\x00\x00SECTION\x00',
}


def of(treatment):
    return [name for name, term in TERMS.items() if term.treatment is treatment]


@pytest.mark.parametrize('name', of(Treatment.HONOURED))
def test_what_is_honoured_has_its_effect(tmp_path, name):
    if name.startswith('$INSUNITS'):
        check_unit(tmp_path, int(name.split()[1]))
        return
    if name == '$DWGCODEPAGE':
        check_code_page(tmp_path)
        return
    if name not in HONOURED:
        check_no_effect(tmp_path, name)
        return
    entity, points = HONOURED[name]
    found = imported(tmp_path, drawing(entity, blocks=BLOCKS))
    expected = [(*p, 0.0)[:3] for p in points if p is not ...]
    places = millimetres(found)
    if ... in points:
        assert len(places) > len(expected)
        places = np.vstack((places[: len(expected) - 1], places[-1:]))
    assert places == pytest.approx(np.array(expected), abs=1e-9)
    assert not [note for note in found.remarks if note.lines and '(handle' in note.what]
    if name in ('LWPOLYLINE 42', 'VERTEX 42'):
        # A quarter of the chord's length to its right.
        assert vias(found) == pytest.approx(np.array([[12.5, 5.0, 0.0]]))
    if name in ('SPLINE', 'SPLINE 41', 'HELIX'):
        assert np.hypot(*millimetres(found)[:, :2].T) == pytest.approx(10.0)


def check_unit(folder, number):
    length = UNITS[number][1]
    if 2e-5 < length < 5.0:
        found = imported(folder, drawing('LINE 10 1 20 2 11 3 21 2', units=number))
        assert millimetres(found)[1] == pytest.approx(1e3 * length * np.array([3.0, 2.0, 0.0]))
        return
    scale = 1e-2 / length
    text = drawing('LINE 10 1 20 2 11 3 21 2', units=number)
    assert millimetres(imported(folder, text, scale=scale))[1] == pytest.approx([30.0, 20.0, 0.0])
    with pytest.raises(BrokenFile, match='farther than 20 m' if length > 1.0 else 'smaller than'):
        imported(folder, text)


def check_code_page(folder):
    text = drawing(
        LINE, CIRCLE + ' 8 Größe', header='9 $DWGCODEPAGE 3 ANSI_936', layers=['Größe 70 1']
    )
    found = imported(folder, text.replace('Größe', '尺寸').encode('gbk'))
    assert found.remarks[0].what == 'CIRCLE on layer 尺寸 (handle 2F)'


def check_no_effect(folder, name):
    if name in ALWAYS:
        base, with_it = LINE, LINE + ' ' + ALWAYS[name]
        if name == '5':
            base, with_it = LINE.replace('5 2F', ''), LINE
    else:
        kind, code = name.split()
        if '=' in code:
            tags = code.replace('=', ' ')
        else:
            tags = {'11': '11 3 21 3', '12': '12 1 22 0', '13': '13 1 23 0'}.get(code, code + ' 1')
        entity, first, second = NO_EFFECT.get(name) or NO_EFFECT[kind]
        base = entity.format('', '')
        with_it = entity.format(first.format(tags), second.format(tags))
    goals = [imported(folder, drawing(entity, blocks=BLOCKS)) for entity in (base, with_it)]
    assert millimetres(goals[0]).tolist() == millimetres(goals[1]).tolist()
    assert [r.why for r in goals[0].remarks] == [r.why for r in goals[1].remarks]


@pytest.mark.parametrize('name', of(Treatment.LEFT_OUT))
def test_what_is_left_out_is_said_with_its_line_and_handle(tmp_path, name):
    if name in LEFT_OUT:
        text, kind = LEFT_OUT[name]
    elif name.isdecimal():
        text, kind = drawing(f'{LINE} {name} {VALUES.get(name, "30")}'), 'LINE'
    else:
        kind, one_word = name, name.replace(' ', '_')
        text = drawing(LINE, f'{one_word} 5 4F 10 0 20 0').replace(one_word, name)
    found = imported(tmp_path, text)
    assert len(millimetres(found)) >= 2
    notes = [note for note in found.remarks if note.why == TERMS[name].reason]
    assert len(notes) == 1
    if kind:
        count = 2 if kind == 'VERTEX' else 1
        assert notes[0].lines == (line_of(text, kind, count),)
    if kind not in ('', 'LAYER', 'VERTEX', 'SPLINE'):
        assert '(handle ' in notes[0].what


@pytest.mark.parametrize('name', of(Treatment.REFUSED))
def test_what_is_refused_is_a_sentence(tmp_path, name):
    with pytest.raises(
        BrokenFile, match=TERMS[name].reason.replace('(', r'\(').replace(')', r'\)')
    ):
        imported(tmp_path, REFUSED[name])


def test_the_table_has_all_units():
    assert sorted(UNITS) == list(range(1, 25))


@pytest.mark.parametrize('entity', ['WALL 5 7F 10 0 20 0', f'{LINE} 77 5'])
def test_what_no_term_names_is_said(tmp_path, entity):
    text = drawing('CIRCLE 10 0 20 0 40 1', entity)
    found = imported(tmp_path, text)
    assert found.remarks[0].lines == (line_of(text, entity.split()[0]),)
    note = found.remarks[0]
    assert (note.what, note.why) in (
        ("'WALL' (handle 7F)", 'it is no entity that is known here'),
        ('LINE (handle 2F)', 'group code 77 is none of a LINE'),
    )
