# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A plan as markers for RViz."""

from __future__ import annotations

from math import ceil

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Vector3
import numpy as np
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, Pose, pose_from_row
from ur_cartesian_driver.motion.goal.known_frames import BASE, TOOL0
from ur_cartesian_driver.motion.plan.plan import Plan
from ur_cartesian_driver.preview.motion_page import BLEND, MOTIONS
from ur_cartesian_driver.ros.message_fields import pose_message

#: Largest number of drawn samples of a path, and of drawn points.
MAX_SAMPLES = 5000
MAX_POINTS = 500
#: Width of the path and diameter of the points [m].
PATH_WIDTH, POINT_SIZE = 0.004, 0.01
#: Length of the axes that are drawn at the start and the end [m].
AXIS_LENGTH = 0.05


def _colour(red: int, green: int, blue: int) -> ColorRGBA:
    return ColorRGBA(r=red / 255.0, g=green / 255.0, b=blue / 255.0, a=1.0)


#: Colours of the motions, the same as on the page that shows a plan.
COLOURS = {kind: _colour(*colour) for kind, (_, colour) in MOTIONS.items()}
BLEND_COLOUR = _colour(*BLEND)
POINT_COLOUR = _colour(50, 60, 70)
_AXES = (
    ((1.0, 0.0, 0.0), _colour(220, 50, 50)),
    ((0.0, 1.0, 0.0), _colour(50, 180, 50)),
    ((0.0, 0.0, 1.0), _colour(50, 80, 220)),
)


def plan_markers(plan: Plan, base: str, stamp: Time) -> MarkerArray:
    """
    Return a plan as markers, which replace the markers of the previous plan.

    Namespace ``path``: the path of the TCP, each piece in the colour of its motion; ``points``:
    the points of the goal; ``ends``: the axes of the TCP at the start and at the end. If the path
    is on a held part, all markers move with the flange.

    :param base: the frame of the robot's base.
    """
    header, T_header_path = Header(stamp=stamp, frame_id=base), IDENTITY
    moving = plan.goal.moving_frame
    if moving is not None:  # RViz moves the markers with the flange
        header.frame_id = base.removesuffix(BASE) + TOOL0
        T_header_path = moving.T_flange_frame
    lines = [_path(plan, header), _points(plan, header)]
    for marker in lines:
        marker.pose = pose_message(T_header_path)
    ends = [T_header_path @ pose_from_row(plan.reference.poses[row]) for row in (0, -1)]
    markers = [*lines, *(_axes(pose, number, header) for number, pose in enumerate(ends))]
    for marker in markers:
        marker.frame_locked = moving is not None
    return MarkerArray(markers=[Marker(header=header, action=Marker.DELETEALL), *markers])


def _path(plan: Plan, header: Header) -> Marker:
    reference, kinds = plan.reference, plan.rows.kinds
    rows = _some(len(reference.poses), MAX_SAMPLES)
    blended = np.any(reference.blend_tolerance[rows], axis=1).tolist()
    marker = Marker(header=header, ns='path', type=Marker.LINE_STRIP)
    marker.scale.x = PATH_WIDTH
    marker.points = _positions(reference.poses[rows])
    marker.colors = [
        BLEND_COLOUR if on_blend else COLOURS[kinds[point]]
        for point, on_blend in zip(reference.point[rows].tolist(), blended, strict=True)
    ]
    return marker


def _points(plan: Plan, header: Header) -> Marker:
    waypoints = plan.goal.waypoints
    marker = Marker(header=header, ns='points', type=Marker.SPHERE_LIST, color=POINT_COLOUR)
    marker.scale = Vector3(x=POINT_SIZE, y=POINT_SIZE, z=POINT_SIZE)
    marker.points = [
        pose_message(waypoints[k].pose).position for k in _some(len(waypoints), MAX_POINTS)
    ]
    return marker


def _axes(pose: Pose, number: int, header: Header) -> Marker:
    marker = Marker(header=header, ns='ends', id=number, type=Marker.LINE_LIST)
    marker.pose = pose_message(pose)
    marker.scale.x = PATH_WIDTH
    for direction, colour in _AXES:
        x, y, z = (AXIS_LENGTH * part for part in direction)
        marker.points += [Point(), Point(x=x, y=y, z=z)]
        marker.colors += [colour, colour]
    return marker


def _some(count: int, most: int) -> list[int]:
    """Return indices of rows: all, or evenly spaced ones and the last if there are too many."""
    rows = list(range(0, count, max(1, ceil(count / most))))
    return rows if rows[-1:] == [count - 1] or not count else [*rows, count - 1]


def _positions(poses: Floats) -> list[Point]:
    return [Point(x=x, y=y, z=z) for x, y, z in np.asarray(poses)[:, :3].tolist()]
