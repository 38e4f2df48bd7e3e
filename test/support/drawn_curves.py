# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The visible curves of a file, and their points, as ezdxf's drawing front end draws them.

The front end approximates arcs and splines by cubic Bézier curves. Here the curves are sampled by
ezdxf's own evaluation of the entities that it decides to draw, including entities in blocks.
"""

from io import StringIO
import logging

from curve_distance import arc_count, SAG
from ezdxf import filemanagement
from ezdxf.addons.drawing.config import Configuration, ProxyGraphicPolicy
from ezdxf.addons.drawing.frontend import UniversalFrontend
from ezdxf.addons.drawing.pipeline import AbstractPipeline
from ezdxf.addons.drawing.properties import RenderContext
from ezdxf.entities import Insert
import numpy as np

logging.getLogger('ezdxf').setLevel(logging.CRITICAL)
#: Entities without a path.
OTHERS = (
    *('POINT', 'HATCH', 'MPOLYGON', 'MESH', 'WIPEOUT', 'MTEXT', 'OLE2FRAME', 'IMAGE', 'TEXT'),
    *('ATTRIB', 'ATTDEF', 'XLINE', 'RAY', '3DFACE', 'SOLID', 'TRACE'),
)


class _Nowhere:
    """A pipeline that draws nothing: only the decisions of the front end are needed."""

    def __getattr__(self, name):
        return lambda *arguments, **options: None


AbstractPipeline.register(_Nowhere)


class DrawnCurves(UniversalFrontend):
    """Collects the curves of a drawing; its unit [m] determines the density of their points."""

    def __init__(self, doc, unit):
        super().__init__(
            RenderContext(doc),
            _Nowhere(),
            Configuration(proxy_graphic_policy=ProxyGraphicPolicy.IGNORE),
        )
        self.curves = []
        self.unit = unit
        self._dispatch.update(dict.fromkeys(OTHERS, lambda entity, properties: None))
        self._dispatch['HELIX'] = self.draw_curve_entity
        self.draw_layout(doc.modelspace())

    def draw_composite_entity(self, entity, properties):
        if isinstance(entity, Insert):
            super().draw_composite_entity(entity, properties)

    def draw_line_entity(self, entity, properties):
        self.curves.append([entity.dxf.start, entity.dxf.end])

    def draw_curve_entity(self, entity, properties):
        self.curves.append(curve_points(entity, self.unit))

    def draw_polyline_entity(self, entity, properties):
        if entity.dxftype() == 'POLYLINE':
            if entity.is_polygon_mesh or entity.is_poly_face_mesh:
                return
            if entity.is_2d_polyline and not entity.dxf.hasattr('elevation') and len(entity):
                entity.dxf.elevation = (0, 0, entity[0].dxf.location.z)  # as in the front end
        for part in entity.virtual_entities():
            self.curves.append(curve_points(part, self.unit))


def curve_points(entity, unit):
    """Return points on a curve in order, in world coordinates."""
    kind, dxf = entity.dxftype(), entity.dxf
    if kind == 'LINE':
        return [dxf.start, dxf.end]
    if kind in ('CIRCLE', 'ARC'):
        start, sweep = (0.0, 360.0) if kind == 'CIRCLE' else arc(dxf.start_angle, dxf.end_angle)
        count = arc_count(sweep, unit * dxf.radius)
        return list(entity.vertices(np.linspace(start, start + sweep, count)))
    if kind == 'ELLIPSE':
        start, sweep = arc(np.degrees(dxf.start_param), np.degrees(dxf.end_param))
        count = arc_count(sweep, unit * max(1.0, dxf.ratio) * dxf.major_axis.magnitude)
        angles = np.linspace(start, start + sweep, count)
        return list(entity.construction_tool().vertices(np.radians(angles)))
    return spline_points(entity.construction_tool(), unit)


def arc(start, end):
    sweep = (end - start) % 360.0
    return start, sweep if 1e-6 < sweep < 360.0 - 1e-6 else 360.0


def spline_points(tool, unit):
    """
    Return points on a spline.

    A spline lies between the knots at which its basis functions add up to 1. If its first or last
    knots differ, ezdxf also draws the other spans, in which the curve leaves its control points.
    """
    knots = np.array(tool.knots())
    first, last = knots[tool.degree], knots[tool.count]
    corners = knots[(first <= knots) & (knots <= last)]
    places = np.union1d(np.linspace(first, last, 33), corners)
    for _ in range(20):
        points = np.array([tuple(p) for p in tool.points(places)])
        middles = 0.5 * (places[1:] + places[:-1])
        off = np.array([tuple(p) for p in tool.points(middles)]) - 0.5 * (points[1:] + points[:-1])
        coarse = unit * np.linalg.norm(off, axis=1) > SAG
        if not coarse.any():
            break
        places = np.union1d(places, middles[coarse])
    return points


def drawn_curves(text: str, unit: float) -> list[np.ndarray]:
    """
    Return the curves of a drawing, each as points (n, 3) [m].

    :param unit: the unit of its lengths [m].
    """
    doc = filemanagement.read(StringIO(text))
    curves = DrawnCurves(doc, unit).curves
    return [unit * np.array([tuple(p) for p in points]) for points in curves if len(points)]
