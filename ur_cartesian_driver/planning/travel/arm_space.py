# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The joint space of one arm with one tool, for the search for a travel."""

from __future__ import annotations

from dataclasses import replace
from math import ceil, radians, tau

import numpy as np

from ur_cartesian_driver.kinematics.inverse import solutions
from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import Joints, vector6
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.preflight.clearance import Clearance, Violation
from ur_cartesian_driver.planning.preflight.tcp_kinematics import max_joint_change, TcpKinematics

#: No joint turns farther than this from one checked configuration to the next [rad].
_ROW_STEP = radians(1.0)
#: At first, only one in this many of these configurations is checked.
_FIRST_STRIDE = 8
#: Distance between two configurations on a line along the axis of the tool [m], and the largest
#: turn of a joint between them [rad]: a greater one leads to another branch.
_LINE_STEP, _MAX_TURN = 0.002, 0.2
#: The least weight of a joint [m/rad]. Wrist 3 would weigh nothing if the tool has no length.
_MIN_WEIGHT = 0.05


class ArmSpace:
    """
    The configurations of an arm, with checks that it is clear of itself and of its cell.

    :param kinematics: the arm and its TCP.
    :param options: the cell, planes and distances that :class:`~.clearance.Clearance` checks.
    """

    def __init__(self, kinematics: TcpKinematics, options: PlanningOptions) -> None:
        """Create the checks."""
        self.kinematics = kinematics
        model = kinematics.arm.model
        arm, T_flange_tcp = kinematics.arm, kinematics.T_flange_tcp
        self._clearance = Clearance(arm, T_flange_tcp, options)
        only_cell = replace(options, self_collision='off', workspace_planes=())
        self._cell = Clearance(arm, T_flange_tcp, only_cell)
        #: Lowest and highest position of each joint, (2, 6) [rad].
        self.limits: Floats = np.array(model.position_limits).T
        # A joint moves its link's length across the joint axis, but not the length along it, and
        # moves all lengths of the links beyond.
        across, along = np.abs(model.geometry.a), np.abs(model.geometry.d)
        beyond = np.cumsum((across + along)[::-1])[::-1] - along
        length = float(np.linalg.norm(kinematics.T_flange_tcp.position))
        #: Greatest displacement of the arm for each radian of a joint, (6,) [m/rad].
        self.weights: Floats = np.maximum(beyond + length, _MIN_WEIGHT)

    def free(self, q: Floats) -> Flags:
        """Return whether each configuration (n, 6) [rad] is clear of everything."""
        return ~self._clearance.too_close(q)

    def seems_free(self, a: Floats, b: Floats) -> bool:
        """Return whether configurations at small steps from a (left out) to b are clear."""
        rows = _rows(a, b)
        # A few of them reveal most motions that are not free.
        return not any(
            self._clearance.too_close(some).any()
            for some in (rows[::-_FIRST_STRIDE], rows)
            if len(some)
        )

    def is_free(self, a: Floats, b: Floats) -> bool:
        """
        Return whether a straight joint motion that seems free is clear of the cell everywhere.

        Self-collisions and planes are checked only at the steps of :meth:`seems_free`, which must
        have been called before.
        """
        start = vector6(a.tolist())
        return self._cell.check(_rows(a, b), start, closest=False).violation is None

    def violation(self, q: Floats, q_start: Joints) -> Violation | None:
        """Return the first violation in configurations (n, 6) [rad] after ``q_start``, or None."""
        return self._clearance.check(q, q_start, closest=False).violation

    def touching(self, q: Joints) -> Violation | None:
        """
        Return the violation in a configuration; None if the arm is clear of everything.

        This includes violations of which the planner would only warn, because a travel avoids
        them, too.
        """
        return self._clearance.violation_at(q)

    def along_tool(self, q: Joints, distance: float) -> Floats | None:
        """
        Return the configurations on a line along the axis z of the tool, without the first.

        :param distance: length of the line [m], negative = backwards.
        :returns: (n, 6) [rad]; None if the arm cannot follow the line.
        """
        count = ceil(abs(distance) / _LINE_STEP)
        begin = self.tcp(q)
        rows = []
        for fraction in np.linspace(0.0, 1.0, count + 1)[1:].tolist():
            pose = begin @ Pose((0.0, 0.0, distance * fraction))
            there = self.kinematics.solution(pose, q)
            if there is None or max_joint_change(q, there) > _MAX_TURN:
                return None
            rows.append(there)
            q = there
        return np.array(rows).reshape(-1, 6)

    def tcp(self, q: Joints) -> Pose:
        """Return ``T_base_tcp`` in a configuration."""
        return self.kinematics.arm.forward(q) @ self.kinematics.T_flange_tcp

    def configurations(self, T_base_tcp: Pose, q_near: Joints) -> list[Joints]:
        """
        Return the configurations in which the arm reaches a pose, the nearest to q_near first.

        Whole turns bring each joint as near to ``q_near`` as its limits allow.
        """
        found = solutions(self.kinematics.arm, self.kinematics.flange(T_base_tcp), q_near)
        if not found:
            return []
        q = np.array(found)
        low, high = self.limits
        q += tau * np.round((q_near - q) / tau)
        q -= tau * np.ceil(np.maximum(q - high, 0.0) / tau)
        q += tau * np.ceil(np.maximum(low - q, 0.0) / tau)
        q = q[((q >= low) & (q <= high)).all(axis=1)]
        order = np.argsort(np.linalg.norm((q - q_near) * self.weights, axis=1), kind='stable')
        return [vector6(row) for row in q[order].tolist()]


def _rows(a: Floats, b: Floats) -> Floats:
    """Return the configurations (n, 6) at small steps from ``a`` to ``b``, without ``a``."""
    count = max(1, ceil(float(np.abs(b - a).max()) / _ROW_STEP))
    rows: Floats = a + np.linspace(0.0, 1.0, count + 1)[1:, None] * (b - a)
    return rows
