# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Curves that ezdxf's drawing front end draws for a file: which are seen, and where they lie.

The front end approximates arcs and splines by cubic Bézier curves. Here the curves are sampled by
ezdxf's own evaluation of the entities that it decides to draw, also of those in blocks.
"""

from io import StringIO
import logging

from curve_distance import STEP
from ezdxf import filemanagement
from ezdxf.addons.drawing.config import Configuration, ProxyGraphicPolicy
from ezdxf.addons.drawing.frontend import UniversalFrontend
from ezdxf.addons.drawing.pipeline import AbstractPipeline
from ezdxf.addons.drawing.properties import RenderContext
from ezdxf.entities import Insert
import numpy as np

logging.getLogger('ezdxf').setLevel(logging.CRITICAL)
#: Splines are sampled until they are so near to lines, as a share of their size.
FLAT = 1e-5
#: What has no path.
OTHERS = (
    *('POINT', 'HATCH', 'MPOLYGON', 'MESH', 'WIPEOUT', 'MTEXT', 'OLE2FRAME', 'IMAGE', 'TEXT'),
    *('ATTRIB', 'ATTDEF', 'XLINE', 'RAY', '3DFACE', 'SOLID', 'TRACE'),
)


class _Nowhere:
    """A pipeline that draws nothing; the front end is asked for its decisions only."""

    def __getattr__(self, name):
        return lambda *arguments, **options: None


AbstractPipeline.register(_Nowhere)


class DrawnCurves(UniversalFrontend):
    """Collects the curves of a drawing, in its units."""

    def __init__(self, doc):
        super().__init__(
            RenderContext(doc),
            _Nowhere(),
            Configuration(proxy_graphic_policy=ProxyGraphicPolicy.IGNORE),
        )
        self.curves = []
        self._dispatch.update(dict.fromkeys(OTHERS, lambda entity, properties: None))
        self._dispatch['HELIX'] = self.draw_curve_entity
        self.draw_layout(doc.modelspace())

    def draw_composite_entity(self, entity, properties):
        if isinstance(entity, Insert):
            super().draw_composite_entity(entity, properties)

    def draw_line_entity(self, entity, properties):
        self.curves.append([entity.dxf.start, entity.dxf.end])

    def draw_curve_entity(self, entity, properties):
        self.curves.append(curve_points(entity))

    def draw_polyline_entity(self, entity, properties):
        if entity.dxftype() == 'POLYLINE':
            if entity.is_polygon_mesh or entity.is_poly_face_mesh:
                return
            if entity.is_2d_polyline and not entity.dxf.hasattr('elevation') and len(entity):
                entity.dxf.elevation = (0, 0, entity[0].dxf.location.z)  # as the front end
        for part in entity.virtual_entities():
            self.curves.append(curve_points(part))


def curve_points(entity):
    """Return points on a curve in order, in world coordinates."""
    kind, dxf = entity.dxftype(), entity.dxf
    if kind == 'LINE':
        return [dxf.start, dxf.end]
    if kind in ('CIRCLE', 'ARC'):
        start, sweep = (0.0, 360.0) if kind == 'CIRCLE' else arc(dxf.start_angle, dxf.end_angle)
        return list(entity.vertices(np.linspace(start, start + sweep, 2 + int(sweep / STEP))))
    if kind == 'ELLIPSE':
        start, sweep = arc(np.degrees(dxf.start_param), np.degrees(dxf.end_param))
        angles = np.linspace(start, start + sweep, 2 + int(sweep / STEP))
        return list(entity.construction_tool().vertices(np.radians(angles)))
    return spline_points(entity.construction_tool())


def arc(start, end):
    sweep = (end - start) % 360.0
    return start, sweep if 1e-6 < sweep < 360.0 - 1e-6 else 360.0


def spline_points(tool):
    places = np.union1d(np.linspace(0.0, tool.max_t, 33), tool.knots())  # corners are at knots
    for _ in range(20):
        points = np.array([tuple(p) for p in tool.points(places)])
        middles = 0.5 * (places[1:] + places[:-1])
        off = np.array([tuple(p) for p in tool.points(middles)]) - 0.5 * (points[1:] + points[:-1])
        coarse = np.linalg.norm(off, axis=1) > FLAT * np.ptp(points, axis=0).max()
        if not coarse.any():
            break
        places = np.union1d(places, middles[coarse])
    return points


def drawn_curves(text: str) -> list[np.ndarray]:
    """Return the curves of a drawing, each as points (n, 3)."""
    doc = filemanagement.read(StringIO(text))
    curves = DrawnCurves(doc).curves
    return [np.array([tuple(p) for p in points]) for points in curves if len(points)]
