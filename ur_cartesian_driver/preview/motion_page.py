# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
One HTML page that shows the arm on its path: it opens in any browser, without a network.

viser draws the scene, plays it over time, and makes the page. The page holds the scene once for
each colouring of the path, with the legend and the report beside the scene.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import replace
from html import escape
from itertools import pairwise
import json
from math import inf
import re
from typing import NamedTuple

import numpy as np

from ur_cartesian_driver.kinematics.cell_poses import T_carrier_body
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.link_shapes import LinkFrames
from ur_cartesian_driver.motion.cell.cell import Cell, EMPTY_CELL
from ur_cartesian_driver.motion.errors import CollisionPredicted, GoalRefused
from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.geometry.pose import Pose, pose_from_row
from ur_cartesian_driver.motion.geometry.vectors import Joints, Vector3
from ur_cartesian_driver.motion.geometry.workspace import parse_planes
from ur_cartesian_driver.motion.goal.goal import Goal
from ur_cartesian_driver.motion.plan.plan import Plan
from ur_cartesian_driver.motion.plan.primitive import AwaitInput, CallFunction, SwitchOutput
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.preflight.cell_stretches import changed
from ur_cartesian_driver.planning.preflight.clearance import Clearance
from ur_cartesian_driver.planning.preflight.path_left import joints_at
from ur_cartesian_driver.planning.preflight.tightest_margins import normalized_margins
from ur_cartesian_driver.planning.request.point_events.switched_outputs import describe_command
from ur_cartesian_driver.preview.distance_curve import distance_curve, groups_of_pairs
from ur_cartesian_driver.preview.plan_samples import Preview, sample, table
from ur_cartesian_driver.preview.scene import Colour, Colours, REFUSED, Scene, serve, Server

#: Least time between two pictures of the arm [s]; largest number of pictures.
MIN_PERIOD = 0.04
MAX_PICTURES = 600
#: A margin of at least this fraction of its scale is drawn as ample; see
#: :func:`normalized_margins`.
AMPLE_MARGIN = 0.5

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
#: Options without planes or bodies.
NO_BODIES = PlanningOptions()
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
#: Script that puts the scene whose name is in the page's address, behind the #, where viser's page
#: looks for the scene.
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
    :param options: the options whose planes and bodies of the cell are drawn.
    :raises ImportError: viser is not installed; the text says how to get it.
    """
    preview = sample(plan, arm, plan.T_flange_active, _period(plan.duration))
    colourings = (_by_type(plan), _by_speed(plan), _by_margin(plan, arm, preview))
    pages = {}
    tcp = plan.T_flange_tcp or plan.T_flange_active
    cells = _cells(plan, preview, arm, options.cell)
    with serve(parse_planes(options.workspace_planes)) as server:
        scene = scene_of_plan(server, arm, tcp, plan, options.cell, plan.T_flange_active)
        for colouring in colourings:
            scene.add_path(plan.reference.poses[:, :3], colouring.colours)
            pages[colouring.name] = scene.record(preview.time, preview.joints, cells)
    texts = _preformatted((table(plan), '\n'.join(plan.report)))
    curve = _closest_pairs(plan, preview, cells, arm, options) if options.cell else ''
    return _page(pages, _legends(colourings) + curve + texts)


def _cells(plan: Plan, preview: Preview, arm: Arm, cell: Cell) -> dict[int, Cell]:
    """
    Return the cell at the start and after each part change.

    The keys are the rows of the preview at which these cells begin to hold.
    """
    cells = {0: cell}
    if not cell:  # no cell was given, so the changes of its parts are not drawn
        return cells
    for change in sorted(plan.goal.part_changes, key=lambda each: each.waypoint):
        cell = changed(cell, change, arm, joints_at(plan, change.waypoint), plan.T_flange_active)
        reference = plan.reference
        last = int(np.searchsorted(reference.point, change.waypoint, side='right')) - 1
        cells[int(np.searchsorted(preview.time, reference.time[last]))] = cell
    return cells


def _closest_pairs(
    plan: Plan, preview: Preview, cells: dict[int, Cell], arm: Arm, options: PlanningOptions
) -> str:
    """Return HTML with a curve of the closest pair for each of :func:`groups_of_pairs`."""
    active = plan.T_flange_active
    tip = plan.T_flange_tcp or active
    known = ~np.isnan(preview.joints.sum(axis=1))
    curves = ''
    titles = dict.fromkeys(title for cell in cells.values() for title in groups_of_pairs(cell))
    for title in titles:
        distances, pairs = np.full(len(known), inf), [''] * len(known)
        for begin, end in pairwise([*cells, len(known)]):
            rows = begin + np.flatnonzero(known[begin:end])
            cell = groups_of_pairs(cells[begin]).get(title, EMPTY_CELL)
            clearance = Clearance(arm, tip, replace(options, cell=cell), active)
            distances[rows], names = clearance.closest(preview.joints[rows])
            for row, (a, b) in zip(rows.tolist(), names, strict=True):
                pairs[row] = f'{a} and {b}'
        curves += distance_curve(title, preview.time, distances, pairs)
    return curves


def scene_of_plan(
    server: Server,
    arm: Arm,
    tcp: Pose,
    plan: Plan | None,
    cell: Cell = EMPTY_CELL,
    T_flange_active: Pose | None = None,
) -> Scene:
    """
    Return a scene with arm and cell and, if a plan is given, its points, outputs and path.

    :param T_flange_active: see :class:`Scene`.
    """
    scene = Scene(server, arm, tcp, cell, T_flange_active=T_flange_active)
    if plan is not None:
        if plan.goal.moving_frame is not None:
            scene.hold(plan.goal.moving_frame, plan.start)
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

    If the arm would touch something there, it is drawn at that place, and the bodies that touch
    are drawn in red, too.

    :param q: the joint positions of the arm at the start [rad].
    :param options: the options whose planes and bodies of the cell are drawn.
    :raises ImportError: viser is not installed; the text says how to get it.
    """
    touching: tuple[str, ...] = ()
    cell, q_start = options.cell, q
    if isinstance(refusal, CollisionPredicted) and refusal.q is not None:
        q, touching = refusal.q, refusal.bodies
        cell = refusal.cell if isinstance(refusal.cell, Cell) else cell
    # A path on a held part is drawn on the part; any other path begins at the start of the arm.
    seen_from = q_start if goal.moving_frame is None else q
    # Only positions are used, because an orientation may be the fault. Points that are given by
    # joints have no position (NaN).
    path = np.array(_places(goal, arm.forward(seen_from), tcp))
    has_place = np.isfinite(path).all(axis=1)
    with serve(parse_planes(options.workspace_planes)) as server:
        scene = Scene(server, arm, tcp, cell, touching)
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


def _places(goal: Goal, T_base_flange: Pose, tcp: Pose) -> list[Vector3]:
    """Return the positions in base of tool and points, with a held part at the given flange."""
    start, frame = (T_base_flange @ tcp).position, goal.T_base_frame
    if goal.moving_frame is not None:
        start = goal.moving_frame.T_base_tool.position
        frame = goal.moving_frame.frame(T_base_flange)
    return [start, *(frame.apply(waypoint.pose.position) for waypoint in goal.waypoints)]


def cell_page(
    cell: Cell,
    arm: Arm,
    q: Joints,
    tcp: Pose,
    texts: Iterable[str] = (),
    touching: Collection[str] = (),
) -> str:
    """
    Return the page of a cell with the arm at rest.

    :param q: the joint positions of the arm [rad].
    :param texts: the texts beside the scene: a table, then texts that are wrapped.
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
    return _page({'type': recorded}, _preformatted(texts))


def _preformatted(texts: Iterable[str]) -> str:
    return ''.join(f'<pre>{escape(text)}</pre>' for text in texts)


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


def _waypoints(plan: Plan) -> Iterator[tuple[int, Floats]]:
    """Yield the number and the position of each point, in the frame of the path."""
    for point, waypoint in enumerate(plan.goal.waypoints):
        pose = plan.goal.T_base_frame @ waypoint.pose
        yield point, np.array(pose.position)


def _outputs(plan: Plan) -> Iterator[tuple[str, Floats]]:
    """Yield a text and a position for each output, each wait for an input and each call."""
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
            at = pose_from_row(plan.reference.poses[last])
            if output.trigger_pose is not None:
                at = _on_path(plan, output.trigger_pose)
            yield describe_command(output), np.array(at.position)


def _on_path(plan: Plan, T_base_tcp: Pose) -> Pose:
    """Return the tool's pose in the frame of the path (base, or a held part) for a TCP pose."""
    frame, tcp = plan.goal.moving_frame, plan.T_flange_tcp or plan.T_flange_active
    return T_base_tcp if frame is None else frame.tool(T_base_tcp @ tcp.inverse())


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
