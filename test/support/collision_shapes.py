# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Where the collision shapes of an arm are, for comparison with its kinematics."""

import numpy as np
from numpy.typing import NDArray

from ur_cartesian_driver.kinematics.collision_bodies import CollisionBodies
from ur_cartesian_driver.kinematics.collision_meshes import CollisionMeshes

Floats = NDArray[np.float64]


def capsules(bodies: CollisionBodies, q: Floats) -> Floats:
    """The ends (n, k, 2, 3) [m] of the capsules that contain the cylinders."""
    start, vector = bodies._capsules(bodies._ends(bodies.arm.frames_rows(q)))
    ends: Floats = np.stack([start, start + vector]).transpose(3, 2, 0, 1)
    return ends


def T_base_meshes(meshes: CollisionMeshes, q: Floats) -> Floats:
    """Where the meshes of all links are at joints (6,) [rad]: matrices (7, 4, 4)."""
    meshes._update_placement(q)
    return np.array([T.homogeneous for T in meshes._placement.oMg])
