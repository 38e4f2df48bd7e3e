# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Entities of a drawing as stretches: sequences of points with lines and arcs between them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import atan, cos, isclose, pi, radians, sin, tau

import numpy as np

from ur_cartesian_driver.importing.dxf.affine import Affine, object_axes
from ur_cartesian_driver.importing.dxf.curve_chords import chords, ellipse_curves, spline_curves
from ur_cartesian_driver.importing.dxf.dxf_records import Record, Z_AXIS
from ur_cartesian_driver.importing.dxf.dxf_terms import LeftOut
from ur_cartesian_driver.importing.imported_path import BrokenFile
from ur_cartesian_driver.motion.geometry.vectors import (
    add,
    cross,
    dot,
    norm,
    scale,
    subtract,
    Vector3,
    ZERO3,
)

#: Largest angle [rad] of one arc of the robot; longer arcs are halved.
_LONGEST_ARC = 0.95 * pi
#: Rounding error [turns] of whole turns in files, some of which write 6.2832.
_WHOLE_TURN = 1e-5
#: Arcs with a smaller bulge are drawn as lines: their height is below a billionth of the chord.
_FLAT = 1e-9
_CLOSED, _FITTED, _IN_SPACE, _MESH, _FACES, _FRAME = 1, 4, 8, 16, 64, 16
#: Ends within this distance [m] of each other are joined.
JOINED = 1e-5


class _NoPathError(Exception):
    """An entity has no path; the message is the name of the term with the reason."""


@dataclass(frozen=True, slots=True)
class Stretch:
    """Points [m]; a line, or an arc through a via point, leads to each point but the first."""

    record: Record
    points: list[Vector3]
    vias: list[Vector3 | None]

    def reversed(self) -> Stretch:
        """Return the stretch in the opposite direction."""
        return Stretch(self.record, self.points[::-1], [None, *self.vias[:0:-1]])


@dataclass(frozen=True, slots=True)
class _Pen:
    """Draws a stretch in the coordinates of its entity."""

    place: Affine
    tolerance: float
    points: list[Vector3] = field(default_factory=list)
    vias: list[Vector3 | None] = field(default_factory=list)

    def line_to(self, point: Vector3) -> None:
        """Draw a line to a point, or begin there."""
        self.points.append(self.place.point(point))
        self.vias.append(None)

    def along_ellipse(
        self, centre: Vector3, a: Vector3, b: Vector3, begin: float, sweep: float
    ) -> None:
        """Draw centre + a cos t + b sin t from t = begin, where the pen is, to begin + sweep."""
        centre, a, b = self.place.point(centre), self.place.direction(a), self.place.direction(b)
        if abs(dot(a, b)) > 1e-9 * dot(a, a) or not isclose(norm(a), norm(b), rel_tol=1e-9):
            c, d, e = (np.array(v) for v in (centre, a, b))
            self._follow(chords(ellipse_curves(d, e, c, begin, sweep), self.tolerance).tolist())
            return
        count = 1
        while abs(sweep) > count * _LONGEST_ARC:
            count *= 2
        step = 0.5 * sweep / count
        at = [
            add(centre, add(scale(a, cos(t)), scale(b, sin(t))))
            for t in (begin + k * step for k in range(1, 2 * count + 1))
        ]
        self.points.extend(at[1::2])
        self.vias.extend(at[::2])

    def along_spline(self, degree: int, knots: Sequence[float], controls: object) -> None:
        """Draw a whole B-spline with weighted control points."""
        curves = spline_curves(degree, np.array(knots), np.array(controls))
        places = chords(self.place.weighted_points(curves), self.tolerance).tolist()
        self.points.append(tuple(places[0]))
        self.vias.append(None)
        self._follow(places)

    def _follow(self, places: Sequence[Sequence[float]]) -> None:
        self.points.extend((x, y, z) for x, y, z in places[1:])
        self.vias.extend([None] * (len(places) - 1))

    def length_of(self, v: Vector3) -> float:
        """Return the length of a difference of two points of the entity [m]."""
        return norm(self.place.direction(v))

    def gap(self) -> float:
        """Return the distance [m] between the ends."""
        return norm(subtract(self.points[0], self.points[-1]))

    def arrive(self, point: Vector3) -> None:
        """Move the newest point, the end of a curve, exactly to the point that the file gives."""
        self.points[-1] = self.place.point(point)


def stretch_of(
    record: Record, place: Affine, tolerance: float, left_out: LeftOut
) -> Stretch | None:
    """
    Return the stretch of an entity; None = the entity is left out, with a remark.

    :param place: the map from the drawing's coordinates to [m].
    :param tolerance: the largest distance [m] of chords from their curve.
    :raises BrokenFile: a value is missing or must be a mistake.
    """
    draw = _DRAWN.get(record.kind)
    if draw is None:
        left_out.add_entity(record)
        return None
    try:
        pen = _Pen(_coordinates(record, place), tolerance)
        draw(record, pen, left_out)
    except BrokenFile:
        raise
    except _NoPathError as error:
        left_out.add_term(record, str(error))
        return None
    except ValueError as error:
        raise record.fault(str(error)) from None
    left_out.add_codes(record)
    if len(pen.points) < 2:
        left_out.add(record, 'it has fewer than two points')
        return None
    return Stretch(record, pen.points, pen.vias)


def _coordinates(record: Record, place: Affine) -> Affine:
    """Return the map from an entity's coordinates to [m]; a plane entity has its own axes."""
    is_plane = record.kind in ('ARC', 'CIRCLE', 'LWPOLYLINE', 'POLYLINE')
    if not is_plane or (record.kind == 'POLYLINE' and record.integer(70) & _IN_SPACE):
        return place
    extrusion = record.extrusion()
    return place if extrusion == Z_AXIS else place.after(object_axes(extrusion))


def _line(record: Record, pen: _Pen, left_out: LeftOut) -> None:
    pen.line_to(record.point(10))
    pen.line_to(record.point(11))


def _round(record: Record, pen: _Pen, left_out: LeftOut) -> None:
    """Draw a circle or an arc."""
    centre, radius = record.point(10), record.number(40)
    if not radius > 0.0:
        raise ValueError(f'its radius is {radius:g}')
    begin, sweep = 0.0, tau
    if record.kind == 'ARC':
        begin = radians(record.number(50))
        sweep = _sweep(begin, radians(record.number(51)))
    a, b = (radius, 0.0, 0.0), (0.0, radius, 0.0)
    _closed_ellipse(pen, centre, a, b, begin, sweep)


def _ellipse(record: Record, pen: _Pen, left_out: LeftOut) -> None:
    centre, a, ratio = record.point(10), record.point(11), record.number(40)
    if not (ratio > 0.0 and norm(a) > 0.0):
        raise ValueError('it has an axis without a length')
    normal = object_axes(record.extrusion()).z
    out = dot(normal, a)
    # If the axis is not in the plane, some programs turn the axis, and others the plane. If it is
    # steep to the plane, there is no ellipse, however small.
    if pen.length_of(scale(normal, out)) > pen.tolerance or abs(out) > 0.5 * norm(a):
        raise ValueError(f'its axis leaves its plane by {abs(out):g} (group codes 11 and 210)')
    across = cross(normal, a)
    b = scale(across, ratio * norm(a) / norm(across))
    begin = record.number(41, 0.0)
    _closed_ellipse(pen, centre, a, b, begin, _sweep(begin, record.number(42, tau)))


def _closed_ellipse(
    pen: _Pen, centre: Vector3, a: Vector3, b: Vector3, begin: float, sweep: float
) -> None:
    start = add(centre, add(scale(a, cos(begin)), scale(b, sin(begin))))
    pen.line_to(start)
    pen.along_ellipse(centre, a, b, begin, sweep)
    if sweep == tau:
        pen.arrive(start)


def _sweep(begin: float, end: float) -> float:
    """Return the angle from begin to end, counter-clockwise; a whole turn if they are equal."""
    turns = (end - begin) / tau
    if abs(turns - round(turns)) < _WHOLE_TURN and (round(turns) or turns == 0.0):
        return tau
    return (end - begin) % tau


def _lwpolyline(record: Record, pen: _Pen, left_out: LeftOut) -> None:
    corners: list[list[float | None]] = []
    elevation = record.number(38, 0.0)
    for code, value, line in record.numbered(10, 20, 42):
        if code == 10:
            corners.append([value, None, 0.0])
        elif not corners:
            raise record.fault(f'group code {code} stands before the first 10', line)
        elif code == 20 and corners[-1][1] is not None:
            raise record.fault('group code 20 occurs twice for a vertex', line)
        else:
            corners[-1][1 if code == 20 else 2] = value
    found = []
    for x, y, bulge in corners:
        if x is None or y is None or bulge is None:
            raise ValueError('a vertex has no y (group code 20)')
        found.append((x, y, bulge))
    count = record.integer(90, len(found))
    if count != len(found):
        raise ValueError(f'it has {len(found)} vertices in place of {count} (group code 90)')
    _plane_polyline(pen, found, elevation, bool(record.integer(70) & _CLOSED))


def _polyline(record: Record, pen: _Pen, left_out: LeftOut) -> None:
    flags = record.integer(70)
    for bit in (_MESH, _FACES):
        if flags & bit:
            raise _NoPathError(f'POLYLINE 70={bit}')
    record.point(10, ZERO3)  # refuses a second point, of a vertex whose beginning is missing
    vertices = []
    for vertex in record.vertices:
        # The control frame of a spline-fit polyline is not visible.
        if not vertex.integer(70) & _FRAME:
            vertices.append(vertex)
            left_out.add_codes(vertex)
        elif not flags & _FITTED:
            raise vertex.fault(
                'it is a control point (group code 70), but its POLYLINE is no fitted spline'
            )
    if flags & _IN_SPACE:
        points = [vertex.point(10) for vertex in vertices]
        for vertex in vertices:
            if vertex.number(42, 0.0):
                raise vertex.fault('a vertex in space has no bulge (group code 42)')
        for point in [*points, points[0]] if flags & _CLOSED and points else points:
            pen.line_to(point)
        return
    height = _elevation(record, vertices, pen)
    for vertex in vertices:
        if vertex.point(10)[2] != height and 30 in vertex.values:
            left_out.add_term(vertex, 'VERTEX 30')
    corners = [(*vertex.point(10)[:2], vertex.number(42, 0.0)) for vertex in vertices]
    _plane_polyline(pen, corners, height, bool(flags & _CLOSED))


def _elevation(record: Record, vertices: Sequence[Record], pen: _Pen) -> float:
    """
    Return the elevation of a plane polyline: its own, or the common one of its vertices.

    :raises ValueError: it has no elevation of its own, and its points have different ones.
    """
    for code in (30, 38):
        if code in record.values:
            return record.number(code)
    heights = [vertex.point(10)[2] for vertex in vertices]
    # If the polyline's own point has no z, most programs read it as an elevation of 0.
    found = [*heights, *([0.0] if 10 in record.values else [])]
    if found and pen.length_of((0.0, 0.0, max(found) - min(found))) > pen.tolerance:
        raise ValueError(
            f'its elevation is missing (group code 30), and its points lie at z from '
            f'{min(found):g} to {max(found):g}'
        )
    return next(iter(heights), 0.0)


def _plane_polyline(
    pen: _Pen, corners: Sequence[tuple[float, float, float]], height: float, closed: bool
) -> None:
    """Draw a polyline through (x, y, bulge): the arc after a corner has bulge = tan(angle / 4)."""
    if not corners:
        return
    pen.line_to((*corners[0][:2], height))
    for (ax, ay, bulge), (bx, by, _) in pairwise([*corners, *corners[: int(closed)]]):
        if abs(bulge) < _FLAT or (ax, ay) == (bx, by):
            pen.line_to((bx, by, height))
            continue
        # The centre is left of the chord if the arc turns left by less than half a turn.
        aside = (1.0 - bulge * bulge) / (4.0 * bulge)
        cx = 0.5 * (ax + bx) - aside * (by - ay)
        cy = 0.5 * (ay + by) + aside * (bx - ax)
        a, b = (ax - cx, ay - cy, 0.0), (cy - ay, ax - cx, 0.0)
        pen.along_ellipse((cx, cy, height), a, b, 0.0, 4.0 * atan(bulge))
        pen.arrive((bx, by, height))


def _spline(record: Record, pen: _Pen, left_out: LeftOut) -> None:
    places = record.points(10)
    if not places and record.points(11):
        raise _NoPathError('SPLINE 11 without 10')
    knots, weights = record.numbers(40), record.numbers(41)
    for code, what, found in ((72, 'knots', knots), (73, 'control points', places)):
        if (count := record.integer(code, len(found))) != len(found):
            raise ValueError(f'it has {len(found)} {what} in place of {count} (group code {code})')
    if weights and len(weights) != len(places):
        raise ValueError(f'it has {len(weights)} weights for {len(places)} control points')
    controls = [
        (w * x, w * y, w * z, w)
        for (x, y, z), w in zip(places, weights or [1.0] * len(places), strict=True)
    ]
    pen.along_spline(record.integer(71), knots, controls)
    if record.integer(70) & _CLOSED and pen.gap() > JOINED:
        left_out.add_term(record, 'SPLINE 70=1 with a gap')


_DRAWN: Mapping[str, Callable[[Record, _Pen, LeftOut], None]] = {
    'LINE': _line,
    'ARC': _round,
    'CIRCLE': _round,
    'ELLIPSE': _ellipse,
    'LWPOLYLINE': _lwpolyline,
    'POLYLINE': _polyline,
    'SPLINE': _spline,
    'HELIX': _spline,
}
