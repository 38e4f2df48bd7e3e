# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Solves several hundred cycles of a path together, before they are due.

While the speed scaling does not change, the cycles up to the end of a section of the path are
known. Solving these cycles together with numpy takes a small fraction of the time for solving
them one by one (:mod:`~.cycle_stepper`), with the same positions up to rounding. Any change
(another scaling, a stop, a new motion, a teleported arm) discards the remaining cycles. If the arm
cannot keep to the time of the path, the cycles are solved one by one.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ur_cartesian_driver.kinematics.inverse_rows import solve_path
from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.pose_rows import (
    compose_rows,
    conjugate_rows,
    multiply_rows,
)
from ur_cartesian_driver.motion.geometry.rotation_rows import log_rows
from ur_cartesian_driver.motion.geometry.vectors import Vector6
from ur_cartesian_driver.sim.motion.arm_target import ArmTarget, TargetRates
from ur_cartesian_driver.sim.motion.paths.path_motion import PathMotion

#: Largest number of cycles in a batch.
_MAX_CYCLES = 384
#: Smallest number of cycles in a batch: numpy is slow for short batches.
_MIN_CYCLES = 12
#: Number of cycles that are solved one by one after a batch could not be solved.
_BACK_OFF = 50


class CycleStep(NamedTuple):
    """The next target of a motion, and the path time [s] by which the motion advances."""

    q: Vector6
    pose: Pose
    duration: float
    #: Speeds and accelerations, if they are known already.
    rates: TargetRates | None = None


class CycleBatch:
    """
    The solved cycles of the path that an arm follows.

    :param target: the target of the arm.
    """

    def __init__(self, target: ArmTarget) -> None:
        """Begin without solved cycles."""
        self._target = target
        #: The solved cycles, last first: joints, pose, rates, time in the section of the path [s].
        self._cycles: list[list[float]] = []
        #: The motion for which the cycles were solved.
        self._motion: PathMotion | None = None
        #: For which the cycles were solved: index of the section, path time per cycle [s] and
        #: bound on the tool speed [m/s].
        self._solved_for = (0, 0.0, 0.0)
        #: Whether the cycles were solved by inverse kinematics.
        self.on_tool_path = False
        #: The joints of the last cycle that :meth:`next` returned.
        self._q: Vector6 = target.q
        #: Number of cycles to wait before the next attempt to solve a batch.
        self._back_off = 0

    def next(self, motion: PathMotion, duration: float, max_tool_speed: float) -> CycleStep | None:
        """
        Advance a motion by its next solved cycle, and return the cycle's target.

        If no cycle is solved, return None; the caller has to solve the cycle.

        :param duration: the path time per cycle [s].
        :param max_tool_speed: bound on the tool speed [m/s].
        """
        target, asked = self._target, (motion.index, duration, max_tool_speed)
        if self._motion is not motion or self._solved_for != asked:
            # Solve only after two equal calls: while the scaling changes, a batch would be
            # discarded in the next cycle.
            self._motion, self._solved_for, self._cycles, self._back_off = motion, asked, [], 0
            return None
        if not self._cycles or self._q is not target.q or not target.tcp_is_active:
            if self._back_off == 0:
                self._cycles = self._solve(motion, duration, max_tool_speed)
                self._back_off = _BACK_OFF
            if not self._cycles:
                self._back_off -= 1
                return None
            self._back_off = 0
        cycle: Any = tuple(self._cycles.pop())
        motion.time = cycle[31]
        self._q = q = cycle[:6]
        pose = Pose(cycle[6:9], cycle[9:13])
        rates = TargetRates(cycle[13:19], cycle[19:25], cycle[25:31])
        return CycleStep(q, pose, duration, rates)

    def _solve(
        self, motion: PathMotion, duration: float, max_tool_speed: float
    ) -> list[list[float]]:
        """Return the next cycles of the section, up to the first that the arm cannot follow."""
        target, section = self._target, motion.sections[motion.index]
        stands = section.profile.length <= 0.0
        if stands or duration <= 0.0 or not target.tcp_is_active:
            return []
        count = min(int((motion.next_change - motion.time) / duration) - 1, _MAX_CYCLES)
        if count < _MIN_CYCLES:
            return []
        # The times are summed one by one, so that they are rounded as in single cycles.
        times = np.add.accumulate([motion.time, *([duration] * count)])[1:]
        setpoints = section.path.rows(section.offset + section.profile.rows(times))
        self.on_tool_path = setpoints.shape[1] == 7
        if self.on_tool_path:
            poses, found = (
                setpoints,
                solve_path(
                    target.arm,
                    compose_rows(setpoints, target.T_tcp_flange),
                    target.q,
                    skip_gaps=False,
                ),
            )
            q = np.concatenate([[target.q], found.q])
        else:
            q = np.concatenate([[target.q], setpoints])
            poses = compose_rows(target.arm.forward_rows(setpoints), target.T_flange_tcp)
        poses = np.concatenate([[target.T_base_tcp.row()], poses])
        kept = target.kinematics.kept_rows(q, self.on_tool_path)
        travel = np.linalg.norm(np.diff(poses[:, :3], axis=0), axis=1)
        kept &= travel <= max_tool_speed * target.cycle
        count = len(kept) if kept.all() else int(np.argmin(kept))
        return self._as_cycles(q[: count + 1], poses[: count + 1], times[:count])

    def _as_cycles(self, q: Floats, poses: Floats, times: Floats) -> list[list[float]]:
        """Return cycles with their rates, last first; row 0 of the inputs is the present state."""
        rate = 1.0 / self._target.cycle
        qd = rate * np.diff(q, axis=0)
        qdd = rate * np.diff(qd, axis=0, prepend=np.array([self._target.qd]))
        turns = log_rows(multiply_rows(poses[1:, 3:], conjugate_rows(poses[:-1, 3:])))
        travel = np.diff(poses[:, :3], axis=0)
        columns = (q[1:], poses[1:], qd, qdd, rate * travel, rate * turns, times[:, None])
        cycles: list[list[float]] = np.concatenate(columns, axis=1)[::-1].tolist()
        return cycles
