# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The scene of a page: the arm, its tool, the cell and a path, as viser draws and plays them."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stdout
import io
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ur_cartesian_driver.kinematics.cell_poses import T_carrier_body
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.link_shapes import ARM_LINKS, link_shapes, LinkFrames
from ur_cartesian_driver.motion.cell.cell import Cell, CellBody, EMPTY_CELL
from ur_cartesian_driver.motion.cell.shapes import Box, Cylinder, HalfSpace, Mesh, Shape, Sphere
from ur_cartesian_driver.motion.geometry.arrays import Floats, Indices
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, Pose, pose_from_row
from ur_cartesian_driver.motion.geometry.vectors import Joints, vector3
from ur_cartesian_driver.motion.geometry.workspace import Plane
from ur_cartesian_driver.motion.goal.moving_frame import MovingFrame
from ur_cartesian_driver.preview.drawn_shapes import coarse_mesh, SQUARE_SIDE, triangles_per_mesh

Colours = NDArray[np.uint8]
Colour = tuple[int, int, int]
#: A server of viser, which has to be installed only to make a page.
Server = Any

#: Largest number of points that are drawn.
MAX_NUMBERED_POINTS = 60

#: Colours of bodies that are fixed, that the arm carries, and that would touch.
FIXED: Colour = (190, 165, 130)
CARRIED: Colour = (110, 160, 110)
REFUSED: Colour = (210, 30, 30)
_ARM, _TOOL, _POINT, _OUTPUT, _PLANE, _TRAIL = (
    (176, 184, 194),
    (90, 100, 110),
    (50, 60, 70),
    (200, 120, 0),
    (120, 170, 220),
    (230, 60, 160),
)
_NO_CHANGES: Mapping[int, Cell] = MappingProxyType({})
#: The nodes of the links in the scene.
_LINK_NODES = tuple(f'/arm/{link.name.lower()}' for link in ARM_LINKS)
#: Direction to the camera if the path gives none.
_ASIDE = np.array((0.65, 0.65, 0.4))


class Scene:
    """The arm, its tool, its cell and its path on a viser server, which shows or records them."""

    def __init__(
        self,
        server: Server,
        arm: Arm,
        tcp: Pose,
        cell: Cell = EMPTY_CELL,
        touching: Collection[str] = (),
        T_flange_active: Pose | None = None,
    ) -> None:
        """
        Draw the arm and the cell, each shape in the frame of its link.

        :param tcp: the TCP to which the tool is drawn.
        :param T_flange_active: the active TCP, which carries bodies in ``tool0_controller``; None
            = ``tcp``.
        :param touching: names of bodies, and of links as in :data:`~.cell.LINK_NAMES`, that are
            drawn in red.
        """
        import trimesh

        self._server, self._scene = server, server.scene
        self._frames = LinkFrames(arm)
        self._touching, self._active = touching, T_flange_active
        #: The node in whose frame the path is, '' = the base; the pose of this frame at the start.
        self._path_root, self._T_base_path = '', IDENTITY
        self._links = [self._scene.add_frame(name, show_axes=False) for name in _LINK_NODES]
        for k, shape in enumerate(link_shapes(arm, 'collision')):
            if shape.mesh is not None:
                mesh = trimesh.load_mesh(shape.mesh)
            else:
                mesh = trimesh.creation.cylinder(shape.radius, shape.length, sections=24)
            node = _LINK_NODES[shape.link]
            colour = self._colour(f'{node.removeprefix("/arm/")}_link', _ARM)
            self._add_mesh(f'{node}/{k}', mesh.vertices, mesh.faces, colour, shape.T_link_shape)
        self._bodies = [
            self._add_body(f'/cell/{k}', body, triangles_per_mesh(cell))
            for k, body in enumerate(cell.bodies)
        ]
        self._cell = cell
        self.set_tool(tcp)

    def _colour(self, name: str, otherwise: Colour) -> Colour:
        return REFUSED if name in self._touching else otherwise

    def set_tool(self, tcp: Pose) -> None:
        """Draw the tool from flange to TCP in place of the last one; move bodies on the TCP."""
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
        self._tcp = tcp
        self._place(self._cell)

    def _add_body(self, name: str, body: CellBody, most: int) -> Any:
        """Draw a body, and return its node; ``most`` = largest number of triangles of a mesh."""
        node = self._scene.add_frame(name, show_axes=False)
        self._scene.add_label(f'{name}/label', body.name, font_screen_scale=0.7)
        colour = self._colour(body.name, CARRIED if body.is_carried else FIXED)
        for k, placed in enumerate(body.shapes):
            vertices, triangles = _triangles(placed.shape, most)
            opacity = 0.3 if isinstance(placed.shape, HalfSpace) else None
            self._add_mesh(
                f'{name}/{k}', vertices, triangles, colour, placed.T_body_shape, opacity
            )
        return node

    def _place(self, cell: Cell) -> None:
        """Move the drawn bodies to their poses in ``cell``, which may be on other carriers."""
        self._cell = cell
        #: Node, link and ``T_link_body`` of each body that the arm carries.
        self._carried = []
        for node, body in zip(self._bodies, cell.bodies, strict=True):
            link, T_link_body = T_carrier_body(body, self._frames, self._active or self._tcp)
            if link > 0:
                self._carried.append((node, link, T_link_body))
            else:
                node.position, node.wxyz = np.array(T_link_body.position), _wxyz(T_link_body)

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

    def hold(self, frame: MovingFrame, q: Joints) -> None:
        """
        Attach paths, points and outputs to a held part, and draw the fixed tool.

        :param q: the joint positions at the start [rad].
        """
        T_link_frame = self._frames.flange @ frame.T_flange_frame
        self._path_root = f'{_LINK_NODES[-1]}/held_part'
        self._scene.add_frame(
            self._path_root,
            axes_length=0.05,
            axes_radius=0.0025,
            position=np.array(T_link_frame.position),
            wxyz=_wxyz(T_link_frame),
        )
        self._scene.add_frame(
            '/fixed_tool',
            axes_length=0.08,
            axes_radius=0.004,
            position=np.array(frame.T_base_tool.position),
            wxyz=_wxyz(frame.T_base_tool),
        )
        self._scene.add_label('/fixed_tool/label', 'fixed tool', font_screen_scale=0.7)
        wrist = pose_from_row(self._frames.poses(np.array([q]))[0][-1])
        self._T_base_path = wrist @ T_link_frame

    def add_path(self, positions: Floats, colours: Colours) -> None:
        """Draw a path with a colour for each of its edges, and point the camera at the path."""
        edges = np.stack((positions[:-1], positions[1:]), axis=1).astype(np.float32)
        self._scene.add_line_segments(
            f'{self._path_root}/path',
            edges,
            np.repeat(colours[:, None], 2, axis=1),
            thickness=0.007,
        )
        rows = np.array([self._T_base_path.apply(vector3(place)) for place in positions.tolist()])
        self.look_at(rows if self._path_root else positions)

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
        self._scene.add_line_segments(f'{self._path_root}/trail', edges, _TRAIL, thickness=0.004)

    def pose_arm(self, q: Joints) -> None:
        """Draw the arm at joint positions [rad]."""
        self._move(self._frames.poses(np.array([q]))[0])

    def add_points(self, points: Iterable[tuple[int, Floats]]) -> None:
        """Draw points with their numbers, up to :data:`MAX_NUMBERED_POINTS` of them."""
        for number, place in list(points)[:MAX_NUMBERED_POINTS]:
            self.add_ball(f'points/{number}', place, 0.006, _POINT)
            node = f'{self._path_root}/points/{number}'
            self._scene.add_label(f'{node}/label', str(number), font_screen_scale=0.7)

    def add_outputs(self, outputs: Iterable[tuple[str, Floats]]) -> None:
        """Mark places of outputs, waits and calls with their texts."""
        for k, (text, place) in enumerate(outputs):
            self.add_ball(f'outputs/{k}', place, 0.008, _OUTPUT)
            node = f'{self._path_root}/outputs/{k}'
            self._scene.add_label(f'{node}/label', text, font_screen_scale=0.7)

    def add_ball(self, name: str, place: Floats, radius: float, colour: Colour) -> None:
        """Draw a ball."""
        self._scene.add_icosphere(
            f'{self._path_root}/{name}', radius, colour, subdivisions=2, position=place
        )

    def record(self, time: Floats, q: Floats, cells: Mapping[int, Cell] = _NO_CHANGES) -> str:
        """
        Return viser's page of the scene with the arm in motion.

        While the joints are not known, the arm stays where it was.

        :param cells: the new cell, for each row at which the cell changes.
        """
        known = ~np.isnan(q.sum(axis=1))
        poses = self._frames.poses(np.where(known[:, None], q, 0.0))
        if 0 in cells:
            self._place(cells[0])
        self._move(poses[int(np.argmax(known))])
        recording = self._server.get_scene_serializer()
        for k in range(len(time)):
            if k in cells:
                self._place(cells[k])
            if known[k]:
                self._move(poses[k])
            recording.insert_sleep(float(time[k + 1] - time[k]) if k + 1 < len(time) else 0.0)
        page: str = recording.as_html()
        return page

    def _move(self, poses: Floats) -> None:
        for node, pose in zip(self._links, poses, strict=True):
            node.position, node.wxyz = pose[:3], pose[[6, 3, 4, 5]]
        for node, link, T_link_body in self._carried:
            T_base_body = pose_from_row(poses[link]) @ T_link_body
            node.position, node.wxyz = np.array(T_base_body.position), _wxyz(T_base_body)


@contextmanager
def serve(planes: Sequence[Plane], host: str = '127.0.0.1', port: int = 0) -> Iterator[Server]:
    """
    Run a viser server in a `with` block; its scene has a floor and the planes.

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
