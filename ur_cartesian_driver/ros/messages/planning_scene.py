# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
MoveIt's PlanningScene as bodies of a cell.

Messages are read by the names of their fields, so moveit_msgs need not be installed. The normal of
a plane points away from its solid side.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from enum import IntEnum
from functools import partial
from math import isfinite
from typing import Any

import numpy as np

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.motion.cell.cell import Cell, CellBody, FRAMES, LINK_NAMES, PlacedShape
from ur_cartesian_driver.motion.cell.shapes import Box, Cylinder, HalfSpace, Mesh, Shape, Sphere
from ur_cartesian_driver.motion.errors import GoalRefused, shortened
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, normalize, Pose
from ur_cartesian_driver.motion.goal.known_frames import ArmSnapshot, Frames
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.planning.preflight.cell_stretches import place_in_base

#: The cell's names for parts of the arm that have other names in other packages.
_LINK_OF_FRAME = {
    'base': 'base_link',
    'tool0': 'tool',
    'flange': 'tool',
    'tool0_controller': 'tool',
}


class _Operation(IntEnum):
    """An operation on an object, numbered as in ``CollisionObject.operation``."""

    ADD = 0
    REMOVE = 1
    APPEND = 2
    MOVE = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneBodies:
    """A cell, and the names of its bodies that came from a planning scene."""

    cell: Cell
    names: frozenset[str] = frozenset()


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneArm:
    """The arm with its state and frames, for objects in frames that move with the arm."""

    arm: Arm
    #: The newest state of the robot; None = not known.
    state: RobotState | None
    frames: Frames
    prefix: str = ''


def updated_scene(scene: SceneBodies, message: Any, place: SceneArm) -> SceneBodies:
    """
    Return a scene as changed by a message of the type moveit_msgs/PlanningScene.

    :raises ValueError: the message cannot be honoured; the text is a clause that says why.
    """
    if len(message.world.octomap.octomap.data):
        raise ValueError('it has an octomap, of which nothing is checked; send it without one')
    update = _Update(scene, place)
    if not message.is_diff:
        update.forget(lambda body: True)
    elif not message.robot_state.is_diff:
        update.forget(lambda body: body.is_carried)
    for attached in message.robot_state.attached_collision_objects:
        update.of(attached.object, partial(update.change_attached, attached))
    for each in message.world.collision_objects:
        update.of(each, partial(update.change_object, each))
    return update.scene


class _Update:
    """A scene that is being changed; a change that is impossible raises a ValueError."""

    def __init__(self, scene: SceneBodies, place: SceneArm) -> None:
        self.scene, self._place = scene, place

    def of(self, item: Any, change: Callable[[], None]) -> None:
        """
        Make a change to one object.

        :param item: the object.
        :param change: makes the change.
        :raises ValueError: the change is impossible; the text names the object.
        """
        try:
            if item.id in self.scene.cell.names - self.scene.names:
                raise ValueError(
                    'the cell has another body of this name; give the object another one'
                )
            change()
        except ValueError as error:
            clause = str(error).rstrip('.')
            raise ValueError(f'object "{shortened(item.id)}": {clause}') from None

    def forget(self, which: Callable[[CellBody], bool]) -> None:
        """Remove the bodies that came from the planning scene and meet a condition."""
        for body in self._own():
            if which(body):
                self._remove(body.name)

    def change_object(self, item: Any) -> None:
        """Add, remove, extend or move a fixed object."""
        operation = _operation(item)
        if operation is _Operation.REMOVE:
            self.forget(lambda body: not body.is_carried and item.id in ('', body.name))
            return
        T_base_object = self._T_base_object(item)
        shapes = tuple(_shapes(item))
        if operation is _Operation.ADD:
            self._put(
                CellBody(name=item.id, shapes=shapes, T_frame_body=T_base_object), replaces=True
            )
            return
        body = self.scene.cell.body(item.id)
        if operation is _Operation.MOVE:
            if shapes or item.primitive_poses or item.mesh_poses or item.plane_poses:
                raise ValueError('it moves single shapes; move the whole object, or add it anew')
            self._put(replace(body, frame='base', T_frame_body=T_base_object))
        else:
            self._put(_with_shapes(body, shapes, self._in_base(body).inverse() @ T_base_object))

    def change_attached(self, attached: Any) -> None:
        """Attach an object to a link, or detach it."""
        item, link = attached.object, attached.link_name.removeprefix(self._place.prefix)
        if _operation(item) is _Operation.REMOVE:
            for body in self._own():
                if body.is_carried and item.id in ('', body.name):
                    self._put(replace(body, frame='base', T_frame_body=self._in_base(body)))
            return
        if not FRAMES.get(link):
            raise ValueError(f'"{shortened(attached.link_name)}" is no link of this arm')
        shapes = tuple(_shapes(item))
        if not shapes:  # an object of the scene, at its present place
            body = self.scene.cell.body(item.id)
            T_link_body = self._in_link(link, body, self._in_base(body))
            body = replace(body, frame=link, T_frame_body=T_link_body)
        else:
            body = CellBody(name=item.id, shapes=shapes, frame=link)
            if item.header.frame_id.removeprefix(self._place.prefix) == link:
                T_link_body = _pose(item.pose)
            else:
                T_link_body = self._in_link(link, body, self._T_base_object(item))
            if _operation(item) is _Operation.APPEND:
                before = self.scene.cell.body(item.id)
                T_body_new = self._in_base(before).inverse() @ self._in_base(
                    replace(body, T_frame_body=T_link_body)
                )
                body = _with_shapes(before, shapes, T_body_new)
            else:
                body = replace(body, T_frame_body=T_link_body)
        self._put(body)
        self._allow(body.name, (link, *attached.touch_links))

    def _own(self) -> list[CellBody]:
        return [body for body in self.scene.cell.bodies if body.name in self.scene.names]

    def _put(self, body: CellBody, *, replaces: bool = False) -> None:
        cell, names = self.scene.cell, self.scene.names
        if replaces and body.name in cell.names:
            cell = cell.without(body.name)  # and without its pairs that may touch
        self.scene = SceneBodies(cell=cell.with_bodies([body]), names=names | {body.name})

    def _remove(self, name: str) -> None:
        self.scene = SceneBodies(
            cell=self.scene.cell.without(name), names=self.scene.names - {name}
        )

    def _allow(self, name: str, links: Iterable[str]) -> None:
        """Allow a body to touch links and other bodies; names that the cell lacks are ignored."""
        names = {link.removeprefix(self._place.prefix) for link in links}
        known = {_LINK_OF_FRAME.get(each, each) for each in names}
        known &= {*LINK_NAMES, *self.scene.cell.names} - {name}
        pairs = self.scene.cell.may_touch | {frozenset({name, each}) for each in known}
        self.scene = replace(self.scene, cell=replace(self.scene.cell, may_touch=pairs))

    def _T_base_object(self, item: Any) -> Pose:
        state, frame = self._place.state, item.header.frame_id
        snapshot = None if state is None else ArmSnapshot.of(state)
        try:
            T_base_frame = self._place.frames.T_base_frame(frame, snapshot)
        except GoalRefused as error:
            text = str(error).removeprefix('trajectory.').rstrip('.')
            raise ValueError(text) from None
        return T_base_frame @ _pose(item.pose)

    def _in_base(self, body: CellBody) -> Pose:
        if not body.is_carried:
            return place_in_base(body, self._place.arm, (0.0,) * 6, IDENTITY)
        state = self._place.state
        if state is None:
            raise ValueError('the robot does not report where the arm is')
        return place_in_base(body, self._place.arm, state.actual_q, state.T_flange_tcp)

    def _in_link(self, link: str, body: CellBody, T_base_body: Pose) -> Pose:
        at_link = replace(body, frame=link, T_frame_body=IDENTITY)
        return self._in_base(at_link).inverse() @ T_base_body


def _operation(item: Any) -> _Operation:
    """Return the operation of an object, which messages hold in a byte."""
    value = item.operation
    number = value[0] if isinstance(value, bytes) else value
    try:
        return _Operation(number)
    except ValueError:
        raise ValueError(f'its operation is {number}, which is none of 0 to 3') from None


def _with_shapes(body: CellBody, shapes: Iterable[PlacedShape], T_body_new: Pose) -> CellBody:
    """Return a body with more shapes, given in a frame whose pose in the body is T_body_new."""
    more = (PlacedShape(each.shape, T_body_new @ each.T_body_shape) for each in shapes)
    return replace(body, shapes=(*body.shapes, *more))


def _pose(message: Any) -> Pose:
    """Return a pose; a quaternion of zeros is no turn, as in MoveIt."""
    position = tuple(float(getattr(message.position, axis)) for axis in 'xyz')
    x, y, z, w = (float(getattr(message.orientation, axis)) for axis in 'xyzw')
    if not all(map(isfinite, (*position, x, y, z, w))):
        raise ValueError('a pose has a number that is not finite')
    turned = normalize((x, y, z, w)) if any((x, y, z, w)) else IDENTITY.quaternion
    return Pose((position[0], position[1], position[2]), turned)


def _shapes(item: Any) -> Iterator[PlacedShape]:
    """Yield the shapes of an object in its frame."""
    for what, shape_of in (
        ('primitive', _primitive),
        ('mesh', _mesh),
        ('plane', lambda _: HalfSpace()),
    ):
        messages = getattr(item, 'meshes' if what == 'mesh' else f'{what}s')
        poses = list(getattr(item, f'{what}_poses')) or [None] * len(messages)
        if len(poses) != len(messages):
            raise ValueError(f'{what}_poses has {len(poses)} entries for {len(messages)} shapes')
        for message, pose in zip(messages, poses, strict=True):
            T_object_shape = IDENTITY if pose is None else _pose(pose)
            if what == 'plane':
                T_object_shape = T_object_shape @ _plane(message)
            yield PlacedShape(shape_of(message), T_object_shape)


def _primitive(message: Any) -> Shape:
    sizes = [float(size) for size in message.dimensions]
    match int(message.type), sizes:
        case 1, [x, y, z]:
            return Box((x, y, z))
        case 2, [radius]:
            return Sphere(radius)
        case 3, [height, radius]:
            return Cylinder(radius, height)
        case ((1 | 2 | 3), _):
            raise ValueError(f'a primitive has {len(sizes)} dimensions')
    raise ValueError(
        'a primitive is no box, sphere or cylinder; send its mesh, or a box around it'
    )


def _mesh(message: Any) -> Mesh:
    vertices = np.array([(v.x, v.y, v.z) for v in message.vertices], dtype=np.float64)
    triangles = np.array([t.vertex_indices for t in message.triangles], dtype=np.intp)
    return Mesh(vertices=vertices, triangles=triangles)


def _plane(message: Any) -> Pose:
    """Return the frame of a plane: z along its normal."""
    a, b, c, d = (float(value) for value in message.coef)
    normal = np.array([a, b, c])
    size = float(np.linalg.norm(normal))
    if not isfinite(size) or not isfinite(d) or size == 0.0:
        raise ValueError('a plane has no normal')
    x, y, z = normal / size
    # The shortest turn from z to the normal; about x if it points down.
    turn = (-y, x, 0.0, 1.0 + z) if z > -1.0 + 1e-12 else (1.0, 0.0, 0.0, 0.0)
    distance = -d / size
    return Pose((distance * x, distance * y, distance * z), normalize(turn))
