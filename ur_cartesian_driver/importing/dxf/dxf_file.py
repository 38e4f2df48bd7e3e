# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
DXF drawings: lines, arcs, circles, ellipses, polylines with bulges, and splines.

ezdxf reads the drawing. It does not keep the lines of the file, so a pass over the tags finds
them; the same pass refuses files that are cut off or have a broken tag.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
import io
from math import atan, hypot, pi, tan
from pathlib import Path
from typing import Any

from ur_cartesian_driver.importing.import_format import ImportFormat, term_table
from ur_cartesian_driver.importing.import_options import ImportOptions, LENGTH_UNITS
from ur_cartesian_driver.importing.imported_path import BrokenFile, PathCollector
from ur_cartesian_driver.importing.text_file import file_lines, file_text
from ur_cartesian_driver.motion.goal import SegmentType
from ur_cartesian_driver.motion.vectors import Vector3, vector3

#: The numbers of $INSUNITS.
_UNITS = {1: 'in', 2: 'ft', 4: 'mm', 5: 'cm', 6: 'm', 13: 'um'}
#: Ends that are as near as this are joined [m].
_JOINED = 1e-5
_KINDS_LEFT_OUT = {
    'INSERT': 'a block; explode it',
    'HATCH': 'a surface has no path',
    'POINT': 'a point alone is no path',
    'TEXT': 'texts are not engraved; convert them to polylines',
    'MTEXT': 'texts are not engraved; convert them to polylines',
}


@dataclass(frozen=True, slots=True)
class _Contour:
    """Points in a row; the motion to each but the first is a line, or an arc through its via."""

    line: int
    points: list[Vector3]
    vias: list[Vector3 | None]

    def reversed(self) -> _Contour:
        return _Contour(self.line, self.points[::-1], [None, *self.vias[:0:-1]])


def collect_dxf(file: Path, options: ImportOptions, into: PathCollector) -> None:
    """
    Read the model space of a drawing, in the order of the file.

    :raises BrokenFile: a tag is broken, the file ends too early, or its unit is not known.
    :raises ImportError: ezdxf is not installed; the text says how to install it.
    """
    try:
        import ezdxf.filemanagement as ezdxf
    except ImportError:
        raise ImportError(
            'DXF needs ezdxf, which is not installed; install it by pip install ezdxf, or the '
            "extra 'import' of this package"
        ) from None
    text = file_text(file)
    places = _Places(text)
    try:
        drawing = ezdxf.read(io.StringIO(text))
    except Exception as error:  # ezdxf's own, and what broken files make it raise
        raise BrokenFile(
            places.last_line,
            f'ezdxf cannot read the drawing: {" ".join(str(error).split())}'.rstrip('.'),
        ) from None
    unit = _unit(drawing, options)
    end: Vector3 | None = None
    for entity in drawing.modelspace():
        kind = entity.dxftype()
        line = places.line_of(entity)
        try:
            contour = _contour(entity, line, unit, options)
        except (ValueError, ArithmeticError, AttributeError) as error:
            raise BrokenFile(line, f'the {kind} cannot be read: {error}'.rstrip('.')) from None
        if contour is None:
            into.remarks.add(line, kind, _KINDS_LEFT_OUT.get(kind, 'it is no path of the tool'))
            continue
        if end is not None and _distance(end, contour.points[0]) > _JOINED:
            if _distance(end, contour.points[-1]) <= _JOINED:
                contour = contour.reversed()
        begins = end is None or _distance(end, contour.points[0]) > _JOINED
        if begins:
            into.add(line, contour.points[0], travel=True, lift=True)
        for point, via in zip(contour.points[1:], contour.vias[1:], strict=True):
            arc = via is not None
            into.add(line, point, SegmentType.CIRCULAR if arc else SegmentType.LINEAR, via=via)
        end = contour.points[-1]


def _unit(drawing: Any, options: ImportOptions) -> float:
    number = drawing.header.get('$INSUNITS', 0)
    name = options.unit or _UNITS.get(number, '')
    if not name:
        raise BrokenFile(
            0, 'the drawing does not say its unit ($INSUNITS); give the option unit, mm perhaps'
        )
    return LENGTH_UNITS[name]


def _distance(a: Vector3, b: Vector3) -> float:
    return hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2])


class _Places:
    """Where the entities of a drawing begin."""

    def __init__(self, text: str) -> None:
        lines = file_lines(text)
        self.last_line = len(lines)
        self._by_handle: dict[str, int] = {}
        self._by_kind: dict[str, list[int]] = {}
        section, kind, line, ended = '', '', 0, False
        handle = False
        for i in range(0, len(lines) - 1, 2):
            try:
                code = int(lines[i])
            except ValueError:
                raise BrokenFile(
                    i + 1, f'{lines[i].strip()!r:.40} is no group code of a DXF file'
                ) from None
            value = lines[i + 1].strip()
            if code == 0:
                if value == 'EOF':
                    ended = True
                    break
                if section == 'ENTITIES' and kind and not handle:
                    self._by_kind.setdefault(kind, []).append(line)
                kind, line, handle = value, i + 1, False
                if value in ('SECTION', 'ENDSEC'):
                    section = ''
            elif code == 2 and kind == 'SECTION':
                section = value
            elif code == 5 and section == 'ENTITIES':
                self._by_handle[value.upper()] = line
                handle = True
            elif 10 <= code <= 59 and section == 'ENTITIES':
                try:
                    float(value)
                except ValueError:
                    raise BrokenFile(
                        i + 2, f'{value!r:.40} is no number (group code {code})'
                    ) from None
        if not ended:
            raise BrokenFile(self.last_line, 'the drawing ends here, before its EOF')
        self._next = {name: iter(found) for name, found in self._by_kind.items()}

    def line_of(self, entity: Any) -> int:
        """Return the line of the next entity; 0 = unknown."""
        line = self._by_handle.get(str(entity.dxf.get('handle', '')).upper())
        if line is not None and not self._by_kind.get(entity.dxftype()):
            return line
        return next(self._next.get(entity.dxftype(), iter(())), 0)


def _contour(entity: Any, line: int, unit: float, options: ImportOptions) -> _Contour | None:
    kind = entity.dxftype()
    if kind == 'LINE':
        ends = [_metres(entity.dxf.start, unit), _metres(entity.dxf.end, unit)]
        return _Contour(line, ends, [None, None])
    if kind in ('ARC', 'CIRCLE'):
        return _round(entity, kind, line, unit)
    if kind == 'LWPOLYLINE':
        elevation = entity.dxf.get('elevation', 0.0)
        corners = [(x, y, elevation, bulge) for x, y, bulge in entity.get_points('xyb')]
        return _polyline(corners, entity.closed, entity.ocs(), line, unit)
    if kind == 'POLYLINE' and entity.is_2d_polyline:
        elevation = entity.dxf.get('elevation', (0.0, 0.0, 0.0))[2]
        corners = [
            (v.dxf.location.x, v.dxf.location.y, elevation, v.dxf.get('bulge', 0.0))
            for v in entity.vertices
        ]
        return _polyline(corners, entity.is_closed, entity.ocs(), line, unit)
    if kind == 'POLYLINE' and entity.is_3d_polyline:
        places = [_metres(v.dxf.location, unit) for v in entity.vertices]
        if entity.is_closed and places:
            places.append(places[0])
        return _lines(places, line)
    if kind in ('SPLINE', 'ELLIPSE'):
        places = [_metres(p, unit) for p in entity.flattening(options.tolerance / unit)]
        return _lines(places, line)
    return None


def _metres(place: Any, unit: float) -> Vector3:
    return (unit * place[0], unit * place[1], unit * place[2])


def _lines(places: Sequence[Vector3], line: int) -> _Contour:
    if len(places) < 2:
        raise ValueError('it has fewer than two points')
    return _Contour(line, list(places), [None] * len(places))


def _round(entity: Any, kind: str, line: int, unit: float) -> _Contour:
    centre, radius = entity.dxf.center, entity.dxf.radius
    if kind == 'CIRCLE':
        x, y, z = centre[0] + radius, centre[1], centre[2]
        corners = [(x, y, z, 1.0), (x - 2.0 * radius, y, z, 1.0)]
        return _polyline(corners, True, entity.ocs(), line, unit)
    from ezdxf.math import Vec3

    begin, stop = entity.dxf.start_angle, entity.dxf.end_angle
    sweep = (stop - begin) % 360.0 or 360.0
    places = [
        Vec3(centre) + Vec3.from_deg_angle(angle, radius) for angle in (begin, begin + sweep)
    ]
    if sweep == 360.0:
        return _round(entity, 'CIRCLE', line, unit)
    (ax, ay, az), (bx, by, bz) = places
    bulge = tan(sweep * pi / 180.0 / 4.0)
    return _polyline([(ax, ay, az, bulge), (bx, by, bz, 0.0)], False, entity.ocs(), line, unit)


def _polyline(
    corners: Sequence[tuple[float, float, float, float]],
    closed: bool,
    ocs: Any,
    line: int,
    unit: float,
) -> _Contour:
    """Return the contour of corners x, y, z with the bulge of what follows, in its own axes."""
    if len(corners) < 2:
        raise ValueError('it has fewer than two points')
    points: list[Vector3] = [corners[0][:3]]
    vias: list[Vector3 | None] = [None]
    ends = [*corners[1:], corners[0]] if closed else corners[1:]
    for (ax, ay, z, bulge), (bx, by, _, _) in zip(corners, ends, strict=False):
        for via, end in _bulge(ax, ay, bx, by, bulge):
            vias.append(None if via is None else (*via, z))
            points.append((*end, z))
    if ocs.transform:
        points = [vector3(ocs.to_wcs(point)) for point in points]
        vias = [None if via is None else vector3(ocs.to_wcs(via)) for via in vias]
    return _Contour(
        line,
        [_metres(point, unit) for point in points],
        [None if via is None else _metres(via, unit) for via in vias],
    )


def _bulge(
    ax: float, ay: float, bx: float, by: float, bulge: float
) -> Iterator[tuple[tuple[float, float] | None, tuple[float, float]]]:
    """Yield a line or arcs, of no more than a half circle each; bulge = tan(angle / 4)."""
    if bulge == 0.0:
        yield None, (bx, by)
        return
    # The middle of the arc lies to the right of the chord if it turns to the left.
    mx = 0.5 * (ax + bx) + 0.5 * bulge * (by - ay)
    my = 0.5 * (ay + by) - 0.5 * bulge * (bx - ax)
    if abs(bulge) > tan(0.95 * pi / 4.0):
        half = tan(0.5 * atan(bulge))
        yield from _bulge(ax, ay, mx, my, half)
        yield from _bulge(mx, my, bx, by, half)
    else:
        yield (mx, my), (bx, by)


FORMAT = ImportFormat(
    name='dxf',
    suffixes=('.dxf',),
    terms=term_table(),
    others='Every other entity is left out, and said.',
    collect=collect_dxf,
)
