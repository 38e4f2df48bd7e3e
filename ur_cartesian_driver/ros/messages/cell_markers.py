# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Markers for RViz: the bodies of the cell, and the two that would touch."""

from __future__ import annotations

from collections.abc import Iterator

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Vector3
import numpy as np
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from ur_cartesian_driver.kinematics.cell_poses import T_carrier_body
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.link_shapes import ARM_LINKS, link_cylinders, LinkFrames
from ur_cartesian_driver.motion.cell.cell import Cell, CellBody
from ur_cartesian_driver.motion.cell.shapes import Box, Cylinder, HalfSpace, Mesh, Sphere
from ur_cartesian_driver.motion.errors import CollisionPredicted
from ur_cartesian_driver.motion.geometry.pose import Pose, pose_from_row
from ur_cartesian_driver.motion.goal.known_frames import BASE, BASE_LINK, T_BASE_BASE_LINK
from ur_cartesian_driver.preview.drawn_shapes import coarse_mesh, SQUARE_SIDE, triangles_per_mesh
from ur_cartesian_driver.preview.scene import CARRIED, Colour, FIXED, REFUSED
from ur_cartesian_driver.ros.message_fields import pose_message

#: Thickness of the squares that stand for planes [m], and their opacity.
_THICKNESS, _CLEAR = 0.001, 0.3
#: Opacity of the bodies that would touch, through which the arm and the fixed bodies are seen.
_GHOST = 0.6


def cell_markers(cell: Cell, tf_prefix: str, stamp: Time) -> MarkerArray:
    """
    Return the bodies as markers, which replace all earlier markers.

    Each body has a namespace. Its markers are in the frame that carries the body, so RViz moves
    them with the arm.
    """
    markers = [Marker(action=Marker.DELETEALL)]
    most = triangles_per_mesh(cell)
    for body in cell.bodies:
        frame, T_frame_body = body.frame, body.T_frame_body
        if frame == BASE_LINK:  # a frame that not every driver publishes
            frame, T_frame_body = BASE, T_BASE_BASE_LINK @ T_frame_body
        header = Header(stamp=stamp, frame_id=tf_prefix + frame)
        colour = CARRIED if body.is_carried else FIXED
        markers += _body_markers(body, T_frame_body, header, colour, most)
    return MarkerArray(markers=markers)


def refusal_markers(
    refusal: CollisionPredicted, cell: Cell, arm: Arm, T_flange_tcp: Pose, base: str, stamp: Time
) -> MarkerArray:
    """
    Return the two bodies that would touch, in red, at the place of their collision.

    Links of the arm are drawn as enclosing cylinders. Each namespace is ``refused``, followed by
    the name of the body.

    :param base: the frame of the robot's base.
    """
    if refusal.q is None:
        return MarkerArray()
    header = Header(stamp=stamp, frame_id=base)
    frames = LinkFrames(arm)
    links = [pose_from_row(row) for row in frames.poses(np.array([refusal.q]))[0]]
    markers: list[Marker] = []
    for body in cell.bodies:
        if body.name in refusal.bodies:
            link, T_link_body = T_carrier_body(body, frames, T_flange_tcp)
            most = triangles_per_mesh(cell)
            markers += _body_markers(body, links[link] @ T_link_body, header, REFUSED, most)
    for number, shape in enumerate(link_cylinders(arm)):
        name = f'{ARM_LINKS[shape.link].name.lower()}_link'
        if name in refusal.bodies:
            marker = _marker(header, name, number, REFUSED, links[shape.link] @ shape.T_link_shape)
            _set_cylinder(marker, shape.radius, shape.length)
            markers.append(marker)
    for marker in markers:
        marker.ns, marker.color.a = f'refused {marker.ns}', _GHOST
    return MarkerArray(markers=markers)


def _marker(header: Header, name: str, number: int, colour: Colour, pose: Pose) -> Marker:
    marker = Marker(header=header, ns=name, id=number, frame_locked=True)
    red, green, blue = (value / 255.0 for value in colour)
    marker.color = ColorRGBA(r=red, g=green, b=blue, a=1.0)
    marker.pose = pose_message(pose)
    return marker


def _body_markers(
    body: CellBody, T_frame_body: Pose, header: Header, colour: Colour, most: int
) -> Iterator[Marker]:
    """Yield a marker for each shape; ``most`` = the largest number of triangles of a mesh."""
    for number, placed in enumerate(body.shapes):
        pose = T_frame_body @ placed.T_body_shape
        marker = _marker(header, body.name, number, colour, pose)
        match placed.shape:
            case Box(size=(x, y, z)):
                marker.type, marker.scale = Marker.CUBE, Vector3(x=x, y=y, z=z)
            case Cylinder(radius=radius, length=length):
                _set_cylinder(marker, radius, length)
            case Sphere(radius=radius):
                d = 2.0 * radius
                marker.type, marker.scale = Marker.SPHERE, Vector3(x=d, y=d, z=d)
            case HalfSpace():
                marker.type = Marker.CUBE
                marker.scale = Vector3(x=SQUARE_SIDE, y=SQUARE_SIDE, z=_THICKNESS)
                marker.pose = pose_message(pose @ Pose((0.0, 0.0, -0.5 * _THICKNESS)))
                marker.color.a = _CLEAR
            case Mesh() as mesh:
                vertices, triangles = coarse_mesh(mesh, most)
                marker.type, marker.scale = Marker.TRIANGLE_LIST, Vector3(x=1.0, y=1.0, z=1.0)
                corners = vertices[triangles.reshape(-1)].tolist()
                marker.points = [Point(x=x, y=y, z=z) for x, y, z in corners]
        yield marker


def _set_cylinder(marker: Marker, radius: float, length: float) -> None:
    marker.type = Marker.CYLINDER
    marker.scale = Vector3(x=2.0 * radius, y=2.0 * radius, z=length)
