# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Terms of DXF: kinds of entities, their group codes, units.

A group code is named with its kind of entity, such as ``LWPOLYLINE 42``; a code alone, such as
``39``, means that code of any entity. A point is named by its first code: ``LINE 11`` means 11,
21 and 31. ``POLYLINE 70=16`` means a bit of a group code. Names and meanings follow the AutoCAD
DXF reference.
"""

from __future__ import annotations

from functools import cache

from ur_cartesian_driver.importing.dxf.dxf_records import EXTENDED_DATA, Record
from ur_cartesian_driver.importing.import_format import (
    honoured,
    left_out,
    refused,
    Term,
    term_table,
    Treatment,
)
from ur_cartesian_driver.importing.imported_path import ImportNotes
from ur_cartesian_driver.importing.text_file import quoted

#: Names and lengths [m] of the units by the number of $INSUNITS. The survey foot is 1200/3937 m.
UNITS = {
    1: ('inches', 0.0254),
    2: ('feet', 0.3048),
    3: ('miles', 1609.344),
    4: ('millimetres', 1e-3),
    5: ('centimetres', 1e-2),
    6: ('metres', 1.0),
    7: ('kilometres', 1e3),
    8: ('microinches', 2.54e-8),
    9: ('mils', 2.54e-5),
    10: ('yards', 0.9144),
    11: ('angstroms', 1e-10),
    12: ('nanometres', 1e-9),
    13: ('microns', 1e-6),
    14: ('decimetres', 0.1),
    15: ('decametres', 10.0),
    16: ('hectometres', 100.0),
    17: ('gigametres', 1e9),
    18: ('astronomical units', 149597870700.0),
    19: ('light years', 9460730472580800.0),
    20: ('parsecs', 3.0856775814913673e16),
    21: ('US survey feet', 1200.0 / 3937.0),
    22: ('US survey inches', 100.0 / 3937.0),
    23: ('US survey yards', 3600.0 / 3937.0),
    24: ('US survey miles', 6336000.0 / 3937.0),
}
#: Numbers of the units for which $MEASUREMENT is 0; it is 1 for all others.
ENGLISH = (1, 2, 3, 8, 9, 10, 21, 22, 23, 24)
_KINDS, _ANY, _NO_EFFECT = 'kinds of entities', 'any entity', 'without effect on a shape'
_WIDTH = 'it has a width; the tool follows the middle'

TERMS = term_table(
    honoured(
        _KINDS,
        *('LINE', 'ARC', 'CIRCLE', 'ELLIPSE', 'SPLINE', 'HELIX'),
        *('LWPOLYLINE', 'POLYLINE', 'VERTEX', 'SEQEND', 'INSERT'),
    ),
    left_out(
        _KINDS,
        'texts are not engraved; convert them to polylines',
        *('TEXT', 'MTEXT', 'ATTRIB', 'ATTDEF', 'SHAPE'),
    ),
    left_out(
        _KINDS,
        'annotations have no path',
        *('DIMENSION', 'ARC_DIMENSION', 'LARGE_RADIAL_DIMENSION', 'LEADER', 'MULTILEADER'),
        *('MLEADER', 'TOLERANCE', 'ACAD_TABLE', 'GEOPOSITIONMARKER'),
    ),
    left_out(
        _KINDS,
        'a surface or a body has no path; draw its edges',
        *('HATCH', 'MPOLYGON', 'SOLID', 'TRACE', '3DFACE', 'REGION', '3DSOLID', 'BODY', 'MESH'),
        *('SURFACE', 'EXTRUDEDSURFACE', 'LOFTEDSURFACE', 'NURBSURFACE', 'PLANESURFACE'),
        *('REVOLVEDSURFACE', 'SWEPTSURFACE'),
    ),
    left_out(_KINDS, 'a point alone is no path', 'POINT'),
    left_out(_KINDS, 'it has no end', 'RAY', 'XLINE'),
    left_out(_KINDS, 'explode it', 'MLINE'),
    left_out(
        _KINDS,
        'a picture or a view has no path',
        *('IMAGE', 'WIPEOUT', 'OLEFRAME', 'OLE2FRAME', 'PDFUNDERLAY', 'DWFUNDERLAY'),
        *('DGNUNDERLAY', 'VIEWPORT', 'LIGHT', 'SUN', 'CAMERA', 'SECTIONOBJECT'),
    ),
    left_out(
        _KINDS,
        'only the application that wrote it can draw it; explode it there',
        *('ACAD_PROXY_ENTITY', 'COORDINATION MODEL', 'ACAD_ZOMBIE_ENTITY'),
    ),
    honoured(_ANY, '8', '38'),
    left_out(_ANY, 'it is invisible', '60'),
    left_out(_ANY, 'it is in paper space', '67', '410'),
    left_out(_ANY, 'it has a thickness; the tool follows its foot', '39'),
    left_out(
        _ANY,
        'it has a colour, type or weight; the tool follows it without gaps all the same',
        *('6', '48', '62', '284', '347', '348', '370', '390', '420', '430', '440'),
    ),
    left_out(
        _ANY,
        'it has data that only the application that wrote them knows',
        *('92', '160', '310', str(EXTENDED_DATA)),
    ),
    honoured('LINE', 'LINE 10', 'LINE 11'),
    honoured('ARC', 'ARC 10', 'ARC 40', 'ARC 50', 'ARC 51', 'ARC 210'),
    honoured('CIRCLE', 'CIRCLE 10', 'CIRCLE 40', 'CIRCLE 210'),
    honoured('ELLIPSE', 'ELLIPSE 10', 'ELLIPSE 11', 'ELLIPSE 40', 'ELLIPSE 41', 'ELLIPSE 42'),
    honoured('ELLIPSE', 'ELLIPSE 210'),
    honoured('LWPOLYLINE', 'LWPOLYLINE 10', 'LWPOLYLINE 42', 'LWPOLYLINE 70=1'),
    honoured('LWPOLYLINE', 'LWPOLYLINE 90', 'LWPOLYLINE 210'),
    left_out('LWPOLYLINE', _WIDTH, 'LWPOLYLINE 40', 'LWPOLYLINE 41', 'LWPOLYLINE 43'),
    honoured('POLYLINE', 'POLYLINE 10', 'POLYLINE 70=1', 'POLYLINE 70=8', 'POLYLINE 210'),
    left_out('POLYLINE', 'a mesh has no path; explode it', 'POLYLINE 70=16', 'POLYLINE 70=64'),
    left_out('POLYLINE', _WIDTH, 'POLYLINE 40', 'POLYLINE 41'),
    honoured('VERTEX', 'VERTEX 10', 'VERTEX 42', 'VERTEX 70=16'),
    left_out('VERTEX', 'the elevation is that of the POLYLINE', 'VERTEX 30'),
    left_out('VERTEX', _WIDTH, 'VERTEX 40', 'VERTEX 41'),
    honoured('SPLINE, HELIX', 'SPLINE 10', 'SPLINE 40', 'SPLINE 41', 'SPLINE 71', 'SPLINE 72'),
    honoured('SPLINE, HELIX', 'SPLINE 73'),
    left_out(
        'SPLINE, HELIX',
        'between fit points alone the curve is not defined',
        'SPLINE 11 without 10',
    ),
    left_out(
        'SPLINE, HELIX',
        'its ends do not meet, so it stays open',
        'SPLINE 70=1 with a gap',
    ),
    honoured('INSERT', 'INSERT 2', 'INSERT 10', 'INSERT 41', 'INSERT 42', 'INSERT 43'),
    honoured('INSERT', 'INSERT 44', 'INSERT 45', 'INSERT 50', 'INSERT 70', 'INSERT 71'),
    honoured('INSERT', 'INSERT 210'),
    left_out('INSERT', 'its block is not in the file', 'INSERT without BLOCK'),
    left_out('INSERT', 'it is clipped; explode and trim it', 'SPATIAL_FILTER'),
    refused('INSERT', 'its block contains itself', 'INSERT in its own BLOCK'),
    honoured('BLOCK', 'BLOCK 2', 'BLOCK 10'),
    left_out('BLOCK', 'its entities are in another file', 'BLOCK 70=4', 'BLOCK 70=8'),
    # These codes say how a shape was made; the file also contains the shape's points and knots.
    honoured(
        _NO_EFFECT,
        *('5', '100', '102', '330', '360', '999', 'LINE 210', 'INSERT 66'),
        *('LWPOLYLINE 70=128', 'LWPOLYLINE 91', 'POLYLINE 66', 'POLYLINE 70=2', 'POLYLINE 70=4'),
        *('POLYLINE 70=128', 'POLYLINE 71', 'POLYLINE 72', 'POLYLINE 73', 'POLYLINE 74'),
        *('POLYLINE 75', 'VERTEX 50', 'VERTEX 70=1', 'VERTEX 70=2', 'VERTEX 70=8'),
        *('VERTEX 70=32', 'VERTEX 91', 'SPLINE 11', 'SPLINE 12', 'SPLINE 13', 'SPLINE 42'),
        *('SPLINE 43', 'SPLINE 44', 'SPLINE 70=1', 'SPLINE 70=2', 'SPLINE 70=4', 'SPLINE 70=8'),
        *('SPLINE 70=16', 'SPLINE 74', 'SPLINE 210'),
    ),
    left_out('layers', 'its layer is off', 'LAYER 62<0'),
    left_out('layers', 'its layer is frozen', 'LAYER 70=1'),
    left_out('layers', 'its layer is for dimensions', 'LAYER Defpoints'),
    left_out('layers', 'it is not plotted, but seen and followed', 'LAYER 290=0'),
    left_out(
        'layers',
        'it has a colour, type or weight; the tool follows its lines without gaps all the same',
        *('LAYER 6', 'LAYER 62', 'LAYER 370', 'LAYER 420'),
    ),
    honoured('header', *(f'$INSUNITS {number}' for number in UNITS), '$DWGCODEPAGE'),
    left_out('header', 'the unit is that of $INSUNITS, or the option unit', '$MEASUREMENT'),
    refused('header', 'give the option unit, mm perhaps', '$INSUNITS 0'),
    refused('file', 'save it as a text (ASCII) DXF', 'binary DXF'),
)

#: Default values of group codes, in addition to 0 and the empty value.
_DEFAULTS = {
    '6': ('BYLAYER', 'BYBLOCK', 'CONTINUOUS'),
    '48': ('1',),
    '62': ('7', '256'),
    '370': ('-1', '-2', '-3'),
    '410': ('MODEL',),
}
_FLAGS = 70
#: The kinds of entities whose flags have a term for each bit.
_HAVE_BITS = ('LWPOLYLINE', 'POLYLINE', 'VERTEX', 'SPLINE', 'HELIX')


@cache
def _term(kind: str, code: str) -> Term | None:
    """Return the term of a group code for a kind, or else for any entity; HELIX means SPLINE."""
    if kind == 'HELIX':
        kind = 'SPLINE'
    return TERMS.get(f'{kind} {code}') or TERMS.get(code)


@cache
def _first_code(code: int) -> int:
    """Return the code of a point's x for the code of its y or z; other codes are unchanged."""
    for first, last, x in ((20, 28, 10), (30, 37, 10), (220, 223, 210), (230, 233, 210)):
        if first <= code <= last:
            return x + code - first
    return code


@cache
def _notable(kind: str, codes: tuple[int, ...]) -> tuple[tuple[int, str], ...]:
    """Return the group codes that are not honoured for a kind of entity, with their names."""
    named = ((code, str(_first_code(code))) for code in codes)
    return tuple(
        (code, name)
        for code, name in named
        if (code != _FLAGS or kind not in _HAVE_BITS)
        and not ((term := _term(kind, name)) and term.treatment is Treatment.HONOURED)
    )


class LeftOut:
    """Collects the omissions from a drawing, with the lines and handles of its records."""

    def __init__(self) -> None:
        """Begin with nothing."""
        self._found: dict[tuple[str, str], dict[Record, None]] = {}

    def add(self, record: Record, why: str, what: str = '') -> None:
        """Note that a record is left out, or make another remark about it."""
        what = what or (record.kind if record.kind in TERMS else quoted(record.kind))
        self._found.setdefault((what, why), {})[record] = None

    def add_term(self, record: Record, name: str, what: str = '') -> None:
        """Note that a record is left out for the reason of a term."""
        self.add(record, TERMS[name].reason, what)

    def add_entity(self, record: Record) -> None:
        """Note that an entity is left out because of its kind."""
        term = TERMS.get(record.kind)
        if record.kind == 'VERTEX':
            self.add(record, 'it follows no POLYLINE')
        else:
            self.add(record, term.reason if term else 'it is no entity that is known here')

    def add_codes(self, record: Record) -> None:
        """Note the group codes of an entity that are left out, or not known."""
        for code, name in _notable(record.kind, tuple(record.values)):
            self._add_code(record, name, code)
        if _FLAGS in record.values and record.kind in _HAVE_BITS:
            flags = record.integer(_FLAGS)
            for bit in range(16):
                if flags >> bit & 1:
                    self._add_code(record, f'{_FLAGS}={1 << bit}', _FLAGS)

    def add_look(self, layer: Record) -> None:
        """Note the properties of a layer that the tool ignores."""
        for code in (6, 62, 370, 420):
            if code in layer.values:
                self._add_code(layer, str(code), code)

    def _add_code(self, record: Record, name: str, code: int) -> None:
        term = _term(record.kind, name)
        what = '' if record.kind != 'LAYER' else f'layer {record.text(2)}'
        if term is None:
            self.add(record, f'group code {name} is none of a {record.kind}', what)
        elif term.treatment is Treatment.LEFT_OUT and not all(
            _is_default(name, value) for value, _ in record.values[code]
        ):
            self.add(record, term.reason, what)

    def tell(self, remarks: ImportNotes) -> None:
        """Add all remarks to the import's; each names the handles of its first records."""
        for (what, why), records in self._found.items():
            handles = _listed([record.handle for record in records if record.handle])
            for record in records:
                remarks.add(record.line, what + handles, why)


def _is_default(code: str, value: str) -> bool:
    try:
        value = f'{float(value):g}'
    except ValueError:
        value = value.upper()
    return value in ('', '0', *_DEFAULTS.get(code, ()))


def _listed(handles: list[str], shown: int = 4) -> str:
    if not handles:
        return ''
    more = f' and {len(handles) - shown} more' if len(handles) > shown else ''
    plural = 's' if len(handles) > 1 else ''
    return f' (handle{plural} {", ".join(handles[:shown])}{more})'
