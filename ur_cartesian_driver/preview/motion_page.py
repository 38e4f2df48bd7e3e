# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
One HTML page that shows the arm on its path: it opens in any browser, without a network.

viser draws the scene, plays it over time, and makes the page. The page holds the scene once for
each colouring of the path, with the legend and the report beside the scene.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from html import escape
import io
import json
import re
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ur_cartesian_driver.kinematics.cell_poses import T_carrier_body
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.link_shapes import ARM_LINKS, link_shapes, LinkFrames
from ur_cartesian_driver.motion.cell.cell import Cell, EMPTY_CELL
from ur_cartesian_driver.motion.cell.shapes import Box, Cylinder, HalfSpace, Mesh, Shape, Sphere
from ur_cartesian_driver.motion.errors import CollisionPredicted, GoalRefused
from ur_cartesian_driver.motion.geometry.arrays import Floats, Indices
from ur_cartesian_driver.motion.geometry.pose import Pose, pose_from_row
from ur_cartesian_driver.motion.geometry.vectors import Joints
from ur_cartesian_driver.motion.geometry.workspace import parse_planes, Plane
from ur_cartesian_driver.motion.goal.goal import Goal
from ur_cartesian_driver.motion.plan.plan import Plan
from ur_cartesian_driver.motion.plan.primitive import AwaitInput, CallFunction, SwitchOutput
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.preflight.clearance import Clearance
from ur_cartesian_driver.planning.preflight.tightest_margins import normalized_margins
from ur_cartesian_driver.planning.request.point_events.switched_outputs import describe_command
from ur_cartesian_driver.preview.distance_curve import distance_curve
from ur_cartesian_driver.preview.drawn_shapes import coarse_mesh, SQUARE_SIDE, triangles_per_mesh
from ur_cartesian_driver.preview.plan_samples import Preview, sample, table

Colours = NDArray[np.uint8]
Colour = tuple[int, int, int]
#: A server of viser, which has to be installed only to make a page.
Server = Any

#: Least time between two pictures of the arm [s]; largest number of pictures.
MIN_PERIOD = 0.04
MAX_PICTURES = 600
#: Largest number of points that are drawn.
MAX_NUMBERED_POINTS = 60
#: A margin of at least this fraction of its scale is drawn as ample; see
#: :func:`normalized_margins`.
AMPLE_MARGIN = 0.5

#: Colours of bodies that are fixed, that the arm carries, and that would touch.
FIXED: Colour = (190, 165, 130)
CARRIED: Colour = (110, 160, 110)
REFUSED: Colour = (210, 30, 30)
_ARM, _TOOL, _POINT, _START, _OUTPUT, _PLANE, _TRAIL = (
    (176, 184, 194),
    (90, 100, 110),
    (50, 60, 70),
    (20, 140, 60),
    (200, 120, 0),
    (120, 170, 220),
    (230, 60, 160),
)
#: Name and colour of each motion.
MOTIONS: dict[str, tuple[str, Colour]] = {
    'MoveL': ('line', (30, 110, 220)),
    'MoveP': ('process', (20, 150, 90)),
    'MoveC': ('arc', (230, 130, 20)),
    'MoveJ': ('joint motion', (150, 60, 190)),
    'OptimoveL': ('optimized line', (0, 160, 190)),
    'OptimoveJ': ('optimized joint motion', (200, 60, 140)),
    'Spline': ('spline', (60, 80, 200)),
}
#: The options of those who have neither planes nor bodies.
NO_BODIES = PlanningOptions()
#: The nodes of the links in the scene.
_LINK_NODES = tuple(f'/arm/{link.name.lower()}' for link in ARM_LINKS)
#: Direction to the camera if the path gives none.
_ASIDE = np.array((0.65, 0.65, 0.4))
#: Colour of blends.
BLEND: Colour = (240, 200, 60)
_LOW, _MIDDLE, _HIGH = np.array([(205, 40, 40), (235, 190, 40), (40, 150, 70)], dtype=np.float64)
#: Pattern of the scene in viser's page; name of the settings in it.
_DATA = re.compile(r'window\.__VISER_EMBED_DATA__="([^"]*)";')
_CONFIG = 'window.__VISER_EMBED_CONFIG__'
#: Patterns of the place in the text of a refusal: the point; the fraction of the segment to it.
_PLACE = re.compile(r'(?:points|segments)\[(\d+)\]|point (\d+)')
_FRACTION = re.compile(r'at ([\d.]+) % of its segment')

_STYLE = """
<style>
aside { position: fixed; left: 0; top: 0; bottom: 42px; width: 31em; max-width: 45%;
  box-sizing: border-box; overflow: auto; padding: 1em; background: #ffffffee; z-index: 1000;
  font: 13px/1.4 system-ui, sans-serif; color: #222; }
aside pre { font: 10px/1.5 ui-monospace, monospace; overflow-x: auto; }
aside pre + pre { white-space: pre-wrap; }
aside nav a { margin-right: .8em; }
aside .refused { color: #c01818; font-weight: 600; }
aside .distance svg { width: 100%; }
aside i { display: inline-block; width: .8em; height: .8em; margin: 0 .4em 0 .8em; }
</style>
"""
#: Script that puts the scene named in the page's address where viser's page looks for it.
_CHOICE = """
<script>
window.__VISER_EMBED_DATA__ = (SCENES => SCENES[location.hash.slice(1)] || SCENES.type)(%s);
window.addEventListener('hashchange', () => location.reload());
</script>
"""


class _Colouring(NamedTuple):
    """The colours of a path: one for each edge, and a legend."""

    name: str
    colours: Colours
    legend: Sequence[tuple[str, Colour]]


def motion_page(plan: Plan, arm: Arm, options: PlanningOptions = NO_BODIES) -> str:
    """
    Return the page of a plan.

    :param arm: the arm for which the plan was made.
    :param options: their planes and the bodies of their cell are drawn.
    :raises ImportError: viser is not installed; the text says how to get it.
    """
    preview = sample(plan, arm, plan.T_flange_active, _period(plan.duration))
    colourings = (_by_type(plan), _by_speed(plan), _by_margin(plan, arm, preview))
    pages = {}
    tcp = plan.T_flange_tcp or plan.T_flange_active
    with serve(parse_planes(options.workspace_planes)) as server:
        scene = scene_of_plan(server, arm, tcp, plan, options.cell)
        for colouring in colourings:
            scene.add_path(plan.reference.poses[:, :3], colouring.colours)
            pages[colouring.name] = scene.record(preview.time, preview.joints)
    texts = ''.join(f'<pre>{escape(text)}</pre>' for text in (table(plan), '\n'.join(plan.report)))
    curve = _closest_pairs(preview, arm, tcp, options)
    return _page(pages, _legends(colourings) + curve + texts)


def _closest_pairs(preview: Preview, arm: Arm, tcp: Pose, options: PlanningOptions) -> str:
    """Return the curve of the closest pair over time; '' for an empty cell."""
    if not options.cell:
        return ''
    known = ~np.isnan(preview.joints).any(axis=1)
    distances, pairs = Clearance(arm, tcp, options).closest(preview.joints[known])
    return distance_curve(preview.time[known], distances, pairs)


def scene_of_plan(
    server: Server, arm: Arm, tcp: Pose, plan: Plan | None, cell: Cell = EMPTY_CELL
) -> Scene:
    """Return a scene with arm and cell and, if a plan is given, its points, outputs and path."""
    scene = Scene(server, arm, tcp, cell)
    if plan is not None:
        scene.add_points(_waypoints(plan))
        scene.add_outputs(_outputs(plan))
        scene.add_path(plan.reference.poses[:, :3], _by_type(plan).colours)
    return scene


def refusal_page(
    goal: Goal,
    refusal: GoalRefused,
    arm: Arm,
    q: Joints,
    tcp: Pose,
    options: PlanningOptions = NO_BODIES,
) -> str:
    """
    Return the page of a goal that was refused: its points, and the place of the refusal in red.

    If the arm would touch something there, the arm is drawn at that place, and what touches in
    red, too.

    :param q: the joint positions of the arm [rad].
    :param options: their planes and the bodies of their cell are drawn.
    :raises ImportError: viser is not installed; the text says how to get it.
    """
    # The orientation may be what is wrong; points given by joints have no place.
    path = np.array(
        [
            (arm.forward(q) @ tcp).position,
            *(goal.T_base_frame.apply(waypoint.pose.position) for waypoint in goal.waypoints),
        ]
    )
    has_place = np.isfinite(path).all(axis=1)
    touching: tuple[str, ...] = ()
    if isinstance(refusal, CollisionPredicted) and refusal.q is not None:
        q, touching = refusal.q, refusal.bodies
    with serve(parse_planes(options.workspace_planes)) as server:
        scene = Scene(server, arm, tcp, options.cell, touching)
        drawn = path[has_place]
        scene.add_path(drawn, np.full((len(drawn) - 1, 3), 150, dtype=np.uint8))
        numbers = np.flatnonzero(has_place[1:]).tolist()
        scene.add_points(zip(numbers, drawn[1:], strict=True))
        place = _place(str(refusal), path)
        if place is not None and np.isfinite(place).all():
            scene.add_ball('refused', place, 0.012, REFUSED)
        recorded = scene.record(np.zeros(1), np.array([q]))
    text = f'<p class="refused">Refused: {escape(str(refusal))}</p>'
    return _page({'type': recorded}, text)


def cell_page(
    cell: Cell, arm: Arm, q: Joints, tcp: Pose, text: str, touching: Collection[str] = ()
) -> str:
    """
    Return the page of a cell with the arm at rest.

    :param q: the joint positions of the arm [rad].
    :param text: stands beside the scene.
    :param touching: names of bodies and links that are drawn in red.
    :raises ImportError: viser is not installed; the text says how to get it.
    """
    frames = LinkFrames(arm)
    links = [pose_from_row(row) for row in frames.poses(np.array([q]))[0]]
    carried = (T_carrier_body(body, frames, tcp) for body in cell.bodies)
    places = [(links[link] @ T_link_body).position for link, T_link_body in carried]
    with serve(()) as server:
        scene = Scene(server, arm, tcp, cell, touching)
        scene.look_at(np.array([(arm.forward(q) @ tcp).position, *places]))
        recorded = scene.record(np.zeros(1), np.array([q]))
    return _page({'type': recorded}, f'<pre>{escape(text)}</pre>')


def _period(duration: float) -> float:
    return max(MIN_PERIOD, duration / MAX_PICTURES)


def _place(text: str, path: Floats) -> Floats | None:
    """Return the place that a refusal names, or None; row 0 of the path is the start."""
    found = _PLACE.search(text)
    if found is None:
        return None
    point = int(found[1] or found[2])
    if point + 1 >= len(path):
        return None
    fraction = _FRACTION.search(text)
    part = float(fraction[1]) / 100.0 if fraction else 1.0
    place: Floats = path[point] + part * (path[point + 1] - path[point])
    return place


# -- colours --------------------------------------------------------------------------------------


def _by_type(plan: Plan) -> _Colouring:
    kinds, reference = plan.rows.kinds, plan.reference
    colours = np.array(
        [MOTIONS[kinds[point]][1] for point in reference.point[1:].tolist()], dtype=np.uint8
    ).reshape(-1, 3)
    on_blend = reference.blend_tolerance[1:].any(axis=1)
    colours[on_blend] = BLEND
    legend = [MOTIONS[kind] for kind in dict.fromkeys(kinds.values())]
    return _Colouring('type', colours, [*legend, *([('blend', BLEND)] if on_blend.any() else [])])


def _by_speed(plan: Plan) -> _Colouring:
    reference = plan.reference
    distance = np.linalg.norm(np.diff(reference.poses[:, :3], axis=0), axis=1)
    span = np.diff(reference.time)
    speed = np.where(span > 0.0, distance / np.where(span > 0.0, span, 1.0), 0.0)
    top = float(speed.max(initial=0.0))
    legend = [(f'{part * top:.3g} m/s', _shade(part)) for part in (0.0, 0.5, 1.0)]
    return _Colouring('speed', _shades(speed / (top or 1.0)), legend)


def _by_margin(plan: Plan, arm: Arm, preview: Preview) -> _Colouring:
    """Colour by the smallest of the distances from singularities and joint limits."""
    known = ~np.isnan(preview.joints).any(axis=1)
    margins = normalized_margins(arm, preview.joints[known])
    at = np.interp(plan.reference.time[1:], preview.time[known], margins)
    legend = [(f'{part * AMPLE_MARGIN:.2g} rad', _shade(part)) for part in (0.0, 0.5)] + [
        (f'{AMPLE_MARGIN:g} rad and more', _shade(1.0))
    ]
    return _Colouring('margin', _shades(at / AMPLE_MARGIN), legend)


def _shade(part: float) -> Colour:
    red, green, blue = _shades(np.array([part]))[0].tolist()
    return red, green, blue


def _shades(parts: Floats) -> Colours:
    """Return colours from red (0) by yellow to green (1)."""
    u = np.clip(parts, 0.0, 1.0)[:, None]
    lower, upper = _LOW + 2.0 * u * (_MIDDLE - _LOW), _MIDDLE + (2.0 * u - 1.0) * (_HIGH - _MIDDLE)
    shades: Colours = np.where(u < 0.5, lower, upper).astype(np.uint8)
    return shades


def _legends(colourings: Iterable[_Colouring]) -> str:
    links = ' '.join(f'<a href="#{one.name}">by {one.name}</a>' for one in colourings)
    lines = [
        f'<p><b>{one.name}</b>'
        + ''.join(
            f'<i style="background: rgb{colour}"></i>{escape(text)}' for text, colour in one.legend
        )
        + '</p>'
        for one in colourings
    ]
    return f'<nav>{links}</nav>{"".join(lines)}'


# -- parts of the scene ---------------------------------------------------------------------------


def _waypoints(plan: Plan) -> Iterator[tuple[int, Floats]]:
    """Yield the points with their places."""
    for point, waypoint in enumerate(plan.goal.waypoints):
        pose = plan.goal.T_base_frame @ waypoint.pose
        yield point, np.array(pose.position)


def _outputs(plan: Plan) -> Iterator[tuple[str, Floats]]:
    """Yield a text and the place for each output, wait for an input and call."""
    for segment in plan.segments:
        stop = segment.primitive
        if not (segment.outputs or isinstance(stop, AwaitInput | CallFunction)):
            continue
        last = int(np.flatnonzero(plan.reference.point == segment.waypoint)[-1])
        if isinstance(stop, AwaitInput | CallFunction):
            text = stop.text if isinstance(stop, CallFunction) else f'waits for {stop.condition}'
            yield text, plan.reference.poses[last, :3]
        for output in segment.outputs:
            if not isinstance(output, SwitchOutput):
                continue
            at = output.trigger_pose or pose_from_row(plan.reference.poses[last])
            yield describe_command(output), np.array(at.position)


class Scene:
    """The arm, its tool, its cell and its path on a server, which shows or records them."""

    def __init__(
        self,
        server: Server,
        arm: Arm,
        tcp: Pose,
        cell: Cell = EMPTY_CELL,
        touching: Collection[str] = (),
    ) -> None:
        """
        Draw the arm and the cell, each shape in the frame of its link.

        :param touching: names of bodies, and of links as in :data:`~.cell.LINK_NAMES`, that are
            drawn in red.
        """
        import trimesh

        self._server, self._scene = server, server.scene
        self._frames = LinkFrames(arm)
        self._cell, self._touching = cell, touching
        self._links = [self._scene.add_frame(name, show_axes=False) for name in _LINK_NODES]
        for k, shape in enumerate(link_shapes(arm, 'collision')):
            if shape.mesh is not None:
                mesh = trimesh.load_mesh(shape.mesh)
            else:
                mesh = trimesh.creation.cylinder(shape.radius, shape.length, sections=24)
            node = _LINK_NODES[shape.link]
            colour = self._colour(f'{node.removeprefix("/arm/")}_link', _ARM)
            self._add_mesh(f'{node}/{k}', mesh.vertices, mesh.faces, colour, shape.T_link_shape)
        self.set_tool(tcp)

    def _colour(self, name: str, otherwise: Colour) -> Colour:
        return REFUSED if name in self._touching else otherwise

    def set_tool(self, tcp: Pose) -> None:
        """Draw the tool from flange to TCP, and the bodies, in place of the previous ones."""
        T_link_tcp = self._frames.flange @ tcp
        reach = np.array([self._frames.flange.position, T_link_tcp.position])
        self._scene.add_line_segments(
            '/arm/wrist_3/tool',
            reach[None].astype(np.float32),
            self._colour('tool', _TOOL),
            thickness=0.008,
        )
        self._scene.add_frame(
            '/arm/wrist_3/tcp',
            axes_length=0.05,
            axes_radius=0.0025,
            position=np.array(T_link_tcp.position),
            wxyz=_wxyz(T_link_tcp),
        )
        most = triangles_per_mesh(self._cell)
        for k, body in enumerate(self._cell.bodies):
            link, T_link_body = T_carrier_body(body, self._frames, tcp)
            node = f'{_LINK_NODES[link]}/body_{k}'
            colour = self._colour(body.name, CARRIED if body.is_carried else FIXED)
            self._scene.add_frame(
                node,
                show_axes=False,
                position=np.array(T_link_body.position),
                wxyz=_wxyz(T_link_body),
            )
            self._scene.add_label(f'{node}/label', body.name, font_screen_scale=0.7)
            for j, placed in enumerate(body.shapes):
                self._add_mesh(
                    f'{node}/{j}',
                    *_triangles(placed.shape, most),
                    colour,
                    placed.T_body_shape,
                    opacity=0.3 if isinstance(placed.shape, HalfSpace) else None,
                )

    def _add_mesh(
        self,
        name: str,
        vertices: Any,
        triangles: Any,
        colour: Colour,
        pose: Pose,
        opacity: float | None = None,
    ) -> None:
        self._scene.add_mesh_simple(
            name,
            np.asarray(vertices, dtype=np.float32),
            np.asarray(triangles, dtype=np.uint32),
            color=colour,
            opacity=opacity,
            flat_shading=True,
            side='double',
            position=np.array(pose.position),
            wxyz=_wxyz(pose),
        )

    def add_path(self, positions: Floats, colours: Colours) -> None:
        """Draw a path with a colour for each of its edges, and point the camera at the path."""
        edges = np.stack((positions[:-1], positions[1:]), axis=1).astype(np.float32)
        self._scene.add_line_segments(
            '/path', edges, np.repeat(colours[:, None], 2, axis=1), thickness=0.007
        )
        self.look_at(positions)

    def look_at(self, positions: Floats) -> None:
        """Point the camera at path and arm from the side, so that they appear beside the text."""
        low, high = np.minimum(positions.min(axis=0), 0.0), np.maximum(positions.max(axis=0), 0.4)
        x, y, _ = positions.mean(axis=0)
        out = np.array((0.7 * x - 0.7 * y, 0.7 * x + 0.7 * y, 0.5 * np.hypot(x, y)))
        out = out / np.linalg.norm(out) if np.hypot(x, y) > 0.01 else _ASIDE
        distance = 0.25 + 0.85 * float(np.linalg.norm(high - low))
        left = np.array((out[1], -out[0], 0.0))
        center = 0.5 * (low + high) + 0.2 * distance * left
        camera = self._server.initial_camera
        camera.position, camera.look_at = center + distance * out, center

    def set_trail(self, positions: Floats) -> None:
        """Draw the trail of the TCP, in place of the previous trail."""
        edges = np.stack((positions[:-1], positions[1:]), axis=1).astype(np.float32)
        self._scene.add_line_segments('/trail', edges, _TRAIL, thickness=0.004)

    def pose_arm(self, q: Joints) -> None:
        """Draw the arm at joint positions [rad]."""
        self._move(self._frames.poses(np.array([q]))[0])

    def add_points(self, points: Iterable[tuple[int, Floats]]) -> None:
        """Draw points with their numbers, up to :data:`MAX_NUMBERED_POINTS` of them."""
        for number, place in list(points)[:MAX_NUMBERED_POINTS]:
            self.add_ball(f'points/{number}', place, 0.006, _POINT)
            self._scene.add_label(f'/points/{number}/label', str(number), font_screen_scale=0.7)

    def add_outputs(self, outputs: Iterable[tuple[str, Floats]]) -> None:
        """Mark places of outputs, waits and calls with their texts."""
        for k, (text, place) in enumerate(outputs):
            self.add_ball(f'outputs/{k}', place, 0.008, _OUTPUT)
            self._scene.add_label(f'/outputs/{k}/label', text, font_screen_scale=0.7)

    def add_ball(self, name: str, place: Floats, radius: float, colour: Colour) -> None:
        """Draw a ball."""
        self._scene.add_icosphere(f'/{name}', radius, colour, subdivisions=2, position=place)

    def record(self, time: Floats, q: Floats) -> str:
        """
        Return viser's page of the scene with the arm in motion.

        While the joints are not known, the arm stays where it was.
        """
        known = ~np.isnan(q.sum(axis=1))
        poses = self._frames.poses(np.where(known[:, None], q, 0.0))
        self._move(poses[int(np.argmax(known))])
        recording = self._server.get_scene_serializer()
        for k in range(len(time)):
            if known[k]:
                self._move(poses[k])
            recording.insert_sleep(float(time[k + 1] - time[k]) if k + 1 < len(time) else 0.0)
        page: str = recording.as_html()
        return page

    def _move(self, poses: Floats) -> None:
        for node, pose in zip(self._links, poses, strict=True):
            node.position, node.wxyz = pose[:3], pose[[6, 3, 4, 5]]


@contextmanager
def serve(planes: Sequence[Plane], host: str = '127.0.0.1', port: int = 0) -> Iterator[Server]:
    """
    Run a server of viser with floor and planes.

    :param port: the first port to try; 0 = any, for a server that only records a scene.
    :raises ImportError: viser is not installed; the text says how to get it.
    """
    try:
        import viser
    except ImportError as error:
        raise ImportError(
            'The page of a motion is drawn by viser, which is not installed: install it with '
            '`pip install viser trimesh`.',
            name='viser',
        ) from error
    with redirect_stdout(io.StringIO()):  # viser prints a greeting in spite of verbose=False
        server = viser.ViserServer(host=host, port=port, verbose=False)
    try:
        _light(server.scene)
        server.scene.add_grid('/floor', 3.0, 3.0, cell_size=0.1, section_size=0.5)
        for plane in planes:
            _add_plane(server.scene, plane)
        yield server
    finally:
        with redirect_stdout(io.StringIO()):
            server.stop()


def _triangles(shape: Shape, most: int) -> tuple[Floats, Indices]:
    """
    Return vertices and triangles of a shape, in its own frame.

    :param most: largest number of triangles of a mesh.
    """
    from trimesh import creation

    match shape:
        case Mesh():
            return coarse_mesh(shape, most)
        case HalfSpace():
            solid = creation.box((SQUARE_SIDE, SQUARE_SIDE, 0.001))
            solid.apply_translation((0.0, 0.0, -0.0005))
        case Box():
            solid = creation.box(shape.size)
        case Cylinder():
            solid = creation.cylinder(shape.radius, shape.length, sections=48)
        case Sphere():
            solid = creation.icosphere(3, shape.radius)
    return np.asarray(solid.vertices), np.asarray(solid.faces)


def _light(scene: Any) -> None:
    """Light by lamps only: without a graphics card, viser's environment map takes many seconds."""
    scene.configure_environment_map(None)
    scene.configure_default_lights(cast_shadow=False)
    scene.add_light_hemisphere(
        '/light', sky_color=(255, 255, 255), ground_color=(150, 150, 160), intensity=2.5
    )


def _add_plane(scene: Any, plane: Plane) -> None:
    """Draw a square of a plane around its point."""
    normal = np.array(plane.normal)
    across = np.cross(normal, np.eye(3)[int(np.argmin(np.abs(normal)))])
    across /= np.linalg.norm(across)
    other = np.cross(normal, across)
    corners = np.array(plane.point) + 0.8 * np.array(
        [across + other, other - across, -across - other, across - other]
    )
    scene.add_mesh_simple(
        f'/planes/{plane.name}',
        corners.astype(np.float32),
        np.array([(0, 1, 2), (0, 2, 3)], dtype=np.uint32),
        color=_PLANE,
        opacity=0.3,
        side='double',
    )


def _wxyz(pose: Pose) -> Floats:
    x, y, z, w = pose.quaternion
    return np.array((w, x, y, z))


def _page(pages: dict[str, str], text: str) -> str:
    """Return viser's page with several scenes to choose from, and a text beside them."""
    scenes = {name: _DATA.search(page) for name, page in pages.items()}
    data = {name: found[1] for name, found in scenes.items() if found is not None}
    page = next(iter(pages.values()))
    begin, end = page.index('<script>window.__VISER_EMBED_DATA__'), page.index('</head>')
    config = page[page.index(_CONFIG, begin) : end]
    head = f'{_CHOICE % json.dumps(data)}<script>{config}{_STYLE}'
    page = page[:begin] + head + page[end:]
    end = page.rindex('</body>')
    return f'{page[:end]}<aside>{text}</aside>{page[end:]}'
