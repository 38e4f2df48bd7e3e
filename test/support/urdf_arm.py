# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""An arm with a part and a fixed tool, as a URDF of the tests, and pinocchio's poses."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ur_cartesian_driver.kinematics.robot_models import DhTable

#: x, y, z [m], roll, pitch, yaw [rad]: the origin of a URDF.
Origin = Sequence[float]


def urdf_of(geometry: DhTable, frames: Mapping[str, tuple[str, Origin]]) -> str:
    """
    Return a URDF of a DH table, and of frames by name: each with its parent and its origin.

    The parents of frames are ``base`` and ``tool0``.
    """
    links, joints, parent = ['base'], [], 'base'
    rows = zip(geometry.theta, geometry.d, geometry.a, geometry.alpha, strict=True)
    for k, (theta, d, a, alpha) in enumerate(rows):
        behind, end = f'behind_{k}', 'tool0' if k == 5 else f'link_{k}'
        joints.append(_joint(f'q{k}', 'revolute', parent, behind, (0, 0, 0, 0, 0, theta)))
        joints.append(_joint(f'fixed_{k}', 'fixed', behind, end, (a, 0, d, alpha, 0, 0)))
        links += [behind, end]
        parent = end
    for name, (of, origin) in frames.items():
        links.append(name)
        joints.append(_joint(f'to_{name}', 'fixed', of, name, origin))
    bodies = ''.join(f'<link name="{name}"/>' for name in links)
    return f'<robot name="arm">{bodies}{"".join(joints)}</robot>'


def _joint(name: str, kind: str, parent: str, child: str, origin: Origin) -> str:
    x, y, z, *rpy = (repr(float(value)) for value in origin)
    limit = '<limit lower="-99" upper="99" velocity="99" effort="99"/>'
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{x} {y} {z}" rpy="{" ".join(rpy)}"/><axis xyz="0 0 1"/>'
        f'{limit if kind == "revolute" else ""}</joint>'
    )


@dataclass
class UrdfArm:
    """Pinocchio's view of a URDF."""

    urdf: str
    model: Any = field(init=False)

    def __post_init__(self) -> None:
        import pinocchio

        self._pinocchio = pinocchio
        self.model = pinocchio.buildModelFromXML(self.urdf)
        self._data = self.model.createData()

    def relative(self, frame: str, seen_from: str, q: np.ndarray) -> np.ndarray:
        """Return the poses (n, 4, 4) of a frame, seen from another, at joints (n, 6) [rad]."""
        found = np.empty((len(q), 4, 4))
        one, other = (self.model.getFrameId(name) for name in (frame, seen_from))
        for row, joints in zip(found, np.asarray(q, dtype=float), strict=True):
            self._pinocchio.framesForwardKinematics(self.model, self._data, joints)
            poses = self._data.oMf
            row[:] = poses[other].actInv(poses[one]).homogeneous
        return found
