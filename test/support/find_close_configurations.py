# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Find configurations in which an arm touches itself or nearly does, by third-party libraries.

    pip install pin example-robot-data airo-models trimesh pycollada python-fcl
    python test/support/find_close_configurations.py > test/kinematics/golden/mesh_distances.json

Pinocchio places the meshes by the robot descriptions in the packages, from ``base``; FCL measures
their distances. The output has, for each model and pair of links, joints [rad] and distance [m] of
touching configurations, and of the closest ones that do not touch. The base of an e-Series arm is
the drawn base with its cable connector, above the mounting surface.
"""

import json
import sys

import fcl
import numpy as np
import pinocchio
import trimesh

from ur_cartesian_driver.kinematics.link_shapes import ARM_LINKS, link_meshes
from ur_cartesian_driver.motion.geometry.arrays import Floats

Floats = Floats
#: Joints [rad] and distance [m].
Row = list[float]
#: Numbers of random configurations: measured, kept for each pair, and starts of approaches.
TRIED, KEPT, STARTS = 250, 6, 8
#: Number of steps of an approach, and typical turn of a joint in one step [rad].
STEPS, STEP = 80, 0.15
#: Pairs that the driver leaves out, or for which it checks only the connector.
LEFT_OUT = (('FOREARM', 'WRIST_2'), ('WRIST_1', 'WRIST_3'), ('BASE', 'UPPER_ARM'))


class MeshJudge:
    """The links of one model as FCL's objects."""

    def __init__(self, name: str) -> None:
        """Load description and meshes."""
        visual = link_meshes(name, 'visual')[0].mesh
        assert visual is not None
        folder, is_cb3 = visual.parents[1], visual.suffix == '.dae'
        urdf = (
            folder.parents[1] / 'urdf' / f'{name}_robot.urdf'
            if is_cb3
            else next(folder.glob('*.urdf'))
        )
        packages = [str(folder.parents[4] if is_cb3 else folder)]
        kind = pinocchio.GeometryType.COLLISION if is_cb3 else pinocchio.GeometryType.VISUAL
        self.model = pinocchio.buildModelFromUrdf(str(urdf))
        self.geometry = pinocchio.buildGeomFromUrdf(
            self.model, str(urdf), kind, package_dirs=packages
        )
        self.data = self.model.createData()
        self.placement = pinocchio.GeometryData(self.geometry)
        self.objects = {}
        for link in ARM_LINKS:
            names = [f'{link.name.lower()}_link_0', f'{link.name.lower()}_link_inertia_0']
            number = next(
                k for k, each in enumerate(self.geometry.geometryObjects) if each.name in names
            )
            files = [
                each.mesh
                for each in link_meshes(name, 'collision')
                if each.link == link and each.mesh is not None
            ]
            parts = [trimesh.load(file, force='mesh') for file in files]
            if link.name == 'BASE' and not is_cb3:
                drawn = trimesh.load(self.geometry.geometryObjects[number].meshPath, force='mesh')
                above = (drawn.vertices[drawn.faces][:, :, 2] > -0.01).all(axis=1)
                parts.append(trimesh.Trimesh(drawn.vertices, drawn.faces[above]))
            mesh = trimesh.util.concatenate(parts)
            shape = fcl.BVHModel()
            shape.beginModel(len(mesh.vertices), len(mesh.faces))
            shape.addSubModel(mesh.vertices, mesh.faces)
            shape.endModel()
            self.objects[link.name] = number, fcl.CollisionObject(shape)

    def place(self, q: Floats) -> None:
        """Move the links to joints (6,) [rad]."""
        pinocchio.updateGeometryPlacements(self.model, self.data, self.geometry, self.placement, q)
        for number, shape in self.objects.values():
            T = self.placement.oMg[number]
            shape.setTransform(fcl.Transform(T.rotation, T.translation))

    def distance(self, a: str, b: str) -> float:
        """Return the distance [m] of two links; 0 = they touch."""
        one, other = self.objects[a][1], self.objects[b][1]
        return max(
            0.0, float(fcl.distance(one, other, fcl.DistanceRequest(), fcl.DistanceResult()))
        )


def close_configurations(name: str, rng: np.random.Generator) -> dict[str, list[Row]]:
    """Return, for each pair, touching configurations and the closest other ones."""
    judge, names = MeshJudge(name), [link.name for link in ARM_LINKS]
    pairs = [(a, b) for i, a in enumerate(names) for b in names[i + 2 :] if (a, b) not in LEFT_OUT]
    found: dict[tuple[str, str], list[Row]] = {pair: [] for pair in pairs}
    for q in np.round(rng.uniform(-np.pi, np.pi, (TRIED, 6)), 4):
        judge.place(q)
        for pair, rows in found.items():
            rows.append([*q.tolist(), judge.distance(*pair)])
    for pair, rows in found.items():
        rows.sort(key=lambda row: row[-1])
        touching = [row for row in rows if row[-1] == 0.0]
        clear = rows[len(touching) :]
        for start in clear[:STARTS]:
            nearest, hit = approach(judge, pair, start, rng)
            clear.append(nearest)
            touching += hit
        clear.sort(key=lambda row: row[-1])
        # Configurations from approaches are last, and overlap least.
        rows[:] = [[*row[:6], round(row[6], 6)] for row in touching[-KEPT:] + clear[:KEPT]]
    return {' '.join(pair): rows for pair, rows in found.items()}


def approach(
    judge: MeshJudge, pair: tuple[str, str], row: Row, rng: np.random.Generator
) -> tuple[Row, list[Row]]:
    """Approach step by step; return the closest configuration apart, and touching ones."""
    for _ in range(STEPS):
        q = np.round(row[:6] + rng.normal(0.0, STEP, 6), 4)
        judge.place(q)
        step = [*q.tolist(), judge.distance(*pair)]
        if step[-1] == 0.0:
            return row, [step]
        if step[-1] < row[-1]:
            row = step
    return row, []


if __name__ == '__main__':
    rng = np.random.default_rng(26)
    models = ('ur3', 'ur5', 'ur10', 'ur3e', 'ur5e')
    result = {name: close_configurations(name, rng) for name in models}
    json.dump(result, sys.stdout, separators=(',', ':'))
