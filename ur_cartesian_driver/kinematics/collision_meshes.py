# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Exact distances between the links of a UR3, UR5 or UR10, from the manufacturer's meshes.

The meshes come from the package example-robot-data; pinocchio computes the distances. Both are
optional; without them the capsules of :mod:`~.collision_bodies` decide. e-Series arms have
a different shape, so there are no meshes for them.

The meshes follow the axes of our own kinematics, so those of a calibrated arm are where its links
really are: with all joints at 0 each mesh has its pose from the robot description, and moves with
its joint from there.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from itertools import combinations
import os
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ur_cartesian_driver.kinematics.chain import Arm, pinocchio_model
from ur_cartesian_driver.kinematics.collision_bodies import Link

Floats: TypeAlias = NDArray[np.float64]
Flags: TypeAlias = NDArray[np.bool_]

#: Models that have meshes.
MODELS_WITH_MESHES = ('ur3', 'ur5', 'ur10')

_DESCRIPTION = Path('example-robot-data', 'robots', 'ur_description', 'urdf')
#: Frame names in the robot description, in the order of the links.
_LINKS: tuple[Link, ...] = tuple(link for link in Link if link is not Link.TOOL)
_FRAMES = tuple(f'{link.name.lower()}_link' for link in _LINKS)


class CollisionMeshes:
    """The meshes of one arm, attached to its joints. Not thread-safe."""

    def __init__(self, arm: Arm) -> None:
        """
        Load the meshes and attach them to the joints.

        :raises ValueError: the model has none.
        :raises ImportError: pinocchio is not installed.
        :raises FileNotFoundError: example-robot-data is not installed.
        """
        if arm.model.name not in MODELS_WITH_MESHES:
            raise ValueError(f'There are no meshes of a {arm.model.name}.')
        self._model = pinocchio_model(arm)
        import pinocchio

        self._pinocchio, self._data = pinocchio, self._model.createData()
        self._geometry = pinocchio.GeometryModel()
        zero = np.zeros(6)
        pinocchio.forwardKinematics(self._model, self._data, zero)
        for link, (shape, T_base_link) in enumerate(_load_meshes(arm.model.name)):
            T_base_joint = self._data.oMi[link]
            self._geometry.addGeometryObject(
                pinocchio.GeometryObject(
                    Link(link).name, link, T_base_joint.inverse() * T_base_link, shape
                )
            )
        self._pairs = {pair: k for k, pair in enumerate(combinations(_LINKS, 2))}
        for a, b in self._pairs:
            self._geometry.addCollisionPair(pinocchio.CollisionPair(int(a), int(b)))
        self._placement = pinocchio.GeometryData(self._geometry)

    @classmethod
    def of(cls, arm: Arm) -> CollisionMeshes | None:
        """Return the meshes of an arm; None if it has none or a package is missing."""
        if arm.model.name not in MODELS_WITH_MESHES:
            return None
        try:
            return cls(arm)
        except (ImportError, FileNotFoundError):
            return None

    def distances(self, pair: tuple[Link, Link], q: Floats) -> Floats:
        """
        Return the distance of two links.

        :param pair: the lower link first.
        :param q: (n, 6) [rad].
        :returns: (n,) [m]; 0 where they touch or overlap.
        """
        index = self._pairs[pair]
        result = np.empty(len(q))
        for row, joints in enumerate(q):
            self._update_placement(joints)
            found = self._pinocchio.computeDistance(self._geometry, self._placement, index)
            result[row] = max(0.0, found.min_distance)
        return result

    def nearer_than(
        self, bound: float, pair: tuple[Link, Link], q: Floats
    ) -> tuple[Flags, Floats]:
        """
        Return where two links are nearer than a bound [m]; several times faster than distances.

        :returns: (n,) whether they are, and (n,) a lower bound of the distance if not [m].
        """
        index = self._pairs[pair]
        self._placement.collisionRequests[index].security_margin = bound
        near, lower_bounds = np.zeros(len(q), dtype=np.bool_), np.zeros(len(q))
        for row, joints in enumerate(q):
            self._update_placement(joints)
            near[row] = self._pinocchio.computeCollision(self._geometry, self._placement, index)
            # Pinocchio counts it from the security margin.
            lower_bounds[row] = bound + max(
                0.0, self._placement.collisionResults[index].distance_lower_bound
            )
        return near, lower_bounds

    def _update_placement(self, q: Floats) -> None:
        self._pinocchio.updateGeometryPlacements(
            self._model, self._data, self._geometry, self._placement, q
        )


@lru_cache
def _load_meshes(name: str) -> list[tuple[Any, Any]]:
    """Return shape and pose (in base, all joints at 0) of each link's mesh."""
    import pinocchio

    share = _find_share()
    urdf = str(share / _DESCRIPTION / f'{name}_robot.urdf')
    model = pinocchio.buildModelFromUrdf(urdf)
    geometry = pinocchio.buildGeomFromUrdf(
        model, urdf, pinocchio.GeometryType.COLLISION, package_dirs=[str(share)]
    )
    data, placement = model.createData(), pinocchio.GeometryData(geometry)
    pinocchio.updateGeometryPlacements(model, data, geometry, placement, np.zeros(6))
    pinocchio.updateFramePlacements(model, data)
    T_world_base = data.oMf[model.getFrameId('base')]
    found = []
    for frame in _FRAMES:
        index = geometry.getGeometryId(f'{frame}_0')
        found.append(
            (
                geometry.geometryObjects[index].geometry,
                T_world_base.inverse() * placement.oMg[index],
            )
        )
    return found


def _find_share() -> Path:
    """
    Return the directory that holds example-robot-data.

    :raises FileNotFoundError: it is not installed.
    """
    for share in _share_candidates():
        if (share / _DESCRIPTION).is_dir():
            return share
    raise FileNotFoundError(
        'The meshes of the robots are not installed; the extra `collision` brings them.'
    )


def _share_candidates() -> Iterator[Path]:
    """Return where wheels and ROS installations keep shared files."""
    import pinocchio

    for parent in Path(pinocchio.__file__).parents:
        yield parent / 'share'
    for prefix in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep):
        if prefix:
            yield Path(prefix, 'share')
