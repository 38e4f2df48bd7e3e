# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The links of an arm as shapes: the frame of each link, and its mesh or cylinders.

Link frames are placed as in the robot descriptions for ROS: z is the axis of the joint that moves
the link, and wrist 3 has the flange's origin and axes. On a calibrated arm each frame lies on the
joint's real axis, as near as possible to its place on the nominal arm with all joints at 0.

The meshes are the manufacturer's. UR3, UR5 and UR10 are in the package example-robot-data (BSD),
UR3e and UR5e (also for a UR7e) in the package airo-models (MIT). Both packages are optional; links
without a mesh are drawn as the cylinders of :mod:`~.collision_bodies`. The meshes of the e-Series
have no connector at the base.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from math import atan2, hypot
import os
from pathlib import Path
from types import MappingProxyType
from typing import Literal, TypeAlias

import numpy as np

from ur_cartesian_driver.kinematics.chain import Arm, table_frames
from ur_cartesian_driver.kinematics.collision_bodies import CollisionBodies, CONNECTOR, Link
from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.geometry.pose import (
    conjugate,
    IDENTITY,
    multiply,
    Pose,
    Quaternion,
    quaternion_from_rotation_vector,
    rotate,
)
from ur_cartesian_driver.motion.geometry.pose_rows import compose_rows, multiply_rows
from ur_cartesian_driver.motion.geometry.vectors import Vector3

#: `visual` has tens of thousands of triangles per link, `collision` about 1000. The collision
#: meshes of the e-Series are convex hulls of the links. The UR5e's long links consist of parts;
#: a cylinder fills the gaps between the parts of its forearm.
Detail: TypeAlias = Literal['visual', 'collision']

#: The links of the arm, without the tool, in the order of the joints that move them.
ARM_LINKS: tuple[Link, ...] = tuple(link for link in Link if link is not Link.TOOL)

_ZERO = (0.0,) * 6
_HALF = 0.5**0.5
# The orientations of the meshes in the frames of their links; the same in both packages.
_TURNS = (
    (0.0, 0.0, 1.0, 0.0),
    (0.0, 0.0, 1.0, 0.0),
    (0.5, -0.5, -0.5, 0.5),
    (0.5, -0.5, -0.5, 0.5),
    (_HALF, 0.0, 0.0, _HALF),
    (0.0, 0.0, 0.0, 1.0),
    (_HALF, 0.0, 0.0, _HALF),
)
_FILES = ('base', 'shoulder', 'upperarm', 'forearm', 'wrist1', 'wrist2', 'wrist3')


def _airo_models() -> Iterator[Path]:
    """Yield the folder with the files of airo-models; the package itself is not imported."""
    spec = find_spec('airo_models')
    if spec is not None and spec.origin is not None:
        yield Path(spec.origin).parent


def _example_robot_data() -> Iterator[Path]:
    """Yield the folders in which wheels and ROS installations may keep example-robot-data."""
    prefixes = os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)
    parents = [Path(prefix) for prefix in prefixes if prefix]
    spec = find_spec('pinocchio')  # the wheels of both are installed under the same prefix
    if spec is not None and spec.origin is not None:
        parents.extend(Path(spec.origin).parents)
    for parent in parents:
        yield parent / 'share' / 'example-robot-data'


_PACKAGE_ROOTS = {'airo-models': _airo_models, 'example-robot-data': _example_robot_data}


@dataclass(frozen=True, slots=True, kw_only=True)
class _MeshSource:
    """The meshes of one model in a package: their files, and their poses in the link frames."""

    package: str
    #: Folder of the model inside the package.
    folder: str
    #: File name extension of visual meshes.
    visual: str
    #: File name extension of collision meshes.
    collision: str
    #: The files of collision meshes that consist of parts.
    parts: Mapping[Link, tuple[str, ...]]
    #: Cylinders about z of the mesh that fill gaps between parts: from, to, radius [m].
    fillings: Mapping[Link, tuple[float, float, float]]
    #: Mesh origins of upper arm, forearm, wrists 1 to 3, along z of their link frames [m].
    offsets: tuple[float, float, float, float, float]
    #: Largest amount by which the visual meshes of two links are nearer than collision meshes [m].
    tolerance: float

    def files(self, link: Link, detail: Detail) -> list[Path]:
        """
        Return the files with the mesh of a link.

        :raises FileNotFoundError: the package is not installed.
        """
        names = (_FILES[link],) if detail == 'visual' else self.parts.get(link, (_FILES[link],))
        suffix = self.visual if detail == 'visual' else self.collision
        for root in _PACKAGE_ROOTS[self.package]():
            found = [Path(root, self.folder, detail, f'{name}.{suffix}') for name in names]
            if all(file.is_file() for file in found):
                return found
        raise FileNotFoundError(
            f'the package {self.package} with the meshes of the arm is not installed, the extra '
            '`collision` brings it'
        )

    def placement(self, link: Link) -> Pose:
        """Return ``T_link_mesh``."""
        along = (0.0, 0.0, *self.offsets)[link]
        return Pose((0.0, 0.0, along), _TURNS[link])


def _cb3(name: str, tolerance: float, *offsets: float) -> _MeshSource:
    a, b, c, d, e = offsets
    return _MeshSource(
        package='example-robot-data',
        folder=f'robots/ur_description/meshes/{name}',
        visual='dae',
        collision='stl',
        parts={},
        fillings={},
        offsets=(a, b, c, d, e),
        tolerance=tolerance,
    )


def _e_series(
    name: str,
    *offsets: float,
    parts: Mapping[Link, tuple[str, ...]] = MappingProxyType({}),
    fillings: Mapping[Link, tuple[float, float, float]] = MappingProxyType({}),
) -> _MeshSource:
    a, b, c, d, e = offsets
    return _MeshSource(
        package='airo-models',
        folder=f'arms/{name}',
        visual='obj',
        collision='obj',
        parts=parts,
        fillings=fillings,
        offsets=(a, b, c, d, e),
        tolerance=0.001,
    )


_UR5E = _e_series(
    'ur5e',
    0.138,
    0.007,
    -0.127,
    -0.0997,
    -0.0989,
    parts={
        link: tuple(f'{link.name.lower()}_link_part_{k}' for k in range(3))
        for link in (Link.UPPER_ARM, Link.FOREARM)
    },
    fillings={Link.FOREARM: (0.087, 0.3775, 0.04)},
)
#: The meshes of each model that has any. The offsets are from the robot descriptions in the
#: packages.
_SOURCES: Mapping[str, _MeshSource] = MappingProxyType(
    {
        'ur3': _cb3('ur3', 0.0005, 0.1198, 0.0273, -0.08505, -0.08535, -0.0819),
        'ur5': _cb3('ur5', 0.0015, 0.13585, 0.01615, -0.093, -0.09465, -0.0823),
        'ur10': _cb3('ur10', 0.001, 0.220941, 0.049041, -0.1149, -0.1157, -0.0922),
        'ur3e': _e_series('ur3e', 0.12, 0.027, -0.104, -0.08535, -0.0921),
        'ur5e': _UR5E,
        'ur7e': _UR5E,
    }
)
#: Models that have meshes.
MODELS_WITH_MESHES: tuple[str, ...] = tuple(_SOURCES)


def mesh_model(name: str) -> str:
    """Return the name of the model whose meshes are used for a model."""
    return Path(_SOURCES[name].folder).name


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkShape:
    """
    A mesh, or a cylinder, that moves with a link.

    :param T_link_shape: in the frame of the link, the frame of the mesh's vertices [m], or the
        middle of the cylinder, whose axis is z.
    :param mesh: the file; None: a cylinder of ``radius`` and ``length`` [m].
    """

    link: Link
    T_link_shape: Pose
    mesh: Path | None = None
    radius: float = 0.0
    length: float = 0.0


def link_shapes(arm: Arm, detail: Detail = 'visual') -> tuple[LinkShape, ...]:
    """Return the meshes of an arm, or cylinders if it has none or their package is missing."""
    try:
        return link_meshes(arm.model.name, detail)
    except (ValueError, FileNotFoundError):
        return link_cylinders(arm)


def link_meshes(name: str, detail: Detail) -> tuple[LinkShape, ...]:
    """
    Return the meshes of a model, one or more for each of :data:`ARM_LINKS`, in their order.

    :raises ValueError: the model has no meshes.
    :raises FileNotFoundError: the package with its meshes is not installed.
    """
    if name not in _SOURCES:
        raise ValueError(f'there are no meshes of the {name}')
    source = _SOURCES[name]
    shapes = []
    for link in ARM_LINKS:
        T_link_mesh = source.placement(link)
        shapes += [
            LinkShape(link=link, T_link_shape=T_link_mesh, mesh=file)
            for file in source.files(link, detail)
        ]
        if detail == 'collision' and link in source.fillings:
            begin, end, radius = source.fillings[link]
            T_link_shape = T_link_mesh @ Pose((0.0, 0.0, 0.5 * (begin + end)))
            shapes.append(
                LinkShape(link=link, T_link_shape=T_link_shape, radius=radius, length=end - begin)
            )
    return tuple(shapes)


def mesh_tolerance(name: str) -> float:
    """Return how much nearer two links of a model can be than their collision meshes [m]."""
    return _SOURCES[name].tolerance


def link_cylinders(arm: Arm) -> tuple[LinkShape, ...]:
    """Return the cylinders of an arm, which contain its links."""
    frames = LinkFrames(arm).at_zero
    shapes = []
    for link, start, end, radius in CollisionBodies(arm).drawn_cylinders():
        vector = end - start
        length = float(np.linalg.norm(vector))
        x, y, z = (0.5 * (start + end)).tolist()
        T_base_shape = Pose((x, y, z), shortest_turn_of_z(*(vector / length).tolist()))
        T_link_shape = frames[link].inverse() @ T_base_shape
        shapes.append(
            LinkShape(link=link, T_link_shape=T_link_shape, radius=radius, length=length)
        )
    return tuple(shapes)


def connector_shape(arm: Arm) -> LinkShape:
    """Return the cylinder of the connector at the base."""
    return link_cylinders(arm)[CONNECTOR]


class LinkFrames:
    """
    The frames of :data:`ARM_LINKS` on one arm. Immutable.

    :param arm: nominal or calibrated.
    """

    def __init__(self, arm: Arm) -> None:
        """Place the frames on the axes of the arm."""
        nominal = table_frames(arm.model.geometry)
        true = arm.frames(_ZERO)
        #: ``T_base_link`` of each link while all joints are at 0.
        self.at_zero: tuple[Pose, ...] = (
            IDENTITY,
            *(
                _on_axis(frame, origin, axis)
                for frame, origin, axis in zip(nominal, true.origins, true.axes, strict=True)
            ),
        )
        #: The frame of each joint in the frame of the link before, while the joint is at 0; the
        #: joint turns about z of its frame.
        self.joints: tuple[Pose, ...] = tuple(
            before.inverse() @ after
            for before, after in zip(self.at_zero[:-1], self.at_zero[1:], strict=True)
        )
        #: ``T_wrist3_flange``; the identity on a nominal arm.
        self.flange: Pose = self.at_zero[-1].inverse() @ arm.forward(_ZERO)

    def poses(self, q: Floats) -> Floats:
        """
        Return ``T_base_link`` of every link.

        :param q: (n, 6) [rad].
        :returns: (n, 7, 7) x y z [m], unit quaternion x y z w; a row for each link.
        """
        rows = np.tile(IDENTITY.row(), (len(q), 1))
        result = [rows]
        zero = np.zeros(len(q))
        for T_link_joint, angle in zip(self.joints, q.T, strict=True):
            rows = compose_rows(rows, T_link_joint)
            turn = np.stack((zero, zero, np.sin(0.5 * angle), np.cos(0.5 * angle)), axis=1)
            rows[:, 3:] = multiply_rows(rows[:, 3:], turn)
            result.append(rows)
        return np.stack(result, axis=1)


def _on_axis(frame: Pose, origin: Vector3, axis: Vector3) -> Pose:
    """Return the frame moved and turned by the shortest way so that its z lies on an axis."""
    a, p = np.array(axis), np.array(frame.position)
    x, y, z = (np.array(origin) + a * (a @ (p - np.array(origin)))).tolist()
    turn = shortest_turn_of_z(*rotate(conjugate(frame.quaternion), axis))
    return Pose((x, y, z), multiply(frame.quaternion, turn))


def shortest_turn_of_z(x: float, y: float, z: float) -> Quaternion:
    """Return the shortest rotation from z to a unit vector."""
    across = hypot(x, y)
    if across == 0.0:
        return (0.0, 0.0, 0.0, 1.0) if z > 0.0 else (1.0, 0.0, 0.0, 0.0)
    angle = atan2(across, z)
    return quaternion_from_rotation_vector((-y / across * angle, x / across * angle, 0.0))
