# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Places of an arm's collision shapes, for comparison with its kinematics and its meshes."""

import numpy as np

from ur_cartesian_driver.kinematics.collision_bodies import CollisionBodies, Link
from ur_cartesian_driver.kinematics.collision_meshes import CollisionMeshes
from ur_cartesian_driver.motion.geometry.arrays import Floats

Floats = Floats


def body_surfaces(bodies: CollisionBodies, q: Floats, n: int = 24) -> list[Floats]:
    """Points (m, 3) on the rims of each body at joints (6,) [rad]; the body is their hull."""
    start, vector, axis = (each[:, :, 0] for each in bodies._skeletons(bodies._lines(q[None])))
    angle = np.linspace(0.0, 2.0 * np.pi, n, endpoint=False)[:, None]
    surfaces = []
    for p, v, u, half, radius in zip(
        start.T, vector.T, axis.T, bodies._insets[:, 0], bodies.radii, strict=True
    ):
        across = np.cross(u, [1.0, 0.3, 0.2])
        across /= np.linalg.norm(across)
        rim = radius * (np.cos(angle) * across + np.sin(angle) * np.cross(u, across))
        surfaces.append(
            np.concatenate([p + t * v + side * half * u + rim for t in (0, 1) for side in (-1, 1)])
        )
    return surfaces


def beyond_bodies(bodies: CollisionBodies, q: Floats, link: Link, points: Floats) -> Floats:
    """
    Return distances of points (n, 3) [m] in base from each body of a link at joints (6,) [rad].

    A distance is below 0 and exact inside of the body, and an upper bound outside of it.
    """
    start, vector, axis = (each[:, :, 0] for each in bodies._skeletons(bodies._lines(q[None])))
    outside = []
    for k in np.flatnonzero(np.array(bodies.links) == link):
        p, v, u = start[:, k], vector[:, k], axis[:, k]
        # The nearest place of a cylinder that moves across its axis, else the middle of the axis.
        nearest = np.clip((points - p) @ v / max(float(v @ v), 1e-300), 0.0, 1.0)
        ways = []
        for t in (nearest, np.full(len(points), 0.5)):
            apart = points - p - t[:, None] * v
            along = apart @ u
            half = bodies._insets[k, 0] + (0.0 if t is nearest else 0.5 * abs(v @ u))
            radial = np.linalg.norm(apart - along[:, None] * u, axis=1) - bodies.radii[k]
            ways.append(np.maximum(np.abs(along) - half, radial))
        outside.append(np.minimum(*ways))
    return np.array(outside)


def T_base_meshes(meshes: CollisionMeshes, q: Floats) -> Floats:
    """Return the poses of all links' meshes at joints (6,) [rad]: matrices (7, 4, 4)."""
    meshes._update_placement(q)
    first = [meshes._shapes[link][0] for link in Link if link is not Link.TOOL]
    return np.array([meshes._placement.oMg[number].homogeneous for number in first])
