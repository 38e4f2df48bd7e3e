# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Joint positions of every cycle, and measures of the motion that they record."""

from itertools import pairwise

from fault_goals import ARM
import numpy as np
from robot_cell import CYCLE

from ur_cartesian_driver.motion.geometry.pose import pose_from_row


class JointTrace:
    """Joint positions of every cycle [rad]."""

    def __init__(self, cell):
        self.cell, self.rows = cell, []

    async def until(self, condition, bound):
        """Record until a condition holds; fail if it does not hold within a bound [s]."""
        end = self.cell.loop.time() + bound
        while not condition():
            assert self.cell.loop.time() < end, self.cell.owner.log
            self.rows.append(self.cell.q)
            await self.cell.sleep(CYCLE)

    def max_speed_and_acceleration(self):
        """Return the largest speed and acceleration of a joint [rad/s], [rad/s^2]."""
        speeds = [
            [(b - a) / CYCLE for a, b in zip(*pair, strict=True)] for pair in pairwise(self.rows)
        ]
        changes = [
            abs(b - a) / CYCLE for pair in pairwise(speeds) for a, b in zip(*pair, strict=True)
        ]
        return max(abs(v) for row in speeds for v in row), max(changes)

    def max_path_deviation(self, goal):
        """Return the largest distance of the tool from the planned paths of a goal [m]."""
        flange = ARM.forward_rows(np.array(self.rows))
        tool = np.array(
            [(pose_from_row(row) @ goal.plan.T_flange_active).position for row in flange]
        )
        paths = [path.poses[:, :3] for path in goal.paths()]
        begin, end = (
            np.concatenate([path[part] for path in paths])
            for part in (slice(None, -1), slice(1, None))
        )
        segment = end - begin
        square = np.maximum((segment**2).sum(axis=1), 1e-18)
        at = np.clip(((tool[:, None] - begin) * segment).sum(axis=2) / square, 0.0, 1.0)
        off = tool[:, None] - begin - at[..., None] * segment
        return float(np.sqrt((off**2).sum(axis=2).min(axis=1)).max())
