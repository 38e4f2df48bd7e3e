# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Exact distances between the links of an arm, from the manufacturer's meshes.

:mod:`~.link_shapes` knows the models that have meshes, and their files; pinocchio computes the
distances. Packages and meshes are optional; without them the cylinders of
:mod:`~.collision_bodies` decide. The connector at the base is always a cylinder from there,
because the meshes of the e-Series have no connector.
"""

from __future__ import annotations

from functools import lru_cache
from importlib.util import find_spec
from itertools import combinations
from math import hypot
from typing import Any

import numpy as np

from ur_cartesian_driver.kinematics.chain import Arm, pinocchio_model
from ur_cartesian_driver.kinematics.collision_bodies import CONNECTOR_PAIR, Link
from ur_cartesian_driver.kinematics.link_shapes import (
    connector_shape,
    link_meshes,
    LinkFrames,
    LinkShape,
    mesh_tolerance,
    shortest_turn_of_z,
)
from ur_cartesian_driver.kinematics.solids import coal
from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, Pose


@lru_cache
def missing_meshes(name: str) -> str:
    """Return the reason why the links of a model cannot be measured, a clause; '' if they can."""
    try:
        link_meshes(name, 'collision')
    except (ValueError, FileNotFoundError) as error:
        return str(error)
    if find_spec('pinocchio') is None:
        return 'pinocchio is not installed, the extra `collision` brings it'
    return ''


class CollisionMeshes:
    """
    The meshes of one arm and the cylinder of its tool, attached to its joints. Not thread-safe.

    :param arm: nominal or calibrated.
    :param T_flange_tcp: the TCP, where the tool ends.
    :param tool_radius: radius of a cylinder from the flange to the TCP [m]; 0 = no tool.
    """

    def __init__(self, arm: Arm, T_flange_tcp: Pose = IDENTITY, tool_radius: float = 0.0) -> None:
        """
        Load the meshes and attach them to the joints.

        :raises ValueError: the model has no meshes.
        :raises ImportError: pinocchio is not installed.
        :raises FileNotFoundError: the package with the meshes is not installed.
        """
        shapes = link_meshes(arm.model.name, 'collision')
        # By how much the simplified meshes may be too small [m].
        self._tolerance = mesh_tolerance(arm.model.name)
        self._model = pinocchio_model(arm)
        import pinocchio

        self._pinocchio, self._data = pinocchio, self._model.createData()
        self._geometry = pinocchio.GeometryModel()
        frames = LinkFrames(arm)
        pinocchio.forwardKinematics(self._model, self._data, np.zeros(6))
        #: The numbers of the shapes of each link; the last one of the base is the connector.
        self._shapes: dict[Link, list[int]] = {link: [] for link in Link}
        for shape in (*shapes, connector_shape(arm)):
            T_base_shape = frames.at_zero[shape.link] @ shape.T_link_shape
            self._attach(shape.link, T_base_shape, _solid(shape))
        length = hypot(*T_flange_tcp.position)
        if tool_radius > 0.0 and length > 0.0:
            # The cylinder is along z and has its origin in the middle.
            to_tcp = T_flange_tcp.position
            T_flange_middle = Pose(
                (0.5 * to_tcp[0], 0.5 * to_tcp[1], 0.5 * to_tcp[2]),
                shortest_turn_of_z(*(value / length for value in to_tcp)),
            )
            self._attach(
                Link.TOOL,
                arm.forward((0.0,) * 6) @ T_flange_middle,
                coal().Cylinder(tool_radius, length),
            )
        self._pairs = {pair: self._add_pairs(pair) for pair in combinations(Link, 2)}
        self._placement = pinocchio.GeometryData(self._geometry)

    def _attach(self, link: Link, T_base_shape: Pose, shape: Any) -> None:
        """Attach a shape to the joint that moves it, given its pose while all joints are at 0."""
        joint = min(link, Link.WRIST_3)
        T = self._pinocchio.SE3(T_base_shape.matrix())
        T_joint_shape = self._data.oMi[joint].inverse() * T
        number: int = self._geometry.addGeometryObject(
            self._pinocchio.GeometryObject(
                f'{link.name} {len(self._shapes[link])}', int(joint), T_joint_shape, shape
            )
        )
        self._shapes[link].append(number)

    def _add_pairs(self, pair: tuple[Link, Link]) -> list[int]:
        """Register the pairs of shapes of two links, and return their numbers."""
        first, second = (self._shapes[link] for link in pair)
        begin = len(self._geometry.collisionPairs)
        for a in first[-1:] if pair == CONNECTOR_PAIR else first:
            for b in second:
                self._geometry.addCollisionPair(self._pinocchio.CollisionPair(a, b))
        return list(range(begin, len(self._geometry.collisionPairs)))

    def distances(self, pair: tuple[Link, Link], q: Floats) -> Floats:
        """
        Return the distance of two links, less the tolerance of their meshes.

        :param pair: the two links, the one nearer to the base first.
        :param q: (n, 6) [rad].
        :returns: (n,) [m]; 0 where the links may touch or overlap.
        """
        result = np.empty(len(q))
        for row, joints in enumerate(q):
            self._update_placement(joints)
            found = (
                self._pinocchio.computeDistance(self._geometry, self._placement, index)
                for index in self._pairs[pair]
            )
            nearest = min(each.min_distance for each in found)
            result[row] = max(0.0, nearest - self._tolerance)
        return result

    def nearer_than(
        self, bound: float, pair: tuple[Link, Link], q: Floats
    ) -> tuple[Flags, Floats]:
        """
        Return whether two links are nearer than a bound [m]; far faster than :meth:`distances`.

        :returns: (n,) whether the links are nearer, and (n,) a lower bound of the distance if not.
        """
        indices = self._pairs[pair]
        for index in indices:
            request = self._placement.collisionRequests[index]
            request.security_margin = bound + self._tolerance
        near, lower_bounds = np.zeros(len(q), dtype=np.bool_), np.zeros(len(q))
        for row, joints in enumerate(q):
            self._update_placement(joints)
            near[row] = any(
                self._pinocchio.computeCollision(self._geometry, self._placement, index)
                for index in indices
            )
            # Pinocchio's lower bound is for the distance minus the security margin.
            found = (self._placement.collisionResults[index] for index in indices)
            lower_bounds[row] = bound + max(0.0, min(each.distance_lower_bound for each in found))
        return near, lower_bounds

    def _update_placement(self, q: Floats) -> None:
        self._pinocchio.updateGeometryPlacements(
            self._model, self._data, self._geometry, self._placement, q
        )


def _solid(shape: LinkShape) -> Any:
    """Return a shape as an object that pinocchio can measure."""
    if shape.mesh is None:
        return coal().Cylinder(shape.radius, shape.length)
    return _mesh(str(shape.mesh))


@lru_cache
def _mesh(file: str) -> Any:
    """Return coal's bounding-volume tree of the triangles in a mesh file."""
    return coal().MeshLoader().load(file, np.ones(3))
