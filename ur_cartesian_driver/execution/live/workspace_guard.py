# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Keep an arm that follows live targets away from planes, from bodies of the cell and from itself.

A check takes longer than a control cycle, so it is left out while no part of the arm can reach a
bound. A part moves at most by the sum of the joints' turns, times the largest distance of any part
from an axis. So each check also notes the smallest distance left to a bound: no other check is
needed until the joints have turned far enough to use it up.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot, inf

import numpy as np

from ur_cartesian_driver.kinematics.cell_distances import CellDistances
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.collision_bodies import CollisionBodies, Link
from ur_cartesian_driver.motion.cell.cell import Cell, EMPTY_CELL
from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import Joints, ZERO6
from ur_cartesian_driver.motion.geometry.workspace import Plane

#: Pairs of bodies in the cell are measured exactly if their distance may exceed their clearance by
#: less than this [m]; otherwise a lower bound is enough, at a tenth of the cost.
_NEAR = 0.02
#: More than the thickness of any link [m].
_THICKNESS = 0.3
#: A smaller approach to a bound counts as rounding [m].
_ROUNDING = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveWorkspace:
    """The bounds that the arm keeps away from."""

    planes: tuple[Plane, ...] = ()
    #: Smallest distance between the cylinders around the links [m]; None = not checked.
    min_clearance: float | None = None
    #: Radius of the tool between flange and TCP [m]; 0 = no tool.
    tool_radius: float = 0.0
    #: The bodies around the arm and on it.
    cell: Cell = EMPTY_CELL

    def __bool__(self) -> bool:
        """Return whether there is any bound."""
        return bool(self.planes) or self.min_clearance is not None or bool(self.cell)


class WorkspaceGuard:
    """Checks the bounds of the workspace for one arm with one tool."""

    def __init__(self, arm: Arm, T_flange_tcp: Pose, workspace: LiveWorkspace) -> None:
        """Compute the collision bodies and the planes."""
        self._arm, self._tcp, self._workspace = arm, T_flange_tcp, workspace
        self._bodies = bodies = CollisionBodies(arm, T_flange_tcp, workspace.tool_radius)
        planes = workspace.planes
        self._normals = np.array([plane.normal for plane in planes]).reshape(-1, 3)
        self._min_heights = np.array(
            [
                sum(n * p for n, p in zip(plane.normal, plane.point, strict=True)) + plane.margin
                for plane in planes
            ]
        )
        self._moving = [k for k, link in enumerate(bodies.links) if link != Link.BASE]
        self._names = [str(bodies.links[k]) for k in self._moving] + ['the TCP']
        radius, cell = workspace.tool_radius, workspace.cell
        self._cell = CellDistances(arm, T_flange_tcp, cell, radius) if cell else None
        # More than the distance of any part of the arm from an axis [m].
        self._max_lever_arm = (
            arm.model.max_reach
            + sum(map(abs, arm.model.geometry.d[3:]))
            + hypot(*T_flange_tcp.position)
            + workspace.tool_radius
            + _THICKNESS
        )
        if self._cell is not None:
            reach = float(self._cell.reaches[1:].max())  # of bodies that the arm carries
            self._max_lever_arm = max(self._max_lever_arm, reach)
        #: The joint positions of the last check [rad], and the smallest slack found there [m].
        self._last_check: tuple[Joints, float] = ZERO6, 0.0

    def violation(self, q: Joints, q_now: Joints) -> str:
        """
        Return the bodies that would be too near to each other or to a plane, as a clause, or ''.

        Bodies that are already too near may move away.

        :param q: joint positions to check [rad].
        :param q_now: present joint positions [rad].
        """
        q_checked, slack = self._last_check
        turns = sum([abs(a - b) for a, b in zip(q, q_checked, strict=True)])
        if self._max_lever_arm * turns < slack:
            return ''
        slacks = self._clearance_slacks(q)
        min_slack = float(slacks.min())
        self._last_check = (q, min_slack)
        if min_slack >= 0.0:
            return ''
        worse = slacks < np.minimum(0.0, self._clearance_slacks(q_now) - _ROUNDING)
        if not worse.any():
            return ''
        index = int(np.where(worse, slacks, inf).argmin())
        return self._clause(index, float(slacks[index]))

    def _clearance_slacks(self, q: Joints) -> Floats:
        """Return all distances minus the margin or clearance that each must keep [m]."""
        row = np.array([q])
        slacks = np.empty(0)
        if self._workspace.planes:
            low = self._bodies.heights(row, self._normals)[0][:, self._moving]
            tcp = self._normals @ np.array((self._arm.forward(q) @ self._tcp).position)
            slacks = (
                np.concatenate([low, tcp[:, None]], axis=1) - self._min_heights[:, None]
            ).ravel()
        if self._workspace.min_clearance is not None:
            link_slacks = self._bodies.distances(row)[0] - self._workspace.min_clearance
            slacks = np.concatenate([slacks, link_slacks])
        if self._cell is not None:
            slacks = np.concatenate([slacks, self._cell_slacks(self._cell, row)])
        return slacks

    def _cell_slacks(self, cell: CellDistances, row: Floats) -> Floats:
        poses = cell.poses(row)
        distances = cell.lower_bounds(poses)[0]
        for column in np.flatnonzero(distances - cell.clearances < _NEAR).tolist():
            distances[column] = cell.distances(column, poses, inf)[0]
        slacks: Floats = distances - cell.clearances
        return slacks

    def _clause(self, index: int, slack: float) -> str:
        planes = self._workspace.planes
        number, body = divmod(index, len(self._names))
        if number < len(planes):
            plane, name = planes[number], self._names[body]
            height = plane.margin + slack
            near = f'come within {height:.4f} m of'
            if height < 0.0:
                near = f'go {-height:.4f} m beyond'
            margin = f', its margin is {plane.margin:.4f} m' if plane.margin else ''
            return f'{name} would {near} the workspace plane "{plane.name}"{margin}'
        index -= len(planes) * len(self._names)
        count = 0 if self._workspace.min_clearance is None else len(self._bodies.pairs)
        if self._cell is not None and index >= count:
            pair = self._cell.pairs[index - count]
            return (
                f'{pair.a} and {pair.b} would come within {max(0.0, pair.clearance + slack):.4f} '
                f'm of each other, their clearance is {pair.clearance:.4f} m'
            )
        clearance = self._workspace.min_clearance or 0.0
        a, b = self._bodies.pairs[index]
        return (
            f'{a} and {b} would come within {max(0.0, clearance + slack):.4f} m of each other '
            f'(measured between cylinders), min_clearance is {clearance:.4f} m'
        )
